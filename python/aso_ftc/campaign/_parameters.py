"""Parameters of a campaign, and the designs that choose their values."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._words import similar
from ._entries import MOST_RUNS, fail, whole
from ._packages import package

__all__ = ["METHODS", "Parameter", "Place", "Sampled", "columns_of_table", "sample", "text"]

Numbers = NDArray[np.float64]

_RANGES = ("from", "to", "logarithmic", "steps")
# The entries of a design beside its method, with the smallest value of those that are counts.
METHODS: dict[str, dict[str, int | None]] = {
    "grid": {},
    "table": {"file": None},
    "random": {"runs": 1},
    "latin-hypercube": {"runs": 1},
    "sobol": {"runs": 1},
    "halton": {"runs": 1},
    "saltelli": {"base": 2, "second-order": None},
    "morris": {"trajectories": 2, "levels": 2},
    "fast": {"base": 65, "harmonics": 1},
}
_OPTIONAL: dict[str, dict[str, Any]] = {
    "saltelli": {"second-order": False},
    "morris": {"levels": 4},
    "fast": {"harmonics": 4},
}


def _number(place: str, entry: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        raise fail(place, f"{entry} = {value!r}: expected a finite number")
    return float(value)


@dataclass(frozen=True)
class Place:
    """A parameter as a run needs it: its name and what it sets."""

    name: str
    places: tuple[str, ...]


@dataclass(frozen=True)
class Parameter:
    """A parameter: what it sets, and which values it takes.

    Attributes:
        name: its name in the results.
        places: what it sets: variables ``"fmu.variable"``, entries such as ``"algorithm.step"``, or
            entries of a disturbance such as ``"noise.deviation"``.
        unit: the unit of the values, if known.
        levels: its values in a full factorial design; ``None`` for a distribution.
        kind: ``"integer"``, ``"number"`` or ``"text"`` (which includes Booleans).
        quantile: the value at a position in [0, 1).
    """

    name: str
    places: tuple[str, ...]
    unit: str | None
    levels: tuple[Any, ...] | None
    kind: str
    quantile: Callable[[Numbers], Sequence[Any]]

    @property
    def numeric(self) -> bool:
        """Whether all values are numbers."""
        return self.kind != "text"

    @property
    def place(self) -> Place:
        """Its name and what it sets."""
        return Place(self.name, self.places)

    @classmethod
    def read(cls, name: str, entry: Any, nominal: Callable[[str], tuple[Any, str | None]]) -> Parameter:
        """Read one entry of ``[parameters]``; ``nominal`` gives start value and unit of a variable."""
        place = f"parameters.{name}"
        if isinstance(entry, (list, tuple, range)):
            entry = {"values": list(entry)}
        elif _is_distribution(entry):
            entry = {"distribution": entry}
        if not isinstance(entry, Mapping):
            raise fail(place, f"expected a list of values or a table such as {{ from = 1.0, to = 2.0 }}, found {entry!r}")
        entries = dict(entry)
        places = entries.pop("set", [name])
        places = [places] if isinstance(places, str) else places
        if not places or not all(isinstance(text, str) for text in places):
            raise fail(place, f"set = {places!r}: expected names of variables")
        unit = entries.pop("unit", None)
        kinds = [kind for kind in ("values", "from", "relative", "distribution") if kind in entries]
        if len(kinds) != 1:
            raise fail(place, "expected one of values, from and to, relative, distribution")
        value, nominal_unit = (None, unit) if unit is not None and kinds[0] != "relative" else nominal(places[0])
        unit = nominal_unit if unit is None else unit
        make = {"values": _listed, "from": _range, "relative": _relative, "distribution": _distribution}
        levels, quantile = make[kinds[0]](place, entries, value)
        tried = quantile(np.array([0.25, 0.5])) if levels is None else levels
        return cls(name, tuple(places), unit, levels, _kind(tried), quantile)


def text(value: Any) -> str:
    """Return a value as it is in the results."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _kind(values: Iterable[Any]) -> str:
    if all(isinstance(value, int) and not isinstance(value, bool) for value in values):
        return "integer"
    return "text" if any(isinstance(value, (bool, str)) for value in values) else "number"


def _unknown(place: str, entries: Mapping[str, Any], known: Sequence[str]) -> None:
    for entry in entries:
        if entry not in known:
            hint = similar(entry, known) or f": expected {', '.join(known)}"
            raise fail(place, f"unknown entry {entry}{hint}")


def _is_distribution(value: Any) -> bool:
    return hasattr(value, "ppf") or hasattr(value, "icdf")


def _listed(place: str, entries: dict[str, Any], _: Any) -> tuple[Any, Any]:
    _unknown(place, entries, ["values", "set", "unit"])
    values = entries["values"]
    if not isinstance(values, (list, tuple)) or not values:
        raise fail(place, f"values = {values!r}: expected a list of at least one value")
    if not all(isinstance(value, (bool, int, float, str)) for value in values):
        raise fail(place, "values: expected numbers, true, false or texts")
    levels = tuple(values)
    return levels, partial(_level, levels)


def _level(levels: tuple[Any, ...], unit: Numbers) -> list[Any]:
    return [levels[int(i)] for i in np.minimum(unit * len(levels), len(levels) - 1)]


def _between(place: str, entries: Mapping[str, Any], low: float, high: float) -> tuple[Any, Any]:
    logarithmic = entries.get("logarithmic", False)
    if not isinstance(logarithmic, bool):
        raise fail(place, f"logarithmic = {logarithmic!r}: expected true or false")
    if not low < high:
        raise fail(place, f"from = {low}, to = {high}: expected from below to")
    if logarithmic and low <= 0:
        raise fail(place, f"from = {low}: a logarithmic range starts above 0")

    quantile = partial(_in_range, low, high, logarithmic)
    levels = None
    if "steps" in entries:
        steps = whole(f"{place}.steps", entries["steps"], 2, MOST_RUNS)
        inner = quantile(np.linspace(0.0, 1.0, steps))[1:-1]
        levels = (low, *(float(value) for value in inner), high)
    return levels, quantile


def _in_range(low: float, high: float, logarithmic: bool, unit: Numbers) -> Any:
    linear = low + unit * (high - low)
    value = np.exp(np.log(low) + unit * (np.log(high) - np.log(low))) if logarithmic else linear
    # The rounded value at an end may be beyond it.
    return np.clip(value, low, high)


def _range(place: str, entries: dict[str, Any], _: Any) -> tuple[Any, Any]:
    _unknown(place, entries, [*_RANGES, "set", "unit"])
    if "to" not in entries:
        raise fail(place, "from without to")
    levels, quantile = _between(place, entries, _number(place, "from", entries["from"]), _number(place, "to", entries["to"]))
    ends = (entries["from"], entries["to"])
    if levels is not None and all(isinstance(end, int) for end in ends) and "logarithmic" not in entries:
        # Whole levels stay whole: variables of type Integer take no 1.0.
        size, rest = divmod(ends[1] - ends[0], entries["steps"] - 1)
        levels = tuple(range(ends[0], ends[1] + 1, size)) if rest == 0 else levels
    return levels, quantile


def _relative(place: str, entries: dict[str, Any], value: Any) -> tuple[Any, Any]:
    _unknown(place, entries, ["relative", "steps", "set", "unit"])
    part = _number(place, "relative", entries["relative"])
    if part <= 0:
        raise fail(place, f"relative = {part}: expected a number above 0")
    if isinstance(value, (bool, str)) or value is None or value == 0:
        raise fail(place, f"relative needs a start value other than 0, found {value!r}")
    ends = sorted((value * (1 - part), value * (1 + part)))
    return _between(place, entries, *ends)


def _distribution(place: str, entries: dict[str, Any], _: Any) -> tuple[Any, Any]:
    stats = package("scipy.stats")
    name = entries["distribution"]
    if _is_distribution(name):
        _unknown(place, entries, ["distribution", "set", "unit"])
        # A frozen distribution, or one of the classes of scipy.stats.
        quantile = name.ppf if hasattr(name, "ppf") else name.icdf
        if not np.isfinite(quantile(np.array([0.25, 0.5, 0.75]))).all():
            raise fail(place, "the distribution has no quantiles: its arguments are out of range")
        return None, partial(_integers, name) if isinstance(getattr(name, "dist", None), stats.rv_discrete) else quantile
    family: Any = getattr(stats, name, None) if isinstance(name, str) else None
    discrete = isinstance(family, stats.rv_discrete)
    if not isinstance(family, stats.rv_continuous) and not discrete:
        kinds = (stats.rv_continuous, stats.rv_discrete)
        hint = similar(name, [attribute for attribute in dir(stats) if isinstance(getattr(stats, attribute), kinds)])
        raise fail(place, f"distribution = {name!r}: expected a name of scipy.stats, such as norm{hint}")
    shapes = [] if family.shapes is None else [text.strip() for text in family.shapes.split(",")]
    allowed = [*shapes, "loc"] if discrete else [*shapes, "loc", "scale"]
    _unknown(place, entries, ["distribution", *allowed, "set", "unit"])
    missing = [shape for shape in shapes if shape not in entries]
    if missing:
        raise fail(place, f"distribution {name} needs {', '.join(missing)}")
    frozen = family(**{key: _number(place, key, entries[key]) for key in allowed if key in entries})
    if not np.isfinite(frozen.ppf([0.25, 0.5, 0.75])).all():
        raise fail(place, f"distribution {name} has no quantiles for these entries: they are out of range")
    return None, partial(_integers, frozen) if discrete else frozen.ppf


def _integers(frozen: Any, unit: Numbers) -> list[Any]:
    """Return the quantiles of a discrete distribution as integers; an end that it does not have is infinite.

    At the position 0 scipy has the number below the smallest one.
    """
    values = np.maximum(frozen.ppf(unit), frozen.support()[0])
    return [int(value) if np.isfinite(value) else value for value in values]


@dataclass(frozen=True)
class Sampled:
    """The values of a design.

    Attributes:
        values: a column for each parameter.
        unit: positions in [0, 1], one row for each run and one column for each parameter; ``None``
            for a grid or a table.
    """

    values: dict[str, Any]
    unit: Numbers | None
    rows: int


def _options(design: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    method = design.get("method")
    if method not in METHODS:
        hint = similar(method, METHODS)
        raise fail("design", f"method = {method!r}: expected one of {', '.join(METHODS)}{hint}")
    options = {**_OPTIONAL.get(method, {}), **{key: value for key, value in design.items() if key != "method"}}
    _unknown("design", options, ["method", *METHODS[method]])
    for entry, least in METHODS[method].items():
        if entry not in options:
            raise fail("design", f"method {method} needs {entry}")
        if least is not None:
            whole(f"design.{entry}", options[entry], least, MOST_RUNS)
    return method, options


def sample(
    design: Mapping[str, Any], parameters: Sequence[Parameter], seed: int
) -> tuple[dict[str, Any], Sampled]:
    """Return the complete design and its values.

    The same design, parameters and seed give the same values on every machine with the same versions
    of NumPy, scipy and SALib; a campaign that goes on compares them with those in its folder.
    """
    method, options = _options(design)
    complete = {"method": method, **options}
    if method == "table":
        values: dict[str, Any] = {parameter.name: list(parameter.levels or ()) for parameter in parameters}
        return {**complete, "file": str(options["file"])}, Sampled(values, None, len(next(iter(values.values()))))
    if not parameters:
        if method != "grid":
            raise fail("parameters", f"a design {method} needs at least one parameter")
        return complete, Sampled({}, None, 1)
    if method == "grid":
        return complete, _grid(parameters)
    unit = _unit(method, options, len(parameters), seed)
    values = {}
    for column, parameter in enumerate(parameters):
        quantiles = parameter.quantile(unit[:, column])
        if parameter.numeric and not np.isfinite(np.asarray(quantiles, dtype=float)).all():
            raise fail(
                f"parameters.{parameter.name}",
                f"the design {method} reaches the ends of a distribution that has none: "
                "use a bounded one, such as truncnorm, or from and to",
            )
        values[parameter.name] = quantiles
    return complete, Sampled(values, unit, len(unit))


def _grid(parameters: Sequence[Parameter]) -> Sampled:
    for parameter in parameters:
        if parameter.levels is None:
            raise fail(f"parameters.{parameter.name}", "a grid needs values, or from and to with steps")
    levels = [parameter.levels or () for parameter in parameters]
    count = math.prod(map(len, levels))
    if count > MOST_RUNS:
        raise fail("design", f"the grid has {count} runs, expected at most {MOST_RUNS}")
    places = np.unravel_index(np.arange(np.prod([len(axis) for axis in levels])), [len(axis) for axis in levels])
    values = {
        parameter.name: [axis[i] for i in column]
        for parameter, axis, column in zip(parameters, levels, places, strict=True)
    }
    return Sampled(values, None, len(places[0]))


def columns_of_table(file: Any, folder: Path) -> dict[str, list[Any]]:
    """Return the columns of a user's .csv or .parquet file, without a column ``run``."""
    if not isinstance(file, (str, os.PathLike)):
        raise fail("design.file", f"{file!r}: expected the path of a .csv or .parquet file")
    path = folder / file
    kind = "parquet" if path.suffix == ".parquet" else "csv"
    reader = package(f"pyarrow.{kind}")
    try:
        table = reader.read_table(path) if kind == "parquet" else reader.read_csv(path)
    except (OSError, ValueError) as error:
        raise fail("design.file", f"{path} cannot be read as a table: {error}") from None
    names = table.column_names
    if double := [name for name in names if names.count(name) > 1]:
        raise fail("design.file", f"{path} has several columns {double[0]}, expected different names")
    columns = {name: table[name].to_pylist() for name in names if name != "run"}
    if not table.num_rows or not columns:
        raise fail("design.file", f"{path} has no values")
    for name, column in columns.items():
        for row, value in enumerate(column, 1):
            if value is None or (isinstance(value, float) and not np.isfinite(value)):
                raise fail("design.file", f"{path}, row {row}: {name} has no value")
    return columns


def _unit(method: str, options: Mapping[str, Any], count: int, seed: int) -> Numbers:
    if method == "random":
        return np.random.default_rng(seed).random((options["runs"], count))
    if method in ("latin-hypercube", "sobol", "halton"):
        qmc = package("scipy.stats").qmc
        engine = {"latin-hypercube": qmc.LatinHypercube, "sobol": qmc.Sobol, "halton": qmc.Halton}[method]
        runs = options["runs"]
        if method == "sobol" and runs & (runs - 1):
            power = 1 << (runs - 1).bit_length()
            warnings.warn(
                f"design: {runs} Sobol points are not balanced, a power of two such as {power} is",
                stacklevel=2,
            )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            return np.asarray(engine(count, rng=np.random.default_rng(seed)).random(runs))
    problem = {"num_vars": count, "names": [f"x{i}" for i in range(count)], "bounds": [[0.0, 1.0]] * count}
    if method == "saltelli":
        if options["base"] & (options["base"] - 1):
            raise fail("design", f"base = {options['base']}: expected a power of two")
        sampler = package("SALib.sample.sobol")
        return np.asarray(
            sampler.sample(problem, options["base"], calc_second_order=options["second-order"], seed=seed)
        )
    if method == "morris":
        sampler = package("SALib.sample.morris")
        unit = sampler.sample(problem, options["trajectories"], num_levels=options["levels"], seed=seed)
        return np.asarray(unit)
    least = 4 * options["harmonics"] ** 2 + 1
    if options["base"] < least:
        raise fail("design", f"base = {options['base']}: {options['harmonics']} harmonics need at least {least}")
    sampler = package("SALib.sample.fast_sampler")
    return np.asarray(sampler.sample(problem, options["base"], M=options["harmonics"], seed=seed))
