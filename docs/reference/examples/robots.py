from pathlib import Path

import poise

MODEL = Path(poise.__file__).parents[2] / "examples" / "models" / "walker12.urdf"

# %% load_robot Robot
robot = poise.load_robot("humanoid33")  # or a file, a pin.Model, a mujoco.MjModel; a Robot
print(robot.mass, robot.nj, robot.joint_names[:3])  # [kg]
print(robot.tau_max[0], robot.q_min[0], robot.q_max[0])  # [N m], [rad]

# %% catalog
from poise.robots import catalog

print([entry.name for entry in catalog()])

# %% describe
from poise.robots import describe

proposal = describe(MODEL)  # a model without a description
print(proposal.text)

# %% description_template
from poise.robots import description_template

print(description_template(MODEL))  # to fill in by hand

# %% JointOrder
from poise.robots import JointOrder

order = JointOrder.breadth_first(robot)  # as Isaac Lab has the joints
print(order.names[:4])
