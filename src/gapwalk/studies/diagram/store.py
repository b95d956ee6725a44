"""The file of a diagram: each branch is written when it is accepted, whole, with what is known of the diagram."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.bifurcation.isolated import SearchResult
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.request import Keeper


class DiagramState(NamedTuple):
    """What is known of a diagram as a whole, without its branches and its search; and whether nothing is left to do."""

    diagram: Diagram
    finished: bool


BRANCH = Part("branch", DiagramBranch, numbered=True)
STATE = Part("diagram", DiagramState)
SEARCH = Part("search", SearchResult)


class DiagramStore:
    """Writes the file of a diagram that is being computed.

    Parameters
    ----------
    file
        The file.
    known
        The diagram as far as the file has it.
    """

    def __init__(self, file: Keeper, known: Diagram) -> None:
        self._file, self._search = file, known.search

    def write(self, diagram: Diagram, *, finished: bool = False) -> None:
        """Write the branches that the file has not, what is known of the whole, and whether nothing is left to do.

        After Ctrl-C the file may lack a branch that was accepted just before.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        count = self._file.count(BRANCH)
        branches = (BRANCH.entry(member, number) for number, member in enumerate(diagram.members[count:], start=count))
        state = STATE.entry(DiagramState(replace(diagram, members=(), search=None), finished))
        # the search only when it is new, for it may be long
        is_new = diagram.search is not None and diagram.search is not self._search
        search = (SEARCH.entry(diagram.search),) if is_new else ()
        self._file.write(*branches, state, *search)
        self._search = diagram.search


def stored_diagram(parts: Parts) -> DiagramState:
    """The diagram of a file; a ValueError if it makes no sense."""
    members: list[DiagramBranch] = []
    for number, member in parts.all(BRANCH):
        known = {each.name: len(each.branch.special_points) for each in members}
        if number != len(members) or member.name in known:
            raise ValueError(f"branch {member.name:.60} has no place in the tree")
        if any(not 0 <= origin.special < known.get(origin.parent, 0) for origin in member.origins):
            raise ValueError(f"branch {member.name} begins or ends nowhere")
        members.append(member)
    state = parts.one(STATE)
    diagram = replace(state.diagram, members=tuple(members), search=parts.get(SEARCH))
    if not members and diagram.search is None:  # which may have led to nothing new
        raise ValueError("it holds no branch")
    if diagram.max_period is not None and diagram.max_period < 1:
        raise ValueError(f"its longest period is {diagram.max_period}")
    return state._replace(diagram=diagram)
