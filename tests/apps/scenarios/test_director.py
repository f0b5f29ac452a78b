"""What the director tells tasks and contacts, on a robot that stands still."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from poise.apps.scenarios import Scenario
from poise.apps.scenarios._director import TOUCHDOWN_PATIENCE, Director
from poise.apps.scenarios._scenario import ContactChange, TargetMotion
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError, UnknownNameError
from poise.stack import (
    ComTask,
    FrameTask,
    JointTask,
    MomentumTask,
    PostureTask,
    Stack,
    SurfaceContact,
)


class Scene:
    """A stack on humanoid33 at home, and a director that plays motions and contact changes."""

    def __init__(self, robot, motions=(), changes=()):
        self.robot = robot
        self.com = ComTask()
        self.hand = FrameTask("right_hand", name="hand")
        self.foot = FrameTask("left_sole", name="foot")
        self.place = FrameTask("left_hand", "position", name="place")
        self.lean = FrameTask("torso", "orientation", name="lean")
        self.elbow = JointTask(["left_elbow", "right_elbow"], name="elbows")
        self.posture = PostureTask()
        self.momentum = MomentumTask()
        self.stack = Stack(
            [SurfaceContact("left_sole"), SurfaceContact("right_sole")],
            [
                [self.com, self.hand, self.foot, self.place, self.lean],
                [self.elbow, self.posture, self.momentum],
            ],
        )
        self.stack.bind(robot)
        self.home = RobotState(robot.q_home, np.zeros(robot.nv))
        self.dynamics = Dynamics(robot)
        self.dynamics.update(self.home)
        for _, task in self.stack.tasks():
            task.evaluate(self.dynamics)
        scenario = Scenario(
            name="scene", duration=100.0, motions=tuple(motions), contact_changes=tuple(changes)
        )
        self.director = Director(scenario, self.stack, robot)

    def at(self, time, contacts=None):
        self.director.lead(replace(self.home, time=time, contacts=contacts or {}))
        for contact in self.stack.contacts:
            contact.advance(time)

    def where(self, frame):
        return self.dynamics.frame(self.robot.frame_id(frame)).position


@pytest.fixture
def scene(get_robot):
    return lambda *motions, changes=(): Scene(get_robot("humanoid33"), motions, changes)


def move(task, kind, value=None, at=1.0, over=2.0, **more):
    goal = {} if value is None else {kind: value}
    return TargetMotion(task=task, at=at, over=over, **goal, **more)


def test_by_goes_half_way_in_half_the_time_and_stays_at_its_goal(scene):
    s = scene(move("com", "by", [0.1, 0.0, -0.2]))
    start = s.com.target_position.copy()
    for time, share in ((1.0, 0.0), (2.0, 0.5), (3.0, 1.0), (50.0, 1.0)):
        s.at(time)
        wanted = start + share * np.array([0.1, 0.0, -0.2])
        np.testing.assert_allclose(s.com.target_position, wanted, atol=1e-12)


def test_above_one_sole_or_between_two_keeps_the_height(scene):
    s = scene(
        move("com", "above", ("right_sole",)),
        move("com", "above", ("left_sole", "right_sole"), at=10.0),
    )
    height = s.com.target_position[2]
    s.at(1.0)
    s.at(3.0)
    np.testing.assert_allclose(s.com.target_position[:2], s.where("right_sole")[:2], atol=1e-12)
    s.at(10.0)
    s.at(12.0)
    middle = 0.5 * (s.where("left_sole") + s.where("right_sole"))
    np.testing.assert_allclose(s.com.target_position, [*middle[:2], height], atol=1e-12)


def test_reach_ends_on_the_ray_from_the_shoulder_at_a_ratio_of_the_arm(scene):
    direction = np.array([0.6, 0.0, 0.8])
    s = scene(
        move("hand", "reach", {"direction": direction, "ratio": 0.5}),
        move("hand", "reach", {"direction": direction, "ratio": 1.0}, at=10.0),
    )
    s.at(1.0)
    s.at(3.0)
    half = s.hand.target_position.copy()
    s.at(10.0)
    s.at(12.0)
    whole = s.hand.target_position.copy()
    shoulder = 2.0 * half - whole
    arm = np.linalg.norm(whole - shoulder)
    np.testing.assert_allclose((whole - shoulder) / arm, direction, atol=1e-9)
    model = s.robot.model
    joint = model.getJointId("right_shoulder_pitch")
    data = model.createData()
    pin.forwardKinematics(model, data, s.home.q)
    chain = list(model.supports[model.frames[s.robot.frame_id("right_hand")].parentJoint])
    first = chain.index(joint) if joint in chain else None
    assert first is not None
    # The clavicle belongs to the arm on this robot, so the ray starts there or at the shoulder.
    origins = [data.oMi[j].translation for j in chain[first - 1 : first + 1]]
    assert min(np.linalg.norm(o - shoulder) for o in origins) < 1e-9
    assert arm >= np.linalg.norm(s.where("right_hand") - shoulder)


def test_a_turn_and_a_shift_of_one_frame_run_side_by_side(scene):
    s = scene(move("hand", "turn", [0.0, 0.0, 1.0]), move("hand", "by", [0.0, 0.2, 0.0], at=1.5))
    start, rotation = s.hand.target_position.copy(), s.hand.target_rotation.copy()
    for time in (1.0, 1.5, 2.0):
        s.at(time)
    s.hand.evaluate(s.dynamics)
    assert s.hand.error_rate[1] > 0.0
    assert s.hand.error_rate[5] > 0.0
    s.at(3.0)
    s.at(3.5)
    np.testing.assert_allclose(s.hand.target_position, start + [0.0, 0.2, 0.0], atol=1e-12)
    turned = pin.exp3(np.array([0.0, 0.0, 1.0])) @ rotation
    np.testing.assert_allclose(s.hand.target_rotation, turned, atol=1e-12)


def test_joints_move_and_those_not_named_stay(scene):
    s = scene(move("posture", "joints", {"left_elbow": -0.5}))
    home = s.robot.q_home[7:].copy()
    s.at(1.0)
    s.at(3.0)
    home[s.robot.joint_index("left_elbow")] = -0.5
    np.testing.assert_allclose(s.posture.target_position, home, atol=1e-12)


@pytest.mark.parametrize("second", [1.4, 2.0, 2.0004, 2.6])
def test_a_later_motion_takes_over_without_a_jump(scene, second):
    s = scene(
        move("com", "by", [0.2, 0.0, 0.0]), move("com", "to", [0.0, 0.3, 0.8], at=second, over=1.0)
    )
    dt, places = 1e-3, []
    for k in range(4000):
        s.at(k * dt)
        places.append(s.com.target_position.copy())
    speed = np.diff(places, axis=0) / dt
    acceleration = np.diff(speed, axis=0) / dt
    # The fastest of the two quintics reaches some 4 m/s^2 and 40 m/s^3.
    assert np.abs(acceleration).max() < 8.0
    assert np.abs(np.diff(acceleration, axis=0)).max() < 0.2
    np.testing.assert_allclose(places[-1], [0.0, 0.3, 0.8], atol=1e-12)


def test_a_foot_on_the_ground_starts_from_where_the_ground_holds_it(scene):
    s = scene(move("foot", "by", [0.0, 0.0, 0.1]))
    s.foot.set_target(position=[9.0, 9.0, 9.0])
    s.at(1.0)
    s.at(3.0)
    np.testing.assert_allclose(s.foot.target_position, s.where("left_sole") + [0, 0, 0.1])


def loads(scene):
    return {c.name: c.active for c in scene.stack.contacts}


def test_a_contact_is_unloaded_at_its_time_over_its_ramp(scene):
    s = scene(changes=[ContactChange(unload="left_sole", at=1.0, over=0.5)])
    s.at(0.999)
    s.at(1.0)
    assert loads(s) == {"left_sole": True, "right_sole": True}
    s.at(1.499)
    assert loads(s)["left_sole"]
    s.at(1.501)
    assert loads(s) == {"left_sole": False, "right_sole": True}


def touch(force):
    return {"left_sole": np.array([0.0, 0.0, force, 0.0, 0.0, 0.0])}


def lifted(scene, touchdown):
    s = scene(
        changes=[
            ContactChange(unload="left_sole", at=0.0, over=0.0),
            ContactChange(load="left_sole", at=5.0, over=0.1, touchdown=touchdown),
        ]
    )
    s.at(0.0)
    s.at(0.1)
    s.at(4.999, touch(500.0))
    assert not loads(s)["left_sole"]
    return s


def test_loading_waits_until_the_ground_is_felt(scene):
    s = lifted(scene, 10.0)
    s.at(5.0)
    s.at(5.3, touch(9.9))
    assert not loads(s)["left_sole"]
    s.at(5.301, touch(10.0))
    assert loads(s)["left_sole"]


def test_loading_does_not_wait_for_ever(scene):
    s = lifted(scene, 10.0)
    s.at(5.0 + TOUCHDOWN_PATIENCE - 1e-3)
    assert not loads(s)["left_sole"]
    s.at(5.0 + TOUCHDOWN_PATIENCE)
    assert loads(s)["left_sole"]


WRONG = {
    "unknown task": (move("con", "by", [0, 0, 0]), UnknownNameError, "'con'.*com"),
    "turning the com": (
        move("com", "turn", [0, 0, 1]),
        ConfigurationError,
        "'turn'.*to, by, above",
    ),
    "over no sole": (
        move("foot", "above", ("left_toe",)),
        UnknownNameError,
        "'left_toe'.*left_sole",
    ),
    "degrees": (
        move("posture", "joints", {"left_elbow": -90.0}),
        ConfigurationError,
        "beyond.*-90.*rad",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_goal_that_does_not_fit_is_refused_when_the_director_is_made(scene, case):
    motion, kind, message = WRONG[case]
    with pytest.raises(kind, match=message):
        scene(motion)
