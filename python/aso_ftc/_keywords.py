"""Keywords that a function does not have, and the names of their counterparts."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import ParamSpec, TypeVar

from ._words import similar

__all__ = ["keywords"]

P = ParamSpec("P")
R = TypeVar("R")


def keywords(others: Mapping[str, str], name: str | None = None) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let a function say what to write for a keyword that it does not have.

    Args:
        others: what to use instead of the keywords of other packages.
        name: the function that users call; default: this one.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        known = list(inspect.signature(function).parameters)

        @functools.wraps(function)
        def checked(*args: P.args, **kwargs: P.kwargs) -> R:
            for keyword in kwargs:
                if keyword not in known:
                    hint = f"; use {others[keyword]}" if keyword in others else similar(keyword, known)
                    raise TypeError(f"{name or function.__name__}() has no argument {keyword!r}{hint}")
            return function(*args, **kwargs)

        return checked

    return decorate
