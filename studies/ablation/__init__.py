"""The ablation study: mechanisms of the stepping code, each switched off at random."""

from studies.ablation.effects_section import effects_section
from studies.ablation.runs_section import runs_section
from studies.plan import Part, StudyPlan

PLAN = StudyPlan(
    name="ablation",
    title="Which mechanisms of the stepping code prevent falls",
    introduction=(
        "Step teleoperation by torques and walking by velocities under pushes, on bumps and with "
        "wrong sensors, so hard that about a fifth of the runs ends with a fall. Each run switches "
        "every mechanism off independently with probability 1/4. A logistic fit of the falls gives "
        "the effect of each mechanism, averaged over what the others do.",
    ),
    source="R. A. Fisher, “The Design of Experiments”, for the factorial design; the mechanisms "
    "are Poise's.",
    parts=(
        Part("runs", "Runs", runs_section),
        Part("effects", "Effects on falls", effects_section),
    ),
)
"""The study: two parts."""
