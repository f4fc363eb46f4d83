"""The folder of a campaign: manifest, plan, parts of the results, kept signals.

Every file is written under a temporary name and renamed, so that an interrupted campaign leaves whole
files only. One process at a time writes a folder.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import multiprocessing
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import _core
from .._errors import ConfigurationError, ResultsError
from .._system import System
from ._changes import changed, changes
from ._faults import FaultCase
from ._packages import package
from ._parameters import Place, text

if TYPE_CHECKING:
    from ._campaign import Campaign

__all__ = ["Folder", "column", "locked", "parquet_bytes", "read_manifest", "system_of"]

MANIFEST = "manifest.json"
# An empty file, which the process that writes the folder has locked.
_LOCK = "campaign.lock"
_FORMAT = 1
# The temporary name of a file; see `write`.
_TEMPORARY = re.compile(r"\.(.+)\.\d+\.tmp")


def write(path: Path, content: bytes) -> None:
    """Write a file whole or not at all.

    Raises:
        ResultsError: the disk is full or the folder cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(temporary, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        reason = error.strerror or str(error)
        raise ResultsError(f"cannot write {path}: {reason}", "Results", {"path": str(path)}) from None


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes from a campaign in this folder, which is created if it is missing.

    Raises:
        ConfigurationError: another process runs a campaign in the folder.
        ResultsError: the folder cannot be written.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        # This process is a worker that imports the script of the campaign; its nanny sees that it does not start.
        raise SystemExit(1)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = _core.lock_file(str(folder / _LOCK))
    except OSError as error:
        reason = error.strerror or str(error)
        raise ResultsError(f"cannot write {folder}: {reason}", "Results", {"path": str(folder)}) from None
    if lock is None:
        raise ConfigurationError(
            f"another process runs a campaign in the folder {folder}: wait for its end, or choose another folder"
        )
    try:
        yield
    finally:
        lock.release()


class Folder:
    """The files of one campaign.

    Raises:
        ConfigurationError: the folder has something else.
    """

    def __init__(self, path: Path, campaign: Campaign) -> None:
        self.path = path.absolute()
        described = campaign.describe()
        text = json.dumps(described, sort_keys=True)
        self.manifest = {
            "format": _FORMAT,
            "name": campaign.name,
            "version": _core.__version__,
            "identity": hashlib.sha256(text.encode()).hexdigest(),
            **described,
            "complete": False,
        }
        self._adopt()

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from the folder; see :func:`locked`."""
        with locked(self.path):
            # Another process may have had the folder until now.
            self._adopt()
            yield

    def _adopt(self) -> None:
        known = read_manifest(self.path)
        if known is None:
            names = {_TEMPORARY.sub(r"\1", path.name) for path in self.path.glob("*")} - {_LOCK}
            # A start that was killed before it had written the manifest goes on.
            if names and not {"plan.parquet"} <= names <= {"plan.parquet", "system.toml", MANIFEST}:
                raise ConfigurationError(
                    f"the folder {self.path} is not empty and has no campaign: choose another one"
                )
            return
        for entry, value in known.items():
            if entry not in ("complete", "runs_done", "identity") and value != json.loads(
                json.dumps(self.manifest.get(entry))
            ):
                raise ConfigurationError(
                    f"the folder {self.path} has another campaign (its entry {entry} differs): "
                    "choose another folder, or remove this one"
                )
        self.manifest["complete"] = known["complete"]

    def begin(self, campaign: Campaign) -> None:
        """Write plan, system and manifest, the manifest last; remove what a killed process was writing."""
        for temporary in self.path.rglob(".*.tmp"):
            temporary.unlink(missing_ok=True)
        if not (self.path / MANIFEST).is_file():
            write(self.path / "plan.parquet", parquet_bytes(_plan_table(campaign)))
            write(self.path / "system.toml", campaign.system.to_toml().encode())
            self.write_manifest()

    def write_manifest(self) -> None:
        """Write the manifest."""
        write(self.path / MANIFEST, (json.dumps(self.manifest, indent=1) + "\n").encode())

    def discard(self) -> None:
        """Let a folder without runs be that of another campaign."""
        if not any((self.path / name).exists() for name in ("runs", "signals")):
            (self.path / MANIFEST).unlink(missing_ok=True)

    def finish(self, runs: int) -> None:
        """State that all runs are done."""
        self.manifest["complete"] = True
        self.manifest["runs_done"] = runs
        self.write_manifest()

    def part(self, first: int) -> Path:
        """Return the path of the part that begins with a run."""
        return self.path / "runs" / f"part-{first:09}.parquet"

    def parts(self) -> list[int]:
        """Return the first runs of all parts that are there."""
        return sorted(int(path.stem[5:]) for path in (self.path / "runs").glob("part-*.parquet"))

    def write_part(self, first: int, table: Any) -> None:
        """Write a part."""
        write(self.part(first), parquet_bytes(table))

    def write_signals(self, run: int, content: bytes) -> None:
        """Write the kept signals of a run."""
        write(self.path / "signals" / f"run-{run:09}.parquet", content)


def read_manifest(path: Path) -> dict[str, Any] | None:
    """Return the manifest of a folder, or ``None`` if there is none."""
    try:
        text = (path / MANIFEST).read_text(encoding="utf-8")
        manifest = json.loads(text)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"cannot read {path / MANIFEST}: {error}") from None
    if not isinstance(manifest, dict) or manifest.get("format") != _FORMAT:
        raise ConfigurationError(f"{path / MANIFEST} is not the manifest of a campaign of this version")
    return manifest


def _plan_table(campaign: Campaign) -> Any:
    arrow = package("pyarrow")
    sampled = campaign.plan.sampled
    columns: dict[str, Any] = {"row": arrow.array(range(sampled.rows), arrow.int64())}
    for parameter in campaign.parameters:
        columns[parameter.name] = column(parameter.kind, sampled.values[parameter.name])
    if sampled.unit is not None:
        for number, parameter in enumerate(campaign.parameters):
            columns[f"unit:{parameter.name}"] = arrow.array(sampled.unit[:, number])
    return arrow.table(columns)


def column(kind: str, values: Any) -> Any:
    """Return the values of a parameter as a column; see :attr:`Parameter.kind`.

    The steps of a range are whole in a grid only; other designs have all numbers of the range.
    """
    arrow = package("pyarrow")
    if kind == "text":
        return arrow.array([text(value) for value in values], arrow.string())
    whole = kind == "integer" and not any(isinstance(value, float) for value in values)
    return arrow.array(list(values), arrow.int64() if whole else arrow.float64())


def parquet_bytes(table: Any) -> bytes:
    """Return a table of Arrow as the bytes of a Parquet file."""
    arrow, parquet = package("pyarrow"), package("pyarrow.parquet")
    sink = arrow.BufferOutputStream()
    parquet.write_table(table, sink, compression="zstd")
    return bytes(sink.getvalue())


def system_of(path: Path, run: int) -> System:
    """Return the system of a run of the campaign in a folder, which ``aso-ftc run`` repeats.

    Raises:
        ConfigurationError: the folder has no campaign, or the campaign no such run.
    """
    manifest = read_manifest(path)
    if manifest is None:
        raise ConfigurationError(f"{path} has no campaign")
    if not 0 <= run < manifest["runs"]:
        raise ConfigurationError(f"run {run}: the campaign has the runs 0 to {manifest['runs'] - 1}")
    row, number = divmod(run, len(manifest["cases"]))
    parquet = package("pyarrow.parquet")
    parameters = manifest["parameters"]
    table = parquet.read_table(path / "plan.parquet", columns=[parameter["name"] for parameter in parameters])
    values = {}
    for parameter in parameters:
        value = table[parameter["name"]][row].as_py()
        values[parameter["name"]] = parameter["levels"][value] if parameter["levels"] is not None else value
    entry = manifest["cases"][number]
    case = FaultCase("", None, None, None, None, entry)
    places = [Place(parameter["name"], tuple(parameter["set"])) for parameter in parameters]
    new = changes(places, manifest["disturbances"], case, values, manifest["seed"], run)
    return changed(System(manifest["system"]), new)
