"""A robot that stands still, for tests of what is in front of it: there is nothing to simulate."""

import json

STATUS = {
    "robot": "still", "source": "browser", "kind": "feet",
    "limits": {"height": [-0.1, 0.02], "torso": [0.2, 0.4, 0.5], "turns": [0.2, 0.6]},
    "asked": {"height": 0.0, "torso": [0.0, 0.0, 0.0], "turns": [0.0, 0.0]},
    "time": 1.0, "mode": "D", "modeText": "standing on both feet",
    "device": "OK", "deviceText": "ok",
    "zmp": [0.0, 0.0], "zmpReference": [0.0, 0.0], "com": [0.0, 0.0, 0.7],
    "soles": [[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]], "handles": [[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]],
    "heading": 0.0, "hands": [[0.1, 0.3, 0.7], [0.1, -0.3, 0.7]], "handsDo": ["REST", "REST"],
    "handTurns": [None, None], "gaze": "REST", "target": None,
    "polygon": [[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.1, -0.1]], "bodies": [], "turns": [],
    "landings": 0, "margin": 0.1, "loads": [300.0, 300.0], "tilt": 0.0, "fallen": False,
    "paused": False, "speed": 1.0, "realTimeFactor": 1.0, "take": "take-001.mcap",
}  # fmt: skip


class Still:
    """A desk of a robot that stands still; what it is told is kept."""

    def __init__(self):
        self.told, self.orders, self.answer = dict(STATUS), [], None

    def order(self, text):
        self.orders.append(json.loads(text))
        return self.answer

    def left(self):
        pass

    def status(self):
        return self.told

    def file(self, name):
        return None
