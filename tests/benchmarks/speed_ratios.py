"""Ratios of the time of a tick on G1 to that of Pinocchio and of plain Python, as JSON.

python -m tests.benchmarks.speed_ratios

Each tick is followed by Pinocchio's two passes over its state, `crba` and `nonLinearEffects`, into
one `Data`, and by a fixed piece of Python and NumPy, all by processor time of the thread. A run is
cut into blocks of ticks, and gone through several times. Of each block the best of the 10th
percentiles counts, which leaves out whatever else the machine did, and the ratio is that of their
means, so that all phases of a step have their share.

`ratio` is the time over that of Pinocchio's passes, which compare with other libraries. From one
machine to another it differs by a quarter, since compiled code slows down more than Python on a
busy core. `guarded` is over the passes and the piece together.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from time import thread_time_ns

import numpy as np
import pinocchio as pin

from benchmarks.clocked import collector_paused
from benchmarks.recording import Recording, record_run
from benchmarks.teleop import Replayed, Walk, WalkTick, record_walk
from poise.apps.scenarios import load_scenario, stage_scenario
from poise.control import Controller, WholeBodyController
from poise.dynamics import RobotState
from poise.robots import Robot, load_robot
from poise.sim import Estimator, rollout
from poise.stack import Leader, SelfCollisionLimit, Stack, default_stack

PASSES = 3
BLOCK = 50
"""Ticks: a tenth of them is enough for a percentile, and a phase of a step has several blocks."""

TICKS = {"tick": 300, "step teleoperator": 1000, "walker": 1400}
"""Whole blocks. The last two, 2 and 1.4 s, go through both double and single support."""

Ticks = Iterator[tuple[int, RobotState]]
"""Processor time [ns] and state of each tick."""


def controller_ticks(recording: Recording, stack: Stack) -> Ticks:
    controller = WholeBodyController(recording.robot, stack)
    recording.prepare(stack)
    for i, state in enumerate(recording.states):
        recording.aim(stack, i)
        begin = thread_time_ns()
        command = controller.step(state)
        yield thread_time_ns() - begin, state
        assert command.status.ok, f"tick {i}: {command.status}"


def leader_ticks(
    states: Sequence[RobotState], estimator: Estimator, leader: Leader, controller: Controller
) -> Ticks:
    for i, state in enumerate(states):
        begin = thread_time_ns()
        estimate = estimator.update(state)
        leader.lead(estimate)
        yield thread_time_ns() - begin, state
        command = controller.step(estimate)
        if hasattr(estimator, "command"):
            estimator.command(command.acceleration, state.time)
        assert command.status.ok, f"tick {i}: {command.status}"


def with_self_collision_limit(robot: Robot) -> Stack:
    base = default_stack(robot)
    return Stack(
        base.contacts,
        base.levels,
        torque_limit=base.torque_limit,
        self_collision_limit=SelfCollisionLimit(),
    )


def teleoperator_ticks(walk: Walk, recorded: Sequence[WalkTick]) -> Ticks:
    leader = walk.teleoperator()
    leader.device = Replayed(iter([tick.sample for tick in recorded]))
    states = [tick.state for tick in recorded]
    return leader_ticks(states, leader.estimator, leader, leader.controller())


def walker_stage(robot: str):
    return stage_scenario(replace(load_scenario("walk"), robot=robot))


def walker_ticks(robot: str, states: Sequence[RobotState]) -> Ticks:
    stage = walker_stage(robot)
    return leader_ticks(states, stage.estimator, stage.leader, stage.controller)


def record_walker(robot: str, ticks: int) -> list[RobotState]:
    stage = walker_stage(robot)
    duration = ticks * stage.plant.control_dt
    run = rollout(
        stage.plant, stage.controller, stage.leader, estimator=stage.estimator, duration=duration
    )
    return [tick.state for tick in run]


class Sum:
    def __init__(self) -> None:
        self.value = 0.0

    def add(self, value: float) -> float:
        self.value += 0.5 * value
        return self.value


def work_in_python() -> None:
    """Call a method 150 times and NumPy 30 times: what leaders spend most of a tick on."""
    total, found, vector = Sum(), dict[int, float](), np.ones(3)
    for i in range(150):
        found[i & 7] = total.add(i)
    for _ in range(15):
        vector = 0.5 * vector + 1.0


def time_beside_yardsticks(robot: Robot, ticks: Ticks) -> list[tuple[int, int, int]]:
    model, data = robot.model, pin.Data(robot.model)
    times = []
    with collector_paused():
        for spent, state in ticks:
            begin = thread_time_ns()
            pin.crba(model, data, state.q, pin.Convention.WORLD)
            pin.nonLinearEffects(model, data, state.q, state.v)
            between = thread_time_ns()
            work_in_python()
            times.append((spent, between - begin, thread_time_ns() - between))
    return times


def ratio(times: Sequence[Sequence[tuple[int, int, int]]]) -> dict[str, float]:
    blocks = np.reshape(times, (PASSES, -1, BLOCK, 3))
    own, pinocchio, python = 1e-3 * np.percentile(blocks, 10.0, axis=2).min(axis=0).mean(axis=0)
    return {
        "ratio": round(own / pinocchio, 2),
        "guarded": round(own / (pinocchio + python), 3),
        "own_us": round(own, 1),
        "pinocchio_us": round(pinocchio, 2),
        "python_us": round(python, 2),
    }


def measure() -> dict[str, dict[str, float]]:
    robot = load_robot("g1")
    standing = record_run(robot, "double", TICKS["tick"])
    walk = Walk.over_an_obstacle(robot, "torque")
    stepping = record_walk(walk, TICKS["step teleoperator"])
    walking = record_walker("g1", TICKS["walker"])
    parts: dict[str, Callable[[], Ticks]] = {
        "tick": lambda: controller_ticks(standing, default_stack(robot)),
        "tick with self-collision limit": lambda: controller_ticks(
            standing, with_self_collision_limit(robot)
        ),
        "step teleoperator's leader and estimator": lambda: teleoperator_ticks(walk, stepping),
        "walker's leader and estimator": lambda: walker_ticks("g1", walking),
    }
    times = {name: [] for name in parts}
    for _ in range(PASSES):
        for name, ticks in parts.items():
            times[name].append(time_beside_yardsticks(robot, ticks()))
    return {name: ratio(passes) for name, passes in times.items()}


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
