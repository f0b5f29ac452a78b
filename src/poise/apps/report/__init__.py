"""The report of a run: one HTML page with plots, the video and a 3D replay, from plain arrays.

Nothing of the simulator is imported here, and matplotlib only when a page is written.
"""

from poise.apps.report._page import asset as asset, write_report as write_report
from poise.apps.report._record import (
    BaseErrors as BaseErrors,
    Check as Check,
    Event as Event,
    RunView as RunView,
    SoleTrack as SoleTrack,
    SupportPhase as SupportPhase,
    TaskTrack as TaskTrack,
)
from poise.apps.report._replay import (
    ForceTrack as ForceTrack,
    Geometry as Geometry,
    MarkerTrack as MarkerTrack,
    Replay as Replay,
)
from poise.apps.report._replay_payload import shapes_payload as shapes_payload

__all__: list[str] = []
