"""Results of a run, in memory."""

from __future__ import annotations

import html
import importlib
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from . import _core
from ._errors import MissingPackageError

if TYPE_CHECKING:
    import matplotlib.figure
    import numpy
    import pandas
    import polars
    import pyarrow
    import xarray
    from numpy.typing import NDArray

__all__ = ["Results"]

# Most variables that a picture or a table shows by itself.
_SHOWN = 20


def _package(name: str, purpose: str) -> Any:
    """Import a package that is optional."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = name.split(".", 1)[0]
        sentence = f"{purpose} needs the package {package}: python -m pip install {package}"
        raise MissingPackageError(sentence, "MissingPackage", {"package": package}) from error


class Results:
    """The recorded variables of a run, one row for each recorded time.

    ``results["fmu.variable"]`` is a NumPy array with the memory of the results, which is read-only. The
    object has the Arrow interface ``__arrow_c_stream__``, so that ``pyarrow.table(results)``,
    ``polars.DataFrame(results)`` and others read it without copies.
    """

    def __init__(self, outcome: _core.Outcome) -> None:
        self._outcome = outcome
        self._table = outcome.table
        self._columns: dict[str, NDArray[Any]] = {}
        self._plot: tuple[str, ...] = ()

    def __getstate__(self) -> tuple[_core.Outcome, tuple[str, ...]]:
        return self._outcome, self._plot

    def __setstate__(self, state: tuple[_core.Outcome, tuple[str, ...]]) -> None:
        outcome, plot = state
        self.__init__(outcome)  # type: ignore[misc]
        self._plot = plot

    @property
    def names(self) -> list[str]:
        """Names of the columns, ``"time"`` first."""
        return self._table.names

    @property
    def units(self) -> dict[str, str | None]:
        """Units of the columns by name; ``None`` without unit."""
        return self._table.units

    @property
    def time(self) -> NDArray[numpy.float64]:
        """Simulated times of the rows in s."""
        return self["time"]

    @property
    def end(self) -> str:
        """Why the run ended: ``"stop time"``, or the name of the FMU that requested the end.

        Of an exception's results: ``"failed"``, ``"time limit"`` or ``"cancelled"``.
        """
        return self._outcome.end

    @property
    def end_time(self) -> float:
        """Simulated time in s that the run reached."""
        return self._outcome.time

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return self._outcome.steps

    @property
    def seconds(self) -> float:
        """Wall-clock time of the steps in s."""
        return self._outcome.seconds

    @property
    def settings(self) -> dict[str, Any]:
        """The complete ``system.toml`` of the run as nested dicts, with all that was chosen."""
        return _core.parse_toml(self._outcome.settings)

    @property
    def explanation(self) -> list[str]:
        """One sentence for each setting that the system left open."""
        return list(self._outcome.reasons)

    def __len__(self) -> int:
        return len(self._table)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def keys(self) -> list[str]:
        """Return the names of the columns."""
        return self.names

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __getitem__(self, name: str) -> NDArray[Any]:
        known = self._columns.get(name)
        if known is not None:
            return known
        import numpy

        numbers = self._table.numbers(name)
        if numbers is not None:
            column = numpy.asarray(numbers)
        else:
            values = self._table.values(name)
            if values is None:
                raise KeyError(self._unknown(name))
            is_text = any(isinstance(value, str) for value in values[:1])
            column = numpy.array(values, dtype=object if is_text else bool)
            column.flags.writeable = False
        self._columns[name] = column
        return column

    def _unknown(self, name: str) -> str:
        import difflib

        near = difflib.get_close_matches(name, self.names, 3)
        hint = f"; similar: {', '.join(near)}" if near else ""
        return f"the results have no column {name!r}{hint}"

    def last(self) -> dict[str, Any]:
        """Return the values of the last row by name; empty without rows."""
        rows = len(self)
        return {name: self._table.value(name, rows - 1) for name in self.names} if rows else {}

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self._table.__arrow_c_stream__(requested_schema)

    def __arrow_c_schema__(self) -> object:
        return self._table.__arrow_c_schema__()

    def to_arrow(self) -> pyarrow.Table:
        """Return a ``pyarrow.Table`` without copies; units are in the metadata of the fields."""
        return _package("pyarrow", "to_arrow()").table(self)

    def to_numpy(self) -> NDArray[Any]:
        """Return a structured array with one field for each column (a copy)."""
        import numpy

        columns = {name: self[name] for name in self.names}
        array = numpy.empty(len(self), dtype=[(name, own.dtype) for name, own in columns.items()])
        for name, column in columns.items():
            array[name] = column
        return array

    def to_pandas(self) -> pandas.DataFrame:
        """Return a ``pandas.DataFrame`` whose index is the time in s."""
        package = _package("pandas", "to_pandas()")
        columns = {name: self[name] for name in self.names[1:]}
        index = package.Index(self.time, name="time")
        frame: pandas.DataFrame = package.DataFrame(columns, index=index, copy=False)
        return frame

    def to_polars(self) -> polars.DataFrame:
        """Return a ``polars.DataFrame`` without copies."""
        return _package("polars", "to_polars()").DataFrame(self)

    def to_xarray(self) -> xarray.Dataset:
        """Return an ``xarray.Dataset`` over ``time``; units are attributes of the variables."""
        package = _package("xarray", "to_xarray()")
        units = self.units

        def attributes(name: str) -> dict[str, str | None]:
            return {"units": units[name]} if units[name] else {}

        variables = {name: ("time", self[name], attributes(name)) for name in self.names[1:]}
        coordinates = {"time": ("time", self.time, {"units": "s"})}
        dataset: xarray.Dataset = package.Dataset(variables, coords=coordinates)
        return dataset

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the same CSV file as the command ``aso-ftc run``."""
        self._write(path, ".csv")

    def to_parquet(self, path: str | os.PathLike[str]) -> None:
        """Write the same Parquet file as the command ``aso-ftc run``."""
        self._write(path, ".parquet")

    def _write(self, path: str | os.PathLike[str], ending: str) -> None:
        text = os.fspath(path)
        if not text.lower().endswith(ending):
            raise ValueError(f"{text}: expected a name that ends in {ending}")
        self._table.write(text)

    def plot(self, *names: str, **options: Any) -> matplotlib.figure.Figure:
        """Draw variables over time, one panel for each unit.

        Args:
            names: the variables; default: those of the experiment, or the first numbers.
            options: passed to ``matplotlib.pyplot.subplots``.
        """
        pyplot = _package("matplotlib.pyplot", "plot()")
        panels: dict[str, list[str]] = {}
        for name in names or self._default_plot():
            if name not in self:
                raise KeyError(self._unknown(name))
            panels.setdefault(self.units[name] or "", []).append(name)
        count = max(len(panels), 1)
        options = {"sharex": True, "squeeze": False, "figsize": (8, 1.5 + 2 * count), **options}
        figure: matplotlib.figure.Figure
        figure, axes = pyplot.subplots(count, 1, **options)
        for own, (unit, members) in zip(axes[:, 0], panels.items()):
            for name in members:
                own.plot(self.time, self[name], label=name)
            own.set_ylabel(unit)
            own.legend(loc="best")
            own.grid(True, alpha=0.3)
        axes[-1, 0].set_xlabel("time in s")
        figure.tight_layout()
        return figure

    def _default_plot(self) -> list[str]:
        known = [name for name in self._plot if name in self]
        numbers = [name for name in self.names[1:] if self[name].dtype.kind in "fib"]
        return known or numbers[:_SHOWN]

    def __repr__(self) -> str:
        count = len(self.names) - 1
        return f"<Results: {count} variables, {len(self)} rows, end at t = {self.end_time:.12g} s ({self.end})>"

    def _repr_html_(self) -> str:
        units, names = self.units, self.names[1:]

        def cell(value: object) -> str:
            return f"<td>{html.escape(str(value))}</td>"

        lines = []
        for name in names[:_SHOWN]:
            column = self[name]
            is_number = column.dtype.kind in "fi" and len(column) > 0
            numbers = [column.min(), column.max()] if is_number else ["", ""]
            last = column[-1] if len(column) else ""
            shown = [f"{value:.6g}" if isinstance(value, float) else value for value in [*numbers, last]]
            lines.append("<tr>" + "".join(map(cell, [name, units[name] or "", *shown])) + "</tr>")
        head = "".join(f"<th>{word}</th>" for word in ("variable", "unit", "min", "max", "last"))
        more = len(names) - _SHOWN
        rest = f"<p>and {more} more variables</p>" if more > 0 else ""
        summary = html.escape(repr(self).strip("<>"))
        return f"<p>{summary}</p><table><thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table>{rest}"
