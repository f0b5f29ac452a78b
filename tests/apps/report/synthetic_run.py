"""Records of runs that never happened, with the shape of those that do."""

from itertools import pairwise

import numpy as np
from scipy.spatial import ConvexHull

from poise.apps.report import (
    Check,
    Event,
    ForceTrack,
    Geometry,
    Replay,
    RunSignals,
    SoleTrack,
    SupportPhase,
    TaskTrack,
)
from poise.apps.scenarios._signals import zmp_margins

STEP = 0.8  # [s]
STRIDE = 0.18  # [m]


def rectangle(x, y, length=0.24, width=0.12):
    half = 0.5 * np.array([length, width])
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return np.array([x, y]) + corners * half


def joint_names(n):
    parts = ("hip_yaw", "hip_pitch", "knee", "ankle", "shoulder", "elbow", "wrist")
    named = [f"{side}_{part}" for part in parts for side in ("left", "right")]
    return tuple([*named, "waist_yaw", "head_yaw", *(f"extra_{i}" for i in range(n))][:n])


def foot_places(time):
    """Where each foot is, and whether it is on the ground, for a walk of alternating steps."""
    number = np.floor(time / STEP).astype(int)
    share = time / STEP - number
    feet = {}
    for side, parity, y in (("left", 0, 0.1), ("right", 1, -0.1)):
        # This foot swings in the last 60% of every step whose number has its parity.
        swings = (number % 2 == parity) & (share > 0.4)
        done = (number + 1 - parity) // 2 if parity == 0 else number // 2
        base = STRIDE * 2.0 * done
        progress = np.where(swings, (share - 0.4) / 0.6, 0.0)
        x = base + 2.0 * STRIDE * progress * (3 - 2 * progress) * progress
        z = 0.08 * np.sin(np.pi * progress)
        feet[side] = (np.stack([x, np.full_like(x, y), z], axis=1), ~swings)
    return feet


def support_phases(time, feet):
    code = feet["left"][1].astype(int) + 2 * feet["right"][1].astype(int)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(code)) + 1, [len(code)]])
    phases = []
    for a, b in pairwise(edges):
        on = [feet[s][0][a] for s, bit in (("left", 1), ("right", 2)) if code[a] & bit]
        corners = np.concatenate([rectangle(p[0], p[1]) for p in on])
        phases.append(
            SupportPhase(
                start=float(time[a]),
                end=float(time[min(b, len(time) - 1)]),
                vertices=corners[ConvexHull(corners).vertices],
            )
        )
    return tuple(phases)


def replay_of(time, com, feet, forces):
    """A pelvis, a trunk and two feet, all boxes, that walk with the feet and the CoM."""
    frames = np.unique(
        np.linspace(0, len(time) - 1, max(1, round((time[-1] - time[0]) * 30) + 1)).astype(int)
    )
    t, up = time[frames], np.array([0.0, 0.0, 0.35])
    places = [com[frames], com[frames] + up, *(feet[s][0][frames] for s in feet)]
    sizes = [(0.09, 0.14, 0.08), (0.1, 0.17, 0.22), *[(0.12, 0.055, 0.03)] * 2]
    boxes = (
        Geometry(body=body, shape="box", size=size, rgba=(0.2 * body, 0.5, 0.7, 1))
        for body, size in enumerate(sizes)
    )
    push = np.zeros((len(t), 3))
    push[(t > 2.0) & (t < 2.15)] = [0, -120, 0]
    tracks = [
        ForceTrack(
            name=f"{side}_sole",
            point=feet[side][0][frames],
            force=np.stack([0.02 * f, 0.01 * f, f], axis=1),
        )
        for side, f in ((s, forces[s][frames]) for s in forces)
    ]
    tracks.append(ForceTrack(name="push", kind="push", point=places[1], force=push))
    target = np.tile([0.5, 0.4, 1.2], (len(t), 1)) + [1, 0, 0] * com[frames, :1]
    target[t < 3.0] = np.nan
    return Replay(
        time=t,
        position=np.stack(places, axis=1),
        quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (len(t), len(places), 1)),
        geometries=tuple(boxes),
        forces=tuple(tracks),
        markers={"left hand target": target},
    )


def walking_record(duration=6.0, rate=250.0, joints=33, seed=3, **changes):
    """A robot that walks forward, is pushed at 2 s and reaches with its left hand from 3 s."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(duration * rate)) / rate
    ticks = len(time)
    feet = foot_places(time)
    com = np.stack(
        [
            STRIDE * time / STEP + 0.02 * np.sin(2 * np.pi * time / STEP),
            -0.045 * np.sin(np.pi * time / STEP + 0.5),
            0.88 + 0.012 * np.cos(2 * np.pi * time / STEP),
        ],
        axis=1,
    )
    reference = com + 0.004 * np.sin(3 * time)[:, None]
    kick = np.exp(-np.maximum(time - 2.0, 0) / 0.4) * (time >= 2.0)
    com[:, 1] -= 0.03 * kick
    zmp = com[:, :2] + 0.03 * rng.normal(size=(ticks, 2)).cumsum(axis=0) / np.sqrt(ticks)
    zmp[:, 1] += -0.05 * np.sin(np.pi * time / STEP + 0.5)
    zmp += 0.002 * rng.normal(size=(ticks, 2))
    weight = 100.0 * 9.81
    share = 0.5 + 0.5 * np.tanh(6 * np.sin(np.pi * time / STEP + 0.4))
    forces = {
        "left": weight * np.where(feet["left"][1], np.where(feet["right"][1], share, 1), 0),
        "right": weight * np.where(feet["right"][1], np.where(feet["left"][1], 1 - share, 1), 0),
    }
    for f in forces.values():
        f += 8 * rng.normal(size=ticks) * (f > 0)
    phase = rng.uniform(0, 2 * np.pi, joints)
    size = rng.uniform(0.05, 0.6, joints)
    wave = np.sin(np.pi * time[:, None] / STEP + phase)
    torque_max = rng.choice([40.0, 90.0, 250.0], joints)
    torque = torque_max * (size * wave + 0.02 * rng.normal(size=(ticks, joints)))
    torque[:, 3 : min(9, joints)] += 0.35 * torque_max[3:9] * kick[:, None]
    reached = np.abs(0.35 * np.exp(-np.maximum(time - 3.0, 0) / 0.3) * (time >= 3.0))
    hand_error = np.where(time < 3.0, np.nan, reached + 0.002)
    com_error = reference - com
    errors = {
        ("com", 0, "m"): np.linalg.norm(com_error, axis=1),
        ("swing foot", 0, "m"): 0.004 + 0.003 * np.abs(np.sin(np.pi * time / STEP)),
        ("pelvis orientation", 0, "rad"): 0.01 + 0.08 * kick,
        ("left hand", 1, "m"): hand_error,
        ("posture", 2, "rad"): 0.4 + 0.1 * np.sin(time),
    }
    tasks = tuple(
        TaskTrack(name=name, level=level, unit=unit, error=error)
        for (name, level, unit), error in errors.items()
    )
    tick = {
        "dynamics": 60 + 4 * rng.gamma(2.0, 1.0, ticks),
        "assembly": 45 + 3 * rng.gamma(2.0, 1.0, ticks),
        "solve": 110 + 12 * rng.gamma(2.0, 1.0, ticks),
        "command": 12 + 1 * rng.gamma(2.0, 1.0, ticks),
    }
    tick["solve"][:: max(ticks // 5, 1)] += 500.0
    status = ["ok"] * ticks
    for i in range(ticks // 2, min(ticks // 2 + 3, ticks)):
        status[i] = "time_limit"
    residuals = np.abs(rng.normal(size=(ticks, 3))) * [1e-10, 1e-8, 0.02]
    residuals[:, 1] += 1e-4 * kick
    fields = {
        "robot": "humanoid33",
        "controller": "whole_body",
        "scenario": "walk",
        "description": "Walks forward with steps of 0.36 m, is pushed sideways with 120 N for "
        "0.15 s, and reaches for a target beside the path.",
        "seed": seed,
        "time": time,
        "joint_names": joint_names(joints),
        "torque": torque,
        "torque_max": torque_max,
        "q": 0.5 * size * wave,
        "position_min": np.full(joints, -0.32),
        "position_max": np.linspace(0.34, 2.0, joints),
        "tasks": tasks,
        "com": com,
        "com_reference": reference,
        "zmp": zmp,
        "zmp_reference": np.full((ticks, 2), np.nan),
        "support": support_phases(time, feet),
        "soles": {f"{s}_sole": sole(forces[s], feet[s][1], feet[s][0]) for s in forces},
        "residuals": residuals,
        "level_names": ("contacts, dynamics", "CoM, pelvis, feet", "hands, posture"),
        "status": tuple(status),
        "tick_us": tick,
        "tick_budget_us": 1000.0,
        "events": (
            Event(time=0.4 * STEP, label="left foot released"),
            Event(time=2.0, label="push 120 N on torso", duration=0.15),
            Event(time=3.0, label="left hand target"),
        ),
        "checks": (
            Check(name="CoM error after 1 s", value=0.0312, bound=0.04, unit="m", ok=True),
            Check(name="ZMP margin", value=0.004, bound=0.0, relation=">=", unit="m", ok=True),
            Check(name="level 1 residual", value=3.2e-10, bound=1e-6, ok=True),
            Check(name="missed ticks", value=3, bound=0, relation="==", ok=False),
        ),
        "summary": {
            "robot": "humanoid33",
            "fell": False,
            "com_error_max_m": 0.0312,
            "torque_ratio_max": 0.953,
            "torque_step_max": 0.1,
            "residual_max": [3.2e-10, 1.1e-4, 0.071],
            "missed_ticks": 3,
            "tick_us": {"p50": 241.0, "p99": 288.0, "max": 770.0},
            "real_time_factor": 2.7,
        },
        "replay": replay_of(time, com, feet, forces),
        "notes": ("No video: this machine has no OpenGL. Install libegl1 or libosmesa6.",),
    }
    fields |= changes
    margin = zmp_margins(fields["time"], fields["zmp"], fields["support"])
    nothing = np.full(len(time), np.nan)
    others = {"targets": {}, "clearance": nothing, "self_contact": nothing, "beyond": nothing}
    return RunSignals(**fields, **others, zmp_margin=margin, modes=())


def sole(force, planned, position=None):
    """A sole with a normal force, on a level floor."""
    wrench = np.zeros((len(force), 6))
    wrench[:, 2] = force
    position = np.zeros((len(force), 3)) if position is None else position
    return SoleTrack(
        position=position, height=position[:, 2], wrench=wrench, planned=planned.astype(float)
    )
