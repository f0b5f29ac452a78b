"""`poise doctor`: what is missing is a line with its remedy, and never a traceback."""

import json
import os
import shutil
import subprocess
import sys
from importlib import metadata

import numba
import pytest

pytest.importorskip("mujoco")

from poise.cli import _doctor
from poise.cli.main import main
from poise.sim import find_opengl

CHECKS = dict(_doctor._CHECKS)


@pytest.fixture
def doctor(monkeypatch, capsys):
    """Carries out one check; its exit status and its lines by name."""

    def examine(check):
        monkeypatch.setattr(_doctor, "_CHECKS", {check: CHECKS[check]})
        status = main(["doctor"])
        out, err = capsys.readouterr()
        assert err == ""
        *lines, last = out.splitlines()
        found = {}
        for line in lines:
            state, _, rest = line.partition(" ")
            name, _, seen = rest.strip().partition(": ")
            found[name] = (state, seen)
        failed = [state for state, _ in found.values()].count("FAIL")
        assert last.startswith(f"{failed} failed")
        assert status == (1 if failed else 0)
        return found

    return examine


def test_an_installation_that_works_fails_no_check(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "poise", "doctor", "--json"],
        cwd=tmp_path, capture_output=True, text=True, timeout=280, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    found = {line["name"]: line for line in json.loads(done.stdout)["checks"]}
    assert "numba" in found["packages"]["seen"]
    assert "mujoco" in found["extra sim"]["seen"]
    assert "humanoid33 stands for 4 s under a push: ok" in found["self-test"]["seen"]
    assert found["compiled functions"]["state"] == "ok"
    assert found["this folder"]["seen"].startswith(str(tmp_path))
    assert all(line["remedy"] or line["state"] == "ok" for line in found.values())


def test_missing_and_old_packages_are_named_with_the_extra_to_install(doctor, monkeypatch):
    given = {
        "websockets": None,
        "mujoco": None,
        "numpy": "1.26.4",
        "pandas": "2.1",
        "numba": "0.69",
    }
    version = metadata.version

    def changed(name):
        if name in given and given[name] is None:
            raise metadata.PackageNotFoundError(name)
        return given.get(name) or version(name)

    monkeypatch.setattr(metadata, "version", changed)
    found = doctor("packages")
    remedy = '(pip install {}"poise[{}]")'.format
    assert found["extra sim"] == ("warn", f"not installed: mujoco {remedy('', 'sim')}")
    assert found["extra teleop"] == (
        "ok",
        f"not installed: mujoco, websockets {remedy('', 'teleop')}",
    )
    assert found["extra tables"] == ("FAIL", f"pandas 2.1 is not >=2.2 {remedy('-U ', 'tables')}")
    state, seen = found["packages"]
    assert state == "FAIL"
    assert "numpy 1.26.4 is not >=2.0" in seen
    assert "numba 0.69 is not <0.69,>=0.62" in seen
    assert seen.endswith("(pip install -U poise)")
    monkeypatch.setattr(_doctor.platform, "python_version", lambda: "3.10.14")
    state, seen = doctor("Python")["Python"]
    assert state == "FAIL"
    assert "make a virtual environment with Python >=3.11" in seen


@pytest.mark.parametrize(
    ("version", "bounds", "good"),
    [
        ("2.0", ">=2.0.0", True), ("2.0rc1", ">=2", True), ("1.10.0+cu12", ">=1.9,<2", True),
        ("2", "<2.0", False), ("0.61.9", "<0.69,>=0.62", False), ("1.0.post1", ">=1.0", True),
        ("0.1.8", "==0.1.8", True), ("0.1.9", "==0.1.8", False),
    ],
)  # fmt: skip
def test_versions_are_compared_by_their_numbers(version, bounds, good):
    assert _doctor._is_within(version, bounds) is good


def test_without_opengl_there_is_a_remedy(doctor, monkeypatch):
    find_opengl.cache_clear()
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    for name in ("MUJOCO_GL", "PYOPENGL_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    state, seen = doctor("OpenGL")["OpenGL"]
    find_opengl.cache_clear()
    assert (state, seen.startswith("no video or picture can be drawn")) == ("warn", True)
    assert "apt install libegl1" in seen


def test_code_that_cannot_be_kept_or_is_not_compiled_fails(doctor, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "/proc/none")
    _, seen = doctor("compiled code")["compiled code"]
    assert "compiled code cannot be kept; got '/proc/none'" in seen
    assert "NUMBA_CACHE_DIR names another" in seen
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert doctor("compiled code")["compiled code"][1].endswith("(unset it)")


@pytest.mark.skipif(os.getuid() != 0, reason="only root mounts")
def test_a_full_disk_and_a_folder_that_is_gone(doctor, tmp_path, monkeypatch):
    mount = ["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(tmp_path)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("no disk can be mounted here")
    try:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr("poise._compiled.code_folder", lambda: str(tmp_path))
        full = f"{tmp_path} takes no 32 MB: No space left on device"
        remedies = "(change to another, or use --out DIR)", "(NUMBA_CACHE_DIR names another folder)"
        assert doctor("disks")["this folder"] == ("warn", f"{full} {remedies[0]}")
        assert doctor("compiled code")["compiled code"] == ("FAIL", f"{full} {remedies[1]}")
    finally:
        os.chdir("/")
        subprocess.run(["umount", str(tmp_path)], check=True)


def test_a_check_that_raises_and_a_self_test_that_dies_are_failures(doctor, monkeypatch):
    def nothing():
        raise OSError(2, "no such\nfile", "/proc/loadavg")

    monkeypatch.setattr(os, "getloadavg", nothing)
    state, seen = doctor("cores")["cores"]
    assert (state, "FileNotFoundError: [Errno 2] no such" in seen) == ("FAIL", True)
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    state, seen = doctor("self-test")["self-test"]
    assert (state, seen.startswith("status 1: no message")) == ("FAIL", True)
    assert "all lines of `poise doctor`" in seen
