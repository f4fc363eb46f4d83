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


def keywords(others: Mapping[str, str]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let a function say what to write for a keyword that it does not have.

    Args:
        others: what to use instead of the keywords of other packages.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        known = list(inspect.signature(function).parameters)

        @functools.wraps(function)
        def checked(*args: P.args, **kwargs: P.kwargs) -> R:
            for name in kwargs:
                if name not in known:
                    hint = f"; use {others[name]}" if name in others else similar(name, known)
                    raise TypeError(f"{function.__name__}() has no argument {name!r}{hint}")
            return function(*args, **kwargs)

        return checked

    return decorate
