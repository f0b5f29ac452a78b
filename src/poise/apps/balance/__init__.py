"""Balance service: the robot stands and walks; another program commands arms, head and velocity."""

from poise.apps.balance._leader import BalanceLeader
from poise.apps.balance._lerobot import LeRobotController
from poise.apps.balance._messages import (
    BalanceState as BalanceState,
    HandTarget as HandTarget,
    Targets as Targets,
)
from poise.apps.balance._server import BalanceServer

__all__ = ["BalanceLeader", "BalanceServer", "LeRobotController"]
