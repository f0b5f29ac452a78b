"""Service `motion_switcher` of a G1, which starts and ends its own motion controllers."""

import ctypes as c
import json
import time
from typing import Any

from poise.errors import RobotError
from poise.hardware._g1_sdk import library_of

_CHECK, _RELEASE = 1001, 1003  # numbers of the service's functions
_WAIT = 1.0  # for an answer, as Unitree's own client [s]
_POLL = 0.05  # between requests; an answer takes 2.4 ms on loopback, measured [s]


def _structure(name: str, /, **fields: Any) -> Any:
    return type(name, (c.Structure,), {"_fields_": list(fields.items())})


_WORD, _LONG = c.c_uint32, c.c_int64
_OCTETS = _structure("Octets", maximum=_WORD, length=_WORD, buffer=c.c_void_p, release=c.c_bool)
_POLICY = {"lease": _LONG, "priority": c.c_int32, "no_reply": c.c_bool}
_TEXT = {"text": c.c_char_p, "binary": _OCTETS}
Request = _structure("Request_", id=_LONG, api=_LONG, **_POLICY, **_TEXT)
Response = _structure("Response_", id=_LONG, api=_LONG, code=c.c_int32, **_TEXT)

_KINDS = {c.c_int64: 4, c.c_int32: 3, c.c_bool: 1, c.c_char_p: 5}  # DDS_OP_VAL of Cyclone
_WORDS = dict.fromkeys(("size", "align", "flags", "keys"), _WORD)
_TYPE = {"name": c.c_char_p, "key_list": c.c_void_p, "count": _WORD}
_REST = {"operations": c.POINTER(_WORD), "meta": c.c_char_p, "types": _LONG * 5}
# `dds_topic_descriptor_t` of Cyclone DDS 0.10, whose last fields are zero.
_DESCRIPTOR = _structure("Descriptor", **_WORDS, **_TYPE, **_REST)


class Channel:
    """Topics of the service, by the DDS library and settings of an object of the SDK."""

    def __init__(self, sdk: Any, sent: Any, got: Any) -> None:
        self._dds, self._got = library_of(sdk), c.POINTER(got)
        self._own = self._dds.dds_create_participant(0, None, None)
        self._writer = self._dds.dds_create_writer(self._own, self._topic(sent), None, None)
        self._reader = self._dds.dds_create_reader(self._own, self._topic(got), None, None)
        if min(self._writer, self._reader) < 0:
            raise RobotError("DDS does not open the motion switcher", got=self._own)

    def found(self) -> bool:
        """Return True if both topics have another end."""
        counts = (c.c_uint32 * 6)(), (c.c_uint32 * 6)()
        self._dds.dds_get_publication_matched_status(self._writer, counts[0])
        self._dds.dds_get_subscription_matched_status(self._reader, counts[1])
        return bool(counts[0][2] and counts[1][2])  # current_count

    def write(self, message: Any) -> None:
        self._dds.dds_write(self._writer, c.byref(message))

    def take(self) -> Any:
        """Return the next message, to use before `close`; None without one."""
        sample, info = c.c_void_p(), (c.c_uint64 * 32)()  # larger than dds_sample_info_t
        taken = self._dds.dds_take(self._reader, c.byref(sample), info, c.c_size_t(1), 1)
        return c.cast(sample, self._got).contents if taken > 0 else None

    def close(self) -> None:
        self._dds.dds_delete(self._own)

    def _topic(self, kind: Any) -> int:
        operations: list[int] = []
        for name, of in kind._fields_:
            code = 0x0701 if of is _OCTETS else _KINDS[of] << 8  # a sequence's elements below it
            operations += [0x01000000 | code << 8, getattr(kind, name).offset]
        name, words = kind.__name__, len(operations) + 2  # with the end, zero
        described = _DESCRIPTOR(size=c.sizeof(kind), align=c.alignment(kind), count=words // 2)
        described.name, described.meta = f"unitree_api::msg::dds_::{name}".encode(), b""
        described.operations = (c.c_uint32 * words)(*operations)
        topic = f"rt/api/motion_switcher/{name[:-1].lower()}".encode()
        return self._dds.dds_create_topic(self._own, c.byref(described), topic, None, None)


def end_mode(sdk: Any, release: bool, timeout: float) -> bool:
    """Return True if a motion mode has been released, False if there is none; else raise."""
    channel = Channel(sdk, Request, Response)
    end = time.monotonic() + _WAIT
    try:
        while not channel.found():
            if time.monotonic() > end:
                return False  # a simulated robot without the service
            time.sleep(_POLL)
        first = mode = _call(channel, _CHECK)
        end = time.monotonic() + timeout
        while release and mode and time.monotonic() < end:
            _call(channel, _RELEASE)
            mode = _call(channel, _CHECK)
    finally:
        channel.close()
    if mode:
        wanted = "none: hang the robot up, then release it by the remote control or release=True"
        raise RobotError("a motion mode of the G1 is active", got=mode, wanted=wanted)
    return bool(first)


def _call(channel: Channel, function: int) -> str:
    """Return the mode's name in the answer, "" without one."""
    request, end = Request(id=time.time_ns(), api=function, text=b"{}"), time.monotonic() + _WAIT
    while time.monotonic() < end:
        # Again and again, because the service may see this client later than it is seen.
        channel.write(request)
        time.sleep(_POLL)
        while (answer := channel.take()) is not None:
            if answer.id == request.id and answer.code == 0:
                return json.loads(answer.text or b"{}").get("name", "")
    raise RobotError(f"the G1's motion switcher has no good answer to {function} in {_WAIT:g} s")
