"""Draws docs/figures/crates.svg: which crate uses which, from `cargo metadata`.

    python scripts/build/crate_picture.py [--check]

Crates below crates/, the command, the Python package and the two models; their normal dependencies. An arrow that follows
from others is left out: if A uses B and C, and B uses C, only A -> B -> C is drawn. --check writes nothing; exit status 1
if the file differs. Needs Python 3.11 and cargo.
"""

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "figures" / "crates.svg"
FACES = {"cli": "cli", "python": "python", "fmu-plant": "fmu-plant", "fmu-controller": "fmu-controller", "fmu-kalman": "fmu-kalman"}
# The picture is narrow, so that names can be read on a telephone.
WIDTH, ROW, BOX, MARGIN = 480, 74, 28, 8
LETTER, PADDING, GAP, LANE = 7.4, 14, 10, 8
SWEEPS = 60


def dependencies():
    """The crates that each crate uses, directly or by others."""
    words = ["cargo", "metadata", "--no-deps", "--format-version=1", "--locked"]
    packages = json.loads(subprocess.check_output(words, cwd=ROOT))["packages"]
    names = {}
    for package in packages:
        folder = Path(package["manifest_path"]).parent.relative_to(ROOT)
        if folder.parts[0] == "crates" or str(folder) in FACES:
            names[package["name"]] = folder.name
    direct = {}
    for package in packages:
        if package["name"] in names:
            used = {names.get(one["name"]) for one in package["dependencies"] if one["kind"] is None}
            direct[names[package["name"]]] = used - {None}
    complete = dict(direct)
    for _ in direct:
        complete = {name: used.union(*(complete[one] for one in used)) for name, used in complete.items()}
    return complete


def arrows(uses):
    """Each pair of a crate and one that it uses, without those that follow from others."""
    return sorted(
        (name, one) for name, used in uses.items() for one in used if not any(one in uses[other] for other in used)
    )


def width(name):
    """The width of a box, or of the place for an arrow that passes by."""
    return len(name) * LETTER + PADDING if isinstance(name, str) else LANE


def rows(uses, pairs):
    """The crates in rows: each below all its users, and no row wider than the picture."""
    depth = {}
    for name in sorted(uses, key=lambda name: len(uses[name])):
        depth[name] = 1 + max((depth[one] for one in uses[name]), default=0)
    waiting, placed = set(uses), []
    while waiting:
        free = [name for name in waiting if not any(name in uses[user] for user in waiting)]
        passing = {used for user, used in pairs if user not in waiting and used in waiting}
        row = []
        for name in sorted(free, key=lambda name: (-depth[name], name)):
            longer = [*row, name]
            items = [*longer, *((used, 0) for used in passing.difference(longer))]
            if not row or sum(width(item) + GAP for item in items) - GAP <= WIDTH - 2 * MARGIN:
                row = longer
        placed.append(row)
        waiting -= set(row)
    return placed


def routed(placed, pairs):
    """The rows with a place for the arrows that pass by to the same crate, and the arrows from row to row."""
    level = {name: k for k, row in enumerate(placed) for name in row}
    lines, full = [], [list(row) for row in placed]
    for user, used in pairs:
        between = [(used, k) for k in range(level[user] + 1, level[used])]
        for place in between:
            if place not in full[place[1]]:
                full[place[1]].append(place)
        lines.append([user, *between, used])
    return full, lines


def steps(lines):
    """The parts of the arrows from one row to the next; arrows to the same crate share parts."""
    return sorted({step for line in lines for step in pairwise(line)}, key=str)


def neighbours(lines):
    """The items above and below each item."""
    above, below = {}, {}
    for one, other in steps(lines):
        below.setdefault(one, []).append(other)
        above.setdefault(other, []).append(one)
    return above, below


def crossings(order, lines):
    """The number of pairs of arrows between two rows that cross."""
    ends = [(order[one], order[other]) for one, other in steps(lines)]
    return sum(
        a[0] == b[0] and (a[1] - b[1]) * (c[1] - d[1]) < 0 for k, (a, c) in enumerate(ends) for b, d in ends[:k]
    )


def sort(full, lines):
    """Orders each row by the middle of its neighbours, down and up in turn; keeps the order with the fewest crossings."""
    above, below = neighbours(lines)
    best, fewest = full, None
    full = [list(row) for row in full]
    for sweep in range(SWEEPS):
        order = {item: (k, i / max(len(row) - 1, 1)) for k, row in enumerate(full) for i, item in enumerate(row)}
        sides = below if sweep % 2 else above
        for k in reversed(range(len(full))) if sweep % 2 else range(len(full)):
            middle = {}
            for item in full[k]:
                near = [order[one][1] for one in sides.get(item, [])]
                middle[item] = sum(near) / len(near) if near else order[item][1]
            full[k].sort(key=lambda item: (middle[item], str(item)))
            order |= {item: (k, i / max(len(full[k]) - 1, 1)) for i, item in enumerate(full[k])}
        count = crossings(order, lines)
        if fewest is None or count < fewest:
            best, fewest = [list(row) for row in full], count
    return swapped(best, lines)


def swapped(full, lines):
    """Swaps neighbours in a row as long as this makes fewer crossings."""
    better = True
    while better:
        better = False
        for row in full:
            for i in range(len(row) - 1):
                order = {item: (k, j) for k, items in enumerate(full) for j, item in enumerate(items)}
                count = crossings(order, lines)
                one, other = row[i], row[i + 1]
                if crossings(order | {one: order[other], other: order[one]}, lines) < count:
                    row[i], row[i + 1] = other, one
                    better = True
    return full


def positions(full, lines):
    """The middle of each item: near its neighbours, and not over another item of its row."""
    above, below = neighbours(lines)
    x = {}
    for row in full:
        space = (WIDTH - 2 * MARGIN - sum(map(width, row))) / (len(row) + 1)
        left = MARGIN + space
        for item in row:
            x[item] = left + width(item) / 2
            left += width(item) + space
    for _ in range(SWEEPS):
        for row in full:
            targets = []
            for item in row:
                near = [x[one] for one in above.get(item, []) + below.get(item, [])]
                targets.append((x[item] + sum(near) / len(near)) / 2 if near else x[item])
            x |= dict(zip(row, apart(row, targets)))
    return x


def apart(row, targets):
    """Moves middles apart so that items do not overlap and stay in the picture."""
    low, high = [], []
    for item, middle in zip(row, targets):
        least = low[-1] + (width(row[len(low) - 1]) + width(item)) / 2 + GAP if low else MARGIN + width(item) / 2
        low.append(max(middle, least))
    for item, middle in zip(reversed(row), reversed(low)):
        last = len(row) - len(high)
        most = high[-1] - (width(row[last]) + width(item)) / 2 - GAP if high else WIDTH - MARGIN - width(item) / 2
        high.append(min(middle, most))
    return high[::-1]


def picture():
    """The picture as SVG."""
    uses = dependencies()
    pairs = arrows(uses)
    full, lines = routed(rows(uses, pairs), pairs)
    full = sort(full, lines)
    x = positions(full, lines)
    y = {item: MARGIN + ROW * k for k, row in enumerate(full) for item in row}
    height = 2 * MARGIN + ROW * (len(full) - 1) + BOX
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" viewBox="0 0 {WIDTH} {height}">',
        "<title>Crates: each arrow points to a crate that is used</title>",
        '<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" orient="auto" '
        'markerUnits="userSpaceOnUse"><path d="M0 0.5 8 4 0 7.5z" fill="#51606b"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
        '<g fill="none" stroke="#51606b" stroke-width="1.2">',
    ]
    for one, other in steps(lines):
        start, end = y[one] + (BOX if isinstance(one, str) else 0), y[other]
        straight = "" if isinstance(one, str) else f"V{y[one] + BOX}"
        middle = (y[one] + BOX + end) / 2
        head = ' marker-end="url(#head)"' if isinstance(other, str) else ""
        curve = f"C{x[one]:.1f} {middle:.0f} {x[other]:.1f} {middle:.0f} {x[other]:.1f} {end}"
        parts.append(f'<path d="M{x[one]:.1f} {start}{straight}{curve}"{head}/>')
    parts.append('</g>\n<g font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="12" text-anchor="middle">')
    for name in sorted(uses):
        left, fill = x[name] - width(name) / 2, "#ffe9c7" if name in FACES else "#dcebf7"
        parts.append(
            f'<rect x="{left:.1f}" y="{y[name]}" width="{width(name):.1f}" height="{BOX}" rx="4" fill="{fill}" stroke="#51606b"/>'
            f'<text x="{x[name]:.1f}" y="{y[name] + 18}" fill="#1c2429">{name}</text>'
        )
    return "\n".join([*parts, "</g>\n</svg>\n"])


def main():
    """Writes the picture, or compares it with the file."""
    drawn = picture()
    if sys.argv[1:] != ["--check"]:
        PICTURE.write_text(drawn, encoding="utf-8")
    elif not PICTURE.is_file() or PICTURE.read_text(encoding="utf-8") != drawn:
        sys.exit("docs/figures/crates.svg is not the picture of the crates: run python scripts/build/crate_picture.py")


if __name__ == "__main__":
    main()
