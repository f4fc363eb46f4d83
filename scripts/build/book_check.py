"""Makes the checks that mkdocs lacks: links of README.md and its neighbours, and no requests to other hosts.

Usage: python scripts/build/book_check.py FOLDER | PAGE.. For the built book in FOLDER, both; for pages in Markdown,
their links. Prints what is wrong, with status 1.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"\]\(([^)\s]+)\)")
# Elements that make a browser load something without a click: sources, style sheets, icons,
# imports.
FETCHED = re.compile(
    r"""(?:\bsrc=["']?|<link\b(?![^>]*rel=["']?canonical)[^>]*\bhref=["']?|@import\s+["']?|url\(["']?)((?:https?:)?//[^\s"')>]+)"""
)


def anchor(heading):
    """The anchor of a heading, as GitHub and mkdocs form it."""
    text = re.sub(r"[^\w\s-]", "", heading.strip().lower())
    return re.sub(r"\s", "-", text)


def anchors(page):
    """Every anchor of a page in Markdown."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return {anchor(heading) for heading in re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)}


def broken_links(page):
    """The links of a page to missing files or anchors."""
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if target.startswith(("https://", "http://", "mailto:")):
            continue
        path, _, place = target.partition("#")
        file = page.parent / path if path else page
        if not file.exists():
            yield f"{page}: {target}: there is no such file"
        elif place and place not in anchors(file):
            yield f"{page}: {target}: there is no such heading"


def foreign_requests(site):
    """The requests of the built book's pages and style sheets to other hosts."""
    for file in sorted(site.rglob("*")):
        if file.suffix in (".html", ".css"):
            for address in FETCHED.findall(file.read_text(encoding="utf-8")):
                yield f"{file.relative_to(site)}: fetches {address}"


def main():
    """Prints all findings."""
    problems, paths = [], [Path(argument) for argument in sys.argv[1:]]
    if not paths:
        sys.exit(__doc__)
    if paths[0].is_dir():
        problems += foreign_requests(paths[0])
        paths = sorted(ROOT.glob("*.md"))
    problems += [line for page in paths for line in broken_links(page)]
    for line in problems:
        print(line, file=sys.stderr)
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
