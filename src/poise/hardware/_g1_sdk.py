"""Unitree's messages of a G1, by the SDK: what both ends of its topics share."""

import ctypes as c
import socket
from collections.abc import Sequence
from importlib import metadata
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from poise.errors import ConfigurationError, RobotError, UnknownNameError, import_extra
from poise.hardware._link import Joints

MOTORS = 29  # that the SDK sets, of the messages' 35

MODE_MACHINES = {
    "g1_23dof": 1,
    "g1_29dof": 2,
    "g1_29dof_lock_waist": 3,
    "g1_23dof_rev_1_0": 4,
    "g1_29dof_rev_1_0": 5,
    "g1_29dof_lock_waist_rev_1_0": 6,
    "g1_dual_arm": 9,
    "g1_23dof_mode_10": 10,
    **{f"g1_29dof_mode_{number}": number for number in range(11, 17)},
}
"""`mode_machine` of a G1 by its model, from robots/g1_description/README.md of unitree_ros.

Models with hands have the number of the same robot without; `poise.load_robot("g1")` is
`g1_29dof_rev_1_0`. Waists of 3, 6, 12, 14 and 16 are locked."""

_VERSION = "0.1.8"  # whose behaviour the tests show
_FLOAT32 = float(np.finfo(np.float32).max)
_ENTITIES = 100  # more than any entity of the SDK's has below it, 12
_PARTICIPANTS = 119  # last index whose ports are of domain 0 (RTPS 2.5, 9.6.2.3)


def open_sdk(interface: str, tag: str) -> tuple[Any, Any]:
    """Return the SDK's module, and a new object of it; one interface and tag in a process."""
    name = "far-unitree-sdk"
    purpose = "A link to a G1, on Linux with Python 3.11 or 3.12,"
    sdk = import_extra("unitree_interface", "g1", purpose, package=name)
    if (version := metadata.version(name)) != _VERSION:
        wanted = f"{_VERSION}; install it with: pip install {name}=={_VERSION}"
        raise ConfigurationError(f"version of {name} is not known", got=version, wanted=wanted)
    interfaces = [found for _, found in socket.if_nameindex()]
    if interface not in interfaces:
        raise UnknownNameError("no such network interface", got=interface, choices=interfaces)
    try:
        kinds = sdk.RobotType.G1, sdk.MessageType.HG
        return sdk, sdk.UnitreeInterface(interface, *kinds, dds_config=_settings(interface, tag))
    except RuntimeError as error:
        wanted = f"an interface that is up, and one interface and tag in a process; {PEERS}"
        raise RobotError("DDS does not start", got=str(error), wanted=wanted) from error


def library_of(sdk: Any) -> c.CDLL:
    return c.CDLL(sdk.unitree_interface.__file__)  # with DDS, loaded already


PEERS = (
    f"on lo, up to {_PARTICIPANTS + 1} participants with the same tag find each other by unicast "
    "to 127.0.0.1, but only 10 with Cyclone's default settings"
)


def silence(sdk: Any) -> None:
    """Remove all callbacks of DDS: an object whose reader is in one aborts as it is deleted."""
    dds, found, size = library_of(sdk), (c.c_int32 * _ENTITIES)(), c.c_size_t(_ENTITIES)
    entities = list(found[: max(dds.dds_lookup_participant(0, found, size), 0)])
    for entity in entities:
        dds.dds_set_listener(entity, None)  # It waits for the end of those that run.
        entities += found[: max(dds.dds_get_children(entity, found, size), 0)]


class MotorOrder:
    """Arrays by joint, and lists by motor of the messages."""

    def __init__(self, joints: Sequence[str], motors: Sequence[str]) -> None:
        if len(motors) != MOTORS:
            raise ConfigurationError("number of motors", got=len(motors), wanted=f"{MOTORS}")
        unknown = [name for name in joints if name not in motors]
        if unknown:
            raise UnknownNameError("a joint has no motor", got=unknown[0], choices=motors)
        self._slots = np.array([list(motors).index(name) for name in joints], dtype=np.int64)
        self._all = np.zeros(MOTORS)

    def spread(self, values: Joints) -> list[float]:
        """Return a number for each motor: zero without a joint, finite as a float32."""
        self._all[self._slots] = np.clip(values, -_FLOAT32, _FLOAT32)
        return self._all.tolist()

    def pick(self, values: Sequence[float]) -> Joints:
        """Return a number for each joint."""
        return np.array(values, dtype=np.float64)[self._slots]


def _settings(interface: str, tag: str) -> str | None:
    """Return Cyclone's settings; None for the SDK's own."""
    if interface != "lo" and not tag:
        return None
    place = f'<NetworkInterface name={quoteattr(interface)} priority="default"/>'
    most = f"<MaxAutoParticipantIndex>{_PARTICIPANTS}</MaxAutoParticipantIndex>"
    return (
        f'<CycloneDDS><Domain Id="any"><General><Interfaces>{place}</Interfaces></General>'
        f"<Discovery><Tag>{escape(tag)}</Tag>{most}</Discovery></Domain></CycloneDDS>"
    )
