"""The report of a run: one HTML page with plots, the video and a 3D replay, from plain arrays.

Nothing of the simulator is imported here, and matplotlib only when a page is written.
"""

from poise.apps.report._record import Check, Event, RunView, SoleTrack, SupportPhase, TaskTrack
from poise.apps.report._replay import ForceTrack, Geometry, MarkerTrack, Replay
from poise.apps.report._write import write_report

__all__ = [
    "Check",
    "Event",
    "ForceTrack",
    "Geometry",
    "MarkerTrack",
    "Replay",
    "RunView",
    "SoleTrack",
    "SupportPhase",
    "TaskTrack",
    "write_report",
]
