"""A folder to work in, and the one line of bad input."""

import pytest

from poise import _progress
from poise.cli.main import main


@pytest.fixture(autouse=True)
def _no_lines_of_progress(monkeypatch):
    """A busy machine writes none to stderr."""
    monkeypatch.setattr(_progress, "LINE_EVERY", float("inf"))


@pytest.fixture
def in_folder(tmp_path, monkeypatch):
    """A folder of its own to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def refused(capsys):
    """Carries out a command that is bad input; its one line on stderr."""

    def refuse(*arguments):
        assert main(arguments) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.startswith("poise: ")
        assert err.count("\n") == 1
        assert err.endswith("\n")
        assert "Traceback" not in err
        return err

    return refuse
