"""`walking_stack`: tasks and contacts that a walker can lead."""

from poise.contacts import SurfaceContact
from poise.control.stack import Stack
from poise.robots.robot import Robot
from poise.tasks import ComTask, FrameTask, PostureTask, Task
from poise.walking.plan import two_soles


def walking_stack(robot: Robot) -> Stack:
    """COM, pelvis and feet first, then torso and hands, then posture and angular momentum.

    Args:
        robot: on two soles.

    Returns:
        A new stack.

    Raises:
        RobotError: the robot does not stand on two soles.
    """
    soles = two_soles(robot)
    balance: list[Task] = [
        ComTask(kp=40.0),
        FrameTask(robot.pelvis, "orientation", kp=100.0, name="pelvis"),
    ]
    feet: list[Task] = [
        FrameTask(sole, kp=300.0, name=sole.replace("sole", "foot")) for sole in soles
    ]
    upper: list[Task] = [FrameTask(robot.torso, "orientation", kp=50.0, name="torso")]
    upper += [FrameTask(hand, "position", kp=100.0, name=hand) for hand in robot.hands]
    last: list[Task] = [PostureTask()]
    return Stack(
        contacts=[SurfaceContact(sole) for sole in soles],
        levels=[[*balance, *feet], upper, last],
    )
