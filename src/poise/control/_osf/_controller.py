"""`OperationalSpaceController`: prioritised torques in closed form."""

from collections.abc import Sequence

from poise._checks import Numbers, checked_kind
from poise.control._controller import Controller
from poise.control._fallback import RateLimit
from poise.control._osf._strategy import OperationalStrategy
from poise.control._rank import RankTreatment
from poise.control._strategy import bound_stack
from poise.dynamics import Dynamics
from poise.robots import Robot
from poise.stack import Stack, Task


class OperationalSpaceController(Controller):
    """The operational space formulation with strict priorities, on any robot.

    `OperationalRecursion` gives torques in closed form. On a floating base contacts stand above
    all tasks, and `ContactForces` finds the wrenches that carry the base, with internal forces.

    Levels that cannot be met are softened by the stack's setting. Where the closed form leaves a
    contact's cone, a torque limit or the bounds of joint, balance or self-collision limit,
    `BoundedAcceleration` takes its place: bounds stand above the tasks, and tasks lose from the
    bottom up. Tasks of one level that conflict share by their weights over the mobility of
    their rows in the home posture. Tasks can be switched and re-ordered while running: no torque
    changes by more than `torque_step` from one tick to the next.

    `step` never raises. For a state that is not finite it returns the last good torque decayed
    towards damping, with that status.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks; `default_stack(robot)` when None.
        rank: treatment of tasks that lose rank; the defaults of `RankTreatment` when None.
        torque_step: largest change of a torque from tick to tick [N m], one number or one a joint;
            a tenth of the torque limits when None, `math.inf` for no bound.
        dynamics: shared with the estimator of the state, see `Controller`; its own when None.

    Raises:
        PoiseError: a name that the robot does not have, no task, or a setting that cannot be right.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack | None = None,
        *,
        rank: RankTreatment | None = None,
        torque_step: Numbers | None = None,
        dynamics: Dynamics | None = None,
    ) -> None:
        stack = bound_stack(robot, stack)
        rank = checked_kind(rank or RankTreatment(), RankTreatment, "rank of the controller")
        self._operational = OperationalStrategy(robot, stack, rank)
        super().__init__(
            self._operational, rate_limit=RateLimit(robot, torque_step), dynamics=dynamics
        )

    @property
    def strategy(self) -> OperationalStrategy:
        """Rows, accelerations and wrenches of the last tick."""
        return self._operational

    def set_levels(self, levels: Sequence[Sequence[Task]]) -> None:
        """Replace the tasks while running: on, off, or in another order.

        Tasks that remain keep their targets. Torques change by `torque_step` a tick at most.

        Args:
            levels: lists of tasks, most important first.

        Raises:
            ConfigurationError: no task, an empty level, or a name used twice.
            UnknownNameError: a frame or joint that the robot does not have.
        """
        self._operational.set_levels(levels)

    def set_wrench(self, contact: str, wrench: Numbers | None) -> None:
        """Set the reference of a contact's part of the internal forces.

        Of all wrenches that carry the robot, the nearest to the references are taken. They move
        nothing: they press contacts against each other, or shift load between them.

        Args:
            contact: name of a contact of the stack.
            wrench: [force; moment] on the robot, along the contact's axes at its centre
                [N, N m]; None for as little as possible.

        Raises:
            UnknownNameError: no such contact.
            TargetError: wrong shape, NaN or infinite.
        """
        self._operational.set_wrench(contact, wrench)
