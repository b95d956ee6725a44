"""Studies that are walked in a moment, and a program that runs one of them so that it can be killed."""

import signal
import sys
from functools import cache

from gapwalk import Contact, Harmonic, Result, Side, Stage, Study, System, WalkOptions, run
from gapwalk.studies import ResponseOptions


def stop_study(largest_step: float = 0.02, end: float = 1.9, **changes) -> Study:
    """An oscillator against a one-sided stop: some folds and grazing points over the frequency."""
    stop = Contact(
        "stop", {"x": 1.0}, (Stage(1.0, 20.0, side=Side.POSITIVE),), None, "hunt-crossley", {"impact_damping": 0.1}
    )
    system = System(["x"], [[1.0]], [[0.05]], contacts=[stop], harmonics=[Harmonic(0.2, {"x": 1.0})], frequency=0.7).at(
        changes
    )
    walk = WalkOptions(largest_step=largest_step)
    return Study(system, ResponseOptions("frequency", 0.7, end, "half.x", walk=walk), "A stop", "title = 'A stop'\n")


def long_study() -> Study:
    """The same in many small steps, so that there is time to interrupt it."""
    return stop_study(largest_step=0.003)


@cache
def long_result() -> Result:
    """What that study comes to where nothing interrupts it."""
    return run(long_study())


def main(path: str, wait_at: int | None = None) -> None:
    """Run the long study into a file, or go on with it; write a line for each point that is safe.

    At the point of a given number it waits for its end, so that it cannot be done before somebody kills it.
    """
    count = 0

    def report(point, special_points) -> None:
        nonlocal count
        count += 1
        print(count, flush=True)
        if count == wait_at:
            signal.pause()

    result = run(long_study(), path, resume=True, report=report)
    print("complete" if result.complete else "stopped", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
