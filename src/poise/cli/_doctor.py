"""`poise doctor`: checks of an installation and its machine, each with its remedy."""

import json
import operator
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from importlib import import_module, metadata
from importlib.util import find_spec
from pathlib import Path
from statistics import quantiles
from time import perf_counter

from poise import __version__
from poise.cli._command import FAILED, OK, Figures
from poise.errors import PoiseError

# Those of the requirements in pyproject.toml
_RELATIONS = {">=": operator.ge, "<": operator.lt, "==": operator.eq}
_REQUIREMENT = re.compile(r"([\w.-]+)[^<>=;]*([^;]*)(?:;.*extra == ['\"](.*)['\"])?")
_ROOM = 32_000_000  # machine code takes 5 MB, a report with video and log 10 MB [bytes]
_PATIENCE = 600.0  # a slow machine compiles the first controller in less [s]
_REPORT = "report it with all lines of `poise doctor`"


@dataclass(frozen=True)
class _Finding:
    state: str  # ok, warn or FAIL
    name: str
    seen: str
    remedy: str


_Findings = Iterator[_Finding]


def _line(name: str, seen: str, good: bool = True, remedy: str = "", bad: str = "FAIL") -> _Finding:
    return _Finding("ok" if good else bad, name, seen, "" if good else remedy)


@dataclass(frozen=True, kw_only=True)
class DoctorVerb(Figures):
    """Check what Poise needs of this machine, and name a remedy for what is missing.

    Versions, extras, OpenGL, cores, compiled code, disks, robots, the time of the first use, and a
    stand with a push of some ten seconds. Exit status: 0 no check failed, 1 one did.

    example: poise doctor
    """

    def act(self) -> int:
        """Carry out all checks; print each line as soon as it is known."""
        found = list[_Finding]()
        for name, check in _CHECKS.items():
            if sys.stderr.isatty():
                print(f"{name} ...", end="\r", file=sys.stderr, flush=True)
            for one in _guarded(name, check):
                found.append(one)
                if not self.json:
                    remedy = f" ({one.remedy})" if one.remedy else ""
                    print(f"{one.state:4}  {one.name}: {one.seen}{remedy}", flush=True)
        failed, warned = (sum(f.state == state for f in found) for state in ("FAIL", "warn"))
        figures = {"ok": failed == 0, "checks": [asdict(f) for f in found]}
        self.show(figures, f"{failed} failed, {warned} warned")
        return FAILED if failed else OK


def _guarded(name: str, check: Callable[[], _Findings]) -> _Findings:
    """Findings of a check, and one more where it raises."""
    try:
        yield from check()
    except PoiseError as error:  # Its message has the remedy.
        yield _line(name, str(error), False)
    except Exception as error:
        what = " ".join(f"{type(error).__name__}: {error}".split())
        yield _line(name, what, False, _REPORT)


def _is_within(version: str, bounds: str) -> bool:
    """Compare releases by their numbers: candidates and local builds count as the release."""

    def numbers(text: str) -> list[int]:
        found = [int(n) for n in re.findall(r"\d+", re.split(r"[^\d.]", text)[0])]
        return found + [0] * (4 - len(found))

    pairs = re.findall(r"([<>=!~]+)\s*([\w.]+)", bounds)
    return all(_RELATIONS[sign](numbers(version), numbers(bound)) for sign, bound in pairs)


def _python() -> _Findings:
    yield _line("Poise", f"{__version__} in {Path(__file__).parents[1]}")
    version, wanted = platform.python_version(), metadata.metadata("poise")["Requires-Python"]
    paths = os.environ.get("PYTHONPATH")
    seen = f"{version}, {sys.executable}" + (f", PYTHONPATH={paths}" if paths else "")
    remedy = f"make a virtual environment with Python {wanted}"
    yield _line("Python", seen, _is_within(version, wanted), remedy)
    real_time = Path("/sys/kernel/realtime").exists() or "PREEMPT_RT" in platform.version()
    seen = f"{platform.platform()}, {'with' if real_time else 'without'} PREEMPT_RT"
    yield _line("system", seen, sys.platform == "linux", "tested on Linux alone", "warn")


def _packages() -> _Findings:
    """Versions and the bounds in Poise's own metadata, for the core and each extra."""
    groups = dict[str, dict[str, str]]()
    for text in metadata.requires("poise") or ():
        if match := _REQUIREMENT.match(text):
            groups.setdefault(match[3] or "", {})[match[1]] = match[2].strip()
    shown = set[str]()
    # Other extras contain `sim`, whose packages are listed once.
    extras = groups.keys() - {"dev", "docs"}
    for extra in sorted(extras, key=lambda name: (name not in ("", "sim"), name)):
        found, missing, old = list[str](), list[str](), list[str]()
        for name, bounds in groups[extra].items():
            try:
                version = metadata.version(name)
            except metadata.PackageNotFoundError:
                missing.append(name)
                continue
            if not _is_within(version, bounds):
                old.append(f"{name} {version} is not {bounds}")
            elif name not in shown:
                found.append(f"{name} {version}")
        shown |= groups[extra].keys()
        wrong = [*old, *([f"not installed: {', '.join(missing)}"] if missing else [])]
        upgrade = "-U " if old else ""
        remedy = f'pip install {upgrade}"poise[{extra}]"' if extra else "pip install -U poise"
        state = "FAIL" if old or not extra else "warn" if extra == "sim" else "ok"
        name = f"extra {extra}" if extra else "packages"
        yield _line(name, "; ".join(wrong or [", ".join(found)]), not wrong, remedy, state)


def _opengl() -> _Findings:
    if find_spec("mujoco") is None:
        return  # as the line of the extra says
    from poise.sim import find_opengl, missing_library

    drawn = find_opengl()
    seen = f"{drawn} has drawn a picture" if drawn else "no video or picture can be drawn"
    yield _line("OpenGL", seen, drawn is not None, str(missing_library()), "warn")


def _cores() -> _Findings:
    from poise._compiled import usable_cores

    cores, load = usable_cores(), os.getloadavg()[0]
    threads = [f"{k}={v}" for k, v in os.environ.items() if k.endswith("_NUM_THREADS")]
    seen = ", ".join([f"{cores} of {os.cpu_count()} usable", f"load {load:.1f}", *threads])
    yield _line("cores", seen, load <= cores, "other programs make ticks late", "warn")


def _code() -> _Findings:
    from poise._compiled import code_folder, count_kept

    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        seen, remedy = "NUMBA_DISABLE_JIT makes ticks some hundred times slower", "unset it"
        yield _line("compiled code", seen, False, remedy)
        return
    for name in ("control", "estimation", "locomotion"):
        import_module(f"poise.{name}")  # with all compiled functions of controllers
    folder, (kept, total, stale) = code_folder(), count_kept()
    yield _room("compiled code", folder, "NUMBA_CACHE_DIR names another folder", "FAIL")
    seen = f"{kept} of {total}" + (f", and {stale} files of other versions" if stale else "")
    remedy = f"find {folder} -name '*.nb[ic]' -delete; " * bool(stale) + "poise warmup"
    yield _line("compiled functions", seen, kept == total and not stale, remedy, "ok")


def _disks() -> _Findings:
    yield _room("temporary folder", tempfile.gettempdir(), "TMPDIR names another", "warn")
    yield _room("this folder", os.getcwd(), "change to another, or use --out DIR", "warn")


def _room(name: str, folder: str, remedy: str, state: str) -> _Finding:
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            os.posix_fallocate(file.fileno(), 0, _ROOM)  # Quotas count, too.
    except OSError as error:
        seen = f"{folder} takes no {_ROOM / 1e6:.0f} MB: {error.strerror}"
        return _line(name, seen, False, remedy, state)
    return _line(name, f"{folder}, {shutil.disk_usage(folder).free / 1e9:.1f} GB free")


def _robots() -> _Findings:
    from poise.robots import catalog

    installed = [entry.installed for entry in catalog()]
    seen = f"{sum(installed)} of {len(installed)} load by name"
    yield _line("robots", seen, all(installed), 'pip install "poise[robots]"', "ok")


def _self_test() -> _Findings:
    """First use and a stand, in a process of their own, which compiled code may end."""
    command = [sys.executable, "-c", "from poise.cli._doctor import stand; stand()"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        seen, remedy = f"not done in {_PATIENCE:.0f} s", "end other programs, run `poise warmup`"
        yield _line("self-test", seen, False, remedy)
        return
    if done.returncode:
        *_, last = ["no message", *done.stderr.strip().splitlines()]
        yield _line("self-test", f"status {done.returncode}: {last}", False, _REPORT)
        return
    first, what, status, p50, p99, period = json.loads(done.stdout.splitlines()[-1])
    # Kept code takes about a second, compiling half a minute.
    remedy = "`poise warmup` compiles ahead"
    yield _line("first use", f"{first:.1f} s to the first command", first < 10.0, remedy, "warn")
    tick = f"tick {p50:.0f} us median, {p99:.0f} us p99 of {period:.0f} us"
    stood = status == "ok"
    remedy = "other programs, or a slow machine" if stood else _REPORT
    state = "warn" if stood else "FAIL"
    yield _line("self-test", f"{what}: {status}, {tick}", stood and p99 < period, remedy, state)


_CHECKS = {
    "Python": _python,
    "packages": _packages,
    "OpenGL": _opengl,
    "cores": _cores,
    "compiled code": _code,
    "disks": _disks,
    "robots": _robots,
    "self-test": _self_test,
}


def stand() -> None:
    """Print as JSON how humanoid33 stands under a push, or without MuJoCo at fixed states."""
    begin = perf_counter()
    import numpy as np

    from poise.control import WholeBodyController
    from poise.dynamics import RobotState
    from poise.robots import load_robot

    robot = load_robot("humanoid33")
    controller, rng = WholeBodyController(robot), np.random.default_rng(0)
    commands = [controller.step(RobotState(robot.q_home, np.zeros(robot.nv)))]
    first, fallen, period, times = perf_counter() - begin, False, 1e-3, list[float]()
    controller.reset()
    try:
        from poise.sim import Plant, rollout

        plant = Plant(robot)
    except PoiseError:
        what = "1000 fixed states of humanoid33"
        for k in range(1000):
            v = 0.01 * rng.standard_normal(robot.nv)
            commands.append(controller.step(RobotState(robot.q_home, v, time=k * period)))
            times.append(sum(controller.timings.values()))
    else:
        what, period = "humanoid33 stands for 4 s under a push", plant.control_dt
        plant.push("torso", (robot.mass, 0.0, 0.0), 0.1)  # 0.1 m/s, braked within the soles
        for tick in rollout(plant, controller, duration=4.0):
            commands.append(tick.command)
            times.append(sum(controller.timings.values()))
        fallen = plant.fallen
    finite = [np.isfinite(np.array(c.torque, dtype=float)).all() for c in commands]
    bad = [
        c.status.name
        for c, good in zip(commands, finite, strict=True)
        if not (good and c.status.ok)
    ]
    status = "the robot fell" if fallen else f"{len(bad)} bad ticks, {bad[0]}" if bad else "ok"
    cuts = [1e6 * cut for cut in quantiles(times, n=100)]
    print(json.dumps([first, what, status, cuts[49], cuts[98], 1e6 * period]))
