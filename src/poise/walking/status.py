"""`WalkStatus`: how a walk stands."""

from enum import Enum


class WalkStatus(Enum):
    """How a walk stands, or why it ended."""

    READY = "ready"
    """No state has come yet."""
    WALKING = "walking"
    """The plan is being followed."""
    FINISHED = "finished"
    """All steps are made; the robot stands."""
    MISPLACED = "misplaced"
    """The feet were not where the plan begins: nothing was moved."""
    FOOT_LOST = "foot_lost"
    """A foot found no ground: it is held, and the robot balances on the other."""
    COM_LOST = "com_lost"
    """The COM ran away from its reference: the foot comes down where it is."""

    @property
    def ok(self) -> bool:
        """Whether nothing went wrong."""
        return self in (WalkStatus.READY, WalkStatus.WALKING, WalkStatus.FINISHED)
