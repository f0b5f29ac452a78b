from pathlib import Path

import numpy as np
import pytest
from synthetic_run import walking_record
from unchecked import run_unchecked

from poise.apps.report import Event, Geometry, Replay
from poise.errors import ConfigurationError


def test_times_that_do_not_increase_are_refused():
    record = walking_record(duration=1.0)
    with pytest.raises(ConfigurationError, match="do not increase"):
        walking_record(duration=1.0, time=record.time[::-1].copy())


WRONG_SHAPES = """
import json, sys
import numpy as np
sys.path.insert(0, sys.argv[1])
from synthetic_run import walking_record
from poise.errors import ConfigurationError
messages = {}
for name, value in {
    "torque": np.zeros((250, 3)),
    "torque_max": np.zeros(4),
    "com": np.zeros((7, 3)),
    "zmp": np.zeros((250, 3)),
    "time": np.zeros(0),
    "status": ("ok",),
    "tick_us": {"solve": np.zeros(9)},
    "level_names": ("only one",),
}.items():
    try:
        walking_record(duration=1.0, **{name: value})
    except ConfigurationError as error:
        messages[name] = str(error)
print(json.dumps(messages))
"""


def test_a_field_of_the_wrong_shape_is_refused_by_name():
    # In a process of its own: here the shape checks of the tests would speak first.
    messages = run_unchecked(WRONG_SHAPES, Path(__file__).parent)
    assert len(messages) == 8
    assert "got (250, 3); wanted (250, 33)" in messages["torque"]
    assert "without a tick" in messages["time"]
    assert "phase 'solve'" in messages["tick_us"]
    for name in ("com", "zmp", "status", "level_names", "torque_max"):
        assert name in messages[name]


def test_an_event_needs_a_finite_time():
    with pytest.raises(ConfigurationError, match="push"):
        Event(time=float("nan"), label="push")


@pytest.mark.parametrize(
    "fields",
    [
        {"shape": "box", "size": (1.0, 1.0)},
        {"shape": "sphere", "size": (-1.0,)},
        {"shape": "mesh"},
        {"shape": "mesh", "vertices": np.zeros((3, 3)), "faces": np.array([[0, 1, 3]])},
    ],
)
def test_a_geometry_that_cannot_be_drawn_is_refused(fields):
    with pytest.raises(ConfigurationError):
        Geometry(body=0, **fields)


def replay_fields():
    return {
        "time": np.zeros(2),
        "body_names": ("a",),
        "position": np.zeros((2, 1, 3)),
        "quaternion": np.zeros((2, 1, 4)),
        "geometries": (),
    }


def test_a_geometry_on_an_unknown_body_is_refused():
    ball = Geometry(body=1, shape="sphere", size=(0.1,))
    with pytest.raises(ConfigurationError, match="does not exist"):
        Replay(**{**replay_fields(), "geometries": (ball,)})
