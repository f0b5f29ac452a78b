"""The page of a campaign, from rows alone."""

import json
import re

import pytest

from poise.apps.pages import write_campaign_page


def row(number, outcome, **values):
    return {"number": number, "outcome": outcome, "values": json.dumps(values), "reason": None}


def written(tmp_path, rows):
    return write_campaign_page(rows, tmp_path / "campaign.html").read_text(encoding="utf-8")


def test_falls_are_counted_by_each_value_among_the_episodes_that_ran(tmp_path):
    rows = [row(i, "fell" if i < 3 else "ok", friction=0.2 if i < 4 else 0.8) for i in range(8)]
    rows.append(row(8, "refused", friction=0.2))
    page = written(tmp_path, rows)
    bars = re.findall(
        r'<div class="name">(friction.*?)</div>.*?"ends">(.*?)</div>', page, re.DOTALL
    )
    assert bars == [("friction 0.2", "3 of 4"), ("friction 0.8", "0 of 4")]
    # Wilson's interval of 3 in 4 with 95%.
    assert "75% [30%, 95%]" in page


def test_episodes_that_went_wrong_have_number_values_and_reason_and_no_markup(tmp_path):
    rows = [row(0, "ok", x=1), {**row(7, "error", x=2), "reason": "<b> & no more"}]
    page = written(tmp_path, rows)
    assert "&lt;b&gt; &amp; no more" in page
    assert "replay" in page
    wrong = page[page.index('id="wrong"') :]
    assert re.findall(r"<td[^>]*>(.*?)</td>", wrong)[:3] == ["7", "error", "x 2"]


@pytest.mark.parametrize("rows", [[], [row(0, "refused")], [{"number": 0, "outcome": "crashed"}]])
def test_a_campaign_without_results_has_a_page(rows, tmp_path):
    page = written(tmp_path, rows)
    assert "No varied field" in page
    assert f"{len(rows)}</dd>" in page
