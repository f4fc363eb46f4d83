"""A plant from logs of its signals."""

from __future__ import annotations

import csv
import os
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from . import _core
from ._errors import ConfigurationError, DesignError
from ._input import _columns, _times

__all__ = ["Plant", "identify"]


class Plant(Mapping[str, Any]):
    """The entries of a plant file; :func:`identify` returns it, :func:`aso_ftc.design` takes it.

    Attributes:
        text: the plant file, whose comments state the order, the fit and what speaks against the model.
        warnings: what may make the model useless, in sentences.
        refusal: why no controller was found; None if there is one.
    """

    def __init__(self, text: str, refusal: str | None, warnings: Sequence[str]) -> None:
        self.text: str = text
        self.refusal: str | None = refusal
        self.warnings: list[str] = list(warnings)
        self._entries: dict[str, Any] = _core.parse_toml(text)

    def __getitem__(self, name: str) -> Any:
        return self._entries[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        counts = f"{len(self['A'])} states, {len(self['B'][0])} commands, {len(self['C'])} measurements"
        return f"<Plant: {counts}; {len(self.warnings)} warnings>"


def identify(
    *logs: object, inputs: Sequence[str] = (), outputs: Sequence[str] = (), order: int | None = None
) -> Plant:
    """Identify a linear plant from logs of its commands and measurements.

    Args:
        logs: tables with a column ``time`` in s and equidistant rows: paths of files, frames of pandas or polars,
            results, mappings, or whatever the argument ``input`` of :func:`simulate` takes as a table. Several logs are
            one estimate.
        inputs: the columns that are commands; default: those called ``u``, ``u1``, ``u2``, ...
        outputs: the columns that are measurements; default: all others if ``inputs`` are given, else ``y``, ``y1``, ...
        order: the number of states; default: the one that predicts the last quarter best.

    Returns:
        the plant file, as ``aso-ftc design --init`` writes it: matrices, names, units, tolerances, and the bandwidths of
        a controller.

    Raises:
        DesignError: a log cannot be read, or no plant can be identified from it.

    >>> plant = identify(frame, inputs=["force"])  # doctest: +SKIP
    >>> design(plant).verdict  # doctest: +SKIP
    'green'
    """
    for name, columns in (("inputs", inputs), ("outputs", outputs)):
        if isinstance(columns, str):
            raise TypeError(f"{name}: expected a sequence of names, found the name {columns!r}")
    with tempfile.TemporaryDirectory() as folder:
        paths = [
            os.fspath(log) if isinstance(log, (str, os.PathLike)) else _written(log, Path(folder, f"log {at}.csv"))
            for at, log in enumerate(logs, 1)
        ]
        try:
            return Plant(*_core.identify(paths, list(inputs), list(outputs), order))
        except DesignError as error:
            # Nobody wrote the file or stated an option of the command: the message names log and argument.
            message = re.sub(rf"({re.escape(folder + os.sep)})?(log \d+)\.csv", r"\2", str(error))
            message = re.sub(r"--(inputs|outputs|order)\b", r"`\1`", message)
            raise DesignError(message, error.kind) from None


def _written(log: object, path: Path) -> str:
    """Write a table as CSV with its units."""
    try:
        columns, units = _columns(log)
        table = {"time": _times(columns), **columns}
    except ConfigurationError as error:
        raise DesignError(f"{path.stem}: {str(error).removeprefix('input: ')}", error.kind) from None
    # Without brackets of its unit, the index of an element would be one.
    header = [f"{name} [{units.get(name) or ''}]" if units.get(name) or name.endswith("]") else name for name in table]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(zip(*(column.tolist() for column in table.values())))
    return str(path)
