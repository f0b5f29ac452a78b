"""`speed_targets`: the ratios that the reduced controller should reach, beside what it reaches."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from benchmarks.result import TickResult

DIRECT, CASCADE = "direct", "cascade/osqp"

_CASCADE_AT_33 = {"double": 0.45, "single": 0.40}
"""Reduced over full tick by the cascade on OSQP; Ahn et al. 2024, Table 3: 0.45 and 0.33."""

_DIRECT_BY_JOINTS = {33: 0.70, 45: 0.55, 60: 0.45}
"""Reduced over full tick by the default solver."""

_NEVER_SLOWER_FROM = 24
_TIMES_FASTER, _ASSEMBLY, _SPREAD, _GROWTH = 8.0, 0.25, 2.0, 1.8


@dataclass(frozen=True, kw_only=True)
class Target:
    """A ratio, and what it should be.

    Attributes:
        target: what the ratio is.
        contacts: stance.
        value: the ratio as measured.
        relation: how it should stand to the bound.
        bound: the bound.
    """

    target: str
    contacts: str
    value: float
    relation: Literal["<=", ">="]
    bound: float

    @property
    def met(self) -> bool:
        """Whether the value keeps the bound."""
        return self.value <= self.bound if self.relation == "<=" else self.value >= self.bound

    def to_json(self) -> dict[str, Any]:
        """The target as JSON holds it."""
        return {**asdict(self), "met": self.met}


def speed_targets(results: Sequence[TickResult]) -> list[Target]:
    """Everything that can be said of the robots and stances that were timed.

    Args:
        results: of `bench_dof`.
    """
    targets: list[Target] = []
    for stance in dict.fromkeys(r.contacts for r in results):
        rows = {(r.joints, r.controller, r.solver): r for r in results if r.contacts == stance}
        targets += _stance_targets(stance, rows)
    return targets


def _stance_targets(stance: str, rows: dict[tuple[int, str, str], TickResult]) -> list[Target]:
    joints = sorted({n for n, _, _ in rows})

    def p50(n: int, controller: str, solver: str) -> float:
        return rows[n, controller, solver].p50_us

    def ratio(n: int, solver: str) -> float:
        return p50(n, "reduced", solver) / p50(n, "whole_body", solver)

    found: list[tuple[str, float, Literal["<=", ">="], float]] = []
    if 33 in joints:
        words = "33 joints: reduced over full tick, cascade/osqp"
        found.append((words, ratio(33, CASCADE), "<=", _CASCADE_AT_33[stance]))
    for n, bound in _DIRECT_BY_JOINTS.items():
        if n in joints:
            words = f"{n} joints: reduced over full tick, direct"
            found.append((words, ratio(n, DIRECT), "<=", bound))
    large = [n for n in joints if n >= _NEVER_SLOWER_FROM]
    if large:
        words = f"{_NEVER_SLOWER_FROM} joints and more: reduced over full tick, direct, most"
        found.append((words, max(ratio(n, DIRECT) for n in large), "<=", 1.0))
    if 33 in joints:
        words = "33 joints: full cascade/osqp over reduced direct"
        times = p50(33, "whole_body", CASCADE) / p50(33, "reduced", DIRECT)
        found.append((words, times, ">=", _TIMES_FASTER))
    for controller in ("whole_body", "reduced"):
        own = [rows[n, controller, DIRECT] for n in joints]
        shares = [(r.phases_us["assembly"] or 0.0) / r.p50_us for r in own]
        spread = max(r.p99_us / r.p50_us for r in own)
        found.append(
            (f"{controller} direct: assembly over tick, most", max(shares), "<=", _ASSEMBLY)
        )
        found.append((f"{controller} direct: p99 over p50, most", spread, "<=", _SPREAD))
        spread = max((r.cpu_p99_us or 0.0) / (r.cpu_p50_us or 1.0) for r in own)
        words = f"{controller} direct: p99 over p50 of processor time, most"
        found.append((words, spread, "<=", _SPREAD))
    if 33 in joints and 60 in joints:
        growth = p50(60, "reduced", DIRECT) / p50(33, "reduced", DIRECT)
        found.append(("reduced direct: 60 over 33 joints", growth, "<=", _GROWTH))
    return [
        Target(target=words, contacts=stance, value=round(value, 3), relation=relation, bound=bound)
        for words, value, relation, bound in found
    ]
