import numpy as np

import poise

robot = poise.load_robot("biped20")

# %% MotorCommand
from poise.hardware import MotorCommand

zero = np.zeros(robot.nj)
command = MotorCommand(q=zero, dq=zero, kp=zero, kd=zero + 2.0, tau=zero)
torque = command.torque(zero, zero + 0.1)  # of ideal drives at 0.1 rad/s [N m]

# %% Link LinkInfo LinkStatus MotorState
from poise.hardware import Link, LinkInfo, LinkStatus, MotorState


class Inertias:
    """A link to one inertia of 1 kg m^2 a joint, in place of a robot's bus."""

    def __init__(self, joints=robot.joint_names):
        self.info = LinkInfo(name="inertias", rate=500.0, joints=joints)
        self.status, self.refused, self.reason = LinkStatus.OK, 0, ""
        self.q, self.dq, self.tau = np.zeros((3, len(joints)))
        self.time = 0.0

    def write(self, command):
        self.tau = command.torque(self.q, self.dq)
        self.dq = self.dq + self.tau / self.info.rate
        self.q, self.time = self.q + self.dq / self.info.rate, self.time + 1.0 / self.info.rate

    def clock(self):
        return self.time  # of a robot, time.monotonic()

    def close(self):
        self.status = LinkStatus.LOST

    def read(self):
        return MotorState(
            time=self.time,
            arrived=self.time,
            q=self.q,
            dq=self.dq,
            tau=self.tau,
            temperature=np.full(len(self.q), np.nan),  # not measured
            quaternion=np.array([0.0, 0.0, 0.0, 1.0]),
            gyro=np.zeros(3),
            acceleration=np.array([0.0, 0.0, 9.81]),
            wrenches=np.zeros((0, 6)),
        )


link: Link = Inertias()
link.write(command)

# %% LastCheck
from poise.hardware import LastCheck

check = LastCheck(robot, kp_max=200.0, kd_max=20.0)  # [N m/rad], [N m s/rad]
link.write(check.check(command, link.read()))

# %% TorqueSplit
from poise.hardware import TorqueSplit

split = TorqueSplit(check, kp={"left_knee": 30.0, "right_knee": 30.0}, kd=1.0)
controller = poise.WholeBodyController(robot)
answer = controller.step(poise.RobotState(robot.q_home, np.zeros(robot.nv)))
link.write(split.split(answer, link.read()))

# %% PlantLink robot_state
from poise.hardware import PlantLink, robot_state

link = PlantLink(poise.Plant(robot), check)
state = robot_state(robot, link.info, link.read())  # for a `StateEstimator`

# %% ProcessLink
from poise.hardware import ProcessLink

if __name__ == "__main__":
    remote = ProcessLink(Inertias, check, linger=0.0)  # damps for two seconds by default
    remote.write(command)
    remote.close()

# %% Watchdog Action Rule Trouble RULES
from poise.hardware import RULES, Action, Rule, Trouble, Watchdog

warm = Rule(trouble=Trouble.HEAT, limit=60.0, response=Action.HOLD)  # [deg C]
watchdog = Watchdog(robot, rules=[*RULES, warm])
with watchdog.signals():  # Ctrl-C and kill are rows of the table
    verdict = watchdog.evaluate(link, link.read(), answer)
    if verdict.response is Action.DAMP:
        link.write(check.damping)

# %% LinkBody
from poise.estimation import StateEstimator
from poise.hardware import LinkBody

plant = poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002))
body = LinkBody(robot, PlantLink(plant), check, split, ramp=0.0)  # it stands already
estimator = StateEstimator(robot)
for _ in poise.rollout(body, controller, estimator=estimator, duration=0.02):
    assert body.verdict.response is Action.RUN
body.close()

# %% preflight Preflight Move
from poise.hardware import Move, Preflight, preflight


class Limp(Inertias):
    """A robot whose time passes while it is read."""

    def read(self):
        self.write(MotorCommand.damping(zero))
        return super().read()


def ask(move: Move) -> None:
    """Ask a person for a motion; `preflight(..., motion=ask)`."""
    input(f"{move.prompt}; Enter begins.")


found: Preflight = preflight(robot, Limp(), check, start=robot.q_home[-robot.nj :], seconds=0.2)
print(found)  # a table: seen, wanted, and what to do

# %% G1Link
from functools import partial

from poise.hardware import G1Link
from poise.robots import JointOrder


def connect(g1):
    """Connect to a G1 by its cable, in a process of its own."""
    motors = JointOrder.unitree_dds("g1").names
    make = partial(G1Link, g1.joint_names, motors, interface="eth0", mode_machines=(5,))
    return ProcessLink(make, LastCheck(g1, kp_max=100.0, kd_max=8.0))
