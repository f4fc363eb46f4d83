"""Messages for ``logging``: the package has the logger ``aso_ftc``, each FMU one below ``aso_ftc.fmu``."""

from __future__ import annotations

import logging

from ._words import in_python

__all__ = ["emit", "level"]

_PACKAGE = "aso_ftc"
_FMU = "aso_ftc.fmu"


def level() -> int:
    """Return the lowest level that a logger of the package passes on."""
    known = [logging.getLogger(_PACKAGE), logging.getLogger(_FMU)]
    known += [
        logger
        for name, logger in list(logging.root.manager.loggerDict.items())
        if name.startswith(f"{_FMU}.") and isinstance(logger, logging.Logger)
    ]
    return min(logger.getEffectiveLevel() for logger in known)


def emit(
    level: int, text: str, fmu: str | None = None, time: float | None = None, category: str = ""
) -> None:
    """Log a message, of an FMU with its name, the simulated time in s and the category."""
    if fmu is None:
        logging.getLogger(_PACKAGE).log(level, "%s", in_python(text))
        return
    at = "" if time is None else f", t = {time:.12g} s"
    kind = f", {category}" if category else ""
    extra = {"fmu": fmu, "time": time, "category": category}
    logging.getLogger(f"{_FMU}.{fmu}").log(level, "%s%s%s: %s", fmu, at, kind, text, extra=extra)
