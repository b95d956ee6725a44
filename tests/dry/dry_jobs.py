"""Studies of a system with friction and a rigid stop, and a program that does one so that it can be killed."""

from __future__ import annotations

from pathlib import Path

import gapwalk as gw
from gapwalk.model.model_source import parse_source
from gapwalk.studies.study_file import Study, check_study

MODEL = """
coordinates = ["x", "y"]
stiffness = [[2.0, -1.0], [-1.0, 1.5]]
damping = [[0.08, 0.0], [0.0, 0.06]]
frequency = 0.6
mean = { y = 0.1 }
[[contact]]
name = "wall"
deflection = { y = 1.0 }
clearance = 1.2
side = "positive"
stiffness = "rigid"
restitution = 0.6
[[friction]]
name = "brake"
deflection = { x = 1.0 }
limit = 0.25
static = 1.2
[[friction]]
name = "joint"
deflection = { x = 1.0, y = -1.0 }
limit = 0.1
stiffness = 3.0
[[harmonic]]
order = 1
amplitude = 0.9
acts_on = { x = 1.0 }
[study]
"""
OVER = 'parameter = "frequency"\nfrom = 0.6\n'
STUDIES = {
    "response": f'kind = "response"\n{OVER}to = 0.63\n[study.walk]\nlargest_step = 0.05\n',
    "settle": 'kind = "settle"\nsignal = "y"\n',
    "sweep": f'kind = "sweep"\n{OVER}to = 0.61\nsteps = 13\npoints = 13\nways = "up"\nworkers = 1\n',
}


def study_of(kind: str) -> Study:
    """Read one of the studies."""
    return check_study(parse_source(MODEL + STUDIES[kind]))


def main(kind: str, path: str) -> None:
    """Do a study, or go on with it; write a line for each part that is safe."""
    result = gw.run(study_of(kind), path, resume=Path(path).exists(), report=lambda *_: print("part", flush=True))
    print("complete" if result.complete else "stopped", flush=True)
