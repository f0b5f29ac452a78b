"""A simulator of your own under `poise.rollout`: Pinocchio integrates an arm in free space."""

import argparse

import numpy as np
import pinocchio as pin

import poise

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--seconds", type=float, default=1.0)
options = parser.parse_args()


class OwnSimulator:
    """An arm in free space; a `poise.sim.Body`."""

    control_dt, time, fallen = 0.001, 0.0, False

    def __init__(self, robot):
        self.robot, self.data = robot, robot.model.createData()
        self.q, self.v = robot.q_home.copy(), np.zeros(robot.nv)

    def state(self):
        """Return what sensors measure."""
        return poise.RobotState(self.q, self.v, time=self.time)

    true_state = state

    def step(self, command):
        """Advance by one control period under the command's torques."""
        dv = pin.aba(self.robot.model, self.data, self.q, self.v, command.torque)
        self.v = self.v + self.control_dt * dv
        self.q = pin.integrate(self.robot.model, self.q, self.control_dt * self.v)
        self.time += self.control_dt


robot = poise.load_robot("arm6")
hand = poise.FrameTask("hand", axes="position")
stack = poise.Stack(levels=[[hand], [poise.PostureTask()]])
controller, record = poise.WholeBodyController(robot, stack), poise.sim.RunRecord()
for tick in poise.rollout(OwnSimulator(robot), controller, duration=options.seconds):
    if tick.index == 0:
        hand.set_target(hand.target_position + [0.0, 0.0, -0.1])
    record.add(tick.time, {"hand_error": hand.error, "torque": tick.command.torque})
print(f"the hand ends {1e3 * np.linalg.norm(record['hand_error'][-1]):.3f} mm from its target")
