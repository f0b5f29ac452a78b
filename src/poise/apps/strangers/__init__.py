"""A robot that nobody has described yet: a description proposed, tried in simulation, shown."""

from poise.apps.strangers._page import write_page
from poise.apps.strangers._trial import Attempt as Attempt, Trial as Trial, try_out

__all__ = ["try_out", "write_page"]
