"""The file of a diagram: each branch is written when it is accepted, whole, with what is known of the diagram."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from gapwalk.bifurcation.diagram import Diagram, Limb
from gapwalk.bifurcation.search import SearchResult
from gapwalk.results.file import Part, Parts
from gapwalk.study.request import Keeper


class DiagramState(NamedTuple):
    """What is known of a diagram as a whole, without its branches and its search; and whether nothing is left to do."""

    diagram: Diagram
    finished: bool


BRANCH = Part("branch", Limb, numbered=True)
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
        branches = (BRANCH.entry(limb, number) for number, limb in enumerate(diagram.limbs[count:], start=count))
        state = STATE.entry(DiagramState(replace(diagram, limbs=(), search=None), finished))
        # the search only when it is new, for it may be long
        is_new = diagram.search is not None and diagram.search is not self._search
        search = (SEARCH.entry(diagram.search),) if is_new else ()
        self._file.write(*branches, state, *search)
        self._search = diagram.search


def stored_diagram(parts: Parts) -> DiagramState:
    """The diagram of a file; a ValueError if it makes no sense."""
    limbs: list[Limb] = []
    for number, limb in parts.all(BRANCH):
        known = {each.name: len(each.branch.special_points) for each in limbs}
        if number != len(limbs) or limb.name in known:
            raise ValueError(f"branch {limb.name:.60} has no place in the tree")
        if any(not 0 <= origin.special < known.get(origin.parent, 0) for origin in limb.origins):
            raise ValueError(f"branch {limb.name} begins or ends nowhere")
        limbs.append(limb)
    state = parts.one(STATE)
    diagram = replace(state.diagram, limbs=tuple(limbs), search=parts.get(SEARCH))
    if not limbs and diagram.search is None:  # which may have led to nothing new
        raise ValueError("it holds no branch")
    if diagram.max_period is not None and diagram.max_period < 1:
        raise ValueError(f"its longest period is {diagram.max_period}")
    return state._replace(diagram=diagram)
