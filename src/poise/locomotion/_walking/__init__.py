"""Walking: footsteps, and the walker that makes them by a plan or by commands."""

from poise.locomotion._walking._commands import VelocityLimits as VelocityLimits
from poise.locomotion._walking._engine import SteppingEngine as SteppingEngine
from poise.locomotion._walking._flight import CLEAR as CLEAR, HeldFlight as HeldFlight
from poise.locomotion._walking._footsteps import (
    Footstep as Footstep,
    FootstepPlan as FootstepPlan,
    Gait as Gait,
    Stride as Stride,
    level_floor as level_floor,
    plan_footsteps as plan_footsteps,
    stand_of as stand_of,
    usual_gait as usual_gait,
)
from poise.locomotion._walking._ground import (
    CLEARANCE as CLEARANCE,
    Ground as Ground,
    Placement as Placement,
    mean_angle as mean_angle,
    turn_to_left as turn_to_left,
    wrapped as wrapped,
    yaw_of as yaw_of,
)
from poise.locomotion._walking._legs import (
    GIVES as GIVES,
    KNEE as KNEE,
    FootRange as FootRange,
    Leg as Leg,
    measure_leg as measure_leg,
)
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
from poise.locomotion._walking._sense import (
    LOADED as LOADED,
    UNLOADED as UNLOADED,
    WalkSense as WalkSense,
)
from poise.locomotion._walking._settings import (
    WalkSettings as WalkSettings,
    WalkStatus as WalkStatus,
)
from poise.locomotion._walking._tasks import (
    CarriedTarget as CarriedTarget,
    stepping_stack as stepping_stack,
    walking_stack as walking_stack,
)
from poise.locomotion._walking._walker import Walker as Walker
