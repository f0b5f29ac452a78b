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
from poise.cli.main import _VERBS, main
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


WRITTEN = {"report.html", "log.mcap", "summary.json"}


@pytest.fixture
def short(in_folder):
    (in_folder / "short.yaml").write_text(SHORT)
    return "short.yaml"


def files(folder):
    return {p.name for p in folder.iterdir()}


def test_a_run_writes_its_files_beside_one_another_and_says_what_held(in_folder, capsys):
    (in_folder / "short.yaml").write_text(SHORT.replace("robot: biped20\n", ""))
    assert main(["run", "short.yaml", "--no-video"]) == 0
    assert files(in_folder / "runs" / "short-humanoid33") == WRITTEN
    out, err = capsys.readouterr()
    assert err == ""
    assert "short on humanoid33: all checks hold" in out
    assert "ok    missed ticks: 0 (<= 0)" in out
    assert "<= 0.01 m)" in out
    assert "report: runs/short-humanoid33/report.html" in out


def test_json_prints_the_summary_alone_and_no_earlier_video_passes_for_this_runs(
    in_folder, short, capsys
):
    folder = in_folder / "here"
    folder.mkdir()
    for name in ("video.mp4", "video.jpg"):
        (folder / name).write_bytes(b"of another run")
    line = ["run", short, "--no-video", "--json", "--out", "here", "--seed", "7"]
    # One that is refused leaves the earlier one as it was.
    assert main([*line, "--controller", "osf", "--strategy", "direct"]) == 2
    assert files(folder) == {"video.mp4", "video.jpg"}
    capsys.readouterr()
    assert main([*line, "--strategy", "cascade"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert json.loads(out) == json.loads((folder / "summary.json").read_text())
    assert json.loads(out)["seed"] == 7
    assert files(folder) == WRITTEN
    assert "whole_body (cascade)" in (folder / "report.html").read_text()


@pytest.mark.skipif(find_opengl() is None, reason="this machine cannot draw")
def test_a_video_lies_beside_the_report(in_folder, short, capsys):
    assert main(["run", short, "--out", "o"]) == 0
    assert files(in_folder / "o") == WRITTEN | {"video.mp4", "video.jpg"}
    assert (in_folder / "o" / "video.mp4").read_bytes()[4:8] == b"ftyp"
    assert 'src="video.mp4"' in (in_folder / "o" / "report.html").read_text()


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (
            MissingExtraError("libegl1", "", "Drawing", install="apt install libegl1"),
            ("No video: Drawing needs", "apt install libegl1"),
        ),
        (KeyboardInterrupt(), ("No video: interrupted",)),
    ],
    ids=["no OpenGL", "Ctrl-C"],
)
def test_without_a_video_the_report_comes_and_says_why(
    in_folder, short, capsys, monkeypatch, fault, words
):
    def cannot(_, __, ___, path, **____):
        if isinstance(fault, KeyboardInterrupt):
            path.write_bytes(b"the first half")
        raise fault

    monkeypatch.setattr(outputs, "render_video", cannot)
    assert main(["run", short, "--out", "o"]) == 0
    said = capsys.readouterr().err
    assert files(in_folder / "o") == WRITTEN
    page = (in_folder / "o" / "report.html").read_text()
    assert "<video" not in page
    assert words[-1].removeprefix("apt ") in page
    for text in words:
        assert text in said


def test_a_check_that_fails_gives_status_one(in_folder, capsys):
    (in_folder / "s.yaml").write_text(SHORT.replace("at_most: 0.01", "at_least: 1.0"))
    assert main(["run", "s.yaml", "--no-video"]) == 1
    out = capsys.readouterr().out
    assert "short on biped20: FAILED" in out
    assert "  FAIL  largest distance of the CoM from its reference" in out


def test_list_names_every_shipped_scenario(capsys):
    assert main(["run", "--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(shipped_scenarios())
    assert main(["run", "--list", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == set(shipped_scenarios())


def test_robots_lists_what_can_be_loaded(capsys):
    assert main(["robots"]) == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.split()[:3] == ["name", "joints", "mass"]
    names = [entry.name for entry in catalog()]
    assert [line.split()[0] for line in lines[: len(names)]] == names
    assert main(["robots", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert list(rows) == names
    assert rows["humanoid33"]["joints"] == 33
    assert rows["humanoid33"]["mass_kg"] == pytest.approx(100.0)
    assert rows["g1"]["joints"] == 29
    assert all(isinstance(row["installed"], bool) and row["licence"] for row in rows.values())


@pytest.mark.parametrize("verb", ["", *_VERBS])
def test_help_has_an_example(verb, capsys):
    words = verb.split()
    assert main([*words, "--help"]) == 0
    assert f"example: {' '.join(['poise', *words])}" in " ".join(capsys.readouterr().out.split())


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
    "unknown strategy": (["stand", "--strategy", "fast"], "'fast'", "direct"),
    "out is a file": (["stand", "--out", "taken"], "'taken'", "writable"),
    "out under a file": (["stand", "--out", "taken/deeper"], "taken/deeper", "writable"),
    "no soles for this stack": (["stand", "--robot", "arm6"], "arm6", "left_sole, right_sole"),
    "no feet": (["over_an_obstacle", "--robot", "arm6"], "arm6", "cannot walk on two feet"),
    "empty file": (["empty.yaml"], "None", "keys with values"),
    "binary file": (["binary.yaml"], "binary.yaml", "UTF-8"),
    "a name with a line break": (["break.yaml"], "break.yaml", ""),
    "URDF without inertia": (["stand", "--robot", "bare.urdf"], "bare.urdf", ""),
    "robot file that is no robot": (["stand", "--robot", "empty.yaml"], "empty.yaml", "XML"),
}


@pytest.mark.parametrize("case", BAD_WORDS)
def test_bad_input_is_one_line_and_status_two_and_nothing_moves(
    in_folder, refused, monkeypatch, case
):
    def no_step(*_):
        raise AssertionError("the plant moved")

    monkeypatch.setattr(Plant, "step", no_step)
    for name, content in (
        ("taken", b""),
        ("empty.yaml", b""),
        ("binary.yaml", b"\xff\xfe\x00\x9f"),
        ("break.yaml", b'name: s\nduration: 1\n"a\\nb": 3\n'),
        ("bare.urdf", b"<robot name='r'><link name='a'/></robot>"),
    ):
        (in_folder / name).write_bytes(content)
    before = files(in_folder)
    arguments, got, choice = BAD_WORDS[case]
    err = refused("run", *arguments, "--no-video")
    assert got in err
    assert choice in err
    assert files(in_folder) == before


def test_a_refused_command_leaves_folders_that_were_there(in_folder):
    (in_folder / "o").mkdir()
    for out in ("o", "o/deep/er"):
        assert main(["run", "stand", "--robot", "arm6", "--no-video", "--out", out]) == 2
        assert files(in_folder) == {"o"}
        assert files(in_folder / "o") == set()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "--seed", "one"], r"poise: Error parsing --seed: no type matching INT.*one"),
        (["run", "--seed", "-1"], "seed is out of range; got -1; wanted a whole number"),
        (["run", "stand", "walk"], "walk"),
        (["run", "stand", "--robot"], "--robot"),
        (["scorecard", "--compare", "one"], "one"),
        (["drive", "--device", "x"], "poise: invalid choice 'x'.*--device.*'browser', 'gamepad'"),
        (["describe"], "poise: Missing from poise describe: FILE"),
        (["run", "--sed", "1"], "poise: no such option; got '--sed'; choices: --seed"),
        (["runn"], "poise: no such verb; got 'runn'; choices: run, "),
        ([], "no such verb"),
    ],
)
def test_a_word_that_cannot_be_read_is_named_beside_those_that_can(arguments, words, refused):
    assert re.search(words, refused(*arguments))


def test_the_list_of_verbs_imports_nothing_that_takes_long(tmp_path):
    code = "import sys; from poise.cli.main import main; main(['--help']); print(*sys.modules)"
    done = poise(cwd=tmp_path, code=code)
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.splitlines()[-1].split())
    assert not loaded & {"mujoco", "pinocchio", "numba", "numpy", "pydantic", "scipy"}


def test_a_window_without_a_screen_is_refused_in_one_line(in_folder, short, refused, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert "without --view" in refused("run", short, "--view", "--no-video")


def poise(*arguments, cwd, code="", **variables):
    """The command in a process of its own, or some code in its place."""
    command = [sys.executable, *(["-c", code] if code else ["-m", "poise"]), *arguments]
    screen = ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL", "PYOPENGL_PLATFORM")
    environment = {k: v for k, v in os.environ.items() if k not in screen} | variables
    return subprocess.run(
        command, capture_output=True, text=True, cwd=cwd, env=environment, timeout=280, check=False
    )


NO_LIBRARY = """
import sys
from importlib.abc import MetaPathFinder


class Missing(MetaPathFinder):
    def find_spec(self, name, *_):
        if name in ("mujoco.egl", "mujoco.osmesa"):
            raise AttributeError('glGetError') if name == "mujoco.egl" else ImportError('no OSMesa')


sys.meta_path.insert(0, Missing())
from poise.cli.main import main
sys.exit(main())
"""
"""The command where the library of a back end is not there, which PyOpenGL says in many ways."""


def one_line(done, *words):
    """Check that a process has ended by one line of bad input."""
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("poise: ")
    assert done.stderr.count("\n") == 1
    for text in words:
        assert text in done.stderr


@pytest.mark.parametrize("verb", ["run", "describe", "teleop"])
def test_a_wrong_back_end_of_opengl_is_one_line(tmp_path, verb):
    file = ["x.urdf"] if verb == "describe" else []
    done = poise(verb, *file, cwd=tmp_path, MUJOCO_GL="eggl")
    one_line(done, "MUJOCO_GL is no OpenGL back end", "'eggl'", "libegl1")
    assert files(tmp_path) == set()


def test_a_missing_library_of_opengl_is_one_line_or_leaves_the_video_out(tmp_path):
    (tmp_path / "s.yaml").write_text(SHORT)
    done = poise("run", "s.yaml", cwd=tmp_path, code=NO_LIBRARY, MUJOCO_GL="egl")
    one_line(done, "MUJOCO_GL=egl", "apt install libegl1")
    # MuJoCo itself does without this one.
    done = poise("run", "s.yaml", cwd=tmp_path, code=NO_LIBRARY, MUJOCO_GL="osmesa")
    assert done.returncode == 0, done.stderr
    # A machine that is busy enough gets lines of progress.
    (said,) = (line for line in done.stderr.splitlines() if not line.startswith("simulating: "))
    assert said.startswith("No video: Drawing with MUJOCO_GL=osmesa needs")
    assert "apt install libosmesa6" in said
    assert read_log(tmp_path / "runs" / "short-biped20" / "log.mcap").complete
    one_line(poise("run", "s.yaml", "--out", "/proc/x/y", cwd=tmp_path), "writable")


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


def test_the_reader_of_a_pipe_may_go_away(tmp_path):
    command = f"{sys.executable} -m poise robots | true"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], capture_output=True, text=True, timeout=280,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0
    assert "Traceback" not in done.stderr


def test_the_version_is_said(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == f"poise {__version__}"
