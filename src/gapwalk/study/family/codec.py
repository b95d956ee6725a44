"""The parts of a family as arrays, and back bit for bit: what a file keeps of them."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.model.system import System
from gapwalk.orbit.floquet import Instability
from gapwalk.study.family.joint import Fate, Joint, Passage
from gapwalk.study.family.member import Member, Place
from gapwalk.study.store.cell_store import Arrays, text_array, text_value
from gapwalk.study.store.codec import PointCodec
from gapwalk.study.store.orbit_codec import Packed
from gapwalk.study.store.plain import end_of, plain_end


def member_arrays(member: Member, system: System, *, balanced: bool) -> Arrays:
    """A member of a system.

    Parameters
    ----------
    member
        The member.
    system
        Its system.
    balanced
        Whether its orbits were found by harmonic balance.
    """
    arrays: dict[str, NDArray[Any]] = {}
    about = []
    for number, branch in enumerate(member.branches):
        unknowns = len(branch.points[0].x)
        codec = PointCodec(system, branch.parameter, branch.period, unknowns, balanced=balanced)
        special_points = [special.point for special in branch.special_points]
        for what, points in (("points", branch.points), ("special", special_points)):
            arrays |= _packed_arrays(f"{what}{number}", codec.pack(points))
        about.append(
            {
                "parameter": branch.parameter,
                "period": branch.period,
                "unknowns": unknowns,
                "count": len(branch.points),
                "special_points": [_plain_special(special) for special in branch.special_points],
                "ends": [plain_end(end) for end in branch.ends],
            }
        )
    whole = {
        "number": member.number,
        "value": member.value,
        "notes": list(member.notes),
        "failures": list(member.failures),
        "branches": about,
    }
    return {"about": text_array(whole), **arrays}


def member_of(arrays: Arrays, system: System, *, balanced: bool) -> Member:
    """The member of its arrays; any of LookupError, TypeError and ValueError if there is none in them."""
    about = text_value(arrays["about"])
    branches = tuple(
        _branch(each, number, arrays, system, balanced=balanced) for number, each in enumerate(about["branches"])
    )
    notes, failures = (tuple(str(text) for text in about[key]) for key in ("notes", "failures"))
    return Member(int(about["number"]), float(about["value"]), branches, notes, failures)


def joint_arrays(joints: tuple[Joint, ...]) -> Arrays:
    """What becomes of special points between two members."""
    return {"joints": text_array([asdict(joint) for joint in joints])}


def joints_of(arrays: Arrays) -> tuple[Joint, ...]:
    """The joints of their arrays; errors as `member_of`."""
    return tuple(_joint(plain) for plain in text_value(arrays["joints"]))


def _branch(about: Any, number: int, arrays: Arrays, system: System, *, balanced: bool) -> Branch:
    parameter, period = str(about["parameter"]), int(about["period"])
    codec = PointCodec(system, parameter, period, int(about["unknowns"]), balanced=balanced)
    points = codec.unpack(_packed(arrays, f"points{number}"), int(about["count"]))
    plain = about["special_points"]
    located = codec.unpack(_packed(arrays, f"special{number}"), len(plain))
    special_points = tuple(
        SpecialPoint(
            Kind(each["kind"]),
            point,
            Instability(*(int(count) for count in each["before"])),
            Instability(*(int(count) for count in each["after"])),
            float(each["uncertainty"]),
            str(each["contact"]),
            str(each["nature"]),
            float(each["judged"]),
        )
        for each, point in zip(plain, located, strict=True)
    )
    return Branch(parameter, period, tuple(points), special_points, tuple(end_of(end) for end in about["ends"]))


def _plain_special(special: SpecialPoint) -> dict[str, Any]:
    return {
        "kind": special.kind.value,
        "before": list(special.before),
        "after": list(special.after),
        "uncertainty": special.uncertainty,
        "contact": special.contact,
        "nature": special.nature,
        "judged": special.judged,
    }


def _packed_arrays(name: str, packed: Packed) -> dict[str, NDArray[Any]]:
    data, events = (np.frombuffer(part, dtype=np.uint8) for part in packed)
    return {f"{name}.data": data, f"{name}.events": events}


def _packed(arrays: Arrays, name: str) -> Packed:
    return arrays[f"{name}.data"].tobytes(), arrays[f"{name}.events"].tobytes()


def _joint(plain: Any) -> Joint:
    begin, end, at = plain["begin"], plain["end"], plain["at"]
    return Joint(
        Kind(plain["kind"]),
        str(plain["contact"]),
        int(plain["period"]),
        Fate(plain["fate"]),
        _place(begin),
        None if end is None else _place(end),
        None if at is None else _pair(at),
        str(plain["event"]),
        tuple(_pair(point) for point in plain["curve"]),
        tuple(
            Passage(str(each["kind"]), float(each["first"]), float(each["value"]), str(each["contact"]))
            for each in plain["passages"]
        ),
        str(plain["detail"]),
    )


def _place(plain: Any) -> Place:
    member, branch, special = plain
    return Place(int(member), int(branch), int(special))


def _pair(plain: Any) -> tuple[float, float]:
    first, second = plain
    return float(first), float(second)
