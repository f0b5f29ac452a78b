"""The page of a card, as a parser sees it."""

import pytest
from cards import CARD, other
from html_page import HtmlPage

from poise.apps.scorecard import write_page
from poise.errors import ConfigurationError


def page_of(tmp_path, *cards):
    return HtmlPage(write_page(cards[0], tmp_path, *cards[1:]).read_text())


def test_the_page_has_everything_and_needs_nothing_else(tmp_path):
    page = page_of(tmp_path, CARD)
    assert page.ids == ["worst", "pushes", "bars", "table", "left-out", "how"]
    assert page.addresses == ["data:,"]
    assert "script" not in page.tags
    # One polar plot standing, and one for each phase of a step.
    assert page.tags.count("svg") == 3
    assert page.tags.count("figure") == 3
    assert [p.name for p in tmp_path.iterdir()] == ["scorecard.html"]


def test_what_is_said_is_all_there_and_no_markup(tmp_path):
    text = page_of(tmp_path, CARD).text
    assert "torque of <knee> at its limit" in text
    assert "it cannot <walk>" in text
    assert "≥ 0.01" in text
    assert "0.02 s [0.02, 0.03]" in text
    assert "(episode 17)" in text
    assert "quick: few seeds" in text


def test_two_cards_are_told_case_by_case_with_a_verdict_where_they_differ(tmp_path):
    text = page_of(tmp_path, CARD, other()).text
    assert text.count("second worse") == 1
    assert "second better" not in text
    ours, theirs = (text.rindex(words) for words in ("0.02 s [0.02", "0.005 s [0.004"))
    assert ours < theirs < text.index("second worse")


def test_cards_that_cannot_be_compared_make_no_page(tmp_path):
    with pytest.raises(ConfigurationError, match="different robots"):
        write_page(CARD, tmp_path, other(robot="g1"))
    assert list(tmp_path.iterdir()) == []
