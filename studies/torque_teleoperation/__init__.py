"""The study of step teleoperation at torque level: the paper's scenarios, and bad operators."""

from studies.plan import Part, StudyPlan
from studies.torque_teleoperation.again_section import again_section
from studies.torque_teleoperation.controllers_section import controllers_section
from studies.torque_teleoperation.cuts_section import cuts_section
from studies.torque_teleoperation.edges_section import edges_section
from studies.torque_teleoperation.everything_section import everything_section
from studies.torque_teleoperation.habits_section import habits_section
from studies.torque_teleoperation.hands_section import hands_section
from studies.torque_teleoperation.held_section import held_section
from studies.torque_teleoperation.operators_section import (
    described_section,
    mixed_section,
    operators_section,
    plants_section,
)
from studies.torque_teleoperation.ridges_section import ridges_section
from studies.torque_teleoperation.scenarios_section import scenarios_section
from studies.torque_teleoperation.standing_section import standing_section

PLAN = StudyPlan(
    name="torque-teleoperation",
    title="Step teleoperation at torque level",
    introduction=(
        "The step teleoperator leads a stack of accelerations, solved for torques every 2 ms, in "
        "place of the paper's joint velocities. The paper's scenarios 1 to 4, and operators who "
        "command at random for a minute, on floors, robots and with sensors that are not as "
        "described. Sensors have noise and a constant error of the attitude of half a degree. "
        "Beside it, how robots stand whose velocities are commanded.",
    ),
    source="Y. Zhang, R. Kikuuwe, “COM Shifter and Body Rotator for Step-by-Step Teleoperation of "
    "Bipedal Robots”, for modes and references; the level of torques and the operators are ours.",
    parts=(
        Part("scenarios", "The paper's scenarios", scenarios_section),
        Part("operators", "Bad operators", operators_section),
        Part("described", "G1 as described", described_section),
        Part("mixed", "G1 under all conditions at once", mixed_section),
        Part("plants", "Other plants", plants_section),
        Part("habits", "Operators with habits", habits_section),
        Part("everything", "Everything at once", everything_section),
        Part("controllers", "Each controller of torques", controllers_section),
        Part("held", "Pushed with one foot held up", held_section),
        Part("again", "Pushed again while it catches itself", again_section),
        Part("edges", "On the edge of a bump", edges_section),
        Part("ridges", "One edge on a ridge", ridges_section),
        Part("cuts", "Connections cut in mid-step", cuts_section),
        Part("hands", "Hands at random", hands_section),
        Part("standing", "Standing at velocity level", standing_section),
    ),
)
"""The study: fifteen parts."""
