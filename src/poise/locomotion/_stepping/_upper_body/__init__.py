"""Hands and gaze, led in a model of arms and neck alone, below balance."""

from poise.locomotion._stepping._upper_body._gaze import GazeLeader
from poise.locomotion._stepping._upper_body._hands import HandLeader, HandStatus

__all__ = [
    "GazeLeader",
    "HandLeader",
    "HandStatus",
]
