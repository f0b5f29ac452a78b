"""The study of (Park, Jin, Kang 2022): what a bias acceleration costs, and what it is worth."""

from studies.bias_acceleration.cost_section import cost_section
from studies.bias_acceleration.simulation import (
    encoder_section,
    gravity_section,
    model_error_section,
)
from studies.bias_acceleration.timing_section import timing_section
from studies.plan import Part, StudyPlan

PLAN = StudyPlan(
    name="bias-acceleration",
    title="Bias acceleration in the operational space formulation",
    introduction=(
        "The operational space formulation (OSF) controls several tasks in strict priority. A task "
        "below others must know which acceleration those will cause: its bias acceleration. The "
        "paper shows that the original formula for it spends a third to a half of all operations "
        "on dynamics that cancel, and proposes one that needs the mass matrix only. Poise's own "
        "formula, `fused`, takes one step more: the velocity term of the prioritised task, which "
        "the bias acceleration adds and the torque takes away again, is left out of both.",
    ),
    source="S. H. Park, M. Jin, S. H. Kang, “Efficient Acceleration-Level Formula of Bias "
    "Acceleration Satisfying Time Precedence for Operational Space Formulation”, IEEE Access, "
    "2022.",
    parts=(
        Part("cost-model", "Operations by formula: Figures 1 to 3", cost_section),
        Part("gravity", "First study: bias acceleration and gravity, Figure 5", gravity_section),
        Part("encoders", "First study: behind encoders, Figure 6, Tables 2 and 3", encoder_section),
        Part("timing", "Second study: time, Table 4", timing_section),
        Part("model-error", "Where the model is wrong, section III.D", model_error_section),
    ),
)
"""The study: its parts in order. A part is a function in a file of its own."""
