"""The faults of a campaign: disturbances that every run has, and the fault of each run."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ._entries import TABLES, fail, only, table

__all__ = ["KINDS", "NO_FAULT", "RANDOM", "FaultCase", "cases", "disturbances"]

KINDS = (
    "bias", "gain", "drift", "stuck", "dropout", "delay", "quantisation", "saturation", "noise", "inversion",
)  # fmt: skip
# The entry of each kind that is its size, for tables and heat maps.
_SIZES = {
    "bias": "value", "gain": "factor", "drift": "rate", "stuck": "value", "delay": "seconds",
    "quantisation": "step", "noise": "deviation", "dropout": "probability", "saturation": "max",
}  # fmt: skip
RANDOM = ("noise", "dropout")


@dataclass(frozen=True)
class FaultCase:
    """The fault of a run: one entry of ``[[scenario.fault]]`` and its columns in the results."""

    label: str
    connection: str | None
    kind: str | None
    size: float | None
    start: float | None
    entry: dict[str, Any] | None


NO_FAULT = FaultCase("", None, None, None, None, None)


def disturbances(entry: Any) -> dict[str, dict[str, Any]]:
    entries = {name: table(f"disturbances.{name}", value) for name, value in table("disturbances", entry).items()}
    for name, value in entries.items():
        place = f"disturbances.{name}"
        if name in TABLES or "." in name:
            raise fail(place, "choose another name: it is a table of the system, or has a dot")
        _check_fault(place, value)
    return entries


def _check_fault(place: str, value: Mapping[str, Any]) -> str:
    kinds = [kind for kind in KINDS if kind in value]
    if len(kinds) != 1:
        raise fail(place, f"expected exactly one of {', '.join(KINDS)}")
    only(place, value, ["connection", "unit", kinds[0]])
    table(f"{place}.{kinds[0]}", value[kinds[0]])
    if "connection" not in value:
        raise fail(place, "expected a connection, such as controller.x_p")
    return kinds[0]


def cases(entries: Any, inputs: Any) -> tuple[FaultCase, ...]:
    """The faults of a fault campaign, the run without a fault first."""
    if not isinstance(entries, (list, tuple)):
        raise fail("faults", "expected a list: [[faults]]")
    cases: list[FaultCase] = []
    for number, entry in enumerate(entries):
        place = f"faults[{number}]"
        fault = table(place, entry)
        fault.setdefault("connection", "all")
        kind = _check_fault(place, fault)
        connections = inputs() if fault["connection"] == "all" else fault["connection"]
        connections = [connections] if isinstance(connections, str) else connections
        if not connections:
            raise fail(place, "the system has no connection that a fault can disturb")
        body = dict(fault[kind])
        names = list(body)
        lists = [value if isinstance(value, (list, tuple)) else [value] for value in body.values()]
        if empty := [name for name, values in zip(names, lists, strict=True) if not values]:
            raise fail(place, f"{kind}.{empty[0]} = []: expected at least one value")
        for connection, *values in itertools.product(connections, *lists):
            filled = dict(zip(names, values, strict=True))
            full = {"connection": connection, kind: filled}
            if "unit" in fault:
                full["unit"] = fault["unit"]
            size, start = filled.get(_SIZES.get(kind, "")), filled.get("from")
            text = ", ".join(f"{key} = {value}" for key, value in filled.items())
            cases.append(
                FaultCase(
                    f"{kind} on {connection}" + (f": {text}" if text else ""),
                    connection,
                    kind,
                    float(size) if isinstance(size, (int, float)) else None,
                    float(start) if isinstance(start, (int, float)) else None,
                    full,
                )
            )
    return (NO_FAULT, *cases) if cases else ()
