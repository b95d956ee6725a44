"""Save a result as one HTML file that opens anywhere, without a network."""

from __future__ import annotations

import os

from gapwalk.errors import ModelError
from gapwalk.explorer.saved.blob import Blob
from gapwalk.explorer.saved.bundle import bundle
from gapwalk.explorer.saved.content import content_of
from gapwalk.explorer.saved.saved_branches import Found, lines_of
from gapwalk.studies.export import write_whole
from gapwalk.studies.options import BranchOptions
from gapwalk.studies.result import Result


def save_html(
    found: Found,
    path: str | os.PathLike[str],
    *,
    measure: str | None = None,
    title: str | None = None,
    motions: int = 400,
) -> None:
    """Save what was found as one HTML file with clickable points, which opens in any browser, without a network.

    The diagram zooms, its axes can be chosen, and a click on a point (or the arrow keys) shows its motion: moving
    parts, history, phase portrait, force-deflection loop, multipliers, contact log, and its sound.

    Parameters
    ----------
    found
        A result of branches, a branch, a diagram, a family, a settled motion or an orbit.
    path
        The file to write.
    measure
        What the diagram shows first, as in `Branch.plot`; by default what the study names.
    title
        Of the page; by default that of the study.
    motions
        How many points of the branches have their motions in the file; about 2 kB each for two coordinates. Of
        more points every second (third, ...) has. All special points have theirs besides.

    Raises
    ------
    ModelError
        If there are no branches and no motion in it, or there is no such measure.
    StoreError
        If the file cannot be written.
    """
    if motions < 1:
        raise ModelError(f"motions is {motions}; it must be at least 1, as in motions=400")
    lines = lines_of(found)
    if isinstance(found, Result):
        title = found.title if title is None else title
        measure = measure or (found.options.measure if isinstance(found.options, BranchOptions) else None)
    blob = Blob()
    shown = content_of(lines, measure or "half", title or "A result", motions, blob)
    write_whole(path, bundle(shown["title"], shown, blob.content))
