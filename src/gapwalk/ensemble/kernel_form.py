"""The form of a kernel: all data on which its source text depends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.scheme import Linear
from gapwalk.model.coefficients import layout_of
from gapwalk.model.structure import Structure


@dataclass(frozen=True)
class Form:
    """The data on which the source text of a kernel depends.

    Parameters
    ----------
    structure
        Structure of the system.
    pattern
        Coefficients of the flow that may differ from zero: bytes of an array of bool.
    modal
        True if the lanes hold modal coordinates, in pairs.
    shared
        True if all lanes have the same coefficients.
    survey
        True if extremes, contacts and largest forces are recorded.
    """

    structure: Structure
    pattern: bytes
    modal: bool
    shared: bool
    survey: bool


def patterns_of(form: Form) -> dict[str, NDArray[np.bool_]]:
    """Mark the entries of a scheme's arrays that may differ from zero."""
    layout, n = layout_of(form.structure), form.structure.size
    linear = Linear(layout, np.frombuffer(form.pattern, dtype=bool).astype(float)[None])
    push, loads, rows = linear.push[0] != 0, linear.loads[0] != 0, linear.deflections[0] != 0
    loads[:, 1:] |= loads[:, 1:].reshape(2 * n, -1, 2)[:, :, ::-1].reshape(2 * n, -1)  # cosine and sine mix over a step
    reach = np.eye(2 * n, dtype=bool) | (linear.matrix[0] != 0)
    for _ in range(2 * n):
        reach = reach @ reach
    patterns = {"transition": reach, "loads": reach @ loads, "weights": reach @ push, "rows": rows}
    patterns["forecast"] = rows @ patterns["weights"]
    if form.modal:
        patterns["transition"] = np.kron(np.eye(n, dtype=bool), np.ones((2, 2), dtype=bool))
        patterns["loads"] = np.broadcast_to(loads.any(axis=0), loads.shape)
        patterns["weights"] = np.broadcast_to(push.any(axis=0), push.shape)
        patterns["rows"] = np.broadcast_to(rows.any(axis=2, keepdims=True), rows.shape)
    return patterns
