"""What speed costs: one plant designed for a grid of requirements."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from ._design import Design, _axes, _of_entries, entries_of
from ._errors import DesignError
from ._results import _package

__all__ = ["TradeOff", "trade_off"]

# By measure: whether more is better.
_MEASURES = {
    "speed": True,
    "observer_speed": True,
    "peak_of_S": False,
    "delay_margin": True,
    "noise": False,
    "ramp_error": False,
}
_COLOURS = {"green": "#1a7f37", "amber": "#b35900", "red": "#c62828"}


def trade_off(plant: object, grid: Mapping[str, Iterable[Any]], **entries: Any) -> TradeOff:
    """Design a plant for every combination of requirements; see what each one costs.

    Args:
        plant: as for :func:`design`.
        grid: by entry, with a dot for an entry of a table, whose other entries stay, the values to try:
            ``{"observer.eigenvalues": [[-4, -5, -6], [-8, -10, -12]]}``.
        entries: as for :func:`design`, the same in all designs; ``observer=None`` removes the table of the plant, for
            a grid with another requirement.

    Returns:
        one row for each combination: the designs and their measures.

    Raises:
        DesignError: no combination can be designed.
    """
    names, values = list(grid), [list(tried) for tried in grid.values()]
    combinations = [dict(zip(names, chosen)) for chosen in itertools.product(*values)]
    content, path = entries_of(plant)

    def design_or_error(combination: dict[str, Any]) -> Design | DesignError:
        changed = {**content, **entries}
        for name, value in combination.items():
            _set(changed, name.split("."), value)
        try:
            return _of_entries(changed, path)
        except DesignError as error:
            return error

    with ThreadPoolExecutor() as threads:
        designs = list(threads.map(design_or_error, combinations))
    refused = [result for result in designs if isinstance(result, DesignError)]
    if len(refused) == len(designs):
        raise refused[0] if refused else DesignError("the grid has no combination", "Grid")
    return TradeOff(combinations, designs)


def _set(entries: dict[str, Any], place: list[str], value: Any) -> None:
    """Set an entry of nested dicts, of which only those on the way are copied; dicts take the place of other values."""
    for name in place[:-1]:
        known = entries.get(name)
        entries[name] = dict(known) if isinstance(known, Mapping) else {}
        entries = entries[name]
    entries[place[-1]] = value


def measures(result: Design) -> dict[str, float]:
    """Return what is compared; a measure that a design does not have is NaN.

    ``speed`` and ``observer_speed``: the decay rates of the slowest eigenvalues in 1/s; ``peak_of_S``: the larger of
    the peaks at commands and measurements, in the units in which the verdict judges them; ``delay_margin`` in s,
    infinite if no delay makes the loop unstable; ``noise``: the largest root-mean-square value of a command under white
    noise of all measurements, that of the entry ``robustness.noise``, 1 without it; ``ramp_error``: the largest error of
    an estimate while its fault rises by 1 in a second.
    """
    import numpy

    report = result.report
    robustness = report["robustness"]
    period = (report["sampling"] or {}).get("sample_time")
    nan = float("nan")

    def slowest(part: str) -> float:
        values = result.eigenvalues[part]
        if period is None:
            return float(-values.real.max())
        with numpy.errstate(divide="ignore"):
            return float(-numpy.log(numpy.abs(values)).max() / period)

    commands = {signal["name"] for signal in report["plant"]["actuators"]}
    noise = [signal["value"] for signal in robustness["noise_together"] if signal["name"] in commands] if robustness else []
    ramps = [error["ramp"] for error in report["estimation"]["errors"] if error["ramp"] is not None]
    delay = robustness["delay_margin"] if robustness else nan
    return {
        "speed": slowest("feedback"),
        "observer_speed": slowest("observer"),
        "peak_of_S": max((point["judged"] for point in robustness["points"]), default=nan) if robustness else nan,
        # JSON has null for a margin without a limit.
        "delay_margin": float("inf") if delay is None else delay,
        "noise": max(noise, default=nan),
        "ramp_error": max(map(abs, ramps), default=nan),
    }


class TradeOff:
    """Designs of one plant for a grid of requirements; :func:`trade_off` returns it."""

    def __init__(self, combinations: list[dict[str, Any]], designs: list[Design | DesignError]) -> None:
        self.designs = designs
        self.rows: list[dict[str, Any]] = []
        for combination, result in zip(combinations, designs):
            if isinstance(result, Design):
                row = {**combination, "verdict": result.verdict, **measures(result), "error": None}
            else:
                row = {**combination, "verdict": "refused", **dict.fromkeys(_MEASURES, float("nan")), "error": str(result)}
            self.rows.append(row)

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(self.rows)

    def __getitem__(self, index: int) -> dict[str, Any]:
        return self.rows[index]

    def __repr__(self) -> str:
        counts = {level: sum(row["verdict"] == level for row in self.rows) for level in (*_COLOURS, "refused")}
        return f"<TradeOff: {len(self)} designs; {', '.join(f'{n} {level}' for level, n in counts.items() if n)}>"

    def to_pandas(self) -> Any:
        """Return the rows as a pandas DataFrame."""
        return _package("pandas", "a DataFrame").DataFrame(self.rows)

    def pareto(self, x: str = "speed", y: str = "peak_of_S") -> list[int]:
        """Return the positions of the designs that no other one surpasses in both measures, in the order of ``x``."""
        points = {}
        for index, row in enumerate(self.rows):
            signed = [row[name] if _better(name) else -row[name] for name in (x, y)]
            if all(value == value for value in signed):
                points[index] = signed
        front = [
            index
            for index, (a, b) in points.items()
            if not any(c >= a and d >= b and (c > a or d > b) for c, d in points.values())
        ]
        return sorted(front, key=lambda index: self.rows[index][x])

    def plot(self, x: str = "speed", y: str = "peak_of_S", ax: Any = None) -> Any:
        """Plot a measure over another one, with a line through those that none surpasses; return the axes."""
        ax = _axes(ax)
        front = self.pareto(x, y)
        ax.plot(*([self.rows[index][name] for index in front] for name in (x, y)), color="0.5", zorder=1, label="best")
        for level, colour in _COLOURS.items():
            rows = [row for row in self.rows if row["verdict"] == level]
            if rows:
                ax.scatter([row[x] for row in rows], [row[y] for row in rows], color=colour, label=level)
        ax.set_xlabel(x)
        ax.set_ylabel(y)
        ax.legend()
        return ax


def _better(measure: str) -> bool:
    if measure not in _MEASURES:
        raise KeyError(f"there is no measure {measure!r}, expected one of {', '.join(_MEASURES)}")
    return _MEASURES[measure]
