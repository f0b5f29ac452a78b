"""The study of the balance service in its quick version."""

import pytest
from unchecked import run_unchecked

pytest.importorskip("mujoco")
pytest.importorskip("matplotlib")

RUN = """
import json
from dataclasses import asdict
from studies.g1_link._balance import run
print(json.dumps({name: asdict(outcome) for name, outcome in run(quick=True).items()}))
"""


@pytest.mark.slow
def test_arms_swing_while_g1_stands_and_walks(get_robot):
    get_robot("g1")
    outcomes = run_unchecked(RUN)
    assert set(outcomes) == {"standing", "walking"}
    for outcome in outcomes.values():
        assert not outcome["fell"]
        assert outcome["seconds"] == pytest.approx(10.0)
        assert 0.9 < outcome["speed"] < 1.5
        assert outcome["error"] < 0.1
        assert outcome["distance"] > 0.0
        assert outcome["refused"] == 0
    assert outcomes["walking"]["steps"] > 8 > outcomes["standing"]["steps"] == 0
