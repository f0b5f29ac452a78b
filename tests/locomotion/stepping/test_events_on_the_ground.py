"""What happens between the lift of a device and the lift of its foot: states and loads made up."""

from dataclasses import replace

import numpy as np
import pytest
from standing import measured, numbers
from walker import Says, sample

from poise.locomotion import DeviceStatus, Mode, StepEnd, StepTeleoperator
from poise.robots import Sole

DT = 0.005
UP, DOWN = (0.0, -0.135, 0.05), (0.0, -0.135, 0.0)


ANYWHERE = {"capture_max": 1.0, "ct_zmp_max": 1.0, "shift_time": 1e-9}
"""The COM need not be above the left foot to lift the right one."""


class Bench:
    """A teleoperator that is fed ticks by hand, of a robot whose soles are too wide to tip over."""

    def __init__(self, robot, *, width=0.5, **changes):
        wide = {name: Sole(name=name, length=0.5, width=width) for name in robot.soles}
        self.robot = robot = replace(robot, soles=wide)
        self.teleoperator = StepTeleoperator(
            robot, actuation="velocity", _numbers=ANYWHERE | changes
        )
        self.controller = self.teleoperator.controller()
        self._ticks = 0
        for _ in range(3):
            self.tick(DOWN, 320.0, 320.0)

    def tick(self, right, *loads):
        time = self._ticks * DT
        self._ticks += 1
        self.teleoperator.device = Says(None if right is None else sample(time, right=right))
        estimate = self.teleoperator.estimator.update(measured(self.robot, *loads, time))
        self.teleoperator.lead(estimate)
        assert self.controller.step(estimate).status.ok
        return self.teleoperator.mode

    @property
    def ended(self):
        return self.teleoperator.status.ended

    def lift(self):
        """To the mode on the left foot, with 30 N left on the right one."""
        assert self.tick(UP, 320.0, 320.0) is Mode.TL
        for _ in range(100):
            if self.tick(UP, 610.0, 30.0) is Mode.SL:
                return
        raise AssertionError("the weight was not taken to have shifted")


def test_a_device_lowered_while_the_foot_is_still_on_the_ground_gives_both_feet_back(get_robot):
    bench = Bench(get_robot("biped20"))
    assert bench.ended is None
    bench.lift()
    assert bench.ended is None
    assert bench.tick(DOWN, 610.0, 30.0) is Mode.D
    assert bench.ended is StepEnd.LOWERED


def test_a_device_lowered_after_the_foot_has_left_waits_for_the_ground(get_robot):
    bench = Bench(get_robot("biped20"))
    bench.lift()
    for _ in range(10):
        bench.tick(UP, 640.0, 0.0)
    assert bench.tick(DOWN, 640.0, 0.0) is Mode.SL
    assert bench.ended is None
    assert bench.tick(DOWN, 610.0, 40.0) is Mode.D
    assert bench.ended is StepEnd.LANDED
    # Until the next one begins.
    assert bench.tick(DOWN, 320.0, 320.0) is Mode.D
    assert bench.ended is StepEnd.LANDED
    bench.lift()
    assert bench.ended is None


def test_a_foot_that_goes_on_carrying_is_given_back(get_robot):
    bench = Bench(get_robot("biped20"))
    bench.lift()
    modes = [bench.tick(UP, 600.0, 40.0) for _ in range(100)]
    assert DT * modes.index(Mode.D) == pytest.approx(0.3, abs=2 * DT)
    assert bench.ended is StepEnd.STUCK


def test_a_shift_that_takes_too_long_says_so(get_robot):
    bench = Bench(get_robot("biped20"))
    modes = [bench.tick(UP, 320.0, 320.0) for _ in range(610)]
    assert modes[0] is Mode.TL
    assert DT * modes.index(Mode.D) == pytest.approx(3.0, abs=2 * DT)
    assert bench.ended is StepEnd.LATE
    assert bench.teleoperator.signals()["step_end"] == "LATE"


def test_a_device_that_is_lost_gives_both_feet_back_and_says_so(get_robot):
    bench = Bench(get_robot("biped20"))
    assert bench.tick(UP, 320.0, 320.0) is Mode.TL
    modes = [bench.tick(None, 320.0, 320.0) for _ in range(120)]
    assert DT * modes.index(Mode.D) == pytest.approx(0.5, abs=2 * DT)
    assert bench.ended is StepEnd.LOST


def test_a_device_that_is_lost_alone_gives_its_foot_back_and_says_so(get_robot):
    bench = Bench(get_robot("biped20"))
    assert bench.tick(UP, 320.0, 320.0) is Mode.TL
    modes = [bench.tick((np.nan, 0.0, 0.0), 320.0, 320.0) for _ in range(120)]
    assert DT * modes.index(Mode.D) == pytest.approx(0.5, abs=2 * DT)
    assert bench.ended is StepEnd.LOST
    assert bench.teleoperator.status.device is DeviceStatus.WAITING


def test_a_foot_that_is_put_down_so_that_nobody_falls_says_so(get_robot):
    """The DCM is between the feet, and beyond the sole that carries alone."""
    bench = Bench(get_robot("biped20"), width=0.16)
    bench.lift()
    assert bench.tick(UP, 610.0, 30.0) is Mode.D
    assert bench.ended is StepEnd.RESCUED


def test_the_com_has_to_be_above_the_foot_that_shall_carry_not_the_zmp_alone(get_robot):
    robot = get_robot("biped20")
    bench = Bench(robot, **{name: getattr(numbers(robot), name) for name in ANYWHERE})
    assert bench.tick(UP, 320.0, 320.0) is Mode.TL
    for _ in range(100):
        assert bench.tick(UP, 610.0, 30.0) is Mode.TL


def test_what_a_lift_needs_must_hold_for_a_while(get_robot):
    times = {}
    for shift_time in (0.01, 0.06):
        bench = Bench(get_robot("biped20"), shift_time=shift_time)
        bench.tick(UP, 320.0, 320.0)
        modes = [bench.tick(UP, 610.0, 30.0) for _ in range(100)]
        times[shift_time] = DT * modes.index(Mode.SL)
    assert times[0.06] - times[0.01] == pytest.approx(0.05, abs=1.5 * DT)


def test_a_foot_in_the_air_is_not_pushed_below_where_it_is_before_it_has_left(get_robot):
    bench = Bench(get_robot("biped20"))
    bench.lift()
    low = (0.0, -0.135, 0.012)
    bench.tick(low, 610.0, 30.0)
    status = bench.teleoperator.status
    assert bench.teleoperator.mode is Mode.SL
    assert status.target[2] >= status.soles[1][2]
