"""The lint of prose finds phrases on added lines of docstrings and comments, and nowhere else."""

import os
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest

from docs import lint_prose

ROOT = Path(__file__).parents[2]
CLEAN = '"""Solve a problem."""\n'
OLD = '"""What somebody wants at once."""\n\n# Likewise.\nx = 1\n'


class Repository:
    """A git repository with one commit on `main`, and the lint in it."""

    def __init__(self, folder):
        self.folder = folder
        author = {
            f"GIT_{who}_{what}": "me"
            for who in ("AUTHOR", "COMMITTER")
            for what in ("NAME", "EMAIL")
        }
        self._environment = os.environ | author | {"GIT_CONFIG_GLOBAL": os.devnull}
        self.git("init", "--quiet", "--initial-branch=main")
        self.write("src/old.py", OLD)
        self.commit()

    def git(self, *arguments):
        command = ["git", *arguments]
        subprocess.run(command, cwd=self.folder, env=self._environment, check=True)

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")

    def commit(self):
        self.git("add", "--all")
        self.git("commit", "--quiet", "--message", "Change")

    def lint(self, *arguments):
        """Exit status and printed lines."""
        done = subprocess.run(
            [sys.executable, ROOT / "docs/lint_prose.py", *arguments],
            cwd=self.folder,
            env=self._environment,
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout.splitlines()


@pytest.fixture
def repository(tmp_path):
    return Repository(tmp_path)


def found(text):
    text = dedent(text)
    return lint_prose.faults(text, set(range(1, text.count("\n") + 2)))


def test_old_prose_in_a_touched_file_is_left_and_an_added_line_is_not(repository):
    repository.git("switch", "--quiet", "--create", "branch")
    repository.write("src/old.py", OLD + "# The sole felt it.\n")
    repository.write("src/new.py", CLEAN)
    repository.commit()
    repository.write("src/new.py", CLEAN + "# Uncommitted, and somebody's.\n")
    repository.write("tests/untracked.py", "\n# Borrowed.\n")
    assert repository.lint() == (
        1,
        ["src/new.py:2: somebody", "src/old.py:5: felt", "tests/untracked.py:2: Borrowed"],
    )
    repository.write("src/old.py", OLD)
    repository.write("src/new.py", CLEAN)
    (repository.folder / "tests/untracked.py").unlink()
    assert repository.lint() == (0, [])


def test_the_base_is_where_the_branch_left_main_or_the_commit_before_or_the_one_given(repository):
    repository.write("src/one.py", "# Somebody.\n")
    repository.commit()
    repository.write("src/two.py", "# Likewise.\n")
    repository.commit()
    two, one = "src/two.py:1: Likewise", "src/one.py:1: Somebody"
    assert repository.lint() == (1, [two])
    assert repository.lint("--base", "HEAD~2") == (1, [one, two])
    repository.git("switch", "--quiet", "--create", "branch", "HEAD~1")
    for name in ("three", "four"):
        repository.write(f"src/{name}.py", "# Felt.\n")
        repository.commit()
    assert repository.lint() == (1, ["src/four.py:1: Felt", "src/three.py:1: Felt"])
    # Ahead of the remote, main is compared with it.
    repository.git("switch", "--quiet", "main")
    repository.git("update-ref", "refs/remotes/origin/main", "HEAD~2")
    assert repository.lint() == (1, [one, two])


def test_without_history_there_is_nothing_to_compare(repository, tmp_path_factory):
    status, (line,) = repository.lint()
    assert status == 0
    assert line.startswith("nothing to compare")
    repository.folder = tmp_path_factory.mktemp("no_repository")
    status, (line,) = repository.lint()
    assert status == 0
    assert line.startswith("nothing to compare")


def test_a_base_that_does_not_exist_is_an_error(repository):
    assert repository.lint("--base", "nowhere") == (2, [])


def test_only_python_files_of_the_folders_are_read_and_moved_ones_are_not_new(repository):
    for name in ("docs/page.py", "src/page.html", "setup.py"):
        repository.write(name, "# Somebody.\n")
    names = [f"{folder}/a/b.py" for folder in sorted(lint_prose.FOLDERS)]
    for name in names:
        repository.write(name, "# Somebody.\n")
    repository.git("mv", "src/old.py", "src/moved.py")
    repository.commit()
    assert repository.lint() == (1, [f"{name}:1: Somebody" for name in names])
    for name in names:
        (repository.folder / name).unlink()
    repository.commit()
    assert repository.lint() == (0, [])


@pytest.mark.parametrize("phrase", lint_prose.PHRASES)
def test_each_phrase_is_found_in_docstrings_and_comments_also_wrapped(phrase):
    assert found(f'def f():\n    """Do it.\n\n    Here {phrase}.\n    """\n') == [(4, phrase)]
    assert found(f"x = 1  # {phrase.capitalize()}.\n") == [(1, phrase.capitalize())]
    first, _, rest = phrase.partition(" ")
    if rest:
        assert found(f"\n# So it {first}\n#   {rest}, always.\n") == [(2, phrase)]
        assert found(f'X = 1\n"""A number {first}\n{rest}."""\n') == [(2, phrase)]


@pytest.mark.parametrize("word", ["What", "Whether", "Where", "How"])
def test_openings_are_found_where_a_docstring_begins(word):
    assert found(f'"""{word} it is."""\n') == [(1, f"docstring opens with {word}")]
    assert found(f'class A:\n    """\n    {word}, then."""\n') == [
        (3, f"docstring opens with {word}")
    ]
    assert found(f'"""Do it.\n\n{word} it is."""\n# {word} it is.\n') == []


def test_other_words_names_in_backticks_and_strings_that_are_no_docstrings_are_left():
    assert (
        found('''
        """Called and settled, the ledger: `felt`, `_led`, a felted sole, somebodys.

        Whatever comes, down it goes; at, once more. It is `x` told, and is
        """

        told = "somebody is told at once"  # However `led` it is.

        # What is

        # left alone is no sentence.


        def f():
            """However it goes."""
            return """What somebody wants."""
        ''')
        == []
    )


def test_a_phrase_counts_where_any_of_its_lines_is_added():
    text = "# It is\n# told so.\n"
    assert lint_prose.faults(text, {2}) == [(1, "is told")]
    assert lint_prose.faults(text, {3}) == []
    text = '"""What\n\nis\nfelt."""\n'
    assert lint_prose.faults(text, {4}) == [(4, "felt")]


def test_ci_lints_prose_after_ruff_and_before_pyright():
    script = (ROOT / ".ci/lint").read_text(encoding="utf-8").splitlines()
    commands = [
        '"$tools/ruff" format --check .',
        '"$tools/python" docs/lint_prose.py',
        '"$tools/pyright" --pythonpath "$tools/python"',
    ]
    assert [line for line in script if line in commands] == commands
