"""The loop of a peer's worker, run as a script by the peer's own interpreter; no Poise in it.

    python worker.py PEER robot.urdf run.npz

Answers on stdout, one JSON object a line: first the size of the problem, then for every request
`{"first": i, "count": n}` the times of n ticks. The end of its input ends it.
"""

import gc
import importlib
import json
import os
import sys
from typing import Any

import numpy as np


def main() -> None:
    """Builds the peer's problem, says hello, and ticks when asked to."""
    name, urdf, run_path = sys.argv[1:]
    answers = _own_stdout()
    try:
        peer = importlib.import_module(f"{name}_worker").Peer(urdf, _read(run_path))
        peer.tick(0)
    except Exception as error:
        # Whatever went wrong in foreign code is the answer.
        _say(answers, {"error": f"{type(error).__name__}: {error}".splitlines()[0]})
        return
    variables, rows = peer.size()
    _say(answers, {"solver": peer.solver, "variables": variables, "rows": rows})
    gc.disable()
    for line in sys.stdin:
        request = json.loads(line)
        ticks = range(request["first"], request["first"] + request["count"])
        outcomes = [peer.tick(index) for index in ticks]
        gc.collect()
        seconds, residuals, failed = zip(*outcomes, strict=True)
        _say(answers, {"seconds": seconds, "residuals": residuals, "failed": failed})


def _own_stdout() -> Any:
    """A stream of our own to the parent; whatever the peer prints goes to stderr."""
    stream = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    return stream


def _say(stream: Any, message: dict[str, Any]) -> None:
    stream.write(json.dumps(message) + "\n")
    stream.flush()


def _read(path: str) -> dict[str, Any]:
    with np.load(path) as file:
        run: dict[str, Any] = {key: file[key] for key in file.files}
    run["facts"] = json.loads(str(run["facts"]))
    return run


if __name__ == "__main__":
    main()
