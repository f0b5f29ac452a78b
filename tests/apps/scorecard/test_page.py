"""The page of a card, as a parser sees it."""

from html.parser import HTMLParser

import pytest
from cards import CARD, other

from poise.apps.scorecard import write_page
from poise.errors import ConfigurationError

VOID = {"meta", "link", "br", "input", "img"}


class Page(HTMLParser):
    """Checks that every element is closed; keeps ids, addresses and texts."""

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.addresses, self.tags, self.texts = [], [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        found = dict(attrs)
        self.ids += [found["id"]] if "id" in found else []
        self.addresses += [found[k] for k in ("src", "href", "xlink:href") if k in found]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)

    @property
    def text(self):
        return " ".join(self.texts)


def page_of(tmp_path, *cards):
    return Page(write_page(cards[0], tmp_path, *cards[1:]).read_text())


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


def test_every_direction_and_every_other_case_is_drawn(tmp_path):
    page = write_page(CARD, tmp_path).read_text()
    assert page.count("<circle") == 3 * 4 + 4 + 8
    assert page.count('class="rail"') == 2
    # Behind each bar stand its ends.
    assert '<div class="ends">1 to 0.01</div>' in page


def test_two_cards_are_shown_in_two_colours(tmp_path):
    page = write_page(CARD, tmp_path, other()).read_text()
    parsed = Page(page)
    assert "0.1.0+aaaa" in parsed.text
    assert "0.2.0+bbbb" in parsed.text
    assert "not tried" in parsed.text
    assert '#d55e00" fill-opacity' in page
    assert page.count("<figure>") == 3


def test_cards_of_one_version_are_told_apart_by_their_controller_alone(tmp_path):
    from dataclasses import replace

    page = page_of(tmp_path, CARD, replace(CARD, controller="osf"))
    assert "with whole_body and osf" in page.text
    assert page.text.count(CARD.version) == 2


def test_two_cards_are_told_case_by_case_with_a_verdict_where_they_differ(tmp_path):
    text = page_of(tmp_path, CARD, other()).text
    assert text.count("second worse") == 1
    assert "second better" not in text
    ours, theirs = (text.rindex(words) for words in ("0.02 s [0.02", "0.005 s [0.004"))
    assert ours < theirs < text.index("second worse")


def test_what_was_left_out_for_one_reason_is_said_once(tmp_path):
    from dataclasses import replace

    left_out = {"speed": "it cannot walk", "delay_walk": "it cannot walk", "latency": "no devices"}
    text = page_of(tmp_path, replace(CARD, left_out=left_out)).text
    assert text.count("it cannot walk") == 1
    assert "speed of walking, delay of sensors, walking" in text


def test_an_empty_card_has_a_page(tmp_path):
    from dataclasses import replace

    page = page_of(tmp_path, replace(CARD, trials=()))
    assert "nothing was tried" in page.text


def test_cards_that_cannot_be_compared_make_no_page(tmp_path):
    with pytest.raises(ConfigurationError, match="different robots"):
        write_page(CARD, tmp_path, other(robot="g1"))
    assert list(tmp_path.iterdir()) == []
