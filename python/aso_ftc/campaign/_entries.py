"""Checks of the entries of a campaign; each error names its place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from .._errors import ConfigurationError
from .._words import similar

__all__ = ["MOST_RUNS", "TABLES", "fail", "finite", "only", "positive", "table", "whole"]

# Tables of a system.toml whose entries a parameter can set.
TABLES = ("algorithm", "experiment")
# Most runs of a campaign: the values of all of them are in memory.
MOST_RUNS = 20_000_000


def fail(place: str, text: str) -> ConfigurationError:
    return ConfigurationError(f"{place}: {text}", "Campaign", {"name": place})


def table(place: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise fail(place, f"expected a table, found {value!r}")
    return dict(value)


def only(place: str, table: Mapping[str, Any], known: Iterable[str]) -> None:
    names = list(known)
    for entry in table:
        if entry not in names:
            hint = similar(entry, names) or f", expected {', '.join(names)}"
            raise fail(f"{place}.{entry}" if place else entry, f"unknown entry{hint}")


def whole(place: str, value: Any, least: int, most: int | None = None) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < least or (most and value > most):
        limits = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise fail(place, f"{value!r}: expected a whole number {limits}")
    return value


def finite(place: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise fail(place, f"{value!r}: expected a finite number")
    return float(value)


def positive(place: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < math.inf:
        raise fail(place, f"{value!r}: expected a number above 0")
    return float(value)
