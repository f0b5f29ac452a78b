import gc
import itertools
import time
from types import SimpleNamespace

import numpy as np
import pytest
from small_biped import torque

from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.locomotion import StepTeleoperator
from poise.sim import Plant, PlantConfig, Recorder, _rollout, rollout
from poise.sim._rollout import garbage_frozen
from poise.stack import Stack


class Limp:
    """Commands no torque, and keeps what it was given."""

    def __init__(self, robot):
        self.robot, self.given = robot, []

    def step(self, state):
        self.given.append(state)
        return torque(np.zeros(self.robot.nj))


class Diary:
    """An observer that writes down what it is told."""

    def __init__(self, name="", log=None, fails_at=None):
        self.name, self.log = name, [] if log is None else log
        self.fails_at, self.ticks = fails_at, []

    def begin(self, plant, controller, leader):
        self.log.append(f"begin {self.name}".strip())
        if self.fails_at == "begin":
            raise RuntimeError("begin")

    def observe(self, tick):
        self.ticks.append(tick)
        if self.fails_at == tick.index:
            raise RuntimeError("observe")

    def end(self):
        self.log.append(f"end {self.name}".strip())


@pytest.fixture
def plant(biped):
    return Plant(biped, PlantConfig())


def test_a_tick_is_what_was_measured_commanded_and_then_was(plant):
    controller = Limp(plant.robot)
    first = plant.state()
    ticks = []
    for tick in rollout(plant, controller, duration=0.01):
        assert tick.truth.time == plant.time
        np.testing.assert_array_equal(tick.truth.q, plant.true_state().q)
        ticks.append(tick)
    assert [t.index for t in ticks] == list(range(10))
    np.testing.assert_allclose([t.time for t in ticks], 1e-3 * np.arange(10), rtol=0, atol=1e-12)
    assert ticks[0].state is first
    assert all(t.estimate is t.state for t in ticks)
    assert [id(t.state) for t in ticks] == [id(s) for s in controller.given]
    for now, after in itertools.pairwise(ticks):
        np.testing.assert_array_equal(now.truth.v, after.state.v)
        for sole, wrench in now.truth.contacts.items():
            np.testing.assert_array_equal(wrench, after.state.contacts[sole])
    assert all(t.leader_seconds >= 0.0 and t.controller_seconds > 0.0 for t in ticks)


def test_it_gives_what_the_loop_written_by_hand_gives(biped):
    by_hand, plant = Plant(biped, PlantConfig()), Plant(biped, PlantConfig())
    controller = Limp(biped)
    while by_hand.time < 0.05 - 1e-9:
        by_hand.step(controller.step(by_hand.state()))
    for _ in rollout(plant, controller, duration=0.05):
        pass
    assert plant.time == by_hand.time
    np.testing.assert_array_equal(plant.data.qpos, by_hand.data.qpos)


@pytest.mark.parametrize(
    ("duration", "ticks"), [(0.0, 0), (1e-4, 0), (0.0096, 10), (0.0104, 10), (0.07 * 3, 210)]
)
def test_a_duration_is_taken_to_the_nearest_tick(plant, duration, ticks):
    assert len(list(rollout(plant, Limp(plant.robot), duration=duration))) == ticks


@pytest.mark.parametrize("duration", [-1.0, float("nan")])
def test_a_wrong_duration_is_said_where_it_is_given(plant, duration):
    with pytest.raises(ConfigurationError, match="duration"):
        rollout(plant, Limp(plant.robot), duration=duration)


def test_it_ends_when_the_robot_has_fallen(plant):
    ticks = list(rollout(plant, Limp(plant.robot)))
    assert plant.fallen
    assert 0.1 < ticks[-1].time < 10.0
    assert list(rollout(plant, Limp(plant.robot))) == []


def test_it_ends_when_the_simulation_diverged(plant):
    diary = Diary()
    for tick in rollout(plant, Limp(plant.robot), observers=[diary], duration=1.0):
        if tick.index == 3:
            plant.data.qvel[:] = np.nan
    assert plant.diverged
    assert (len(diary.ticks), diary.log) == (5, ["begin", "end"])


def test_an_estimate_goes_to_leader_and_controller(plant):
    controller, led = Limp(plant.robot), []

    def later(state):
        return RobotState(q=state.q, v=state.v, contacts=state.contacts, time=state.time + 1.0)

    for tick in rollout(plant, controller, led.append, estimator=later, duration=0.003):
        assert tick.estimate is controller.given[-1] is led[-1]
        assert tick.estimate.time == tick.state.time + 1.0
    assert len(led) == 3


def test_leader_and_estimator_may_be_objects(plant):
    order = []
    leader = SimpleNamespace(stack=Stack(), lead=lambda state: order.append("lead"))
    estimator = SimpleNamespace(update=lambda state: order.append("estimate") or state)
    list(rollout(plant, Limp(plant.robot), leader, estimator=estimator, duration=0.002))
    assert order == ["estimate", "lead"] * 2


def test_an_estimator_that_asks_for_it_is_told_what_was_commanded_and_when(plant):
    told = []
    estimator = SimpleNamespace(
        update=lambda state: state, command=lambda *command: told.append(command)
    )
    ticks = list(rollout(plant, Limp(plant.robot), estimator=estimator, duration=0.004))
    assert len(told) > 1
    assert told == [(tick.command.acceleration, tick.time) for tick in ticks]


def test_observers_end_in_reverse_order_when_nobody_asks_for_more(plant):
    log = []
    observers = [Diary("a", log), Diary("b", log)]
    for _ in rollout(plant, Limp(plant.robot), observers=observers):
        break
    gc.collect()
    assert log == ["begin a", "begin b", "end b", "end a"]


@pytest.mark.parametrize("who", ["leader", "controller", "observer", "begin", "consumer", "end"])
def test_observers_end_whatever_goes_wrong(plant, who):
    log = []

    def breaks(*_):
        raise RuntimeError(who)

    controller = SimpleNamespace(step=breaks) if who == "controller" else Limp(plant.robot)
    bad = Diary("bad", log, {"observer": 0, "begin": "begin"}.get(who))
    if who == "end":
        bad.end = breaks
    observers = [Diary("a", log), bad]
    ticks = rollout(
        plant, controller, breaks if who == "leader" else None, observers, duration=0.002
    )

    def consume():
        for _ in ticks:
            if who == "consumer":
                ticks.throw(RuntimeError("consumer"))

    with pytest.raises(RuntimeError, match=who.replace("observer", "observe")):
        consume()
    assert log[0] == "begin a"
    assert log[-1] == "end a"
    assert log.count("end bad") == (who not in ("begin", "end"))


def collection_ms():
    """Processor time of the shortest of some full collections."""
    found = []
    for _ in range(2):
        begin = time.thread_time()
        gc.collect()
        found.append(1e3 * (time.thread_time() - begin))
    return min(found)


@pytest.fixture
def thawed(monkeypatch):
    """Garbage is as it is for users, who froze none; in other tests it stays frozen."""
    monkeypatch.setattr(_rollout, "garbage_frozen", garbage_frozen)
    gc.unfreeze()
    yield
    gc.freeze()


@pytest.fixture
def uncollected(monkeypatch):
    """No collection goes through all that other tests have made: half a second each."""
    monkeypatch.setattr(gc, "collect", lambda: 0)


@pytest.fixture
def crowd():
    """Many live objects, as robots, solvers and packages are."""
    objects = [{"number": [i]} for i in range(100_000)]
    yield objects
    assert gc.get_freeze_count() == 0


@pytest.mark.usefixtures("thawed")
def test_no_collection_inside_a_loop_takes_a_millisecond(plant, crowd):
    outside = collection_ms()
    ticks = rollout(plant, Limp(plant.robot), observers=[Recorder()], duration=0.05)
    for tick in ticks:
        if tick.index % 20 == 19:
            assert collection_ms() < min(1.0, 0.2 * outside)


@pytest.mark.parametrize("end", ["drop", "controller", "throw"])
@pytest.mark.usefixtures("thawed", "uncollected")
def test_garbage_is_thawed_however_the_loop_ends(plant, end):
    class Broken:
        def step(self, state):
            if end == "controller" and state.time > 0.0015:
                raise RuntimeError("controller")
            return torque(np.zeros(plant.robot.nj))

    ticks = rollout(plant, Broken(), duration=0.005)
    assert gc.get_freeze_count() == 0
    next(ticks)
    assert gc.get_freeze_count() > 0
    if end == "controller":
        with pytest.raises(RuntimeError):
            list(ticks)
    elif end == "throw":
        with pytest.raises(KeyError):
            ticks.throw(KeyError())
    del ticks
    assert gc.get_freeze_count() == 0


def test_a_leader_of_another_period_is_refused_before_anything_moves(get_robot):
    robot = get_robot("biped20")
    teleoperator = StepTeleoperator(robot, actuation="velocity")
    plant = Plant(robot, PlantConfig(actuation="velocity"))
    with pytest.raises(ConfigurationError, match="0.005 s and 0.001 s"):
        rollout(plant, teleoperator.controller(), teleoperator)
    assert plant.time == 0.0
