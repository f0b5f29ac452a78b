"""The study of bad operators: falls of robots whose feet are commanded at random."""

from itertools import product
from pathlib import Path

from studies.bad_operator.conditions import CONDITIONS, DESCRIBED, MIXED, NOISE, PLANTS, SOLID
from studies.bad_operator.operator_section import (
    FALL_EVERY,
    Allowed,
    Asked,
    one_in_ten_minutes,
    operator_section,
)
from studies.plan import Part, StudyPlan
from studies.trial_section import none, part

FOLDER = Path("runs/bad-operator-falls")
"""Inputs that made a robot fall, in a folder for each robot."""

FALLS = {"biped20": 2 / 200, "g1": 10 / 200}
"""Share of seeds at velocity level that may end with a fall."""


def allowed(asked: Asked) -> Allowed:
    """Falls allowed under a condition: at velocity level only `biped20` has a bound."""
    if asked.level == "torque":
        return one_in_ten_minutes
    return none if (asked.robot, asked.condition) == ("biped20", DESCRIBED) else None


PLAN = StudyPlan(
    name="bad-operator",
    title="Step teleoperation under bad operators",
    introduction=(
        "An operator who commands at random for a minute, about two and a half whims a second: "
        "jumps, jitters of up to 10 cm, taps, lifts both feet, freezes, reaches too far, crosses "
        "the legs, lowers early, sends rubbish. Sensors have noise, encoders 17 bits.",
    ),
    source="The controller is that of Y. Zhang, R. Kikuuwe, “COM Shifter and Body Rotator for "
    "Step-by-Step Teleoperation of Bipedal Robots”, with Poise's departures; the operator is ours.",
    parts=(
        Part(
            "falls",
            "Falls at velocity level",
            operator_section(
                "Falls at velocity level",
                [Asked(robot, NOISE, "velocity") for robot in FALLS],
                (200, 3),
                lambda asked: part(FALLS[asked.robot]),
                prose=f"Inputs that made a robot fall are in `{FOLDER}`; "
                "`poise.apps.teleoperation.replay_teleop` runs them again.",
                folder=FOLDER,
            ),
        ),
        Part(
            "conditions",
            "Both levels, condition by condition",
            operator_section(
                "Bad operators, level by level",
                [
                    Asked(robot, condition, level)
                    for robot, level, condition in product(("biped20", "g1"), PLANTS, CONDITIONS)
                ],
                (20, 3),
                allowed,
                prose="As described the sensors have noise, and the attitude is off by half a "
                "degree. Asked: at torque level at most one fall in "
                f"{FALL_EVERY:.0f} minutes, at velocity level of biped20 as described none. But "
                f"under “{SOLID}” and “{MIXED}” limbs go through each other in simulation: the "
                "last column has the least distance of shanks and feet, negative for a fall that "
                "a real robot might have had.",
            ),
        ),
    ),
)
"""The study."""
