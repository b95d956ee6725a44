"""Records can be compared, looked for in lists, and kept in sets: those that hold arrays too."""

import copy
import importlib
import pickle
import pkgutil
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

import pytest

import gapwalk as gw
from gapwalk.notebook import Shown
from tests.release.names import public_things
from tests.systems import clutch


@cache
def modules() -> list[Any]:
    names = [each.name for each in pkgutil.walk_packages(gw.__path__, "gapwalk.") if "__main__" not in each.name]
    return [importlib.import_module(name) for name in names]


@cache
def records() -> list[Any]:
    """All dataclasses of gapwalk."""
    found = {each for module in modules() for each in vars(module).values() if isinstance(each, type)}
    ours = (each for each in found if is_dataclass(each) and each.__module__.startswith("gapwalk."))
    return sorted(ours, key=lambda each: (each.__module__, each.__qualname__))


def test_no_record_compares_arrays() -> None:
    by_content = [each for each in records() if each.__eq__ is not object.__eq__]
    assert len(by_content) > 100
    guilty = [
        f"{each.__module__}.{each.__qualname__}.{field.name}"
        for each in by_content
        for field in fields(each)
        if field.compare and "NDArray" in str(field.type) and "Callable" not in str(field.type)
    ]
    assert not guilty, f"write eq=False: `==` of arrays is no truth value: {guilty}"


def test_every_public_record_is_hashable() -> None:
    public = {thing for thing in public_things().values() if isinstance(thing, type)}
    met: list[Any] = [each for each in records() if each in public or issubclass(each, Shown)]
    assert len(met) > 40
    guilty = [
        f"{each.__module__}.{each.__qualname__}.{field.name}"
        for each in met
        if each.__hash__ is not object.__hash__
        for field in fields(each)
        if field.hash is not False and field.compare and str(field.type).startswith(("list", "dict", "Mapping", "set"))
    ]
    assert not guilty, f"write field(hash=False), or a tuple: {guilty}"
    assert [each for each in met if each.__hash__ is None] == []


@cache
def samples() -> dict[str, Any]:
    """Records as users meet them, by a name."""
    system = clutch()
    train = gw.train.Train(
        [gw.train.Inertia("engine", 1.0), gw.train.Inertia("load", 2.0)],
        [gw.train.Shaft("shaft", ("engine", "load"), stiffness=1.0, damping=0.1)],
        mean={"engine": 0.1},
        harmonics=[gw.Harmonic(0.2, {"engine": 1.0})],
    )
    orbit = gw.find_orbit(system.at({"frequency": 1.0}))
    branch = gw.follow(orbit, "frequency", 0.55)
    fold = next(each for each in branch.special_points if each.kind is not gw.Kind.BRANCH_POINT)
    locus = gw.follow_locus(fold, "frequency", "mean.q3", ((0.5, 1.0), (0.24, 0.26)))
    return {
        "system": system,
        "contact": gw.backlash("gap", {"q1": 1.0}, 1.0),
        "contact with a list of stages": gw.Contact("gap", {"q1": 1.0}, [gw.Stage(1.0)]),  # type: ignore[arg-type]
        "harmonic": gw.Harmonic(0.2, {"q1": 1.0}),
        "train": train,
        "plane": gw.analysis.Plane({"q1": 1.0}),
        "orbit": orbit,
        "balanced orbit": gw.find_orbit(system.at({"frequency": 1.0}), method=gw.Balance(harmonics=8)),
        "point": branch.points[3],
        "special point": fold,
        "end": branch.ends[-1],
        "branch": branch,
        "locus": locus,
        "locus point": locus.points[0],
        "motion": orbit.motion(),
        "modes": gw.find_modes(system),
        "rest": gw.find_equilibria(system),
        "hysteresis": gw.analysis.hysteresis(system, 1.5, "stage2"),
        "spectrum": gw.analysis.spectrum(orbit, "q1"),
        "settled": gw.settle(system.at({"frequency": 1.0})),
    }


MODELS = ("system", "contact", "contact with a list of stages", "harmonic", "train", "plane", "end")
WALKED = ("orbit", "balanced orbit", "point", "special point", "branch", "locus", "locus point", "motion")
FOUND = (*WALKED, "modes", "rest", "hysteresis", "spectrum", "settled")


@pytest.mark.parametrize("name", MODELS + FOUND)
def test_a_record_can_be_compared_and_kept_in_a_set(name: str) -> None:
    record = samples()[name]
    other, again = pickle.loads(pickle.dumps(record)), copy.copy(record)
    assert record == record  # noqa: PLR0124
    assert (record == other) is (name in MODELS)  # what was asked is equal by content, what was found is itself only
    assert (record != other) is (name not in MODELS)
    assert (hash(record) == hash(other)) or record != other
    assert record in {record, other, again}
    assert [other, again, record].index(record) >= 0
    assert record != 5


def test_a_result_can_be_compared_and_kept_in_a_set(tmp_path) -> None:
    model = tmp_path / "a.toml"
    model.write_text(
        'coordinates = ["x"]\nstiffness = [[1.0]]\ndamping = [[0.1]]\n'
        "[[harmonic]]\norder = 1\namplitude = 0.5\nacts_on = { x = 1.0 }\n"
        '[study]\nkind = "response"\nparameter = "frequency"\nfrom = 2.0\nto = 1.9\n'
    )
    study = gw.read_study(model)
    result, other = gw.run(study), gw.run(study)
    assert result != other
    assert result.study == other.study
    assert len({result, other, result}) == 2
    assert hash(study) == hash(other.study)
    assert result.branches[0] in {result.branches[0], *other.branches}
