"""The study of locomotion: legs on what they can measure, led, pushed, told absurd things."""

from studies.locomotion.cells_section import cells_section
from studies.locomotion.estimation_section import estimation_section
from studies.locomotion.ground_section import ground_section
from studies.locomotion.led_section import led_section
from studies.locomotion.references_section import references_section
from studies.locomotion.standing_section import standing_section
from studies.locomotion.steps_section import steps_section
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
        Part("led", "Led by velocities", led_section),
        Part("standing", "Pushed without a step", standing_section),
        Part("ground", "Ground and bodies that nobody told of", ground_section),
        Part("steps", "Torques from tick to tick", steps_section),
        Part("references", "References that no robot can follow", references_section),
    ),
)
"""The study: what is estimated, and what is walked, and what is survived."""
