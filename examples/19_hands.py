"""Hands: step teleoperation at torque level, one hand holding what the model is told of."""

import argparse
from dataclasses import replace

import poise
from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.locomotion import ScriptedDevice, StepTeleoperator, WayPoint

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="g1", help="a name in `poise robots`, or a file")
parser.add_argument("--seconds", type=float, default=5.0)
parser.add_argument("--mass", type=float, default=1.0, help="in the right hand [kg]")
options = parser.parse_args()

robot = poise.load_robot(options.robot)
hand = robot.hands[1]
load = poise.sim.PlantConfig.Payload(frame=hand, mass=options.mass)
plant = replace(TORQUE_TELEOP_PLANT.with_noise(), payloads=(load,))


def operator(teleoperator: StepTeleoperator) -> ScriptedDevice:
    """Lifts the right foot, and the right hand with it; the left hand reaches too far."""
    up = (0.15, 0.0, 0.2)
    points = [
        WayPoint(at=0.5, right=(0.0, 0.0, 0.0), right_hand=(0.0, 0.0, 0.0)),
        WayPoint(at=1.2, right=(0.0, 0.0, 0.08), right_hand=up, left_hand=(0.0, 0.0, 0.0)),
        WayPoint(at=2.5, right=(0.0, 0.0, 0.08), right_hand=up, left_hand=(0.7, 0.0, 0.3)),
        WayPoint(at=3.2, right=(0.0, 0.0, -0.02)),
    ]
    return ScriptedDevice(points, *teleoperator.estimator.anchors)


for known in (False, True):
    told = robot.carrying(hand, options.mass) if known else robot
    run = run_teleop(told, operator, plant, duration=options.seconds)
    (x, y), status = run.record["com"][-1, :2] - run.log.zmp_reference[-1], run.teleoperator.status
    assert status is not None
    print(f"load {'known' if known else 'unknown'}: CoM {1e3 * (x * x + y * y) ** 0.5:.1f} mm off")
    print("hands:", ", ".join(does.value for does in status.hands))
