"""The study of strangers: models that nobody described, read, described and tried as downloaded."""

from studies.plan import Part, StudyPlan
from studies.strangers.led_section import led_section
from studies.strangers.tries_section import tries_section

PLAN = StudyPlan(
    name="strangers",
    title="Robots that nobody here has described",
    introduction=(
        "Every URDF and MJCF below a folder is read as it was downloaded, a description is "
        "proposed for it, and the robot stands, squats and reaches in simulation under one stack: "
        "balance, then hands, then posture. Then it walks, and an operator leads it over an "
        "obstacle, and a bad one for a minute. Nothing is edited and nothing is tuned for a robot.",
    ),
    source="none: the models are those below the folder that `--dir` names; without it, those of "
    "example-robot-data",
    parts=(
        Part("tries", "Each model", tries_section),
        Part("led", "Each model under the bad operator", led_section),
    ),
)
"""The study: two parts."""
