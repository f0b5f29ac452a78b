"""The files around the code agree with each other and with the code."""

import os
import re
import subprocess
import tomllib
from importlib.metadata import PackageNotFoundError, requires
from pathlib import Path

import yaml
from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = PYPROJECT["project"]
CONDA_NAMES = {
    "matplotlib": "matplotlib-base",
    "mujoco": "mujoco-python",
    "pin": "pinocchio-python",
}
"""Packages that have other names on conda-forge."""
README = (ROOT / "README.md").read_text(encoding="utf-8")
LOCK = re.compile(r"^([A-Za-z0-9._-]+)==(\S+)$")


def lock_lines() -> list[str]:
    lines = (ROOT / "requirements.lock").read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def setup_commands() -> list[str]:
    section = README.partition("## Set-up")[2].partition("\n## ")[0]
    return re.findall(r"```sh\n(.*?)\n```", section, re.DOTALL)


def test_citation_has_the_version_of_the_last_release_and_a_checkout_without_tags_a_later_one():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    coming = Version(PYPROJECT["tool"]["hatch"]["version"]["fallback-version"])
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.findall(r"^## \[(\d[\d.]*)\]", changelog, re.MULTILINE)
    assert coming.is_devrelease
    # Before the first release, the one to come.
    assert citation["version"] == (released[0] if released else coming.base_version)
    assert not released or coming > Version(released[0])


def test_changelog_has_an_unreleased_section_and_keeps_its_form():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (.*)$", text, re.MULTILINE)
    assert headings[0] == "[Unreleased]"
    assert all(re.fullmatch(r"\[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d", h) for h in headings[1:])
    kinds = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"^### (.*)$", text, re.MULTILINE)) <= kinds


def test_citation_has_what_its_format_needs():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()
    assert citation["license"] == PROJECT["license"]
    assert len(citation["references"]) == 3
    for reference in citation["references"]:
        assert {"type", "title", "authors"} <= reference.keys()


def test_lock_is_one_pinned_version_a_line_and_nothing_else():
    assert [line for line in lock_lines() if not LOCK.match(line)] == []
    names = [normal(line.split("==")[0]) for line in lock_lines()]
    assert len(names) == len(set(names))
    assert "poise" not in names


def test_lock_pins_every_requirement_within_its_bounds():
    pinned = {normal(n): v for n, v in (line.split("==") for line in lock_lines())}
    wanted = [*PROJECT["dependencies"]]
    for extra in PROJECT["optional-dependencies"].values():
        wanted += [r for r in extra if not r.startswith("poise[")]
    for requirement in map(Requirement, wanted):
        assert pinned[normal(requirement.name)] in requirement.specifier, requirement


def test_lock_is_closed_under_what_its_packages_require():
    pinned = {normal(line.split("==")[0]) for line in lock_lines()}
    for name in sorted(pinned):
        try:
            needed = requires(name) or []
        except PackageNotFoundError:
            continue
        for requirement in map(Requirement, needed):
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                assert normal(requirement.name) in pinned, f"{name} needs {requirement}"


def test_readme_has_two_setup_commands_and_ci_runs_both():
    commands = setup_commands()
    assert len(commands) == 2
    install, develop = commands
    assert install.endswith(".venv/bin/poise run")
    assert develop.endswith(".venv/bin/python -m pytest -n 2")
    assert all("\n" not in command for command in commands)
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert all(command in script for command in commands)


def test_setup_commands_use_extras_that_exist():
    for extra in re.findall(r'"\.\[(\w+)\]"', "".join(setup_commands())):
        assert extra in PROJECT["optional-dependencies"]


def test_ci_scripts_stop_at_the_first_error_and_are_valid_bash():
    for script in (ROOT / ".ci").iterdir():
        assert os.access(script, os.X_OK)
        text = script.read_text(encoding="utf-8")
        assert text.startswith("#!/usr/bin/env bash\n")
        assert "set -euo pipefail" in text
        subprocess.run(["bash", "-n", str(script)], check=True, timeout=30)


def test_the_list_of_examples_names_each():
    listed = (ROOT / "examples/README.md").read_text(encoding="utf-8")
    examples = {path.name for path in (ROOT / "examples").glob("*.*")} - {"README.md"}
    assert {name for name in examples if f"]({name})" not in listed} == set()


def test_readme_opens_with_one_paragraph_and_a_picture():
    head = README.split("\n\n")
    assert head[0] == "# Poise"
    assert head[1].startswith("Poise is ")
    assert head[2].startswith("![")


def test_ci_runs_everything_that_a_workflow_runs():
    text = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    lines = {line.removesuffix(" &") for line in text.splitlines()}
    for path in (ROOT / ".github" / "workflows").iterdir():
        workflow = yaml.safe_load(path.read_text(encoding="utf-8"))
        for step in (step for job in workflow["jobs"].values() for step in job["steps"]):
            command = step.get("run", ".ci/run").removeprefix("sudo ")
            script = re.fullmatch(r"\.ci/\w+", command) and command in text.split()
            assert script or command in lines | {".ci/run"}, (path.name, command)


def test_workflows_test_the_pythons_of_the_classifiers():
    workflow = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))
    pythons = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if ":: Python :: 3." in c]
    assert workflow["jobs"]["test"]["strategy"]["matrix"]["python"] == pythons
    assert PROJECT["requires-python"] == f">={pythons[0]}"


def test_conda_recipe_requires_what_the_project_requires():
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8"))
    core = [f"python{PROJECT['requires-python']}", *PROJECT["dependencies"]]
    required = (core, PROJECT["optional-dependencies"]["sim"])
    for output, wanted in zip(recipe["outputs"], required, strict=True):
        needed = [line for line in output["requirements"]["run"] if "pin_subpackage" not in line]
        conda = [
            Requirement(f"{CONDA_NAMES.get(r.name, r.name)}{r.specifier}")
            for r in map(Requirement, wanted)
        ]
        assert {*map(Requirement, needed)} == {*conda}
    host = recipe["outputs"][0]["requirements"]["host"]
    assert {*map(Requirement, PYPROJECT["build-system"]["requires"])} < {*map(Requirement, host)}
