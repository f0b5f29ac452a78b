"""`DEPARTURES`: every rule of step teleoperation that is not the paper's, and what it is for.

At velocity level; the table in docs/teleoperation.md has the same rows.
"""

from dataclasses import dataclass, field

_STEPPING = "poise.locomotion._stepping"
_FOOT, _STANCE = f"{_STEPPING}._feet", f"{_STEPPING}._stance"

_NONE, _ANY = 1e-9, 1e3
"""Numbers that take a rule's effect away: nothing of it, or as much as one likes."""


@dataclass(frozen=True, kw_only=True)
class Departure:
    """A rule of Poise in place of one of the paper's.

    Attributes:
        rule: Poise's.
        paper: the paper's.
        reason: for the departure.
        taken_back: changes with which it is as in the paper, see `changed`; empty where none
            does that.
    """

    rule: str
    paper: str
    reason: str
    taken_back: dict[str, float] = field(default_factory=dict[str, float])


DEPARTURES = (
    Departure(
        rule="servos of 70 /rad and 2.5 s/rad, over the joint's torque limit",
        paper="joints that do the commanded velocity, by servos whose gains are not given",
        reason="Poise's rules stand on these and on stiff servos (1000 and 50), where a foot "
        "touches a block of scenario 1. The paper's fall on these in scenarios 1, 2 and 3; on the "
        "stiff ones the measured ZMP jumps and (14e) holds at once, so that no foot leaves the "
        "ground there, or, where the ZMP is smoothed, they fall, too",
    ),
    Departure(
        rule="devices are guarded (`OperatorGuard`)",
        paper="(14), (15d): each sample as it comes",
        reason="a place more than 0.31 m from where the device is followed to is a jump that no "
        "hand makes, and is refused; so are samples that are old, late or no numbers, and a device "
        "is followed at 2.5 m/s at most. One that is silent for 0.5 s lets go of its foot",
    ),
    Departure(
        rule="the measured ZMP is smoothed",
        paper="the ZMP as measured",
        reason="load cells have noise, and soles that touch the ground knock",
        taken_back={f"{_STANCE}._estimator._ZMP_TIME": _NONE},
    ),
    Departure(
        rule="other foot firm in double support (`w_S2`)",
        paper="w_S2 = 100",
        reason='the "+I" of the SR-inverse lets feet drift until a sole rolls',
        taken_back={"w_S2": 100.0},
    ),
    Departure(
        rule="foot firm and straight up near the ground",
        paper="the foot is soft and goes anywhere as soon as the mode says so",
        reason="a foot that still touches is dragged over the ground, by angular momentum or by "
        "the operator",
        taken_back={f"{_STANCE}._footing._CLEAR_HEIGHT": _NONE},
    ),
    Departure(
        rule="angular momentum leaks (`momentum_leak`)",
        paper="(39a) as a pure integral",
        reason="the torso goes into a limit cycle",
        taken_back={"momentum_leak": _NONE},
    ),
    Departure(
        rule="L_Gd = 0 in D, TL and TR, and at each change of mode",
        paper="(39b): L_Gd stays what it was, its rate alone is zero",
        reason="what the last swing asked for has nothing to do with the next one; in double "
        "support it weighs next to nothing",
    ),
    Departure(
        rule="constant weights, and the torso's (`w_B1`) never ε",
        paper="weights by the measured ZMP error (39c)",
        reason="they chatter from edge to edge; with them the body rotator does not make the "
        "ZMP's largest excursion much smaller",
    ),
    Departure(
        rule="torso heavier the further it leans (`tilt_soft`)",
        paper="a torso that leans as far as (39) wants",
        reason="at 0.3 rad hip joints are at their limits and the COM cannot be placed",
        taken_back={"tilt_soft": _ANY},
    ),
    Departure(
        rule="COM above the foot that shall carry (`capture_max`, `ct_zmp_max`, `shift_time`)",
        paper="(14e), the ZMP alone",
        reason="while the COM brakes, the ZMP is in the foot and the COM is not; CT-ZMP and "
        "divergent component, commanded and measured, must be near too, for `shift_time`",
        taken_back={"capture_max": _ANY, "ct_zmp_max": _ANY, "shift_time": _NONE},
    ),
    Departure(
        rule="CT-ZMP on the soles, and one factor for both axes",
        paper="(37) wherever the COM is, each axis by itself",
        reason="the CT-ZMP is kept on the soles, and the COM goes straight from foot to foot; "
        "a_lim does not hold for braking. Without saturation (37) under the gain rule is "
        "Sugihara's regulator (33) with k_s = 1 + k_p / ω², so this gives it its limits back",
    ),
    Departure(
        rule="(37) is fed the COM's commanded velocity",
        paper="the measured one",
        reason="servos lag, and what is measured jumps as soles rock and legs swing: with it the "
        "paper's rules fall sooner in scenarios 1 to 3, on servos as soft as these",
    ),
    Departure(
        rule="COM's commanded velocity begins anew, as measured, when contacts change",
        paper='"simple time integration" from the beginning on',
        reason="what is commanded and what the robot does part at each landing and lift, and never "
        "meet again; not at every change of mode: an operator who cannot decide makes many. "
        "Measured is an observed velocity, made smooth with the commanded acceleration: at the "
        "moment of a landing the bare one is that of a shock, and the robot would follow it",
    ),
    Departure(
        rule="COM's commanded velocity leaks into the measured one (`velocity_leak`)",
        paper="a commanded COM velocity that is only integrated",
        reason="while a sole rocks on its edge the COM moves by itself; the integral leaks into "
        "what is measured",
        taken_back={"velocity_leak": _NONE},
    ),
    Departure(
        rule="the body leans over the foot that carries where that foot's hip is weak",
        paper="an upright torso (17b)",
        reason="upright on one foot the hip is beside that foot by half the hips' distance, and "
        "holds the body's weight at that lever; hips of 30 N m under 31 kg do not, and some turn "
        "in by 0.1 rad only. Measured from the model: as far as 70% of the hip's torque and 80% of "
        "its range need, at most 0.2 rad; zero for the paper's robot, G1 and TALOS",
    ),
    Departure(
        rule="stance by load",
        paper="the left foot as the stance in D, the support foot in TL and TR",
        reason="in D, TL and TR the foot that carries more is the one at rest",
    ),
    Departure(
        rule="stance sole turned back onto its ground (`k_level`)",
        paper="a stance sole that is level by definition",
        reason="a robot on the edge of a sole would stay there. What the ground is, the sole says "
        "and no level: see “Soles and their ground”",
        taken_back={"k_level": _NONE},
    ),
    Departure(
        rule="foot in the air parallel to the stance's ground",
        paper="level (15e)",
        reason="on a slope, or with an attitude that is off, a level sole lands on an edge",
    ),
    Departure(
        rule="other foot held on the ground, and giving way as it carries",
        paper="(15d) in D, TL, TR, which has no feedback",
        reason="without load a foot is held where it was put down; with load that would be a "
        "closed chain whose servos wind up: it yields to its contact, and is lifted or lowered "
        "until it carries what the ZMP asks for, in a shift the CT-ZMP: where joints sag the "
        "weight stays where it was",
    ),
    Departure(
        rule="foot without load pressed down",
        paper="a foot that stays where it was when landing was felt",
        reason="one that touched with an edge would hang in the air; without load it goes down, by "
        "at most 0.1 m/s, and stands where it is as soon as it carries: pressed further it "
        "would tip the robot over the edge of the other sole. One that is about to be lifted is "
        "not pressed: that drums it on the ground, and throws the ZMP to the far edge of the other",
        taken_back={f"{_STANCE}._estimator._PRESS_SPEED": _NONE},
    ),
    Departure(
        rule="COM comes down for the legs to reach (`stoop_max`)",
        paper="a constant COM height (15b)",
        reason="the COM comes down as far as the legs need for their feet, now and at the end of a "
        "shift, but no lower than the ankles' pitch lets the soles that carry stay level and than "
        "knees hold up with 0.7 of their torque (on one leg all of the weight, on two half of it "
        "each), and for no target below the floor: the body would be coming down when the foot "
        "lands",
        taken_back={"stoop_max": _NONE},
    ),
    Departure(
        rule="gentle heights of COM and foot (`lift_speed`, `lower_speed`)",
        paper="v_lim for everything",
        reason="at 1 m/s down the robot falls faster than it can carry, and a foot that lands hard "
        "kicks it: from 4 cm above the ground its speed falls from `lower_speed` to "
        "0.15 m/s",
        taken_back={
            "lift_speed": 1.0, "lift_acceleration": _ANY, "lower_speed": 1.0,
            f"{_FOOT}._TOUCH_SPEED": 1.0,
        },
    ),
    Departure(
        rule="smooth swing",
        paper="a foot velocity that jumps, however near the robot is to tipping",
        reason="the ZMP jumps with it; and swinging takes angular momentum that the balance needs, "
        "so along the ground the foot is slower the nearer the divergent component is to the "
        "sole's edge",
        taken_back={f"{_FOOT}._SWING_TIME": _NONE},
    ),
    Departure(
        rule="commands within reach",
        paper="commands anywhere",
        reason="a foot that is sent out of reach pulls the robot over",
    ),
    Departure(
        rule="legs kept off each other",
        paper="a foot goes where it is sent, whatever is there",
        reason="feet that have come down pressed together throw the robot at its next shift",
    ),
    Departure(
        rule="a step can be taken back",
        paper="no way back from TL, TR, nor from SL, SR while the foot is still on the ground",
        reason="an operator may think better of a step; and a foot that has not left the ground is "
        "not pushed down, which would push the robot over",
    ),
    Departure(
        rule="landing after unloading only",
        paper="load alone",
        reason="a foot that scrapes on its way up has not landed",
    ),
    Departure(
        rule="rescue",
        paper="the operator decides",
        reason="when the divergent component leaves the sole, the foot in the air comes down",
    ),
    Departure(
        rule="joints within their bounds, knees bent, W_B at most 1e4",
        paper="(19) to (23) without bounds, with any W_B",
        reason="a simulated joint has a range and a greatest speed; a straight knee has no way to "
        "move the COM up or down. The study's leader of the paper's rules keeps these",
    ),
)  # fmt: skip
"""In the order of a tick's work, as far as it goes."""


def as_markdown() -> str:
    """The table of docs/teleoperation.md."""
    rows = [f"| {d.rule} | {d.paper} | {d.reason} |" for d in DEPARTURES]
    return "\n".join(["| rule | in place of | why |", "| --- | --- | --- |", *rows])
