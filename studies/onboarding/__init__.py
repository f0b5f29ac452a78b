"""The study of onboarding: models of robots, read, described and tried as downloaded."""

from studies.onboarding.led_section import led_section
from studies.onboarding.tries_section import listed_section, others_section
from studies.plan import Part, StudyPlan

PLAN = StudyPlan(
    name="onboarding",
    title="Robots as downloaded",
    introduction=(
        "Each URDF, MJCF or xacro file is read as it was downloaded, a description is proposed for "
        "it, and the robot stands, squats and reaches in simulation under one stack: balance, then "
        "hands, then posture. Then it walks, and an operator leads it over an obstacle, and a bad "
        "one for a minute. Nothing is edited and nothing is tuned for a robot.",
        "The list of public models is fixed: one that fails stays in it.",
    ),
    source="none: the models are those below the folder that `--dir` names; without it, those of "
    "example-robot-data",
    parts=(
        Part("listed", "The fixed list", listed_section),
        Part("others", "Each other model", others_section),
        Part("led", "Each model under the bad operator", led_section),
    ),
)
"""The study: three parts."""
