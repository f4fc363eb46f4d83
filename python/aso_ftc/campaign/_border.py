"""Where the border between success and failure runs: a fitted surface over two parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Border", "border"]

Numbers = NDArray[np.float64]

_CELLS = 40
_FOLDS = 5
# The fewest runs that must fail, and that must pass: twice as many as there are coefficients.
_FEWEST = 12
_ITERATIONS = 50
_RIDGE = 1e-3


@dataclass(frozen=True)
class Border:
    """The probability of failure over two parameters.

    Attributes:
        x, y: the values of the parameters, increasing.
        probability: one row for each value of ``y``.
        wrong: the part of the runs that a fit without them puts on the wrong side of one half.
    """

    x: Numbers
    y: Numbers
    probability: Numbers
    wrong: float


def border(x: Numbers, y: Numbers, failed: NDArray[np.bool_]) -> Border | None:
    """Fit a logistic regression with all terms up to the second degree; None if too few runs fail or pass.

    ``wrong`` comes from cross-validation: each fifth of the runs is judged by a fit to the others.
    """
    known = np.isfinite(x) & np.isfinite(y)
    x, y, failed = x[known], y[known], failed[known]
    if min(failed.sum(), (~failed).sum()) < _FEWEST or np.ptp(x) <= 0 or np.ptp(y) <= 0:
        return None
    terms = _Terms(x, y)
    matrix = terms(x, y)
    part = np.random.default_rng(0).permutation(len(x)) % _FOLDS
    wrong = 0
    for fold in range(_FOLDS):
        rest = part != fold
        predicted = _logistic(matrix[~rest] @ _fit(matrix[rest], failed[rest])) > 0.5
        wrong += int((predicted != failed[~rest]).sum())
    across, along = (np.linspace(values.min(), values.max(), _CELLS) for values in (x, y))
    cells = np.meshgrid(across, along)
    surface = _logistic(terms(*(grid.ravel() for grid in cells)) @ _fit(matrix, failed))
    return Border(across, along, surface.reshape(_CELLS, _CELLS), wrong / len(x))


class _Terms:
    """1, x, y, x^2, x y, y^2 of parameters with mean 0 and deviation 1."""

    def __init__(self, x: Numbers, y: Numbers) -> None:
        self._scales = [(values.mean(), values.std()) for values in (x, y)]

    def __call__(self, x: Numbers, y: Numbers) -> Numbers:
        a, b = ((values - mean) / deviation for values, (mean, deviation) in zip((x, y), self._scales))
        return np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=1)


def _logistic(score: Numbers) -> Numbers:
    result: Numbers = 1.0 / (1.0 + np.exp(-np.clip(score, -500, 500)))
    return result


def _fit(matrix: Numbers, failed: NDArray[np.bool_]) -> Numbers:
    """Return the coefficients: Newton's method; a small ridge keeps those of runs that a line separates finite."""
    coefficients = np.zeros(matrix.shape[1])
    ridge = _RIDGE * np.eye(matrix.shape[1])
    for _ in range(_ITERATIONS):
        chance = _logistic(matrix @ coefficients)
        slope = matrix.T @ (failed - chance) - ridge @ coefficients
        curvature = (matrix * (chance * (1 - chance))[:, None]).T @ matrix + ridge
        step = np.linalg.solve(curvature, slope)
        coefficients += step * min(1.0, 10.0 / max(float(np.abs(step).max()), 1e-300))
        if np.abs(step).max() < 1e-8:
            break
    return coefficients
