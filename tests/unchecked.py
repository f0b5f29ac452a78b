"""Long runs in a process of their own, where loops are not type-checked and take a fifth."""

import json
import os
import subprocess
import sys


def run_unchecked(code, *arguments):
    """Runs Python code, and returns what it prints last, which must be JSON.

    Args:
        code: Python code, with warnings as errors.
        arguments: `sys.argv[1:]` of the code.
    """
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])
