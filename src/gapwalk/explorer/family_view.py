"""View of a family on the page: the branches of all members, and their special points joined from one to the next."""

from __future__ import annotations

from gapwalk.answers.shown_measure import shown_measure
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Locus
from gapwalk.explorer.answer_view import AnswerView, Json, shown
from gapwalk.model.words import parameter_symbol, parameter_words
from gapwalk.studies.family import Family, SpecialPointPath


@shown(Family)
class FamilyView(AnswerView):
    """The branches over their parameter; in three dimensions also over the quantity in which members differ."""

    script = "record.branches"
    record: Family

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return the branches of all members, named after the values in which these differ."""
        found = self.record
        return [
            (f"{name} at {found.over.name} = {member.value:.6g}", branch)
            for member in found.members
            for name, branch in member.named
        ]

    @property
    def axes(self) -> tuple[str, str]:
        """The parameter, and the measure of the study."""
        found = self.record
        return found.parameter, shown_measure(found.system, getattr(self.finding, "options", None))

    @property
    def parameters(self) -> tuple[str, ...]:
        """The parameters in which members differ."""
        return tuple(name for name in self.record.over.names if name in self.record.system.parameters)

    def sentences(self) -> list[str]:
        """Return the members, and how many special points are joined."""
        found = self.record
        name = parameter_symbol(found.over.name, found.system.units if found.over.name in self.parameters else None)
        values = [member.value for member in found.members]
        ends = f"{len(values)} values of {name} from {values[0]:.6g} to {values[-1]:.6g}"
        several = [path for path in found.point_paths if len(path.places) > 1]
        return [f"{ends}: {len(several)} special points go on through members, each joined to the next"]

    def drawn(self) -> Json:
        """Return the depth of each curve in three dimensions, and the paths of special points."""
        found, name = self.record, self.record.over.name
        words = parameter_words(name, found.system.units) if name in self.parameters else name
        values = [member.value for member in found.members for _ in member.branches]
        places: dict[tuple[int, int], int] = {}
        for member in found.members:
            for index in range(len(member.branches)):
                places[member.number, index] = len(places)
        return {
            "within": {found.parameter: list(found.within)},
            "space": {"words": words, "values": values},
            "ribs": [_rib(path, places) for path in found.point_paths if len(path.places) > 1],
        }


def _rib(path: SpecialPointPath, places: dict[tuple[int, int], int]) -> Json:
    """Return the special points of a path by the indices of their curves; inexact where a connection is a guess."""
    points = [[places[place.member, place.branch], place.special] for place in path.places]
    return {"kind": path.kind.value, "text": path.name, "exact": path.exact, "points": points}
