"""Makes the checks that mkdocs lacks: links of README.md and its neighbours, and no requests to other hosts.

Usage: python scripts/book_check.py FOLDER. Prints what is wrong, with status 1.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BESIDE = ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md")
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
            yield f"{page.name}: {target}: there is no such file"
        elif place and place not in anchors(file):
            yield f"{page.name}: {target}: there is no such heading"


def foreign_requests(site):
    """The requests of the built book's pages and style sheets to other hosts."""
    for file in sorted(site.rglob("*")):
        if file.suffix in (".html", ".css"):
            for found in FETCHED.findall(file.read_text(encoding="utf-8")):
                yield f"{file.relative_to(site)}: fetches {found}"


def main():
    """Prints all findings."""
    if len(sys.argv) != 2:
        sys.exit(__doc__.strip().splitlines()[-1])
    found = [line for name in BESIDE for line in broken_links(ROOT / name)]
    found += foreign_requests(Path(sys.argv[1]))
    for line in found:
        print(line, file=sys.stderr)
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
