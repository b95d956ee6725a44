"""The step of the batch integrator in numbers: exact linear propagation, and weights for the contact forces.

Over one step the linear part (stiffness, damping, mean load, harmonics) is propagated exactly by a matrix exponential.
The contact forces enter by Duhamel's integral over a polynomial through their values at the end of the step and at
three earlier times: an exponential Adams-Moulton method (Hochbruck and Ostermann 2010, Acta Numerica 19, 209-286), with
the polynomial through the three earlier values as its predictor, and one evaluation of each force per step.

Method: docs/numerics/batch-integrator.md
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from gapwalk.model.coefficients import CoefficientLayout

HISTORY = 3
"""Number of earlier values of each contact force that a step uses."""

DEGREE = 4
"""Degree of the polynomial, of the rest of a step, that gives the change of the state by an impulse before that."""

_MODAL_FROM = 3  # degrees of freedom from which the two numbers per mode are fewer than those of a full matrix
_LARGEST_CONDITION = 1e9  # of the modal basis: nine of sixteen digits may be lost; the others exceed the accuracy


_NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)  # of Chebyshev, in steps


def rigid_stops(layout: CoefficientLayout) -> list[int]:
    """Return the numbers of the contacts that are rigid stops."""
    return [k for k, slots in enumerate(layout.contacts) if slots.form.law.rebounds]


def deflections_of(layout: CoefficientLayout) -> list[tuple[int, int]]:
    """Return the contact, and the argument of its law, of every deflection."""
    return [(k, place) for k, slots in enumerate(layout.contacts) for place, _ in enumerate(slots.deflections)]


@dataclass(frozen=True, eq=False)
class Linear:
    """The linear part of one or many systems of equal structure, in matrices over time (not theta)."""

    layout: CoefficientLayout  #: Positions of the coefficients in an array.
    coefficients: NDArray[np.float64]  #: shape (lanes, number of coefficients): Coefficients of each system.

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return self.layout.structure.size

    @property
    def rate(self) -> NDArray[np.float64]:
        """Time per angle theta, ``1/W``, shape (lanes,)."""
        return self.coefficients[:, 0]

    @cached_property
    def table(self) -> NDArray[np.float64]:
        """The coefficients ``[A | B | D_1 ... | m | a_1 ... | b_1 ...]``, shape (lanes, n, columns)."""
        return self.coefficients[:, self.layout.accelerations]

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """``L`` of ``z' = L z`` without contacts and loads, shape (lanes, 2n, 2n)."""
        n = self.n
        matrix = np.zeros((len(self.coefficients), 2 * n, 2 * n))
        matrix[:, :n, n:] = np.eye(n)
        matrix[:, n:, :] = -self.table[:, :, : 2 * n]
        return matrix

    @cached_property
    def push(self) -> NDArray[np.float64]:
        """Acceleration of the state by a unit of each contact force, shape (lanes, 2n, contacts)."""
        n, count = self.n, len(self.layout.contacts)
        push = np.zeros((len(self.coefficients), 2 * n, count))
        push[:, n:] = -self.table[:, :, 2 * n : 2 * n + count]
        return push

    @cached_property
    def loads(self) -> NDArray[np.float64]:
        """Acceleration of the state by ``1, cos h theta, sin h theta, ...``, shape (lanes, 2n, 1 + 2 orders)."""
        n, first, count = self.n, 2 * self.n + len(self.layout.contacts), len(self.layout.orders)
        loads = np.zeros((len(self.coefficients), 2 * n, 1 + 2 * count))
        loads[:, n:, 0] = self.table[:, :, first]
        loads[:, n:, 1::2] = self.table[:, :, first + 1 : first + 1 + count]
        loads[:, n:, 2::2] = self.table[:, :, first + 1 + count :]
        return loads

    @cached_property
    def deflections(self) -> NDArray[np.float64]:
        """Rows that map a state to each deflection, then to its rate, shape (lanes, 2, deflections, 2n)."""
        n, places = self.n, deflections_of(self.layout)
        rows = np.zeros((len(self.coefficients), 2, len(places), 2 * n))
        for index, (contact, argument) in enumerate(places):
            vector = self.layout.contacts[contact].deflections[argument]
            rows[:, 0, index, :n] = rows[:, 1, index, n:] = self.coefficients[:, vector]
        return rows

    @cached_property
    def impulses(self) -> NDArray[np.float64]:
        """Change of the state by impacts that change the rate of each rigid stop by 1, shape (lanes, 2n, stops)."""
        places, stops = [contact for contact, _ in deflections_of(self.layout)], rigid_stops(self.layout)
        found = -self.push[:, :, stops]
        rows = self.deflections[:, 1, [places.index(stop) for stop in stops]]
        rates = np.einsum("lkz,lzk->lk", rows, found)
        return found / rates[:, None]

    @cached_property
    def basis(self) -> NDArray[np.float64] | None:
        """Real modal basis, shape (lanes, 2n, 2n), in pairs of adjacent columns; None if it does not save work."""
        if self.n < _MODAL_FROM:
            return None
        values: NDArray[np.complex128]
        vectors: NDArray[np.complex128]
        values, vectors = (part.astype(complex) for part in np.linalg.eig(self.matrix))
        order = np.argsort(values.imag != 0, axis=1, kind="stable")  # real ones first: complex pairs stay adjacent
        values = np.take_along_axis(values, order, axis=1)
        vectors = np.take_along_axis(vectors, order[:, None, :], axis=2)
        columns = np.where(values.imag[:, None, :] < 0, vectors.imag, vectors.real)
        columns = columns / np.maximum(np.linalg.norm(columns, axis=1, keepdims=True), np.finfo(float).tiny)
        good = np.all(np.isfinite(columns)) and np.linalg.cond(columns).max() <= _LARGEST_CONDITION
        return columns if good else None

    def some(self, lanes: NDArray[np.intp]) -> Linear:
        """Select some of the systems, in the same basis."""
        part = Linear(self.layout, self.coefficients[lanes])
        part.__dict__["basis"] = None if self.basis is None else self.basis[lanes]
        return part


@dataclass(frozen=True, eq=False)
class Scheme:
    """The matrices of one step of a given length, for each lane."""

    transition: NDArray[np.float64]  #: shape (lanes, 2n, 2n): Propagates the state over the step.
    #: shape (lanes, 2n, 1 + 2 orders): Contribution of ``1, cos h theta, sin h theta, ...`` at the start of the step.
    loads: NDArray[np.float64]
    #: shape (lanes, 1 + HISTORY, 2n, contacts): Contribution of the contact forces: at the end of the step, at its
    #: start, and at earlier steps.
    weights: NDArray[np.float64]
    rows: NDArray[np.float64]  #: shape (lanes, 2, deflections, 2n): Maps the state to deflections and their rates.
    #: shape (lanes, HISTORY, 2, deflections, contacts): Contribution of earlier contact forces to the deflections and
    #: rates at the end of the step.
    forecast: NDArray[np.float64]
    span: NDArray[np.float64]  #: shape (lanes,): Length of the step, in time.
    #: shape (lanes, degree + 1, 2n, stops): Contribution of an impact that changes the rate of a rigid stop by 1: a
    #: polynomial of the rest of the step.
    impulse: NDArray[np.float64]
    #: shape (lanes, degree + 1, 2, stops): That polynomial for the deflection of the stop itself, and for its rate.
    echo: NDArray[np.float64]
    #: shape (lanes, 2, 2n, stops): Contribution of the reaction, linear over the step, that changes the deflection at
    #: its end by 1 and not the rate; and of the one that changes the rate by 1 and not the deflection.
    hold: NDArray[np.float64]

    def some(self, lanes: NDArray[np.intp]) -> Scheme:
        """Select some of the lanes."""
        return Scheme(*(getattr(self, field.name)[lanes] for field in fields(self)))


def scheme_of(linear: Linear, steps: int) -> Scheme:
    """Compute the scheme of `steps` steps per forcing period, in the basis of `linear`."""
    span = linear.rate * (2.0 * math.pi / steps)
    n2, n_loads, n_contacts = 2 * linear.n, linear.loads.shape[2], linear.push.shape[2]
    carried = expm(_augmented(linear, span))
    moments = [
        carried[:, :n2, n2 + n_loads + n_contacts * j : n2 + n_loads + n_contacts * (j + 1)] * math.factorial(j)
        for j in range(1 + HISTORY)
    ]
    transition, loads = carried[:, :n2, :n2], carried[:, :n2, n2 : n2 + n_loads]
    weights: NDArray[Any] = _interpolating(moments, np.arange(1.0, -HISTORY, -1.0))
    before = _interpolating(moments[:HISTORY], np.arange(0.0, -HISTORY, -1.0))
    rows = linear.deflections
    forecast = np.einsum("lakz,ljzm->ljakm", rows, before)
    impulse: NDArray[Any]
    hold: NDArray[Any]
    impulse, echo, hold = _of_stops(linear, span)
    if linear.basis is not None:
        impulse, hold = (np.linalg.solve(linear.basis[:, None], each) for each in (impulse, hold))
        transition = np.linalg.solve(linear.basis, transition @ linear.basis)
        loads = np.linalg.solve(linear.basis, loads)
        weights = np.linalg.solve(linear.basis[:, None], weights)
        rows = rows @ linear.basis[:, None]
    return Scheme(transition, loads, weights, rows, forecast, span, impulse, echo, hold)


def _of_stops(linear: Linear, span: NDArray[np.float64]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Compute the contributions of impulses and reactions of rigid stops: `Scheme.impulse`, `echo` and `hold`."""
    stops = rigid_stops(linear.layout)
    if not stops:
        lanes, n2 = len(span), 2 * linear.n
        return np.zeros((lanes, DEGREE + 1, n2, 0)), np.zeros((lanes, DEGREE + 1, 2, 0)), np.zeros((lanes, 2, n2, 0))
    carried = expm(linear.matrix[:, None] * (span[:, None] * _NODES)[:, :, None, None]) @ linear.impulses[:, None]
    impulse = np.einsum("pj,ljzk->lpzk", np.linalg.inv(np.vander(_NODES, increasing=True)), carried)
    places = [contact for contact, _ in deflections_of(linear.layout)]
    rows = linear.deflections[:, :, [places.index(stop) for stop in stops]]
    powers = np.arange(DEGREE + 1)
    reactions = np.stack(  # constant over the step, and growing with the rest of it
        [np.einsum("p,lpzk->lzk", 1.0 / (powers + more), impulse) for more in (1.0, 2.0)], axis=1
    )
    effect = np.einsum("lakz,lrzk->lkar", rows, reactions)
    hold = np.einsum("lrzk,lkra->lazk", reactions, np.linalg.inv(effect))
    return impulse, np.einsum("lakz,lpzk->lpak", rows, impulse), hold


def _augmented(linear: Linear, span: NDArray[np.float64]) -> NDArray[np.float64]:
    """Build the matrix of the linear part over one step, augmented by the loads and by polynomial contact forces."""
    lanes, n2, n_contacts = len(span), 2 * linear.n, linear.push.shape[2]
    first = n2 + linear.loads.shape[2]
    matrix = np.zeros((lanes, first + n_contacts * (1 + HISTORY), first + n_contacts * (1 + HISTORY)))
    over = span[:, None, None]
    matrix[:, :n2, :n2] = linear.matrix * over
    matrix[:, :n2, n2:first] = linear.loads * over
    matrix[:, :n2, first : first + n_contacts] = linear.push * over
    angle = span / linear.rate
    for index, order in enumerate(linear.layout.orders):
        cosine, sine = n2 + 1 + 2 * index, n2 + 2 + 2 * index
        matrix[:, cosine, sine], matrix[:, sine, cosine] = -order * angle, order * angle
    for index in range(n_contacts * HISTORY):
        matrix[:, first + index, first + n_contacts + index] = 1.0
    return matrix


def _interpolating(moments: list[NDArray[np.float64]], nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute weights of values at nodes (in steps) from integrals of powers, shape (lanes, nodes, 2n, contacts)."""
    powers = np.linalg.inv(np.vander(nodes, increasing=True))
    return np.einsum("jlzk,ji->lizk", np.array(moments), powers)
