"""Bodies of a train without inertia: nodes between shafts, whose equations are of first order.

With the deflections w of the coordinates as a node turns by itself as columns of W, ``x = y + g W (W^T W)^-1 W^T y'``.
Method: docs/numerics/notes/models.md
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray


def nodes_of(form: Any, numbers: Any) -> tuple[list[str], NDArray[Any]]:
    """Return the name of an inertia of each body without inertia, and the columns W, shape (n, such bodies)."""
    light = [way for way in numbers.ways.T if way[list(form.massless)].any()]
    nodes = np.zeros((len(form.coordinates), len(light)), dtype=numbers.ways.dtype)
    nodes[: len(form.springs)] = numbers.rows[list(form.springs)] @ np.array(light).T
    return [form.inertias[np.flatnonzero(way)[0]] for way in light], nodes


def node_problems(form: Any, numbers: Any) -> Iterator[str]:
    """List what is wrong at bodies without inertia: what joins them must be linear, and have a damper."""
    names_of_nodes, nodes = nodes_of(form, numbers)
    moved = np.abs(numbers.deflections @ nodes) > _MOVED
    for name, column in zip(names_of_nodes, moved.T, strict=True):
        ends = [form.links[number] for number in np.flatnonzero(column)]
        names, here = " and ".join(link.name for link in ends), f"{name}.inertia is 0"
        bent = [link.name for link in ends if link.parts or link.turns]
        alone = len(ends) == 1 and not np.any(np.array(numbers.torques)[:, form.inertias.index(name)])
        damped, springs = np.any(numbers.damping[column]), numbers.stiffness[column]
        if alone and not damped:
            yield f"{here}, and {names} alone holds it, so that no torque acts there: leave both out"
        elif bent and not alone:  # alone it has no torque, whatever its spring is
            yield (
                f"{here}; it must be > 0 beside {bent[0]}, which is no linear spring or damper: only those may "
                "join a part without inertia"
            )
        elif form.slips:
            yield (
                f"{here}; it must be > 0 in a train with a drag that alone joins two parts of it: give it a small "
                "inertia, or join its shafts in series"
            )
        elif not damped and len(springs) == 2 and not any(link.geared for link in ends):
            yield (
                f"{here}, and {names} have no damping, so that it follows them at once: join them in series, as "
                f"one shaft with stiffness = {float(np.prod(springs) / np.sum(springs)):.10g}"
            )
        elif not damped:
            yield (
                f"{here}, and {names} have no damping, so that no equation gives its rate: give one of them a "
                "damping, or the part an inertia"
            )


_MOVED = 1e-9  # deflection of a link by a node from which the node moves it
