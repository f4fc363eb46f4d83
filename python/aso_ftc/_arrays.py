"""Arrays: those of FMI 3.0, whose elements are variables with indices in their names, and those of NumPy as lists."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ._errors import ConfigurationError

__all__ = ["Array", "arrays", "plain", "spread"]

# The indices at the end of the name of an element: [2] or [1,2].
_INDICES = re.compile(r"(.+)\[(\d+(?:,\d+)*)\]")


@dataclass(frozen=True)
class Array:
    """An array: the names of its elements in row-major order, and its extents."""

    elements: tuple[str, ...]
    shape: tuple[int, ...]


def arrays(names: Iterable[str]) -> dict[str, Array]:
    """Return the complete arrays among the elements with these names, by name."""
    parts: dict[str, dict[tuple[int, ...], str]] = {}
    known = dict.fromkeys(names)
    for name in known:
        if match := _INDICES.fullmatch(name):
            indices = tuple(map(int, match[2].split(",")))
            parts.setdefault(match[1], {})[indices] = name
    complete = {}
    for name, elements in parts.items():
        if len({len(indices) for indices in elements}) > 1 or name in known:
            continue
        axes = [sorted(set(axis)) for axis in zip(*elements)]
        shape = tuple(len(axis) for axis in axes)
        if math.prod(shape) == len(elements):
            ordered = tuple(elements[place] for place in itertools.product(*axes))
            complete[name] = Array(ordered, shape)
    return complete


def plain(value: Any) -> Any:
    """Return a value with the numbers, lists and dicts of Python instead of those of NumPy and others."""
    if isinstance(value, Mapping):
        return {name: plain(inner) for name, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(inner) for inner in value]
    return value.tolist() if hasattr(value, "tolist") else value


def spread(values: Mapping[str, Any], known: Mapping[str, Array]) -> Iterator[tuple[str, Any]]:
    """Return names and values, those of an array with one value for each element.

    Raises:
        ConfigurationError: an array has another shape.
    """
    for name, value in values.items():
        array = known.get(name)
        if array is None:
            yield name, value
            continue
        import numpy

        numbers = numpy.asarray(value)
        if numbers.shape not in (array.shape, ()):
            sentence = f"{name} has the shape {array.shape}, found an array of the shape {numbers.shape}"
            raise ConfigurationError(sentence, "Shape", {"name": name})
        yield from zip(array.elements, numpy.broadcast_to(numbers, array.shape).ravel().tolist())
