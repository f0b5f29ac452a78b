"""`run`: G1 stands and walks while a scripted client of the balance service swings its arms."""

from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin
from jaxtyping import Float64

import poise.apps.balance as balance
from poise.dynamics import RobotState
from poise.estimation import PayloadEstimator, StateEstimator
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, rollout
from studies.plan import StudyOptions
from studies.trial_section import Bound, Case, TrialSection, worst

PERIOD, INTERVAL, LOOK = 0.002, 10, 25
"""Control period [s]; ticks between two messages of the client, 50 Hz, and two distances."""

SWINGS = {
    "shoulder_pitch": (1.0, 0.50, 0.0),
    "shoulder_roll": (0.15, 0.37, 0.15),
    "elbow": (0.5, 0.50, 0.0),
}
"""Amplitude [rad], frequency [Hz] and offset outwards [rad] of each joint: incommensurable but for
shoulder and elbow, which together move the hand by 1 m/s."""

COMMANDS = np.array([0.3, 0.1, 0.3])
"""Largest velocities of the walk, drawn anew every `HELD` seconds [m/s, m/s, rad/s]."""

HELD = 5.0

LATE = 0.1
"""Bound on the tracking error [m]: at 1 m/s a message's interval of 20 ms, the model's acceleration
and the joints' feedback of 1 / sqrt(150) s = 82 ms."""


@dataclass(frozen=True, kw_only=True)
class Swing:
    """One trial."""

    walks: bool  # velocities are commanded, drawn at random
    seconds: float  # duration
    load: float = 0.0  # in each hand [kg]
    seed: int = 0  # of sensors and velocities


@dataclass(frozen=True, kw_only=True)
class Swung:
    """Outcome of a trial."""

    fell: bool  # whether the robot fell
    seconds: float  # until the end or the fall
    steps: int  # touchdowns
    speed: float  # largest of the left hand in the torso's frame [m/s]
    error: float  # of the left hand from its command in the torso's frame, root mean square [m]
    worst: float  # the largest [m]
    distance: float  # least between an arm and the rest of the robot, by its collision geometry [m]
    refused: int  # messages


def targets(robot: Robot, time: float) -> dict[str, float]:
    """Return positions of the arms' joints at a time [rad]."""
    found: dict[str, float] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for name, (size, frequency, offset) in SWINGS.items():
            joint = f"{side}_{name}_joint"
            wave = size * np.sin(2.0 * np.pi * frequency * time)
            way = sign * (wave + offset)
            home = float(robot.q_home[7 + robot.joint_index(joint)])
            found[joint] = home + (-way if name == "elbow" else way)
    return found


def run_swing(trial: Swing) -> Swung:
    """Run one trial."""
    robot, rng = load_robot("g1"), np.random.default_rng(trial.seed)
    loads = tuple(PlantConfig.Payload(frame=h, mass=trial.load) for h in robot.hands if trial.load)
    config = PlantConfig(control_dt=PERIOD, self_contact=True, payloads=loads)
    plant = Plant(robot, config.with_noise(), seed=trial.seed)
    leader = balance.BalanceLeader(robot, dt=PERIOD)
    estimator = StateEstimator(robot, payload=PayloadEstimator(robot))
    hand, pairs = _Hand(robot), arm_pairs(plant)
    velocity, errors, speed, distance = np.zeros(3), [0.0], 0.0, np.inf
    for tick in rollout(
        plant, leader.controller(), leader, estimator=estimator, duration=trial.seconds
    ):
        if trial.walks and tick.index % round(HELD / PERIOD) == round(1.0 / PERIOD):
            velocity = COMMANDS * rng.uniform((-0.3, -1.0, -1.0), 1.0)
        if tick.index % INTERVAL == 0:
            ahead, left, turn = velocity.tolist()
            message = balance.Targets(
                time=tick.time + PERIOD,
                velocity=(ahead, left, turn),
                joints=targets(robot, tick.time),
            )
            leader.take(message)
        if tick.index % LOOK:
            continue
        distance = min(distance, nearest(plant, pairs))
        place, rate = hand.motion(tick.truth)
        speed = max(speed, rate)
        if tick.time > 1.0:
            wanted, _ = hand.motion(_commanded(robot, tick.time + PERIOD))
            errors.append(float(np.linalg.norm(place - wanted)))
    return Swung(
        fell=plant.fallen,
        seconds=plant.time,
        steps=leader.walker.steps_made,
        speed=speed,
        error=float(np.sqrt(np.mean(np.square(errors)))),
        worst=max(errors),
        distance=distance,
        refused=leader.refused,
    )


class _Hand:
    """Motion of the left hand in the torso's frame."""

    def __init__(self, robot: Robot) -> None:
        self._model, self._data = robot.model, robot.model.createData()
        self._hand, self._torso = robot.frame_id(robot.hands[0]), robot.frame_id(robot.torso)

    def motion(self, state: RobotState) -> tuple[Float64[np.ndarray, "3"], float]:
        """Return place [m] and speed [m/s]."""
        pin.forwardKinematics(self._model, self._data, state.q, state.v)
        pin.updateFramePlacements(self._model, self._data)
        torso, hand = (self._data.oMf[frame] for frame in (self._torso, self._hand))
        of_hand, of_torso = (
            pin.getFrameVelocity(self._model, self._data, frame, pin.LOCAL_WORLD_ALIGNED)
            for frame in (self._hand, self._torso)
        )
        lever = hand.translation - torso.translation
        slip = of_hand.linear - of_torso.linear - np.cross(of_torso.angular, lever)
        return torso.rotation.T @ lever, float(np.linalg.norm(slip))


def _commanded(robot: Robot, time: float) -> RobotState:
    q = robot.q_home.copy()
    for joint, angle in targets(robot, time).items():
        q[7 + robot.joint_index(joint)] = angle
    return RobotState(q, np.zeros(robot.nv))


def arm_pairs(plant: Plant) -> list[tuple[int, int]]:
    """Return pairs of collision geometry of an arm and another part that may touch."""
    model, arms = plant.model, dict[int, str]()
    for body in range(model.nbody):
        name = model.body(body).name
        if any(part in name for part in ("shoulder", "elbow", "wrist", "hand")):
            arms[body] = name.split("_")[0]
    excluded = {tuple(sorted((int(s) >> 16, int(s) & 0xFFFF))) for s in model.exclude_signature}
    solid = [g for g in range(model.ngeom) if model.geom_contype[g] and model.geom_bodyid[g] > 0]
    found: list[tuple[int, int]] = []
    for i, one in enumerate(solid):
        for other in solid[i + 1 :]:
            a, b = int(model.geom_bodyid[one]), int(model.geom_bodyid[other])
            apart = arms.get(a) != arms.get(b)
            if apart and tuple(sorted((a, b))) not in excluded:
                found.append((one, other))
    return found


def nearest(plant: Plant, pairs: list[tuple[int, int]]) -> float:
    """Return the least distance of pairs of geometry, no more than 0.05 m [m]."""
    far = 0.05
    found = (mujoco.mj_geomDistance(plant.model, plant.data, i, j, far, None) for i, j in pairs)
    return min(found, default=far)


def _cases(options: StudyOptions) -> list[Case]:
    seconds = 10.0 if options.quick else 300.0
    return [
        Case(
            name="walking" if walks else "standing",
            trials=[Swing(walks=walks, seconds=seconds, seed=options.first_seed)],
            bounds=(
                Bound(name="tracking error of the hand", value=worst("error"), most=LATE, unit="m"),
                Bound(
                    name="depth of an arm in the body",
                    value=lambda outcomes: -min(o.distance for o in outcomes),
                    most=0.0,
                    unit="m",
                ),
            ),
        )
        for walks in (False, True)
    ]


balance_section = TrialSection(
    title="Arms that swing",
    prose=(
        "A client of the balance service swings both arms against each other with up to 1 m/s of "
        "hand speed, 50 messages a second, while the robot stands, and while it walks by "
        "velocities drawn anew every 5 s. Sensors have noise, the base is estimated.",
    ),
    run=run_swing,
    kind=Swung,
    cases=_cases,
    columns={
        "time [s]": worst("seconds"),
        "steps": worst("steps"),
        "hand speed, most [m/s]": worst("speed"),
        "error, root mean square [mm]": worst("error", 1e3),
        "error, most [mm]": worst("worst", 1e3),
        "distance, least [mm]": lambda outcomes: 1e3 * min(o.distance for o in outcomes),
    },
)
"""The section of the balance service."""


def run(quick: bool = False) -> dict[str, Swung]:
    """Run the trials one after another.

    Args:
        quick: 10 s of each instead of five minutes.

    Returns:
        Outcomes by the name of their case.
    """
    cases = _cases(StudyOptions(quick=quick))
    return {case.name: run_swing(trial) for case in cases for trial in case.trials}
