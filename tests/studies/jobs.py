"""Studies without branches that are done in a moment: their model files, with one process each."""

from pathlib import Path

import gapwalk as gw
from gapwalk.model.model_source import parse_source
from gapwalk.studies import basin_study as basin_job
from gapwalk.studies import rattle_chance, run_up_study
from gapwalk.studies import regime_study as regime_job
from gapwalk.studies import scan_study as scan_work
from gapwalk.studies.study_file import Study, check_study
from tests.computed import file_of, once
from tests.models import CLUTCH, STOP

HEAD = (
    CLUTCH.replace("amplitude = 0.25", "amplitude = 0.5").replace("mean = ", "frequency = 0.45\nmean = ")
    + """
[study]
"""
)

SETTLE = HEAD + 'kind = "settle"\nsignal = "stage2"\nphase = "90 deg"\n'
SWEEP = HEAD + (
    'kind = "sweep"\nparameter = "frequency"\nfrom = 0.5\nto = 0.6\nsteps = 45\npoints = 13\nworkers = 1\n'
    'signal = "q3\'"\n'
)
BASINS = HEAD + (
    'kind = "basins"\nplane = { q1 = [-4.0, 4.0], "q1\'" = [-3.0, 3.0] }\nfixed = { q3 = 0.5 }\n'
    "resolution = [100, 90]\nexact_borders = false\ncheck = 8\nworkers = 1\n"
)
SHARES = HEAD + (
    'kind = "shares"\nparameter = "frequency"\nfrom = 0.6\nto = 0.7\nbox = { q1 = [-4.0, 4.0] }\n'
    "points = 3\nstarts = 8\nworkers = 1\n"
)
REGIMES = HEAD + (
    'kind = "regimes"\nparameter = "frequency"\nfrom = 0.7\nto = 0.5\n'
    'second = { parameter = "harmonic1.amplitude", from = 0.4, to = 0.5 }\nresolution = [4, 9]\ncarry = "up"\n'
    "check = 2\nlongest = 400\nforces = true\nworkers = 1\n"
)
RUN_UP = (
    HEAD + 'kind = "run-up"\nfrom = 0.4\nto = 0.6\nrate = [0.002, 0.004]\nstarts = 3\nbins = 10\nwith_response = true\n'
)
CAMPBELL = HEAD + 'kind = "campbell"\nparameter = "frequency"\nfrom = 0.1\nto = 0.6\norders = [1, 2]\n'
GEAR = """
title = "A mass between two stops"
coordinates = ["x"]
stiffness = [0.0]
damping = [0.4]
mean = { x = 0.4 }
frequency = 1.0

[[contact]]
name = "teeth"
deflection = { x = 1.0 }
clearance = 0.5
stiffness = 1.3

[[harmonic]]
amplitude = 0.2
acts_on = { x = 1.0 }

[study]
"""
RATTLE = GEAR + 'kind = "rattle"\nparameter = "frequency"\nfrom = 0.9\nto = 1.5\nsteps = 6\nstarts = 4\nworkers = 1\n'
THRESHOLD = GEAR + (
    'kind = "threshold"\nparameter = "mean.x"\nfrom = 0.1\nto = 1.2\nvalues = 8\nstarts = 3\nperiods = 60\n'
    'over = { parameter = "frequency", from = 1.4, to = 2.0 }\n'
)
TOLERANCE = (
    STOP
    + """
[study]
kind = "tolerance"
parameter = "frequency"
from = 0.7
to = 1.0
samples = 40
check = 1
workers = 1
spread = [{ parameter = "stop.clearance", sd = "5 %" }]
"""
)
RATTLE_CHANCE = GEAR + (
    'kind = "rattle-chance"\nvalues = [1.0, 1.4]\nsamples = 14\nstarts = 2\nworkers = 1\n'
    'spread = [{ parameter = "mean.x", sd = "60 %" }]\n'
)
DESIGN = (
    STOP
    + """
[study]
kind = "design"
parameter = "frequency"
from = 0.7
to = 1.2
changes = [{ parameter = "harmonic1.amplitude", by = 0.9 }]
goals = [{ quiet = "stop", from = 0.7, to = 1.2 }]
starts = 0
search = { values = [1.0], starts = 2, newton_starts = 0 }
"""
)
BACKBONE = (
    CLUTCH
    + """
[study]
kind = "backbone"
modes = [1, 2]
largest_amplitude = 2.0
foretell = "harmonic1"
"""
)
SELF_EXCITED = """
title = "Van der Pol's oscillator"
coordinates = ["x"]
stiffness = [[1.0]]

[[force]]
name = "damper"
deflection = { x = 1.0 }
law = "(x*x - mu)*v"
mu = -0.2

[study]
kind = "self-excited"
parameter = "damper.mu"
from = -0.2
to = 0.4
"""
TORI = (
    CLUTCH
    + """
[study]
kind = "tori"
parameter = "frequency"
from = 1.198
to = 1.194
period = 2
max_period = 2
accuracy = 1e-7
samples = 17
workers = 1
"""
)
SCAN = HEAD + (
    'kind = "scan"\nparameters = ["mean.q1", "stage2.stiffness"]\nfactors = [0.9, 1.1]\npairs = 1\nneighbours = 2\n'
    'starts = 2\nworkers = 1\nlongest = 400\nlisted = [{ "mean.q3" = 0.3 }]\n'
    'claim = [{ motion = "period 3", at = { frequency = 0.45 } }]\n'
)
MODELS = {
    "scan": SCAN.replace('["mean.q1", "stage2.stiffness"]', '["mean.q1"]')
    .replace("pairs = 1", "pairs = 0")
    .replace("0.9, 1.1", "1.01, 1.02"),
    "run-up": RUN_UP,
    "campbell": CAMPBELL,
    "rattle": RATTLE,
    "backbone": BACKBONE,
    "self-excited": SELF_EXCITED,
    "tori": TORI,
    "threshold": THRESHOLD,
    "tolerance": TOLERANCE,
    "rattle-chance": RATTLE_CHANCE,
    "design": DESIGN,
    "settle": SETTLE,
    "sweep": SWEEP,
    "basins": BASINS,
    "regimes": REGIMES,
    "shares": SHARES,
}

SMALL = (
    (scan_work, "CHUNK", 3),
    (run_up_study, "CHUNK", 4),
    (regime_job, "ROWS", 3),
    (basin_job, "CHUNK", 4096),
    (rattle_chance, "CHUNK", 4),
)
"""What makes chunks of so few cells that each job has some."""


def study_of(kind: str) -> Study:
    return check_study(parse_source(MODELS[kind]))


@once
def result_file(kind: str) -> bytes:
    """The result file of a study that nothing interrupts."""
    return file_of(study_of(kind))


def main(kind: str, path: str) -> None:
    """Run a study in small parts, or go on with it; write a line for each part that is safe."""
    for module, name, value in SMALL:
        setattr(module, name, value)
    result = gw.run(study_of(kind), path, resume=Path(path).exists(), report=lambda *_: print("part", flush=True))
    print("complete" if result.complete else "stopped", flush=True)
