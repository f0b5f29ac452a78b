"""A link in a process of its own, and the end of the one or the other."""

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from functools import partial

import links
import numpy as np
import processes
import pytest
from unchecked import run_unchecked

from poise.errors import ConfigurationError, RobotError
from poise.hardware import LinkStatus, MotorCommand, ProcessLink

SPAWN = multiprocessing.get_context("spawn")


def wait_for(condition, seconds=5.0):
    """True once the condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.001)
    return True


def real_time():
    """A priority above whatever else a busy machine does; None where that is not permitted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except (AttributeError, OSError):
        return None
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return 80


@pytest.fixture(scope="module")
def shared():
    """A link for tests that leave it as it was."""
    made = ProcessLink(processes.Leg, links.make_check(), linger=0.0)
    yield made
    made.close()


@pytest.fixture
def link():
    """A link for tests that end it."""
    made = ProcessLink(processes.Leg, links.make_check(), linger=0.0)
    yield made
    made.close()


def write_until(link, command, condition, seconds=5.0):
    """Write a command in each tick until the condition holds."""

    def tick():
        link.write(command)
        return condition()

    return wait_for(tick, seconds)


def test_commands_reach_the_robot_and_states_come_back(shared):
    assert shared.info.joints == links.JOINTS
    target = links.command(tau=np.array([1.0, 0.0, 0.0]))
    assert write_until(shared, target, lambda: shared.status is LinkStatus.OK)
    assert write_until(shared, target, lambda: shared.read().q[0] > 0.02)
    state = shared.read()
    assert abs(shared.clock() - state.arrived) < 1.0
    assert state.acceleration.tolist() == [0.0, 0.0, 9.81]
    assert wait_for(lambda: shared.read().time > state.time)


def test_nothing_is_sent_before_the_first_command(tmp_path):
    log = tmp_path / "log"
    link = ProcessLink(partial(processes.Leg, log=log), links.make_check(), linger=0.0)
    try:
        time.sleep(0.05)
        assert link.status is LinkStatus.IDLE
        assert len(processes.commands_of(log)) == 0
    finally:
        link.close()
    assert len(processes.commands_of(log)) == 0


def test_it_damps_between_commands(shared):
    write_until(shared, links.command(), lambda: shared.status is LinkStatus.OK)
    assert shared.status is LinkStatus.OK
    assert wait_for(lambda: shared.status is LinkStatus.DAMPING)


@pytest.mark.parametrize(
    "bad",
    [
        links.command(tau=np.array([np.nan, 0.0, 0.0])),
        links.command(tau=np.array([101.0, 0.0, 0.0])),
        MotorCommand.damping(np.ones(2)),
    ],
    ids=["nan", "torque", "joints"],
)
def test_a_command_that_fails_the_last_check_is_a_status(shared, bad):
    before = shared.refused
    assert write_until(shared, bad, lambda: shared.refused > before)
    assert write_until(shared, bad, lambda: shared.status is LinkStatus.REFUSED)
    assert "wanted" in shared.reason


def test_a_process_of_a_link_that_is_killed_is_a_status(link):
    assert write_until(link, links.command(), lambda: link.read().time > 0.0)
    os.kill(link.pid, signal.SIGKILL)
    assert wait_for(lambda: link.status is LinkStatus.LOST)
    last = link.read()
    link.write(links.command())
    assert link.read().time == last.time
    assert "-9" in link.reason


def test_a_link_that_raises_is_a_status():
    link = ProcessLink(partial(processes.Leg, fails_at=0.1), links.make_check(), linger=0.0)
    assert wait_for(lambda: link.status is LinkStatus.LOST)
    assert link.reason == "OSError: the cable is out"
    link.close()


def broken():
    raise OSError("no such interface: eth7")


def test_a_link_that_cannot_be_made_is_one_clear_error():
    with pytest.raises(RobotError, match="no such interface: eth7"):
        ProcessLink(broken, links.make_check())
    with pytest.raises(RobotError, match="did not start"):
        ProcessLink(processes.Leg, links.make_check(), priority=100)
    with pytest.raises(ConfigurationError, match="other joints"):
        ProcessLink(partial(processes.Leg, joints=("a", "b")), links.make_check())


def run_and_end(controller, near, log, how, far_enough):
    """Lines of the log before the controller's end, and those from 20 ms after it on."""
    controller.start()
    pid = near.recv()
    try:
        assert wait_for(lambda: far_enough(processes.commands_of(log)))
        end = time.monotonic()
        os.kill(controller.pid, how)
        assert wait_for(lambda: processes.commands_of(log)[-1, 0] > end + 0.6)
    finally:
        controller.kill()
        controller.join()
    assert wait_for(lambda: not alive(pid)), "the process of the link does not end"
    lines = processes.commands_of(log)
    # Without a priority another process may delay the link's.
    late = 0.02 if real_time() else 0.5
    return lines[lines[:, 0] < end], lines[lines[:, 0] > end + late]


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["kill -9", "stop"])
def test_without_its_controller_a_moving_robot_is_damped_within_20_ms(tmp_path, how):
    log, (near, far) = tmp_path / "log", SPAWN.Pipe(duplex=False)
    arguments = (partial(processes.Leg, log=log), links.make_check(), far, real_time())
    controller = SPAWN.Process(target=processes.swing, args=arguments)

    def is_fast(lines):  # 0.05 of its largest speed
        return len(lines) > 250 and lines[-1, 3] > 0.05

    before, after = run_and_end(controller, near, log, how, is_fast)
    assert np.median(before[-50:, 1]) == 20.0
    assert after[:, 1].max() == 0.0
    assert len(after) > 50
    for lines in (before, after):
        assert lines[:, 2].max() <= 1.0
        assert np.isfinite(lines).all()
    assert np.all(np.diff(after[:, 3]) < 0.0)


@pytest.mark.slow
def test_a_humanoid_whose_controller_is_killed_as_it_sways_is_damped_within_20_ms(tmp_path):
    pytest.importorskip("mujoco")
    log, (near, far) = tmp_path / "log", SPAWN.Pipe(duplex=False)
    controller = SPAWN.Process(target=processes.sway, args=("biped20", log, far, real_time()))
    log.touch()
    before, after = run_and_end(
        controller, near, log, signal.SIGKILL, lambda lines: len(lines) > 1000
    )
    assert np.median(before[-100:, 1]) == 20.0
    assert after[:, 1].max() == 0.0
    assert len(after) > 100
    for lines in (before, after):
        assert lines[:, 2].max() <= 1.0
        assert np.isfinite(lines).all()


def test_a_lost_terminal_leaves_the_process_of_the_link_alone(shared):
    assert os.getsid(shared.pid) == shared.pid


def test_ctrl_c_leaves_the_process_of_the_link_alone(shared):
    write_until(shared, links.command(), lambda: shared.status is LinkStatus.OK)
    os.kill(shared.pid, signal.SIGINT)
    time.sleep(0.05)
    before = shared.read().time
    assert wait_for(lambda: shared.read().time > before)
    assert wait_for(lambda: shared.status is LinkStatus.DAMPING)


def test_nothing_is_sent_after_close(link):
    link.close()
    assert link.status is LinkStatus.LOST
    assert link.pid is None
    link.write(links.command())
    link.close()


def test_the_process_of_a_link_imports_no_robot_and_no_simulator():
    code = "import json, sys, poise.hardware._server; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert not {"pinocchio", "mujoco", "numba"} & set(json.loads(done.stdout))


NO_COMMANDS = """
import json
import links, processes
from poise.hardware import ProcessLink

check, damped = links.make_check(), []
link = ProcessLink(processes.Leg, links.make_check(), linger=0.0)
for bad in (None, "text", 3, links.command(tau="text"), links.command(kp=[[1.0], [2.0, 3.0]])):
    link.write(bad)
    damped.append(check.check(bad, links.state()) is check.damping)
link.close()
print(json.dumps(damped))
"""
"""Run without the tests' type checking, which would answer first."""


def test_nothing_raises_for_what_is_no_command():
    assert run_unchecked(NO_COMMANDS) == [True] * 5
