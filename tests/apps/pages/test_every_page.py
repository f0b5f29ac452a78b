"""Every page in a real browser: nothing overflows on a phone, a tablet or a desk, and no errors."""

import json
from pathlib import Path

import pytest
from cards import CARD, other
from pages import DRAWS_IN_SOFTWARE, chromium, playwright
from synthetic_run import walking_record

pytest.importorskip("mujoco")

from poise.apps.onboarding import Attempt, Tryout, write_page as write_description
from poise.apps.pages import write_campaign_page
from poise.apps.report import Check, write_report
from poise.apps.scorecard import write_page as write_scorecard
from poise.robots import describe, load_robot
from poise.robots._catalog import find_entry, open_entry
from studies.finding import Finding, Section, Table, draw
from studies.page import write_study
from studies.plan import Part, StudyOptions, StudyPlan

LONG = "a_name_without_any_place_to_break_it_" * 4
WORDS = "torque of left_knee at its limit (0.25 s), then the right foot slips by 3 cm " * 2


def report(folder):
    late = Check(name=LONG, value=1.0, bound=0.0, ok=False, time=1.75, mechanism=WORDS)
    held = Check(name="ZMP margin", value=0.004, bound=0.0, relation=">=", unit="m", ok=True)
    record = walking_record(duration=2.0, checks=(late, held), description=WORDS + LONG)
    return write_report(record, folder)


def scorecard(folder):
    return write_scorecard(CARD, folder)


def two_scorecards(folder):
    return write_scorecard(CARD, folder, other())


def episode(number):
    force = 12.5 * number
    return {
        "number": number,
        "outcome": "fell" if force > 300.0 else "refused" if number % 7 == 0 else "ok",
        "reason": WORDS if force > 300.0 else None,
        "robot": "humanoid33",
        "controller": "whole_body",
        "version": "0.1.0",
        "values": json.dumps({"disturbances.0.force": force, LONG: "low" if number % 2 else "up"}),
        "com_error_max_m": 1e-4 * number if number else None,
        "missed_ticks": 0,
    }


def campaign(folder):
    return write_campaign_page([episode(i) for i in range(40)], folder / "campaign.html")


def description(folder):
    model = folder / "newcomer.urdf"
    model.write_text(open_entry(find_entry("humanoid33"))[0])
    proposal = describe(model)
    figures = {"com_error_max_m": 0.01, "torque_ratio_max": 0.9}
    tried = Attempt(name="stand", ok=False, words=(WORDS,), weakest=LONG, figures=figures)
    path = folder / "describe.html"
    write_description(load_robot(model, proposal.facts), proposal, Tryout((tried,)), path)
    return path


def lines(folder):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("poise.apps.onboarding._page.find_opengl", lambda: None)
        return description(folder)


def study(folder):
    def part(options, progress):
        finding = Finding(name=LONG, ok=False, paper=2, ours=2.5, unit="m/s", note=WORDS)
        drawing = {"name": "line", "title": "A line", "caption": WORDS, "height": 2.0}
        table = Table(title="T", header=" | ".join("abcdefghijkl"), rows=((*range(11), WORDS),))
        figure = draw(**drawing, paint=lambda canvas: canvas.subplots().plot([0.0, 1.0]))
        return Section(prose=(WORDS,), findings=(finding,), figures=(figure,), tables=(table,))

    about = {"name": "trial", "title": "A trial", "introduction": (WORDS,), "source": LONG}
    plan = StudyPlan(**about, parts=(Part(name="one", title=f"Part {LONG}", compute=part),))
    return write_study(plan.run(StudyOptions()), folder)


PAGES = (report, scorecard, two_scorecards, campaign, description, lines, study)


@pytest.fixture(scope="module")
def browser():
    with playwright() as play, chromium(play, *DRAWS_IN_SOFTWARE) as started:
        yield started


OUTSIDE = """() => [...document.querySelectorAll("td, th, dd, p, h1, h2, li, .card *, label")]
  .filter((e) => e.getClientRects().length && !e.closest(".scroll, nav, details:not([open])"))
  .filter((e) => e.getBoundingClientRect().right > innerWidth + 1 || e.scrollWidth > e.clientWidth
    + 1 && getComputedStyle(e).display !== "inline")
  .map((e) => e.outerHTML.slice(0, 200))"""
"""Texts that leave the screen or their own box, without those that scroll in a box."""


@pytest.mark.parametrize("make", PAGES, ids=lambda make: make.__name__)
def test_nothing_overflows_and_no_script_fails(make, browser, tmp_path):
    path = make(tmp_path)
    for width in (390, 800, 1280):
        errors = []
        page = browser.new_page(viewport={"width": width, "height": 800})
        page.on("pageerror", lambda error, errors=errors: errors.append(str(error)))
        page.on("request", lambda r, errors=errors: errors.append(r.url) if "http" in r.url else 0)
        page.goto(Path(path).as_uri())
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), width
        assert page.evaluate(OUTSIDE) == [], width
        assert errors == []
        page.close()


def test_on_a_phone_rows_are_blocks_of_labels_and_values(browser, tmp_path):
    page = browser.new_page(viewport={"width": 390, "height": 800})
    page.goto(report(tmp_path).as_uri())
    cell = 'document.querySelector("#checks tr.held td:nth-child(2)")'
    label = f'getComputedStyle({cell}, "::before").content'
    assert page.evaluate(label) == '"value"'
    # Four rows of letters at most, for a check with a name of words.
    height = page.evaluate('document.querySelector("#checks tr.held").offsetHeight')
    assert height < 200
    page.set_viewport_size({"width": 1280, "height": 800})
    assert page.evaluate(label) == "none"
    page.close()
