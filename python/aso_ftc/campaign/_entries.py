"""Checks of the entries of a campaign; each error names its place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from .._errors import ConfigurationError

__all__ = ["TABLES", "fail", "finite", "only", "positive", "table"]

# Tables of a system.toml whose entries a parameter can set.
TABLES = ("algorithm", "experiment")


def fail(place: str, text: str) -> ConfigurationError:
    return ConfigurationError(f"{place}: {text}", "Campaign", {"name": place})


def table(place: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise fail(place, f"expected a table, found {value!r}")
    return dict(value)


def only(place: str, table: Mapping[str, Any], known: Iterable[str]) -> None:
    for entry in table:
        if entry not in known:
            raise fail(f"{place}.{entry}" if place else entry, f"unknown entry, expected {', '.join(known)}")


def finite(place: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise fail(place, f"{value!r}: expected a finite number")
    return float(value)


def positive(place: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < math.inf:
        raise fail(place, f"{value!r}: expected a number above 0")
    return float(value)
