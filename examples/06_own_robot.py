"""Your own robot: a URDF, and a short file with the facts that a URDF does not hold."""

import argparse
from pathlib import Path

import poise
from poise.robots import description_template

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--seconds", type=float, default=3.0)
parser.add_argument("--template", action="store_true", help="print a description to fill in")
options = parser.parse_args()

# The description is found by its name, walker12.poise.yaml, beside the model.
model = Path(__file__).parent / "models" / "walker12.urdf"
if options.template:
    print(description_template(model))
    raise SystemExit

robot = poise.load_robot(model)
print(f"{robot.name}: {robot.nj} joints, {robot.mass:.1f} kg, soles {', '.join(robot.soles)}")
controller = poise.WholeBodyController(robot)  # with the default stack of this robot
com = controller.stack.task("com")
plant = poise.Plant(robot)
middle = controller.dynamics.com.copy()


def squat(state: poise.RobotState) -> None:
    """Down by 5 cm in two seconds, at constant speed."""
    com.set_target(middle - [0.0, 0.0, 0.05 * min(1.0, state.time / 2.0)])


for _ in poise.rollout(plant, controller, squat, duration=options.seconds):
    pass
print(controller.status())
