"""Families that are done in a moment, and a program that works on one so that it can be killed."""

import sys
import time

import gapwalk as gw
from gapwalk.model.model_source import parse_source
from gapwalk.studies.branch_family import Family
from gapwalk.studies.study_file import check_study
from tests.computed import file_of, once
from tests.models import CLUTCH
from tests.systems import clutch

MODEL = f"""\
{CLUTCH}
[study]
kind = "family"
parameter = "frequency"
from = 1.4
to = 1.1
over = {{ "mean.q3" = [0.25, 0.35, 0.5] }}
workers = 1
"""
"""The second resonance of figures 13 and 14: two flips and two grazing points at each of three loads."""


def study_of(text: str = MODEL) -> gw.Study:
    return check_study(parse_source(text, "m.toml"))


@once
def family_file() -> bytes:
    """The result file of that study."""
    return file_of(study_of())


def second_resonance(loads=(0.25, 0.35, 0.5), system: gw.System | None = None, **more) -> Family:
    """The same by the function."""
    given = {"workers": 1} | more
    return gw.family(system or clutch(), "frequency", (1.4, 1.1), {"mean.q3": loads}, **given)


def main(path: str) -> None:
    """Work on a family, or go on with it; write a line for each part that is safe."""

    def report(part, pace) -> None:
        print(pace.done, pace.total, flush=True)
        time.sleep(0.05)

    result = gw.run(study_of(), path, resume=True, report=report)
    print("complete" if result.complete else "stopped", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
