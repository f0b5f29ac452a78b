"""The `poise` command: verbs, help, files, exit status, and one clean line for bad input."""

import json
import os
import re
import subprocess
import sys

import pytest

pytest.importorskip("mujoco")

from poise import __version__
from poise.apps.scenarios import _outputs as outputs, controller_names, shipped_scenarios
from poise.cli.main import main
from poise.control import CONTROLLERS
from poise.errors import MissingExtraError
from poise.robots import catalog
from poise.sim import Plant, find_opengl, read_log

SHORT = """
name: short
robot: biped20
duration: 0.04
checks:
  - {metric: com_error_max, at_most: 0.01}
"""


@pytest.fixture
def in_folder(tmp_path, monkeypatch):
    """A folder of its own to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def short(in_folder):
    (in_folder / "short.yaml").write_text(SHORT)
    return "short.yaml"


def files(folder):
    return {p.name for p in folder.iterdir()}


def test_a_run_writes_its_files_beside_one_another_and_says_what_held(in_folder, capsys):
    (in_folder / "short.yaml").write_text(SHORT.replace("robot: biped20\n", ""))
    assert main(["run", "short.yaml", "--no-video"]) == 0
    folder = in_folder / "runs" / "short-humanoid33"
    assert files(folder) == {"report.html", "log.mcap", "summary.json"}
    out, err = capsys.readouterr()
    assert err == ""
    assert "short on humanoid33: all checks hold" in out
    assert "ok    missed ticks: 0 (<= 0)" in out
    assert "<= 0.01 m)" in out
    assert "report: runs/short-humanoid33/report.html" in out


def test_json_prints_the_summary_alone_and_no_earlier_video_passes_for_this_runs(
    in_folder, short, capsys
):
    (in_folder / "here").mkdir()
    for name in ("video.mp4", "video.jpg"):
        (in_folder / "here" / name).write_bytes(b"of another run")
    assert main(["run", short, "--no-video", "--json", "--out", "here", "--seed", "7"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert json.loads(out) == json.loads((in_folder / "here" / "summary.json").read_text())
    assert json.loads(out)["seed"] == 7
    assert files(in_folder / "here") == {"report.html", "log.mcap", "summary.json"}


@pytest.mark.slow
def test_robot_controller_and_strategy_of_the_command_line_win(in_folder, short, capsys):
    more = ["--robot", "humanoid33", "--controller", "whole_body", "--strategy", "cascade"]
    assert main(["run", short, "--no-video", "--json", *more]) in (0, 1)
    assert json.loads(capsys.readouterr().out)["robot"] == "humanoid33"
    page = (in_folder / "runs" / "short-humanoid33" / "report.html").read_text()
    assert "whole_body (cascade)" in page


@pytest.mark.skipif(find_opengl() is None, reason="this machine cannot draw")
def test_a_video_lies_beside_the_report(in_folder, short, capsys):
    assert main(["run", short, "--out", "o"]) == 0
    assert files(in_folder / "o") == {
        "report.html", "log.mcap", "summary.json", "video.mp4", "video.jpg",
    }  # fmt: skip
    assert (in_folder / "o" / "video.mp4").read_bytes()[4:8] == b"ftyp"
    assert 'src="video.mp4"' in (in_folder / "o" / "report.html").read_text()


def test_without_opengl_the_report_comes_and_says_what_to_install(
    in_folder, short, capsys, monkeypatch
):
    def cannot(*_, **__):
        raise MissingExtraError("libegl1", "", "Drawing", install="apt install libegl1")

    monkeypatch.setattr(outputs, "render_video", cannot)
    assert main(["run", short, "--out", "o"]) == 0
    said = capsys.readouterr().err
    assert said.startswith("No video: Drawing needs")
    assert "apt install libegl1" in said
    assert files(in_folder / "o") == {"report.html", "log.mcap", "summary.json"}
    page = (in_folder / "o" / "report.html").read_text()
    assert "install libegl1" in page
    assert "<video" not in page


def test_a_run_that_is_refused_leaves_the_earlier_one_as_it_was(in_folder, short):
    folder = in_folder / "o"
    folder.mkdir()
    for name in ("video.mp4", "video.jpg", "report.html"):
        (folder / name).write_bytes(b"of another run")
    assert main(["run", short, "--out", "o", "--controller", "osf", "--strategy", "direct"]) == 2
    assert files(folder) == {"video.mp4", "video.jpg", "report.html"}


@pytest.mark.parametrize("scenario", ["over_an_obstacle", "over_an_obstacle_velocity"])
def test_a_robot_without_feet_that_shall_be_walked_by_hand_is_one_line(in_folder, capsys, scenario):
    assert main(["run", scenario, "--robot", "arm6", "--no-video"]) == 2
    assert "cannot walk on two feet" in capsys.readouterr().err


def test_ctrl_c_while_the_video_is_drawn_leaves_the_report(in_folder, short, capsys, monkeypatch):
    def interrupted(_, __, ___, path, **____):
        path.write_bytes(b"the first half")
        raise KeyboardInterrupt

    monkeypatch.setattr(outputs, "render_video", interrupted)
    assert main(["run", short, "--out", "o"]) == 0
    assert "No video: interrupted" in capsys.readouterr().err
    assert "No video: interrupted" in (in_folder / "o" / "report.html").read_text()
    assert files(in_folder / "o") == {"report.html", "log.mcap", "summary.json"}


def test_a_check_that_fails_gives_status_one(in_folder, capsys):
    (in_folder / "s.yaml").write_text(SHORT.replace("at_most: 0.01", "at_least: 1.0"))
    assert main(["run", "s.yaml", "--no-video"]) == 1
    out = capsys.readouterr().out
    assert "short on biped20: FAILED" in out
    assert "  FAIL  largest distance of the COM from its reference" in out


def test_list_names_every_shipped_scenario(capsys):
    assert main(["run", "--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(shipped_scenarios())
    assert main(["run", "--list", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == set(shipped_scenarios())


def test_robots_lists_what_can_be_loaded(capsys):
    assert main(["robots"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "joints" in lines[0]
    assert "mass" in lines[0]
    assert [line.split()[0] for line in lines[1 : 1 + len(catalog())]] == [
        e.name for e in catalog()
    ]
    assert {"humanoid33", "biped20", "arm6", "upper17", "g1", "talos"} <= {
        e.name for e in catalog()
    }


def test_robots_as_json_has_the_figures(capsys):
    assert main(["robots", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert rows["humanoid33"]["joints"] == 33
    assert rows["humanoid33"]["mass_kg"] == pytest.approx(100.0)
    assert rows["g1"]["joints"] == 29
    assert all(isinstance(row["installed"], bool) and row["licence"] for row in rows.values())


@pytest.mark.parametrize(
    "verb",
    [
        [],
        *(
            [v]
            for v in (
                "run",
                "scorecard",
                "campaign",
                "robots",
                "describe",
                "teleop",
                "drive",
                "convert",
                "warmup",
            )
        ),
    ],
    ids=str,
)
def test_help_has_an_example(verb, capsys):
    assert main([*verb, "--help"]) == 0
    assert f"example: {' '.join(['poise', *verb])}" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("verb", ["run", "scorecard"])
def test_help_names_all_controllers_and_strategies(verb, capsys):
    assert main([verb, "--help"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    said = out[out.rindex("--controller STR") : out.rindex("--strategy STR")]
    for name in controller_names():
        assert name in said
    said = out[out.rindex("--strategy STR") :]
    for name, kind in CONTROLLERS.items():
        who = said[: said.index(name)].rpartition(" (")[0]
        assert who.endswith(", ".join(kind.strategies))


BAD_WORDS = {
    "unknown scenario": (["squad"], "squad", "squat"),
    "missing file": (["nowhere/s.yaml"], "nowhere/s.yaml", "stand"),
    "folder instead of a file": (["."], "'.'", "stand"),
    "unknown robot": (["stand", "--robot", "g2"], "'g2'", "g1"),
    "robot that is nothing": (["stand", "--robot", ""], "''", "humanoid33"),
    "missing robot file": (["stand", "--robot", "no/robot.urdf"], "no/robot.urdf", "No such file"),
    "unknown controller": (["stand", "--controller", "osc"], "'osc'", "whole_body"),
    "controller that is nothing": (["stand", "--controller", ""], "''", "whole_body"),
    "unknown strategy": (["stand", "--strategy", "fast"], "'fast'", "direct"),
    "formula of the study": (
        ["stand", "--controller", "osf", "--strategy", "numerical"],
        "'numerical'",
        "fused",
    ),
    "out is a file": (["stand", "--out", "taken"], "'taken'", "writable"),
    "out under a file": (["stand", "--out", "taken/deeper"], "taken/deeper", "writable"),
    "no soles for this stack": (["stand", "--robot", "arm6"], "arm6", "left_sole, right_sole"),
    "empty file": (["empty.yaml"], "None", "keys with values"),
    "binary file": (["binary.yaml"], "binary.yaml", "UTF-8"),
    "URDF without inertia": (["stand", "--robot", "bare.urdf"], "bare.urdf", ""),
    "robot file that is no robot": (["stand", "--robot", "empty.yaml"], "empty.yaml", "XML"),
}


def one_line(err):
    assert err.startswith("poise: ")
    assert err.count("\n") == 1
    assert err.endswith("\n")
    assert "Traceback" not in err


@pytest.mark.parametrize("case", BAD_WORDS)
def test_bad_input_is_one_line_and_status_two_and_nothing_moves(
    in_folder, capsys, monkeypatch, case
):
    def no_step(*_):
        raise AssertionError("the plant moved")

    monkeypatch.setattr(Plant, "step", no_step)
    (in_folder / "taken").write_text("")
    (in_folder / "empty.yaml").write_text("")
    (in_folder / "binary.yaml").write_bytes(b"\xff\xfe\x00\x9f")
    (in_folder / "bare.urdf").write_text("<robot name='r'><link name='a'/></robot>")
    arguments, got, choice = BAD_WORDS[case]
    assert main(["run", *arguments, "--no-video"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    one_line(err)
    assert got in err
    assert choice in err
    assert files(in_folder) == {"taken", "empty.yaml", "binary.yaml", "bare.urdf"}


def test_a_refused_command_leaves_folders_that_were_there(in_folder):
    (in_folder / "o").mkdir()
    for out in ("o", "o/deep/er"):
        assert main(["run", "stand", "--robot", "arm6", "--no-video", "--out", out]) == 2
        assert files(in_folder) == {"o"}
        assert files(in_folder / "o") == set()


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "stand", "--seed", "-1"],
        ["run", "stand", "--seed", "one"],
        ["run", "stand", "--seed", "1.5"],
        ["run", "stand", "walk"],
        ["run", "stand", "--robot"],
        ["run", "--frobnicate"],
        ["scorecard", "--compare", "one"],
        ["drive", "--device", "hands"],
        ["describe"],
        ["walk"],
        [],
    ],
    ids=str,
)
def test_a_command_line_that_cannot_be_read_gives_one_line_and_status_two(arguments, capsys):
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    one_line(err)
    assert not arguments or arguments[-1] in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "--seed", "one"], r"poise: Error parsing --seed: no type matching INT.*one"),
        (["run", "--seed", "-1"], "seed is out of range; got -1; wanted a whole number"),
        (["drive", "--device", "x"], "poise: invalid choice 'x'.*--device.*'browser', 'gamepad'"),
        (["describe"], "poise: Missing from poise describe: FILE"),
        (["run", "--sed", "1"], "poise: no such option; got '--sed'; choices: --seed"),
        (["runn"], "poise: no such verb; got 'runn'; choices: run, "),
    ],
)
def test_a_word_that_cannot_be_read_is_named_beside_those_that_can(arguments, words, capsys):
    assert main(arguments) == 2
    assert re.search(words, capsys.readouterr().err)


def test_the_list_of_verbs_imports_nothing_that_takes_long(tmp_path):
    code = "import sys; from poise.cli.main import main; main(['--help']); print(*sys.modules)"
    done = poise(cwd=tmp_path, code=code)
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.splitlines()[-1].split())
    assert not loaded & {"mujoco", "pinocchio", "numba", "numpy", "pydantic", "scipy"}


def test_a_name_with_a_line_break_still_gives_one_line(in_folder, capsys):
    (in_folder / "s.yaml").write_text('name: s\nduration: 1\n"a\\nb": 3\n')
    assert main(["run", "s.yaml"]) == 2
    one_line(capsys.readouterr().err)


def test_a_window_without_a_screen_is_refused_in_one_line(in_folder, short, capsys, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert main(["run", short, "--view", "--no-video"]) == 2
    err = capsys.readouterr().err
    one_line(err)
    assert "without --view" in err


def test_a_folder_where_a_file_should_be_written_is_one_line(in_folder, short, capsys):
    (in_folder / "o" / "summary.json").mkdir(parents=True)
    assert main(["run", short, "--no-video", "--out", "o"]) == 2
    err = capsys.readouterr().err
    one_line(err)
    assert "summary.json" in err


def poise(*arguments, cwd, code="", **variables):
    """The command in a process of its own, or some code in its place."""
    command = [sys.executable, *(["-c", code] if code else ["-m", "poise"]), *arguments]
    screen = ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL", "PYOPENGL_PLATFORM")
    environment = {k: v for k, v in os.environ.items() if k not in screen} | variables
    return subprocess.run(
        command, capture_output=True, text=True, cwd=cwd, env=environment, timeout=60, check=False
    )


@pytest.mark.parametrize("arguments", [("bad.yaml",), ("stand", "--out", "/proc/x/y")], ids=str)
def test_a_real_process_gives_one_line_and_status_two(tmp_path, arguments):
    (tmp_path / "bad.yaml").write_text("name: s\nduration: 5 s\n")
    done = poise("run", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    one_line(done.stderr)


LIBRARY_MISSING = """
import sys
from importlib.abc import MetaPathFinder


class Missing(MetaPathFinder):
    def find_spec(self, name, *_):
        if name in ("mujoco.egl", "mujoco.osmesa"):
            raise {error}


sys.meta_path.insert(0, Missing())
from poise.cli.main import main
sys.exit(main())
"""
"""The command where the library of a back end is not there, which PyOpenGL says in many ways."""


@pytest.mark.parametrize("verb", ["run", "describe", "teleop", "drive", "scorecard", "campaign"])
def test_a_wrong_back_end_of_opengl_is_one_line(tmp_path, verb):
    file = ["x.urdf"] if verb in ("describe", "campaign") else []
    done = poise(verb, *file, cwd=tmp_path, MUJOCO_GL="eggl")
    assert (done.returncode, done.stdout) == (2, "")
    one_line(done.stderr)
    assert "MUJOCO_GL is no OpenGL back end" in done.stderr
    assert "'eggl'" in done.stderr
    assert "libegl1" in done.stderr
    assert files(tmp_path) == set()


@pytest.mark.parametrize(
    ("back_end", "package"), [("egl", "libegl1"), ("osmesa", "libosmesa6")], ids=str
)
def test_a_missing_library_of_opengl_is_one_line(tmp_path, back_end, package):
    code = LIBRARY_MISSING.format(error="AttributeError('glGetError')")
    done = poise("run", "stand", cwd=tmp_path, code=code, MUJOCO_GL=back_end)
    assert (done.returncode, done.stdout) == (2, "")
    one_line(done.stderr)
    assert f"MUJOCO_GL={back_end}" in done.stderr
    assert f"apt install {package}" in done.stderr


def test_a_back_end_that_mujoco_does_without_leaves_the_video_out(tmp_path):
    (tmp_path / "s.yaml").write_text(SHORT)
    code = LIBRARY_MISSING.format(error="ImportError('no OSMesa')")
    done = poise("run", "s.yaml", cwd=tmp_path, code=code, MUJOCO_GL="osmesa")
    assert done.returncode == 0, done.stderr
    (said,) = (line for line in done.stderr.splitlines() if not line.startswith("simulating: "))
    assert said.startswith("No video: Drawing with MUJOCO_GL=osmesa needs")
    assert "apt install libosmesa6" in said


UNSTABLE = """
import mujoco
from poise.cli.main import main
main(["run", "--list", "--json"])
model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
)
data = mujoco.MjData(model)
data.qvel[:] = 1e300
mujoco.mj_step(model, data)
assert data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number == 1
"""


def test_warnings_of_mujoco_reach_neither_the_screen_nor_a_file(tmp_path):
    done = poise(cwd=tmp_path, code=UNSTABLE)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "WARNING" not in done.stdout
    assert files(tmp_path) == set()


def test_a_real_process_runs_a_file_to_its_log(tmp_path):
    (tmp_path / "s.yaml").write_text(SHORT)
    done = poise("run", "s.yaml", "--no-video", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    # A machine that is busy enough gets lines of progress.
    assert all(line.startswith("simulating: ") for line in done.stderr.splitlines())
    assert read_log(tmp_path / "runs" / "short-biped20" / "log.mcap").complete


def test_the_reader_of_a_pipe_may_go_away(tmp_path):
    command = f"{sys.executable} -m poise robots | true"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], capture_output=True, text=True, timeout=60,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0
    assert "Traceback" not in done.stderr


def test_the_version_is_said(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == f"poise {__version__}"
