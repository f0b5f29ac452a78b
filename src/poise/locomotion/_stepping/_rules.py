"""`Rules`: where the step teleoperator departs from the paper's rules, one by one."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Departures from Zhang and Kikuuwe that keep the robot on its feet; all on by default.

    Each can be taken back by itself, for studies; `PAPER_RULES` takes back all.

    Attributes:
        firm_feet: in double support the other foot's velocity weighs 1e4 in place of 100: with 100
            the "+I" of the SR-inverse lets the feet drift apart until a sole rolls.
        firm_lift: a foot near the ground is held as firmly as one on it, in place of softly as soon
            as the mode is single support: while it is still at the ground, the angular momentum
            would drag it along.
        leaking_momentum: the desired angular momentum (39a) is forgotten with time, in place of a
            pure integral, which drives the torso in a limit cycle.
        constant_weights: angular momentum and torso have constant weights in single support, in
            place of (39c), which chatters with the measured ZMP.
        safe_lift: a foot leaves the ground when CT-ZMP and divergent component are near the support
            foot too, for `shift_time`, in place of the ZMP alone (14e): while the COM slows down,
            the ZMP is in the foot already and the COM is not.
        loaded_stance: with both feet on the ground (D, TL, TR) the foot that carries more is taken
            to be at rest, in place of the left one in D and the one that shall carry in TL and TR.
        cancel: a device that is lowered before its foot has left the ground gives both feet back,
            in TL and TR and also in SL and SR; so does a shift that takes too long. A foot that has
            not left the ground is not pushed down either: that would push the robot over.
        held_feet: in double support the other foot is held where it was put down, in place of where
            it is (15d), which has no feedback.
        armed_landing: landing is looked for after the foot has been without load for a while, or
            carries on long after it should have left, and not while it is sent up.
        reachable: commands beyond the leg's reach or into the other foot are brought back.
        supported: the CT-ZMP is kept within the soles that carry, in place of (37) wherever the COM
            is; a_lim does not hold for braking, where it makes a COM that is fast overshoot; and it
            shortens both axes alike, so that the COM goes straight from foot to foot.
        steady_com: the COM's velocity is set to the measured one where contacts change only, in
            place of at every change of mode, which an operator who cannot decide makes often.
        gentle: the COM's height has a speed and an acceleration of its own, and the foot's way
            down speeds of its own, less and less between `clear_height` and the ground, in place of
            v_lim: at 1 m/s down the robot falls faster than it can carry, and a foot that lands
            hard kicks it.
        level_stance: a stance sole that is measured to be tilted is turned back slowly, in place of
            being taken to be level: a robot that has tipped onto an edge would stay there.
        rescue: a foot in the air is put down at once where it is, whatever the operator wants, when
            the divergent component has left the sole that carries.
        lift_first: a foot goes sideways or forward only as far as it is clear of the ground.
        bounded_tilt: the torso's attitude weighs the more the further it leans, in place of leaning
            as far as the angular momentum wants, which takes the joints to their limits.
        felt_velocity: the commanded velocity of the COM leaks into the measured one: while a sole
            rocks on its edge the COM moves by itself, which an integral does not notice.
        press_down: with both feet on the ground the one that is not the stance goes on down while
            it carries nothing, by at most `press_speed`: one that has only just touched with an
            edge would be held in the air, and the weight is shifted to it. As soon as it carries,
            it stands where it is: pressed further it would tip the robot over the edge of the sole
            at rest.
        smooth_swing: the swing foot's velocity is smoothed over a few ticks: where it jumps, as
            with the saturation (17c) or a device that jitters, the ZMP jumps too. Along the ground
            it is also slower the nearer the divergent component is to the sole's edge: swinging a
            leg takes angular momentum that the balance needs.
        stooping: the COM comes down as far as the legs need to reach their feet, in place of a
            constant height (15b): with it long steps can be taken, and feet far apart stay put. It
            goes no lower than the pitch of the ankles that carry lets their soles stay level.
    """

    firm_feet: bool = True
    firm_lift: bool = True
    leaking_momentum: bool = True
    constant_weights: bool = True
    safe_lift: bool = True
    loaded_stance: bool = True
    cancel: bool = True
    held_feet: bool = True
    armed_landing: bool = True
    reachable: bool = True
    supported: bool = True
    steady_com: bool = True
    gentle: bool = True
    level_stance: bool = True
    rescue: bool = True
    lift_first: bool = True
    bounded_tilt: bool = True
    felt_velocity: bool = True
    press_down: bool = True
    smooth_swing: bool = True
    stooping: bool = True


PAPER_RULES = Rules(
    firm_feet=False,
    firm_lift=False,
    leaking_momentum=False,
    constant_weights=False,
    safe_lift=False,
    loaded_stance=False,
    cancel=False,
    held_feet=False,
    armed_landing=False,
    reachable=False,
    supported=False,
    steady_com=False,
    gentle=False,
    level_stance=False,
    rescue=False,
    lift_first=False,
    bounded_tilt=False,
    felt_velocity=False,
    press_down=False,
    smooth_swing=False,
    stooping=False,
)
"""The paper's rules taken literally."""
