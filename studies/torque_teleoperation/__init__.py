"""The study of step teleoperation at torque level: scenarios, and a random operator."""

from studies.plan import Part, StudyPlan
from studies.torque_teleoperation.everything import everything_section
from studies.torque_teleoperation.scenarios import scenarios_section

PLAN = StudyPlan(
    name="torque-teleoperation",
    title="Step teleoperation at torque level",
    introduction=(
        "The step teleoperator leads a stack of accelerations, solved for torques every 2 ms, in "
        "place of the paper's joint velocities. The paper's scenarios 1 to 4, and an operator who "
        "commands feet, hands, head, body and stick at random. Sensors have noise.",
    ),
    source="Y. Zhang, R. Kikuuwe, “COM Shifter and Body Rotator for Step-by-Step Teleoperation of "
    "Bipedal Robots”, for modes and references; the level of torques and the operator are ours.",
    parts=(
        Part("scenarios", "The paper's scenarios", scenarios_section),
        Part("everything", "Everything at once", everything_section),
    ),
)
"""The study."""
