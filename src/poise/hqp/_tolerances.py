"""What counts as zero in the hierarchical QP, and when each method gives up: all its constants.

They are constants and no arguments: state problems in units in which what matters is above them.
"""

# --- what a user sees -------------------------------------------------------------------------

RELAXED = 1e-9
"""Relative residual above which a level of the strategy `direct` counts as not met."""

MET_TOLERANCE = 1e-9
"""Largest violation, relative to `max(1, |a| |x|)`, of a row that counts as met: in the strategies
cascade and weighted."""

VISIBLE_VIOLATION = 1e-8
"""Violations below this, relative to the level's largest, are rounding and not worth words."""

OPPOSING_RATIO = 1e-6
"""Multipliers below this, relative to the level's largest, oppose nobody in an explanation."""

# --- a problem that is stated -----------------------------------------------------------------

SYMMETRY_TOLERANCE = 1e-9
"""Relative asymmetry of H above which it was hardly meant to be a Hessian."""

DEFINITENESS_TOLERANCE = 1e-10
"""Relative size below zero that rounding may give the smallest eigenvalue of a semidefinite H."""

RANGE_TOLERANCE = 1e-9
"""Relative part of g along a direction that H does not curve, above which the final cost has no
minimum."""

# --- the active-set solver: numbers that are zero ---------------------------------------------

RANK_TOLERANCE = 1e-9
"""A row depends on those before it where less than this part of it lies outside them."""

SLACK_TOLERANCE = 1e-12
"""Slack below this, relative to the numbers that cancel in it, is rounding."""

DEPENDENCE_TOLERANCE = 1e-13
"""A dependent row has nothing of a pivot where less than this part of it lies along the pivot's own
coordinate; of a row of which less than this is left, that is rounding."""

CANCELLATION = 1e-13
"""Sums below this, relative to their terms, are zero: in the least squares of a level."""

STEEP = 1e3
"""A dependent row this many times longer than the pivots it depends on magnifies what rounding
leaves of their slack."""

FEASIBILITY_TOLERANCE = 1e-11
"""A row may leave its interval by this much relative to |a| |x|; more than `SLACK_TOLERANCE`, or
rows would be deactivated and activated again for ever."""

DUAL_TOLERANCE = 1e-10
"""Multipliers of the wrong sign below this, relative to the terms that balance, are zero."""

FLAT_TOLERANCE = 1e-12
"""Curvatures of the final cost below this, relative to its largest coefficient, are zero."""

SAME_TOLERANCE = 1e-9
"""Residuals of which none is larger by more than this, relative to it, are the same."""

SINGULAR_TOLERANCE = 1e-6
"""Relative change at which the search for the least singular value of a level that may be damped
ends; where several lie close together, it finds one that is some percent too large."""

SINGULAR_ROUNDS = 30
"""Inverse iterations of that search at most."""

MOVE_TOLERANCE = 1e-11
"""A step shorter than this, relative to the point, is none: rows may be as far from their bounds as
that."""

OPTIMALITY_TOLERANCE = 1e-8
"""Relative error of active rows, and of terms that should balance, up to which an answer counts as
exact; and change of a level's residual after the level was solved, up to which nothing moved it."""

CANCELLED = 1e-5
"""Squares that became smaller than this by subtraction, relatively, are computed anew."""

# --- the active-set solver: when the search goes on in another way ----------------------------

PATIENCE = 20
"""Changes without a step after which rows are deactivated by number, so as not to go in circles."""

RESIGNED = 60
"""Changes without a step after which a row that comes back stays: rows at this point take turns."""

ADD_RATIOS = (0.5, 0.7, 0.6, 0.9, 0.8)
"""Of each leap in turn: rows violated by at least this part of the largest violation are added."""

DROP_RATIOS = (0.0, 0.5, 0.0, 0.2, 0.0, 0.7, 0.1)
"""Of each leap in turn: rows whose multiplier of the wrong sign is at least this part of the
largest such are dropped. Because the ratios come in turn, and their numbers have no common divisor,
few leaps go round in a circle."""

MANY = 2
"""Wrong rows up to which single steps are the way to go on."""

COLD_CHANGES, WARM_CHANGES = 3, 12
"""Changes from no active set, or from that of the last solve, after which a guess costs less."""

ASTRAY = 100
"""Changes after which a search that a guess did not help begins anew, from no active set."""

MOST_EXCHANGES = 4
"""Exchanges after which the search goes step by step."""

MOST_LEAPS = 25
"""Leaps after which the search goes step by step."""

LEAP_PATIENCE = 4
"""Leaps without fewer wrong rows than ever before, after which it does so, too."""


def changes_allowed(n: int, m: int) -> int:
    """Changes of the active set after which a search ends with the point that it has."""
    return 50 + 10 * (n + m)


# --- the active-set solver: the guess ---------------------------------------------------------

HARD, SOFT = 1e-14, 1e-8
"""Compliance of rows in a guess, of the levels above and of the level at hand, relative to what
they do to x: D over |M|^2."""

UNMET_RATIO = 0.1
"""A level of a guess whose slack a correction leaves more of than this cannot be met."""

CORRECTIONS = 2
"""How often a guess corrects the levels above one that cannot be met."""

GUESS_SLACK_TOLERANCE = 1e-6
"""Slack of a level below this, relative to its rows and to x, is none in a guess."""

HOLDING_RATIO = 1e-8
"""In a guess, rows with less than this part of a level's largest multiplier do not hold it up."""

GUESS_TOLERANCE = 1e-9
"""Violations below this, relative to the distance from the final cost's optimum, are none in a
guess."""

RIDGE = 1e-9
"""What a guess adds to the final cost's curvatures, relative to their mean."""

FLOOR = 1e-15
"""Pivots of a guess are at least this, relative to their rows: some depend on others."""

# --- certifying a point -----------------------------------------------------------------------

CERTIFIED_ACTIVE = 1e-7
"""A row this close to its bound, relative to its size, counts as active."""

CERTIFIED_SLACK = 1e-8
"""Slack below this, relative to the row's size, is rounding: such a row is met, and what it does to
the others of its level may be anything that so much slack would do."""

CERTIFIED_MULTIPLIER = 1e-7
"""Multipliers above this part of the largest are certainly positive."""

CERTIFIED_RANK = 1e-9
"""Rows of which no more than this part lies outside the free ones depend on them."""

BALANCE_RANK = 1e-10
"""Singular values of the free rows below this, relative to the largest, are zero."""

# --- the cascade ------------------------------------------------------------------------------

ACCURACY: dict[str, float] = {
    "daqp": 1e-8,
    "proxqp": 1e-8,
    "quadprog": 1e-6,
    "piqp": 1e-6,
    "clarabel": 1e-6,
    "osqp": 1e-3,
}
"""How far a level's slack, relative to its scale, may have drifted by the end of a cascade before
the answer is called INACCURATE. The one table of tolerances, by backend."""

SLOPS = (0.0, 1e-10, 1e-9, 1e-8, 1e-7)
"""How far held rows are widened, relative to their size, when the backend finds no point: what
earlier levels left may be too thin for it to enter."""

HELD_ACTIVE = 1e-8
"""Held rows this close to their bound, relative to their size, may carry a multiplier."""

HELD_BALANCE = 1e-7
"""Terms that balance no better than this, relative to the largest, say nothing about rows."""

HELD_MULTIPLIER = 1e-6
"""Multipliers above this part of the level's largest term are certainly positive."""

PROJECTION_RANK = 1e-10
"""Rows of which a projection leaves less than this part depend on what was projected out: what is
left of an exactly dependent row after two projections is near 1e-15."""

PIVOT_RANK = 1e-9
"""Pivots of unit rows below this are zero: such a row is a combination of the rows before it."""

# --- QP backends ------------------------------------------------------------------------------

DEFINITE = 1e-8
"""Least curvature, relative to the largest, of a P that a factorisation can rely on."""

SINGULAR_COST = 1e-12
"""Singular values of P below this, relative to the largest, are zero where a QP has no rows."""

PROXIMAL_RATIOS = (1e-7, 1e-5, 1e-3)
"""Curvatures added, relative to P's largest entry, for backends that factor a singular P: the
smallest converges fastest, a larger one is tried where the backend finds no point with it."""

PROXIMAL_STEPS = 300
"""Most repetitions; two or three are usual, more where a level barely curves a direction."""

PROXIMAL_CREEP = 10
"""Repetitions after which a slope that the problem allows may be left over."""

PROXIMAL_STEP = 1e-11
"""The repetition ends when a step is this small, relative to the point."""

PROXIMAL_NOISE = 1e-8
"""Steps this small that no longer shrink are rounding, magnified by the weak curvature."""

PROXIMAL_FEASIBILITY = 1e-10
"""Rows violated by more than this, relative to their size, call for a larger curvature: a small one
magnifies the backend's own tolerance."""

PROXIMAL_FAILURE = 1e-6
"""A last step larger than this says that the repetitions did not converge."""

# --- the weighted QP --------------------------------------------------------------------------

LEFT_OVER = 0.01
"""Of the lowest level of tasks, what a cost that is flat elsewhere may leave over: internal forces
between two feet cost next to nothing [unit/s^2]."""

WEIGHT_SPAN = 1e6
"""How much dearer the highest level of a cost may be than the final cost below all levels: wider
costs use up double precision, and DAQP finds no point."""
