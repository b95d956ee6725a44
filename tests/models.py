"""Texts of model files that tests of several rooms share: the systems, to which a test adds what is to be studied."""

import os

from gapwalk.model.model_file import check_model, has_pace, in_order
from gapwalk.model.model_source import read_source
from gapwalk.model.problems import ModelFileError
from gapwalk.model.system import System

STOP = """\
title = "A stop"
coordinates = ["x"]
stiffness = [1.0]
damping = [0.05]
frequency = 0.7

[[contact]]
name = "stop"
deflection = { x = 1.0 }
clearance = 1.0
stiffness = 20.0
side = "positive"
impact_damping = 0.1

[[harmonic]]
amplitude = 0.2
acts_on = { x = 1.0 }
"""
"""A mass that is walked in a moment."""

CLUTCH = """\
title = "Clutch"
coordinates = ["q1", "q3"]
stiffness = [[0.1, -0.6], [-0.06, 1.1]]
damping = [[0.04, -0.04], [-0.04, 0.06]]
mean = { q1 = 0.25, q3 = 0.25 }

[[contact]]
name = "stage2"
deflection = { q1 = 1.0 }
force = { q1 = 0.9, q3 = -0.54 }
clearance = 1.0
stiffness = 1.0
impact_damping = 0.05

[[harmonic]]
amplitude = 0.25
acts_on = { q1 = 1.0 }
"""
"""The clutch of figure 13, without a frequency."""


def response(end: float) -> str:
    """The table of a frequency response of the stop, up to a frequency."""
    return f"""
[study]
kind = "response"
parameter = "frequency"
from = 0.7
to = {end}
measure = "half.x"
"""


def read_system(path: str | os.PathLike[str]) -> System:
    """The system of a model file, whether or not it has a study."""
    source = read_source(path)
    model, problems = check_model(source)
    if not has_pace(source):
        problems.append(source.problem("is missing; write the frequency W of the excitation", ("frequency",)))
    if model is None or problems:
        raise ModelFileError(in_order(problems))
    return model.system
