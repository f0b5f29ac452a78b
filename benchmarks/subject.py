"""`Subject`: one of Poise's own controllers under the clock on a recorded run."""

from benchmarks.clocked import Clocked
from benchmarks.methods import Method
from benchmarks.recording import Recording
from benchmarks.stances import bench_stack
from poise.control import make_controller


class Subject(Clocked):
    """A controller with a stack of its own, led by the targets of a recording.

    Args:
        recording: the run it is timed on.
        kind: which stack.
        method: which controller, and how it solves.

    Raises:
        UnknownNameError: no such controller or backend.
        MissingExtraError: the backend is not installed.
    """

    def __init__(self, recording: Recording, kind: str, method: Method) -> None:
        stack = bench_stack(recording.robot, kind, recording.stance)
        controller = make_controller(recording.robot, stack, method.plan())
        recording.prepare(stack)
        super().__init__(
            method, controller, recording.states, lambda tick: recording.aim(stack, tick)
        )
