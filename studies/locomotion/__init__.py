"""The study of locomotion: walks on the estimate of the base, and faulty load cells."""

from studies.locomotion.cells import cells_section
from studies.locomotion.estimation import estimation_section
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
        Part("cells", "Load cells with faults", cells_section),
    ),
)
"""The study."""
