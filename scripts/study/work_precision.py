"""Draws docs/figures/work_precision.svg from docs/figures/work_precision.csv.

Usage: cargo run --release -p tests --example work_precision > docs/figures/work_precision.csv
       python scripts/study/work_precision.py
"""

import csv
import math
from collections import defaultdict
from pathlib import Path

from drawing import drawing, line, marker, text

STEM = Path(__file__).resolve().parents[2] / "docs" / "figures" / "work_precision"
WIDTH, HEIGHT = 1000.0, 560.0
TOP, BOTTOM = 70.0, 480.0
PANELS = [(90.0, 480.0), (590.0, 980.0)]
GRID = "#dddddd"
SIZE, RADIUS = 14, 4
# Colours of Okabe and Ito (2008), each with a marker: a polygon with this number of corners, 0 for
# a disc.
STYLES = {
    "fixed": ("#777777", 0),
    "doubling": ("#d55e00", 4),
    "embedded": ("#0072b2", 3),
    "increment": ("#009e73", 6),
    "energy": ("#aa3377", 5),
}
TITLES = {
    "transient": "a fast lag behind a slow oscillator",
    "two masses": "two masses, a stiff and damped coupling",
}


def curves():
    """For each problem, for each step control: steps and errors."""
    points = defaultdict(lambda: defaultdict(list))
    with STEM.with_suffix(".csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            point = (float(row["steps"]), float(row["largest error"]))
            points[row["problem"]][row["step control"]].append(point)
    return points


def decades(values):
    """Powers of ten from the one below the smallest value to the one above the largest."""
    return range(math.floor(math.log10(min(values))), math.ceil(math.log10(max(values))) + 1)


def panel(title, by_control, left, right):
    """Curves, grid and labels of one problem."""
    points = [point for curve in by_control.values() for point in curve]
    across, up = decades([x for x, _ in points]), decades([y for _, y in points])

    def at(point):
        x = (math.log10(point[0]) - across[0]) / (across[-1] - across[0])
        y = (math.log10(point[1]) - up[0]) / (up[-1] - up[0])
        return left + x * (right - left), BOTTOM - y * (BOTTOM - TOP)

    parts = [text((left + right) / 2, TOP - 14, title, "middle", 15)]
    for power in across:
        x, _ = at((10.0**power, 10.0 ** up[0]))
        parts += [line([(x, TOP), (x, BOTTOM)], GRID, 1), text(x, BOTTOM + 20, f"1e{power}", "middle", SIZE)]
    for power in up:
        _, y = at((10.0 ** across[0], 10.0**power))
        parts += [line([(left, y), (right, y)], GRID, 1), text(left - 8, y + 5, f"1e{power}", "end", SIZE)]
    for control, curve in by_control.items():
        colour, corners = STYLES[control]
        parts.append(line(map(at, curve), colour, 2))
        parts += [marker(at(point), colour, corners, RADIUS) for point in curve]
    parts.append(text((left + right) / 2, BOTTOM + 44, "communication steps", "middle", SIZE))
    turned = f' transform="rotate(-90 {left - 58:.1f} {(TOP + BOTTOM) / 2:.1f})"'
    parts.append(text(left - 58, (TOP + BOTTOM) / 2, "largest error of an output", "middle", SIZE, turned))
    return parts


def main():
    """Reads, draws, writes."""
    title = "Error over the number of communication steps, Gauss-Seidel with lines"
    parts = [text(WIDTH / 2, 28, title, "middle", 18)]
    for (problem, by_control), (left, right) in zip(curves().items(), PANELS, strict=True):
        parts += panel(TITLES[problem], by_control, left, right)
    for column, (control, (colour, corners)) in enumerate(STYLES.items()):
        x, y = 190 + 140 * column, HEIGHT - 14
        parts += [marker((x, y - 5), colour, corners, RADIUS), text(x + 14, y, control, size=SIZE)]
    STEM.with_suffix(".svg").write_text(drawing(WIDTH, HEIGHT, title, parts), encoding="utf-8")


if __name__ == "__main__":
    main()
