"""Strictness: nearly dependent rows in the solver, and limits per level in closed form."""

from studies.finding import Finding, Section
from studies.plan import Progress, StudyOptions
from studies.quiet.operational_section import osf_levels
from studies.quiet.strictness_section import near_dependent

PROBLEMS, STATES = 10_000, 1000

RISE = 1e-9
"""Largest relative rise of a higher level's residual that counts as none."""


def priorities_section(options: StudyOptions, progress: Progress) -> Section:
    """Add lower levels, or ask more of them, and compare what the higher ones miss."""
    problems = near_dependent(options.count(PROBLEMS, 300), options.seed)
    progress(1.0, 2.0)
    count = options.count(STATES, 30)
    states = osf_levels(count, options.seed)
    rise = max(states["contacts"], states["balance"])
    progress(2.0, 2.0)
    findings = (
        Finding(
            name="nearly dependent rows: silent rises by a lower level",
            paper=0,
            ours=int(problems["silent"]),
            ok=problems["silent"] == 0,
            note=f"of {problems['problems']} problems with rows dependent to within 1e-10 to 1e-7; "
            f"{problems['inaccurate']} say that they are inaccurate",
        ),
        Finding(
            name="operational space: largest rise of a higher level by hands that ask for more",
            paper=RISE,
            ours=float(rise),
            ok=rise <= RISE,
            note=f"{count} states of G1, hands asked 1, 5 and 10 times, strict levels",
        ),
    )
    return Section(findings=findings)
