"""The study of step teleoperation at torque level: the paper's scenarios, and bad operators."""

from collections.abc import Sequence
from itertools import product

from studies.bad_operator.conditions import CONDITIONS, DESCRIBED, MIXED, OTHER_PLANTS
from studies.bad_operator.operator_section import (
    FALL_EVERY,
    Allowed,
    Asked,
    none_but_mixed,
    one_in_ten_minutes,
    operator_section,
)
from studies.plan import Part, StudyPlan
from studies.torque_teleoperation import everything
from studies.torque_teleoperation.cuts import cuts_section
from studies.torque_teleoperation.scenarios import scenarios_section
from studies.trial_section import TrialSection, none, part

_ROBOTS = ("biped20", "humanoid33", "g1")
_PROSE = (
    "Asked as described: at most one fall in a hundred seeds on G1, none on the others; otherwise "
    f"at most one in {FALL_EVERY:.0f} minutes."
)


def _allowed(asked: Asked) -> Allowed:
    if asked.condition != DESCRIBED:
        return one_in_ten_minutes
    return part(0.01) if asked.robot == "g1" else none


def _operators(
    robots: Sequence[str], conditions: Sequence[str], seeds: tuple[int, int] = (50, 3)
) -> TrialSection:
    """Bad operators of some robots under some conditions: parts with the same trials share them."""
    asked = [Asked(robot, condition) for robot, condition in product(robots, conditions)]
    return operator_section(
        "Bad operators", asked, seeds, _allowed, prose=_PROSE, described_seeds=200
    )


PLAN = StudyPlan(
    name="torque-teleoperation",
    title="Step teleoperation at torque level",
    introduction=(
        "The step teleoperator leads a stack of accelerations, solved for torques every 2 ms, in "
        "place of the paper's joint velocities. The paper's scenarios 1 to 4, and operators who "
        "command at random for a minute, on floors, robots and with sensors that are not as "
        "described. Sensors have noise and a constant error of the attitude of half a degree.",
    ),
    source="Y. Zhang, R. Kikuuwe, “COM Shifter and Body Rotator for Step-by-Step Teleoperation of "
    "Bipedal Robots”, for modes and references; the level of torques and the operators are ours.",
    parts=(
        Part("scenarios", "The paper's scenarios", scenarios_section),
        Part("operators", "Bad operators", _operators(_ROBOTS, tuple(CONDITIONS))),
        Part("described", "G1 as described", _operators(("g1",), (DESCRIBED,))),
        Part("mixed", "G1 under all conditions at once", _operators(("g1",), (MIXED,))),
        Part(
            "plants", "Other plants", _operators(("g1", "humanoid33"), tuple(OTHER_PLANTS), (5, 1))
        ),
        Part(
            "everything",
            "Everything at once",
            operator_section(
                "Everything at once",
                [
                    *(Asked(robot, DESCRIBED) for robot in (*_ROBOTS, "talos")),
                    Asked("g1", MIXED),
                ],
                (10, 1),
                none_but_mixed,
                prose="Feet are the bad operator's, both hands go to places at random at up to 1 "
                "m/s, the head turns, the body is bent by up to 0.4 rad about each axis, lowered "
                "and raised, feet are turned, and the stick is pushed now and then.",
                quick_seconds=15.0,
                run=everything.run_trial,
            ),
        ),
        Part(
            "controllers",
            "Each controller of torques",
            operator_section(
                "Controllers",
                [
                    Asked(robot, condition, solved_by=controller)
                    for robot, controller, condition in product(
                        ("biped20", "g1"), ("whole_body", "reduced", "osf"), (DESCRIBED, MIXED)
                    )
                ],
                (4, 1),
                none_but_mixed,
                prose="The same stack, led by the same operators over the same ground.",
                quick_seconds=15.0,
            ),
        ),
        Part("cuts", "Connections cut in mid-step", cuts_section),
    ),
)
"""The study."""
