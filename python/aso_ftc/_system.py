"""Systems of connected FMUs, and their runs."""

from __future__ import annotations

import copy
import hashlib
import itertools
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast
from urllib.parse import unquote
from xml.etree import ElementTree

from . import _core
from ._arrays import Array, arrays, plain, spread
from ._description import Variable
from ._errors import ConfigurationError, Error
from ._html import page
from ._keywords import keywords
from ._progress import of_run
from ._results import Results

if TYPE_CHECKING:
    from types import TracebackType

    from ._slave import Slave

__all__ = ["Cancel", "Simulation", "System", "fault"]

PathLike = str | os.PathLike[str]
Value = bool | int | float | str
Cancel = _core.Cancel

# Keywords of FMPy's functions that run one FMU, and what does the same here.
_FMPY = {
    "step_size": "step, the communication step",
    "output_interval": "step, the communication step, or record_every, the interval between rows",
    "relative_tolerance": "tolerance",
    "fmi_type": 'interface, "co-simulation" or "model-exchange"',
    "timeout": "time_limit, in s of wall-clock time",
    "step_finished": "cancel and progress, or System.simulation() to step from Python",
    "debug_logging": 'logging.getLogger("aso_ftc.fmu").setLevel("DEBUG")',
    "logger": 'a handler of logging.getLogger("aso_ftc.fmu")',
    "fmi_call_logger": "the command `aso-ftc run --log-calls`",
    "validate": "aso_ftc.check(fmu)",
    "record_events": "record_every",
    "fmu_instance": "System.simulation()",
    "fmu_state": "Simulation.save() and restore()",
}
_BYTES = (bytes, bytearray)
# Tables of a system.toml that a System shows as attributes.
_TABLES = ("algorithm", "experiment", "results", "isolation", "scenario")


def fault(
    connection: str,
    kind: str,
    *,
    start: float | None = None,
    until: float | None = None,
    unit: str | None = None,
    **parameters: object,
) -> dict[str, Any]:
    """Return a fault on a connection, for :meth:`System.run` and :meth:`System.add_fault`.

    Args:
        connection: the input, ``"fmu.variable"``, or both ends, ``"fmu.output=fmu.input"``.
        kind: ``"bias"``, ``"gain"``, ``"drift"``, ``"stuck"``, ``"dropout"``, ``"delay"``,
            ``"quantisation"``, ``"saturation"``, ``"noise"`` or ``"inversion"``.
        start: simulated time in s at which the fault begins; default: the start of the run.
        until: simulated time in s at which it ends; default: never.
        unit: unit of the values; default: the unit of the input.
        parameters: the parameters of the kind, such as ``value=0.01`` of a bias.

    >>> fault("controller.x_p", "bias", value=0.01, start=2.0)
    {'connection': 'controller.x_p', 'bias': {'value': 0.01, 'from': 2.0}}
    """
    body = {**parameters, **stated({"from": start, "until": until})}
    return {"connection": connection, kind: body, **stated({"unit": unit})}


class System:
    """FMUs, their connections and everything else that a ``system.toml`` states.

    Args:
        description: the text of a ``system.toml``, or the same structure as nested dicts.
        folder: the folder where relative paths start; default: the current one.

    Raises:
        ConfigurationError: an entry is unknown, has the wrong type or is out of range.
    """

    start_values: dict[str, Value]
    """Values of variables before the run, by ``"fmu.variable"``."""
    algorithm: dict[str, Any]
    """The table ``[algorithm]``."""
    experiment: dict[str, Any]
    """The table ``[experiment]``: ``start-time``, ``stop-time`` in s, ``tolerance``."""
    results: dict[str, Any]
    """The table ``[results]``."""
    isolation: dict[str, Any]
    """The table ``[isolation]``."""
    scenario: dict[str, Any]
    """The tables ``[[scenario.set]]``, ``signal``, ``table`` and ``fault``, each a list."""

    def __init__(
        self,
        description: str | Mapping[str, Any] | None = None,
        *,
        folder: PathLike | None = None,
    ) -> None:
        self._folder = os.path.abspath(os.fspath(folder) if folder is not None else os.getcwd())
        config = {} if description is None else description
        if not isinstance(config, (str, Mapping)) or (
            isinstance(config, str) and (config.endswith(".toml") or os.path.isfile(config))
        ):
            kind = f"the file {config}" if isinstance(config, str) else type(config).__name__
            raise TypeError(f"expected the text of a system.toml or a dict, found {kind}; System.from_toml reads files")
        self._adopt(_core.check_configuration(config, self._folder))
        self._slaves: dict[str, Slave] = {}
        self._cache: tuple[dict[str, Any], dict[str, Slave], _core.Study] | None = None

    def _adopt(self, config: dict[str, Any]) -> None:
        self.start_values = config.pop("settings", {})
        for name in _TABLES:
            setattr(self, name, config.pop(name, {}))
        self._rest = config

    @classmethod
    def from_toml(cls, path: PathLike) -> System:
        """Read a ``system.toml``.

        Raises:
            ConfigurationError: with ``path``, ``line`` and ``column``.
        """
        config = _core.read_configuration(os.fspath(path))
        system = cls(folder=os.path.dirname(os.path.abspath(os.fspath(path))))
        system._adopt(config)
        return system

    @classmethod
    def from_ssp(cls, path: PathLike) -> System:
        """Build on a system structure: an SSP, an SSD, an ``OspSystemStructure.xml``, or a folder with one."""
        return cls({"system": os.fspath(path)})

    def _path(self, path: PathLike) -> str:
        return os.path.abspath(os.path.join(self._folder, os.fspath(path)))

    def add(
        self,
        name: str,
        fmu: PathLike | Slave,
        *,
        interface: Literal["co-simulation", "model-exchange"] | None = None,
        solver: Literal["automatic", "explicit", "stiff"] | None = None,
        every: int | None = None,
        replace: bool = False,
    ) -> System:
        """Add an FMU, or a Python object with a function ``step`` (see :class:`Slave`).

        Args:
            name: its name in the system.
            fmu: path of the archive or of a folder with the unpacked FMU, or the object.
            interface: the interface of an FMU that offers both; default: co-simulation.
            solver: the integration method of a model-exchange FMU.
            every: the FMU makes one step for this many communication steps.
            replace: take the place of the FMU that has this name.

        Returns:
            the system itself.

        Raises:
            ConfigurationError: the system has an FMU of this name.
        """
        if not replace and (name in self._slaves or name in self._rest.get("fmus", {})):
            sentence = f"the system has an FMU {name} already; replace=True puts this one in its place"
            raise ConfigurationError(sentence, "SameName", {"name": name})
        if isinstance(fmu, (str, os.PathLike)):
            self._slaves.pop(name, None)
            self._rest.setdefault("fmus", {})[name] = self._path(fmu)
        elif callable(getattr(fmu, "step", None)):
            self._rest.get("fmus", {}).pop(name, None)
            self._slaves[name] = fmu
        else:
            kind = type(fmu).__name__
            raise TypeError(f"{name}: expected a path or an object with a function step, found {kind}")
        for table, value in stated({"interface": interface, "solver": solver}).items():
            self._rest.setdefault(table, {})[name] = value
        if every is not None:
            self.algorithm.setdefault("every", {})[name] = every
        return self

    def connect(
        self, source: str, target: str, *, factor: float | None = None, offset: float | None = None
    ) -> System:
        """Connect an output to an input: ``target = factor source + offset``.

        Without a factor and an offset, units that differ are converted. As soon as a system has one
        stated connection, variables of equal names are no longer connected by themselves.

        Args:
            source: ``"fmu.output"``.
            target: ``"fmu.input"``.
        """
        entry = {"from": source, "to": target, **stated({"factor": factor, "offset": offset})}
        self._rest.setdefault("connections", []).append(entry)
        return self

    def add_fault(
        self,
        connection: str,
        kind: str,
        *,
        start: float | None = None,
        until: float | None = None,
        unit: str | None = None,
        **parameters: object,
    ) -> System:
        """Disturb the values on a connection; see :func:`fault`."""
        entry = fault(connection, kind, start=start, until=until, unit=unit, **parameters)
        self.scenario.setdefault("fault", []).append(entry)
        return self

    def add_signal(self, variable: str, *, unit: str | None = None, **kind: object) -> System:
        """Let an unconnected input or a tunable parameter follow a signal.

        Args:
            variable: ``"fmu.variable"``.
            unit: unit of the values; default: the unit of the variable.
            kind: exactly one of ``constant``, ``steps``, ``points``, ``ramp``, ``sine``, ``csv``, as in
                ``[[scenario.signal]]``.
        """
        entry = {"variable": variable, **kind, **stated({"unit": unit})}
        self.scenario.setdefault("signal", []).append(entry)
        return self

    def add_setting(self, variable: str, at: float, value: Value, unit: str | None = None) -> System:
        """Set an unconnected input or a tunable parameter at a simulated time in s."""
        entry = {"variable": variable, "at": at, "value": value, **stated({"unit": unit})}
        self.scenario.setdefault("set", []).append(entry)
        return self

    @property
    def fmus(self) -> dict[str, str]:
        """Paths of the FMUs by name, without those of a system structure."""
        return dict(self._rest.get("fmus", {}))

    @property
    def connections(self) -> list[dict[str, Any]]:
        """The stated connections, each with ``from`` and ``to``."""
        return copy.deepcopy(self._rest.get("connections", []))

    def _config(self) -> dict[str, Any]:
        tables = {name: getattr(self, name) for name in _TABLES}
        filled = {name: table for name, table in tables.items() if table}
        return {**self._rest, "settings": _flat(self.start_values), **filled}

    def to_dict(self) -> dict[str, Any]:
        """Return the structure of the ``system.toml`` with absolute paths, without Python slaves."""
        return _core.check_configuration(self._config(), self._folder)

    def to_toml(self) -> str:
        """Return the text of the ``system.toml`` with absolute paths, without Python slaves."""
        return _core.render_toml(self.to_dict())

    def copy(self) -> System:
        """Return an independent copy. Python slaves are copied by ``copy.deepcopy``."""
        return copy.deepcopy(self)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_cache": None}

    def __deepcopy__(self, memo: dict[int, Any]) -> System:
        system = type(self).__new__(type(self))
        memo[id(self)] = system
        system.__dict__.update(copy.deepcopy(self.__getstate__(), memo))
        return system

    def __repr__(self) -> str:
        names = [*self._rest.get("fmus", {}), *self._slaves]
        based = [repr(os.path.basename(self._rest["system"]))] if "system" in self._rest else []
        return f"System({', '.join([*based, *names])})"

    def _repr_html_(self) -> str:
        fmus = [(name, os.path.basename(path)) for name, path in self._rest.get("fmus", {}).items()]
        slaves = [(name, type(slave).__name__) for name, slave in self._slaves.items()]
        sources: dict[str, list[str]] = {}
        for entry in self._rest.get("connections", []):
            sources.setdefault(entry["to"].partition(".")[0], []).append(f"{entry['from']} to {entry['to']}")
        by_name = not sources and "system" not in self._rest and len(fmus) + len(slaves) > 1
        others = ("by equal names",) if by_name else ()
        rows = [(name, file, "; ".join(sources.get(name, others))) for name, file in [*fmus, *slaves]]
        return page(repr(self), ("name", "FMU or object", "connections to it"), rows)

    def files(self) -> dict[str, str]:
        """Return the SHA-256 of every file that the system reads, by absolute path.

        A folder has the hash of the names and hashes of its files. The hash of an SSD, or of a system of
        libcosim, includes the files that it names.
        """
        paths = {table[name] for table, name in _entries_of_files(self.to_dict())}
        return {path: hash_of_file(path) for path in sorted(paths)}

    def with_files(self, paths: Mapping[str, PathLike]) -> System:
        """Return a copy that reads other files: absolute path to new path, as for :meth:`files`."""
        replaced = {os.path.abspath(old): os.path.abspath(os.fspath(new)) for old, new in paths.items()}
        system = self.copy()
        config = system.to_dict()
        for table, name in _entries_of_files(config):
            table[name] = replaced.get(table[name], table[name])
        system._adopt(config)
        return system

    def _study(self) -> _core.Study:
        # Arrays of NumPy cannot be compared as dicts and lists are.
        config = plain(self._config())
        if self._cache is not None:
            known, slaves, study = self._cache
            # Objects that are equal may still be two objects, of which the system has one.
            same = slaves.keys() == self._slaves.keys() and all(slaves[name] is self._slaves[name] for name in slaves)
            if same and known == config:
                return study
        study = _core.Study(config, self._folder, list(self._slaves.items()))
        self._cache = copy.deepcopy(config), dict(self._slaves), study
        return study

    def _check_values(self, values: Mapping[str, Any] | None, isolate: bool | None = None) -> None:
        """Refuse a matrix of another shape, whose rows would be mixed, and bytes for a variable that is no Binary."""
        present = {**self.start_values, **({} if values is None else values)}
        parts = {name: dict(_elements(value)) for name, value in present.items()}
        shapes = {name: tuple(map(max, zip(*elements))) for name, elements in parts.items()}
        matrices = [name for name, shape in shapes.items() if len(_long(shape)) > 1]
        binaries = [name for name, elements in parts.items() if any(isinstance(element, _BYTES) for element in elements.values())]
        if not matrices and not binaries:
            return
        variables = self._study().check(_changes(start_values=values, isolate=isolate), quiet=True)
        types = {entry["name"]: entry["type"] for entry in variables}
        known = arrays(types)
        for name in matrices:
            if name in known and _long(known[name].shape) != _long(shapes[name]):
                sentence = f"{name} has the shape {known[name].shape}, found an array of the shape {shapes[name]}"
                raise ConfigurationError(sentence, "Shape", {"name": name})
        for name in binaries:
            kind = types.get(known[name].elements[0] if name in known else name)
            if kind not in ("Binary", None):
                raise ConfigurationError(f"{name} is a {kind}, found bytes", "Value", {"name": name})

    def check(self, **changes: Any) -> None:
        """Find every error that is known before a run: loads and connects the FMUs, resolves all names.

        Args:
            changes: as for :meth:`run`, as far as they change the configuration.

        Raises:
            ConfigurationError, FmuError: the first error.
        """
        self._study().check(_changes(**changes))

    def variables(self) -> list[Variable]:
        """Return the variables of all FMUs, with names ``"fmu.variable"``."""
        return [Variable(**entry) for entry in self._study().check({}, quiet=True)]

    @keywords(_FMPY)
    def run(
        self,
        *,
        start_values: Mapping[str, Any] | None = None,
        faults: Iterable[Mapping[str, Any]] | None = None,
        settings: Iterable[Mapping[str, Any]] | None = None,
        signals: Iterable[Mapping[str, Any]] | None = None,
        record: Iterable[str] | None = None,
        exclude: Iterable[str] | None = None,
        record_every: float | Literal["step", "never"] | None = None,
        start_time: float | None = None,
        stop_time: float | None = None,
        step: float | None = None,
        tolerance: float | None = None,
        algorithm: Mapping[str, Any] | None = None,
        isolate: bool | None = None,
        call_time_limit: float | None = None,
        memory_limit: int | str | None = None,
        time_limit: float | None = None,
        cancel: Cancel | None = None,
        progress: bool | Callable[[float], object] | None = None,
        file: PathLike | None = None,
    ) -> Results:
        """Run the system to its stop time and return the results.

        The arguments take precedence over the system, which they do not change. The interpreter is
        released while the FMUs step. Ctrl-C raises ``KeyboardInterrupt`` after the present step; the
        exception has the attribute ``results`` with the rows up to then.

        Args:
            start_values: values of variables before the run, by ``"fmu.variable"``.
            faults: further faults; see :func:`fault`.
            settings: further settings during the run, as ``[[scenario.set]]``.
            signals: further signals, as ``[[scenario.signal]]``.
            record: variables to record, by name or pattern; default: inputs, outputs, local variables.
            exclude: variables not to record, by name or pattern.
            record_every: interval between rows in s, ``"step"`` or ``"never"``; default: every step, with
                more than 10,000 steps 10,000 intervals.
            start_time, stop_time: simulated time in s.
            step: communication step in s.
            tolerance: relative tolerance of solvers inside the FMUs.
            algorithm: entries of ``[algorithm]``, such as ``{"method": "jacobi"}``.
            isolate: run each FMU in a process of its own (Linux).
            call_time_limit: limit of each call of an isolated FMU, in s of wall-clock time.
            memory_limit: limit of the memory of an isolated FMU, in bytes or as ``"2GiB"``.
            time_limit: limit of the run from loading to the last step, in s of wall-clock time, checked between steps.
            cancel: ends the run from another thread.
            progress: ``True`` for a bar on a terminal, a line in a notebook; or a function of the fraction done, 0 to 1.
            file: also write the results to this ``.csv`` or ``.parquet`` file.

        Raises:
            ConfigurationError: a name, a value or a setting is wrong.
            FmuError: an FMU cannot be loaded or instantiated.
            RunError: the run failed after its start; its ``results`` has the rows up to then.
            ResultsError: the file cannot be written; its ``results`` has the rows if the run has started.
        """
        self._check_values(start_values, isolate)
        changes = _changes(
            start_values=start_values,
            faults=faults,
            settings=settings,
            signals=signals,
            record=record,
            exclude=exclude,
            record_every=record_every,
            start_time=start_time,
            stop_time=stop_time,
            step=step,
            tolerance=tolerance,
            algorithm=algorithm,
            isolate=isolate,
            call_time_limit=call_time_limit,
            memory_limit=memory_limit,
            file=None if file is None else os.path.abspath(os.fspath(file)),
        )
        return self._run(changes, time_limit=time_limit, cancel=cancel, progress=progress)

    def _run(self, changes: dict[str, Any], **options: Any) -> Results:
        outcome, stop = self._study().run(changes, **{**options, "progress": of_run(options.get("progress"))})
        results, error = Results(outcome), cast("Any", stop)
        if error is None:
            return results
        try:
            error.results = results
            raise error
        finally:
            # The traceback would otherwise keep this frame, and with it the results, in a cycle.
            del error, stop, results

    @keywords(_FMPY)
    def simulation(
        self,
        *,
        start_values: Mapping[str, Any] | None = None,
        faults: Iterable[Mapping[str, Any]] | None = None,
        settings: Iterable[Mapping[str, Any]] | None = None,
        signals: Iterable[Mapping[str, Any]] | None = None,
        start_time: float | None = None,
        stop_time: float | None = None,
        step: float | None = None,
        tolerance: float | None = None,
        algorithm: Mapping[str, Any] | None = None,
        isolate: bool | None = None,
        call_time_limit: float | None = None,
        memory_limit: int | str | None = None,
    ) -> Simulation:
        """Initialise the FMUs and return a simulation to advance step by step.

        The arguments are those of :meth:`run`. Use the simulation in a ``with`` statement, which frees
        the FMUs at its end.
        """
        self._check_values(start_values, isolate)
        changes = _changes(
            start_values=start_values,
            faults=faults,
            settings=settings,
            signals=signals,
            start_time=start_time,
            stop_time=stop_time,
            step=step,
            tolerance=tolerance,
            algorithm=algorithm,
            isolate=isolate,
            call_time_limit=call_time_limit,
            memory_limit=memory_limit,
        )
        return Simulation(self._study().simulation(changes))


class Simulation:
    """A simulation that Python advances; :meth:`System.simulation` creates it.

    ``simulation["fmu.variable"]`` is the value of a variable at the time reached, of an array of FMI 3.0
    an array; the names of all variables are what a loop over the simulation gives.
    """

    def __init__(self, stepper: _core.Stepper) -> None:
        self._stepper = stepper

    @cached_property
    def _names(self) -> dict[str, None]:
        return dict.fromkeys(self._stepper.names())

    @cached_property
    def _arrays(self) -> dict[str, Array]:
        return arrays(self._names)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: object) -> bool:
        return name in self._names or name in self._arrays

    def _ipython_key_completions_(self) -> list[str]:
        return [*self._names, *self._arrays]

    def __enter__(self) -> Simulation:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self.close()
        except Exception:
            # The exception of the block is the one that matters.
            if kind is None:
                raise

    @property
    def time(self) -> float:
        """Simulated time in s that is reached."""
        return self._stepper.time

    @property
    def finished(self) -> bool:
        """Whether the stop time is reached or an FMU requested the end."""
        return self._stepper.finished

    def names(self) -> list[str]:
        """Return the names of all variables, ``"fmu.variable"``."""
        return list(self._names)

    def step(self, count: int = 1) -> int:
        """Make up to ``count`` communication steps; return how many were made before the end."""
        return self._stepper.step(count)

    def run_until(self, time: float) -> int:
        """Step until a simulated time in s is reached; return the number of steps."""
        return self._stepper.run_until(time)

    def __getitem__(self, name: str) -> Any:
        if name in self._names or name not in self._arrays:
            return self._stepper[name]
        import numpy

        array = self._arrays[name]
        return numpy.array(self._stepper.get(list(array.elements))).reshape(array.shape)

    def get(self, names: Iterable[str]) -> list[Any]:
        """Return the values of several variables, of an array of FMI 3.0 an array."""
        if isinstance(names, str):
            raise TypeError(f"expected a list of names, found the text {names!r}")
        listed = list(names)
        if not self._arrays.keys().isdisjoint(listed):
            return [self[name] for name in listed]
        return self._stepper.get(listed)

    def set(self, name: str, value: object) -> None:
        """Set an input without a connection or a tunable parameter, from the next step on."""
        known = {} if name in self._names else self._arrays
        for variable, element in spread({name: value}, known):
            self._stepper.set(variable, element)

    def save(self) -> bytes:
        """Return the state of all FMUs and connections.

        Raises:
            ConfigurationError: an FMU cannot serialise its state (``canSerializeFMUstate``).
        """
        return self._stepper.save()

    def restore(self, state: bytes) -> None:
        """Return to a state that :meth:`save` of this or an equal simulation has returned.

        Faults that have not begun in the state may differ: one run is the start of several.

        Raises:
            ConfigurationError: the state is one of another system, step, algorithm or start time, or of other faults.
        """
        self._stepper.restore(state)

    def close(self) -> None:
        """Terminate and free the FMUs. A second call does nothing."""
        self._stepper.close()


def stated(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries that are not ``None``."""
    return {name: value for name, value in entries.items() if value is not None}


def _entries_of_files(config: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
    """Return the entries of a configuration that are paths of files: the table of each, and its name in it."""
    if "system" in config:
        yield config, "system"
    fmus, scenario = config.get("fmus", {}), config.get("scenario", {})
    yield from ((fmus, name) for name in fmus)
    yield from ((entry, "csv") for entry in scenario.get("table", []))
    yield from ((entry["csv"], "file") for entry in scenario.get("signal", []) if "csv" in entry)


def _flat(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values of variables: of arrays of numbers as one text, of arrays of texts for each element."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        elements = dict(_elements(value.tolist() if hasattr(value, "tolist") else value))
        if () in elements:
            flat[name] = _plain(elements[()])
        elif any(isinstance(element, (str, bytes)) for element in elements.values()):
            for indices, element in elements.items():
                flat[f"{name}[{','.join(map(str, indices))}]"] = _plain(element)
        else:
            flat[name] = ", ".join(_text(element) for element in elements.values())
    return flat


def _elements(value: Any, indices: tuple[int, ...] = ()) -> Iterator[tuple[tuple[int, ...], Any]]:
    """Return the elements of nested lists with their indices, which start at 1."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if not isinstance(value, (list, tuple)):
        yield indices, value
        return
    for index, item in enumerate(value, 1):
        yield from _elements(item, (*indices, index))


def _long(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the extents above 1, in whose order the elements are read."""
    return tuple(extent for extent in shape if extent > 1)


def _plain(value: Any) -> Any:
    return value.hex() if isinstance(value, _BYTES) else value


def _text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


@keywords(_FMPY, "check")
def _changes(
    *,
    start_values: Mapping[str, Any] | None = None,
    faults: Iterable[Mapping[str, Any]] | None = None,
    settings: Iterable[Mapping[str, Any]] | None = None,
    signals: Iterable[Mapping[str, Any]] | None = None,
    tables: Iterable[Mapping[str, Any]] | None = None,
    record: Iterable[str] | None = None,
    exclude: Iterable[str] | None = None,
    record_every: float | str | None = None,
    start_time: float | None = None,
    stop_time: float | None = None,
    step: float | None = None,
    tolerance: float | None = None,
    algorithm: Mapping[str, Any] | None = None,
    isolate: bool | None = None,
    call_time_limit: float | None = None,
    memory_limit: int | str | None = None,
    file: str | None = None,
) -> dict[str, Any]:
    """Return the entries of a ``system.toml`` that the arguments of a run state."""
    if isinstance(record, str) or isinstance(exclude, str):
        raise TypeError("record and exclude are lists of names, found a str")
    for name, value in {"faults": faults, "settings": settings, "signals": signals}.items():
        if isinstance(value, Mapping):
            raise TypeError(f"{name} is a list of dicts, found a dict")
    if isinstance(algorithm, str):
        raise TypeError(f'algorithm is a dict, such as {{"method": "jacobi"}}, found the text {algorithm!r}')
    recorded = None if record is None else list(record)
    if recorded is not None and not recorded:
        record_every = "never"
    options = {} if algorithm is None else dict(algorithm)
    options = {name.replace("_", "-"): value for name, value in options.items()}
    tables_of = {
        "settings": None if start_values is None else _flat(start_values),
        "scenario": {
            "set": None if settings is None else list(settings),
            "signal": None if signals is None else list(signals),
            "table": None if tables is None else list(tables),
            "fault": None if faults is None else list(faults),
        },
        "results": {
            "record": recorded,
            "exclude": None if exclude is None else list(exclude),
            "every": record_every,
            "file": file,
        },
        "experiment": {"start-time": start_time, "stop-time": stop_time, "tolerance": tolerance},
        "algorithm": {**options, **({} if step is None else {"step": step})},
        "isolation": {
            "isolate": isolate,
            "time-limit": call_time_limit,
            "memory-limit": memory_limit,
        },
    }
    changes = {name: stated(table or {}) for name, table in tables_of.items()}
    return {name: table for name, table in changes.items() if table}


def files_named_by(path: str) -> list[str]:
    """Return the files that an SSD, or a system of libcosim, names by relative paths, and those that these name."""
    named: list[str] = []
    for file in itertools.chain([path], named):
        if not file.lower().endswith((".ssd", ".xml")):
            continue
        try:
            sources = [element.get("source", "") for element in ElementTree.parse(file).iter()]
        except (OSError, ElementTree.ParseError):
            # The run says what is wrong.
            continue
        for source in sources:
            # libcosim runs proxyfmu://HOST?file=NAME elsewhere.
            name = unquote(source.rpartition("?file=")[2].partition("#")[0]).replace("\\", "/")
            inner = os.path.normpath(os.path.join(os.path.dirname(file), name))
            if name and not os.path.isabs(name) and os.path.exists(inner) and inner not in (path, *named):
                named.append(inner)
    if path.lower().endswith(".xml"):
        # The descriptions of groups of variables are beside the FMUs or the system.
        folders = dict.fromkeys(os.path.dirname(file) for file in (path, *named))
        named += [str(file) for folder in folders for file in sorted(Path(folder).glob("*_OspModelDescription.xml"))]
    return named


def hash_of_file(path: str, *, alone: bool = False) -> str:
    """Return the SHA-256 of a file with those that it names, or only of the file, or of a folder."""
    digest = hashlib.sha256()
    if os.path.isdir(path):
        for folder, folders, names in os.walk(path):
            folders.sort()
            for name in sorted(names):
                inner = os.path.join(folder, name)
                digest.update(os.path.relpath(inner, path).encode() + b"\0" + hash_of_file(inner, alone=True).encode())
        return digest.hexdigest()
    for inner in [] if alone else files_named_by(path):
        name = os.path.relpath(inner, os.path.dirname(path))
        digest.update(name.encode() + b"\0" + hash_of_file(inner, alone=True).encode())
    try:
        with open(path, "rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    except OSError as error:
        raise Error(f"cannot read {path}: {error.strerror}") from error
    return digest.hexdigest()
