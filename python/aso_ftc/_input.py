"""Inputs over time: tables of every kind, and functions, as what a run reads."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Union

from ._arrays import arrays, spread
from ._description import Variable
from ._errors import ConfigurationError
from ._results import Results, _package
from ._words import similar

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Input", "options"]

Input = Union["ArrayLike", Mapping[str, Sequence[Any]], Callable[[float], Mapping[str, Any]], Any]

_REALS = ("Real", "Float64", "Float32")


def options(data: Input, element: str, variables: Iterable[Variable]) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return the signals of a scenario and the options of a run for an input of an FMU.

    Args:
        data: as the argument ``input`` of :func:`aso_ftc.simulate`.
        element: the name of the FMU in its system.
        variables: the variables of the FMU, without the name of the FMU.
    """
    known = {variable.name: variable for variable in variables}
    shapes = arrays(known)
    if callable(data):
        function: Callable[[float], Mapping[str, Any]] = data

        def values(time: float) -> dict[str, Any]:
            present = function(time)
            # A row of pandas has names, too.
            if not hasattr(present, "items"):
                raise TypeError(f"input: expected a dict of values at t = {time:.12g} s, found {type(present).__name__}")
            return {f"{element}.{name}": value for name, value in spread(present, shapes)}

        return [], {"input": values}
    columns, units = _columns(data)
    times = _times(columns)
    signals: list[dict[str, Any]] = []
    tables: list[tuple[str, bytes, bytes]] = []
    ignored: list[str] = []
    for name, column in _elements(columns, shapes):
        variable = known.get(name)
        if variable is None:
            sentence = f"input: the FMU has no variable {name!r}{similar(name, known)}"
            raise ConfigurationError(sentence, "Input", {"name": name})
        if not _is_driven(variable):
            ignored.append(f"{name} ({variable.variability} {variable.causality})")
            continue
        signal: dict[str, Any] = {"variable": f"{element}.{name}"}
        unit = units.get(name, units.get(name.partition("[")[0]))
        if unit and variable.unit and unit != variable.unit:
            signal["unit"] = unit
        moments, numbers = _present(variable, times, column)
        if variable.type == "String":
            # Of several values at one time, the last one holds.
            steps = dict(zip(moments.tolist(), map(str, numbers.tolist())))
            signals.append({**signal, "steps": [list(step) for step in steps.items()]})
            continue
        file = f"input-{len(tables)}"
        tables.append((file, moments.tobytes(), numbers.tobytes()))
        signals.append({**signal, "csv": {"file": file, "column": file}})
    if ignored and (not signals or isinstance(data, dict)):
        sentence = f"input: expected inputs and tunable parameters, found {', '.join(ignored)}"
        raise ConfigurationError(sentence, "Input")
    if ignored:
        # Results are an input, although they have outputs, too.
        logging.getLogger("aso_ftc").info("input: not used, as they are no inputs: %s", ", ".join(ignored))
    return signals, {"tables": tables}


def _columns(data: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the columns of a table by name, and the units that it states."""
    import numpy

    if isinstance(data, Results):
        return dict(data), data.units
    if hasattr(data, "to_frame"):
        # A series of pandas or polars.
        data = data.to_frame()
    if isinstance(data, Mapping) and not hasattr(data, "data_vars"):
        return {str(name): _unmasked(column) for name, column in data.items()}, {}
    if hasattr(data, "data_vars"):
        # Of xarray.
        parts = {str(name): data[name] for name in [*data.coords, *data.data_vars]}
        units = {name: part.attrs.get("units") for name, part in parts.items()}
        return {name: numpy.asarray(part) for name, part in parts.items()}, units
    if hasattr(data, "columns") and hasattr(data, "index"):
        # Of pandas.
        columns = {str(name): data[name].to_numpy() for name in data.columns}
        if "time" not in columns and data.index.name == "time":
            columns["time"] = data.index.to_numpy()
        return columns, dict(data.attrs.get("units", {}))
    if hasattr(data, "get_columns"):
        # Of polars.
        return {column.name: column.to_numpy() for column in data.get_columns()}, {}
    if hasattr(data, "__arrow_c_stream__"):
        table = _package("pyarrow", "a table of Arrow as input").table(data)
        units = {
            field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema
        }
        return {name: table[name].to_numpy() for name in table.column_names}, units
    array = numpy.asanyarray(data)
    if array.dtype.names is None:
        sentence = (
            "input: expected a table with the column time (results, mapping, structured array, frame, dataset) "
            f"or a function of the time, found {_described(data)}"
        )
        raise ConfigurationError(sentence, "Input")
    return {name: _unmasked(array[name]) for name in array.dtype.names}, {}


def _unmasked(column: Any) -> NDArray[Any]:
    """Return a column as an array, with None for the values that are masked."""
    import numpy

    if numpy.ma.is_masked(column):
        return numpy.array(column.tolist(), dtype=object)
    return numpy.asarray(column)


def _described(data: Any) -> str:
    shape = getattr(data, "shape", None)
    return f"{type(data).__name__}" + (f" of the shape {tuple(shape)}" if shape is not None else "")


def _times(columns: dict[str, Any]) -> NDArray[Any]:
    """Take the column ``time``, durations as numbers in s; checks it and the lengths of the others."""
    import numpy

    if "time" not in columns:
        names = ", ".join(columns)
        raise ConfigurationError(f'input: expected a column "time", found {names}', "Input")
    try:
        times = numpy.asarray(columns.pop("time"))
        if times.dtype.kind == "m":
            times = times / numpy.timedelta64(1, "s")
        if times.dtype.kind == "M":
            raise TypeError("found dates, expected the time since the start")
        times = numpy.array(times, dtype=float)
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"input: time is no number in s: {error}", "Input") from None
    lengths = {name: numpy.shape(column)[:1] for name, column in columns.items()}
    other = next((name for name, length in lengths.items() if length != times.shape), None)
    if times.ndim != 1 or other is not None:
        sentence = f"input: expected columns of one length, found {len(times)} times"
        raise ConfigurationError(f"{sentence} and {lengths.get(str(other))} of {other}", "Input")
    if not len(times):
        raise ConfigurationError("input: expected at least one row, found none", "Input")
    wrong = numpy.flatnonzero(~numpy.isfinite(times))
    if len(wrong):
        raise ConfigurationError(f"input: time is {times[wrong[0]]} in row {wrong[0]}", "Input")
    falls = numpy.flatnonzero(numpy.diff(times) < 0)
    if len(falls):
        row = falls[0] + 1
        sentence = f"input: time is {times[row]:.12g} s in row {row} after {times[row - 1]:.12g} s"
        raise ConfigurationError(f"{sentence}, expected ascending times", "Input")
    return times


def _elements(columns: Mapping[str, Any], shapes: Mapping[str, Any]) -> Iterable[tuple[str, Any]]:
    """Return the columns, those of an array with a column for each element."""
    import numpy

    for name, column in columns.items():
        if name not in shapes:
            yield name, column
            continue
        rows = numpy.stack(list(column)) if len(column) else column
        yield from zip(shapes[name].elements, _flat(name, rows, shapes[name].shape))


def _flat(name: str, rows: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    if rows.shape[1:] != shape:
        sentence = f"input: {name} has the shape {shape}, found {rows.shape[1:]} in each row"
        raise ConfigurationError(sentence, "Input", {"name": name})
    columns: NDArray[Any] = rows.reshape(len(rows), -1).T
    return columns


def _is_driven(variable: Variable) -> bool:
    return variable.causality == "input" or (variable.causality, variable.variability) == ("parameter", "tunable")


def _present(variable: Variable, times: NDArray[Any], column: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the times and the numbers of the rows that have a value."""
    import numpy

    name, values = variable.name, numpy.asarray(column)
    if values.ndim != 1:
        sentence = f"input: {name} is a scalar, found {values.shape[1:]} in each row"
        raise ConfigurationError(sentence, "Input", {"name": name})
    if variable.type == "Binary":
        sentence = f"input: {name} is a Binary, to which a function of the time gives values, not a table"
        raise ConfigurationError(sentence, "Input", {"name": name})
    if values.dtype.kind == "O":
        # pandas.NA, an NAType, is neither equal to itself nor different.
        absent = [value is None or type(value).__name__ == "NAType" or value != value for value in values.tolist()]
        gaps = numpy.array(absent, dtype=bool)
    else:
        gaps = values != values
    if gaps.any() and variable.type in _REALS and variable.variability == "continuous":
        row = int(numpy.argmax(gaps))
        sentence = f"input: {name} is {values[row]} in row {row}, t = {times[row]:.12g} s, expected a number"
        raise ConfigurationError(sentence, "Input", {"name": name})
    times, values = times[~gaps], values[~gaps]
    if variable.type == "String":
        return times, values
    try:
        if numpy.iscomplexobj(values):
            raise TypeError("expected real numbers, found complex ones")
        numbers = values.astype(float)
    except (TypeError, ValueError) as error:
        sentence = f"input: {name} is a {variable.type}: {error}"
        raise ConfigurationError(sentence, "Input", {"name": name}) from None
    return times, numbers
