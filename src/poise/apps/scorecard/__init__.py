"""Scorecards: the largest disturbances that a robot with its controller survives."""

from poise.apps.scorecard._card import (
    CARD as CARD,
    PAGE as PAGE,
    Card as Card,
    Difference as Difference,
    compare as compare,
    read_card as read_card,
)
from poise.apps.scorecard._page import (
    VERDICTS as VERDICTS,
    reasons_of as reasons_of,
    result_text as result_text,
    write_page as write_page,
)
from poise.apps.scorecard._plan import FULL as FULL, QUICK as QUICK, Plan as Plan
from poise.apps.scorecard._run import make_card as make_card, replay_job as replay_job
from poise.apps.scorecard._trials import TRIALS as TRIALS, Trial as Trial

__all__: list[str] = []
