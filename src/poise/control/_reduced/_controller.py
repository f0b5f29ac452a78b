"""`ReducedController`: strictly prioritised torque control over the reduced robot."""

from poise.control._reduced._elimination import announce
from poise.control._reduced._resolver import ReducedResolver
from poise.control._torque_controller import TorqueController
from poise.dynamics import Dynamics, Partitions
from poise.robots import Robot
from poise.stack import Contact, PostureTask, Stack


class ReducedController(TorqueController[ReducedResolver]):
    """Tasks in strict priority in, joint torques out: contacts and balance on a small model.

    The formulation of Ahn et al. 2024, section 4, with exact dynamics, see `ReducedResolver`. It
    takes the same stacks as `WholeBodyController` and finds the same torques, in less time the more
    joints stand between no contact and the base. What is common to all controllers by quadratic
    programs is said of `TorqueController`.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack | None = None,
        *,
        strategy: str = "direct",
        backend: str | None = None,
        time_limit: float | None = None,
    ) -> None:
        announce()
        self._partitions = Partitions(robot)
        super().__init__(robot, stack, strategy=strategy, backend=backend, time_limit=time_limit)
        self._rehearse()

    @property
    def resolver(self) -> ReducedResolver | None:
        """The two problems of the last tick that was solved, and their solutions."""
        return self._last

    def _make_resolver(self, contacts: tuple[Contact, ...]) -> ReducedResolver:
        partition = self._partitions.of([c.frame for c in contacts])
        return ReducedResolver(self.robot, self.stack, contacts, partition, self._make_solver)

    def _rehearse(self) -> None:
        """Runs everything compiled once, so that the first tick finds it ready."""
        # Without contacts the chain that hangs freely is as long as it can be.
        stack = Stack(levels=[[PostureTask()]])
        stack.bind(self.robot)
        resolver = ReducedResolver(
            self.robot, stack, (), self._partitions.of(()), self._make_solver
        )
        resolver.assemble(Dynamics(self.robot))
        resolver.solve()
