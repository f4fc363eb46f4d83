"""Progress on one line of a terminal or a notebook."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

__all__ = ["draw", "has_lines", "of_run"]


def _is_notebook() -> bool:
    return type(sys.stderr).__module__.partition(".")[0] == "ipykernel"


def has_lines() -> bool:
    """Whether a carriage return starts the line of standard error again: on a terminal and in a notebook."""
    return sys.stderr is not None and (sys.stderr.isatty() or _is_notebook())


def draw(text: str) -> None:
    """Draw the line, over the one before."""
    print(f"\r{text:<78}", end="", file=sys.stderr, flush=True)


def of_run(progress: Any) -> Any:
    """Return what a run does for its argument ``progress``: in a notebook it draws a line in place of a bar."""
    return _line() if progress is True and _is_notebook() else progress


def _line() -> Callable[[float], None]:
    begin = drawn = time.monotonic()

    def show(fraction: float) -> None:
        nonlocal drawn
        now = time.monotonic()
        if fraction >= 1.0:
            draw(f"100 % in {now - begin:.1f} s")
            print(file=sys.stderr)
        elif now - drawn > 0.2 and fraction > 0.0:
            drawn = now
            draw(f"{100 * fraction:.0f} %, {(now - begin) * (1 / fraction - 1):.0f} s left")

    return show
