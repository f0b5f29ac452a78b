"""The study of locomotion: walking on what the robot's own sensors say, led and pushed."""

from studies.locomotion.estimation_section import estimation_section
from studies.locomotion.led_section import led_section
from studies.plan import Part, StudyPlan

PLAN = StudyPlan(
    name="locomotion",
    title="Legs on what they can measure themselves",
    introduction=(
        "Robots that walk with the estimate of their base in the loop, measured by an inertial "
        "unit, encoders and load cells as one buys them, with noise, biases and 2 ms of delay; the "
        "controller's period is 2 ms. Bounds are those that Poise sets itself.",
    ),
    source="The estimator is that of R. Hartley, M. Ghaffari, R. M. Eustice, J. W. Grizzle, "
    "“Contact-aided invariant extended Kalman filtering for robot state estimation” (2020).",
    parts=(
        Part("estimation", "The estimate on walks", estimation_section),
        Part("led", "Led by velocities", led_section),
    ),
)
"""The study: what is estimated, and what is walked."""
