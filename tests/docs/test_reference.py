"""Every public name has an example in the reference, and the examples run."""

import re
import subprocess
import sys

import pytest

pytest.importorskip("mkdocs")
pytest.importorskip("griffe")

from docs import hooks, reference_examples

SLOW = ("campaigns", "onboarding", "scenarios")
FILES = sorted(reference_examples.EXAMPLES.glob("*.py"), key=lambda file: file.stem in SLOW)
PACKAGES = {name: names for name, names in hooks.public_names().items() if name != "poise"}


@pytest.mark.fast_cases(13)
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_examples_run(file):
    """Each in a process of its own, as users run them: some start workers."""
    pytest.importorskip("mujoco")
    command = [sys.executable, file]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", timeout=120, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("package", [name for name, names in PACKAGES.items() if names])
def test_every_public_name_has_an_example_that_uses_it(package):
    file = reference_examples.EXAMPLES / f"{package.rpartition('.')[2]}.py"
    cells = reference_examples.cells(file.read_text(encoding="utf-8"))
    assert set(cells) == set(PACKAGES[package])
    for name, code in cells.items():
        assert re.search(rf"\b{name}\b", code), name


def test_names_are_read_as_the_interpreter_has_them():
    import poise.stack

    assert hooks.public_names()["poise.stack"] == poise.stack.__all__
    assert hooks.public_names()["poise"] == poise.__all__


def test_a_name_of_the_package_itself_has_its_reference_elsewhere():
    elsewhere = {name for names in PACKAGES.values() for name in names}
    assert set(hooks.public_names()["poise"]) <= elsewhere
