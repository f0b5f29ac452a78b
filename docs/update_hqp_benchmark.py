"""Run `python -m benchmarks hqp`, and put its first table and its figure into the documentation.

    OPENBLAS_NUM_THREADS=1 python docs/update_hqp_benchmark.py

Further arguments go to the command.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
PAGE = HERE / "hqp_benchmark.md"
FIGURE = HERE / "images" / "hqp.png"
OUTPUT = re.compile(r"(<!-- begin of the output -->\n).*(<!-- end of the output -->)", re.DOTALL)


def main() -> None:
    """Race, then replace the text between the marks."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "benchmarks", "hqp", "--out", folder, *sys.argv[1:]]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        shutil.copy(Path(folder) / "hqp.png", FIGURE)
    page = PAGE.read_text(encoding="utf-8")
    first = done.stdout.partition("\n\n**")[0]
    PAGE.write_text(OUTPUT.sub(lambda m: f"{m[1]}{first}\n{m[2]}", page), encoding="utf-8")


if __name__ == "__main__":
    main()
