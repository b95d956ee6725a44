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
        self._file, self._count, self._search = file, len(known.limbs), known.search

    def add(self, diagram: Diagram, limb: Limb) -> None:
        """Write the branch that was added to a diagram last.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        self._file.write(BRANCH.entry(limb, self._count), *self._state(diagram, finished=False))
        self._count, self._search = self._count + 1, diagram.search

    def finish(self, diagram: Diagram, *, finished: bool) -> None:
        """Write what is known of the diagram as a whole, and whether nothing is left to do. Errors as `add`."""
        self._file.write(*self._state(diagram, finished))
        self._search = diagram.search

    def _state(self, diagram: Diagram, finished: bool):
        """What is known of the diagram as a whole; its search only when it is new, for it may be long."""
        yield STATE.entry(DiagramState(replace(diagram, limbs=(), search=None), finished))
        if diagram.search is not None and diagram.search is not self._search:
            yield SEARCH.entry(diagram.search)


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
