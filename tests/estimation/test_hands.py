"""What hands hold, against wrenches that Pinocchio's inverse dynamics gives a robot with a load."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from poise import WholeBodyController, default_stack
from poise.dynamics import Dynamics, RobotState
from poise.estimation import PayloadBelief, PayloadEstimator
from poise.sim import Plant, PlantConfig, rollout

DT = 0.004


def arms(robot):
    """Joints that move a hand and not the torso, as places in q of the joints."""
    model = robot.model
    trunk = set(model.supports[model.frames[robot.frame_id(robot.torso)].parentJoint])
    above = {
        int(j)
        for hand in robot.hands
        for j in model.supports[model.frames[robot.frame_id(hand)].parentJoint]
    }
    return np.array(sorted(above - trunk), dtype=np.int64) - 2


def felt(robot, loaded, q, v, a, time, *, push=None):
    """The state of a robot whose first sole carries all that its motion takes, with a load.

    A push is a force in the world [N], and the frame at whose origin somebody pushes; at the
    robot's centre of mass for None.
    """
    data = loaded.model.createData()
    base = pin.rnea(loaded.model, data, q, v, a)[:6]
    pin.forwardKinematics(loaded.model, data, q)
    world = pin.XYZQUATToSE3(q[:7]).act(pin.Force(base[:3], base[3:]))
    if push is not None:
        force, frame = push
        place = pin.centerOfMass(robot.model, robot.model.createData(), q)
        if frame is not None:
            place = pin.updateFramePlacement(loaded.model, data, robot.frame_id(frame)).translation
        world -= pin.Force(force, np.cross(place, force))
    first, *others = robot.soles
    sole = pin.updateFramePlacement(loaded.model, data, robot.frame_id(first))
    wrench = sole.actInv(world)
    contacts = {first: np.concatenate((wrench.linear, wrench.angular))}
    contacts |= {name: np.zeros(6) for name in others}
    return RobotState(q, v, contacts, time)


def moved(robot, loaded, seconds, *, seed=0, size=0.35, push=lambda t: None):
    """States of a robot whose arms swing by sums of sines, and its torso a little."""
    rng = np.random.default_rng(seed)
    own = arms(robot)
    rates, phases = rng.uniform(1.0, 3.0, len(own)), rng.uniform(0.0, 6.28, len(own))
    q, v, a = robot.q_home.copy(), np.zeros(robot.nv), np.zeros(robot.nv)
    for time in DT * np.arange(int(seconds / DT)):
        angle = rates * time + phases
        q[7 + own] = robot.q_home[7 + own] + size * np.sin(angle)
        v[6 + own], a[6 + own] = size * rates * np.cos(angle), -size * rates**2 * np.sin(angle)
        yield felt(robot, loaded, q.copy(), v.copy(), a.copy(), time, push=push(time))


def estimated(robot, states, **belief):
    estimator = PayloadEstimator(robot, PayloadBelief(**belief))
    last = None
    for state in states:
        last = estimator.update(state)
    return estimator, last


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(
    ("name", "hand", "seed"), [("g1", 0, 1), ("g1", 1, 2), ("humanoid33", 1, 3)]
)
def test_a_load_is_found_in_the_hand_that_moves_it(get_robot, name, hand, seed):
    robot = get_robot(name)
    mass = 0.03 * robot.mass
    loaded = robot.carrying(robot.hands[hand], mass)
    estimator, state = estimated(robot, moved(robot, loaded, 6.0, seed=seed))
    assert estimator.held[hand] == pytest.approx(mass, rel=0.1)
    assert estimator.held[1 - hand] < 0.1 * mass
    assert abs(estimator.mass) < 0.15 * mass
    # So whoever computes with it has the centre of mass where it is, wherever the hand goes.
    told, true = Dynamics(robot), Dynamics(loaded)
    told.update(state)
    true.update(RobotState(state.q, state.v))
    assert np.linalg.norm((told.com - true.com)[:2]) < 1e-3
    np.testing.assert_allclose(told.h, true.h, atol=0.1 * mass * 9.81)


def test_what_the_body_is_heavier_by_is_no_hands(get_robot):
    robot = get_robot("g1")
    loaded = robot.carrying(robot.torso, 0.2 * robot.mass, (0.02, 0.0, 0.1))
    estimator, _ = estimated(robot, moved(robot, loaded, 5.0))
    assert estimator.mass == pytest.approx(0.2 * robot.mass, rel=0.03)
    assert estimator.held.max() < 0.005 * robot.mass


def test_a_hand_at_rest_tells_nothing_and_the_body_has_it(get_robot):
    robot = get_robot("g1")
    loaded = robot.carrying(robot.hands[0], 1.0)
    estimator, _ = estimated(robot, moved(robot, loaded, 5.0, size=0.0))
    np.testing.assert_array_equal(estimator.held, 0.0)
    assert estimator.mass == pytest.approx(1.0, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("leans", "bound"), [(False, 0.02), (True, 0.5)])
def test_pushes_are_no_loads_and_nothing_is_that_a_hand_leans_on(get_robot, leans, bound):
    robot = get_robot("g1")
    rng = np.random.default_rng(4)
    pushes = 0.05 * robot.weight * rng.uniform(-1.0, 1.0, (20, 3))

    def push(time):
        if time % 1.0 >= 0.5:
            return None
        force = pushes[int(time)]
        return (np.array([0.0, 0.0, abs(force[2])]), robot.hands[0]) if leans else (force, None)

    most = []
    for believed in (0.01, 1e3):
        estimator, held = PayloadEstimator(robot, PayloadBelief(push=believed)), 0.0
        for state in moved(robot, robot, 8.0, push=push):
            estimator.update(state)
            held = max(held, float(estimator.held.max()))
        most.append(held)
    # [kg]; what the hand leans on bears up to 1.7 kg.
    assert most[0] < bound
    assert most[1] > 3.0 * most[0]


@pytest.mark.parametrize("seed", range(3))
def test_whatever_soles_say_it_stays_within_bounds(get_robot, seed):
    robot = get_robot("g1")
    rng = np.random.default_rng(seed)
    estimator = PayloadEstimator(robot)
    for state in moved(robot, robot, 2.0, seed=seed):
        wrench = robot.weight * np.array([0.3, 0.3, 1.0, 0.3, 0.3, 0.3]) * rng.normal(1.0, 1.0, 6)
        if rng.uniform() < 0.01:
            wrench[rng.integers(6)] = rng.choice([np.nan, 1e9])
        held = estimator.update(
            RobotState(state.q, state.v, dict.fromkeys(robot.soles, wrench), state.time)
        ).payload
        assert np.isfinite(estimator.held).all()
        assert (estimator.held >= 0.0).all()
        assert (estimator.held <= 0.1 * robot.mass + 1e-9).all()
        assert held is None or (held.held <= 0.1 * robot.mass + 1e-9).all()


def test_a_robot_without_hands_has_none(get_robot):
    robot = replace(get_robot("biped20"), hands=())
    share = np.array([0.0, 0.0, 0.6 * robot.weight, 0.0, 0.0, 0.0])
    states = (
        RobotState(robot.q_home, np.zeros(robot.nv), dict.fromkeys(robot.soles, share), t)
        for t in DT * np.arange(1000)
    )
    estimator, state = estimated(robot, states)
    assert estimator.held.shape == state.payload.held.shape == (0,)
    assert estimator.mass == pytest.approx(0.2 * robot.mass, rel=0.1)


class Swing:
    """A leader that moves the hands to and fro."""

    def __init__(self, robot):
        self.stack = default_stack(robot)
        self.stack.bind(robot)
        home = Dynamics(robot)
        home.update(RobotState(robot.q_home, np.zeros(robot.nv)))
        self._hands = [
            (self.stack.task(f"{hand} pose"), home.placement(robot.frame_id(hand))[0].copy())
            for hand in robot.hands
        ]

    def lead(self, state):
        angle = 2.0 * max(state.time - 0.5, 0.0)
        for task, place in self._hands:
            task.set_target(place + np.array([0.15 * np.sin(angle), 0.0, 0.1 * np.sin(2 * angle)]))


@pytest.mark.slow
def test_a_plant_that_swings_a_load_has_its_com_where_it_is_told(get_robot):
    robot = get_robot("g1")
    load = PlantConfig.Payload(frame=robot.hands[1], mass=1.0)
    plant = Plant(robot, PlantConfig(control_dt=0.002, payloads=(load,)), seed=5)
    leader, told = Swing(robot), Dynamics(robot)
    controller = WholeBodyController(robot, leader.stack)
    off = []
    for tick in rollout(plant, controller, leader, estimator=PayloadEstimator(robot), duration=7.0):
        told.update(RobotState(tick.truth.q, tick.truth.v, payload=tick.estimate.payload))
        if tick.estimate.time > 4.0:
            off.append(np.linalg.norm((told.com - plant.com)[:2]))
    assert not plant.fallen
    # Taken for a load of the body it is off by 5 mm.
    assert max(off) < 1.5e-3
