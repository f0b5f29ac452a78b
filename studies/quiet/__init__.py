"""The study of levels that cannot be met: targets out of reach, and the motion that is left."""

from studies.plan import Part, StudyPlan
from studies.quiet.cost_section import cost_section
from studies.quiet.far_section import far_section
from studies.quiet.priorities_section import priorities_section
from studies.quiet.pushes_section import pushes_section, standing_section
from studies.quiet.targets_section import (
    collision_section,
    reached_section,
    sensed_section,
    targets_section,
    unlimited_section,
)

PLAN = StudyPlan(
    name="quiet",
    title="Quiet strict priority",
    introduction=(
        "A level of a stack that cannot be met is softened: it comes to rest at its edge, and the "
        "levels below cost it nothing. Targets in and out of reach show the motion that is left, "
        "and problems and states drawn at random that priorities hold.",
    ),
    source="T. Sugihara, “Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt "
    "method”, T-RO 2011, for error-proportional damping; the bounds are ours.",
    parts=(
        Part("targets", "Targets at rest", targets_section),
        Part("unlimited", "Without a rate limit", unlimited_section),
        Part("sensed", "With noise and estimator", sensed_section),
        Part("reached", "Targets that strict levels reach", reached_section),
        Part("collisions", "Hands led into the robot", collision_section),
        Part("cost", "Cost of lower levels", cost_section),
        Part("priorities", "Strictness", priorities_section),
        Part("far", "Targets far away", far_section),
        Part("standing", "Pushed while standing", standing_section),
        Part("pushes", "Pushed while walking", pushes_section),
    ),
)
"""The study."""
