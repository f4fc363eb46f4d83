"""Analysis of a campaign: table of the runs, sensitivity indices, failure probability, influence."""

from __future__ import annotations

import json
import math
import os
import shlex
import shutil
import tempfile
import warnings
import weakref
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from .. import _html
from .._errors import ConfigurationError, ResultsError
from ._packages import package

if TYPE_CHECKING:
    import pandas
    import pyarrow

__all__ = ["Outcome", "Probability", "load"]

FAULT_COLUMNS = ("fault.connection", "fault.kind", "fault.size", "fault.from")
# Designs whose rows are independent samples of the distributions, and those that are more even than
# independent samples.
_INDEPENDENT = ("random",)
_EVEN = ("latin-hypercube", "sobol", "halton")
# SALib's number of bootstrap resamples; one call draws at most so many rows.
_RESAMPLES, _ROWS_OF_A_CALL = 100, 4_000_000
# Random permutations of a test; its least p-value is 1 / (1 + permutations).
_PERMUTATIONS = 4_999
# How the reason of a run starts that failed in a measure, not in its simulation.
MEASURE = "measures."
NO_VALUE = "for a run without a value, a function may return math.nan"
# Parts that are read in place; more are merged first.
_PARTS = 100


def batches(names: Iterable[str], size: int = 8) -> Iterator[list[str]]:
    """Return the names in lists of a few, so that reading their columns needs little memory."""
    known = list(names)
    return (known[start : start + size] for start in range(0, len(known), size))


def holds(limit: Mapping[str, float], value: Any) -> Any:
    """Return whether a value, or each one of an array, is within its limit; NaN is not."""
    return value < limit["below"] if "below" in limit else value > limit["above"]


def bounds(failures: int, runs: int, confidence: float) -> tuple[float, float]:
    """Return the bounds of Clopper and Pearson of a probability; see :meth:`Outcome.failure_probability`."""
    test = package("scipy.stats").binomtest(failures, runs)
    interval = test.proportion_ci(confidence_level=confidence, method="exact")
    return float(interval.low), float(interval.high)


@dataclass(frozen=True)
class Probability:
    """Failure probability of the runs of a campaign, with the bounds of Clopper and Pearson.

    Attributes:
        name: the limit, or ``"any limit"``.
        failures, runs: number of failures and of the runs that count.
        probability: ``failures / runs``.
        lower, upper: bounds; the interval covers the probability with at least ``confidence``.
        confidence: two-sided, such as 0.95.
        note: what restricts the meaning of the bounds; empty if nothing does.
    """

    name: str
    failures: int
    runs: int
    probability: float
    lower: float
    upper: float
    confidence: float
    note: str = ""


def load(folder: str | os.PathLike[str]) -> Outcome:
    """Load the results of a campaign from its folder; also while the campaign runs, or after its end.

    Raises:
        ResultsError: the folder has no campaign, or no run has finished yet.
    """
    path = Path(folder)
    try:
        manifest = json.loads((path / "manifest.json").read_text(encoding="utf-8"))
    except OSError as error:
        sentence = f"{path}: expected the folder of a campaign with manifest.json: {error.strerror}"
        raise ResultsError(sentence, "NoCampaign") from error
    except ValueError as error:
        raise ResultsError(f"{path / 'manifest.json'}: not JSON: {error}", "BadManifest") from error
    return Outcome(path, manifest)


class Outcome:
    """The runs of a campaign that have ended, with their parameters, measures and statuses.

    Attributes:
        folder: folder of the campaign.
        manifest: ``manifest.json`` of the folder: design, parameters, measures, limits.
    """

    def __init__(self, folder: Path, manifest: dict[str, Any]) -> None:
        self.folder: Path = folder
        self.manifest: dict[str, Any] = manifest
        self._files = sorted(str(part) for part in (folder / "runs").glob("part-*.parquet"))
        if not self._files:
            raise ResultsError(f"{folder}: no run of this campaign has ended yet", "NoRuns")
        if len(self._files) > _PARTS:
            self._merge()
        self._status = self.read(["status"])["status"]
        repeated = self._status.index[self._status.index.duplicated()]
        if len(repeated):
            sentence = f"{folder}: run {repeated[0]} is in two files of {folder / 'runs'}; remove one of them"
            raise ResultsError(sentence, "RepeatedRun", {"run": int(repeated[0])})

    # The table.

    def _merge(self) -> None:
        """Copy many small parts to one temporary file: each read of a column opens every file."""
        arrow, parquet = package("pyarrow"), package("pyarrow.parquet")
        temporary = tempfile.mkdtemp(prefix="aso-ftc-")
        weakref.finalize(self, shutil.rmtree, temporary, ignore_errors=True)
        path = os.path.join(temporary, "runs.parquet")
        schema = parquet.read_schema(self._files[0])
        try:
            with parquet.ParquetWriter(path, schema, compression="zstd") as writer:
                for names in batches(self._files, _PARTS):
                    writer.write_table(
                        arrow.concat_tables([parquet.ParquetFile(name).read() for name in names])
                    )
        except (OSError, arrow.ArrowInvalid) as error:
            raise ResultsError(f"{self.folder}: cannot read all runs: {error}", "CannotRead") from error
        self._files = [path]

    def _arrow(
        self, columns: list[str] | None, *, dictionaries: bool, runs: Sequence[int] | None = None
    ) -> pyarrow.Table:
        """Read columns of all parts, rows sorted by ``run``."""
        dataset = package("pyarrow.dataset")
        types = package("pyarrow.types")
        plain = dataset.dataset(self._files, format="parquet")
        if dictionaries:
            text = {field.name for field in plain.schema if types.is_string(field.type)}
            names = text & set(columns or plain.schema.names)
            form = dataset.ParquetFileFormat(dictionary_columns=names)
            plain = dataset.dataset(self._files, format=form)
        only = None if runs is None else dataset.field("run").isin(list(runs))
        table = plain.to_table(columns=columns, filter=only).unify_dictionaries()
        numbers = table["run"].to_numpy()
        return table if bool(np.all(numbers[1:] > numbers[:-1])) else table.sort_by("run")

    def read(self, columns: Sequence[str], runs: Sequence[int] | None = None) -> pandas.DataFrame:
        """Read these columns, of all runs or of some, indexed by ``run``; texts as categories.

        A text that is absent, such as the connection of a run without fault, is empty.
        """
        package("pandas")
        table = self._arrow(["run", *dict.fromkeys(columns)], dictionaries=True, runs=runs)
        frame: pandas.DataFrame = table.to_pandas(split_blocks=True, self_destruct=True)
        for name in frame.columns[frame.dtypes == "category"]:
            # The order of the categories must not depend on the parts.
            frame[name] = frame[name].cat.set_categories(sorted({*frame[name].cat.categories, ""})).fillna("")
        return frame.set_index("run")

    def to_arrow(self) -> pyarrow.Table:
        """Return all runs as a ``pyarrow.Table``, sorted by ``run``."""
        return self._arrow(None, dictionaries=False)

    @cached_property
    def table(self) -> pandas.DataFrame:
        """All runs as a table indexed by ``run``: parameters, measures, ``status``, ``reason``, ``seconds``."""
        package("pandas")
        frame: pandas.DataFrame = self.to_arrow().to_pandas()
        return frame.set_index("run")

    def __len__(self) -> int:
        return len(self._status)

    @property
    def runs(self) -> NDArray[np.int64]:
        """Run numbers of the rows."""
        return np.asarray(self._status.index.to_numpy(), dtype=np.int64)

    @property
    def statuses(self) -> dict[str, int]:
        """Number of runs of each status, the most frequent first."""
        return {str(name): int(count) for name, count in self._status.value_counts().items() if count}

    @property
    def unfinished(self) -> NDArray[np.bool_]:
        """Which rows did not end with the status ``"ok"``."""
        return np.asarray(self._status.to_numpy() != "ok")

    def __repr__(self) -> str:
        lost = int(self.unfinished.sum())
        name, planned = self.manifest["name"], self.manifest["runs"]
        return f"<Outcome: {name}, {len(self)} of {planned} runs, {lost} not finished>"

    def _repr_html_(self) -> str:
        rows = []
        for name, entry in self.manifest["measures"].items():
            values = self.read([name])[name].to_numpy()
            finite = values[np.isfinite(values)]
            shown = [f"{f(finite):.6g}" for f in (np.min, np.median, np.max)] if len(finite) else [""] * 3
            rows.append([name, entry.get("unit") or "", describe(self.limits.get(name)), *shown])
        return _html.page(repr(self).strip("<>"), ("measure", "unit", "limit", "min", "median", "max"), rows)

    @property
    def limits(self) -> dict[str, dict[str, float]]:
        """Limits by measure: ``{"below": x}`` or ``{"above": x}``."""
        return dict(self.manifest.get("limits") or {})

    @property
    def command_parts(self) -> list[str]:
        """The texts before, between and after the run numbers of :meth:`command`."""
        folder = shlex.quote(os.fspath(self.folder))
        return [f"aso-ftc campaign {folder} --show ", " > run-", ".toml && aso-ftc run run-", ".toml"]

    def command(self, run: int) -> str:
        """Return the shell command that repeats this run: it writes ``run-RUN.toml`` and runs it."""
        if not 0 <= run < self.manifest["runs"]:
            sentence = (
                f"command: run {run} is not in this campaign; expected 0 to {self.manifest['runs'] - 1}"
            )
            raise ConfigurationError(sentence, "UnknownRun", {"run": run})
        return str(int(run)).join(self.command_parts)

    # Sensitivity indices.

    @cached_property
    def _units(self) -> list[str]:
        """The sampled parameters, in the order of the sample."""
        parquet = package("pyarrow.parquet")
        names = parquet.read_schema(self.folder / "plan.parquet").names
        return [name.removeprefix("unit:") for name in names if name.startswith("unit:")]

    def _measured(self, measure: str) -> dict[str, Any]:
        known = self.manifest["measures"]
        if measure not in known:
            sentence = f"the campaign has no measure {measure!r}; its measures are {', '.join(known)}"
            raise ConfigurationError(sentence, "UnknownMeasure", {"measure": measure})
        entry: dict[str, Any] = known[measure]
        return entry

    def _sample(self, measure: str, method: str, what: str) -> tuple[dict[str, Any], NDArray[np.float64]]:
        """Return SALib's description of the parameters, and the measure of every row of the design."""
        entry = self._measured(measure)
        design = self.manifest["design"]["method"]
        if design != method:
            sentence = f"{what} need a campaign with the design {method!r}; this one has {design!r}"
            raise ConfigurationError(sentence, "WrongDesign", {"expected": method, "found": design})
        if self.manifest.get("faults"):
            sentence = f"{what} need a campaign without faults; in this one the fault varies, too"
            raise ConfigurationError(sentence, "WrongDesign", {"expected": method, "found": "faults"})
        frame = self.read([measure, "status"])
        values = np.asarray(frame[measure].to_numpy(), dtype=np.float64)
        stated = "unfinished" in entry
        bad = ~np.isfinite(values) | (self.unfinished & (not stated))
        statuses = frame["status"][bad].value_counts()
        counts = [f"{count} {name}" for name, count in statuses.items() if count and name != "ok"]
        no_number = int((bad & ~self.unfinished).sum())
        counts += [f"{no_number} without a finite {measure!r}"] if no_number else []
        absent = self.manifest["runs"] - len(frame)
        counts += [f"{absent} not run yet"] if absent else []
        if counts:
            sentence = (
                f"{what} need every run of the design; {int(bad.sum()) + absent} of "
                f"{self.manifest['runs']} have no value: {', '.join(counts)}. A measure may state a value for "
                "runs that do not finish: `unfinished`"
            )
            raise ConfigurationError(sentence, "IncompleteRuns", {"missing": int(bad.sum()) + absent})
        if values.min() == values.max():
            sentence = f"{what} of {measure!r} do not exist: all runs have the same value {values[0]:g}"
            raise ConfigurationError(sentence, "ConstantMeasure", {"measure": measure})
        names = self._units
        problem = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
        return problem, values

    def _table(self, indices: Mapping[str, Any], *names: str, index: Any = None) -> pandas.DataFrame:
        """Return the indices with these names as columns; the index is by default that of the parameters."""
        pandas_ = package("pandas")
        index = pandas_.Index(self._units, name="parameter") if index is None else index
        columns = {name: np.asarray(indices[name], dtype=np.float64) for name in names}
        frame: pandas.DataFrame = pandas_.DataFrame(columns, index=index)
        return frame

    def sobol(self, measure: str, confidence: float = 0.95, seed: int = 0) -> pandas.DataFrame:
        r"""Return Sobol indices of a campaign with the design ``saltelli``.

        The first-order index is ``S1_i = Var(E[Y | X_i]) / Var(Y)``, the total index
        ``ST_i = 1 - Var(E[Y | X_~i]) / Var(Y)``; the estimators are those of Saltelli et al. (2010),
        Table 2 (b) and (f), in SALib.

        Args:
            measure: name of the measure Y.
            confidence: of the intervals ``S1 +- S1_conf`` and ``ST +- ST_conf`` (bootstrap, normal).
            seed: of the bootstrap.

        Returns:
            One row for each parameter, columns ``S1``, ``S1_conf``, ``ST``, ``ST_conf``; no unit.

        Raises:
            ConfigurationError: the campaign has another design, or a run has no value of the measure.
        """
        problem, values = self._sample(measure, "saltelli", "Sobol indices")
        rows = values.reshape(-1, self._block)
        # The rows of second order between A, AB and B are not needed here.
        first = np.ascontiguousarray(np.delete(rows, np.s_[1 + len(self._units) : -1], axis=1)).ravel()
        indices = _sobol(problem, first, False, len(rows), confidence, seed)
        return self._table(indices, "S1", "S1_conf", "ST", "ST_conf")

    def sobol_second_order(self, measure: str, confidence: float = 0.95, seed: int = 0) -> pandas.DataFrame:
        """Return Sobol indices of second order of a design ``saltelli`` with ``second-order = true``.

        ``S2_ij = Var(E[Y | X_i, X_j]) / Var(Y) - S1_i - S1_j``; estimator of Saltelli (2002) in SALib.
        Same arguments and errors as :meth:`sobol`.

        Returns:
            One row for each pair of parameters, columns ``S2`` and ``S2_conf``; no unit.
        """
        problem, values = self._sample(measure, "saltelli", "Sobol indices")
        if self._block == len(self._units) + 2:
            sentence = "Sobol indices of second order need the design 'saltelli' with second-order = true"
            raise ConfigurationError(sentence, "WrongDesign", {"expected": "second-order"})
        indices = _sobol(problem, values, True, len(values) // self._block, confidence, seed)
        upper = np.triu_indices(len(self._units), 1)
        pairs = [(self._units[i], self._units[j]) for i, j in zip(*upper)]
        index = package("pandas").MultiIndex.from_tuples(pairs, names=["first", "second"])
        columns = {name: indices[name][upper] for name in ("S2", "S2_conf")}
        return self._table(columns, *columns, index=index)

    @property
    def _block(self) -> int:
        """Rows of a design ``saltelli`` for one base sample: A, D times AB, D times BA, B."""
        count = len(self._units)
        return 2 * count + 2 if self.manifest["design"].get("second-order") else count + 2

    def morris(self, measure: str, confidence: float = 0.95, seed: int = 0) -> pandas.DataFrame:
        """Return the elementary effects of a campaign with the design ``morris``.

        An elementary effect is the change of the measure per change of a parameter's position in its
        distribution, from 0 (lowest) to 1 (highest): the effect of the whole range. Morris (1991);
        ``mu_star`` by Campolongo et al. (2007); SALib.

        Args:
            measure: name of the measure.
            confidence: of the interval ``mu_star +- mu_star_conf`` (bootstrap, normal).
            seed: of the bootstrap.

        Returns:
            One row for each parameter, all columns in the unit of the measure: ``mu_star``, mean of the
            absolute effects; ``mu_star_conf``; ``mu``, mean of the effects; ``sigma``, their standard
            deviation (nonlinearity and interactions).

        Raises:
            ConfigurationError: the campaign has another design, or a run has no value of the measure.
        """
        problem, values = self._sample(measure, "morris", "Morris indices")
        parquet = package("pyarrow.parquet")
        plan = parquet.read_table(
            self.folder / "plan.parquet", columns=["row", *(f"unit:{name}" for name in self._units)]
        ).sort_by("row")
        positions = np.column_stack([plan.column(f"unit:{name}").to_numpy() for name in self._units])
        levels = int(self.manifest["design"].get("levels", 4))
        indices = package("SALib.analyze.morris").analyze(
            problem,
            np.asarray(positions, dtype=np.float64),
            values,
            num_levels=levels,
            conf_level=confidence,
            seed=seed,
        )
        return self._table(indices, "mu_star", "mu_star_conf", "mu", "sigma")

    def fast(self, measure: str, confidence: float = 0.95, seed: int = 0) -> pandas.DataFrame:
        """Return indices of the extended Fourier amplitude sensitivity test, design ``fast``.

        ``S1`` and ``ST`` as in :meth:`sobol`; Saltelli, Tarantola and Chan (1999), in SALib. The
        intervals are an indication only: SALib computes them from one half of the search curve, and they
        do not contain the bias of the method.

        Args:
            measure: name of the measure.
            confidence: of the intervals ``S1 +- S1_conf`` and ``ST +- ST_conf``.
            seed: of the resampling.

        Returns:
            One row for each parameter, columns ``S1``, ``S1_conf``, ``ST``, ``ST_conf``; no unit.

        Raises:
            ConfigurationError: the campaign has another design, or a run has no value of the measure.
        """
        problem, values = self._sample(measure, "fast", "FAST indices")
        analyze = package("SALib.analyze.fast").analyze
        harmonics = int(self.manifest["design"].get("harmonics", 4))
        # SALib draws from NumPy's global generator, which is not ours to change.
        state = np.random.get_state()
        try:
            np.random.seed(seed)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                indices = analyze(problem, values, M=harmonics, conf_level=confidence)
        finally:
            np.random.set_state(state)
        return self._table(indices, "S1", "S1_conf", "ST", "ST_conf")

    # Limits.

    def failed(self, limit: str | None = None) -> NDArray[np.bool_]:
        """Return which rows fail: not finished, or the measure is not within its limit.

        Args:
            limit: the measure of the limit; default: a run fails if any limit fails.
        """
        known = self.limits
        if not known or (limit is not None and limit not in known):
            have = f"its limits are on {', '.join(known)}" if known else "it has no limits at all"
            sentence = f"the campaign has no limit on {limit!r}; {have}"
            raise ConfigurationError(sentence, "UnknownLimit", {"limit": limit})
        failed = self.unfinished
        for name in [limit] if limit is not None else known:
            values = np.asarray(self.read([name])[name].to_numpy(), dtype=np.float64)
            failed = failed | ~holds(known[name], values)
        return failed

    def failure_probability(
        self,
        limit: str | None = None,
        confidence: float = 0.95,
        unfinished: Literal["failure", "exclude"] = "failure",
        fault: str | None = None,
    ) -> Probability:
        r"""Return the probability that a run fails, with Clopper-Pearson bounds.

        With k failures in n runs and ``a = 1 - confidence``, the bounds are the quantiles
        ``beta(a/2; k, n-k+1)`` and ``beta(1-a/2; k+1, n-k)`` (Clopper and Pearson, 1934). They hold for
        independent samples, the design ``random``. The rows of ``latin-hypercube``, ``sobol`` and
        ``halton`` are more even than independent ones: the estimate is usually closer than the bounds
        say, but the confidence is not exact, and ``note`` says so. For the other designs the fraction of
        failures is no probability.

        A run fails if its measure does not satisfy ``value < below`` or ``value > above``, also if the
        measure is NaN (such as the time of a detection that did not happen).

        Args:
            limit: the measure of the limit; default: a run fails if any limit fails.
            confidence: two-sided.
            unfinished: ``"failure"`` counts a run that did not finish as a failure, ``"exclude"`` leaves
                it out of both numbers.
            fault: label of the fault, required in a fault campaign, ``""`` for the runs without fault: the
                probability under this fault.

        Raises:
            ConfigurationError: a limit or fault that is unknown, or a design without random samples.
        """
        method = self.manifest["design"]["method"]
        if method not in _INDEPENDENT + _EVEN:
            expected = ", ".join(_INDEPENDENT + _EVEN)
            sentence = (
                f"a failure probability needs a design of random samples ({expected}); found {method!r}"
            )
            raise ConfigurationError(sentence, "WrongDesign", {"expected": expected, "found": method})
        failed = self.failed(limit)
        rows = np.ones(len(self), dtype=bool)
        if self.manifest.get("faults"):
            labels = self.read(["fault"])["fault"]
            rows = np.asarray(labels.to_numpy() == fault)
            if not rows.any():
                sentence = (
                    f"a failure probability needs one fault of the campaign, for example "
                    f"fault={str(labels.iloc[-1])!r}; found {fault!r}"
                )
                raise ConfigurationError(sentence, "UnknownFault", {"fault": fault})
        elif fault:
            raise ConfigurationError(f"the campaign has no faults, found the fault {fault!r}", "UnknownFault", {"fault": fault})
        if unfinished == "exclude":
            rows = rows & ~self.unfinished
        elif unfinished != "failure":
            sentence = f"unfinished: expected 'failure' or 'exclude', found {unfinished!r}"
            raise ConfigurationError(sentence, "BadOption", {"unfinished": unfinished})
        count = int(rows.sum())
        if count == 0:
            raise ConfigurationError("a failure probability needs at least one finished run", "NoRuns")
        failures = int(failed[rows].sum())
        notes = []
        if method in _EVEN:
            notes.append(
                f"the rows of the design {method!r} are more even than independent samples: the bounds are "
                f"usually wider than needed, their confidence is not exact"
            )
        if len(self) < self.manifest["runs"] and self.manifest.get("complete"):
            notes.append(
                "the campaign ended when the bounds were close enough: their confidence is not exact, because the "
                "number of runs depends on the results"
            )
        elif len(self) < self.manifest["runs"]:
            notes.append(
                f"{len(self)} of {self.manifest['runs']} runs have ended: the bounds are biased if the others "
                f"take longer because of how they behave"
            )
        name = "any limit" if limit is None else limit
        low, high = bounds(failures, count, confidence)
        return Probability(name, failures, count, failures / count, low, high, confidence, "; ".join(notes))

    # Which parameter, which fault.

    @property
    def inputs(self) -> dict[str, bool]:
        """What varies between runs: names of parameters and columns of faults; true if numeric."""
        names = {entry["name"]: bool(entry["numeric"]) for entry in self.manifest["parameters"]}
        if self.manifest.get("faults"):
            names.update({name: name in ("fault.size", "fault.from") for name in FAULT_COLUMNS})
        return names

    def influence(self, measure: str) -> pandas.DataFrame:
        """Return how the measure depends on each parameter, for any design.

        Numeric parameters have one row each, with Spearman's rank correlation between parameter and
        measure over the finished runs (it sees monotone dependence only; its p-value, by Student's t, is for
        independent samples only), and the fraction of failures in the lowest and in the highest tenth of
        the parameter. Other parameters have one row for each value. In a fault campaign, connection,
        kind, size and start of the fault are parameters, too.

        Args:
            measure: name of the measure; a run fails as in :meth:`failure_probability`, NaN without limit.

        Returns:
            Rows by ``parameter``, numeric ones first, strongest correlation first. Columns: ``value``
            (``None`` for numeric parameters), ``runs``, ``correlation``, ``p_value``, ``lowest_tenth``,
            ``highest_tenth``, ``failed`` (fraction of these runs) and ``median`` of the measure.
        """
        self._measured(measure)
        values = np.asarray(self.read([measure])[measure].to_numpy(), dtype=np.float64)
        values = np.where(self.unfinished, np.nan, values)
        failed = self.failed(measure) if measure in self.limits else np.full(len(values), np.nan)
        spearman = package("scipy.stats").spearmanr
        numbers: list[dict[str, Any]] = []
        others: list[dict[str, Any]] = []
        for names in batches(self.inputs):
            frame = self.read(names)
            for name in names:
                if self.inputs[name]:
                    inputs = np.asarray(frame[name].to_numpy(), dtype=np.float64)
                    numbers.append({"parameter": name, **_dependence(inputs, values, failed, spearman)})
                    continue
                groups = frame.groupby(name, observed=True, sort=True).indices
                others += [
                    {"parameter": name, "value": value, **_group(values[rows], failed[rows])}
                    for value, rows in groups.items()
                ]
        numbers.sort(key=lambda row: -abs(np.nan_to_num(row["correlation"])))
        columns = ["parameter", "value", "runs", "correlation", "p_value", "lowest_tenth", "highest_tenth"]
        pandas_ = package("pandas")
        table = pandas_.DataFrame(numbers + others, columns=[*columns, "failed", "median"])
        result: pandas.DataFrame = table.set_index("parameter")
        return result

    def heat_map(self, measure: str) -> pandas.DataFrame:
        """Return the worst value of the measure for each fault of a fault campaign.

        The worst value is the largest, with a limit ``above`` the smallest; infinite where a run did not
        finish or where its measure is NaN; NaN where the campaign has no such fault. Runs without fault
        are left out.

        Returns:
            Rows by ``(kind, connection)``, columns by ``(size, from)``.
        """
        self._measured(measure)
        if not self.manifest.get("faults"):
            sentence = "a heat map of faults needs a fault campaign; this campaign has no faults"
            raise ConfigurationError(sentence, "WrongDesign", {"expected": "faults"})
        frame = self.read([measure, "fault", *FAULT_COLUMNS])
        smallest = set(self.limits.get(measure, {})) == {"above"}
        worst = -math.inf if smallest else math.inf
        values = np.asarray(frame[measure].to_numpy(), dtype=np.float64)
        frame[measure] = np.where(self.unfinished | np.isnan(values), worst, values)
        keys = {
            "fault.kind": "kind",
            "fault.connection": "connection",
            "fault.size": "size",
            "fault.from": "from",
        }
        faults = frame[frame["fault"] != ""].rename(columns=keys)
        groups = faults.groupby(list(keys.values()), dropna=False, observed=True)[measure]
        cells: pandas.Series = groups.min() if smallest else groups.max()
        result: pandas.DataFrame = cells.unstack(["size", "from"]).sort_index().sort_index(axis=1)
        return result

    def page(self, path: str | os.PathLike[str], force: bool = False) -> Path:
        """Write an HTML page of the campaign, one file that needs no network, and return its path.

        Args:
            path: the file to write.
            force: also overwrite a file that is no page of a campaign.
        """
        from . import _page

        _page.write(self, Path(path), force)
        return Path(path)


def warn_of_measures(outcome: Outcome) -> bool:
    """Warn of runs that count as failed because a measure of theirs failed; return whether there are any."""
    if not outcome.unfinished.any():
        return False
    reasons = outcome.read(["reason"])["reason"][outcome.unfinished].astype(str)
    failed = reasons[reasons.str.startswith(MEASURE)]
    if len(failed):
        sentence = f"{len(failed)} of {len(outcome)} runs failed in a measure; run {failed.index[0]}: {failed.iloc[0]}"
        warnings.warn(f"{sentence} ({NO_VALUE})", stacklevel=4)
    return len(failed) > 0


def describe(limit: Mapping[str, float] | None) -> str:
    """Return a limit as text, such as ``"below 0.001"``."""
    return " and ".join(f"{word} {value:g}" for word, value in (limit or {}).items())


def evidence(outcome: Outcome, influence: pandas.DataFrame, measure: str) -> list[tuple[str, float, float]]:
    """Return each parameter that varies, its strength in 0 to 1 and p-value, the best evidence first.

    The strength of a numeric parameter is the absolute rank correlation in ``influence``. A text or a Boolean is
    compared with the failures, by Cramer's V and a permutation test, because a run that does not finish has no value
    of the measure; without failures with the measure, by the test of Kruskal and Wallis.
    """
    numeric = influence[influence["correlation"].notna()]
    rows = [(name, abs(rho), p) for name, rho, p in zip(numeric.index, numeric["correlation"], numeric["p_value"])]
    failed = outcome.failed(measure) if measure in outcome.limits else np.zeros(len(outcome), dtype=bool)
    values = np.asarray(outcome.read([measure])[measure].to_numpy(), dtype=np.float64)
    known = np.isfinite(values) & ~outcome.unfinished
    for name in [name for name, is_numeric in outcome.inputs.items() if not is_numeric]:
        groups = list(outcome.read([name]).groupby(name, observed=True).indices.values())
        if _varies(failed):
            counts = np.array([[len(group), failed[group].sum()] for group in groups])
            tested = _dependence_of_failures(counts)
        else:
            tested = _dependence_of_values([values[group][known[group]] for group in groups])
        if tested is not None:
            rows.append((name, *tested))
    # The least p-values of the tests differ by orders of magnitude: below 1e-3 the strength ranks.
    return sorted(rows, key=lambda row: (max(row[2], 1e-3), -row[1]))


def _sobol(
    problem: dict[str, Any],
    values: NDArray[np.float64],
    second: bool,
    base: int,
    confidence: float,
    seed: int,
) -> dict[str, Any]:
    """Call SALib in parts whose memory is bounded; pools the variances of the bootstrap.

    A part has ``base * resamples`` random rows; with n parts of equal size, the variance of all
    resamples is the mean of the variances of the parts. Small campaigns need one part.
    """
    analyze = package("SALib.analyze.sobol").analyze
    sizes = (_RESAMPLES, 50, 25, 10, 5, 2)
    size = next((size for size in sizes if size * base <= _ROWS_OF_A_CALL), sizes[-1])
    indices: dict[str, Any] = {}
    parts = _RESAMPLES // size
    # SALib takes the seed 0 for no seed.
    seeds = 1 + np.random.SeedSequence(seed).generate_state(parts).astype(np.int64)
    for part_seed in seeds:
        part = analyze(problem, values, second, size, confidence, seed=int(part_seed))
        for name, array in part.items():
            indices[name] = indices.get(name, 0.0) + array**2 / parts if name.endswith("_conf") else array
    return {name: np.sqrt(array) if name.endswith("_conf") else array for name, array in indices.items()}


def _group(values: NDArray[np.float64], failed: NDArray[Any]) -> dict[str, Any]:
    known = values[~np.isnan(values)]
    median = float(np.median(known)) if len(known) else math.nan
    return {"runs": len(values), "failed": float(np.mean(failed)), "median": median}


def _varies(values: NDArray[Any]) -> bool:
    return bool(values.min() < values.max())


def _dependence_of_failures(counts: NDArray[np.int64]) -> tuple[float, float] | None:
    """Return Cramer's V and its p-value by random permutations; a row has the runs and the failures of a value."""
    runs, failures = counts.T
    if len(runs) < 2:
        return None
    share = failures.sum() / runs.sum()

    def square(failures: NDArray[np.int64]) -> NDArray[np.float64]:
        return np.asarray(((failures - share * runs) ** 2 / (share * (1 - share) * runs)).sum(axis=-1))

    drawn = np.random.default_rng(0).multivariate_hypergeometric(runs, failures.sum(), _PERMUTATIONS)
    reached = int((square(drawn) >= square(failures) * (1 - 1e-9)).sum())
    return math.sqrt(float(square(failures)) / runs.sum()), (1 + reached) / (1 + _PERMUTATIONS)


def _dependence_of_values(groups: list[NDArray[np.float64]]) -> tuple[float, float] | None:
    """Return the root of the share of the variance of the ranks between the groups, and its p-value."""
    groups = [values for values in groups if len(values)]
    if len(groups) < 2 or not _varies(np.concatenate(groups)):
        return None
    test = package("scipy.stats").kruskal(*groups)
    return math.sqrt(test.statistic / (sum(map(len, groups)) - 1)), float(test.pvalue)


def _dependence(
    inputs: NDArray[np.float64], values: NDArray[np.float64], failed: NDArray[Any], spearman: Any
) -> dict[str, Any]:
    row: dict[str, Any] = {"value": None, "correlation": math.nan, "p_value": math.nan}
    row |= _group(values, failed)
    both = ~(np.isnan(inputs) | np.isnan(values))
    if both.sum() > 2 and _varies(inputs[both]) and _varies(values[both]):
        row["correlation"], row["p_value"] = map(float, spearman(inputs[both], values[both]))
    known = ~np.isnan(inputs)
    if known.any():
        low, high = np.quantile(inputs[known], [0.1, 0.9])
        row["lowest_tenth"] = float(np.mean(failed[known][inputs[known] <= low]))
        row["highest_tenth"] = float(np.mean(failed[known][inputs[known] >= high]))
    return row
