"""A `FootMotion` that a user writes: a policy that lifts feet and puts them down at random."""

import numpy as np
import pytest

import poise
from poise.locomotion import VelocityLimits, WalkSettings, walking_stack
from poise.locomotion._walking._engine import SteppingEngine
from poise.locomotion._walking._footsteps import level_floor, stand_of, usual_gait
from poise.locomotion._walking._modes import StepEnd
from poise.locomotion._walking._parts import make_parts

sim = pytest.importorskip("poise.sim")


class RandomFeet:
    """Lift a foot, hold it at a random place within 5 cm for a random time, and put it down."""

    def __init__(self, seed):
        self._rng, self._ends = np.random.default_rng(seed), []

    @property
    def landings(self):
        return self._ends.count(StepEnd.LANDED)

    def lifted(self):
        return int(self._rng.integers(2)) if self._rng.random() < 0.005 else None

    def end_of_shift(self, foot, since):
        return StepEnd.LATE if since > 3.0 else None

    def take_off(self, foot):
        self._time, self._ends = 0.0, [*self._ends, None]
        self._holds = self._rng.uniform(0.3, 1.0)
        self._aside, self._start = self._rng.uniform(-0.05, 0.05, 2) / np.sqrt(2.0), None

    def end_of_swing(self, foot, load):
        if self._time > 0.6 and load > 0.05:
            self._ends[-1] = StepEnd.LANDED
        return self._ends[-1]

    def move(self, flight, dt):
        if self._start is None:
            self._start, self._up = flight.position.copy(), 0.0
        self._time += dt
        falls = self._time > 0.6 + self._holds
        rate = -0.1 if falls else (0.1 if self._time < 0.4 else 0.0)
        self._up += rate * dt
        ratio = min(max((self._time - 0.2) / 0.4, 0.0), 1.0)
        place = self._start + np.array([*(ratio * self._aside), self._up])
        across = self._aside / 0.4 if 0.0 < ratio < 1.0 else np.zeros(2)
        flight.move(place, np.array([*across, rate]), np.eye(3), 0.0)


def held_by(motion, robot, stack):
    """Return an engine whose feet a motion holds."""
    stand = stand_of(robot, None)
    gait, floor = usual_gait(stand.com[2] - stand.middle[2]), level_floor(stand.start)
    settings, limits = WalkSettings(), VelocityLimits()
    stack.bind(robot)
    engine = SteppingEngine(
        stack, lambda: make_parts(robot, stack, stand, gait, settings, limits, floor, None)
    )
    engine.commands.closes = False
    engine.hold(motion)
    return engine


@pytest.mark.parametrize(("name", "seed"), [("humanoid33", 0), ("g1", 1)])
def test_a_random_policy_holds_feet_and_nobody_falls(get_robot, name, seed):
    robot, motion = get_robot(name), RandomFeet(seed)
    stack = walking_stack(robot)
    engine = held_by(motion, robot, stack)
    plant = sim.Plant(robot, sim.PlantConfig(control_dt=0.002))
    controller, held, highest = poise.WholeBodyController(robot, stack), 0, 0.0
    for tick in poise.rollout(plant, controller, engine.lead, duration=6.0):
        assert tick.command.status.ok
        assert not plant.fallen
        steps = engine.steps
        if steps.held and engine.mode.single:
            held += 1
            sole = engine.parts.sense.sole(steps.foot)[0]
            highest = max(highest, float(sole[2]))
    assert not engine.overrules
    assert engine.steps.steps_made >= 2
    # The policy's own, and not capture steps.
    assert motion.landings >= 2
    assert 0.002 * held > 1.0
    assert 0.03 < highest < 0.06
