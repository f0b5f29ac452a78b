"""Walking: footsteps, and the walker that makes them, planned or as it is led."""

from poise.locomotion._walking._commands import VelocityLimits
from poise.locomotion._walking._engine import SteppingEngine as SteppingEngine
from poise.locomotion._walking._flight import HeldFlight as HeldFlight
from poise.locomotion._walking._footsteps import (
    CLEARANCE as CLEARANCE,
    Footstep,
    FootstepPlan,
    Gait,
    Stride,
    level_floor as level_floor,
    stand_of as stand_of,
    usual_gait as usual_gait,
)
from poise.locomotion._walking._ground import Ground, Placement
from poise.locomotion._walking._modes import (
    LIFT as LIFT,
    Mode as Mode,
    ModeEvent as ModeEvent,
    StepEnd as StepEnd,
    StepMachine as StepMachine,
    draw_modes as draw_modes,
)
from poise.locomotion._walking._parts import make_parts as make_parts
from poise.locomotion._walking._phases import FootMotion as FootMotion
from poise.locomotion._walking._plan import plan_footsteps
from poise.locomotion._walking._sense import WalkSense as WalkSense
from poise.locomotion._walking._settings import WalkSettings, WalkStatus
from poise.locomotion._walking._tasks import (
    CarriedTarget,
    stepping_stack as stepping_stack,
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
