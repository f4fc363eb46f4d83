"""Draws residual_over_sample_time.svg: curves on logarithmic axes. Used by residual_over_sample_time.py."""

import math
from dataclasses import dataclass

from drawing import TEXT, drawing, line, marker, text

WIDTH, HEIGHT = 1000.0, 640.0
LEFT, RIGHT, TOP, BOTTOM = 100.0, 972.0, 60.0, 560.0
ACROSS, UP = (0.09, 11.0), (1e-3, 100.0)  # ms, mm
ACROSS_TICKS = [0.1, 0.2, 0.5, 1, 2, 5, 10]
UP_TICKS = [0.001, 0.01, 0.1, 1, 10, 100]
GRID, FINE = "#d0d0d0", "#eeeeee"
RADIUS = 5
# Colours of Okabe and Ito (2008), each with a marker: a polygon with this number of corners, 0 for
# a disc.
STYLES = [("#d55e00", 0), ("#0072b2", 4), ("#009e73", 3), ("#aa3377", 6)]
# The first prototype of this controller (constant, prediction), and the claim of the paper, in mm.
PROTOTYPE = [(0.1, 1.3), (0.5, 1.3), (1, 1.8), (10, 18)]
PAPER = 1.0


@dataclass(frozen=True)
class Curve:
    """Points in ms and mm under one name."""

    label: str
    points: list


def at(point):
    """The position of a point in ms and mm in the drawing."""
    part = lambda value, low, high: math.log(value / low) / math.log(high / low)
    x = LEFT + part(point[0], *ACROSS) * (RIGHT - LEFT)
    return x, BOTTOM - part(point[1], *UP) * (BOTTOM - TOP)


def axes():
    """Grid, frame and labels."""
    (left, right), (low, high) = ACROSS, UP
    fine = [k * decade for decade in UP_TICKS[:-1] for k in range(2, 10)]
    parts = [line([at((left, y)), at((right, y))], FINE, 1) for y in fine]
    for tick in ACROSS_TICKS:
        parts.append(line([at((tick, low)), at((tick, high))], GRID, 1))
        parts.append(text(at((tick, low))[0], BOTTOM + 24, f"{tick:g}", "middle"))
    for tick in UP_TICKS:
        parts.append(line([at((left, tick)), at((right, tick))], GRID, 1))
        parts.append(text(LEFT - 10, at((left, tick))[1] + 6, f"{tick:g}", "end"))
    corners = [(LEFT, TOP), (RIGHT, TOP), (RIGHT, BOTTOM), (LEFT, BOTTOM), (LEFT, TOP)]
    middle = ((LEFT + RIGHT) / 2, (TOP + BOTTOM) / 2)
    turned = f' transform="rotate(-90 28 {middle[1]:.1f})"'
    return [
        *parts,
        line(corners, "#444444", 1),
        text(middle[0], BOTTOM + 54, "sample time in ms", "middle"),
        text(28, middle[1], "half of peak to peak of the cart in mm, t &gt; 60 s", "middle", 16, turned),
    ]


def log_plot(curves):
    """The figure as SVG."""
    title = "What is left of the friction, over the sample time of the controller"
    parts = [
        text((LEFT + RIGHT) / 2, 34, title, "middle", 20),
        *axes(),
        line([at((ACROSS[0], PAPER)), at((ACROSS[1], PAPER))], TEXT, 1.2, "7 4"),
        text(at((1.1, PAPER))[0], at((1.1, PAPER))[1] + 20, "the paper: below 1 mm"),
        line(map(at, PROTOTYPE), "#777777", 5, "2 6"),
    ]
    key = LEFT + 24
    for row, (curve, (colour, corners)) in enumerate(zip(curves, STYLES, strict=True)):
        height = TOP + 28 + 24 * row
        parts.append(line(map(at, curve.points), colour, 2))
        parts += [marker(at(point), colour, corners, RADIUS) for point in curve.points]
        parts.append(line([(key, height), (key + 44, height)], colour, 2))
        parts.append(marker((key + 22, height), colour, corners, RADIUS))
        parts.append(text(key + 56, height + 6, curve.label))
    height = TOP + 28 + 24 * len(curves)
    parts.append(line([(key, height), (key + 44, height)], "#777777", 5, "2 6"))
    parts.append(text(key + 56, height + 6, "first prototype (constant, prediction)"))
    return drawing(WIDTH, HEIGHT, title, parts)
