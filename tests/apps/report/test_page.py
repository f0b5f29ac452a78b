"""The page as text: complete, balanced, escaped, the same twice, and small."""

import re
import sys

import numpy as np
import pytest
from html_page import HtmlPage
from markupsafe import escape
from synthetic_run import sole, walking_record

from poise.apps.report import Check, Event, SupportPhase, TaskTrack, write_report
from poise.apps.report._page import page_html
from poise.errors import MissingExtraError

FIGURES = [
    "tracking",
    "com",
    "support",
    "zmp",
    "forces",
    "torque",
    "joints",
    "residuals",
    "status",
    "ticks",
]


def written(record, directory):
    return write_report(record, directory).read_text(encoding="utf-8")


def shown_figures(page):
    return re.findall(r'data-figure="([^"]+)"', page)


def no_contact_record():
    ticks = 500
    return walking_record(
        duration=2.0,
        zmp=np.full((ticks, 2), np.nan),
        support=(SupportPhase(start=0.0, end=2.0, vertices=np.zeros((0, 2))),),
        soles={n: sole(np.zeros(ticks), np.zeros(ticks)) for n in ("left", "right")},
    )


def single_sample_record():
    return walking_record(duration=0.004)


def all_nan_record():
    full = walking_record(duration=1.0)
    nan = {
        name: np.full_like(getattr(full, name), np.nan)
        for name in ("torque", "q", "com", "com_reference", "zmp", "residuals")
    }
    tick = {k: np.full_like(v, np.nan) for k, v in full.tick_us.items()}
    task = TaskTrack(name="hand", level=0, unit="m", error=np.full(250, np.nan))
    return walking_record(duration=1.0, **nan, tick_us=tick, tasks=(task,))


EDGE_CASES = {
    "no contacts ever": no_contact_record,
    "one sample": single_sample_record,
    "nothing but NaN": all_nan_record,
    "one joint": lambda: walking_record(duration=2.0, joints=1),
    "died early": lambda: walking_record(
        duration=0.3, fell=True, ended_early="pelvis below 0.4 m at 0.30 s"
    ),
    "joints without limits": lambda: walking_record(
        duration=2.0, torque_max=np.full(33, np.inf), position_max=np.full(33, np.inf)
    ),
    "many events": lambda: walking_record(
        duration=2.0, events=tuple(Event(time=0.02 * i, label=f"event {i}") for i in range(100))
    ),
    "twenty tasks": lambda: walking_record(
        duration=2.0,
        tasks=tuple(
            TaskTrack(name=f"task {i}", level=i, unit="m", error=np.full(500, 0.1 + i))
            for i in range(20)
        ),
    ),
}


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("case", EDGE_CASES)
def test_an_unusual_run_still_gets_a_whole_page(case, tmp_path):
    record = EDGE_CASES[case]()
    page = written(record, tmp_path)
    HtmlPage(page)
    expected = list(FIGURES)
    if case == "nothing but NaN":
        expected.remove("ticks")
    assert shown_figures(page) == expected


def test_parts_that_do_not_exist_are_left_out_and_the_rest_stays(tmp_path):
    bare = walking_record(
        duration=1.0, tasks=(), soles={}, support=(), events=(), checks=(), summary={}, notes=(),
        replay=None, residuals=np.zeros((250, 0)), level_names=(),
        tick_us={"solve": np.full(250, np.nan)},
    )  # fmt: skip
    page = written(bare, tmp_path)
    HtmlPage(page)
    assert shown_figures(page) == ["com", "support", "zmp", "torque", "joints", "status"]
    assert "<canvas" not in page
    assert "<video" not in page


def usual_record():
    return walking_record(duration=1.0, video="video.mp4")


@pytest.fixture(scope="module")
def usual_page(tmp_path_factory):
    return written(usual_record(), tmp_path_factory.mktemp("usual"))


def test_every_figure_is_there_with_one_sentence_on_how_to_read_it(usual_page):
    parser = HtmlPage(usual_page)
    assert shown_figures(usual_page) == FIGURES
    sections = re.findall(r"<section[^>]*data-figure.*?</section>", usual_page, flags=re.DOTALL)
    assert all('class="how"' in s and "<svg" in s for s in sections)
    assert set(FIGURES) <= set(parser.ids)


NASTY = "<script>alert('1')</script> & \"$x_{1}\\frac$ 力 \n_end"


def test_user_text_is_shown_and_never_obeyed(tmp_path):
    plain = walking_record(duration=1.0)
    nasty_task = TaskTrack(name="_" + NASTY, level=0, unit="m", error=plain.tasks[0].error)
    record = walking_record(
        duration=1.0,
        robot=NASTY, controller=NASTY, scenario=NASTY, description=NASTY, ended_early=NASTY,
        joint_names=tuple(f"{NASTY}{i}" for i in range(33)),
        tasks=(nasty_task,),
        level_names=(NASTY, NASTY, NASTY),
        status=tuple([NASTY] * 250),
        tick_us={NASTY: np.ones(250)},
        events=(Event(time=0.5, label=NASTY),),
        checks=(Check(name=NASTY, value=1.0, bound=2.0, unit=NASTY, ok=True),),
        summary={NASTY: NASTY},
        video=NASTY,
        notes=(NASTY,),
    )  # fmt: skip
    page = written(record, tmp_path)
    assert "<script>alert" not in page
    parser = HtmlPage(page)
    assert parser.ids.count("replay") == 1
    assert str(escape(NASTY)) in page
    assert page.count("<script") == page.count("</script>") == 5


def test_the_page_asks_nothing_of_the_network(usual_page):
    parser = HtmlPage(usual_page)
    outside = [s for s in parser.addresses if not s.startswith(("#", "data:"))]
    assert outside == ["video.mp4"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, "1 of 4 checks failed"),
        ({"checks": (Check(name="a", value=1.0, bound=2.0, ok=True),)}, "The check holds"),
        ({"checks": ()}, "nothing was checked"),
        ({"fell": True}, "The robot fell"),
        ({"ended_early": "NaN in the state"}, "The run ended early"),
    ],
)
def test_the_verdict_says_how_the_run_ended(changes, words):
    page = page_html(walking_record(duration=0.5, **changes), [])
    head = page[page.index("<header>") : page.index("</header>")]
    assert words in head


def test_without_matplotlib_the_error_names_the_extra_and_nothing_is_written(tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "matplotlib", None)
        with pytest.raises(MissingExtraError, match=r"poise\[sim\]"):
            write_report(walking_record(duration=0.5), tmp_path / "out")
    assert not (tmp_path / "out").exists()
