"""What a worker does: it keeps the files of a campaign and does runs."""

from __future__ import annotations

import io
import os
import runpy
import tarfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from .._errors import Error, RunError, TimeLimitError
from .._system import System, files_named_by
from ._analysis import holds
from ._campaign import Campaign, Function, check_arguments
from ._changes import arguments, changes
from ._faults import FaultCase
from ._folder import parquet_bytes
from ._measures import Expression
from ._parameters import Place

__all__ = ["Job", "Row", "pack"]


@dataclass
class Row:
    """The outcome of one run."""

    run: int
    measures: dict[str, float]
    status: str = "ok"
    reason: str = ""
    seconds: float = 0.0
    signals: bytes | None = None


@dataclass
class Job:
    """A campaign as it travels to the workers: everything but the values of the runs."""

    version: str
    system: System
    files: dict[str, tuple[str, bytes]]
    parameters: list[Place]
    disturbances: dict[str, Any]
    cases: tuple[FaultCase, ...]
    expressions: dict[str, str]
    functions: dict[str, Function]
    unfinished: dict[str, float]
    limits: dict[str, Any]
    keep: dict[str, Any]
    seed: int
    record_every: Any
    time_limit: float | None
    paths: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, campaign: Campaign) -> Job:
        """Return the job of a campaign; reads its files."""
        paths = campaign.describe()["files"]
        return cls(
            version=_core.__version__,
            system=campaign.system.copy(),
            files={digest: pack(path) for path, digest in paths.items()},
            parameters=[parameter.place for parameter in campaign.parameters],
            disturbances=campaign.disturbances,
            cases=campaign.plan.faults,
            expressions={name: expression.text for name, expression in campaign.expressions.items()},
            functions=campaign.functions,
            unfinished=campaign.unfinished,
            limits=campaign.limits,
            keep=campaign.keep,
            seed=campaign.seed,
            record_every=campaign.record_every,
            time_limit=campaign.time_limit,
            paths=paths,
        )

    def unpack(self, folder: Path) -> Runner:
        """Write the files that the folder lacks and return what does the runs."""
        if self.version != _core.__version__:
            raise Error(
                f"this worker has aso_ftc {_core.__version__}, the campaign {self.version}: install the same version"
            )
        placed = {}
        for path, digest in self.paths.items():
            name, content = self.files[digest]
            placed[path] = str(_place(folder / digest, name, content))
        sources = {function[0] for function in self.functions.values() if isinstance(function, tuple)}
        system = self.system.with_files(
            {path: place for path, place in placed.items() if path not in sources}
        )
        functions = {
            name: (placed[function[0]], function[1]) if isinstance(function, tuple) else function
            for name, function in self.functions.items()
        }
        return Runner(self, system, functions)


def pack(path: str) -> tuple[str, bytes]:
    """Return the name and the content of a file; of a folder, and of a file with those that it names, a tar archive."""
    source, named = Path(os.path.normpath(path)), [Path(file) for file in files_named_by(path)]
    if source.is_file() and not named:
        try:
            return source.name, source.read_bytes()
        except OSError as error:
            raise Error(f"cannot read {path}: {error.strerror}") from error
    root = Path(os.path.commonpath([file.parent for file in (source, *named)]))
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", dereference=True) as archive:
        for file in (source, *named):
            archive.add(file, arcname=file.relative_to(root))
    return source.relative_to(root).as_posix() + "/", buffer.getvalue()


def _place(folder: Path, name: str, content: bytes) -> Path:
    """Write a file or a folder below a folder that is named by its content, once."""
    target = folder / name.rstrip("/")
    if target.exists():
        return target
    temporary = folder.with_name(f"{folder.name}.{os.getpid()}.tmp")
    temporary.mkdir(parents=True, exist_ok=True)
    if name.endswith("/"):
        with tarfile.open(fileobj=io.BytesIO(content)) as archive:
            archive.extractall(temporary, filter="data")
    else:
        (temporary / name).write_bytes(content)
    try:
        os.replace(temporary, folder)
    except OSError:
        # Another worker with this folder was faster.
        if not target.exists():
            raise
    return target


class Runner:
    """Does the runs of one campaign in this process."""

    def __init__(self, job: Job, system: System, functions: Mapping[str, Function]) -> None:
        self.job, self.system = job, system
        self.expressions = {name: Expression(name, text) for name, text in job.expressions.items()}
        self.functions: dict[str, Callable[..., Any]] = {}
        for name, function in functions.items():
            if not isinstance(function, tuple):
                self.functions[name] = function
                continue
            path, attribute = function
            user_function = runpy.run_path(path).get(attribute)
            if not callable(user_function):
                raise Error(f"measures.{name}: {Path(path).name} has no function {attribute}")
            check_arguments(f"measures.{name}", user_function)
            self.functions[name] = user_function
        signals = sorted(set().union(*(expression.signals for expression in self.expressions.values())))
        # A function of the user may read every input, output and local variable.
        self.record = ["*", *signals] if self.functions else signals or None

    def check(self) -> None:
        """Open the FMUs and resolve all names, so that an error is known before the first run."""
        self.system.check(record=self.record)

    def runs(
        self, numbers: Sequence[int], values: Mapping[str, Sequence[Any]], cases: Sequence[int]
    ) -> list[Row]:
        """Do runs: their numbers, the values of the parameters and the numbers of their faults."""
        rows = []
        for place, (run, case) in enumerate(zip(numbers, cases, strict=True)):
            rows.append(self.run(run, {name: column[place] for name, column in values.items()}, case))
        return rows

    def run(self, run: int, values: Mapping[str, Any], case: int) -> Row:
        """Do one run. What goes wrong in it becomes its status and its reason."""
        job = self.job
        names = [*self.expressions, *self.functions]
        row = Row(run, {})
        begin = time.perf_counter()
        fault = job.cases[case]
        try:
            overrides = changes(job.parameters, job.disturbances, fault, values, job.seed, run)
            results = self._simulate(overrides, self.record, job.record_every)
            start = np.nan if fault.start is None else fault.start
            for name, expression in self.expressions.items():
                row.measures[name] = expression.value(results, results.time, values, start)
            for name, function in self.functions.items():
                row.measures[name] = _value(name, function, results, {**values, "fault": fault.label})
        except TimeLimitError as error:
            row.status, row.reason = "time limit", str(error)
        except RunError as error:
            row.status, row.reason = _status(error), str(error)
        except Exception as error:
            row.status, row.reason = (
                "failed",
                f"{error}" if isinstance(error, Error) else f"{type(error).__name__}: {error}",
            )
        if row.status != "ok":
            row.measures = {name: job.unfinished.get(name, np.nan) for name in names}
        row.seconds = time.perf_counter() - begin
        if self._kept(row):
            try:
                rerun = self._simulate(overrides, job.keep.get("record"), job.keep.get("every"))
            except RunError as error:
                rerun = error.results
            except Exception:
                # The run has its reason; there is nothing to keep.
                rerun = None
            row.signals = None if rerun is None else parquet_bytes(rerun.to_arrow())
        return row

    def _simulate(self, overrides: Mapping[str, Any], record: Any, every: Any) -> Any:
        limit = self.job.time_limit
        return self.system.run(**arguments(overrides), time_limit=limit, record=record, record_every=every)

    def _kept(self, row: Row) -> bool:
        keep = self.job.keep
        if row.run in keep.get("runs", ()):
            return True
        if row.status != "ok":
            return bool(keep.get("unfinished", False))
        return any(not holds(self.job.limits[name], row.measures[name]) for name in keep.get("outside", ()))


def _value(name: str, function: Callable[..., Any], *arguments: Any) -> float:
    """Return a measure of a function of the user; its exception names the measure."""
    try:
        return float(function(*arguments))
    except Exception as error:
        raise Error(f"measures.{name}: {type(error).__name__}: {error}", "Measure") from error


def _status(error: RunError) -> str:
    if error.status in ("killed", "exited", "out of memory"):
        return "crashed"
    return "time limit" if error.status == "timed out" else "failed"
