"""Studies by harmonic balance that are walked in a moment, and a program that runs one so that it can be killed."""

import dataclasses
import sys
import time

from gapwalk import Balance, Study, run
from tests.studies.studies import stop_study


def balanced(study: Study, method: Balance) -> Study:
    """The same study by harmonic balance."""
    return dataclasses.replace(study, options=dataclasses.replace(study.options, method=method))


def growing_study() -> Study:
    """A response on which the number of harmonics grows several times by the way."""
    return balanced(stop_study(end=1.3), Balance(error=1e-4))


def main(path: str) -> None:
    """Run it into a file, or go on with it; write a line for each point that is safe."""
    count = 0

    def report(point, special_points) -> None:
        nonlocal count
        count += 1
        print(count, flush=True)
        time.sleep(0.01)  # so that there is time to kill it: the whole walk takes little longer

    result = run(growing_study(), path, resume=True, report=report)
    print("complete" if result.complete else "stopped", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
