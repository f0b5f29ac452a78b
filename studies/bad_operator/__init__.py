"""The study of the bad operator: how often a robot falls under hands that do anything."""

from studies.bad_operator.conditions_section import conditions_section
from studies.bad_operator.falls_section import falls_section
from studies.plan import Part, StudyPlan

PLAN = StudyPlan(
    name="bad-operator",
    title="Step teleoperation under a bad operator",
    introduction=(
        "An operator who commands at random for a minute, about two and a half whims a second: "
        "jumps, jitters of up to 10 cm, taps, lifts both feet, freezes, reaches too far, crosses "
        "the legs, lowers early, sends rubbish. Sensors have noise, encoders 17 bits. How often "
        "do `biped20` and G1 fall at velocity level? And how often at either level, where sensors "
        "are off by a constant, floors slope, somebody pushes?",
    ),
    source="The controller is that of Y. Zhang, R. Kikuuwe, “COM Shifter and Body Rotator for "
    "Step-by-Step Teleoperation of Bipedal Robots”, with Poise's departures; the operator is ours.",
    parts=(
        Part("falls", "Falls", falls_section),
        Part("conditions", "Falls by level and condition", conditions_section),
    ),
)
"""The study: two parts."""
