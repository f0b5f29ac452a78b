"""The report of a run: one HTML page with plots, the video and a 3D replay, from plain arrays.

Nothing of the simulator is imported here, and matplotlib only when a page is written.
"""

from poise.report.record import RunRecord
from poise.report.replay import ForceTrack, Geometry, MarkerTrack, Replay
from poise.report.tracks import Check, Event, SoleTrack, SupportPhase, TaskTrack
from poise.report.write import write_report

__all__ = [
    "Check",
    "Event",
    "ForceTrack",
    "Geometry",
    "MarkerTrack",
    "Replay",
    "RunRecord",
    "SoleTrack",
    "SupportPhase",
    "TaskTrack",
    "write_report",
]
