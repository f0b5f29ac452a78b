"""Records of runs that never happened, with the shape of those that do."""

from itertools import pairwise

import numpy as np

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
    legs = [f"{s}_{j}" for s in ("left", "right") for j in LEG]
    arms = [f"{s}_{j}" for s in ("left", "right") for j in ARM]
    named = [*legs, "waist_yaw", "waist_pitch", "waist_roll", *arms, "head_yaw", "head_pitch"]
    return tuple([*named, *(f"extra_{i}" for i in range(n))][:n])


LEG = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
ARM = (
    "shoulder_pitch",
    "shoulder_roll",
    "shoulder_yaw",
    "elbow",
    "forearm_yaw",
    "wrist_pitch",
    "wrist_roll",
    "hand_yaw",
)


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
    left_on, right_on = feet["left"][1], feet["right"][1]
    code = left_on.astype(int) + 2 * right_on.astype(int)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(code)) + 1, [len(code)]])
    phases = []
    for a, b in pairwise(edges):
        on = [feet[s][0][a] for s, bit in (("left", 1), ("right", 2)) if code[a] & bit]
        corners = np.concatenate([rectangle(p[0], p[1]) for p in on]) if on else np.zeros((0, 2))
        end = time[b] if b < len(time) else time[-1]
        phases.append(
            SupportPhase(
                start=float(time[a]),
                end=float(end),
                vertices=hull(corners),
            )
        )
    return tuple(phases)


def hull(points):
    if len(points) < 3:
        return points
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).vertices]


def replay_of(time, com, feet, forces, mesh=None):
    """A simple figure of boxes and capsules that walks with the feet and the COM."""
    frames = np.unique(
        np.linspace(0, len(time) - 1, max(1, round((time[-1] - time[0]) * 30) + 1)).astype(int)
    )
    t = time[frames]
    names = ["pelvis", "torso", "head"]
    places = [com[frames], com[frames] + [0, 0, 0.35], com[frames] + [0, 0, 0.72]]
    geometries = [
        Geometry(body=0, shape="box", size=(0.09, 0.14, 0.08), rgba=(0.25, 0.3, 0.36, 1)),
        Geometry(body=1, shape="box", size=(0.1, 0.17, 0.22), rgba=(0.86, 0.88, 0.9, 1)),
        Geometry(body=2, shape="ellipsoid", size=(0.09, 0.08, 0.12), rgba=(0.25, 0.3, 0.36, 1)),
    ]
    turns = [np.tile([0.0, 0, 0, 1], (len(t), 1)) for _ in names]
    for side, y in (("left", 0.1), ("right", -0.1)):
        foot = feet[side][0][frames]
        hip = com[frames] + [0, y - 0.0, -0.06]
        knee = 0.5 * (foot + hip) + [0.06, 0, 0.03]
        elements = [(hip, knee, 0.062), (knee, foot + np.array([0, 0, 0.08]), 0.05)]
        shoulder = com[frames] + [0, 1.9 * y, 0.5]
        swing = 0.25 * np.sin(np.pi * t / STEP + (0 if side == "left" else np.pi))
        elbow = shoulder + np.stack([swing - 0.05, 0.4 * y + 0 * t, -0.28 + 0 * t], axis=1)
        hand = elbow + np.stack([swing + 0.12, 0 * t, -0.22 + 0 * t], axis=1)
        elements += [(shoulder, elbow, 0.045), (elbow, hand, 0.038)]
        for a, b, radius in elements:
            body = len(names)
            names.append(f"{side}_{body}")
            places.append(0.5 * (a + b))
            turns.append(aligned(b - a))
            half = 0.5 * float(np.linalg.norm(b - a, axis=1).mean())
            geometries.append(
                Geometry(body=body, shape="capsule", size=(radius, half - 0.3 * radius))
            )
            geometries.append(
                Geometry(
                    body=body,
                    shape="sphere",
                    size=(1.18 * radius,),
                    position=np.array([0, 0, half]),
                    rgba=(0.25, 0.3, 0.36, 1),
                )
            )
        body = len(names)
        names.append(f"{side}_foot")
        places.append(foot + np.array([0, 0, 0.03]))
        turns.append(np.tile([0.0, 0, 0, 1], (len(t), 1)))
        geometries.append(
            Geometry(body=body, shape="box", size=(0.12, 0.055, 0.03), rgba=(0.3, 0.3, 0.3, 1))
        )
    if mesh is not None:
        geometries.append(
            Geometry(body=1, shape="mesh", vertices=mesh[0], faces=mesh[1], rgba=(0.9, 0.5, 0.2, 1))
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
        quaternion=np.stack(turns, axis=1),
        geometries=tuple(geometries),
        forces=tuple(tracks),
        markers={"left hand target": target},
    )


def ball_mesh(rings=24, radius=0.5):
    """A ball of triangles."""
    polar, around = np.meshgrid(
        np.linspace(0.01, np.pi - 0.01, rings), np.linspace(0, 2 * np.pi, rings), indexing="ij"
    )
    sine = np.sin(polar)
    places = [sine * np.cos(around), sine * np.sin(around), np.cos(polar)]
    vertices = radius * np.stack(places, axis=-1).reshape(-1, 3)
    first = (np.arange(rings - 1)[:, None] * rings + np.arange(rings - 1)).ravel()
    lower = np.stack([first, first + rings, first + 1], axis=1)
    upper = np.stack([first + 1, first + rings, first + rings + 1], axis=1)
    return vertices, np.concatenate([lower, upper])


def aligned(v):
    """Quaternion (x, y, z, w) that turns z to each direction."""
    d = v / np.linalg.norm(v, axis=1, keepdims=True)
    q = np.stack([-d[:, 1], d[:, 0], 0 * d[:, 0], 1 + d[:, 2]], axis=1)
    flipped = np.linalg.norm(q, axis=1) < 1e-6
    q[flipped] = [1.0, 0, 0, 0]
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def walking_record(duration=6.0, rate=250.0, joints=33, seed=3, mesh=None, **changes):
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
    tasks = (
        TaskTrack(
            name="com",
            level=0,
            unit="m",
            error=np.linalg.norm(com_error, axis=1),
        ),
        TaskTrack(
            name="swing foot",
            level=0,
            unit="m",
            error=0.004 + 0.003 * np.abs(np.sin(np.pi * time / STEP)),
        ),
        TaskTrack(
            name="pelvis orientation", level=0, unit="rad", error=0.01 + 0.08 * kick + 0 * time
        ),
        TaskTrack(name="left hand", level=1, unit="m", error=hand_error),
        TaskTrack(
            name="posture",
            level=2,
            unit="rad",
            error=0.4 + 0.1 * np.sin(time),
        ),
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
        "level_names": ("contacts, dynamics", "COM, pelvis, feet", "hands, posture"),
        "status": tuple(status),
        "tick_us": tick,
        "tick_budget_us": 1000.0,
        "events": (
            Event(time=0.4 * STEP, label="left foot released"),
            Event(time=2.0, label="push 120 N on torso", duration=0.15),
            Event(time=3.0, label="left hand target"),
        ),
        "checks": (
            Check(name="COM error after 1 s", value=0.0312, bound=0.04, unit="m", ok=True),
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
        "replay": replay_of(time, com, feet, forces, mesh),
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
