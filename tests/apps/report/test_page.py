"""The page as text: complete, balanced, escaped, the same twice, and small."""

import re
import sys
from html.parser import HTMLParser

import numpy as np
import pytest
from markupsafe import escape
from synthetic_run import sole, walking_record

from poise.apps.pages import house_style
from poise.apps.report import Check, Event, SupportPhase, TaskTrack, write_report
from poise.apps.report._page import page_html
from poise.apps.report._plots import draw_plots
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
VOID = {"meta", "link", "input", "br", "img"}


class Balanced(HTMLParser):
    """Collects tags, ids and text; an element that is not closed is an error."""

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.texts, self.sources = [], [], [], []

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.ids += [values["id"]] if "id" in values else []
        self.sources += [v for k, v in attrs if k in ("src", "href", "xlink:href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data):
        if data.strip() and self.open and self.open[-1] not in ("script", "style"):
            self.texts.append(data.strip())


def parse(page):
    parser = Balanced()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    assert len(parser.ids) == len(set(parser.ids))
    return parser


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
    "two samples": lambda: walking_record(duration=0.008),
    "no COM reference": lambda: walking_record(
        duration=2.0, com_reference=np.full((500, 3), np.nan)
    ),
    "sixty joints": lambda: walking_record(duration=2.0, joints=60),
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
    "perfect tasks": lambda: walking_record(
        duration=2.0,
        tasks=(TaskTrack(name="com", level=0, unit="m", error=np.zeros(500)),),
        residuals=np.zeros((500, 3)),
    ),
    "zero tick times": lambda: walking_record(duration=2.0, tick_us={"solve": np.zeros(500)}),
}


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("case", EDGE_CASES)
def test_an_unusual_run_still_gets_a_whole_page(case, tmp_path):
    record = EDGE_CASES[case]()
    page = written(record, tmp_path)
    parse(page)
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
    parse(page)
    assert shown_figures(page) == ["com", "support", "zmp", "torque", "joints", "status"]
    assert "<canvas" not in page
    assert "<video" not in page


def usual_record():
    return walking_record(duration=1.0, video="video.mp4")


@pytest.fixture(scope="module")
def usual_page(tmp_path_factory):
    return written(usual_record(), tmp_path_factory.mktemp("usual"))


def test_every_figure_is_there_with_one_sentence_on_how_to_read_it(usual_page):
    parser = parse(usual_page)
    assert shown_figures(usual_page) == FIGURES
    sections = re.findall(r"<section[^>]*data-figure.*?</section>", usual_page, flags=re.DOTALL)
    assert all('class="how"' in s and "<svg" in s for s in sections)
    assert set(FIGURES) <= set(parser.ids)


def test_every_axis_names_its_unit():
    for figure in drawn_axes(walking_record(duration=2.0)):
        axes = [ax for ax in figure.axes if not hasattr(ax, "_colorbar")]
        for ax in axes:
            y_words = ax.get_ylabel() or ("" if ax.get_yticklabels() else "no axis")
            names_rows = any(not is_number(t.get_text()) for t in ax.get_yticklabels())
            assert names_rows or y_words.endswith("]"), (ax.get_title(), y_words)
            shares_time = ax.get_xlabel() or axes.index(ax) < len(axes) - 1
            assert shares_time, "the lowest axis has no label"
            if ax.get_xlabel():
                assert ax.get_xlabel().endswith("]")


def is_number(text):
    return bool(re.fullmatch(r"[−\d.e⁻⁰¹²³⁴⁵⁶⁷⁸⁹∞]*", text))


def drawn_axes(record):
    """The matplotlib figures behind a page, caught on their way into SVG."""
    from poise.apps.report._plots import _sheet as sheet, _ticks as ticks, _zmp as zmp

    caught = []
    with pytest.MonkeyPatch.context() as patch:
        for module in (sheet, ticks, zmp):
            patch.setattr(module, "inline_svg", lambda f, *_: caught.append(f) or "<svg></svg>")
        with house_style():
            draw_plots(record)
    assert len(caught) == len(FIGURES)
    return caught


def test_no_legend_covers_the_data():
    for figure in drawn_axes(walking_record(duration=2.0)):
        figure.canvas.draw()
        for ax in figure.axes:
            if ax.get_legend():
                legend = ax.get_legend().get_window_extent()
                assert legend.x0 >= ax.get_window_extent().x1
                assert legend.x1 <= figure.bbox.x1


def test_one_task_has_one_colour_and_no_two_tasks_look_alike():
    figure = drawn_axes(walking_record(duration=2.0))[0]
    lines = [line for ax in figure.axes for line in ax.get_lines() if "level" in line.get_label()]
    looks = {(line.get_color(), line.get_linestyle()) for line in lines}
    assert len(lines) == 5
    assert len(looks) == 5


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
    parser = parse(page)
    assert parser.ids.count("replay") == 1
    assert str(escape(NASTY)) in page
    assert page.count("<script") == page.count("</script>") == 5


def test_the_page_asks_nothing_of_the_network(usual_page):
    parser = parse(usual_page)
    outside = [s for s in parser.sources if not s.startswith(("#", "data:"))]
    assert outside == ["video.mp4"]


def test_the_same_run_gives_the_same_bytes(usual_page, tmp_path):
    assert write_report(usual_record(), tmp_path).read_bytes() == usual_page.encode()


def test_ten_seconds_at_one_kilohertz_stay_small(tmp_path):
    path = write_report(walking_record(duration=10.0, rate=1000.0), tmp_path)
    assert path.stat().st_size < 2_000_000


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


def test_checks_show_value_bound_unit_and_mark():
    page = page_html(walking_record(duration=0.5), [])
    rows = re.findall(r'<tr class="(held|failed)">(.*?)</tr>', page, flags=re.DOTALL)
    assert [kind for kind, _ in rows] == ["failed", "held", "held", "held"]
    cells = [re.sub("<.*?>", "", cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", rows[1][1])]
    assert cells == ["COM error after 1 s", "0.0312", "≤ 0.04", "m", "–", "✓ holds"]


def test_a_failed_check_leads_to_its_moment_and_says_how_it_came():
    failed = Check(
        name="ZMP margin",
        value=-0.01,
        bound=0.0,
        relation=">=",
        unit="m",
        ok=False,
        time=0.3217,
        mechanism="torque of <left_knee> at its limit (0.25 s)",
    )
    page = page_html(walking_record(duration=0.5, checks=(failed,)), [])
    (row,) = re.findall(r'<tr class="failed">(.*?)</tr>', page, flags=re.DOTALL)
    assert '<button class="moment" data-time="0.3217">0.32 s</button>' in row
    assert "torque of &lt;left_knee&gt; at its limit (0.25 s)" in row


@pytest.mark.slow
def test_a_user_style_of_matplotlib_changes_nothing(usual_page, tmp_path):
    import matplotlib

    with matplotlib.rc_context({"font.size": 30, "axes.grid": False, "svg.fonttype": "path"}):
        assert written(usual_record(), tmp_path) == usual_page


def test_without_matplotlib_the_error_names_the_extra_and_nothing_is_written(tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "matplotlib", None)
        with pytest.raises(MissingExtraError, match=r"poise\[sim\]"):
            write_report(walking_record(duration=0.5), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_importing_the_report_imports_neither_matplotlib_nor_mujoco():
    import subprocess

    code = (
        "import sys, poise.apps.report; print('matplotlib' in sys.modules, 'mujoco' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]
