"""Walking: footsteps, and the walker that makes them, planned or as it is led."""

from poise.locomotion._walking._commands import VelocityLimits
from poise.locomotion._walking._footsteps import (
    Footstep,
    FootstepPlan,
    Gait,
    Stride,
    stand_of as stand_of,
    usual_gait as usual_gait,
)
from poise.locomotion._walking._ground import Ground, Placement
from poise.locomotion._walking._plan import plan_footsteps
from poise.locomotion._walking._settings import WalkSettings, WalkStatus
from poise.locomotion._walking._tasks import (
    CarriedTarget,
    swing_braking as swing_braking,
    walking_stack,
)
from poise.locomotion._walking._walker import Walker

__all__ = [
    "CarriedTarget",
    "Footstep",
    "FootstepPlan",
    "Gait",
    "Ground",
    "Placement",
    "Stride",
    "VelocityLimits",
    "WalkSettings",
    "WalkStatus",
    "Walker",
    "plan_footsteps",
    "walking_stack",
]
