"""Contacts refuse stages and damping that make no sense."""

import pytest

from gapwalk.errors import ModelError
from gapwalk.model import Contact, Side, Stage, backlash, stop

X = {"x": 1.0}


def test_backlash_is_one_symmetric_stage() -> None:
    contact = backlash("gap", X, 0.5, 2.0)
    assert contact.stages == (Stage(0.5, 2.0, 0.0, Side.BOTH),)
    assert contact.law.name == "elastic"
    damped = backlash("gap", X, 0.5, 2.0, impact_damping=0.1)
    assert (damped.law.name, damped.numbers) == ("hunt-crossley", {"impact_damping": 0.1})


def test_a_stop_is_a_stage_on_one_side() -> None:
    assert stop("wall", X, 0.5, 2.0).stages == (Stage(0.5, 2.0, 0.0, Side.POSITIVE),)
    damped = stop("wall", X, 0.5, 2.0, side="negative", impact_damping=0.1)
    assert damped.stages == (Stage(0.5, 2.0, 0.0, Side.NEGATIVE),)
    assert (damped.law.name, damped.numbers) == ("hunt-crossley", {"impact_damping": 0.1})


@pytest.mark.parametrize(("side", "signs"), [(Side.BOTH, (1, -1)), (Side.POSITIVE, (1,)), (Side.NEGATIVE, (-1,))])
def test_a_side_has_its_signs(side: Side, signs: tuple[int, ...]) -> None:
    assert side.signs == signs


def test_stages_on_different_sides_need_no_order() -> None:
    stages = (Stage(2.0, side=Side.POSITIVE, name="a"), Stage(1.0, side=Side.NEGATIVE, name="b"))
    assert Contact("gap", X, stages).stages == stages


@pytest.mark.parametrize(
    ("stages", "options", "message"),
    [
        ((), {}, "it has no stage"),
        ((Stage(-1.0),), {}, "clearance is -1.0; it must be a number >= 0"),
        ((Stage(float("nan")),), {}, "clearance is nan"),
        ((Stage(1.0, name="a"), Stage(0.5, name="b")), {}, "clearance 0.5 follows 1.0"),
        ((Stage(1.0, name="a"), Stage(1.0, name="b")), {}, "list the stages from the inside out"),
        ((Stage(1.0), Stage(2.0)), {}, "need names that differ"),
        ((Stage(1.0, name="a"), Stage(2.0, name="a")), {}, "need names that differ"),
        ((Stage(1.0, name="a.b"), Stage(2.0, name="c")), {}, "stage name 'a.b'"),
        # The parameter gap.deflection.clearance would have two meanings for a coordinate called clearance.
        ((Stage(1.0, name="deflection"), Stage(2.0, name="c")), {}, "stage name 'deflection'"),
        ((Stage(1.0),), {"impact_damping": 0.1}, 'write law = "hunt-crossley"'),
        ((Stage(1.0),), {"viscous_damping": 0.1}, 'write law = "viscous"'),
        ((Stage(1.0),), {"viscous_damping": 0.1, "law": "hunt-crossley"}, "law is 'hunt-crossley'"),
        ((Stage(1.0, -1.0),), {"law": "viscous"}, "the slope of the force falls to -1.0"),
    ],
)
def test_what_makes_no_sense_is_refused(stages, options, message: str) -> None:
    with pytest.raises(ModelError, match=r"contact 'gap': ") as error:
        Contact("gap", X, stages, **options)
    assert message in str(error.value)


def test_a_side_may_be_a_text() -> None:
    assert Stage(1.0, side="positive").side is Side.POSITIVE  # type: ignore
    with pytest.raises(ModelError, match="side is 'left'; write 'both', 'positive', 'negative'"):
        Stage(1.0, side="left")  # type: ignore


def test_an_undamped_contact_may_soften() -> None:
    stages = (Stage(1.0, 1.0, name="a"), Stage(2.0, -3.0, name="b"))
    assert Contact("gap", X, stages).stages == stages
