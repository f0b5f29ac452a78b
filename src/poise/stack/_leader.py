"""`Leader`: protocol of whatever sets the targets of a stack."""

from typing import Protocol, runtime_checkable

from poise.dynamics import RobotState
from poise.stack._stack import Stack


@runtime_checkable
class Leader(Protocol):
    """Set the targets of a stack before each step of its controller.

    A walker, a step teleoperator, a scenario's script or an object of the user's own is one. What
    a leader may set is this, and nothing else:

    - targets of tasks with their rates (`set_target`), or the reference itself (`set_velocity`,
      `set_acceleration`),
    - weights of tasks against each other within a level, row by row (`set_weight`), and gains
      (`set_gains`),
    - contacts: `engage` and `release`, with the length of their ramps, and `set_damping`. A
      controller that takes one contact to be at rest takes the first active one: a leader chooses
      by what it engages.

    A leader depends on no solver, controller or simulator. Like a controller it never raises on
    numbers: a state that is not finite is passed over.
    """

    @property
    def stack(self) -> Stack:
        """The stack whose targets it sets."""
        ...

    def lead(self, state: RobotState) -> None:
        """Set targets, weights and contacts of the stack for the next tick.

        Args:
            state: of the robot, as the controller will get it.
        """
        ...
