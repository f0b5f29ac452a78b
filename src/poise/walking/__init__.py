"""Walking: footsteps, references, and the walker that leads a stack along them."""

from poise.walking.carried import CarriedTarget
from poise.walking.footsteps import Footstep, FootstepPlan, Placement
from poise.walking.gait import Gait, Stride
from poise.walking.ground import Ground, Platform
from poise.walking.plan import plan_footsteps
from poise.walking.reference import WalkReference
from poise.walking.settings import WalkSettings
from poise.walking.stack import walking_stack
from poise.walking.status import WalkStatus
from poise.walking.walker import Walker

__all__ = [
    "CarriedTarget",
    "Footstep",
    "FootstepPlan",
    "Gait",
    "Ground",
    "Placement",
    "Platform",
    "Stride",
    "WalkReference",
    "WalkSettings",
    "WalkStatus",
    "Walker",
    "plan_footsteps",
    "walking_stack",
]
