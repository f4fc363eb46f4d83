"""One FMU: run it, check it."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Union

from . import _core
from ._command import command
from ._errors import ConfigurationError, FmuError
from ._results import Results
from ._system import Cancel, PathLike, System, _changes

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["CheckReport", "check", "simulate"]

Input = Union["ArrayLike", Mapping[str, Sequence[float]], Callable[[float], Mapping[str, Any]]]


def simulate(
    fmu: PathLike,
    *,
    start_time: float | None = None,
    stop_time: float | None = None,
    step: float | None = None,
    start_values: Mapping[str, Any] | None = None,
    input: Input | None = None,
    output: Iterable[str] | None = None,
    record_every: float | Literal["step", "never"] | None = None,
    tolerance: float | None = None,
    interface: Literal["co-simulation", "model-exchange"] | None = None,
    solver: Literal["automatic", "explicit", "stiff"] | None = None,
    isolate: bool | None = None,
    time_limit: float | None = None,
    cancel: Cancel | None = None,
    progress: bool | Callable[[float], object] | None = None,
) -> Results:
    """Run one FMU and return its outputs over time. Names are those of the FMU.

    Args:
        fmu: the archive, or a folder with the unpacked FMU.
        start_time, stop_time: simulated time in s; default: the ``DefaultExperiment``, else 0 and 1.
        step: communication step in s; default: the ``DefaultExperiment``, else 1 ms.
        start_values: values of variables before the run.
        input: inputs over time: a structured array or a mapping of columns with ``"time"`` in s, with the
            interpolation of FMPy; or a function that gets the time in s at each communication point and
            returns values by name.
        output: variables to record, by name or pattern; default: the outputs.
        record_every: interval between rows in s; default: every step, with more than 10,000 steps
            10,000 intervals.
        tolerance: relative tolerance of solvers.
        interface: the interface of an FMU that offers both; default: co-simulation.
        solver: the integration method of a model-exchange FMU.
        isolate: run the FMU in a process of its own (Linux).
        time_limit, cancel, progress: as for :meth:`System.run`.

    Raises:
        ConfigurationError, FmuError, RunError: as :meth:`System.run`.
    """
    name = _element(fmu)
    system = System().add(name, os.path.abspath(os.fspath(fmu)), interface=interface, solver=solver)
    if isolate is not None:
        # Of the system, so that no function loads the FMU into this process.
        system.isolation["isolate"] = isolate
    changes: dict[str, Any] = {
        "start_values": None if start_values is None else _prefixed(name, start_values),
        "start_time": start_time,
        "stop_time": stop_time,
        "step": step,
        "tolerance": tolerance,
        "record_every": record_every,
        "record": _outputs(system, name) if output is None else [f"{name}.{own}" for own in _names(output)],
    }
    options: dict[str, Any] = {"time_limit": time_limit, "cancel": cancel, "progress": progress}
    options["prefix"] = f"{name}."
    if input is None or callable(input):
        if input is not None:
            options["input"] = _from_function(name, input)
        return system._run(_changes(**changes), **options)
    with tempfile.TemporaryDirectory(prefix="aso-ftc-") as folder:
        path = os.path.join(folder, "input.csv")
        _write_input(path, input, {own.name for own in system.variables()}, name)
        tables = [{"csv": path, "element": name}]
        return system._run(_changes(**changes, tables=tables), **options)


def _element(fmu: PathLike) -> str:
    """Return the name of the FMU in its system."""
    stem = Path(os.path.abspath(os.fspath(fmu))).stem
    return "".join(letter if letter.isalnum() or letter in "_-" else "_" for letter in stem) or "fmu"


def _names(names: Iterable[str]) -> list[str]:
    if isinstance(names, str):
        raise TypeError("output is a list of names, found a str")
    return list(names)


def _prefixed(name: str, values: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{name}.{variable}": value for variable, value in values.items()}


def _outputs(system: System, name: str) -> list[str] | None:
    """Return the outputs; ``None``, which records more, without outputs."""
    return [own.name for own in system.variables() if own.causality == "output"] or None


def _from_function(
    name: str, function: Callable[[float], Mapping[str, Any]]
) -> Callable[[float], Mapping[str, Any]]:
    return lambda time: _prefixed(name, function(time))


def _write_input(path: str, given: Any, known: set[str], element: str) -> None:
    """Write inputs as a CSV file with a column ``time``."""
    import numpy

    if isinstance(given, Mapping) or hasattr(given, "columns"):
        columns = {str(name): numpy.asarray(given[name]) for name in given}
    else:
        array = numpy.asarray(given)
        if array.dtype.names is None:
            sentence = "input: expected a structured array, a mapping of columns or a function"
            raise ConfigurationError(sentence, "Input")
        columns = {name: array[name] for name in array.dtype.names}
    if "time" not in columns:
        found = ", ".join(columns)
        raise ConfigurationError(f'input: expected a column "time", found {found}', "Input")
    unknown = [name for name in columns if name != "time" and f"{element}.{name}" not in known]
    if unknown:
        raise ConfigurationError(f"input: the FMU has no variable {unknown[0]!r}", "Input")
    lengths = {column.shape for column in columns.values()}
    if len(lengths) != 1 or len(next(iter(lengths))) != 1:
        raise ConfigurationError("input: expected columns of one length", "Input")
    names = ["time", *(name for name in columns if name != "time")]
    # repr of a float reads back as the same number.
    values = [[_number(value) for value in columns[name].tolist()] for name in names]
    quoted = [f'"{name.replace(chr(34), chr(34) * 2)}"' for name in names]
    lines = [",".join(quoted), *map(",".join, zip(*values))]
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _number(value: Any) -> str:
    return str(int(value)) if isinstance(value, bool) else repr(value)


@dataclass(frozen=True)
class CheckReport:
    """What ``aso-ftc check`` finds in an FMU."""

    ok: bool
    """Whether no finding is an error."""
    errors: int
    warnings: int
    notes: int
    findings: list[dict[str, Any]]
    data: dict[str, Any]
    """The whole answer of the command."""

    def __str__(self) -> str:
        lines = [f"{own.get('severity', 'note')}: {own.get('what', own)}" for own in self.findings]
        return "\n".join([*lines, f"errors {self.errors}, warnings {self.warnings}, notes {self.notes}"])


def check(fmu: PathLike, *, run: bool = True, time_limit: float = 30.0) -> CheckReport:
    """Check an FMU against the rules of FMI; see the page "check" of the documentation.

    Args:
        fmu: the archive.
        run: also run the FMU, in a process of its own.
        time_limit: limit of each call of the FMU in s of wall-clock time.

    Raises:
        FmuError: the FMU cannot be read.
    """
    words = [str(command()), "check", os.fspath(fmu), "--json", "--time-limit", str(time_limit)]
    done = subprocess.run(
        words if run else [*words, "--no-run"], capture_output=True, text=True, check=False
    )
    if done.returncode not in (0, 1) or not done.stdout:
        raise FmuError(done.stderr.strip().removeprefix("error: ") or "the check failed", "Check")
    data = json.loads(done.stdout)
    counts = {name: data[name] for name in ("errors", "warnings", "notes")}
    return CheckReport(ok=done.returncode == 0, findings=data["findings"], data=data, **counts)


def compile(fmu: PathLike) -> Path:
    """Build the library of an FMU for this platform from the FMU's source code.

    The compiler is the one that the environment variable ``CC`` names, or the first of cc, gcc and clang.
    The built FMU is kept in the user's cache folder and used again.

    Args:
        fmu: an FMU, as an archive or a folder.

    Returns:
        The path of the built FMU; the path of ``fmu`` itself if it has a library for this platform.

    Raises:
        FmuError: the FMU has neither a library nor source code, there is no compiler, or the compiler
            refuses the source code.
    """
    return _core.compile(os.fspath(fmu))
