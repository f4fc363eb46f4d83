"""Results of a run, in memory."""

from __future__ import annotations

import importlib
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, cast

from . import _core
from ._arrays import Array, arrays
from ._errors import MissingPackageError
from ._html import MOST_ROWS, page
from ._words import similar

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure
    import numpy
    import pandas
    import polars
    import pyarrow
    import xarray
    from numpy.typing import NDArray

__all__ = ["Results"]


def _package(name: str, purpose: str) -> Any:
    """Import a package that is optional."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = name.split(".", 1)[0]
        sentence = f"{purpose} needs the package {package}: python -m pip install {package}"
        raise MissingPackageError(sentence, "MissingPackage", {"package": package}) from error


class Results(Mapping[str, "NDArray[Any]"]):
    """The recorded variables of a run: a mapping of names to columns, with one row for each recorded time.

    ``results["fmu.variable"]`` is a NumPy array with the memory of the results, which is read-only. The
    name of an array of FMI 3.0 gives its elements in its dimensions: ``(rows, ...)``. The object has the
    Arrow interface ``__arrow_c_stream__``, so that ``pyarrow.table(results)``,
    ``polars.DataFrame(results)`` and others read it without copies.

    Two results are equal if they have the same names, units and values; NaN equals NaN.
    """

    def __init__(self, outcome: _core.Outcome) -> None:
        self._outcome = outcome
        self._table = outcome["table"]
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

        Of an exception's results: ``"failed"``, ``"time limit"``, ``"cancelled"`` or ``"interrupted"``.
        """
        return self._outcome["end"]

    @property
    def end_time(self) -> float:
        """Simulated time in s that the run reached."""
        return self._outcome["time"]

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return self._outcome["steps"]

    @property
    def seconds(self) -> float:
        """Wall-clock time of the steps in s."""
        return self._outcome["seconds"]

    @property
    def settings(self) -> dict[str, Any]:
        """The complete ``system.toml`` of the run as nested dicts, with all that was chosen."""
        return _core.parse_toml(self._outcome["settings"])

    @property
    def explanation(self) -> list[str]:
        """One sentence for each setting that the system left open."""
        return list(self._outcome["reasons"])

    def __len__(self) -> int:
        return len(self.names)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __contains__(self, name: object) -> bool:
        return name in self.names or name in self._arrays

    def _ipython_key_completions_(self) -> list[str]:
        return [*self.names, *self._arrays]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Results):
            return NotImplemented
        if self.units != other.units or self.names != other.names:
            return False
        return all(_equal(self[name], other[name]) for name in self)

    # Columns are compared by their values, as those of frames.
    __hash__ = None  # type: ignore[assignment]

    def __getitem__(self, name: str) -> NDArray[Any]:
        known = self._columns.get(name)
        if known is not None:
            return known
        import numpy

        numbers = self._table.numbers(name)
        if numbers is not None:
            column = numpy.asarray(numbers)
        elif (values := self._table.values(name)) is not None:
            is_bool = all(isinstance(value, bool) for value in values)
            column = numpy.array(values, dtype=bool if is_bool else object)
        elif name in self._arrays:
            array = self._arrays[name]
            columns = [self[element] for element in array.elements]
            column = numpy.stack(columns, axis=-1).reshape(len(columns[0]), *array.shape)
        else:
            raise KeyError(self._unknown(name))
        column.flags.writeable = False
        self._columns[name] = column
        return column

    @cached_property
    def _arrays(self) -> dict[str, Array]:
        return arrays(self.names)

    def _unknown(self, name: str) -> str:
        return f"the results have no column {name!r}{similar(name, self.names)}"

    def last(self) -> dict[str, Any]:
        """Return the values of the last row by name; empty without rows."""
        rows = len(self._table)
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
        array = numpy.empty(len(self._table), dtype=[(name, column.dtype) for name, column in columns.items()])
        for name, column in columns.items():
            array[name] = column
        return array

    def to_pandas(self) -> pandas.DataFrame:
        """Return a ``pandas.DataFrame`` whose index is the time in s; ``attrs["units"]`` has the units by name."""
        package = _package("pandas", "to_pandas()")
        columns = {name: self[name] for name in self.names[1:]}
        index = package.Index(self.time, name="time")
        frame: pandas.DataFrame = package.DataFrame(columns, index=index)
        frame.attrs["units"] = {name: unit for name, unit in self.units.items() if unit}
        return frame

    def to_polars(self) -> polars.DataFrame:
        """Return a ``polars.DataFrame`` without copies."""
        # A mapping of columns would lose the types of columns with gaps.
        return _package("polars", "to_polars()").DataFrame(self._table)

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

    def plot(
        self,
        *names: str,
        signals: Iterable[str] = (),
        ax: matplotlib.axes.Axes | None = None,
        **options: Any,
    ) -> matplotlib.figure.Figure:
        """Draw variables over time, one panel for each unit.

        Args:
            names: the variables; default: those of the experiment, or the first numbers.
            signals: further variables, as a list.
            ax: draw all variables into these axes of an existing picture.
            options: passed to ``matplotlib.pyplot.subplots``.
        """
        if isinstance(signals, str):
            raise TypeError("signals is a list of names, found a str")
        panels: dict[str, list[str]] = {}
        for name in [*names, *signals] or self._default_plot():
            if name not in self:
                raise KeyError(self._unknown(name))
            unit = self.units[self._arrays[name].elements[0] if name in self._arrays else name]
            panels.setdefault(unit or "", []).append(name)
        if ax is not None:
            if options:
                raise TypeError(f"{next(iter(options))} is an option of a new picture, found ax, too")
            shown = [name for members in panels.values() for name in members]
            self._draw(ax, shown, ", ".join(filter(None, panels)))
            ax.set_xlabel("time in s")
            return _shown_once(cast("matplotlib.figure.Figure", ax.figure))
        pyplot = _package("matplotlib.pyplot", "plot()")
        count = max(len(panels), 1)
        options = {"sharex": True, "squeeze": False, "figsize": (8, 1.5 + 2 * count), **options}
        figure, axes = pyplot.subplots(count, 1, **options)
        for panel, (unit, members) in zip(axes[:, 0], panels.items()):
            self._draw(panel, members, unit)
        axes[-1, 0].set_xlabel("time in s")
        figure.tight_layout()
        return _shown_once(figure)

    def _draw(self, axes: matplotlib.axes.Axes, names: list[str], unit: str) -> None:
        for name in names:
            values, labels = self[name], self._arrays[name].elements if name in self._arrays else name
            # Without rows, NumPy cannot find the number of elements.
            axes.plot(self.time, values.reshape(len(values), math.prod(values.shape[1:])), label=labels)
        axes.set_ylabel(unit)
        axes.legend(loc="best")
        axes.grid(True, alpha=0.3)

    def _default_plot(self) -> list[str]:
        known = [name for name in self._plot if name in self]
        numbers = [name for name in self.names[1:] if self[name].dtype.kind in "fib"]
        return known or numbers[:MOST_ROWS]

    def __repr__(self) -> str:
        count, rows = len(self.names) - 1, len(self._table)
        return f"<Results: {count} variables, {rows} rows, end at t = {self.end_time:.12g} s ({self.end})>"

    def _repr_html_(self) -> str:
        units, names = self.units, self.names[1:]
        rows = []
        for name in names[:MOST_ROWS]:
            column = self[name]
            is_number = column.dtype.kind in "fi" and len(column) > 0
            numbers = [column.min(), column.max()] if is_number else ["", ""]
            last = column[-1] if len(column) else ""
            shown = [f"{value:.6g}" if isinstance(value, float) else value for value in [*numbers, last]]
            rows.append([name, units[name] or "", *shown])
        head = ("variable", "unit", "min", "max", "last")
        return page(f"{self!r}"[1:-1], head, rows, len(names) - MOST_ROWS)


def _shown_once(figure: Any) -> Any:
    """Let a notebook show a picture once that a cell both draws and returns."""
    pyplot = importlib.import_module("matplotlib.pyplot")
    if "inline" in pyplot.get_backend() and getattr(figure, "number", None) in pyplot.get_fignums():
        figure._ipython_display_ = partial(_display, figure)
    return figure


def _display(figure: Any) -> None:
    """Close a picture that IPython shows now, and show those before it: the end of the cell would show it again."""
    pyplot = importlib.import_module("matplotlib.pyplot")
    for number in pyplot.get_fignums():
        if number < figure.number:
            importlib.import_module("IPython.display").display(pyplot.figure(number))
            pyplot.close(number)
    pyplot.close(figure)
    # IPython shows the picture as any other.
    raise NotImplementedError


def _equal(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Whether two columns have the same type and values; NaN equals NaN."""
    import numpy

    if one.dtype != other.dtype:
        return False
    return numpy.array_equal(one, other, equal_nan=one.dtype.kind == "f")
