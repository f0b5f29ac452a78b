"""Which part imports which: read from the source, and from what an import leaves in memory."""

import ast
import importlib
import json
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "src" / "poise"

FLOORS = (
    {"errors"},
    {"_yaml", "_progress"},
    {"_checks", "_copies", "_schema", "_compiled"},
    {"_show"},
    {"robots", "hqp"},
    {"dynamics"},
    {"stack", "estimation"},
    {"control"},
    {"locomotion", "sim", "hardware"},
    {"apps"},
    {"cli"},
)
"""From the ground up. A part imports from the floors below its own, and from itself."""

FLOOR = {name: height for height, names in enumerate(FLOORS) for name in names}

MUJOCO_USERS = ("sim/", "apps/scenarios/_replay.py")
"""The only places that import the simulator; everything else goes through them."""

OPTIONAL = (
    "mujoco", "matplotlib", "mcap", "imageio", "qpsolvers", "osqp", "proxsuite", "piqp",
    "clarabel", "quadprog", "example_robot_data", "websockets", "pygame", "msgspec",
    "pyarrow", "distributed", "submitit", "optuna", "jinja2", "unitree_interface", "zmq",
)  # fmt: skip


def modules():
    return sorted(ROOT.rglob("*.py"))


@cache
def imports_of(path):
    """Every absolute name that a file imports, wherever the import stands in it."""
    return tuple(_imports_of(path))


def _imports_of(path):
    package = ("poise", *path.relative_to(ROOT).parts[:-1])
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join((*above, *([node.module] if node.module else [])))
            if base == "poise":
                yield from (f"poise.{alias.name}" for alias in node.names)
            else:
                yield base


def part_of(name):
    """The part of Poise that a module name or a file belongs to."""
    return name.split(".")[1] if name.startswith("poise.") else None


def test_every_part_stands_on_a_floor():
    parts = {p.relative_to(ROOT).parts[0].removesuffix(".py") for p in modules()}
    assert parts - {"__init__", "__main__"} <= set(FLOOR)


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_downwards(path):
    own = path.relative_to(ROOT).parts[0].removesuffix(".py")
    if own in ("__init__", "__main__"):
        return
    for name in imports_of(path):
        part = part_of(name)
        if part is None or part == own or part not in FLOOR:
            continue
        assert FLOOR[part] < FLOOR[own], f"{own} imports {name}"


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_packages_are_reached_through_their_faces(path):
    """Past another package's face nobody goes; inside one, modules are called by their names."""
    own = ("poise", *path.relative_to(ROOT).parts[:-1])
    for name in imports_of(path):
        words = name.split(".")
        # A module stands in its package, a package's face in the one around it.
        package = tuple(words[:-1])
        if part_of(name) is None or not any(word.startswith("_") for word in words[2:]):
            continue
        assert own[: len(package)] == package, name


STEPPING = (
    {"_sample", "_biped", "_limbs"},
    {"_guard", "_estimator"},
    {"_footing"},
    {"_feet", "_velocity_tasks", "_torque_tasks"},
    {"_hands", "_velocity_level", "_torque_level"},
)
"""The floors within step teleoperation, below the modules that put them together."""


def test_parts_of_step_teleoperation_stand_on_floors_of_their_own():
    root, inside = ROOT / "locomotion" / "_stepping", "poise.locomotion._stepping."
    floor = {name: height for height, names in enumerate(STEPPING) for name in names}
    for own in floor:
        for name in imports_of(root / f"{own}.py"):
            part = name.removeprefix(inside).split(".")[0]
            if name.startswith(inside):
                assert floor.get(part, len(STEPPING)) < floor[own], f"{own}: {name}"


def test_the_simulator_takes_nothing_from_control_but_the_command():
    for path in (ROOT / "sim").rglob("*.py"):
        used = {name for name in imports_of(path) if part_of(name) in ("control", "locomotion")}
        assert used <= {"poise.control"}, path


def test_whole_packages_are_not_imported_from_inside():
    for path in modules():
        assert "poise" not in set(imports_of(path)), path


def test_only_the_simulator_imports_mujoco():
    for path in modules():
        if any(name.split(".")[0] == "mujoco" for name in imports_of(path)):
            assert str(path.relative_to(ROOT)).startswith(MUJOCO_USERS), path


def run_fresh(code):
    """What Python code prints, and the modules that it has loaded at the end, in a new process."""
    script = f"import json, sys; {code}; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], capture_output=True, text=True, check=True
    )
    *said, loaded = done.stdout.splitlines()
    return said, done.stderr, set(json.loads(loaded))


@pytest.fixture(scope="module")
def imported():
    return run_fresh("import poise")


def test_importing_poise_imports_nothing_optional(imported):
    _, _, loaded = imported
    assert not loaded & set(OPTIONAL)
    assert not {m for m in loaded if m.startswith(("poise.sim", "poise.apps"))}


def test_controlling_a_robot_imports_no_simulator_and_no_other_solver():
    _, _, loaded = run_fresh(
        "import poise, numpy as np; r = poise.load_robot('biped20'); "
        "c = poise.WholeBodyController(r); "
        "assert c.step(poise.RobotState(r.q_home, np.zeros(r.nv))).status.ok"
    )
    assert not loaded & set(OPTIONAL)


def test_importing_poise_prints_nothing(imported):
    said, errors, _ = imported
    assert (said, errors) == ([], "")


OUTSIDE = ("benchmarks", "studies", "bundled_robots")
LABORATORY = sorted(p for name in OUTSIDE for p in (ROOT.parents[1] / name).rglob("*.py"))


def absolute_imports(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""


def names_from_poise(path):
    """Module and name of everything that a file of the laboratory imports from Poise."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((a.name, None) for a in node.names if a.name.split(".")[0] == "poise")
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "poise":
            yield from ((node.module, alias.name) for alias in node.names)


@pytest.mark.parametrize("path", LABORATORY, ids=lambda p: str(p.relative_to(ROOT.parents[1])))
def test_the_laboratory_uses_public_names_alone(path):
    for module, name in names_from_poise(path):
        assert not [part for part in module.split(".") if part.startswith("_")], (module, name)
        public = getattr(importlib.import_module(module), "__all__", ())
        assert name is None or name in public, f"{module} does not offer {name}"


def test_nothing_in_poise_imports_the_laboratory():
    for path in modules():
        assert not {n.split(".")[0] for n in imports_of(path)} & set(OUTSIDE), path


def test_benchmarks_import_no_study():
    for path in LABORATORY:
        if path.is_relative_to(ROOT.parents[1] / "benchmarks"):
            assert "studies" not in {n.split(".")[0] for n in absolute_imports(path)}, path
