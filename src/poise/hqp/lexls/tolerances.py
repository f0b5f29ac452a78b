"""What counts as zero in `lexls`, and when it gives up."""

RANK_TOLERANCE = 1e-9
"""A row depends on those before it where less than this share of it lies outside them."""

SLACK_TOLERANCE = 1e-12
"""Slack below this, relative to the numbers that cancel in it, is rounding."""

DEPENDENCE_TOLERANCE = 1e-13
"""A dependent row has no share of a pivot where less than this of it lies along the pivot's own
coordinate."""

CANCELLATION = 1e-13
"""Sums below this, relative to their terms, are zero: in the least squares of a level."""

FEASIBILITY_TOLERANCE = 1e-11
"""A row may leave its interval by this much relative to |a| |x|; more than `SLACK_TOLERANCE`, or
rows would be let go and called back for ever."""

DUAL_TOLERANCE = 1e-10
"""Multipliers of the wrong sign below this, relative to the forces that balance, are zero."""

FLAT_TOLERANCE = 1e-12
"""Curvatures of the final cost below this, relative to its largest coefficient, are zero."""

SAME_TOLERANCE = 1e-9
"""Residuals of which none is larger by more than this, relative to it, are the same."""

SINGULAR_TOLERANCE = 1e-6
"""Relative change at which the search for the least singular value of a level that may be damped
ends; where several lie close together, it finds one that is some percent too large."""

MOVE_TOLERANCE = 1e-12
"""A step shorter than this, relative to the point, is none."""

OPTIMALITY_TOLERANCE = 1e-8
"""Relative error of active rows, and of forces that should balance, up to which an answer counts as
exact."""

PATIENCE = 20
"""Changes without a step after which rows are let go by number, so as not to go in circles."""


ADD_SHARES = (0.5, 0.7, 0.6, 0.9, 0.8)
"""Of each leap in turn: rows violated by at least this share of the largest violation are added."""

DROP_SHARES = (0.0, 0.5, 0.0, 0.2, 0.0, 0.7, 0.1)
"""Likewise, rows that pull by at least this share of the strongest pull are let go. Because the
shares come in turn, and their numbers have no common divisor, few leaps go round in a circle."""


HARD, SOFT = 1e-14, 1e-8
"""How much rows give way in a guess, of the levels above and of the level at hand, relative to what
they do to x: D over |M|^2."""

MET_SHARE = 0.1
"""A level of a guess whose slack a correction leaves more of than this cannot be met."""

CORRECTIONS = 2
"""How often a guess corrects the levels above one that cannot be met."""

MET_TOLERANCE = 1e-6
"""Slack of a level below this, relative to its rows and to x, is none in a guess."""

FIRM_SHARE = 1e-8
"""In a guess, rows with less than this share of a level's largest multiplier are not in its way."""

GUESS_TOLERANCE = 1e-9
"""Violations below this, relative to the way from the final cost's optimum, are none in a guess."""

RIDGE = 1e-9
"""What a guess adds to the final cost's curvatures, relative to their mean."""

FLOOR = 1e-15
"""Pivots of a guess are at least this, relative to their rows: some depend on others."""

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
