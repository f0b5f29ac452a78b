"""Which tasks a contact stands in for."""

from collections.abc import Sequence

from poise.contacts.contact import Contact
from poise.tasks import FrameTask, Task


def is_held(task: Task, contacts: Sequence[Contact]) -> bool:
    """Whether a task acts on a frame whose motion an active contact already decides.

    A point contact decides where its frame is, but not how it is turned.

    Args:
        task: the task.
        contacts: active contacts.
    """
    return isinstance(task, FrameTask) and any(
        c.frame == task.frame and not (task.turns and c.dim < 6) for c in contacts
    )
