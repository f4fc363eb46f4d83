"""Campaigns whose runs follow from the runs before them: the worst case, and small probabilities."""

from __future__ import annotations

import contextlib
import copy
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import plain
from ._analysis import warn_of_measures
from ._changes import arguments
from ._engine import Session
from ._entries import fail, whole
from ._folder import locked
from ._packages import package
from ._parameters import Sampled

if TYPE_CHECKING:
    from ._campaign import Campaign

__all__ = ["RareEvent", "WorstCase", "rare_event", "worst_case"]

Numbers = NDArray[np.float64]

# Members of a generation for each parameter, and the fewest in all.
_MEMBERS, _FEWEST = 10, 20
# The part of the runs that each level of subset simulation keeps.
_KEPT = 0.1
# Positions stay this far from the ends of a distribution, which may have none.
_END = 1e-16
_NORMAL_QUANTILE_95 = 1.959963984540054


@dataclass(frozen=True)
class WorstCase:
    """The worst run that a search found.

    Attributes:
        measure: the measure that was searched.
        value: its value in the worst run; NaN if that one did not finish.
        values: the parameters of the run, and the label of its ``fault`` if the campaign has faults.
        arguments: the run again: ``campaign.system.run(**worst.arguments)``.
        history: the worst value after each generation.
        runs, unfinished: number of runs in all, and of those that did not finish.
    """

    measure: str
    value: float
    values: dict[str, Any]
    fault: str | None
    arguments: dict[str, Any]
    history: tuple[float, ...]
    runs: int
    unfinished: int


@dataclass(frozen=True)
class RareEvent:
    """A small probability, by subset simulation.

    Attributes:
        limit: the measure whose limit is violated with this ``probability``.
        lower, upper: bounds of 95 %, log-normal with the coefficient of ``variation``; NaN if no run failed. They
            hold for many runs in a level and do not know of failures in a region that no run came near.
        levels: how far the runs of each level are beyond the limit at least; the last one is 0.
        runs: number of runs in all.
    """

    limit: str
    probability: float
    lower: float
    upper: float
    variation: float
    levels: tuple[float, ...]
    runs: int


class _Batches:
    """Runs of a campaign at positions of its parameters, one campaign in a folder of its own for each batch."""

    def __init__(self, campaign: Campaign, path: Path, session: Session, measure: str) -> None:
        self.campaign, self.path, self.session, self.measure = campaign, path, session, measure
        self.count = self.runs = self.unfinished = 0
        self.warned = False

    def part(self, unit: Numbers) -> Campaign:
        """Return the campaign with one run for each row of positions in [0, 1], and each fault."""
        unit = np.clip(unit, _END, 1 - _END)
        values = {parameter.name: parameter.quantile(unit[:, k]) for k, parameter in enumerate(self.campaign.parameters)}
        part = copy.copy(self.campaign)
        part.name = f"{self.campaign.name} {self.count}"
        design = {"method": "search", "batch": self.count}
        part.plan = type(part.plan)(design, Sampled(values, unit, len(unit)), part.plan.faults)
        part.runs_per_task = min(50, max(1, len(part.plan) // 16))
        return part

    def __call__(self, unit: Numbers, sign: float) -> tuple[Numbers, NDArray[np.int64]]:
        """Return the worst value of each row, of all faults, and its fault.

        A run that did not finish or has no value is worse than any other.
        """
        part = self.part(unit)
        outcome = self.session.outcome(part, self.path / f"batch-{self.count:05}")
        self.count += 1
        self.warned = self.warned or warn_of_measures(outcome)
        values = sign * outcome.read([self.measure])[self.measure].to_numpy(dtype=float)
        self.runs += len(values)
        self.unfinished += int(outcome.unfinished.sum())
        lost = outcome.unfinished | np.isnan(values)
        table = np.where(lost, np.inf, values).reshape(len(unit), -1)
        worst = table.argmax(axis=1)
        return table[np.arange(len(unit)), worst], worst


def _check(campaign: Campaign) -> None:
    if not campaign.parameters:
        raise fail("parameters", "a search needs at least one parameter")
    if campaign.plan.design["method"] != "random":
        raise fail("design", 'a search needs { method = "random", runs = number }')


@contextlib.contextmanager
def _batches(
    campaign: Campaign, path: Path, measure: str, workers: int | None, scheduler: str | None
) -> Iterator[_Batches]:
    # Neither the end of a random campaign nor kept signals belong to a search.
    variant = copy.copy(campaign)
    variant.stop, variant.keep = {}, {}
    count = None if workers is None else whole("workers", plain(workers), 1)
    # Each batch locks its folder only while it runs; this lock keeps other processes out between two batches.
    with locked(path.absolute()), Session(count, scheduler) as session:
        yield _Batches(variant, path, session, measure)


def worst_case(
    campaign: Campaign, path: Path, measure: str, *, smallest: bool, workers: int | None, scheduler: str | None
) -> WorstCase:
    """Search the parameters and faults for the largest or smallest value of a measure; see Campaign.worst_case.

    Differential evolution (R. Storn and K. Price, Journal of Global Optimization 11, 1997) of scipy.optimize on the
    positions in [0, 1] of the parameters.
    """
    optimize = package("scipy.optimize")
    _check(campaign)
    dimensions = len(campaign.parameters)
    members = max(_FEWEST, _MEMBERS * dimensions)
    runs = campaign.plan.sampled.rows
    generations = runs // members - 1
    if generations < 1:
        raise fail("design.runs", f"{runs}: a search of {dimensions} parameters needs at least {2 * members}")
    sign = -1.0 if smallest else 1.0
    worst: dict[str, Any] = {"value": -np.inf}
    history: list[float] = []

    with _batches(campaign, path, measure, workers, scheduler) as batches:

        def negative(columns: Numbers) -> Numbers:
            unit = columns.T
            values, faults = batches(unit, sign)
            best = int(values.argmax())
            if values[best] > worst["value"]:
                # The noise of a run depends on its number.
                run = best * len(campaign.plan.faults) + int(faults[best])
                worst.update(value=values[best], part=batches.part(unit), run=run)
            history.append(sign * worst["value"])
            # The optimiser compares finite numbers.
            return -np.clip(values, -1e300, 1e300)

        optimize.differential_evolution(
            negative,
            [(0.0, 1.0)] * dimensions,
            maxiter=generations,
            popsize=max(1, members // dimensions),
            tol=0.0,
            rng=np.random.default_rng(campaign.seed),
            polish=False,
            updating="deferred",
            vectorized=True,
        )
        if "part" not in worst:
            raise fail(f"measures.{measure}", "no run of the search has a value")
        part, run, value = worst["part"], worst["run"], worst["value"]
        values, case = part.plan.row(run)
        return WorstCase(
            measure=measure,
            value=float(sign * value) if np.isfinite(value) else float("nan"),
            values=values,
            fault=part.plan.faults[case].label if campaign.cases else None,
            arguments=arguments(part.changes(run)),
            history=tuple(float(entry) for entry in history),
            runs=batches.runs,
            unfinished=batches.unfinished,
        )


def rare_event(
    campaign: Campaign, path: Path, limit: str, *, workers: int | None, scheduler: str | None
) -> RareEvent:
    """Estimate the probability that a limit is violated; see Campaign.rare_event.

    Subset simulation (S.-K. Au and J. L. Beck, Probabilistic Engineering Mechanics 16, 2001) of OpenTURNS on standard
    normal variables, of which each parameter is a function.
    """
    if limit not in campaign.limits:
        raise fail("limits", f"{limit!r} has no limit, expected one of {', '.join(campaign.limits) or 'those stated'}")
    _check(campaign)
    turns, normal = package("openturns"), package("scipy.stats").norm
    ((kind, bound),) = campaign.limits[limit].items()
    sign = 1.0 if kind == "below" else -1.0
    runs = campaign.plan.sampled.rows
    block = max(1, int(_KEPT * runs))
    failures: list[BaseException] = []

    with _batches(campaign, path, limit, workers, scheduler) as batches:

        def distance(sample: Any) -> Numbers:
            try:
                values, _ = batches(normal.cdf(np.asarray(sample)), sign)
            except BaseException as error:
                failures.append(error)
                raise
            # A run that did not finish violates the limit by more than any other.
            distances: Numbers = np.clip(values - sign * bound, -1e300, 1e300)
            return distances[:, None]

        dimensions = len(campaign.parameters)
        turns.RandomGenerator.SetSeed(campaign.seed)
        function = turns.PythonFunction(dimensions, 1, func_sample=distance)
        variables = turns.RandomVector(turns.Normal(dimensions))
        event = turns.ThresholdEvent(turns.CompositeRandomVector(function, variables), turns.GreaterOrEqual(), 0.0)
        simulation = turns.SubsetSampling(event, 2.0, _KEPT)
        simulation.setBlockSize(block)
        simulation.setMaximumOuterSampling(max(1, runs // block))
        try:
            simulation.run()
        except Exception:
            # OpenTURNS makes a RuntimeError of every exception, with its traceback as the text.
            if failures:
                raise failures[0] from None
            raise
        result = simulation.getResult()
        probability = float(result.getProbabilityEstimate())
        variation = float(result.getCoefficientOfVariation())
        if variation < 0.0 < probability:
            # Of a probability that the first level finds by counting, OpenTURNS states none.
            rows = batches.runs // len(campaign.plan.faults)
            variation = math.sqrt((1.0 - probability) / (probability * rows))
        lower, upper = _bounds(probability, variation)
        return RareEvent(
            limit=limit,
            probability=probability,
            lower=lower,
            upper=upper,
            variation=variation,
            levels=tuple(float(level) for level in simulation.getThresholdPerStep()),
            runs=batches.runs,
        )


def _bounds(probability: float, variation: float) -> tuple[float, float]:
    """Return the bounds of 95 % of a log-normal estimate; NaN of a probability of 0."""
    if probability <= 0:
        return math.nan, math.nan
    factor = math.exp(_NORMAL_QUANTILE_95 * math.sqrt(math.log1p(variation**2)))
    return probability / factor, min(1.0, probability * factor)
