"""The replay's data as compact JSON: typed arrays in base64, meshes quantised to 16 bits."""

import base64
import json
from collections.abc import Iterable
from typing import Any

import numpy as np
from jaxtyping import Float64, Int, Shaped

from poise.apps.report._record import Geometry, Replay, RunSignals

_QUATERNION_SCALE = np.iinfo(np.int16).max
"""A quaternion's parts as 16-bit integers: wrong by at most 2e-5."""
_STEPS = np.iinfo(np.uint16).max
"""Steps between a mesh's least and greatest coordinate: a hundredth of a millimetre on a body."""


def replay_json(run: RunSignals, replay: Replay) -> str:
    """Everything the page's 3D replay draws, as one JSON object that is safe inside a script."""
    # The tick nearest to each frame.
    ticks = np.rint(np.interp(replay.time, run.time, np.arange(len(run.time)))).astype(int)
    last = float(run.time[-1])
    payload = {
        "bodies": replay.position.shape[1],
        "time": _floats(replay.time),
        "position": _floats(replay.position),
        "quaternion": _encode(np.round(replay.quaternion * _QUATERNION_SCALE).astype("<i2")),
        "com": _floats(run.com[ticks]),
        "zmp": _floats(run.zmp[ticks]),
        **shapes_payload(replay.geometries),
        "phases": [
            {
                "start": phase.start,
                "end": min(phase.end, last),
                "vertices": [_short(v) for v in phase.vertices],
            }
            for phase in run.support
        ],
        "forces": [
            {"name": f.name, "kind": f.kind, "point": _floats(f.point), "force": _floats(f.force)}
            for f in replay.forces
        ],
        "markers": [{"name": n, "position": _floats(p)} for n, p in replay.markers.items()],
        "events": [{"time": e.time, "duration": e.duration, "label": e.label} for e in run.events],
    }
    text = json.dumps(payload, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")


def shapes_payload(geometries: Iterable[Geometry]) -> dict[str, list[dict[str, Any]]]:
    """Return the bodies of `scene.js` as JSON can hold them; shared meshes are there once."""
    meshes: dict[bytes, dict[str, Any]] = {}
    placed: list[dict[str, Any]] = []
    for geometry in geometries:
        entry: dict[str, Any] = {"body": geometry.body, "shape": geometry.shape}
        for name in ("size", "position", "quaternion", "rgba"):
            entry[name] = _short(getattr(geometry, name))
        if geometry.vertices is not None and geometry.faces is not None:
            key = geometry.vertices.tobytes() + geometry.faces.tobytes()
            if key not in meshes:
                meshes[key] = _mesh(geometry.vertices, geometry.faces)
            entry["mesh"] = list(meshes).index(key)
        placed.append(entry)
    return {"geometries": placed, "meshes": list(meshes.values())}


def _mesh(
    vertices: Float64[np.ndarray, "nvert 3"], faces: Int[np.ndarray, "nface 3"]
) -> dict[str, Any]:
    low = vertices.min(axis=0)
    step = np.maximum(np.ptp(vertices, axis=0) / _STEPS, 1e-12)  # [m]
    wide = len(vertices) > _STEPS
    return {
        "low": _short(low, 9),
        "step": [float(s) for s in step],
        "vertices": _encode(np.round((vertices - low) / step).astype("<u2")),
        "faces": _encode(faces.astype("<u4" if wide else "<u2")),
        "wide": wide,
    }


def _short(values: Any, digits: int = 6) -> list[float]:
    """Plain numbers, rounded to the replay's resolution."""
    return [round(float(v), digits) for v in values]


def _floats(values: Float64[np.ndarray, "..."]) -> str:
    return _encode(values.astype("<f4"))


def _encode(values: Shaped[np.ndarray, "..."]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
