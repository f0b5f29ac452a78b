"""A G1 behind its link: the edge of a delayed loop, the noise of velocities, and a short sweep."""

import numpy as np
import pytest
from unchecked import run_unchecked

from poise.hardware import MotorCommand
from poise.sim import Linkage, Motor, MotorConfig, Plant

for package in ("matplotlib", "mujoco"):
    pytest.importorskip(package)

from poise.apps.deployment import g1_gains  # noqa: E402
from studies.g1_link._bus import Bus, g1_plant  # noqa: E402
from studies.g1_link._standing import LOOP, above_lowest, velocity_noise  # noqa: E402
from studies.g1_link._vibration import EDGE  # noqa: E402
from studies.g1_link._wire import checksum  # noqa: E402


@pytest.mark.parametrize(("factor", "grows"), [(0.97, False), (1.03, True)])
def test_a_delayed_loop_oscillates_beyond_the_edge(factor, grows):
    delay, dt = 0.01, 2e-5
    kd = factor * EDGE / delay
    x, v, late = 1.0, 0.0, [0.0] * round(delay / dt)
    peaks = [0.0, 0.0]
    for k in range(50_000):
        late.append(-(kd * v + 0.25 * kd**2 * x))
        v += dt * late[k]
        x += dt * v
        if k >= 40_000:
            peaks[1] = max(peaks[1], abs(x))
        elif 10_000 <= k < 20_000:
            peaks[0] = max(peaks[0], abs(x))
    assert (peaks[1] > peaks[0]) == grows


def test_the_noise_of_velocities_is_that_of_rounded_positions(get_robot):
    robot = get_robot("g1")
    pair = ("left_ankle_pitch_joint", "left_ankle_roll_joint")
    config = MotorConfig(
        motors=(Motor(joints=".*", gear=10.0, resolution=0.01),),
        linkages=(Linkage(joints=pair, rates=((1, 1), (1, -1))),),
        velocity_bandwidth=300.0,
    )
    # A joint that moves by many steps in a period, at a pace that is no multiple of them.
    moved = np.cumsum(np.full(200_000, 0.0137) + 1e-3 * np.sin(np.arange(200_000)))
    errors = 1e-3 * np.round(moved / 1e-3) - moved
    keep, filtered, found = np.exp(-2.0 * np.pi * 300.0 * LOOP), 0.0, []
    for change in np.diff(errors):
        filtered = keep * filtered + (1.0 - keep) * change / LOOP
        found.append(filtered)
    noise = velocity_noise(robot, config)
    knee, ankle = (robot.joint_names.index(name) for name in ("left_knee_joint", pair[0]))
    assert noise[knee] == pytest.approx(np.std(found), rel=0.03)
    assert noise[ankle] == pytest.approx(noise[knee] / np.sqrt(2.0))


def test_vibration_is_what_is_above_the_lowest_frequency():
    times = 0.002 * np.arange(1250)
    slow_part, fast = np.sin(2.0 * np.pi * 3.0 * times), 0.1 * np.sin(2.0 * np.pi * 40.0 * times)
    samples = list(np.stack([slow_part, slow_part + fast], axis=1))
    np.testing.assert_allclose(above_lowest(samples), [0.0, 0.1 / np.sqrt(2.0)], atol=1e-6)


RUN = """
import json
from studies.g1_link._vibration import run

print(json.dumps([[f.name, f.ok] for f in run(quick=True).findings]))
"""


@pytest.mark.slow
def test_a_short_sweep_has_the_edge_where_the_loop_has_it(get_robot):
    get_robot("g1")
    assert all(ok for _, ok in run_unchecked(RUN))


def test_the_checksum_is_that_of_published_words():
    # CRC-32/MPEG-2 of "1234" and "5678" as big-endian words, whose catalogue value is of
    # "123456789"; computed byte by byte here.
    remainder = 0xFFFFFFFF
    for byte in b"12345678":
        remainder ^= byte << 24
        for _ in range(8):
            top, remainder = remainder >> 31, (remainder << 1) & 0xFFFFFFFF
            remainder ^= 0x04C11DB7 if top else 0
    words = [int.from_bytes(part, "big") for part in (b"1234", b"5678")]
    assert checksum(words) == remainder


@pytest.fixture
def bus(get_robot):
    robot = get_robot("g1")
    return Bus(Plant(robot, g1_plant(ideal=True)), g1_gains(robot).check)


@pytest.mark.parametrize(
    ("field", "share"), [("tau", 1.0), ("tau", 1.01), ("tau", np.nan), ("kp", 1.01), ("kd", 1.01)]
)
def test_a_bus_counts_what_its_last_check_lets_through(bus, monkeypatch, field, share):
    check = bus.check
    limits = {"tau": check.tau_max, "kp": check.kp_max, "kd": check.kd_max}
    zero = np.zeros(len(check.joints))
    values = dict.fromkeys(("q", "dq", "kp", "kd", "tau"), zero) | {field: share * limits[field]}
    values["q"] = 0.5 * (check.lower + check.upper)
    monkeypatch.setattr(bus.check, "check", lambda command, state: command)
    bus.write(MotorCommand(**values))
    assert bus.wrong == (share != 1.0)


def test_states_of_a_bus_are_float32_one_period_late(bus):
    first = bus.read()
    bus.write(bus.check.damping)
    assert bus.read() is first
    assert bus.missed == 1
    bus.write(bus.check.damping)
    second = bus.read()
    assert second.time == second.arrived == pytest.approx(0.004)
    assert np.array_equal(second.q, np.float64(np.float32(second.q)))


FAULTS = """
print(json.dumps([
    [found.action, found.wrong, found.finite]
    for kind in ("NaN", "stop", "unsolved")
    for found in [run_fault(Fault(kind=kind, seed=0))]
]))
"""


@pytest.mark.slow
def test_faults_that_have_to_be_damped_are(get_robot):
    get_robot("g1")
    code = "import json\nfrom studies.g1_link._faults import Fault, run_fault\n" + FAULTS
    assert run_unchecked(code) == [["DAMP", 0, True]] * 3


PREFLIGHT = """
import json
from studies.g1_link._preflight import preflight_section
from studies.plan import StudyOptions
found = preflight_section(StudyOptions(quick=True), lambda done, total: None).findings
print(json.dumps([[f.name, f.ours] for f in found]))
"""


@pytest.mark.slow
def test_all_mistakes_are_found_by_the_preflight(get_robot):
    get_robot("g1")
    assert [ours for _, ours in run_unchecked(PREFLIGHT)] == [0, 0]
