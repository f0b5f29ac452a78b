"""A robot that stands without a simulator: states, loads and footings that the tests make up."""

from dataclasses import replace
from functools import cache

import numpy as np

from poise.dynamics import RobotState
from poise.locomotion import Mode, TeleopParameters
from poise.locomotion._stepping._feet import FootDevices
from poise.locomotion._stepping._stance._biped import FootRange, biped_of
from poise.locomotion._stepping._stance._estimator import StanceEstimator, ZmpSensor
from poise.locomotion._stepping._stance._footing import Footing
from poise.locomotion._stepping._stance._parameters import size_of
from poise.locomotion._stepping._velocity_tasks import velocity_numbers
from poise.locomotion._support import SingleSupportRegion

PARAMETERS = TeleopParameters()
ZMP_TIME = 0.01


@cache
def biped(robot):
    return biped_of(robot, size_of(robot, robot.q_home))


def numbers(robot):
    """Numbers of the velocity level."""
    return velocity_numbers(biped(robot).size)


def estimator(robot):
    return StanceEstimator(robot, biped(robot).soles, robot.q_home)


def sensor(robot, left, right):
    """Soles that carry so much [N]."""
    sensor = ZmpSensor(biped(robot).weight, ZMP_TIME, PARAMETERS.dt)
    sensor.loads[:] = left, right
    return sensor


def footing(robot, mode=Mode.SL, lifted=0.0, com_velocity=(0.0, 0.0), at=(0.0, 0.0), loaded=None):
    """Standing at home, with the ground below the right foot so far down as if it were lifted.

    Home may be moved along the ground.

    The stance is the left foot. The soles say nothing of centres of pressure unless `loaded` does.
    """
    ours = estimator(robot)
    ours.stand_on(0)
    v = np.zeros(robot.nv)
    v[:2] = com_velocity
    q = robot.q_home.copy()
    q[:2] += at
    ours.dynamics.update(RobotState(q, v))
    for anchor in ours.anchors:
        anchor += [*at, -lifted]
    height = float(ours.dynamics.com[2])
    return Footing(
        biped=biped(robot),
        mode=mode,
        stance=0,
        estimator=ours,
        omega=float(np.sqrt(9.81 / height)),
        region=SingleSupportRegion(
            sizes=biped(robot).sizes,
            margin=biped(robot).size.margin,
            arrived=numbers(robot).capture_max,
        ),
        sensor=loaded if loaded is not None else sensor(robot, 320.0, 320.0),
    )


def measured(robot, left, right, time):
    """A state at home with loads on the soles, each at the sole's centre [N]."""
    wrenches = {
        name: np.array([0.0, 0.0, load, 0.0, 0.0, 0.0])
        for name, load in zip(biped(robot).soles, (left, right), strict=True)
    }
    return RobotState(robot.q_home, np.zeros(robot.nv), wrenches, time)


def steady(robot, **changes):
    """A footing whose divergent component is at the centre of the sole that carries."""
    now = footing(robot, **changes)
    way = now.anchors[0][:2] - now.dynamics.com[:2]
    return footing(robot, **changes, com_velocity=tuple((way * now.omega).tolist()))


def devices(robot, **changes):
    """Two foot devices, by parameters with changes."""
    parameters = replace(PARAMETERS, **changes)
    return FootDevices(FootRange(biped(robot), parameters, servos=True), parameters)


def aimed(ours, now, command, *, room_below=0.0, falling=False):
    """Place to which foot devices send the foot in a tick [m]."""
    ours.update(command, (True, True), now)
    ours.room_below, ours.falling = room_below, falling
    return ours.aim()


def towards(ours, now, target, rate=(0.0, 0.0, 0.0), *, hurry=False):
    """Velocity of a foot in a tick that is sent to a place [m/s]."""
    ours.update(None, (True, True), now)
    ours.sent, ours.rate, ours.rescuing = target, rate, hurry
    return ours.velocity()
