"""The script that measures a checkout counts what its docstrings say."""

import json
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest

from docs import measure_house

ROOT = Path(__file__).parents[2]

FILES = {
    "src/poise/__init__.py": '"""Package."""\n\n__all__ = ["Shown"]\n',
    "src/poise/_compiled/__init__.py": "",
    "src/poise/hqp/__init__.py": '__all__ = ["solve"]\n',
    "src/poise/hqp/_search/__init__.py": '__all__ = ["Search"]\n',
    "src/poise/hqp/_search/search.py": '''\
        """Whether a name is public is decided by its package."""

        import math

        class Search:
            """Active-set search.

            Listed by a private package alone: three lines beyond the first.
            """

        class Shown:
            """Constants of the module below: not one is within a class.

            Two lines beyond the first and the one of the quotes.
            """

            LIMIT = 3

            def shown(self):
                """Public.

                Three.
                """

                def inner():
                    """Inside a function.

                    Nobody can name it.
                    """

            def _hidden(self):
                """How, with a comma:

                it opens with How all the same.
                """

            class Inner:
                """What is inside a public class."""

        class _Hidden:
            def method(self):
                """Wherever: not an opening.

                A method of a class that is not public.
                """

        def solve():
            """Where,
            of all places."""
    ''',
    "src/poise/sim/_constants.py": """\
        import math

        ONE = 1
        _TWO: float = 2.0
        LEFT, RIGHT = 0, 1
        SIGNS = {"left": -1, "right": +1}
        HALF = math.pi / 2
        A = B = 3

        NAME = "1"
        FLAG = True
        PI = math.pi
        lower = 4
        BARE: int
        Mixed = 5
        if ONE:
            INSIDE = 6

        class Shown:
            pass
    """,
    "src/poise/robots/_robot.py": "\n\n",
    "src/poise/apps/onboarding/__init__.py": "\n",
    "src/poise/apps/onboarding/page.css": "\n\n\n",
    "src/poise/apps/live/page.html": "<p>\n</p>\n",
    "src/poise/apps/live/page.js": "//\n",
    "src/poise/apps/live/three.bundle.min.js": "//\n" * 1000,
    "src/poise/apps/live/scene.yaml": "a: 1\n",
    "src/poise/cli/_run.py": "\n",
    "docs/page.md": "# Page\n\nText.\n",
    "docs/script.py": "\n",
    "tests/test_one.py": "\n",
    "tests/notes.md": "not counted\n",
    "studies/one.py": "class Shown:\n    pass\n",
    "benchmarks/two.py": "ONE = 1\n",
    "bundled_robots/three.py": "\n\n",
}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    # A folder above the checkout whose name begins as a private package's does.
    folder = tmp_path_factory.mktemp("house") / "_checkout"
    for name, content in FILES.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(dedent(content), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def figures(checkout):
    done = subprocess.run(
        [sys.executable, ROOT / "docs/measure_house.py", checkout],
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def test_rows_and_files_are_counted_under_the_package_that_has_them(figures):
    search = len(dedent(FILES["src/poise/hqp/_search/search.py"]).splitlines())
    constants = len(dedent(FILES["src/poise/sim/_constants.py"]).splitlines())
    assert figures["sizes"] == {
        "root and _compiled": {"rows": 3, "files": 2},
        "hqp": {"rows": 2 + search, "files": 3},
        "sim": {"rows": constants, "files": 1},
        # The robots' own file, and onboarding with its style sheet.
        "robots and onboarding": {"rows": 2 + 1 + 3, "files": 3},
        # Templates and scripts, neither the bundled one nor the scene.
        "apps and cli": {"rows": 2 + 1 + 1, "files": 3},
        "docs": {"rows": 4, "files": 2},
        "tests": {"rows": 1, "files": 1},
        "studies and benchmarks": {"rows": 5, "files": 3},
    }
    assert figures["longest file"] == {"src/poise/hqp/_search/search.py": search}


def test_totals_are_those_of_python_alone(figures):
    sizes = figures["sizes"]
    templates = 3 + 2 + 1
    rows = sum(size["rows"] for size in list(sizes.values())[:-3])
    assert figures["library: lines"] == rows - templates
    assert figures["library: files"] == 9
    assert figures["library and laboratory: lines"] == rows - templates + 5
    assert figures["library and laboratory: files"] == 12
    assert figures["public names"] == 2


def test_constants_are_upper_case_names_at_the_top_of_a_module_with_a_number(figures):
    # ONE, _TWO, LEFT, RIGHT, SIGNS, HALF, A, B.
    assert figures["numeric constants"] == 8


def test_a_class_name_is_repeated_within_the_library(figures):
    assert figures["class names used more than once"] == 1


def test_docstrings_are_judged_by_their_first_word_and_by_who_lists_the_name(figures):
    # The module's, `_hidden`'s, `Inner`'s, `solve`'s.
    assert figures["docstrings that open with What, Whether, Where, How"] == 4
    lines = "docstring lines after the first: names in "
    # `Shown`, `Shown.shown` and `solve`.
    assert figures[lines + "an __all__ of a public package"] == 3 + 3 + 1
    assert figures[lines + "an __all__ of a private package"] == 3
    # `inner`, `_Hidden.method`, `Shown._hidden`.
    assert figures[lines + "no __all__"] == 3 + 3 + 3


def test_folders_of_onboarding_are_in_this_checkout():
    for part in measure_house.ONBOARDING:
        assert (ROOT / "src/poise" / part).exists(), part


def test_only_bundled_third_party_files_are_left_out():
    library = ROOT / "src/poise"
    suffixes = {".py", *measure_house.TEMPLATES}
    files = {path for path in library.rglob("*") if path.suffix in suffixes}
    left_out = files - set(measure_house.source_files(library, *suffixes))
    assert [path.name for path in left_out] == ["three.bundle.min.js"]
