"""Reduced systems against closed forms, against SciPy, and against the full system at rest."""

import numpy as np
import pytest
import scipy.linalg

from gapwalk import Contact, Harmonic, Stage, System, backlash, reduce
from gapwalk.errors import ModelError
from gapwalk.reduction.reduction import flexibility_of
from gapwalk.reduction.reduction_error import matrices_of
from tests.reduction.chains import rod, stiffness_of


def chain(size: int, contact: int, **changes) -> System:
    """A chain of unit masses and springs between walls, with a gap at one mass, driven there."""
    names = tuple(f"q{index}" for index in range(size))
    given = {
        "stiffness": stiffness_of(size),
        "contacts": [backlash("gap", {names[contact]: 1.0}, 0.1)],
        "harmonics": [Harmonic(1.0, {names[contact]: 1.0})],
    }
    return System(names, **(given | changes))


def natural(system: System) -> np.ndarray:
    """Natural frequencies with open contacts."""
    squares = scipy.linalg.eigh(system.matrix("stiffness"), system.matrix("mass"), eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0))


def at_rest(system: System, load: np.ndarray) -> np.ndarray:
    """Deflections of the contacts under a constant load."""
    deflections = matrices_of(system).deflections
    return deflections @ np.linalg.solve(system.matrix("stiffness"), load)


def test_frequencies_are_those_of_the_chain() -> None:
    """w_k = 2 sin(k pi / 2(N+1)); a basis gives upper bounds, and they fall with its size (Rayleigh and Ritz)."""
    exact = 2.0 * np.sin(np.arange(1, 41) * np.pi / 82.0)
    errors = []
    for modes in (4, 8, 16):
        found = natural(reduce(chain(40, 12), modes=modes, up_to=0.1).system)
        assert len(found) == modes + 1
        errors.append(found - exact[: modes + 1])
        assert errors[-1].min() > -1e-12
    assert (errors[1][:5] < errors[0] + 1e-12).all()
    assert errors[0][:3].max() < 1e-3
    assert errors[2][:3].max() < 0.02 * errors[0][:3].max()
    assert (errors[2][:8] < 2e-3 * exact[:8]).all()


def test_the_modes_are_those_of_the_two_parts_beside_the_kept_mass() -> None:
    """Held at mass 12 of 40, a chain falls into two chains between walls, of 12 and of 27 masses."""
    parts = [2.0 * np.sin(np.arange(1, n + 1) * np.pi / (2.0 * (n + 1))) for n in (12, 27)]
    reduction = reduce(chain(40, 12), modes=20, up_to=0.1)
    assert reduction.frequencies == pytest.approx(np.sort(np.concatenate(parts))[:20], abs=1e-10)
    assert reduction.kept == ("q12",)
    assert reduction.system.coordinates == ("q12", *(f"mode{k}" for k in range(1, 21)))


def test_the_blocks_are_craig_and_bampton_s() -> None:
    """Stiffness: condensed at rest, 1/13 + 1/28 of the springs on both sides; no coupling; unit modal masses."""
    system = reduce(chain(40, 12), modes=3, up_to=0.1).system
    stiffness, mass = system.matrix("stiffness"), system.matrix("mass")
    assert stiffness[0, 0] == pytest.approx(1.0 / 13.0 + 1.0 / 28.0)
    assert not stiffness[0, 1:].any()
    np.testing.assert_array_equal(mass[1:, 1:], np.eye(3))
    shape = np.concatenate((np.arange(1, 14) / 13.0, np.arange(27, 0, -1) / 28.0))
    assert mass[0, 0] == pytest.approx(shape @ shape)


def test_with_all_modes_nothing_is_changed() -> None:
    full = rod(12, 2)
    reduction = reduce(full, modes=100, up_to=2.0)
    assert reduction.system.size == 12
    assert reduction.error < 1e-10
    assert natural(reduction.system) == pytest.approx(natural(full))
    exact, found = (flexibility_of(matrices_of(each), np.array([0.3, 1.7])) for each in (full, reduction.system))
    assert found.contacts == pytest.approx(exact.contacts, abs=1e-12)
    assert found.loads == pytest.approx(exact.loads, abs=1e-12)


def test_the_error_is_the_largest_difference_of_the_flexibility() -> None:
    """On a grid of its own, with matrices inverted: nowhere up to the highest frequency is the error exceeded."""
    full = rod(30, 2)
    reduction = reduce(full, modes=6, up_to=0.8)
    small, worst = reduction.system, 0.0
    for springs in (0.0, 6.0):
        rows = []
        for system in (full, small):
            deflections = matrices_of(system).deflections
            held = system.matrix("stiffness") + springs * deflections.T @ deflections
            rows.append([
                deflections @ np.linalg.solve(
                    held + 1j * w * system.matrix("damping") - w**2 * system.matrix("mass"), deflections.T
                )
                for w in np.linspace(0.003, 0.8, 700)
            ])  # fmt: skip
        size = np.linalg.norm(rows[0], axis=(1, 2))
        off = np.linalg.norm(np.array(rows[1]) - rows[0], axis=(1, 2)) / np.maximum(size, np.median(size))
        worst = max(worst, off.max())
    assert 1e-4 < worst < 1.02 * reduction.error


def test_the_fewest_modes_for_an_error_are_taken() -> None:
    errors = (0.3, 1e-1, 1e-2, 1e-3, 1e-5)
    found = [reduce(rod(60, 2), error=error, up_to=0.5) for error in errors]
    assert all(each.error <= error for each, error in zip(found, errors, strict=True))
    sizes = [each.system.size for each in found]
    assert sizes == sorted(sizes)
    assert sizes[-1] < 45
    assert reduce(rod(60, 2), modes=found[1].modes - 1, up_to=0.5).error > 0.1
    # the response to inertia pays: as many modes alone are worse
    assert reduce(rod(60, 2), modes=found[-1].modes, up_to=0.5).error > 10 * found[-1].error


def test_without_modes_it_is_exact_at_rest() -> None:
    load = np.random.default_rng(1).normal(size=15)
    full = rod(15, 3)
    small = reduce(full, modes=0, up_to=0.5)
    for place in small.basis.kept:
        load = np.eye(15)[place]
        assert at_rest(small.system, small.basis.vectors.T @ load) == pytest.approx(at_rest(full, load), abs=1e-12)


def test_what_acts_on_many_coordinates_brings_its_static_response() -> None:
    """A contact between two means of coordinates, with a force elsewhere; gravity; a shaken base."""
    names = tuple(f"q{index}" for index in range(20))
    weights = np.linspace(0.2, 1.0, 5)
    contact = Contact(
        "gap",
        dict(zip(names[:5], weights, strict=True)),
        (Stage(0.1, 3.0),),
        dict(zip(names[9:14], -weights, strict=True)),
    )
    full = System(
        names,
        stiffness_of(20),
        contacts=[contact],
        mean=dict.fromkeys(names, 0.01),
        harmonics=[Harmonic(1.0, {name: 0.1 * k for k, name in enumerate(names)}), Harmonic(0.5, {"q17": 1.0}, 2)],
    )
    reduction = reduce(full, modes=0, up_to=0.1)
    assert reduction.kept == ("q17",)
    assert reduction.system.size == 1 + 4  # deflection, force, gravity, the base
    matrices = matrices_of(full)
    for load in (*matrices.loads.T, *matrices.forces.T, *matrices.deflections):
        expected = at_rest(full, load)
        assert at_rest(reduction.system, reduction.basis.vectors.T @ load) == pytest.approx(expected, abs=1e-11)
    small = matrices_of(reduction.system)
    assert small.mass.toarray()[1:, 1:] == pytest.approx(np.eye(4), abs=1e-12)


def test_a_free_chain_moves_as_a_whole() -> None:
    names = tuple(f"q{index}" for index in range(30))
    gap = backlash("gap", {"q3": 1.0, "q20": -1.0}, 0.1)
    full = System(
        names, stiffness_of(30, free=True), contacts=[gap], harmonics=[Harmonic(1.0, {"q3": 1.0, "q20": -1.0})]
    )
    reduction = reduce(full, modes=8, up_to=0.1)
    assert reduction.kept == ("q3", "q20")
    found = natural(reduction.system)
    assert found[0] == pytest.approx(0.0, abs=1e-7)
    assert found[1:4] == pytest.approx(2.0 * np.sin(np.arange(1, 4) * np.pi / 60.0), rel=5e-3)
    whole = np.linalg.lstsq(reduction.basis.vectors, np.ones(30), rcond=None)[0]
    assert reduction.basis.vectors @ whole == pytest.approx(np.ones(30), abs=1e-10)
    assert whole @ reduction.system.matrix("mass") @ whole == pytest.approx(30.0)


def test_a_part_that_nothing_holds_keeps_a_coordinate() -> None:
    names = tuple(f"q{index}" for index in range(12))
    stiffness = scipy.linalg.block_diag(stiffness_of(6), stiffness_of(6, free=True))
    full = System(
        names, stiffness, contacts=[backlash("gap", {"q2": 1.0}, 0.1)], harmonics=[Harmonic(1.0, {"q2": 1.0})]
    )
    reduction = reduce(full, modes=2, up_to=0.1)
    assert len(reduction.kept) == 2
    assert reduction.kept[1] in names[6:]
    assert natural(reduction.system)[0] == pytest.approx(0.0, abs=1e-7)


def test_only_contacts_may_hold_a_system() -> None:
    names = tuple(f"q{index}" for index in range(25))
    gaps = [backlash(f"gap{k}", {name: 1.0}, 0.0, 2.0) for k, name in enumerate((names[0], names[-1]))]
    full = System(
        names, stiffness_of(25, free=True), 0.02 * np.eye(25), contacts=gaps, harmonics=[Harmonic(1.0, {"q8": 1.0})]
    )
    reduction = reduce(full, error=1e-3, up_to=0.05)
    held = []
    for system in (full, reduction.system):
        deflections = matrices_of(system).deflections
        stiffness = system.matrix("stiffness") + 2.0 * deflections.T @ deflections
        held.append(np.sqrt(scipy.linalg.eigh(stiffness, system.matrix("mass"), eigvals_only=True)))
    assert held[1][:4] == pytest.approx(held[0][:4], rel=1e-3)
    assert reduction.system.size < 15


def test_named_coordinates_are_kept_and_names_do_not_clash() -> None:
    full = System(
        ("mode1", "b", "c", "d"),
        stiffness_of(4),
        contacts=[backlash("mode2", {"mode1": 1.0}, 0.1)],
        harmonics=[Harmonic(1.0, {"mode1": 1.0})],
    )
    reduction = reduce(full, modes=2, up_to=0.1, keep=["d"])
    assert reduction.system.coordinates == ("mode1", "d", "mode_1", "mode_2")


def test_nothing_to_leave_out_and_no_contact_are_no_trouble() -> None:
    full = chain(4, 1)
    everything = reduce(full, up_to=1.0, keep=full.coordinates)
    assert everything.system.coordinates == full.coordinates
    assert everything.error < 1e-12
    assert natural(everything.system) == pytest.approx(natural(full))
    linear = reduce(chain(9, 1, contacts=()), modes=4, up_to=0.3)
    assert linear.error == 0.0
    assert natural(linear.system)[0] == pytest.approx(2.0 * np.sin(np.pi / 20.0), rel=1e-3)


def test_lanczos_finds_the_same_modes(monkeypatch) -> None:
    full = rod(80, 2)
    dense = reduce(full, modes=9, up_to=0.5)
    monkeypatch.setattr("gapwalk.reduction.reduction._DENSE", 10)
    sparse = reduce(full, modes=9, up_to=0.5)
    assert sparse.frequencies == pytest.approx(dense.frequencies, rel=1e-9)
    assert sparse.error == pytest.approx(dense.error, rel=1e-5)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"modes": 3, "error": 0.1}, "give one of them"),
        ({"modes": -1}, "an integer >= 0"),
        ({"modes": 2.5}, "an integer >= 0"),
        ({"error": 0.0}, "from 1e-08 to 1"),
        ({"error": "small"}, "from 1e-08 to 1"),
        ({"up_to": -1.0}, "it must be a number > 0"),
        ({"keep": ["q99"]}, "did you mean"),
        ({"keep": "q3"}, 'write keep=["q3"]'),
    ],
)
def test_an_option_that_makes_no_sense_is_refused(options, words: str) -> None:
    with pytest.raises(ModelError) as caught:
        reduce(rod(20), **options)
    assert words in str(caught.value)


@pytest.mark.parametrize("which", ["mass", "stiffness"])
def test_matrices_that_are_not_symmetric_are_refused(which: str) -> None:
    with pytest.raises(ModelError, match=f"the {which} matrix is not symmetric"):
        reduce(rod(20).at({f"{which}.q1.q2": 0.3}))
