"""`try_out`: a trial in simulation: stand, squat and reach, or hold still on a fixed base."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from poise.apps.scenarios import INTERRUPTED, Run, make_scenario, run_scenario, summarise
from poise.errors import PoiseError, RobotError
from poise.robots import Robot, standing_posture, swings

_DRIFT = 0.01  # [m] of what holds still: less than half the width of the narrowest soles
_PART = 0.85  # of a motion that counts as all of it


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """One thing tried."""

    name: str  # "stand", "squat", "hold" or "reach"
    ok: bool  # whether it went well
    # the checks that failed and what happened before; after a fall the fall alone
    words: tuple[str, ...]
    weakest: str  # the joint whose torque came nearest to its limit
    figures: dict[str, Any]  # those of the run, as its `summary.json` has them


@dataclass(frozen=True)
class Tryout:
    """Outcome of the trial of a robot.

    Attributes:
        attempts: one for each thing tried, in order.
    """

    attempts: tuple[Attempt, ...]

    @property
    def ok(self) -> bool:
        """True where all attempts are."""
        return all(attempt.ok for attempt in self.attempts)


def try_out(robot: Robot) -> Tryout:
    """Let a biped stand, squat and, where it has hands, reach: balance first, then hands.

    Each is a scenario, with the true state in place of an estimate. A robot with a fixed base
    holds its posture in place of standing and squatting. What does not stand is not tried further.

    Args:
        robot: a biped, or a robot with a fixed base.

    Returns:
        What went well, and in words what did not.

    Raises:
        RobotError: the robot cannot be simulated.
    """
    still = [{"metric": "task_error_max", "task": h, "at_most": _DRIFT} for h in robot.hands]
    if robot.soles:
        still = [{"metric": "com_error_max", "at_most": _DRIFT}]
    name = "stand" if robot.soles else "hold"
    attempts: list[Attempt] = []
    plans: list[dict[str, Any]] = [{"name": name, "duration": 2.0, "checks": still}]
    while plans:
        content = {**_content(robot), **plans.pop(0)}
        try:
            run = run_scenario(make_scenario(content, content["name"]), robot=robot)
        except PoiseError as error:
            raise RobotError(str(error)) from None
        except Exception as error:  # Of MuJoCo or a library.
            raise RobotError(f"{type(error).__name__}: {error}") from None
        if run.ended_early == INTERRUPTED:
            raise KeyboardInterrupt
        attempts.append(_attempt(run))
        if len(attempts) == 1 and run.ok:
            plans += [_squat(robot)] if robot.soles else []
            plans += [_reach(robot)] if robot.hands else []
    return Tryout(tuple(attempts))


def _content(robot: Robot) -> dict[str, Any]:
    """Content of a scenario's file, with a stack that any robot has."""
    com = [{"com": {"kp": 60}}] if robot.soles else []
    frame = {"axes": "position", "kp": 60}
    hands = [{"frame": {"frame": hand, "name": hand, **frame}} for hand in robot.hands]
    # After the hands: legs of five joints cannot hold CoM and pelvis both.
    pelvis = [{"frame": {"frame": robot.pelvis, "axes": "orientation", "kp": 100}}] if com else []
    contacts = [{"surface": {"frame": sole}} for sole in robot.soles]
    levels = [level for level in (com, hands, pelvis, ["posture"]) if level]
    return {"ground_truth": True, "stack": {"contacts": contacts, "levels": levels}}


def _attempt(run: Run) -> Attempt:
    words: list[str] = []
    for check in [check for check in run.checks if not check.ok]:
        value = f"{check.value:.3g} {check.unit}, wanted {check.relation} {check.bound:.3g}"
        what = f"after {check.time:.2f} s" if check.metric == "fell" else f"is {value}"
        words.append(": ".join(filter(None, (f"{check.name} {what}", check.mechanism))))
    ratios = np.max(np.nan_to_num(np.abs(run.signals.torque) / run.robot.tau_max), axis=0)
    return Attempt(
        name=run.scenario.name,
        ok=run.ok,
        words=tuple(words[:1] if run.fell else words),
        weakest=run.robot.joint_names[int(np.argmax(ratios))],
        figures=summarise(run),
    )


def _squat(robot: Robot) -> dict[str, Any]:
    """Down as far as limits allow, and up."""
    height = float(pin.centerOfMass(robot.model, robot.model.createData(), robot.q_home)[2])
    shares = (0.1, 0.075, 0.05, 0.025)
    # A fifth deeper: the controller brakes before limits.
    depths = [share for share in shares if _stands(robot, (1.0 - 1.2 * share) * height)]
    # Legs of five joints have no such posture with toes straight ahead: they are tried anyhow.
    depth = [*depths, shares[0]][0] * height
    down = {"task": "com", "at": 0.3, "over": 1.5, "by": [0.0, 0.0, -depth]}
    low = {"metric": "com_travel", "axis": "z", "at_least": _PART * depth}
    back = {"metric": "com_error_max", "from": 4.0, "at_most": _DRIFT}
    motions = [down, {**down, "at": 2.3, "by": [0.0, 0.0, depth]}]
    return {"name": "squat", "duration": 4.3, "motions": motions, "checks": [low, back]}


def _stands(robot: Robot, com_height: float) -> bool:
    try:
        return len(standing_posture(robot, com_height=com_height)) > 0
    except RobotError:
        return False


def _reach(robot: Robot) -> dict[str, Any]:
    """Target of each hand: a swing of one arm joint, preferably forward and up."""
    model, data, q = robot.model, robot.model.createData(), robot.q_home
    pin.framesForwardKinematics(model, data, q)
    trunk, posture = set(robot.joints_above(robot.torso)), dict[str, float]()
    motions: list[dict[str, Any]] = []
    checks: list[dict[str, Any]] = []
    arms = {hand: sorted(set(robot.joints_above(hand)) - trunk) for hand in robot.hands}
    for hand, arm in ((hand, arm) for hand, arm in arms.items() if arm):
        frame = robot.frame_id(hand)
        turns = list(swings(model, q, arm, frame, 0.5))
        ways = np.array([turn.place - data.oMf[frame].translation for turn in turns])
        sizes = np.linalg.norm(ways, axis=1)
        best = int(np.argmax(ways @ [0.6, 0.0, 0.8] + sizes))
        motions.append({"task": hand, "by": ways[best].tolist()})
        most = (1.0 - _PART) * float(sizes[best])
        checks.append({"metric": "task_error_end", "task": hand, "at_most": most})
        # The posture of the arm is a target too; without it a joint may end at a stop.
        joint = turns[best].joint
        posture[model.names[joint]] = float(turns[best].q[model.joints[joint].idx_q])
    motions += [{"task": "posture", "joints": posture}] if posture else []
    motions = [{**motion, "at": 0.3, "over": 1.7} for motion in motions]
    return {"name": "reach", "duration": 3.0, "motions": motions, "checks": checks}
