"""The floating base under a stance contact: its velocity follows from the joints'."""

import numpy as np
from jaxtyping import Float64

BASE = 6
"""Velocities of a floating base."""


def base_from_joints(
    contact_jacobian: Float64[np.ndarray, "6 nv"],
) -> Float64[np.ndarray, "6 nj"]:
    """X in v_base = X u, for a contact frame that stands still.

    From J_b v_base + J_j u = 0 follows X = -J_b^-1 J_j: equation (11) of Zhang and Kikuuwe for any
    frame, in any axes. J_b only moves a velocity from the base to the contact and can always be
    inverted.

    Args:
        contact_jacobian: Jacobian of the contact frame, six rows.
    """
    return np.linalg.solve(contact_jacobian[:, :BASE], -contact_jacobian[:, BASE:])


def constrained(
    jacobian: Float64[np.ndarray, "m nv"], base_map: Float64[np.ndarray, "6 nj"]
) -> Float64[np.ndarray, "m nj"]:
    """A Jacobian under the stance constraint, J_j + J_b X, which maps joint velocities alone.

    For the COM and the centroidal momentum this is (13) of Zhang and Kikuuwe.

    Args:
        jacobian: maps the whole velocity v = [v_base; u].
        base_map: X.
    """
    return jacobian[:, :BASE] @ base_map + jacobian[:, BASE:]
