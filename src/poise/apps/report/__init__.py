"""The report of a run: one HTML page with plots, the video and a 3D replay, from plain arrays.

Nothing of the simulator is imported here, and matplotlib only when a page is written.
"""

from poise.apps.report._page import asset as asset, write_report as write_report
from poise.apps.report._record import (
    BaseErrors as BaseErrors,
    Check as Check,
    Event as Event,
    ForceTrack as ForceTrack,
    Geometry as Geometry,
    Replay as Replay,
    RunSignals as RunSignals,
    SoleTrack as SoleTrack,
    SupportPhase as SupportPhase,
    TaskTrack as TaskTrack,
)
from poise.apps.report._replay import shapes_payload as shapes_payload

__all__: list[str] = []
