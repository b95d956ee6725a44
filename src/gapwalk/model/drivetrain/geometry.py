"""Kinematics of a train: motions of its inertias from deflections of its links, and the reverse.

All functions take the form of the train and the ratios of its links, real or complex.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from gapwalk.model.drivetrain.train_form import Step, TrainForm


def speeds(form: TrainForm, ratios: NDArray[Any]) -> NDArray[Any]:
    """Speeds at which the inertias turn together, the first at 1, shape (inertias,)."""
    found = np.ones(len(form.inertias) + 1, dtype=ratios.dtype)
    for step, factor in _factors(form, ratios):
        if step.parent != form.ground:
            found[step.child] = found[step.parent] * factor
    return found[:-1]


def angles(form: TrainForm, ratios: NDArray[Any]) -> NDArray[Any]:
    """Angles of the inertias by the coordinates while the root of the tree is at rest, shape (inertias + 1, n).

    The last row is the ground.
    """
    columns = {link: column for column, link in enumerate(form.springs)}
    found = np.zeros((len(form.inertias) + 1, len(columns)), dtype=ratios.dtype)
    for step, factor in _factors(form, ratios):
        angle = found[step.child]
        np.multiply(found[step.parent], factor, out=angle)
        if step.link in columns:
            angle[columns[step.link]] += -factor if form.links[step.link].ends[0] == step.parent else 1.0
    return found


def deflections(form: TrainForm, ratios: NDArray[Any]) -> NDArray[Any]:
    """Deflections of the links by the coordinates, shape (links, n)."""
    found = np.zeros((len(form.links), len(form.springs)), dtype=ratios.dtype)
    found[list(form.springs), range(len(form.springs))] = 1.0
    chords = [chord for chord in form.tree.chords if not form.links[chord].rigid]
    turned = angles(form, ratios) if chords else found
    for chord in chords:
        first, second = form.links[chord].ends
        found[chord] = turned[first] - ratios[chord] * turned[second]
    return found


def bodies(form: TrainForm, ratios: NDArray[Any]) -> csr_array:
    """Angles of the inertias by those of the bodies that rigid gears make of them, shape (inertias, bodies)."""
    count = len(form.inertias)
    body, turn = np.zeros(count + 1, dtype=np.intp), np.ones(count + 1, dtype=ratios.dtype)
    known = 1 if form.is_free else 0
    for step, factor in _factors(form, ratios):
        if form.links[step.link].rigid:
            body[step.child], turn[step.child] = body[step.parent], turn[step.parent] * factor
        else:
            body[step.child], known = known, known + 1
    return coo_array((turn[:-1], (np.arange(count), body[:-1])), shape=(count, known)).tocsr()


def pulls(form: TrainForm, ratios: NDArray[Any], of_bodies: csr_array) -> csr_array:
    """Deflections of the links by the angles of the bodies, shape (links, bodies)."""
    count, numbers = len(form.inertias), np.arange(len(form.links))
    ends = np.array([link.ends for link in form.links]).T.ravel()
    weights = np.concatenate((np.ones(len(numbers)), -ratios))
    moving = ends != form.ground
    places = (np.tile(numbers, 2)[moving], ends[moving])
    by_inertias = coo_array((weights[moving], places), shape=(len(numbers), count)).tocsr()
    return csr_array(by_inertias @ of_bodies)


def _factors(form: TrainForm, ratios: NDArray[Any]) -> Iterator[tuple[Step, Any]]:
    """The steps through the tree, each with the angle of its child by that of its parent while nothing deflects."""
    for step in form.tree.steps:
        forward = form.links[step.link].ends[0] == step.parent
        yield step, 1 / ratios[step.link] if forward else ratios[step.link]
