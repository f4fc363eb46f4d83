"""What a run of a campaign changes in its system."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._system import System
from ._entries import TABLES, fail
from ._faults import KINDS, RANDOM, FaultCase
from ._parameters import Place

__all__ = ["arguments", "changed", "changes"]


def changed(system: System, new: Mapping[str, Any]) -> System:
    """Return a copy of the system with the changes of a run."""
    variant = system.copy()
    variant.start_values.update(new["start_values"])
    for name in TABLES:
        getattr(variant, name).update(new[name])
    variant.scenario.setdefault("fault", []).extend(new["faults"])
    return variant


def changes(
    parameters: Sequence[Place],
    disturbances: Mapping[str, Any],
    case: FaultCase,
    values: Mapping[str, Any],
    seed: int,
    run: int,
) -> dict[str, Any]:
    """Return what a run changes in its system: start values, entries of tables, faults.

    Noise and random dropouts without a seed of their own get one that depends on the seed of the
    campaign, the number of the run and their position.
    """
    overrides: dict[str, Any] = {"start_values": {}, "algorithm": {}, "experiment": {}}
    faults = copy.deepcopy(dict(disturbances))
    for parameter in parameters:
        value = values[parameter.name]
        for place in parameter.places:
            table, _, entry = place.partition(".")
            if table in faults and entry:
                kind = next(key for key in faults[table] if key in KINDS)
                faults[table][kind][entry] = value
            elif table in TABLES:
                overrides[table][entry.replace("_", "-")] = value
            else:
                overrides["start_values"][place] = value
    entries: list[dict[str, Any]] = []
    for disturbance in faults.values():
        connections = disturbance.pop("connection")
        for connection in [connections] if isinstance(connections, str) else connections:
            entries.append({"connection": connection, **copy.deepcopy(disturbance)})
    if case.entry is not None:
        entries.append(copy.deepcopy(case.entry))
    for position, disturbed in enumerate(entries):
        for kind in RANDOM:
            if kind in disturbed and "seed" not in disturbed[kind]:
                drawn = np.random.SeedSequence([seed, run, position]).generate_state(1, np.uint32)
                disturbed[kind]["seed"] = int(drawn[0])
    overrides["faults"] = entries
    return overrides


def arguments(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return the changes of a run as arguments of :meth:`System.run`."""
    experiment = {name.replace("-", "_"): value for name, value in overrides["experiment"].items()}
    for name in experiment:
        if name not in ("start_time", "stop_time", "tolerance"):
            raise fail(f"experiment.{name}", "expected start-time, stop-time or tolerance")
    keywords: dict[str, Any] = {"start_values": overrides["start_values"], "faults": overrides["faults"], **experiment}
    if overrides["algorithm"]:
        keywords["algorithm"] = overrides["algorithm"]
    return keywords
