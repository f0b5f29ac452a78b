"""The documentation is right: its code runs, its links lead somewhere, its tables are complete."""

import dataclasses
import re
import shutil
import threading
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import yaml

import poise
from poise import hqp, stack
from poise._schema import _keys
from poise.apps.campaigns import OUTCOMES, Design
from poise.apps.campaigns._campaign import Campaign, Draw, TunePlan
from poise.apps.campaigns._episode import ABOUT, FIGURES, TIMINGS, warm_up
from poise.apps.scenarios import (
    _stack_plan as stack_plan,
    parse_scenario,
    shipped_scenarios,
)
from poise.apps.scenarios._metrics import METRICS
from poise.apps.scenarios._scenario import CheckPlan, Scenario, TargetMotion
from poise.cli.main import main
from poise.robots import catalog
from poise.sim import Block, PlantConfig, SensorConfig

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "examples/README.md"])
BLOCK = re.compile(r"(?:<!-- from (\S+) -->\n)?```(\w+)\n(.*?)```", re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks(page: Path, language: str) -> list[tuple[str, str]]:
    """The page's blocks of a language: the file they come from, or "", and their text."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [(source, text) for source, kind, text in found if kind == language]


def anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if target.startswith("http"):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{name_of(page)}: {target}"
        if anchor:
            assert anchor in anchors(file), f"{name_of(page)}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_included_files_exist(page):
    for line in page.read_text(encoding="utf-8").splitlines():
        if "--8" in line:
            included = re.fullmatch(r' *--8<-- "([^":]+)(:\d+)?"', line)
            assert included, f"{name_of(page)}: {line}"
            assert (ROOT / included[1]).is_file(), f"{name_of(page)}: {line}"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_blocks_that_come_from_a_file_are_part_of_it(page):
    for source, text in [*blocks(page, "python"), *blocks(page, "yaml")]:
        if source:
            assert text in (ROOT / source).read_text(encoding="utf-8"), f"{name_of(page)}: {source}"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_python_blocks_run_one_after_the_other(page, tmp_path, monkeypatch):
    texts = [text for source, text in blocks(page, "python") if not source]
    if not texts:
        return
    # The robot of the user that pages speak of.
    models = tmp_path / "models"
    shutil.copytree(ROOT / "examples" / "models", models)
    for path in list(models.iterdir()):
        path.rename(models / path.name.replace("walker12", "my_robot"))
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    for text in texts:
        exec(compile(text, name_of(page), "exec"), names)


def test_the_thread_of_the_arms_lets_go_of_both_although_one_fails(capsys):
    texts = (text for _, text in blocks(ROOT / "docs" / "haptics.md", "python"))
    recipe = next(text for text in texts if "def serve(" in text).partition("\ndriver, ")[0]
    names = {"np": np}
    exec(compile(recipe, "haptics.md", "exec"), names)
    failing, other, driver = Mock(), Mock(), Mock()
    failing.write.side_effect = OSError("the cable is out")
    driver.tick.side_effect = RuntimeError("whatever ends the thread")
    with pytest.raises(RuntimeError, match="whatever"):
        names["serve"](driver, (failing, other), threading.Event())
    np.testing.assert_array_equal(other.write.call_args.args[0], np.zeros(3))
    assert "the cable is out" in capsys.readouterr().out


def test_the_tutorial_shows_what_it_says(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for source, text in blocks(ROOT / "docs" / "tutorial" / "stand.md", "python"):
        if not source:
            exec(compile(text, "stand.md", "exec"), names)
    assert names["command"].status is poise.CommandStatus.BAD_STATE
    assert np.isfinite(names["command"].torque).all()


def test_scenario_blocks_are_read():
    page = ROOT / "docs" / "scenarios.md"
    texts = [text for _, text in blocks(page, "yaml")]
    assert len(texts) >= 6
    for text in texts:
        data = {"name": "from the docs", "duration": 10.0} | yaml.safe_load(text)
        parse_scenario(yaml.safe_dump(data), name_of(page))


def test_campaign_blocks_are_read(tmp_path):
    texts = [text for _, text in blocks(ROOT / "docs" / "campaigns.md", "yaml")]
    assert len(texts) == 3
    for text in texts:
        (tmp_path / "block.yaml").write_text(text)
        warm_up([([Design.load(tmp_path / "block.yaml").job(0)], False)])


def missing(page: str, words) -> list[str]:
    """Which words do not stand as code on a page."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return [w for w in words if not re.search(rf"`(?:[^`]*\W)?{re.escape(w)}(?:\W[^`]*)?`", text)]


def fields_of(*kinds: type) -> list[str]:
    return [field.name for kind in kinds for field in dataclasses.fields(kind)]


def test_scenarios_page_names_every_key_of_the_file():
    parts = (PlantConfig.Servo, PlantConfig.LinkError, PlantConfig.Payload)
    kinds = (PlantConfig, *parts, SensorConfig, Block)
    keys = [*_keys(Scenario), *_keys(TargetMotion), *_keys(CheckPlan), *fields_of(*kinds)]
    keys += [*stack_plan._TASKS, *stack_plan._CONTACTS]
    assert missing("scenarios.md", keys) == []


def test_campaigns_page_names_every_key_of_the_file_and_every_outcome():
    keys = [*_keys(Campaign), *_keys(Draw), *_keys(TunePlan)]
    assert missing("campaigns.md", [*keys, *OUTCOMES, *ABOUT, *FIGURES, *TIMINGS]) == []


def test_scenarios_page_names_every_metric_with_its_unit():
    text = (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8")
    for name, metric in METRICS.items():
        row = re.search(rf"^\| `{name}` \|[^|]*\| ([^|]*?) ?\| ([^|]*?) ?\|$", text, re.MULTILINE)
        assert row is not None, name
        unit, subject = row.groups()
        if metric.subject == "task":
            assert unit == "the task's"
        else:
            assert unit == metric.unit
        assert subject == (metric.subject or ("(axis)" if metric.takes_axis else ""))


def test_scenarios_page_names_every_shipped_scenario():
    assert missing("scenarios.md", shipped_scenarios()) == []


def test_scenarios_page_names_every_backend_and_strategy():
    assert missing("scenarios.md", [*hqp.STRATEGIES, *hqp.ACCURACY]) == []


def test_tasks_page_names_every_task_contact_and_limit():
    kinds = [k for k in stack.__all__ if k.endswith(("Task", "Contact", "Limit"))]
    assert missing("tasks.md", [k for k in kinds if k not in ("Task", "Contact")]) == []


def test_tasks_page_names_every_argument():
    kinds = [stack.Contact, stack.PointContact, stack.SurfaceContact, stack.JointLimit]
    arguments = {a for kind in kinds for a in kind.__init__.__annotations__} - {"dim", "return"}
    assert missing("tasks.md", sorted(arguments - {"frame", "name"})) == []


def test_robots_page_names_every_robot():
    assert missing("robots.md", (entry.name for entry in catalog())) == []


def test_every_image_is_small_and_shown():
    shown = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for image in [p for kind in ("jpg", "png", "webp") for p in ROOT.glob(f"docs/**/*.{kind}")]:
        assert image.stat().st_size < 400_000, image.name
        assert name_of(image).removeprefix("docs/") in shown, image.name


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_poise_commands_have_the_verbs_and_options_they_use(page, capsys):
    commands = re.findall(r"^(?:\S*/)?poise (.*)$", "".join(t for _, t in blocks(page, "sh")), re.M)
    for command in commands:
        words = command.partition("#")[0].split()
        assert main([words[0], "--help"]) == 0, command
        usage = capsys.readouterr().out
        for option in (word for word in words if word.startswith("--")):
            assert option in usage, command
        for file in (word for word in words if word.endswith(".yaml")):
            assert (ROOT / file).is_file(), command
