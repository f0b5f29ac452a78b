"""Propose a description for a robot, try it in simulation and show the result on a page."""

from poise.apps.onboarding._page import write_page
from poise.apps.onboarding._trial import Attempt as Attempt, Tryout as Tryout, try_out

__all__ = ["try_out", "write_page"]
