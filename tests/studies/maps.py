"""Maps that are drawn up in a moment, and a program that draws one up so that it can be killed."""

import sys
import time

from gapwalk import Balance, Kind, Result, Study, WalkOptions, run
from gapwalk.studies import ParameterRange
from gapwalk.studies.map_study import MapStudyOptions
from tests.computed import file_of, once, opened
from tests.systems import clutch

KINDS = (Kind.FOLD, Kind.FLIP, Kind.NEIMARK_SACKER, Kind.GRAZING)


def clutch_map(workers: int | None = 1, kinds: tuple[Kind, ...] = KINDS, **more) -> Study:
    """The second resonance of figure 13 over frequency and mean load: loci of flips, folds and grazing points."""
    second = ParameterRange("mean.q1", 0.2, 0.3)
    given = {"sections": 2, "max_period": 1} | more
    options = MapStudyOptions("frequency", 1.4, 1.1, "half.q1", second=second, kinds=kinds, workers=workers, **given)
    system = clutch(frequency=1.4).at({"mean.q1": 0.2})
    return Study(system, options, "Second resonance", "title = 'Second resonance'\n", name="resonance")


@once
def resonance() -> Result:
    """What `clutch_map` comes to where nothing interrupts it."""
    return opened(map_file())


@once
def map_file() -> bytes:
    """The result file of `clutch_map`."""
    return file_of(clutch_map())


def balanced_map(workers: int | None = 1, **more) -> Study:
    """The same by harmonic balance, with as many harmonics as it takes."""
    return clutch_map(workers, method=Balance(error=2e-5), walk=WalkOptions(largest_step=0.05), **more)


def main(path: str, workers: str, method: str = "shooting") -> None:
    """Draw up a map and store it, or go on with it; write a line for each section and each locus that is safe."""
    make = balanced_map if method == Balance.name else clutch_map

    def report(chart, addition) -> None:
        print(len(chart.sections), len(chart.loci), flush=True)
        time.sleep(0.05)  # or most of the work would be done between two readings of this line

    result = run(make(int(workers)), path, resume=True, report=report)
    print("complete" if result.complete else "stopped", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
