"""States and commands of a link, and what it says of itself."""

import links
import numpy as np
import pytest

from poise.errors import ConfigurationError
from poise.hardware import LinkInfo, MotorCommand


def test_a_drive_adds_the_torques_of_its_own_loop():
    command = links.command(q=np.array([0.5, 1.0, 0.0]), dq=np.array([0.0, 2.0, 0.0]))
    torque = command.torque(np.array([0.4, 1.0, 0.0]), np.array([0.0, 1.0, 3.0]))
    np.testing.assert_allclose(torque, [10.0 + 20.0 * 0.1, -20.0 + 1.0, 5.0 - 3.0])


def test_damping_takes_energy_at_any_place():
    damping = MotorCommand.damping(np.array([1.0, 2.0, 3.0]))
    dq = np.array([1.0, -1.0, 0.5])
    assert damping.torque(np.full(3, 0.7), dq).tolist() == [-1.0, 2.0, -1.5]


@pytest.mark.parametrize(
    ("settings", "match"),
    [({"rate": 0.0}, "rate"), ({"rate": np.nan}, "rate"), ({"joints": ("a", "a")}, "twice")],
)
def test_an_info_that_cannot_be_is_refused(settings, match):
    with pytest.raises(ConfigurationError, match=match):
        LinkInfo(**{"name": "leg", "rate": 500.0, "joints": links.JOINTS} | settings)
