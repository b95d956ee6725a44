"""Straight-line code cut into loops: one loop of thousands of lines compiles for seconds and spills registers.

The lines of a step that belong together form an *atom*. Consecutive atoms share a loop over the lanes until it is full.
Values that one loop computes and a later one needs are stored in rows of scratch memory.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from gapwalk.ensemble.kernel_frame import LANES

Atom = Sequence[str]

_FULL = 64  # largest number of products in a loop
_NAME = re.compile(r"\b(?:[zufy]\d+|h\d+_\d+|c\d+)\b")
_TARGET = re.compile(r"^([zufy]\d+|h\d+_\d+) = ")


@dataclass
class Chunk:
    """Atoms that share a loop over the lanes.

    Attributes
    ----------
    lines
        Lines of the atoms.
    needs
        Names that the lines use and do not define, in order of appearance.
    gives
        Names that the lines define.
    keeps
        Defined names that later chunks need.
    """

    lines: list[str] = field(default_factory=list)
    needs: dict[str, None] = field(default_factory=dict)
    gives: dict[str, None] = field(default_factory=dict)
    keeps: list[str] = field(default_factory=list)

    def add(self, atom: Atom) -> None:
        """Append an atom."""
        for line in atom:
            target = _TARGET.match(line)
            for name in _NAME.findall(line[target.end() :] if target else line):
                if name not in self.gives:
                    self.needs[name] = None
            if target:
                self.gives[target[1]] = None
        self.lines += atom

    @property
    def numbers(self) -> list[str]:
        """Names of the scheme's numbers that the lines use."""
        return [name for name in self.needs if name.startswith("c")]

    def loads(self, rows: Mapping[str, int]) -> list[str]:
        """Return the lines that load the other names from their rows."""
        return [f"{name} = S[{rows[name] * LANES} + l]" for name in self.needs if not name.startswith("c")]

    def stores(self, rows: Mapping[str, int]) -> list[str]:
        """Return the lines that store names for later chunks in their rows."""
        return [f"S[{rows[name] * LANES} + l] = {name}" for name in self.keeps]


def chunks_of(atoms: Sequence[Atom]) -> list[Chunk]:
    """Group consecutive atoms in chunks of limited size."""
    chunks, size = [Chunk()], 0
    for atom in atoms:
        cost = sum(line.count("*") for line in atom)
        if chunks[-1].lines and size + cost > _FULL:
            chunks.append(Chunk())
            size = 0
        chunks[-1].add(atom)
        size += cost
    later: set[str] = set()
    for chunk in reversed(chunks):
        chunk.keeps = [name for name in chunk.gives if name in later]
        later |= set(chunk.needs)
    return chunks
