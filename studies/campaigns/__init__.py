"""The study of campaigns: what an interruption costs, how fast they are, what tuning gains."""

from studies.campaigns.interruption_section import interruption_section
from studies.campaigns.speed_section import speed_section
from studies.campaigns.tuning_section import tuning_section
from studies.plan import Part, StudyPlan

PLAN = StudyPlan(
    name="campaigns",
    title="Campaigns: many episodes over many workers",
    introduction=(
        "`poise campaign` as a user has it, with `biped20` standing under a push. The bounds are "
        "what campaigns are held to; times are of this machine.",
    ),
    source="No paper: campaigns are Poise's own.",
    parts=(
        Part("interruption", "A killed worker and a killed parent", interruption_section),
        Part("speed", "Two workers beside one", speed_section),
        Part("tuning", "Gains tuned from a bad start", tuning_section),
    ),
)
"""The study: what is kept, how fast it is, what it is good for."""
