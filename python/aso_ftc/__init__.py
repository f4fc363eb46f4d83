"""Fault-tolerant control and co-simulation of FMUs.

>>> import aso_ftc as af
>>> results = af.reproduce(stop_time=1.0)
>>> len(results.time)
101

* :func:`simulate` runs one FMU, :class:`System` connects several.
* :class:`Results` holds the rows of a run for NumPy, Arrow, pandas, polars and xarray.
* :func:`report` writes the report of a run, as a page with interactive plots.
* :func:`design` designs a fault-tolerant controller, :func:`trade_off` one for each of several requirements.
* :func:`identify` makes a plant for it from logs.
* :func:`check` and :func:`read_model_description` look at an FMU; :func:`compile` builds its library.
"""

from __future__ import annotations

import atexit as _atexit
import importlib as _importlib
from typing import TYPE_CHECKING as _TYPE_CHECKING
from typing import Any as _Any

from . import _core
from ._command import _path as _command_path
from ._command import command
from ._description import DefaultExperiment, ModelDescription, Variable, read_model_description
from ._design import Controller, Design, design
from ._errors import (
    CancelledError,
    ConfigurationError,
    DesignError,
    Error,
    FmuError,
    MissingPackageError,
    ResultsError,
    RunError,
    TimeLimitError,
)
from ._identify import Plant, identify
from ._paper import fmus, paper, reproduce
from ._report import report
from ._results import Results
from ._simulate import CheckReport, check, compile, simulate
from ._slave import Slave
from ._system import Cancel, Simulation, System, fault
from ._trade_off import TradeOff, trade_off

if _TYPE_CHECKING:
    from . import campaign as campaign

__version__ = _core.__version__

__all__ = [
    "Cancel",
    "CancelledError",
    "CheckReport",
    "ConfigurationError",
    "Controller",
    "DefaultExperiment",
    "Design",
    "DesignError",
    "Error",
    "FmuError",
    "MissingPackageError",
    "ModelDescription",
    "Plant",
    "Results",
    "ResultsError",
    "RunError",
    "Simulation",
    "Slave",
    "System",
    "TimeLimitError",
    "TradeOff",
    "Variable",
    "__version__",
    "check",
    "clear",
    "command",
    "compile",
    "design",
    "fault",
    "fmus",
    "identify",
    "paper",
    "read_model_description",
    "report",
    "reproduce",
    "simulate",
    "trade_off",
]


def clear() -> None:
    """Close the FMUs that no run uses and remove their unpacked files; done at the end of Python."""
    _core.clear()


def __dir__() -> list[str]:
    return sorted([*__all__, "campaign"])


def __getattr__(name: str) -> _Any:
    # Campaigns import large packages, so they are imported when they are used.
    if name == "campaign":
        return _importlib.import_module(f"{__name__}.campaign")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


_core.set_worker(str(_command_path()))
_atexit.register(_core.clear)
