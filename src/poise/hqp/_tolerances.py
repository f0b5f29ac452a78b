"""Tolerances and limits of the hierarchical QP: all its constants.

They are no arguments: state problems in units in which quantities that matter are above them.
"""

# --- solutions --------------------------------------------------------------------------------

MET_TOLERANCE = 1e-9
"""Largest relative residual of a level that counts as met, and violation of a row in a cascade,
relative to `max(1, |a| |x|)`."""

VISIBLE_VIOLATION = 1e-8
"""Violations below this, relative to the level's largest, are rounding in an explanation."""

OPPOSING_RATIO = 1e-6
"""Multipliers below this, relative to the level's largest, oppose no row in an explanation."""

# --- checks of a problem ----------------------------------------------------------------------

COST_TOLERANCE = 1e-9
"""Relative asymmetry of H above which it is no Hessian, and part of g along a direction that H does
not curve, above which the final cost has no minimum."""

DEFINITENESS_TOLERANCE = 1e-10
"""Relative rounding below zero of the smallest eigenvalue of a semidefinite H."""

# --- the active-set solver: numbers that are zero ---------------------------------------------

RANK_TOLERANCE = 1e-9
"""Rows depend on those before them where less than this part of them lies outside: in the
factorisation, the certificate and the cascade."""

SLACK_TOLERANCE = 1e-12
"""Slack below this, relative to the numbers that cancel in it, is rounding."""

DEPENDENCE_TOLERANCE = 1e-13
"""Parts of a dependent row below this, along a pivot's own coordinate or outside all pivots, are
rounding."""

CANCELLATION = 1e-13
"""Sums below this, relative to their terms, are zero: in the least squares of a level."""

STEEP = 1e3
"""A dependent row this many times longer than its pivots magnifies the rounding of their slack."""

FEASIBILITY_TOLERANCE = 1e-11
"""Room of a row outside its interval, relative to |a| |x|; above `SLACK_TOLERANCE`, or rows would
alternate without end."""

DUAL_TOLERANCE = 1e-10
"""Multipliers of the wrong sign below this, relative to the terms that balance, are zero."""

FLAT_TOLERANCE = 1e-12
"""Curvatures of the final cost below this, relative to its largest coefficient, are zero."""

SAME_TOLERANCE = 1e-9
"""Residuals whose relative difference is below this are the same."""

SINGULAR_TOLERANCE = 1e-6
"""Relative change that ends the iteration for a level's least singular value, which is some percent
too large where several lie close together."""

SINGULAR_ROUNDS = 30
"""Inverse iterations for it at most."""

MOVE_TOLERANCE = 1e-11
"""Steps shorter than this, relative to the point, are rounding of the rows."""

OPTIMALITY_TOLERANCE = 1e-8
"""Relative error, in an exact answer, of active rows, of terms that should balance, and of the
residual of a level after it was solved."""

CANCELLED = 1e-5
"""Squares smaller than this by subtraction, relatively, are recomputed."""

# --- the active-set solver: changes of its phase ----------------------------------------------

PATIENCE = 20
"""Changes without a step after which rows are deactivated by number, against cycles."""

RESIGNED = 60
"""Changes without a step after which a reactivated row stays active, against cycling."""

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
"""Exchanges after which single steps follow."""

MOST_LEAPS = 25
"""Leaps after which single steps follow."""

LEAP_PATIENCE = 4
"""Leaps without fewer wrong rows than ever before, after which single steps follow."""


def changes_allowed(n: int, m: int) -> int:
    """Return the cap on changes of the active set."""
    return 50 + 10 * (n + m)


# --- the active-set solver: the guess ---------------------------------------------------------

HARD, SOFT = 1e-14, 1e-8
"""Compliance of rows in a guess, of the levels above and of the level at hand: D over |M|^2."""

UNMET_RATIO = 0.1
"""Part of a level's slack after a correction above which a guess takes the level for unmet."""

CORRECTIONS = 2
"""Corrections in a guess of the levels above one that cannot be met."""

GUESS_SLACK_TOLERANCE = 1e-6
"""Slack of a level below this, relative to its rows and to x, is none in a guess."""

HOLDING_RATIO = 1e-8
"""Part of a level's largest multiplier below which a row does not oppose it in a guess."""

GUESS_TOLERANCE = 1e-9
"""Violations below this, relative to the distance from the final cost's optimum, are none in a
guess."""

RIDGE = 1e-9
"""Curvature that a guess adds to the final cost, relative to its mean."""

FLOOR = 1e-15
"""Least pivot of a guess, relative to its row, for rows that depend on others."""

# --- the certificate --------------------------------------------------------------------------

CERTIFIED_ACTIVE = 1e-7
"""A row this close to its bound, relative to its size, counts as active."""

CERTIFIED_SLACK = 1e-8
"""Slack below this, relative to the row's size, is rounding: the row counts as met, with any
multiplier that so much slack allows."""

CERTIFIED_MULTIPLIER = 1e-7
"""Multipliers above this part of the largest are certainly positive."""

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

HELD_ACTIVE = 1e-8
"""Held rows this close to their bound, relative to their size, may carry a multiplier."""

HELD_BALANCE = 1e-7
"""Relative imbalance above which multipliers are uncertain."""

HELD_MULTIPLIER = 1e-6
"""Multipliers above this part of the level's largest term are certainly positive."""

PROJECTION_RANK = 1e-10
"""Part of a row after projection below which it is dependent; of exactly dependent ones, 1e-15.
Singular values of a certificate's free rows below this, relative to the largest, are zero."""

# --- QP backends ------------------------------------------------------------------------------

DEFINITE = 1e-8
"""Least curvature, relative to the largest, of a P that a factorisation can rely on."""

SINGULAR_COST = 1e-12
"""Singular values of P below this, relative to the largest, are zero where a QP has no rows."""

PROXIMAL_RATIOS = (1e-7, 1e-5, 1e-3)
"""Proximal weights in turn, relative to P's largest entry. The smallest converges fastest, but
magnifies the backend's own tolerance: a larger one follows where rows are missed. Of 2,000 random
hierarchies all were right so, against 2 to 13 wrong with any single weight."""

PROXIMAL_STEPS = 300
"""Most repetitions; two or three are usual, more along directions of little curvature."""

PROXIMAL_CREEP = 10
"""Repetitions after which a slope that the QP allows may remain."""

PROXIMAL_STEP = 1e-11
"""The repetition ends when a step is this small, relative to the point."""

PROXIMAL_NOISE = 1e-8
"""Steps this small that no longer shrink are rounding, magnified by the weak curvature."""

PROXIMAL_FEASIBILITY = 1e-10
"""Rows violated by more than this, relative to their size, call for a larger curvature: a small one
magnifies the backend's own tolerance."""

PROXIMAL_FAILURE = 1e-6
"""Last step, relative to the point, above which the repetitions did not converge."""

# --- the weighted QP --------------------------------------------------------------------------

LEFT_OVER = 0.01
"""Error of the lowest level of tasks that may remain along directions of next to no cost, such as
internal forces between two feet [unit/s^2]."""

WEIGHT_SPAN = 1e6
"""Largest weight of a level in the cost, relative to the final cost: beyond it, for want of
precision, DAQP finds no point."""
