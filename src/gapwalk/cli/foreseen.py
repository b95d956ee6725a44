"""Processes that the studies of a model file will need: they start while this one loads what it needs itself."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

_SHARED = {
    "diagram": "diagram_study",
    "map": "map_study",
    "locus": "locus_study",
    "family": "family_study",
    "sweep": "sweep_study",
    "basins": "basin_study",
    "shares": "share_study",
    "regimes": "regime_study",
    "tolerance": "tolerance_study",
    "rattle": "rattle_study",
    "tori": "tori_study",
    "scan": "scan_study",
    "threshold": "threshold_study",
    "run-up": "run_up_study",
    "design": "design_study",
    "backbone": "backbone_study",
    "self-excited": "self_excited_study",
    "rattle-chance": "rattle_chance",
}
"""Kinds of study whose work several processes share, each with its module; the registry would load NumPy."""

_KIND = re.compile(r"""^\s*kind\s*=\s*["']([a-z-]+)["']""", re.MULTILINE)
_ALONE = re.compile(r"^\s*workers\s*=\s*1\s*(#.*)?$", re.MULTILINE)
_MOST = 1_000_000  # characters that are looked at


def foreseen_modules(text: str) -> list[str]:
    """Return the modules of the kinds of study in the text of a model file whose work processes will share."""
    # The text is not parsed: what is wrong here costs or saves time, and nothing else.
    kinds = dict.fromkeys(_KIND.findall(text))
    return [] if _ALONE.search(text) else [f"gapwalk.studies.{_SHARED[kind]}" for kind in kinds if kind in _SHARED]


def foresee(file: Path) -> None:
    """Begin to start the processes that the studies of a model file will need, if there are cores for them."""
    from gapwalk.parallel.processes import local_cores, start_server

    text = ""
    with suppress(OSError, UnicodeDecodeError):  # whoever reads the file says what is wrong with it
        if file.is_file():
            with file.open(encoding="utf-8") as content:
                text = content.read(_MOST)
    modules = foreseen_modules(text)
    if modules and local_cores() > 1:
        start_server(["gapwalk.studies.runner", *modules])
