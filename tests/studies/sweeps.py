"""A sweep that is driven in a moment, and a program that drives it into a file so that it can be killed."""

from gapwalk import sweep
from tests.systems import clutch

FOLDS = (clutch(), "frequency", (0.605, 0.649))
"""Over the two folds of figure 13 at its first resonance."""


def options(**given) -> dict:
    """Options of a short sweep in this process."""
    return {"steps": 45, "points": 14, "workers": 1} | given


def main(path: str) -> None:
    """Drive the sweep, or go on with it; write a line for each segment that is safe."""
    found = sweep(*FOLDS, **options(), output=path, report=lambda each, _: print(each.lane, each.number, flush=True))
    print("complete" if found.complete else "stopped", flush=True)
