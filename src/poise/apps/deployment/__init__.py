"""Deployment: scenarios and operators on a robot behind a link, and a simulated robot there."""

from poise.apps.deployment._deploy import (
    FLUSH as FLUSH,
    deploy as deploy,
    stage_deployment as stage_deployment,
)
from poise.apps.deployment._faults import FaultPlan as FaultPlan, Faults as Faults
from poise.apps.deployment._g1 import (
    connect_g1 as connect_g1,
    g1_gains as g1_gains,
    simulate_g1 as simulate_g1,
)
from poise.apps.deployment._linked_plant import LinkedPlant as LinkedPlant
from poise.apps.deployment._replay_states import replay_states as replay_states
from poise.apps.deployment._simulate import SimulatedRobot as SimulatedRobot
