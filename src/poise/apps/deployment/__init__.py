"""Deployment: scenarios and operators on a robot behind a link, and a simulated robot there."""

from poise.apps.deployment._deploy import FLUSH as FLUSH, deploy, stage_deployment
from poise.apps.deployment._faults import FaultPlan, Faults
from poise.apps.deployment._g1 import connect_g1, g1_gains, simulate_g1
from poise.apps.deployment._linked_plant import LinkedPlant as LinkedPlant
from poise.apps.deployment._replay_states import replay_states
from poise.apps.deployment._simulate import SimulatedRobot

__all__ = [
    "FaultPlan",
    "Faults",
    "SimulatedRobot",
    "connect_g1",
    "deploy",
    "g1_gains",
    "replay_states",
    "simulate_g1",
    "stage_deployment",
]
