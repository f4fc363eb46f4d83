"""One FMU: run it, check it."""

from __future__ import annotations

import json
import os
import re
import subprocess
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from . import _core
from ._arrays import arrays
from ._command import command
from ._description import Variable
from ._errors import ConfigurationError, FmuError
from ._html import page
from ._input import Input, options
from ._keywords import keywords
from ._results import Results
from ._system import _FMPY, Cancel, PathLike, System, _changes

__all__ = ["CheckReport", "check", "simulate"]

@keywords(_FMPY)
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
        step: communication step in s; default: the ``DefaultExperiment``, else 1 ms, or for more than 100 s
            the power of ten that gives at most 100,000 steps.
        start_values: values of variables before the run, also as ``(value, unit)`` with the unit of the variable.
        input: inputs over time. Either a table with the column ``"time"`` in s or of durations, with the
            interpolation of FMPy: a mapping of columns, a structured array, :class:`Results`, a frame of pandas (whose index
            may be the time) or polars, a dataset of xarray, a table of Arrow; units that it states are
            converted, and columns that are outputs are not used. Or a function that gets the time in s at
            each communication point and returns values by name.
        output: variables to record, by name or pattern, or by the name of an array; default: the outputs.
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
    values = None if start_values is None else _start_values(system, name, start_values)
    system._check_values(values)
    variables = _variables(system, name, values)
    changes: dict[str, Any] = {
        "start_values": values,
        "start_time": start_time,
        "stop_time": stop_time,
        "step": step,
        "tolerance": tolerance,
        "record_every": record_every,
        "record": _recorded(name, variables, output),
    }
    run_options: dict[str, Any] = {"time_limit": time_limit, "cancel": cancel, "progress": progress}
    if input is not None:
        changes["signals"], inputs = options(input, name, variables)
        run_options |= inputs
    try:
        return system._run(_changes(**changes), **run_options, prefix=f"{name}.")
    except ConfigurationError as error:
        # The signals of the scenario are the columns of the input, and its tables are no files.
        def at(match: re.Match[str]) -> str:
            _, moments, _ = run_options["tables"][int(match[2])]
            return f" at t = {memoryview(moments).cast('d')[int(match[1]) - 1]:.12g} s"

        sentence = re.sub(r"^scenario\.signal\[\d+\]", "input", str(error))
        sentence = re.sub(r" in row (\d+) of .*input-(\d+)(?=: )", at, sentence)
        raise ConfigurationError(sentence, error.kind, error.fields) from error.__cause__


def _element(fmu: PathLike) -> str:
    """Return the name of the FMU in its system."""
    stem = Path(os.path.abspath(os.fspath(fmu))).stem
    return "".join(letter if letter.isalnum() or letter in "_-" else "_" for letter in stem) or "fmu"


def _start_values(system: System, name: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return start values with the names of the system, without the units that they state; checks these."""
    with_units = {
        variable: value
        for variable, value in values.items()
        if isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], str) and not isinstance(value[0], str)
    }
    for scalar in _variables(system, name, None) if with_units else []:
        variable = scalar.name if scalar.name in with_units else scalar.name.rpartition("[")[0]
        _, stated = with_units.get(variable, (None, scalar.unit))
        if stated != scalar.unit:
            sentence = f"start_values: expected {variable} in {scalar.unit or 'no unit'}, found {stated}"
            raise ConfigurationError(sentence, "Unit", {"name": variable})
    return {f"{name}.{variable}": with_units.get(variable, (value,))[0] for variable, value in values.items()}


def _variables(system: System, name: str, values: Mapping[str, Any] | None) -> list[Variable]:
    """Return the variables of the FMU with its own names, in the sizes that the start values give to arrays."""
    known = system._study().check(_changes(start_values=values), quiet=True)
    return [Variable(**{**entry, "name": entry["name"].removeprefix(f"{name}.")}) for entry in known]


def _recorded(name: str, variables: list[Variable], output: Iterable[str] | None) -> list[str] | None:
    """Return what is recorded: outputs by default; ``None``, which records more, without outputs."""
    if output is None:
        return [f"{name}.{variable.name}" for variable in variables if variable.causality == "output"] or None
    if isinstance(output, str):
        raise TypeError(f"output is a list of names, found the text {output!r}")
    known = arrays(variable.name for variable in variables)
    return [f"{name}.{element}" for signal in output for element in (known[signal].elements if signal in known else [signal])]


@dataclass(frozen=True)
class CheckReport:
    """What ``aso-ftc check`` finds in an FMU; true if no finding is an error."""

    ok: bool
    """Whether no finding is an error."""
    errors: int
    warnings: int
    notes: int
    findings: tuple[dict[str, Any], ...] = field(hash=False, repr=False)
    data: dict[str, Any] = field(hash=False, repr=False)
    """The whole answer of the command."""

    def __bool__(self) -> bool:
        return self.ok

    def __str__(self) -> str:
        lines = [f"{finding.get('severity', 'note')}: {finding.get('what', finding)}" for finding in self.findings]
        return "\n".join([*lines, self._counts()])

    def _counts(self) -> str:
        return f"errors {self.errors}, warnings {self.warnings}, notes {self.notes}"

    def _repr_html_(self) -> str:
        rows = [(finding.get("severity", "note"), finding.get("what", finding)) for finding in self.findings]
        return page(self._counts(), ("severity", "finding"), rows)


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
        words if run else [*words, "--no-run"], capture_output=True, encoding="utf-8", check=False
    )
    if done.returncode not in (0, 1) or not done.stdout:
        raise FmuError(done.stderr.strip().removeprefix("error: ") or "the check failed", "Check")
    data = json.loads(done.stdout)
    counts = {name: data[name] for name in ("errors", "warnings", "notes")}
    return CheckReport(ok=done.returncode == 0, findings=tuple(data["findings"]), data=data, **counts)


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
