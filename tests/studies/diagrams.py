"""Diagrams that are found in a moment, and a program that finds one of them so that it can be killed."""

import sys
from collections.abc import Callable

from gapwalk import Result, SearchOptions, Study, run
from gapwalk.studies import DiagramStudyOptions
from tests.computed import file_of, once, opened
from tests.systems import clutch


def clutch_diagram(workers: int | None = 1, end: float = 0.6, **more) -> Study:
    """The second resonance of figure 13: P1, a loop of P2, and one of P4 on it."""
    options = DiagramStudyOptions("frequency", 0.85, end, "half.q1", workers=workers, **({"max_period": 4} | more))
    return Study(clutch(frequency=0.85), options, "Second resonance", "title = 'Second resonance'\n", name="loop")


def many_branches(workers: int | None = 1) -> Study:
    """A part of figure 15: P1, a part of a loop of P2, and on it loops of P4."""
    system = clutch(frequency=0.44).at({"harmonic1.amplitude": 0.5})
    return Study(system, DiagramStudyOptions("frequency", 0.44, 0.405, "half.q1", max_period=4, workers=workers))


def islands(workers: int | None = 1) -> Study:
    """Two islands of period 3 of figure 15 and the motions of periods 1 and 2 between them.

    It begins on one island, so everything else has to be searched for; and from one of the roots that are found then
    other branches grow.
    """
    system = clutch(frequency=0.45).at({"harmonic1.amplitude": 0.5})
    options = DiagramStudyOptions(
        "frequency",
        0.345,
        0.47,
        "half.q1",
        period=3,
        start=(2.697, 1.655, -0.735, -0.205),
        max_period=3,
        workers=workers,
        search_values=(0.351, 0.445),
        search=SearchOptions(starts=12, newton_starts=2, newton_periods=(1, 3), patience=100),
    )
    return Study(system, options, "Islands", "title = 'Islands'\n", name="islands")


@once
def clutch_loop() -> Result:
    """What `clutch_diagram` comes to where nothing interrupts it."""
    return opened(loop_file())


@once
def loop_file() -> bytes:
    """The result file of `clutch_diagram` where nothing interrupts it."""
    return file_of(clutch_diagram())


@once
def islands_file() -> bytes:
    """The result file of `islands` where nothing interrupts it."""
    return file_of(islands())


def main(path: str, workers: str, study: Callable[[int], Study] = many_branches) -> None:
    """Find the branches of a study and store them, or go on with it; write a line for each branch that is safe."""
    result = run(study(int(workers)), path, resume=True, report=lambda diagram, member: print(member.name, flush=True))
    print("complete" if result.complete else "stopped", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
