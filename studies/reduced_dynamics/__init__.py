"""The study of Ahn et al. 2024: whole-body control on a robot of reduced dimension."""

from studies.plan import Part, StudyPlan
from studies.reduced_dynamics.difference_section import difference_section
from studies.reduced_dynamics.dof_section import dof_section
from studies.reduced_dynamics.sizes_section import sizes_section
from studies.reduced_dynamics.timing_section import timing_section
from studies.reduced_dynamics.tracking_section import tracking_section

PLAN = StudyPlan(
    name="reduced-dynamics",
    title="Whole-body control with reduced dynamics",
    introduction=(
        "A humanoid in contact moves base and legs under the contacts' constraints; what hangs on "
        "them freely is felt through one wrench. The paper puts a centroid of six coordinates in "
        "its place, solves contacts and balance on the small robot (LQP 1) and the rest after it "
        "(LQP 2). “Conventional” is Poise's `whole_body`, “proposed” its `reduced`, which is exact "
        "where the paper approximates.",
        "The robot is `humanoid33`, with as many joints in each limb as the paper's TOCABI. Times "
        "are Python's on this machine; ratios within a run are what can be compared.",
    ),
    source="J. Ahn, J. Jung, Y. Lee, H. Lee, S. Haddadin, J. Park, “Efficient Computation of "
    "Whole-Body Control Utilizing Simplified Whole-Body Dynamics via Centroidal Dynamics”, 2024.",
    parts=(
        Part("time", "Time along a walk, Table 3", timing_section),
        Part("sizes", "Sizes of the problems, Tables 1 and 2", sizes_section),
        Part("tracking", "Tracking errors, Figure 4", tracking_section),
        Part("joints", "Time by joints, Figure 5", dof_section),
        Part("difference", "Beyond the paper: full and reduced at every tick", difference_section),
    ),
)
"""The study: its parts in order. A part is a function in a file of its own."""
