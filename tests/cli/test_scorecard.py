"""`poise scorecard`: cards made and compared, and one clean line for bad input."""

import io
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("mujoco")

from cards import CARD, other

from poise.apps import scorecard
from poise.apps.campaigns import CampaignFolder
from poise.cli.main import main

QUICK = ["scorecard", "--robot", "biped20", "--controller", "osf", "--quick"]


@pytest.fixture
def two_cards(in_folder):
    """Folders of two cards."""
    for name, card in (("one", CARD), ("two", other())):
        (in_folder / name).mkdir()
        card.write(in_folder / name)
    return ["one", "two"]


@pytest.fixture
def made(monkeypatch):
    """Cards are made without an episode; the plans that were asked for."""
    plans = []

    def make(plan, folder, workers, progress):
        plans.append(plan)
        progress(1.0, 2.0)
        folder.mkdir(parents=True, exist_ok=True)
        return replace(CARD, controller=plan.controller)

    monkeypatch.setattr(scorecard, "make_card", make)
    return plans


def test_a_card_is_printed_and_written_beside_its_page(in_folder, made, capsys):
    assert main([*QUICK, "--trials", "push, delay"]) == 0
    (plan,) = made
    assert (plan.robot, plan.controller, plan.trials) == ("biped20", "osf", ("push", "delay"))
    assert plan.extent.quick
    folder = in_folder / "runs" / "scorecard-biped20-osf-quick"
    assert {path.name for path in folder.iterdir()} == {"scorecard.html", "scorecard.json"}
    out, err = capsys.readouterr()
    assert err == ""
    assert "delay of sensors" in out
    assert "0.02 s [0.02, 0.03]" in out
    assert "left out: speed of walking: it cannot <walk>" in out
    assert "worst: push, standing ahead: torque of <knee>" in out
    assert out.endswith("page: runs/scorecard-biped20-osf-quick/scorecard.html\n")


def test_json_prints_the_card_alone_and_it_is_shown_against_another(two_cards, made, capsys):
    assert main([*QUICK, "--out", "here", "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert json.loads(out) == json.loads(Path("here/scorecard.json").read_text())
    assert main([*QUICK, "--out", "here", "--against", "two"]) == 0
    assert "second worse" in capsys.readouterr().out


def test_two_cards_are_compared_in_a_table_and_on_a_page(in_folder, two_cards, capsys):
    assert main(["scorecard", "--compare", *two_cards]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    lines = {line.split("  ")[1]: line for line in out.splitlines() if line.startswith("  ")}
    assert lines["delay of sensors"].endswith("second worse")
    assert "second" not in lines["push, standing ahead"]
    assert "not tried" in lines["friction"]
    assert (in_folder / "runs" / "scorecard-compare" / "scorecard.html").is_file()
    assert main(["scorecard", "--compare", *two_cards, "--json", "--out", "here"]) == 0
    found = {d["trial"]: d for d in json.loads(capsys.readouterr().out)}
    assert found["delay"]["verdict"] == "worse"
    assert found["friction"]["second"] is None


def test_a_terminal_without_a_letter_is_told_all_the_same(in_folder, two_cards, monkeypatch):
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding="latin-1"))
    assert main(["scorecard", "--compare", *two_cards]) == 0
    out = sys.stdout.buffer.getvalue().decode("latin-1")
    assert "  friction                                    \\u2265 0.01 [0.01, 0.05]" in out
    assert out.endswith("page: runs/scorecard-compare/scorecard.html\n")


def test_trials_are_listed(capsys):
    assert main(["scorecard", "--list"]) == 0
    out = capsys.readouterr().out
    assert "push              push, standing" in out
    assert main(["scorecard", "--list", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["speed"] == "speed of walking"


BAD = {
    "no such controller": ([*QUICK, "--controller", "pid"], "choices: .*whole_body"),
    "no such trial": ([*QUICK, "--trials", "psuh"], "got 'psuh'; choices: push"),
    "a robot that does not stand": ([*QUICK, "--robot", "arm6"], "two feet"),
    "a file that is no card": (["scorecard", "--compare", "one", "text"], "not a scorecard"),
    "cards of two robots": (["scorecard", "--compare", "one", "g1"], "different robots"),
    "no number": (["scorecard", "--replay", "one", "x"], "got 'x'"),
    "against another robot": ([*QUICK, "--against", "g1"], "different robots"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line(case, in_folder, two_cards, refused):
    arguments, words = BAD[case]
    (in_folder / "text").write_text("hello")
    (in_folder / "g1").mkdir()
    other(robot="g1").write(in_folder / "g1")
    assert re.search(words, refused(*arguments))


def test_the_folder_of_another_card_is_refused(in_folder, refused):
    plan = scorecard.Plan(robot="biped20", controller="osf", extent=scorecard.FULL)
    with CampaignFolder(in_folder / "here").claimed(plan.content):
        pass
    err = refused(*QUICK, "--trials", "delay", "--out", "here")
    assert "'quick' differs" in err
    assert "another --out" in err


def test_an_interruption_says_how_to_go_on(in_folder, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(scorecard, "make_card", interrupted)
    assert main([*QUICK]) == 1
    assert "the same command goes on" in capsys.readouterr().err


@pytest.mark.slow
def test_a_small_card_is_made_by_workers(in_folder):
    """One trial of one look a seed, with the packages of the extra `sim` alone."""
    code = (
        "import sys; sys.modules |= dict.fromkeys("
        "['pyarrow', 'pyarrow.parquet', 'distributed', 'submitit', 'optuna'])\n"
        "from dataclasses import replace; from pathlib import Path\n"
        "from poise.apps import scorecard as s; from poise.apps.campaigns import LocalWorkers\n"
        "if __name__ == '__main__':\n"
        "    extent = replace(s.QUICK, operators=2, operator_time=0.5)\n"
        "    plan = s.Plan(robot='biped20', controller='step_teleoperation', extent=extent,"
        " trials=('bad_operator',))\n"
        "    card = s.make_card(plan, Path('here'), LocalWorkers(2))\n"
        "    print(card.trials[0].cases[0].median)\n"
    )
    (in_folder / "small.py").write_text(code)
    done = subprocess.run([sys.executable, "small.py"], capture_output=True, text=True, check=True)
    assert done.stdout == "1.0\n"
