"""`Rules`: where the step teleoperator departs from the paper's rules, one by one."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Departures from Zhang and Kikuuwe that keep the robot on its feet; all on by default.

    Each can be taken back by itself, for studies; `PAPER_RULES` takes back all.

    Attributes:
        firm_feet: in double support the other foot's velocity weighs 1e4 in place of 100: with 100
            the "+I" of the SR-inverse lets the feet drift apart until a sole rolls.
        leaking_momentum: the desired angular momentum (39a) is forgotten with time, in place of a
            pure integral, which drives the torso in a limit cycle.
        constant_weights: angular momentum and torso have constant weights in single support, in
            place of (39c), which chatters with the measured ZMP.
        safe_lift: a foot leaves the ground when CT-ZMP and divergent component are near the support
            foot too, in place of the ZMP alone (14e): while the COM slows down, the ZMP is in the
            foot already and the COM is not.
        loaded_stance: in double support the foot that carries more is taken to be at rest, in place
            of the left one.
        cancel: a device that is lowered before its foot has left the ground gives both feet back;
            so does a shift that takes too long.
        held_feet: in double support the other foot is held where it was put down, in place of where
            it is (15d), which has no feedback.
        armed_landing: landing is looked for after the foot has been without load for a while.
        reachable: commands beyond the leg's reach or into the other foot are brought back.
    """

    firm_feet: bool = True
    leaking_momentum: bool = True
    constant_weights: bool = True
    safe_lift: bool = True
    loaded_stance: bool = True
    cancel: bool = True
    held_feet: bool = True
    armed_landing: bool = True
    reachable: bool = True


PAPER_RULES = Rules(
    firm_feet=False,
    leaking_momentum=False,
    constant_weights=False,
    safe_lift=False,
    loaded_stance=False,
    cancel=False,
    held_feet=False,
    armed_landing=False,
    reachable=False,
)
"""The paper's rules taken literally."""
