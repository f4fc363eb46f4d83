"""Tables for notebooks."""

from __future__ import annotations

import html
from collections.abc import Iterable

__all__ = ["MOST_ROWS", "page"]

# Most rows that a table or a picture shows by itself.
MOST_ROWS = 20


def page(summary: str, head: Iterable[object], rows: Iterable[Iterable[object]], more: int = 0) -> str:
    """Return a summary and a table as HTML; ``more`` is the number of rows that are left out."""

    def row(cells: Iterable[object], tag: str) -> str:
        # Some viewers, such as marimo, have no space between the cells of tables.
        start = f'<{tag} style="padding: 0.25em 0.6em">'
        return "<tr>" + "".join(f"{start}{html.escape(str(cell))}</{tag}>" for cell in cells) + "</tr>"

    body = "".join(row(cells, "td") for cells in rows)
    rest = f"<p>and {more} more</p>" if more > 0 else ""
    return (
        f"<p>{html.escape(summary)}</p><table><thead>{row(head, 'th')}</thead>"
        f"<tbody>{body}</tbody></table>{rest}"
    )
