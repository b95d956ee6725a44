"""Forms of special points in samples: predicted where the error of that is known to be small, and else corrected."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.point_prediction import Predicted, Terms
from gapwalk.answers.point_tracking import Corrected, TrackedPoint
from gapwalk.answers.tolerance_records import Tracking
from gapwalk.errors import ModelError

Array = NDArray[np.float64]

_SAME = 1e-6  # scaled distance within which two solutions are one point
_UNLIKELY = -0.2  # score below which a form is not looked for
_EXACT = 0.05  # share of the allowed error that solutions may have to which predictions are fitted
_APART = 0.2  # distance between neighbouring points, as a share of the nominal one, below which both are corrected


class Located(NamedTuple):
    """A form in a sample."""

    #: value, error: Value of the parameter, and a bound of its error.
    value: float
    error: float
    unknowns: Array  #: Unknowns of its equation; empty for a form that is attached to another one.
    corrected: Corrected | None = None  #: The solution; None for a prediction whose error is known to be small.


class FormFinder:
    """Finds forms of special points in samples."""

    def __init__(self, asked: Tracking, origin: TrackedPoint) -> None:
        self.asked, self.origin = asked, origin
        self.points = [form.point(asked.names) for form in asked.forms]

    def terms(self, samples: Array) -> Terms:
        """Return the terms of polynomials at some samples."""
        return Terms((samples - self.origin.origin) / self.asked.deviations)

    def allows(self, sample: Array) -> bool:
        """Return True if the model allows the values of a sample."""
        try:
            self.asked.at(sample)
        except ModelError:
            return False
        return True

    def found(self, samples: Array, *, exact: bool = False) -> Iterator[dict[int, Located] | None]:
        """Yield for each sample what was found of each form; None if it is refused.

        If `exact`, predictions are corrected everywhere, and more exactly.
        """
        forms = self.asked.forms
        terms = self.terms(samples)
        guesses = [None if point.fit is None else point.fit.predicted(terms) for point in self.points]
        scores, nothing = self._scores(terms), np.zeros(0)
        trusted = None if exact else self._trusted(guesses)
        offsets = {f: form.offset_at(terms) for f, form in enumerate(forms) if form.companion >= 0}
        left = 0.5 * self.asked.accuracy * (_EXACT if exact else 1.0)
        for k, sample in enumerate(samples):
            found = dict[int, Located]()
            if not self.allows(sample):
                yield None
                continue
            plane = self.origin.plane_at(sample)
            for f in np.argsort(-scores[k], kind="stable").tolist():
                guess = guesses[f]
                if scores[k, f] < _UNLIKELY or forms[f].companion >= 0 or guess is None:
                    continue
                if trusted is not None and np.isfinite(trusted[f][k]):
                    found[f] = Located(float(guess.unknowns[k, -1]), float(trusted[f][k]), guess.unknowns[k])
                    continue
                each = self.points[f].fitted_at(plane, guess.at(k), left)
                if each is not None and not self._is_double(f, each, found):
                    error = left * float(self.points[f].scales[-1])
                    found[f] = Located(each.value, error, each.unknowns, each)
            for f, (offset, errors) in offsets.items():
                beside = found.get(forms[f].companion)
                if beside is not None and np.isfinite(errors[k]):
                    error = beside.error + float(errors[k])
                    found[f] = Located(beside.value + float(offset[k]), error, nothing)
            yield found

    def _scores(self, terms: Terms) -> Array:
        """Return a number for each sample and form: about 1 where the form exists, and 0 where it does not."""
        found = np.ones((len(terms.x), len(self.points)))
        for f, form in enumerate(self.asked.forms):
            if len(form.scores):
                found[:, f] = terms.of(form.degree) @ form.scores
        return found

    def _trusted(self, predicted: Sequence[Predicted | None]) -> list[Array]:
        """Return for each form the bounds of the errors of its predictions, infinity where it must be corrected.

        A prediction is the answer if the form exists in all systems known so far, its error is small, and it is far
        from its neighbours on the branch: contacts and multipliers of a special point change only where another
        special point passes it, and points vanish where two of them meet.
        """
        asked, forms = self.asked, self.asked.forms
        always = [f for f, form in enumerate(forms) if form.companion < 0 and not len(form.scores)]
        errors = [np.full(1, np.inf) if each is None else np.full(len(each.errors), np.inf) for each in predicted]
        for f in always:
            each = predicted[f]
            if each is not None:
                near = each.errors <= asked.accuracy * np.abs(each.unknowns[:, -1])
                errors[f] = np.where(near, each.errors, np.inf)
        for f, g in pairwise(f for f in always if predicted[f] is not None):
            near = self._nearness(f, g, predicted) < _APART
            errors[f][near] = errors[g][near] = np.inf
        return errors

    def _nearness(self, f: int, g: int, predicted: Sequence[Predicted | None]) -> Array:
        """Return the distance of two predicted forms in samples, along and as a share of the one at zero parameters."""
        one, other, fits = predicted[f], predicted[g], (self.points[f].fit, self.points[g].fit)
        assert one is not None
        assert other is not None
        assert fits[0] is not None
        assert fits[1] is not None
        columns = [*range(len(self.asked.first.state)), -1]
        scales = self.points[f].scales[columns]
        apart = (other.unknowns[:, columns] - one.unknowns[:, columns]) / scales
        between = (fits[1].coefficients[0, columns] - fits[0].coefficients[0, columns]) / scales
        return apart @ between / float(between @ between)

    def _is_double(self, f: int, each: Corrected, found: Mapping[int, Located]) -> bool:
        """Return True if another form came to the same solution."""
        kind, scales = self.asked.forms[f].met.kind, self.points[f].scales
        return any(
            self.asked.forms[g].met.kind == kind
            and len(other.unknowns) == len(each.unknowns)
            and float(np.abs((other.unknowns - each.unknowns) / scales).max()) < _SAME
            for g, other in found.items()
        )
