"""The operational space formulation: closed-form priorities, tasks re-ordered while running."""

import numpy as np

import poise

robot = poise.load_robot("humanoid33")
com = poise.ComTask(kp=60.0)
upright = poise.FrameTask("pelvis", "orientation", kp=100.0)
hands = [poise.FrameTask(hand, "position", kp=100.0) for hand in robot.hands]
posture = poise.PostureTask()
stack = poise.Stack(
    contacts=[poise.SurfaceContact(sole) for sole in robot.soles],
    levels=[[com, upright], hands, [posture]],
)
# No torque may change by more than 5 N m from one tick to the next, whatever is switched.
controller = poise.OperationalSpaceController(robot, stack, torque_step=5.0)
plant = poise.Plant(robot)

largest_step, before = 0.0, None


def switch(state: poise.RobotState) -> None:
    """Re-orders the tasks while the robot stands."""
    if abs(state.time - 0.5) < 1e-9:
        # The hands are let go, and the posture takes their place.
        controller.set_levels([[com, upright], [posture]])
    if abs(state.time - 1.0) < 1e-9:
        # Now one hand is wanted again, at once and 5 cm higher; and it is more important.
        controller.set_levels([[com, upright], [hands[0]], [posture]])
        where = controller.dynamics.frame(robot.frame_id(robot.hands[0])).position
        hands[0].set_target(where + np.array([0.0, 0.0, 0.05]))


for tick in poise.rollout(plant, controller, switch, duration=1.5):
    command = tick.command
    if before is not None:
        largest_step = max(largest_step, float(np.abs(command.torque - before).max()))
    before = command.torque

print(controller.status())
print(f"largest change of a torque in a tick: {largest_step:.2f} N m")
print(f"load on the left sole: {command.wrenches['left_sole'][2]:.0f} N")
