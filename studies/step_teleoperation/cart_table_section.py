"""Figure 6: the CoM shifter on the cart-table model, with three values of k_d."""

from collections.abc import Callable
from typing import Any

import numpy as np

from poise.locomotion import ComShifter
from studies.finding import Figure, Finding, Section, Table, draw
from studies.plan import Progress, StudyOptions
from studies.step_teleoperation.cart_table import CartFlywheelTable

_HEIGHT, _MASS, _STEP, _DT, _SECONDS = 0.765, 65.0, 0.21, 1e-3, 3.0
_SHARES = (0.7, 1.0, 1.6)
_SETTLED = 0.01
"""Settled means: within this share of the step."""

Response = tuple[float, np.ndarray, np.ndarray]
"""k_d [1/s], the ZMP and the CoM over time [m]."""


def cart_table_section(_options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    rule = ComShifter(_HEIGHT).kd
    responses = [_respond(share * rule) for share in _SHARES]
    progress(1.0, 2.0)
    overshoot = [float(zmp.max()) - _STEP for _, zmp, _ in responses]
    settle = [_settling(zmp) for _, zmp, _ in responses]
    # On a finer grid: which is the fastest of those that do not overshoot.
    grid = np.linspace(0.8, 1.5, 57)
    allowed = [
        (share, _settling(zmp))
        for share in grid
        for _, zmp, _ in [_respond(float(share) * rule)]
        if zmp.max() - _STEP < 1e-5
    ]
    fastest = float(min(allowed, key=lambda pair: pair[1])[0])
    progress(2.0, 2.0)
    return Section(
        prose=(
            "With the gain rule (30), `k_d = k_p / omega + omega`, the slower pole of (28) goes "
            "against its stable zero, and the ZMP arrives fast and without overshoot.",
            "Equation (25b) is misprinted. With (24c), `r = r_hat - u_2 / W`, it gives "
            "`r = 2 r_hat - r_ref`; (29), `r = r_ref`, takes `u_2 = W (r_hat - r_ref)`, which is "
            "what (39a) has with the signs of (2).",
        ),
        figures=(_figure(responses),),
        findings=(
            Finding(name="k_d by the gain rule (30)", paper=14.75, ours=rule, unit="1/s",
                    ok=abs(rule - 14.75) < 0.02, note="from k_p = 40 and omega = 3.58 /s"),
            Finding(name="overshoot of the ZMP under the gain rule", paper=0.0,
                    ours=1e3 * max(overshoot[1], 0.0), unit="mm", ok=overshoot[1] < 1e-5,
                    note="no overshoot under (30)"),
            Finding(name="overshoot of the ZMP with 0.7 times that k_d",
                    ours=1e3 * overshoot[0], unit="mm", ok=overshoot[0] > 1e-3,
                    note="a smaller k_d overshoots"),
            Finding(name="settling with 1.6 times that k_d over that of the rule",
                    ours=settle[2] / settle[1], ok=settle[2] > settle[1],
                    note="a larger k_d is slower; settled within 1% of the step"),
            Finding(name="k_d of the fastest response that does not overshoot, over the rule's",
                    paper=1.0, ours=fastest, ok=abs(fastest - 1.0) < 0.02,
                    note="the fastest of 57 values from 0.8 to 1.5 times the rule's"),
            *_rotated(),
        ),
        tables=(
            Table(
                title="Responses to a step of 0.21 m",
                header="k_d [1/s] | overshoot [mm] | settling time [s]",
                rows=tuple(
                    (round(kd, 2), 1e3 * max(over, 0.0), time)
                    for (kd, _, _), over, time in zip(responses, overshoot, settle, strict=True)
                ),
            ),
        ),
    )  # fmt: skip


def _respond(kd: float) -> Response:
    shifter = ComShifter(_HEIGHT, kd=kd)
    table = CartFlywheelTable(_HEIGHT, _MASS, np.zeros(1))
    reference, ticks = np.array([_STEP]), round(_SECONDS / _DT)
    zmp, com = np.empty(ticks), np.empty(ticks)
    for i in range(ticks):
        com[i] = table.position[0]
        table.step(
            shifter.acceleration(reference, table.position, table.velocity), np.zeros(1), _DT
        )
        zmp[i] = table.zmp[0]
    return kd, zmp, com


def _rotated() -> tuple[Finding, Finding]:
    """Eq. (29) with the body rotator of (39a), and with that of (25b) as printed."""
    weight = CartFlywheelTable(_HEIGHT, _MASS, np.zeros(2)).weight
    reference = np.array([_STEP, 0.5 * _STEP])

    def by_39a(cart_table_zmp: np.ndarray) -> np.ndarray:
        return weight * (cart_table_zmp - reference)

    def by_25b(cart_table_zmp: np.ndarray) -> np.ndarray:
        return weight * (reference - cart_table_zmp)

    right, printed = (_off_reference(reference, rates) for rates in (by_39a, by_25b))
    return (
        Finding(name="(29): the ZMP off its reference with shifter and rotator, by (39a)",
                paper=0.0, ours=1e3 * right, unit="mm", ok=right < 1e-9,
                note="r = r_ref, whatever the state"),
        Finding(name="(29): the ZMP off its reference, by (25b) as printed",
                paper=0.0, ours=1e3 * printed, unit="mm", ok=printed < 1e-9,
                note="a misprint: its sign makes (24c) r = 2 r_hat - r_ref, twice as far off as "
                     "without a rotator"),
    )  # fmt: skip


def _off_reference(
    reference: np.ndarray, momentum_rate: Callable[[np.ndarray], np.ndarray]
) -> float:
    """Return the largest ZMP error with the shifter and u_2 by the CT-ZMP [m]."""
    shifter, table = ComShifter(_HEIGHT), CartFlywheelTable(_HEIGHT, _MASS, np.zeros(2))
    off = 0.0
    for _ in range(round(_SECONDS / _DT)):
        acceleration = shifter.acceleration(reference, table.position, table.velocity)
        cart_table_zmp = shifter.cart_table_zmp(table.position, acceleration)
        table.step(acceleration, momentum_rate(cart_table_zmp), _DT)
        off = max(off, float(np.abs(table.zmp - reference).max()))
    return off


def _settling(zmp: np.ndarray) -> float:
    off = np.flatnonzero(np.abs(zmp - _STEP) > _SETTLED * _STEP)
    return _DT * float(off[-1] + 1)


def _figure(responses: list[Response]) -> Figure:
    def paint(canvas: Any) -> None:
        left, right = canvas.subplots(1, 2)
        for kd, zmp, com in responses:
            time = _DT * np.arange(len(zmp))
            left.plot(time, zmp, label=f"k_d = {kd:.2f} /s")
            right.plot(time, com)
        for panel, name in ((left, "ZMP [m]"), (right, "CoM [m]")):
            panel.axhline(_STEP, color="dimgrey", linestyle="--", linewidth=0.8)
            panel.set_xlabel("time [s]")
            panel.set_ylabel(name)
        left.legend(loc="lower right")

    return draw(
        name="figure-6",
        title="Figure 6: the CoM shifter with three values of k_d",
        caption="Step of the ZMP reference by 0.21 m on the cart-table model, a_lim = 0.8 m/s². "
        "The middle value is the gain rule's.",
        height=3.2,
        paint=paint,
    )
