"""`python -m poise`: the command, where its script is not on the path."""

import sys

from poise.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
