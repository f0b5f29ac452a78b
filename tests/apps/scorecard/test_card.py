"""A card as a file, and two of them side by side."""

import json

import pytest
from cards import CARD, other

from poise.apps.scorecard import compare, read_card
from poise.errors import ConfigurationError, PoiseError


def test_a_card_is_read_as_it_was_written(tmp_path):
    path = CARD.write(tmp_path)
    assert path.name == "scorecard.json"
    assert read_card(path) == CARD
    assert read_card(tmp_path) == CARD
    data = json.loads(path.read_text())
    assert data["trials"][2]["cases"][0]["median"] == 0.02
    assert [p.name for p in tmp_path.iterdir()] == ["scorecard.json"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "not a scorecard"),
        ("[1]", "not a scorecard"),
        ('{"fell": false}', "wanted a scorecard.json"),
        ('{"trials": [], "left_out": {}}', "robot"),
        ("\x00\xff", "not a scorecard"),
    ],
)
def test_a_file_that_is_no_card_is_refused(tmp_path, text, words):
    path = tmp_path / "card.json"
    path.write_text(text)
    with pytest.raises(PoiseError, match=words):
        read_card(path)


def test_cases_whose_intervals_are_apart_are_told_from_others():
    found = {(d.trial.name, d.first.angle, d.first.phase): d for d in compare(CARD, other())}
    assert found["delay", None, None].verdict == "worse"
    assert found["push", 90.0, None].verdict == "alike"
    assert found["push_walk", 0.0, 0.1].second is None
    assert found["push_walk", 0.0, 0.1].verdict == ""
    back = {d.trial.name: d for d in compare(other(), CARD)}
    assert back["delay"].verdict == "better"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"robot": "g1"}, "different robots; got 'g1'; wanted 'biped20'"),
        ({"trials_version": 99}, "different versions of the trials"),
        ({"quick": False}, "one of them quick"),
    ],
)
def test_cards_of_different_things_are_not_compared(changes, words):
    with pytest.raises(ConfigurationError, match=words):
        compare(CARD, other(**changes))
