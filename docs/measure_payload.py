"""How far the CoM is off with loads nobody told of: the table of estimation_loads.md.

python docs/measure_payload.py [ROBOT ...]
"""

import sys
from dataclasses import dataclass

import numpy as np

import poise
from poise.dynamics import Dynamics, RobotState
from poise.estimation import PayloadEstimator, StateEstimator
from poise.sim import PlantConfig, SensorConfig

PERIOD, SECONDS, SETTLED = 0.002, 8.0, 5.0
"""Of the controller; how long a robot stands, and from when on it counts [s]."""

SWING, RISE, RATE = 0.15, 0.1, 2.0
"""How far moving hands go to and fro and up and down [m], and their angular frequency [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A robot that is not as its description says.

    Attributes:
        scale: of all its masses.
        load: mass of what it carries [kg].
        part: what carries it, "hand" or "torso".
        moves: whether its hands move.
    """

    scale: float = 1.0
    load: float = 0.0
    part: str = "hand"
    moves: bool = False


CASES = {
    "as described": Case(),
    "20% lighter": Case(scale=0.8),
    "20% heavier": Case(scale=1.2),
    "3 kg in a hand": Case(load=3.0),
    "3 kg at the trunk": Case(load=3.0, part="torso"),
    "hands move": Case(moves=True),
    "hands move, 1 kg in one": Case(load=1.0, moves=True),
}


class Hands:
    """A leader of the default stack that moves its hands to and fro, or does not."""

    def __init__(self, robot: poise.Robot, moves: bool) -> None:
        self.stack, self._moves = poise.default_stack(robot), moves
        home = Dynamics(robot)
        home.update(RobotState(robot.q_home, np.zeros(robot.nv)))
        self.com = home.com
        self._hands = [
            (self.stack.task(f"{hand} pose"), home.placement(robot.frame_id(hand))[0])
            for hand in robot.hands
        ]

    def lead(self, state: RobotState) -> None:
        """Where hands shall be now."""
        if self._moves:
            angle = RATE * state.time
            way = np.array([SWING * np.sin(angle), 0.0, RISE * np.sin(2.0 * angle)])
            for task, place in self._hands:
                task.set_target(place + way)


def errors(robot: poise.Robot, case: Case, *, known: bool) -> tuple[float, float]:
    """Mean error of the CoM along the ground and of its height [mm]; NaN for a robot that fell."""
    frame = robot.hands[0] if case.part == "hand" else robot.torso
    loads = (PlantConfig.Payload(frame=frame, mass=case.load),) if case.load else ()
    config = PlantConfig(
        control_dt=PERIOD,
        sensors=SensorConfig.typical(),
        mass_scale=case.scale,
        payloads=loads,
    )
    plant, leader = poise.Plant(robot, config, seed=1), Hands(robot, case.moves)
    controller = poise.WholeBodyController(robot, leader.stack)
    estimator = StateEstimator(robot, payload=PayloadEstimator(robot) if known else None)
    off = [
        plant.com - leader.com
        for tick in poise.rollout(plant, controller, leader, estimator=estimator, duration=SECONDS)
        if tick.state.time > SETTLED
    ]
    if plant.fallen or not off:
        return np.nan, np.nan
    along = np.linalg.norm(np.array(off)[:, :2], axis=1)
    return 1e3 * float(along.mean()), 1e3 * float(np.abs(np.array(off)[:, 2]).mean())


def main() -> None:
    """Prints the table."""
    names = sys.argv[1:] or ["g1", "humanoid33"]
    robots = [poise.load_robot(name) for name in names]
    print("| | " + " | ".join(f"{name}, horizontal | height" for name in names) + " |")
    print("| --- |" + " --- | --- |" * len(names))
    for label, case in CASES.items():
        cells: list[str] = []
        for robot in robots:
            without, with_it = (errors(robot, case, known=known) for known in (False, True))
            cells += [f"{a:.1f}, {b:.1f}" for a, b in zip(without, with_it, strict=True)]
        print(f"| {label} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
