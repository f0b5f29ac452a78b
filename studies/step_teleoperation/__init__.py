"""The study of (Zhang, Kikuuwe): a person places a biped's feet, feedback keeps its balance."""

from studies.plan import Part, StudyPlan
from studies.step_teleoperation.cart_table_section import cart_table_section
from studies.step_teleoperation.rules import rules_section
from studies.step_teleoperation.scenarios import (
    g1_section,
    lift_section,
    obstacle_section,
    swing_section,
    switch_section,
)

PLAN = StudyPlan(
    name="step-teleoperation",
    title="Step-by-step teleoperation with CoM shifter and body rotator",
    introduction=(
        "A person holds two devices, one for each foot of a biped. Lifting one shifts the weight "
        "and lifts its foot, which then follows the device until it lands. The CoM shifter moves "
        "the centre of mass by feedback from a ZMP reference that jumps; the body rotator makes up "
        "for what the swinging leg does. Here the hands are scripts, on `biped20`, the paper's "
        "robot in mass and size.",
        "Axes are Poise's: x forward, y left. The paper draws its figures with x to the side.",
    ),
    source="Y. Zhang, R. Kikuuwe, “COM Shifter and Body Rotator for Step-by-Step Teleoperation of "
    "Bipedal Robots”.",
    parts=(
        Part("cart-table", "The CoM shifter by itself, Figure 6", cart_table_section),
        Part("scenario-1", "Scenario 1: over an obstacle, Figure 8", obstacle_section),
        Part("scenario-2", "Scenario 2: lifting one foot, Figure 10", lift_section),
        Part("scenario-3", "Scenario 3: switching the support foot, Figure 12", switch_section),
        Part("scenario-4", "Scenario 4: a fast swing, Figure 14", swing_section),
        Part("g1", "Beyond the paper: scenarios 1 to 3 on G1", g1_section),
        Part("rules", "Beyond the paper: its rules alone", rules_section),
    ),
)
"""The study: its parts in order. A part is a function in a file of its own."""
