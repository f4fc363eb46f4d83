"""Designs of fault-tolerant controllers."""

from __future__ import annotations

import contextlib
import json
import os
import warnings
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from . import _core, _plant
from ._errors import DesignError
from ._html import page
from ._paper import fmus
from ._results import _package
from ._system import PathLike

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Controller", "Design", "design", "entries_of"]


def design(plant: object, **entries: Any) -> Design:
    """Design observer and feedback with fault compensation for a linear plant.

    Args:
        plant: the path of a plant file; its content as nested dicts; a system of python-control or scipy.signal
            (state space, transfer function, zeros and poles), sampled with its ``dt``; a tuple of matrices ``(A, B, C)`` or
            ``(A, B, C, D)`` with the shapes (n, n), (n, m), (p, n), (p, m); or the path of a ``.npz`` or ``.mat``
            file with them.
        entries: entries of the plant file, which replace those of the plant: ``feedback``,
            ``observer``, ``F_a`` (n, q), ``faults``, ``measurements``, ...; see the page "Plant file". ``None``
            removes an entry. Eigenvalues are numbers as NumPy gives them, complex ones in pairs. Without ``feedback``
            or ``observer`` a bandwidth is chosen by the verdict.

    Returns:
        gains, checks and report: the same numbers as ``aso-ftc design``.

    Raises:
        DesignError: an entry is wrong, or no gain meets the requirements.

    >>> result = design((A, B, C), actuator_faults="all")  # doctest: +SKIP
    """
    if isinstance(plant, (str, os.PathLike)) and not entries and not _has_matrices(os.fspath(plant)):
        return Design(_core.design_file(os.fspath(plant)), os.path.abspath(os.fspath(plant)))
    content, path = entries_of(plant)
    return _of_entries({**content, **entries}, path)


def _has_matrices(path: str) -> bool:
    return path.lower().endswith((".npz", ".mat"))


def entries_of(plant: object) -> tuple[dict[str, Any], str]:
    """Return the entries of a plant, as :func:`design` takes it, and a file in the folder where their paths start."""
    folder = os.getcwd()
    if isinstance(plant, (str, os.PathLike)):
        path = os.path.abspath(os.fspath(plant))
        if _has_matrices(path):
            content = _plant.of_file(path)
        else:
            try:
                with open(path, encoding="utf-8") as file:
                    content = _core.parse_toml(file.read())
            except OSError as error:
                raise DesignError(f"cannot read {path}: {error.strerror}", "File", {"path": path}) from None
            except ValueError as error:
                # Neither TOML nor UTF-8.
                raise DesignError(f"{path}: {error}", "Entry", {"path": path}) from None
            folder = os.path.dirname(path)
    elif isinstance(plant, Mapping):
        content = dict(plant)
    else:
        content = _plant.of_system(plant)
    return content, os.path.join(folder, "plant.toml")


def _of_entries(entries: Mapping[str, Any], path: str) -> Design:
    stated = {name: _plant.stated(value, name) for name, value in entries.items() if value is not None}
    stated = _plant.with_names(stated)
    with _without_place(is_file=False):
        return Design(_core.design_plant(stated, path), path, stated)


@contextlib.contextmanager
def _without_place(*, is_file: bool) -> Iterator[None]:
    """Let an error of a plant that nobody wrote to a file name the entry alone."""
    try:
        yield
    except DesignError as error:
        if is_file or "message" not in error.fields:
            raise
        raise DesignError(error.fields["message"], error.kind) from None


class Design:
    """A designed controller: gains, checks, report; :func:`design` returns it."""

    def __init__(self, designed: _core.Designed, path: str, entries: dict[str, Any] | None = None) -> None:
        self._designed = designed
        self._path = path
        self._is_file = entries is None
        self._entries = entries
        self._report: dict[str, Any] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return _of_entries, (self.entries, self._path)

    @property
    def entries(self) -> dict[str, Any]:
        """The plant and the requirements: the entries of the plant file."""
        if self._entries is None:
            self._entries = _core.parse_toml(self._designed.plant)
        return dict(self._entries)

    def with_(self, **entries: Any) -> Design:
        """Design again with other entries: ``design.with_(observer={"eigenvalues": [-4, -5, -6]})``."""
        return _of_entries({**self.entries, **entries}, self._path)

    @property
    def report(self) -> dict[str, Any]:
        """The numbers of the report, as ``aso-ftc design --json`` prints them."""
        if self._report is None:
            self._report = json.loads(self._designed.report())
        return self._report

    @property
    def gains(self) -> dict[str, NDArray[Any]]:
        """The matrices of the controller by name: ``K_x`` (m, n), ``K_f``, ``L_x`` (n, p), ``L_f``, ..."""
        import numpy

        return {gain["name"]: numpy.array(gain["values"], dtype=float) for gain in self.report["gains"]}

    @property
    def K_x(self) -> NDArray[Any]:
        """The gain of the state feedback (m, n)."""
        return self.gains["K_x"]

    @property
    def K_f(self) -> NDArray[Any]:
        """The gain of the fault compensation (m, q)."""
        return self.gains["K_f"]

    @property
    def L(self) -> NDArray[Any]:
        """The gain of the observer: ``L_x`` (n, p) above ``L_f`` (q, p)."""
        import numpy

        return numpy.vstack([self.gains["L_x"], self.gains["L_f"]])

    @property
    def eigenvalues(self) -> dict[str, NDArray[Any]]:
        """The eigenvalues of ``feedback`` (A + B K_x) and ``observer`` (A_0 - L C_0), complex; of a sample if sampled."""
        import numpy

        pairs = {part: self.report[part]["eigenvalues"] for part in ("feedback", "observer")}
        return {part: numpy.array([complex(*value) for value in values]) for part, values in pairs.items()}

    @property
    def margins(self) -> list[dict[str, Any]]:
        """The margins of each command (``at`` is ``input``) and measurement (``output``).

        ``gain`` has the factors up to which the loop is stable, ``phase`` is in degrees, ``delay`` in s.
        """
        points = (self.report["robustness"] or {"points": []})["points"]
        names = ("name", "gain", "phase", "delay")
        return [
            {"at": point["point"], **{name: channel[name] for name in names}}
            for point in points
            for channel in point["channels"]
        ]

    @property
    def plant(self) -> Any:
        """The plant from commands to measurements as a ``control.StateSpace``; of a sampled design held and sampled."""
        return self._system("plant", self._commands, self._measurements)

    @property
    def closed_loop(self) -> Any:
        """The loop as a ``control.StateSpace``.

        From signals that are added to commands and measurements, to commands and measurements without these.
        """
        signals = [*self._commands, *self._measurements]
        return self._system("closed loop", [f"d_{name}" for name in signals], signals)

    @property
    def S(self) -> Any:
        """The sensitivity at the measurements as ``control.FrequencyResponseData``."""
        return self._response("S at the measurements")

    @property
    def T(self) -> Any:
        """The complementary sensitivity at the measurements as ``control.FrequencyResponseData``."""
        return self._response("T at the measurements")

    @property
    def S_input(self) -> Any:
        """The sensitivity at the commands as ``control.FrequencyResponseData``."""
        return self._response("S at the commands")

    @property
    def T_input(self) -> Any:
        """The complementary sensitivity at the commands as ``control.FrequencyResponseData``."""
        return self._response("T at the commands")

    @property
    def _commands(self) -> list[str]:
        return [signal["name"] for signal in self.report["plant"]["actuators"]]

    @property
    def _measurements(self) -> list[str]:
        return [signal["name"] for signal in self.report["plant"]["measurements"]]

    def _system(self, name: str, inputs: list[str], outputs: list[str]) -> Any:
        import numpy

        control = _package("control", "a system of python-control")
        matrices, period = self._designed.system(name)
        sizes = ((-1, len(matrices[0])), (len(matrices[0]), -1), (-1, len(matrices[0])), (len(outputs), -1))
        arrays = [numpy.array(rows, dtype=float).reshape(size) for rows, size in zip(matrices, sizes)]
        return control.StateSpace(*arrays, period or 0, inputs=inputs, outputs=outputs)

    def _response(self, name: str) -> Any:
        import numpy

        signals = self._commands if name.endswith("commands") else self._measurements
        system = self._system(name, signals, signals)
        curves = (self.report["robustness"] or {"curves": []})["curves"]
        if not curves:
            raise DesignError(f"{name} does not exist: the loop is not stable", "Unstable")
        return _package("control", name).frequency_response(system, numpy.array(curves[0]["frequencies"]))

    def plot_bode(self, ax: Any = None) -> Any:
        """Plot the largest singular values of S and T at commands and measurements over the frequency; return the axes."""
        ax = _axes(ax)
        for curve in (self.report["robustness"] or {"curves": []})["curves"]:
            ax.loglog(curve["frequencies"], curve["singular_values"][0], label=curve["name"])
        ax.set_xlabel("frequency in rad/s")
        ax.set_ylabel("largest singular value")
        ax.legend()
        return ax

    def plot_step(self, ax: Any = None, *, fault: str | None = None) -> Any:
        """Plot the responses to a step of a fault, the first one by default; return the axes."""
        steps = self.report["steps"]
        names = [step["fault"] for step in steps]
        if fault is not None and fault not in names:
            raise DesignError(f"there is no fault {fault!r}, expected one of {', '.join(names)}", "Fault")
        step = steps[names.index(fault) if fault else 0]
        ax = _axes(ax)
        for curve in step["curves"]:
            unit = f" in {curve['unit']}" if curve["unit"] else ""
            ax.plot(curve["times"], curve["values"], label=f"{curve['name']}{unit}")
        ax.set_xlabel("time in s")
        ax.set_title(f"step of {step['fault']} by {step['size']:g} {step['unit'] or ''}".rstrip())
        ax.legend()
        return ax

    @property
    def checks(self) -> list[dict[str, Any]]:
        """The conditions that were checked: ``condition``, ``holds``, ``value``, ``explanation``."""
        return list(self.report["checks"])

    @property
    def bounds(self) -> list[dict[str, Any]]:
        """Bounds of the errors, one for each pair of a fault and an error."""
        return list(self.report["bounds"])

    @property
    def verdict(self) -> str:
        """How robust the design is: ``green``, ``amber`` or ``red``; ``report["verdict"]`` says why."""
        return str(self.report["verdict"]["level"])

    @property
    def reasons(self) -> list[str]:
        """The sentences for a verdict that is not green."""
        return list(self.report["verdict"]["reasons"])

    @property
    def ok(self) -> bool:
        """Whether all checks hold and the verdict is not red: where ``aso-ftc design`` ends with status 0."""
        return self._designed.holds and self.verdict != "red"

    @property
    def design_file(self) -> str:
        """The text of the controller's ``design.toml``."""
        return self._designed.file

    @property
    def controller(self) -> Controller:
        """The controller, to make its FMU."""
        return Controller(self)

    def page(self) -> str:
        """Return the report as an HTML page that needs no other file."""
        return self._designed.page()

    def _repr_html_(self) -> str:
        rows = [("yes" if check["holds"] else "no", check["condition"]) for check in self.checks]
        verdict = "; ".join([self.verdict, *self.reasons])
        return page(f"{self.report['description']}: {verdict}", ("holds", "condition"), rows)

    def __str__(self) -> str:
        import numpy

        lines = [self.report["description"], f"verdict: {self.verdict}", *(f"    {reason}" for reason in self.reasons)]
        with numpy.printoptions(precision=5, suppress=True):
            lines.extend(f"{name} =\n{gain}" for name, gain in self.gains.items())
            lines.extend(f"eigenvalues, {part}: {values}" for part, values in self.eigenvalues.items())
        robustness = self.report["robustness"]
        if robustness:
            peaks = ", ".join(f"{point['judged']:.3f} at the {point['point']}" for point in robustness["points"])
            # JSON has null for a margin without a limit.
            delay = robustness["delay_margin"]
            lines.append(f"peak of S: {peaks}; delay margin: {'no limit' if delay is None else f'{delay:.4g} s'}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        held = sum(check["holds"] for check in self.checks)
        return f"<Design: {', '.join(self.gains)}; {held} of {len(self.checks)} checks hold; {self.verdict}>"


def _axes(ax: Any) -> Any:
    if ax is not None:
        return ax
    return _package("matplotlib.pyplot", "a plot").subplots()[1]


def _controller(base: PathLike | None) -> str:
    """The packed controller from which another one is made."""
    return os.fspath(fmus()["AsoController"] if base is None else base)


class Controller:
    """The controller of a design."""

    def __init__(self, design: Design) -> None:
        self._design = design
        self._designed = design._designed

    def __reduce__(self) -> tuple[Any, ...]:
        return Controller, (self._design,)

    def _errors(self) -> contextlib.AbstractContextManager[None]:
        return _without_place(is_file=self._design._is_file)

    @property
    def system(self) -> Any:
        """The controller from measurements to commands, limits aside, as a ``control.StateSpace``."""
        design = self._design
        return design._system("controller", design._measurements, design._commands)

    def fmu(self, path: PathLike, *, base: PathLike | None = None) -> str:
        """Write the controller as an FMU; return its path.

        Args:
            path: the file to write.
            base: the packed controller from which it is made; default: that of this package.
        """
        with self._errors():
            self._designed.fmu(_controller(base), os.fspath(path))
        return os.fspath(path)

    def kalman_fmu(self, path: PathLike, *, base: PathLike) -> str:
        """Write a Kalman filter that carries the plant's FMU; return its path.

        Args:
            path: the file to write.
            base: the packed filter from which it is made, ``KalmanFilter.fmu`` of ``aso-ftc pack fmu-kalman``.
        """
        with self._errors():
            note = self._designed.kalman_fmu(os.fspath(base), os.fspath(path))
        if note is not None:
            warnings.warn(note, stacklevel=2)
        return os.fspath(path)

    def feedback_fmu(self, path: PathLike, *, base: PathLike | None = None) -> str:
        """Write the controller that takes the estimates of the Kalman filter in place of its own; return its path.

        Args:
            path: the file to write.
            base: the packed controller from which it is made; default: that of this package.
        """
        with self._errors():
            self._designed.feedback_fmu(_controller(base), os.fspath(path))
        return os.fspath(path)

    def c_code(self, folder: PathLike, *, single: bool = False) -> list[str]:
        """Write the controller of a sampled design as C99; return the paths: header, source, runtime.

        Args:
            folder: where to write; it is made if it is missing, and files of the same names are replaced.
            single: ``float`` instead of ``double``, with a bound of the difference in the header.
        """
        return self._code(folder, False, single)

    def rust_crate(self, folder: PathLike, *, single: bool = False) -> list[str]:
        """Write the controller of a sampled design as a Rust crate without the standard library; return the paths.

        The arguments are those of :meth:`c_code`.
        """
        return self._code(folder, True, single)

    def _code(self, folder: PathLike, rust: bool, single: bool) -> list[str]:
        with self._errors():
            files, notes = self._designed.code(rust, single)
        paths = []
        for name, text in files:
            path = os.path.join(os.fspath(folder), name)
            os.makedirs(os.path.dirname(path), exist_ok=True)
            temporary = f"{path}.{os.getpid()}.tmp"
            try:
                with open(temporary, "w", encoding="ascii", newline="\n") as file:
                    file.write(text)
                os.replace(temporary, path)
            except OSError:
                with contextlib.suppress(OSError):
                    os.remove(temporary)
                raise
            paths.append(path)
        for note in notes:
            warnings.warn(note, stacklevel=3)
        return paths
