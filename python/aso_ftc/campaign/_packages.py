"""The packages that campaigns need, imported when they are used."""

from __future__ import annotations

import importlib
from typing import Any

from .._errors import MissingPackageError

__all__ = ["package"]


def package(name: str) -> Any:
    """Import a package of the extra ``campaign``.

    Raises:
        MissingPackageError: it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        missing = (error.name or name).partition(".")[0]
        raise MissingPackageError(
            f'campaigns need the package {missing}: install it, in a clone of this project by `python -m pip install "./python[campaign]"`',
            "MissingPackage",
            {"package": missing},
        ) from None
