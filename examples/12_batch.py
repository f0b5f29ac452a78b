"""Many states at once: how hard can a standing robot push its centre of mass, in each direction?"""

import argparse

import numpy as np

import poise

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="humanoid33", help="a name in `poise robots`, or a file")
parser.add_argument("--count", type=int, default=2000, help="how many accelerations to try")
options = parser.parse_args()

robot = poise.load_robot(options.robot)
default = poise.default_stack(robot)
# The question is what feet can bear for a moment, not what they can go on with.
stack = poise.Stack(
    default.contacts, default.levels, balance_limit=poise.BalanceLimit(enabled=False)
)
controller = poise.WholeBodyController(robot, stack)

# As many states as tries; here they are all the same, and the target is what changes.
at_home = poise.RobotState(robot.q_home, np.zeros(robot.nv))
rng = np.random.default_rng(0)
angles = rng.uniform(-np.pi, np.pi, options.count)
sizes = rng.uniform(0.0, 8.0, options.count)
asked = np.column_stack((sizes * np.cos(angles), sizes * np.sin(angles), np.zeros(options.count)))
com = stack.task("com")
commands = controller.solve_batch(
    [at_home] * options.count, before_each=lambda i: com.set_acceleration(asked[i])
)

# Two levels of physics stand above one's own: CoM and pelvis, then the hands, then the posture.
balance = commands.ok & (commands.residuals[:, 2] < 1e-6)
hands = balance & (commands.residuals[:, 3] < 1e-6)
for name, direction in (("ahead", 0.0), ("back", np.pi), ("aside", 0.5 * np.pi)):
    near = np.abs(np.angle(np.exp(1j * (angles - direction)))) < 0.2
    most, still = sizes[balance & near].max(), sizes[hands & near].max()
    print(f"{name}: {most:.1f} m/s^2, with both hands where they are {still:.1f} m/s^2")
