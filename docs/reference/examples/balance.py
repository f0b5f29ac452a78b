import poise

robot = poise.load_robot("humanoid20")

# %% BalanceLeader
from poise.apps.balance import BalanceLeader, Targets

leader = BalanceLeader(robot, dt=0.002)
leader.take(Targets(time=0.0, joints={"left_elbow": 0.5}, velocity=(0.1, 0.0, 0.0)))

# %% BalanceServer
from poise.apps.balance import BalanceServer

with BalanceServer(leader, port=0) as server:  # any free ports
    print(server.targets, server.states)

# %% LeRobotController
from poise.apps.balance import LeRobotController

# `run_step(action, lowstate) -> {"<joint>.q": ...}` of a G1, for LeRobot's `UnitreeG1`.
print(LeRobotController.run_step.__doc__)
