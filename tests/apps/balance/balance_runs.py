"""Runs of the balance service for its tests."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from poise import Plant, RobotState, rollout
from poise.apps.balance import BalanceLeader, Targets
from poise.estimation import PayloadEstimator, StateEstimator
from poise.robots import capsules_of
from poise.sim import PlantConfig

DT = 0.002


def swing(robot, time, size=1.0):
    """Arms that swing against each other, hands with up to 1 m/s."""
    wave, found = size * math.sin(math.pi * time), {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for name, way in (("shoulder_pitch", 1.0), ("elbow", -0.5), ("shoulder_roll", 0.1)):
            joint = f"{side}_{name}_joint"
            home = float(robot.q_home[7 + robot.joint_index(joint)])
            found[joint] = home + sign * way * wave + (0.2 * sign if "roll" in joint else 0.0)
    return found


@dataclass
class Run:
    """Outcome of a run."""

    fallen: bool
    place: np.ndarray
    steps: int
    rooms: list  # least distance of capsules of arms above what is kept [m]
    leader: BalanceLeader


def run(robot, client, seconds, *, load=0.0, cells=True, noise=False):
    """Run a robot in the simulator under a client, a function of the time, at 50 Hz."""
    loads = tuple(PlantConfig.Payload(frame=h, mass=load) for h in robot.hands if load)
    config = PlantConfig(control_dt=DT, self_contact=True, payloads=loads)
    plant = Plant(robot, config.with_noise() if noise else config)
    leader = BalanceLeader(robot, dt=DT)
    estimator = StateEstimator(robot, payload=PayloadEstimator(robot) if cells else None)

    def estimate(state):
        return estimator.update(state if cells else replace(state, contacts={}))

    rooms, room = [], arm_room(robot)
    for tick in rollout(plant, leader.controller(), leader, estimator=estimate, duration=seconds):
        if tick.index % 10 == 0:
            leader.take(replace_time(client(tick.time), tick.time + DT))
            rooms.append(room(tick.truth.q))
    return Run(plant.fallen, plant.com, leader.walker.steps_made, rooms, leader)


def replace_time(targets, time):
    """The same targets, at another time."""
    return Targets(time, targets.velocity, targets.joints, targets.hands)


def arm_room(robot):
    """Return a function of q: least distance of arms' capsules, by coal, above what is kept [m]."""
    capsules, names = capsules_of(robot), robot.model.names
    words = ("shoulder", "elbow", "wrist")
    arms = [any(word in names[joint] for word in words) for joint in capsules.joints.tolist()]
    ours = np.array([arms[i] or arms[j] for i, j in capsules.pairs.tolist()])
    margins = np.minimum(0.02, capsules.at_home - 0.01)
    return lambda q: float((capsules.distances(robot, q) - margins)[ours].min())


class Posed:
    """A leader whose robot stands at home, its arms exactly at their targets."""

    def __init__(self, robot, dt=0.01, q=None):
        self.robot, self.dt, self.time = robot, dt, 0.0
        self.leader = BalanceLeader(robot, dt=dt)
        self.task = self.leader.stack.task("arms")
        self.index = np.array([7 + robot.joint_index(joint) for joint in self.task.joints])
        self.q = (robot.q_home if q is None else q).copy()
        self.stamp = 100.0

    def step(self, **targets):
        """Take one tick, with a message where there are targets; return the arms' joints."""
        if targets:
            self.stamp += self.dt
            self.leader.take(Targets(targets.pop("time", self.stamp), **targets))
        else:
            self.stamp += self.dt
        self.leader.lead(RobotState(self.q, np.zeros(self.robot.nv), time=self.time))
        self.time += self.dt
        self.q[self.index] = self.task.target_position
        return self.q[self.index].copy()

    def hand(self, name):
        """Place of a hand in the frame of the torso [m]."""
        data = self.robot.model.createData()
        pin.framesForwardKinematics(self.robot.model, data, self.q)
        torso, hand = (data.oMf[self.robot.frame_id(f)] for f in (self.robot.torso, name))
        return torso.actInv(hand).translation
