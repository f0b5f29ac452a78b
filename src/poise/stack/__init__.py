"""Tasks, contacts and limits of a robot as rows, independent of solvers."""

from poise.stack._axes import (
    LINEAR_SPEED as LINEAR_SPEED,
    UNIT_TOLERANCE as UNIT_TOLERANCE,
    Pose as Pose,
    checked_gain as checked_gain,
    checked_target as checked_target,
)
from poise.stack._balance import BalanceLimit, BalanceRows as BalanceRows
from poise.stack._centroid import ComTask, MomentumTask
from poise.stack._contact import Contact
from poise.stack._evaluation import any_dynamics as any_dynamics, evaluate as evaluate
from poise.stack._frame import FrameTask
from poise.stack._joint_limit import JointLimit
from poise.stack._joints import JointTask, PostureTask
from poise.stack._leader import Leader
from poise.stack._owner import Owner as Owner
from poise.stack._relative_frame import RelativeFrameTask
from poise.stack._rows import (
    AT_BOUND as AT_BOUND,
    ContactSets as ContactSets,
    StackRows as StackRows,
    home_jacobians as home_jacobians,
    stacked_cones as stacked_cones,
)
from poise.stack._self_collision import (
    SelfCollisionLimit,
    SelfCollisionRows as SelfCollisionRows,
)
from poise.stack._shipped_contacts import PointContact, SurfaceContact
from poise.stack._softening import (
    DAMPING as DAMPING,
    Softening as Softening,
    find_softening as find_softening,
)
from poise.stack._stack import (
    SOFTENING as SOFTENING,
    Stack,
    default_stack,
    is_held as is_held,
)
from poise.stack._support import BASE as BASE, find_hull as find_hull
from poise.stack._tables import Numbers as Numbers, Rows as Rows
from poise.stack._targets import PoseTarget as PoseTarget
from poise.stack._task import Task, TaskFaultError as TaskFaultError
from poise.stack._torque_limit import (
    SHORTEST_TICK as SHORTEST_TICK,
    SMOOTH_RATE as SMOOTH_RATE,
    TorqueLimit,
)

__all__ = [
    "BalanceLimit",
    "ComTask",
    "Contact",
    "FrameTask",
    "JointLimit",
    "JointTask",
    "Leader",
    "MomentumTask",
    "PointContact",
    "PostureTask",
    "RelativeFrameTask",
    "SelfCollisionLimit",
    "Stack",
    "SurfaceContact",
    "Task",
    "TorqueLimit",
    "default_stack",
]
