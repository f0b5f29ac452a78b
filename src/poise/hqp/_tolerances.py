"""Tolerances and limits of the hierarchical QP: all its constants.

They are no arguments: state problems in units in which quantities that matter are above them.
"""

# --- accuracies, from one sum to a whole answer ------------------------------------------------

CANCELLATION = 1e-13
"""Sums below this, relative to their terms, are zero: a few hundred roundings."""

SLACK_TOLERANCE = 1e-12
"""Slacks and curvatures below this, relative to the numbers that cancel in them, are rounding."""

POINT_TOLERANCE = 1e-11
"""Room of a row outside its interval, relative to |a| |x|, and length of a step, relative to the
point, that are rounding; above `SLACK_TOLERANCE`, or rows would alternate without end."""

FACTOR_TOLERANCE = 1e-10
"""Part of its terms that a factorisation leaves of a zero: a multiplier of the wrong sign, an
eigenvalue below zero, a row after projection; of exactly dependent rows, 1e-15 is left."""

RANK_TOLERANCE = 1e-9
"""Rows depend on those before them where less than this part of them lies outside, and a curvature
that is this part of the mean bounds a flat direction of the final cost."""

MET_TOLERANCE = 1e-9
"""Relative difference up to which numbers are equal: the residual of a level that counts as met,
a row and its bound by `max(1, |a| |x|)`, the residuals of two points, H and its transpose, and g
and what H curves."""

OPTIMALITY_TOLERANCE = 1e-8
"""Relative error of an answer: of active rows, of terms that should balance, of the slack and the
residual of a level after it was solved, and of an iteration that no longer converges."""

CERTIFIED = 1e-7
"""Ten times that: certain. A row this close to its bound counts as active, a multiplier above this
part of the largest is positive, and a larger imbalance is none of rounding."""

COARSE = 1e-6
"""Relative accuracy of what need not be exact: a level's least singular value, the slack of a
level in a guess, the multipliers that explain a slack, and an iteration that may count."""

# --- the active-set solver: its phases ---------------------------------------------------------

STEEP = 1e3
"""A dependent row this many times longer than its pivots magnifies the rounding of their slack."""

CANCELLED = 1e-5
"""Squares smaller than this by subtraction, relatively, are recomputed."""

PATIENCE = 20
"""Changes without a step after which rows are deactivated by number, against cycles; after three
times as many, a reactivated row stays active, as does one that came back more often than this."""

ADD_RATIOS = (0.5, 0.7, 0.6, 0.9, 0.8)
"""Of each leap in turn: part of the largest violation from which rows are added."""

DROP_RATIOS = (0.0, 0.5, 0.0, 0.2, 0.0, 0.7, 0.1)
"""Of each leap in turn: part of the largest multiplier of the wrong sign that drops a row.
The lengths of the two lists have no common divisor, against cycles."""

MANY = 2
"""Wrong rows up to which exchanges or single steps follow."""

COLD_CHANGES, WARM_CHANGES = 3, 12
"""Changes from no active set, or from that of the last solve, after which a guess costs less."""

ASTRAY = 100
"""Changes after which a search with a guess restarts from the empty active set."""

MOST_EXCHANGES = 4
"""Exchanges, and leaps without fewer wrong rows than before, after which single steps follow."""

MOST_LEAPS = 25
"""Leaps after which single steps follow."""


def changes_allowed(n: int, m: int) -> int:
    """Return the cap on changes of the active set."""
    return 50 + 10 * (n + m)


# --- the active-set solver: the guess ---------------------------------------------------------

HARD, SOFT = 1e-14, 1e-8
"""Compliance of rows in a guess, of the levels above and of the level at hand: D over |M|^2."""

UNMET_RATIO = 0.1
"""Part of a level's slack after a correction above which a guess takes the level for unmet."""

FLOOR = 1e-15
"""Least pivot of a guess, relative to its row, for rows that depend on others."""

# --- the cascade ------------------------------------------------------------------------------

ACCURACY: dict[str, float] = {
    "daqp": 1e-8,
    "proxqp": 1e-8,
    "quadprog": 1e-6,
    "piqp": 1e-6,
    "clarabel": 1e-6,
    "osqp": 1e-3,
}
"""Drift of a level's slack by the end of a cascade, relative to its scale, from which it is
INACCURATE, by backend."""

SLOPS = (0.0, 1e-10, 1e-9, 1e-8, 1e-7)
"""Widening of held rows in turn, relative to their size, where the backend finds no point: the set
that earlier levels leave may be too thin for it."""

# --- QP backends ------------------------------------------------------------------------------

DEFINITE = 1e-8
"""Least curvature, relative to the largest, of a P that a factorisation can rely on."""

PROXIMAL_RATIOS = (1e-7, 1e-5, 1e-3)
"""Proximal weights in turn, relative to P's largest entry. The smallest converges fastest, but
magnifies the backend's own tolerance: a larger one follows where rows are missed. Of 2,000 random
hierarchies all were right so, against 2 to 13 wrong with any single weight."""
