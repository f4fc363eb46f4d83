"""A campaign: a system, a plan of runs and what is measured in each run."""

from __future__ import annotations

import hashlib
import inspect
import itertools
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._arrays import plain
from .._errors import ConfigurationError, Error
from .._html import page
from .._paper import paper
from .._system import PathLike, System, fault, hash_of_file, stated
from .._words import similar
from ._analysis import FAULT_COLUMNS
from ._changes import arguments, changes
from ._entries import TABLES, fail, finite, only, positive, table, whole
from ._faults import NO_FAULT, FaultCase, cases, disturbances
from ._measures import PAPER_CLAIMS, Expression
from ._parameters import Parameter, Sampled, columns_of_table, sample, text

if TYPE_CHECKING:
    from ._analysis import Outcome
    from ._search import RareEvent, WorstCase

__all__ = ["Campaign", "Function", "Plan", "check_arguments"]

# A function of the user: file and name, or the function itself.
Function = tuple[str, str] | Callable[..., Any]

_ENTRIES = {
    "name", "system", "seed", "design", "parameters", "disturbances", "faults", "measures", "claims",
    "limits", "keep", "stop", "record-every", "runs-per-task", "isolate", "time-limit", "memory-limit",
    "settings", "algorithm", "experiment",
}  # fmt: skip
_NAME = re.compile(r"[\w.\-\[\], ()]+")
# The columns of the results beside parameters, measures and those of faults.
_COLUMNS = ("run", "status", "reason", "seconds", "fault")


@dataclass(frozen=True)
class Plan:
    """The runs of a campaign: every row of the design with every fault; faults change fastest."""

    design: dict[str, Any]
    sampled: Sampled
    faults: tuple[FaultCase, ...]

    def __len__(self) -> int:
        return self.sampled.rows * len(self.faults)

    def row(self, run: int) -> tuple[dict[str, Any], int]:
        """Return the values of the parameters and the number of the fault of a run."""
        row, case = divmod(run, len(self.faults))
        return {name: _plain(column[row]) for name, column in self.sampled.values.items()}, case


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


class Campaign:
    """A system and a plan of many runs; what a ``campaign.toml`` states.

    Args:
        system: a :class:`System`, the path of a ``system.toml`` or of a system structure, or ``"paper"``
            for the loop of :func:`aso_ftc.paper`.
        parameters: what varies, by name: a list of values, a distribution of scipy.stats, or a table with ``values``; ``from`` and
            ``to`` (with ``steps``, ``logarithmic``); ``relative``; or ``distribution`` with the entries of
            that distribution in scipy.stats. ``set`` names what it sets if that is not its own name.
        design: ``method`` (``"grid"``, ``"table"``, ``"random"``, ``"latin-hypercube"``, ``"sobol"``,
            ``"halton"``, ``"saltelli"``, ``"morris"``, ``"fast"``) and its entries; default: a grid.
        measures: by name an expression, a function ``function(results, values)`` that returns a number, or
            a table with ``expression`` or ``python`` (the function, or ``"file.py:function"``) and
            ``unfinished``, the value for a run that does not finish (NaN).
        limits: by measure: ``{"below": number}`` or ``{"above": number}``.
        disturbances: faults that all runs have, by name; parameters can set their entries.
        faults: faults of which each run has one; lists in an entry mean every combination.
        keep: whose signals are kept: ``runs``, ``unfinished``, ``outside`` (of a limit), ``record``, ``every``.
        stop: ends a random campaign when the interval of a limit is narrow: ``limit``, ``width``,
            ``confidence``.
        options: further entries of a ``campaign.toml`` with underscores: ``seed``, ``name``, ``claims``,
            ``record_every``, ``runs_per_task``, ``isolate``, ``time_limit``, ``memory_limit``, ``settings``,
            ``algorithm``, ``experiment``, and ``folder``, where relative paths start.

    Raises:
        ConfigurationError: an entry is wrong.
        MissingPackageError: the packages of the extra ``campaign`` are not installed.
    """

    def __init__(
        self,
        system: System | PathLike,
        *,
        parameters: Mapping[str, Any] | None = None,
        design: Mapping[str, Any] | None = None,
        measures: Mapping[str, Any] | None = None,
        limits: Mapping[str, Any] | None = None,
        disturbances: Mapping[str, Any] | None = None,
        faults: Sequence[Mapping[str, Any]] | None = None,
        keep: Mapping[str, Any] | None = None,
        stop: Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        folder = options.pop("folder", None)
        entries: dict[str, Any] = {name.replace("_", "-"): value for name, value in options.items()}
        entries["system"] = system
        entries |= stated({
            "parameters": parameters, "design": design, "measures": measures, "limits": limits,
            "disturbances": disturbances, "faults": faults, "keep": keep, "stop": stop,
        })  # fmt: skip
        for name in TABLES:
            if isinstance(entries.get(name), Mapping):
                entries[name] = {str(entry).replace("_", "-"): value for entry, value in entries[name].items()}
        self._read(entries, Path(folder) if folder is not None else Path.cwd())

    @classmethod
    def from_toml(cls, path: PathLike) -> Campaign:
        """Read a ``campaign.toml``. Relative paths start in its folder."""
        path = Path(path)
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigurationError(f"cannot read {path}: {error}", "File", {"path": str(path)}) from None
        campaign = cls.__new__(cls)
        try:
            entries = _core.parse_toml(text)
            entries.setdefault("name", path.stem)
            campaign._read(entries, path.absolute().parent)
        except ConfigurationError as error:
            fields = {**error.fields, "path": str(path), "line": _line(text, error.fields.get("name"))}
            where = str(path) if fields["line"] is None else f"{path}:{fields['line']}"
            raise ConfigurationError(f"{where}: {error}", error.kind, fields) from None
        return campaign

    def _read(self, entries: dict[str, Any], folder: Path) -> None:
        entries = plain(entries)
        only("", entries, sorted(_ENTRIES))
        self.name: str = str(entries.get("name", "campaign"))
        if not _NAME.fullmatch(self.name):
            raise fail("name", f"{self.name!r}: expected letters, digits, spaces, dots, - and _")
        self.seed: int = whole("seed", entries.get("seed", 0), 0)
        self.system: System = _system(entries, folder)
        self.isolate: bool = bool(entries.get("isolate", False))
        limit = entries.get("time-limit")
        self.time_limit: float | None = None if limit is None else positive("time-limit", limit)
        self.memory_limit: Any = entries.get("memory-limit")
        if self.memory_limit is not None and not self.isolate:
            raise fail("memory-limit", "a limit of memory needs isolate = true")
        if self.isolate:
            # An FMU may also crash while it is opened for a check.
            limits = {"time-limit": self.time_limit, "memory-limit": self.memory_limit}
            self.system.isolation.update({"isolate": True, **stated(limits)})
        self.record_every: Any = entries.get("record-every", "step")
        self._variables = {variable.name: variable for variable in self.system.variables()}
        self.disturbances: dict[str, dict[str, Any]] = disturbances(entries.get("disturbances", {}))
        self.parameters: list[Parameter] = self._parameters(entries, folder)
        self.cases: tuple[FaultCase, ...] = cases(entries.get("faults", []), self._inputs)
        self._measures(entries, folder)
        design = table("design", entries.get("design", {"method": "grid"}))
        complete, sampled = sample(design, self.parameters, self.seed)
        self.plan: Plan = Plan(complete, sampled, self.cases or (NO_FAULT,))
        self.keep: dict[str, Any] = self._keep(entries.get("keep"))
        self.stop: dict[str, Any] = self._stop(entries.get("stop"))
        # Independent of the number of workers, so that the parts are.
        share = min(50, max(10, len(self.plan) // 64))
        self.runs_per_task: int = whole("runs-per-task", entries.get("runs-per-task", share), 1, 10_000)
        self.check()

    # The parts of a campaign.toml, in the order in which they are read.

    def _inputs(self) -> list[str]:
        """The inputs that a connection drives, which are those that a fault can disturb."""
        inputs = []
        for name, variable in self._variables.items():
            if variable.causality == "input" and variable.type in ("Real", "Float64", "Float32"):
                try:
                    self.system.check(faults=[fault(name, "bias", value=0.0)])
                except Error:
                    continue
                inputs.append(name)
        return inputs

    def _nominal(self, place: str) -> tuple[Any, str | None]:
        variable = self._variables.get(place)
        if variable is None:
            times = ("-time", ".seconds", ".every", ".from", ".until", ".lost", ".period")
            is_step = place.startswith("algorithm.") and place.endswith("step")
            return None, "s" if is_step or place.replace("_", "-").endswith(times) else None
        return self.system.start_values.get(place, variable.start), variable.unit

    def _parameters(self, entries: Mapping[str, Any], folder: Path) -> list[Parameter]:
        definitions = table("parameters", entries.get("parameters", {}))
        design = entries.get("design", {})
        if isinstance(design, Mapping) and design.get("method") == "table":
            columns = columns_of_table(design.get("file"), folder)
            for name in definitions:
                if name not in columns:
                    known = ", ".join(columns)
                    raise fail(f"parameters.{name}", f"the table has no such column, it has {known}")
            definitions = {
                name: {**table(f"parameters.{name}", entry), "values": columns[name]}
                for name, entry in (definitions or dict.fromkeys(columns, {})).items()
            }
        parameters = []
        for name, entry in definitions.items():
            if not _NAME.fullmatch(name):
                raise fail(f"parameters.{name}", "a name has letters, digits, dots and brackets")
            if name in (*_COLUMNS, *FAULT_COLUMNS, "row"):
                raise fail(f"parameters.{name}", "a column of the results has this name, choose another one, with `set`")
            parameter = Parameter.read(name, entry, self._nominal)
            for place in parameter.places:
                self._check_place(f"parameters.{name}", place)
            parameters.append(parameter)
        owners: dict[str, str] = {}
        for parameter in parameters:
            for place in parameter.places:
                if place in owners:
                    raise fail(f"parameters.{parameter.name}", f"{place} is set by {owners[place]}, too")
                owners[place] = parameter.name
        return parameters

    def _check_place(self, where: str, place: str) -> None:
        first, _, entry = place.partition(".")
        if (first in self.disturbances and entry) or first in TABLES or place in self._variables:
            return
        hint = similar(place, self._variables)
        raise fail(where, f"{place} is neither a variable of the system nor an entry of a disturbance{hint}")

    def _measures(self, entries: Mapping[str, Any], folder: Path) -> None:
        measures = table("measures", entries.get("measures", {}))
        if entries.get("claims", False):
            measures = {**PAPER_CLAIMS, **measures}
        if not measures:
            raise fail(
                "measures", 'a campaign needs at least one measure, such as peak = "max(abs(plant.x))"'
            )
        self.expressions: dict[str, Expression] = {}
        self.functions: dict[str, Function] = {}
        self.unfinished: dict[str, float] = {}
        columns = {*_COLUMNS, *(parameter.name for parameter in self.parameters)}
        for name, entry in measures.items():
            if name in columns or name.startswith(("fault.", "unit:")):
                raise fail(f"measures.{name}", "a column of the results has this name, choose another one")
            short = {"expression": entry} if isinstance(entry, str) else {"python": entry}
            is_short = isinstance(entry, str) or callable(entry)
            measure = short if is_short else table(f"measures.{name}", entry)
            if "unfinished" in measure:
                self.unfinished[name] = finite(f"measures.{name}.unfinished", measure.pop("unfinished"))
            if set(measure) == {"expression"}:
                self.expressions[name] = Expression(name, str(measure["expression"]))
            elif set(measure) == {"python"}:
                self.functions[name] = _function(f"measures.{name}", measure["python"], folder)
            else:
                raise fail(
                    f"measures.{name}", 'expected an expression, a function, or { python = "file.py:function" }'
                )
        self.limits: dict[str, Any] = table("limits", entries.get("limits", {}))
        for name, limit in self.limits.items():
            if name not in measures:
                hint = similar(name, measures)
                raise fail(f"limits.{name}", f"no measure has this name, there are {', '.join(measures)}{hint}")
            limit = table(f"limits.{name}", limit)
            if len(limit) != 1 or not set(limit) <= {"below", "above"}:
                raise fail(f"limits.{name}", "expected { below = number } or { above = number }")
            finite(f"limits.{name}", next(iter(limit.values())))

    def _keep(self, entry: Any) -> dict[str, Any]:
        keep = table("keep", {} if entry is None else entry)
        only("keep", keep, ["runs", "unfinished", "outside", "record", "every"])
        for name in ("runs", "outside", "record"):
            if not isinstance(keep.get(name, []), list):
                raise fail(f"keep.{name}", f"{keep[name]!r}: expected a list")
        for run in keep.get("runs", []):
            if isinstance(run, bool) or not isinstance(run, int) or not 0 <= run < len(self.plan):
                raise fail("keep.runs", f"{run!r}: expected numbers of runs, 0 to {len(self.plan) - 1}")
        for name in keep.get("outside", []):
            if name not in self.limits:
                raise fail("keep.outside", f"{name!r} has no limit")
        return keep

    def _stop(self, entry: Any) -> dict[str, Any]:
        stop = table("stop", {} if entry is None else entry)
        if not stop:
            return stop
        only("stop", stop, ["limit", "width", "confidence"])
        if stop.get("limit") not in self.limits:
            raise fail("stop.limit", f"{stop.get('limit')!r}: expected a measure with a limit")
        if self.plan.design["method"] != "random":
            raise fail("stop", "only runs of a design random are independent, so that they can end early")
        if len(self.plan.faults) > 1:
            raise fail(
                "stop", "a campaign with several faults has one probability for each, it cannot end early"
            )
        stop.setdefault("confidence", 0.95)
        for name in ("width", "confidence"):
            if not positive(f"stop.{name}", stop.get(name)) < 1:
                raise fail(f"stop.{name}", f"{stop[name]!r}: expected a number below 1")
        return stop

    # What a run does.

    def __len__(self) -> int:
        return len(self.plan)

    @property
    def signals(self) -> list[str]:
        """The signals that the expressions read."""
        return sorted(set().union(*(expression.signals for expression in self.expressions.values())))

    def sources(self) -> list[str]:
        """Return the paths of the files with functions of the user."""
        return [function[0] for function in self.functions.values() if isinstance(function, tuple)]

    def changes(self, run: int) -> dict[str, Any]:
        """Return the arguments of :meth:`System.run` with the values and the fault of a run."""
        values, case = self.plan.row(run)
        return changes(
            [parameter.place for parameter in self.parameters],
            self.disturbances,
            self.plan.faults[case],
            values,
            self.seed,
            run,
        )

    def describe(self) -> dict[str, Any]:
        """Return everything that the results depend on, for the manifest of the folder."""
        return {
            "system": self.system.to_dict(),
            "files": {**self.system.files(), **{path: hash_of_file(path) for path in self.sources()}},
            "seed": self.seed,
            "design": self.plan.design,
            "runs": len(self.plan),
            "plan": _digest_of_plan(self.plan),
            "parameters": [
                {
                    "name": parameter.name,
                    "set": list(parameter.places),
                    "unit": parameter.unit,
                    "numeric": parameter.numeric,
                    "levels": None if parameter.numeric else {text(value): value for value in parameter.levels or ()},
                }
                for parameter in self.parameters
            ],
            "disturbances": self.disturbances,
            "cases": [case.entry for case in self.plan.faults],
            "faults": bool(self.cases),
            "measures": self._described(),
            "limits": self.limits,
            "keep": self.keep,
            "stop": self.stop,
            "record-every": self.record_every,
            "runs-per-task": self.runs_per_task,
            "isolate": self.isolate,
            "time-limit": self.time_limit,
            "memory-limit": self.memory_limit,
        }

    def _described(self) -> dict[str, dict[str, Any]]:
        measures: dict[str, dict[str, Any]] = {
            **{name: {"expression": expression.text} for name, expression in self.expressions.items()},
            **{name: _describe_function(function) for name, function in self.functions.items()},
        }
        for name, value in self.unfinished.items():
            measures[name]["unfinished"] = value
        return measures

    def check(self) -> None:
        """Find what is known before the first run: tries the first and the last run without a step.

        Raises:
            ConfigurationError, FmuError: the first error.
        """
        recorded = self.signals
        for name in recorded:
            if name not in self._variables:
                reader = next(key for key, expression in self.expressions.items() if name in expression.signals)
                hint = similar(name, self._variables)
                raise fail(f"measures.{reader}", f"the system has no variable {name}{hint}")
        # Without this check, an error in the signals to keep would leave out the files of all of them.
        recordings = [{"record": recorded or None, "record_every": self.record_every}]
        recordings += [{"record": self.keep.get("record"), "record_every": self.keep.get("every")}] if self.keep else []
        for run, recording in itertools.product(sorted({0, len(self.plan) - 1}), recordings):
            try:
                self.system.check(**arguments(self.changes(run)), **recording)
            except ConfigurationError as error:
                text = f"{self.name}, run {run}: {error}"
                raise ConfigurationError(text, error.kind, error.fields) from None
        self._check_times()
        zeros = {name: np.zeros(2) for name in recorded}
        known = self.plan.row(0)[0]
        for key, expression in self.expressions.items():
            for name in expression.parameters:
                if name not in known:
                    hint = similar(name, known)
                    raise fail(f"measures.{key}", f"the campaign has no parameter {name}{hint}")
            expression.value(zeros, np.array([0.0, 1.0]), known)

    def _check_times(self) -> None:
        """Find a stop time that is not after the start time, in every row of the design."""
        defaults = {"start-time": 0.0, "stop-time": np.inf}
        times = {name: self.system.experiment.get(name, default) for name, default in defaults.items()}
        where = "experiment.stop-time"
        for parameter in self.parameters:
            for place in parameter.places:
                table, _, entry = place.replace("_", "-").partition(".")
                if table == "experiment" and entry in times and parameter.numeric:
                    times[entry] = np.asarray(self.plan.sampled.values[parameter.name], dtype=float)
                    where = f"parameters.{parameter.name}"
        start, stop = np.broadcast_arrays(times["start-time"], times["stop-time"])
        wrong = np.flatnonzero(stop <= start)
        if len(wrong):
            start, stop = start.flat[wrong[0]], stop.flat[wrong[0]]
            raise fail(where, f"stop time {stop:g} s: expected more than the start time, {start:g} s")

    def run(
        self,
        folder: PathLike,
        *,
        workers: int | None = None,
        scheduler: str | None = None,
        progress: bool = True,
        live: Callable[[str], None] | None = None,
    ) -> Outcome:
        """Do all runs that the folder does not have yet, and return the results.

        Local workers are processes: in a script, call this below ``if __name__ == "__main__":``.

        Args:
            folder: the folder of the campaign, a new one or one where this campaign was interrupted.
            workers: number of local processes; default: the number of processors.
            scheduler: the address of a Dask scheduler instead of local processes.
            progress: show a line with the progress on a terminal and in a notebook.
            live: serve a page on this machine that shows the runs while they are done; gets its address.

        Raises:
            ConfigurationError: something is wrong that is known before the first run, the folder has
                another campaign, or another process runs a campaign in it.
            Error: a measure fails in each of the first runs, the scheduler was lost, or the disk is full. The same call
                goes on.
        """
        from ._engine import execute

        count = None if workers is None else whole("workers", plain(workers), 1)
        return execute(
            self, Path(folder), workers=count, scheduler=scheduler, progress=progress, live=live
        )

    def worst_case(
        self,
        folder: PathLike,
        measure: str,
        *,
        smallest: bool = False,
        workers: int | None = None,
        scheduler: str | None = None,
    ) -> WorstCase:
        """Search the parameters for the run with the largest value of a measure, over all faults.

        Needs a design ``{"method": "random", "runs": number}``, whose runs are those of the whole search. The same
        seed gives the same search, and an interrupted one goes on. A run that does not finish is the worst.

        Args:
            folder: a new folder, or that of this search.
            measure: the name of a measure.
            smallest: search for the smallest value.
            workers, scheduler: as for :meth:`run`.

        Raises:
            ConfigurationError, Error: as for :meth:`run`.
        """
        from ._search import worst_case

        if measure not in (*self.expressions, *self.functions):
            raise fail("measure", f"{measure!r}: expected one of {', '.join((*self.expressions, *self.functions))}")
        return worst_case(self, Path(folder), measure, smallest=smallest, workers=workers, scheduler=scheduler)

    def rare_event(
        self, folder: PathLike, limit: str, *, workers: int | None = None, scheduler: str | None = None
    ) -> RareEvent:
        """Estimate the probability that a limit is violated, down to 1e-6 and less, by subset simulation.

        Needs the package openturns and a design ``{"method": "random", "runs": number}``, whose runs are those of
        one level, such as 500; each level divides the probability by about 10. The same seed gives the same runs, and
        an interrupted estimate goes on. With faults, a row of parameters fails if one of its faults does.

        Args:
            folder: a new folder, or that of this estimate.
            limit: the name of a measure with a limit.
            workers, scheduler: as for :meth:`run`.

        Raises:
            ConfigurationError, Error: as for :meth:`run`.
        """
        from ._search import rare_event

        return rare_event(self, Path(folder), limit, workers=workers, scheduler=scheduler)

    def __repr__(self) -> str:
        return f"Campaign({self.name!r}, {len(self)} runs of {self.system!r})"

    def _repr_html_(self) -> str:
        rows = []
        for parameter in self.parameters:
            values = self.plan.sampled.values[parameter.name]
            ends = [f"{min(values):.6g}", f"{max(values):.6g}"] if parameter.numeric else ["", ""]
            rows.append([parameter.name, parameter.unit or "", *ends, ", ".join(parameter.places)])
        return page(repr(self), ("parameter", "unit", "min", "max", "sets"), rows)


def _system(entries: dict[str, Any], folder: Path) -> System:
    if "system" not in entries:
        raise fail("system", 'a campaign needs a system: a system.toml, an SSP or "paper"')
    source = entries["system"]
    if isinstance(source, System):
        system = source.copy()
    elif source == "paper":
        system = paper()
    elif isinstance(source, (str, os.PathLike)):
        path = folder / source
        if not path.exists():
            raise fail("system", f"there is no file {path}")
        system = System.from_toml(path) if path.suffix == ".toml" else System.from_ssp(path)
    else:
        raise fail("system", f'{source!r}: expected a path or "paper"')
    for name, value in table("settings", entries.get("settings", {})).items():
        system.start_values[name] = value
    for name in TABLES:
        getattr(system, name).update(table(name, entries.get(name, {})))
    system.results.pop("file", None)
    return system


def _function(place: str, text: Any, folder: Path) -> Function:
    if callable(text):
        check_arguments(place, text)
        function: Function = text
        return function
    path, _, name = str(text).rpartition(":")
    if not path or not name.isidentifier():
        raise fail(place, f'{text!r}: expected "file.py:function"')
    file = (folder / path).absolute()
    if not file.is_file():
        raise fail(place, f"there is no file {file}")
    return str(file), name


def check_arguments(place: str, function: Callable[..., Any]) -> None:
    """Refuse a function that cannot be called with results and values."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        # Some functions in C have none.
        return
    try:
        signature.bind(None, None)
    except TypeError:
        stated = f"{getattr(function, '__name__', 'function')}{signature}"
        raise fail(place, f"expected a function of two arguments, such as f(results, values), found {stated}") from None


def _describe_function(function: Function) -> dict[str, str]:
    """Return a function of the user for the manifest; one without a file with a hash of its code."""
    if isinstance(function, tuple):
        return {"python": ":".join(function)}
    try:
        text = inspect.getsource(function)
    except (OSError, TypeError):
        code = getattr(function, "__code__", None)
        text = repr((code.co_code, code.co_consts)) if code is not None else repr(function)
    name = f"{getattr(function, '__module__', '')}:{getattr(function, '__qualname__', repr(function))}"
    return {"python": name, "code": hashlib.sha256(text.encode()).hexdigest()}


def _digest_of_plan(plan: Plan) -> str:
    digest = hashlib.sha256()
    for name, column in plan.sampled.values.items():
        array = np.asarray(column)
        if array.dtype.kind in "OU":
            digest.update(json.dumps([name, [_plain(value) for value in column]]).encode())
        else:
            digest.update(name.encode() + b"\0" + array.tobytes())
    return digest.hexdigest()


def _line(text: str, place: str | None) -> int | None:
    """The line of ``table.entry`` in the text of a file, as far as the words show it."""
    if not place:
        return None
    table, _, entry = place.partition(".")
    table = table.partition("[")[0]
    inside = False
    first = None
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#")[0].strip()
        heading = words.strip("[] ").replace('"', "")
        if words.startswith("["):
            inside = heading == table or heading.startswith(f"{table}.")
            if inside and first is None:
                first = number
            if heading == place:
                return number
        key = words.partition("=")[0].strip().strip("\"'")
        if "=" in words and key.replace('"', "") in (([entry] if inside else []) if entry else [table]):
            return number
    return first
