import re

import numpy as np
import pytest

import poise
from poise.errors import ConfigurationError, TargetError, UnknownNameError
from poise.stack import Contact, Stack, SurfaceContact

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("value", [-0.1, NAN, INF])
def test_ramps_take_a_finite_time(value):
    contact = SurfaceContact("left_sole")
    for move in (contact.release, contact.engage):
        with pytest.raises(ConfigurationError, match="duration"):
            move(value)
    assert contact.active


def test_an_unknown_frame_is_refused_with_choices(get_robot):
    with pytest.raises(UnknownNameError, match="left_sole"):
        SurfaceContact("left_sol").bind(get_robot("g1"))


def test_a_frame_that_is_no_sole_needs_a_size(get_robot):
    with pytest.raises(ConfigurationError, match="length and width.*left_sole"):
        SurfaceContact("left_hand").bind(get_robot("g1"))
    with pytest.raises(ConfigurationError, match="length and width"):
        SurfaceContact("left_hand", length=0.1).bind(get_robot("g1"))


def test_a_margin_as_large_as_the_sole_is_refused(get_robot):
    with pytest.raises(ConfigurationError, match="leaves nothing"):
        SurfaceContact("left_sole", margin=0.2).bind(get_robot("g1"))


class ConeContact(Contact):
    """A point whose cone is whatever it is given."""

    def __init__(self, frame, cone, dim=3):
        super().__init__(frame, friction=0.5, damping=10.0, min_load=0.0, dim=dim, name="hook")
        self._given = cone

    def _make_cone(self, robot):
        return self._given


@pytest.mark.parametrize("shape", [(0, 3), (2, 6), (3,)])
def test_a_cone_without_rows_or_with_other_columns_than_the_wrench_is_refused(get_robot, shape):
    contact = ConeContact("left_hand", np.zeros(shape))
    stack = Stack(contacts=[contact], levels=[])
    wanted = r"got " + re.escape(str(shape)) + r"; wanted \(rows, 3\) with at least one row"
    with pytest.raises(ConfigurationError, match=f"cone of contact 'hook'.*{wanted}"):
        poise.WholeBodyController(get_robot("humanoid33"), stack)


class PivotContact(ConeContact):
    """A point that does not turn about the vertical."""

    def __init__(self):
        super().__init__("left_hand", np.array([[0.0, 0.0, -1.0, 0.0]]), dim=4)

    def _held_components(self, robot):
        return np.array([0, 1, 2, 5])


def test_a_contact_holds_the_components_it_names(get_robot):
    stack = Stack(contacts=[PivotContact()], levels=[])
    controller = poise.WholeBodyController(get_robot("humanoid33"), stack)
    np.testing.assert_array_equal(controller.stack.contacts[0].chosen, [0, 1, 2, 5])


@pytest.mark.parametrize("value", [-0.5, NAN, INF])
def test_a_damping_that_cannot_be_is_refused_and_changes_nothing(value):
    contact = SurfaceContact("left_sole", damping=7.0)
    with pytest.raises(ConfigurationError, match="damping of contact 'left_sole'"):
        contact.set_damping(value)
    assert contact.damping == 7.0


@pytest.mark.parametrize("value", [[0.0] * 5, np.zeros(7), [NAN, *[0.0] * 5], "fast"])
def test_an_acceleration_that_cannot_be_is_refused_and_changes_nothing(value):
    contact = SurfaceContact("left_sole")
    contact.set_acceleration(np.ones(6))
    with pytest.raises(TargetError, match="acceleration of contact 'left_sole'"):
        contact.set_acceleration(value)
    np.testing.assert_array_equal(contact.acceleration, np.ones(6))
