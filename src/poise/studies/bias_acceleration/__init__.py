"""The study of (Park, Jin, Kang 2022): what a bias acceleration costs, and what it is worth."""

from poise.studies.bias_acceleration.cost_section import cost_section
from poise.studies.plan import Part, StudyPlan

PLAN = StudyPlan(
    name="bias-acceleration",
    title="Bias acceleration in the operational space formulation",
    introduction=(
        "The operational space formulation (OSF) controls several tasks in strict priority. A task "
        "below others must know which acceleration those will cause: its bias acceleration. The "
        "paper shows that the original formula for it spends a third to a half of all operations "
        "on dynamics that cancel, and proposes one that needs the mass matrix only.",
    ),
    source="S. H. Park, M. Jin, S. H. Kang, “Efficient Acceleration-Level Formula of Bias "
    "Acceleration Satisfying Time Precedence for Operational Space Formulation”, IEEE Access, "
    "2022.",
    parts=(
        Part(
            name="cost-model", title="Operations by formula: Figures 1 to 3", compute=cost_section
        ),
    ),
)
"""The study: its parts in order. A part is a function in a file of its own."""
