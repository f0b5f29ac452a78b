"""`python -m bundled_robots`: write the documents of the bundled robots, or check them."""

import argparse
import sys
from collections.abc import Sequence

from bundled_robots.documents import (
    ARCHIVE,
    differences,
    make_documents,
    read_archive,
    write_archive,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the archive, or compare it with what would be written."""
    parser = argparse.ArgumentParser(
        prog="python -m bundled_robots",
        description="Makes the URDF documents of humanoid20 to humanoid60, biped20, arm6 and "
        f"upper17, and writes them into {ARCHIVE.name} of the package poise.robots.",
    )
    parser.add_argument(
        "--check", action="store_true", help="write nothing; exit 1 where shipped documents differ"
    )
    documents = make_documents()
    if not parser.parse_args(arguments).check:
        write_archive(documents)
        return 0
    different = differences(documents, read_archive())
    for name in different:
        print(f"{name} differs from what `python -m bundled_robots` makes")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
