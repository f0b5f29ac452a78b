"""`record_walk`: a walk that can be led again, tick by tick, by the same targets and loads."""

import json
import subprocess
import sys

import pytest

REPLAY = """
import json
import numpy as np
from benchmarks.methods import parse_method
from benchmarks.walk_recording import record_walk
from benchmarks.walk_recording import WalkSubject
from poise.robots import load_robot

walk = record_walk(load_robot("humanoid33"), 1, seconds=1.8)
again = WalkSubject(walk, "posture", parse_method("whole_body", "direct"))
pair = [WalkSubject(walk, "table1", parse_method(c, "direct")) for c in ("whole_body", "reduced")]
errors, feet = [], []
for i in range(len(walk.states)):
    again.tick(i)
    errors.append(float(np.linalg.norm(again.lead.stack.task("com").error)))
    feet.append(sum(c.active for c in again.lead.stack.contacts))
    for one in pair:
        one.tick(i) if i % 20 == 0 else one.skip(i)
full, own = (one.torque[::20] for one in pair)
print(json.dumps({
    "same error": bool(np.array_equal(errors, walk.com_error)),
    "same feet": bool(np.array_equal(feet, walk.feet)),
    "feet": np.unique(walk.feet, return_counts=True)[1].tolist(),
    "torque": float(np.abs(full - own).max() / np.abs(full).max()),
    "com": float(walk.com_error.max()), "hand": float(walk.hand_error.max()),
}))
"""


@pytest.mark.slow
def test_a_walk_is_led_again_bit_by_bit_and_both_controllers_agree_on_it():
    # In a process of its own, without the shape checks of the tests, which take five times as long.
    done = subprocess.run(
        [sys.executable, "-c", REPLAY], capture_output=True, text=True, check=True
    )
    found = json.loads(done.stdout)
    assert found["same error"]
    assert found["same feet"]
    single, double = found["feet"]
    assert single > 400
    assert double > 800
    assert found["torque"] < 1e-6
    assert found["com"] < 5e-3
    assert found["hand"] < 5e-3
