"""What backbones foretell: births of isolated branches against folds of the forced motions, followed in two parameters.

The birth is where both folds of an isolated branch meet: the lowest amplitude on the locus of its folds.
"""

import numpy as np
import pytest
from scipy.special import ellipk

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.free import island_births as work_balance
from gapwalk.free.island_births import IslandBirth
from tests.tiers import in_campaign, keeps

STIFFNESS, DAMPING = np.array([[2.0, -1.0], [-1.0, 2.0]]), np.array([[0.02, -0.01], [-0.01, 0.02]])
CUBIC = gw.force("spring", {"x": 1.0}, "x*x*x")


def duffing(damping: float) -> gw.System:
    return gw.System(["x"], [1.0], [damping], contacts=[CUBIC], harmonics=[gw.Harmonic(0.1, {"x": 1.0})])


def pair(contact: gw.Contact) -> gw.System:
    load = [gw.Harmonic(0.1, {"a": 1.0})]
    return gw.System(["a", "b"], STIFFNESS, DAMPING, contacts=[contact], harmonics=load)


def lowest_amplitude(orbit: gw.Orbit, birth: IslandBirth) -> float:
    """Follow the isolated branch, which closes, then its fold over frequency and amplitude down to its vertex."""
    w, a = birth.frequency, birth.amplitude
    island = gw.follow(orbit, "frequency", (0.6 * w, 1.6 * w))
    assert island.closed
    fold = island.special("fold")[0]
    locus = gw.follow_locus(fold, "frequency", "harmonic1.amplitude", ((0.6 * w, 1.6 * w), (0.5 * a, 1.5 * a)))
    return min(point.values[1] for point in locus.points)


def test_the_main_resonance_of_a_linear_oscillator():
    """At resonance the amplitude is ``F / (c w)``, exactly."""
    system = gw.System(["x"], [4.0], [0.03], contacts=[], harmonics=[gw.Harmonic(0.1, {"x": 1.0})])
    line = gw.free.backbone(system, 1, options=gw.free.BackboneOptions(largest_amplitude=5.0))
    found = gw.free.foretell(system, line, harmonics=[1])
    assert found.amplitudes[:, 0] == pytest.approx(0.03 * 2.0 * line.half("x"), rel=1e-9)
    assert not found.births


def test_the_work_over_duffings_motions():
    """``x'' + x + x^3 = 0``: the losses are ``c`` times the integral of the squared rate, from the energy alone."""
    system = duffing(0.02)
    line = gw.free.backbone(system, 1, (0.5, 3.0))
    found = gw.free.foretell(system, line, harmonics=[1])
    for point, needed in list(zip(line.points, found.amplitudes[:, 0], strict=True))[10::15]:
        x = np.linspace(0.0, 2.0 * np.pi, 4001)[:-1]  # the phase of a substitution q = X sin
        big = point.amplitude
        q = big * np.sin(x)
        rate = np.sqrt(1.0 + 0.5 * (big**2 + q**2))  # v = X cos x times this
        loss = 0.02 * np.mean(big**2 * np.cos(x) ** 2 * rate) * 2.0 * np.pi
        period = 4.0 * ellipk(big**2 / (2.0 * (1.0 + big**2))) / np.sqrt(1.0 + big**2)
        motion = line.motion(point, 1024)
        first = 2.0 * np.mean(motion.q[:-1, 0] * np.cos(2.0 * np.pi * np.arange(1024) / 1024))
        assert needed == pytest.approx(loss / (np.pi * first), rel=1e-8)
        assert 2.0 * np.pi / point.value == pytest.approx(period, rel=1e-10)


@keeps("0.005-0.0002")
@pytest.mark.parametrize(("damping", "error"), [(0.005, 2e-4), (0.02, 5e-3)])
def test_the_subharmonic_island_of_duffing(damping, error):
    """It is foretold the better, the lighter the damping: the error falls with its square."""
    system = duffing(damping)
    found = gw.free.foretell(system, gw.free.backbone(system, 1, (0.5, 3.0)), harmonics=[1, 2, 3])
    (birth,) = found.births
    assert (birth.harmonic, birth.period, birth.joins) == (3, 3, False)
    there, states = found.starts(birth, 1.3 * birth.amplitude)
    orbit = gw.find_orbit(there, birth.period, states[0])
    assert orbit.measure("half.x") == pytest.approx(birth.point.amplitude, rel=0.2)
    assert birth.amplitude == pytest.approx(lowest_amplitude(orbit, birth), rel=error)


@pytest.mark.parametrize(
    ("contact", "harmonic", "mode"),
    [
        (gw.force("spring", {"a": 1.0}, "x*x*x"), 3, 1),
        in_campaign(gw.force("spring", {"a": 1.0}, "x*x*x"), 3, 2),
        in_campaign(gw.stop("stop", {"a": 1.0}, 1.0, 3.0), 2, 1),
        (gw.stop("stop", {"a": 1.0}, 1.0, 3.0), 2, 2),
    ],
    ids=["duffing-1", "duffing-2", "bilinear-1", "bilinear-2"],
)
def test_islands_of_two_masses_are_where_they_are_foretold(contact, harmonic, mode):
    """Within 2 percent: the search, started there, finds the island above its birth, and nothing of it below."""
    system = pair(contact)
    found = gw.free.foretell(system, gw.free.backbone(system, mode), harmonics=[1, harmonic])
    birth = found.births[0]
    assert birth.period == harmonic
    met = {}
    for share in (0.9, 1.1):
        there, _ = found.starts(birth, share * birth.amplitude)
        options = gw.SearchOptions(
            starts=48, newton_starts=48, periods=birth.period, newton_periods=(birth.period,), box=found.box(birth)
        )
        orbits = gw.search(there, "frequency", [birth.frequency], options=options).found
        met[share] = [each.orbit for each in orbits if each.orbit.period == birth.period]
    assert not met[0.9]
    assert len(met[1.1]) == 2
    assert birth.amplitude == pytest.approx(lowest_amplitude(met[1.1][0], birth), rel=0.02)


def test_equations_that_were_multiplied_foretell_the_same(monkeypatch):
    """Without an energy the left eigenvector of the monodromy matrix takes the place of its gradient."""
    mix = np.array([[1.0, 0.3], [-0.5, 2.0]])
    found = []
    for by in (np.eye(2), mix):
        push = dict(zip("ab", by @ [1.0, 0.0], strict=True))
        system = gw.System(
            ["a", "b"],
            by @ STIFFNESS,
            by @ DAMPING,
            mass=by,
            contacts=[gw.stop("stop", {"a": 1.0}, 1.0, 3.0, force=push)],
            harmonics=[gw.Harmonic(0.1, push)],
        )
        assert work_balance.shows_energy(system) == (by is not mix)
        line = gw.free.backbone(system, 1)
        found.append(gw.free.foretell(system, line, harmonics=[2, 3]).births)
    for one, other in zip(*found, strict=True):
        assert one.amplitude == pytest.approx(other.amplitude, rel=1e-8)
        assert one.frequency == pytest.approx(other.frequency, rel=1e-8)


def test_nothing_is_foretold_at_figure_27():
    """Its islands, at Ω = 0.25, move with 2 Ω = 0.5: below the lowest frequency of its backbones, 0.584 and 1.152."""
    system = gw.paper.case("27")
    for mode, lowest in ((1, 0.584003545), (2, 1.1519547)):
        line = gw.free.backbone(system, mode)
        assert line.values.min() == pytest.approx(lowest, rel=1e-3)
        found = gw.free.foretell(system, line, "harmonic2", [1])
        assert found.needed(0.25, 1) == found.needed(0.255, 1) == ()
        # the load of order 1 has no frequency near them at all
        assert (line.values > 2.0 * 0.255).all()


def test_what_cannot_be_foretold_is_refused():
    system = duffing(0.02)
    line = gw.free.backbone(system, 1, (0.5, 2.0))
    with pytest.raises(ModelError, match="it must be one of harmonic1"):
        gw.free.foretell(system, line, "torque")
    with pytest.raises(ModelError, match="integers from 1 on"):
        gw.free.foretell(system, line, harmonics=[0])
    with pytest.raises(ModelError, match="another system"):
        gw.free.foretell(pair(gw.stop("stop", {"a": 1.0}, 1.0, 3.0)), line)
    found = gw.free.foretell(system, line, harmonics=[3])
    assert found.starts(found.births[0], 0.9 * found.births[0].amplitude)[1] == []
    assert "isolated branches are foretold" in str(found.summary())
    assert len([*found.tables()["amplitudes"]()]) == len(line.points) + 1


@pytest.mark.slow
@pytest.mark.parametrize("starts", [16, in_campaign(64)])
def test_the_island_of_an_internal_resonance(starts):
    """The main resonance of two masses: where modes 1 and 2 exchange energy, a closed branch lies beside it."""
    load = [gw.Harmonic(0.1, {"b": 1.0})]
    stop = gw.stop("stop", {"a": 1.0}, 1.0, 20.0)
    damping = [[0.05, 0.0], [0.0, 0.05]]
    system = gw.System(["a", "b"], [[1.0, -1.0], [-1.0, 2.0]], damping, contacts=[stop], harmonics=load)
    line = gw.free.backbone(system, 1, options=gw.free.BackboneOptions(largest_amplitude=10.0))
    joins, birth = gw.free.foretell(system, line, harmonics=[1]).births
    assert (joins.joins, birth.joins, birth.period) == (True, False, 1)
    found = gw.free.foretell(system, line, harmonics=[1])
    there, _ = found.starts(birth, 1.05 * birth.amplitude)
    main = gw.follow(gw.find_orbit(there, frequency=0.3), "frequency", 1.2)
    options = gw.SearchOptions(starts=starts, newton_starts=starts, newton_periods=(1,), box=found.box(birth))
    new = gw.search(there, "frequency", [birth.frequency], known=[main], options=options).new
    assert new
    assert birth.amplitude == pytest.approx(lowest_amplitude(new[0].orbit, birth), rel=0.02)
