"""One message of an operator: as JSON from a page, and as bytes in a record."""

import math

import msgspec
import numpy as np
import pytest

from poise.locomotion import (
    BodyCommand,
    OperatorSample,
    TrackedPose,
)

HAND = TrackedPose((0.1, -0.2, 1e300), True, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.3))
WHOLE = OperatorSample(
    time=12.5,
    feet=(TrackedPose((1.0, 0.1, 0.0), velocity=(0.0, 0.0, 0.1)), None),
    hands=(None, HAND),
    head=TrackedPose(None, False, (0.0, 0.0, 0.0, 1.0)),
    body=BodyCommand(-0.1, (0.0, 0.1, 1e308), (0.2, 0.0)),
    velocity=(0.3, 0.0, -0.1),
    upright=True,
    lift=(False, True),
    move=(1.0, -0.5),
)

encode, decode = msgspec.msgpack.encode, msgspec.msgpack.Decoder(OperatorSample).decode


@pytest.mark.parametrize("sample", [OperatorSample(), WHOLE], ids=["rest", "whole"])
def test_what_is_written_is_read(sample):
    assert decode(encode(sample)) == sample
    assert msgspec.json.decode(msgspec.json.encode(sample), type=OperatorSample) == sample


def test_numbers_that_are_none_come_through_a_record():
    lost = TrackedPose.of(np.full(3, np.nan))
    read = decode(encode(OperatorSample(math.inf, (lost, None))))
    assert read.time == math.inf
    assert all(map(math.isnan, read.place(0)))
    assert all(map(math.isnan, read.place(1)))


@pytest.mark.parametrize(
    "text",
    [
        b'{"do": "fly"}',
        b'{"do": "drive", "beat": 1.0}',
        b'{"do": "drive", "feet": [{"place": [0, 0, 0]}, null]}',
        b'{"do": "drive", "body": {"hight": 0.1}}',
        b'{"do": "drive", "turn": 1.5}',
        b'{"do": "drive", "upright": 1}',
    ],
)
def test_unknown_members_and_other_kinds_are_refused(text):
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(text, type=OperatorSample)


def test_a_pose_of_arrays_keeps_what_they_were():
    place = np.array([1.0, 2.0, 3.0], dtype=np.float32)
    pose = TrackedPose.of(place, velocity=[0, 0, 1])
    place[:] = np.nan
    assert pose == TrackedPose((1.0, 2.0, 3.0), velocity=(0.0, 0.0, 1.0))
