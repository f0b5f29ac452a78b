"""A program moves the arms of a robot that stands and walks by itself, over ZeroMQ.

The service runs beside the client, on a simulated robot; on hardware a link takes its place.
"""

import argparse
import math
import threading

import zmq

import poise
from poise.apps.balance import BalanceLeader, BalanceServer
from poise.estimation import StateEstimator

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="g1", help="a humanoid: a name in `poise robots`, or a file")
parser.add_argument("--joint", default="shoulder_pitch", help="that swings in both arms")
parser.add_argument("--seconds", type=float, default=6.0)
options = parser.parse_args()

robot = poise.load_robot(options.robot)
server = BalanceServer(BalanceLeader(robot, dt=0.002), port=0)


def serve() -> None:
    """Run the service on a simulated robot."""
    plant = poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002, self_contact=True))
    server.run(plant, estimator=StateEstimator(robot), duration=options.seconds, paced=True)


service = threading.Thread(target=serve)
service.start()

# The client ---------------------------------------------------------------------------------------
context = zmq.Context.instance()
targets, states = context.socket(zmq.PUSH), context.socket(zmq.SUB)
targets.connect(server.targets)
states.connect(server.states)
states.subscribe(b"")
state, begun = {}, None
while service.is_alive():
    if not states.poll(100):
        continue
    state = states.recv_json()
    begun = begun or state["joints"]
    swing = 0.5 * math.sin(math.pi * state["time"])
    joints = {
        name: angle + swing * (1.0 if name.startswith("left") else -1.0)
        for name, angle in begun.items()
        if options.joint in name
    }
    ahead = 0.3 if state["time"] > 0.3 * options.seconds else 0.0
    # A stamp of any clock; that of the robot, as a busy machine simulates it slower than real time.
    targets.send_json({"time": state["time"], "joints": joints, "velocity": [ahead, 0.0, 0.0]})

context.destroy(linger=0)
server.close()
print(f"{state['time']:.1f} s: {state['walk']}, command {state['command']}", end=", ")
print(f"{state['refused']} messages refused, hands at {state['hands']}")
