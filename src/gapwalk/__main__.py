"""``python -m gapwalk`` is the command ``gapwalk``."""

import sys

from gapwalk.cli import main

if __name__ == "__main__":
    sys.exit(main())
