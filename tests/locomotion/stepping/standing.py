"""A robot that stands without a simulator: states, loads and footings that the tests make up."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np

from poise.dynamics import RobotState
from poise.locomotion import Mode, TeleopParameters
from poise.locomotion._stepping._feet import FootDevices
from poise.locomotion._stepping._stance._estimator import StanceEstimator
from poise.locomotion._stepping._stance._footing import Footing
from poise.locomotion._stepping._stance._parameters import biped_of
from poise.locomotion._stepping._velocity_tasks import velocity_numbers
from poise.locomotion._support import SingleSupportRegion

PARAMETERS = TeleopParameters()


@cache
def biped(robot):
    return biped_of(robot, robot.q_home)


def foot_range(robot, parameters=PARAMETERS):
    return biped(robot).foot_range(parameters, servos=True)


def numbers(robot):
    """Numbers of the velocity level."""
    return velocity_numbers(biped(robot))


def estimator(robot):
    return StanceEstimator(biped(robot), robot.q_home, PARAMETERS.dt)


def sensed(left, right):
    """Measurements of soles that carry so much [N]."""
    return SimpleNamespace(
        loads=np.array([left, right]),
        centres=[None, None],
        wrenches=[None, None],
        zmp=np.zeros(2),
    )


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
    now = Footing(
        biped=biped(robot),
        mode=mode,
        estimator=ours,
        omega=float(np.sqrt(9.81 / height)),
        region=SingleSupportRegion(
            sizes=biped(robot).sizes,
            margin=biped(robot).margin,
            arrived=numbers(robot).capture_max,
        ),
    )
    now.sense = sensed(320.0, 320.0) if loaded is None else loaded
    return now


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
    return FootDevices(foot_range(robot, parameters), parameters)


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
