"""Parts of a drawing as SVG: texts, lines and markers. Used by log_plot.py and work_precision.py."""

import math

FONT = "DejaVu Sans, Verdana, Helvetica, Arial, sans-serif"
TEXT = "#222222"


def text(x, y, words, anchor="start", size=16, turned=""):
    """A line of text."""
    place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}"'
    return f'<text {place} fill="{TEXT}"{turned}>{words}</text>'


def line(points, colour, width, dash=""):
    """A line through points of the drawing."""
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width}"{dashed}/>'


def marker(centre, colour, corners, radius):
    """A filled polygon with this number of corners, or a disc for 0."""
    x, y = centre
    if corners == 0:
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{colour}"/>'
    turns = [2 * math.pi * k / corners for k in range(corners)]
    # As large as the disc to the eye.
    size = radius + 1.5
    path = " ".join(f"{x + size * math.sin(t):.1f},{y - size * math.cos(t):.1f}" for t in turns)
    return f'<polygon points="{path}" fill="{colour}"/>'


def drawing(width, height, title, parts):
    """The whole drawing on white."""
    head = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" '
        f'viewBox="0 0 {width:g} {height:g}" font-family="{FONT}" role="img">',
        f"<title>{title}</title>",
        f'<rect width="{width:g}" height="{height:g}" fill="#ffffff"/>',
    ]
    return "\n".join([*head, *parts, "</svg>"]) + "\n"
