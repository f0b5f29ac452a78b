"""Inverses of one level's rows: the right inverse (22c), and the SR-inverse (22e)."""

from typing import Any, cast

import numpy as np
from jaxtyping import Float64
from scipy.linalg import lapack as _scipy_lapack

from poise.control.osf.rank import RankTreatment

_lapack: Any = cast("Any", _scipy_lapack)  # SciPy's stubs do not know the wrapped routines


def right_inverse(
    jacobian: Float64[np.ndarray, "m n"],
    velocity: Float64[np.ndarray, " m"],
    scale: Float64[np.ndarray, " m"],
    rank: RankTreatment,
) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, "n n"]]:
    """Least step that gives a velocity, J^+ v with J^+ = J^T (J J^T)^-1, and the space it fills.

    Equation (22c) of Zhang and Kikuuwe, which has no answer where J J^T cannot be inverted. There,
    directions get the share that `rank` gives them, from all of them down to none.

    LAPACK's `dtrtrs` and its like are kept away from: they wait for threads on a busy machine.

    Args:
        jacobian: J.
        velocity: v.
        scale: what rows are multiplied by where ranks are decided: one over the size that their
            block of rows has in the home posture.
        rank: what happens to directions that are lost.

    Returns:
        The step, and P = J^+ J, which projects on the space that J takes from those below it.
    """
    rows, wanted = jacobian * scale[:, None], velocity * scale
    gram = rows @ rows.T
    shifted = gram.copy()
    shifted.flat[:: len(scale) + 1] -= rank.high * rank.high
    if _lapack.dpotrf(shifted, lower=1, overwrite_a=1)[1] == 0:
        factor = _lapack.dpotrf(gram, lower=1)[0]
        inverse_factor = _lapack.dtrtri(factor, lower=1)[0]
        basis = inverse_factor @ rows
        return basis.T @ (inverse_factor @ wanted), basis.T @ basis
    squares, directions = np.linalg.eigh(gram)
    _, gain = rank.shares(squares)
    turned = directions.T @ rows
    shared = turned.T * gain
    return shared @ (directions.T @ wanted), shared @ turned


def robust_step(
    jacobian: Float64[np.ndarray, "m n"],
    velocity: Float64[np.ndarray, " m"],
    weight: Float64[np.ndarray, " m"],
) -> Float64[np.ndarray, " n"]:
    """The step J^# v of the singularity-robust inverse J^# = (J^T W J + I)^-1 J^T W.

    Equation (22e) of Zhang and Kikuuwe: it minimises |J x - v|^2_W + |x|^2, so that |x| is at most
    sqrt(w) |v| / 2 for a weight w, singular or not. It is found as B^T (B B^T + I)^-1 sqrt(W) v
    with B = sqrt(W) J, which is the same.

    Args:
        jacobian: J.
        velocity: v.
        weight: diagonal of W, not negative.
    """
    root = np.sqrt(weight)
    rows = jacobian * root[:, None]
    gram = rows @ rows.T
    gram.flat[:: len(root) + 1] += 1.0
    return rows.T @ _lapack.dposv(gram, root * velocity, lower=1)[1]
