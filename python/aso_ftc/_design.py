"""Designs of fault-tolerant controllers."""

from __future__ import annotations

import contextlib
import json
import os
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from . import _core
from ._errors import DesignError
from ._paper import fmus
from ._system import PathLike

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Controller", "Design", "design"]


def design(plant: object, **entries: Any) -> Design:
    """Design observer and feedback with fault compensation for a linear plant.

    Args:
        plant: the path of a plant file; its content as nested dicts; a linear system with the attributes
            ``A``, ``B``, ``C`` (and ``D``, which must be zero), such as ``control.StateSpace``; a tuple
            of matrices ``(A, B, C)`` with the shapes (n, n), (n, m), (p, n); or the path of a ``.npz`` or
            ``.mat`` file with them.
        entries: entries of the plant file, which replace those of the plant: ``feedback``,
            ``observer``, ``F_a`` (n, q), ``faults``, ``measurements``, ...; see the page "Plant file".

    Returns:
        gains, checks and report: the same numbers as ``aso-ftc design``.

    Raises:
        DesignError: an entry is wrong, or no gain meets the requirements.

    >>> made = design((A, B, C), feedback={"eigenvalues": [-2, -3]},
    ...               observer={"eigenvalues": [-8, -9, -10]}, actuator_faults=True)  # doctest: +SKIP
    """
    if isinstance(plant, (str, os.PathLike)):
        path = os.fspath(plant)
        if path.lower().endswith((".npz", ".mat")):
            return _of_entries({**_of_file(path), **entries})
        if not entries:
            return Design(_core.design_file(path))
        with open(path, encoding="utf-8") as file:
            own = _core.parse_toml(file.read())
        return _of_entries({**own, **entries}, os.path.dirname(os.path.abspath(path)))
    if isinstance(plant, Mapping):
        return _of_entries({**plant, **entries})
    return _of_entries({**_matrices(plant), **entries})


def _of_entries(entries: Mapping[str, Any], folder: str | None = None) -> Design:
    own = {name: _plain(value) for name, value in entries.items() if value is not None}
    own = _with_signals(own)
    return Design(_core.design_plant(own, os.path.join(folder or os.getcwd(), "plant.toml")))


def _plain(value: Any) -> Any:
    """Return matrices as lists of rows of floats."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    return value


def _matrices(plant: Any) -> dict[str, Any]:
    import numpy

    if all(hasattr(plant, name) for name in "ABC"):
        if getattr(plant, "dt", None) not in (None, 0, False):
            raise DesignError("the plant is sampled, expected a continuous-time system", "Sampled")
        feedthrough = numpy.asarray(getattr(plant, "D", 0.0), dtype=float)
        if feedthrough.any():
            raise DesignError("the matrix D of the plant is not zero, expected no feedthrough", "D")
        named = {"A": plant.A, "B": plant.B, "C": plant.C}
        labels = {
            "states": getattr(plant, "state_labels", None),
            "actuators": getattr(plant, "input_labels", None),
            "measurements": getattr(plant, "output_labels", None),
        }
    elif isinstance(plant, (tuple, list)) and len(plant) == 3:
        named, labels = dict(zip("ABC", plant)), {}
    else:
        kind = type(plant).__name__
        raise TypeError(f"expected a path, a dict, a linear system or matrices (A, B, C), found {kind}")
    own: dict[str, Any] = {
        name: numpy.atleast_2d(numpy.asarray(matrix, dtype=float)).tolist() for name, matrix in named.items()
    }
    for entry, names in labels.items():
        if names and all(str(name).isidentifier() for name in names):
            own[entry] = [{"name": str(name)} for name in names]
    return own


def _with_signals(own: dict[str, Any]) -> dict[str, Any]:
    """Add names of states, commands and measurements where there are none."""
    for entry, matrix, axis, letter in (
        ("states", "A", 0, "x"),
        ("actuators", "B", 1, "u"),
        ("measurements", "C", 0, "y"),
    ):
        if entry not in own and matrix in own:
            rows = own[matrix]
            count = len(rows) if axis == 0 else len(rows[0])
            own[entry] = [{"name": f"{letter}{k + 1}"} for k in range(count)]
    return own


def _of_file(path: str) -> dict[str, Any]:
    """Read the matrices of a ``.npz`` or ``.mat`` file."""
    import numpy

    content: Mapping[str, Any]
    if path.lower().endswith(".npz"):
        content = numpy.load(path)
    else:
        from ._results import _package

        content = _package("scipy.io", "a .mat file").loadmat(path)
    missing = [name for name in "ABC" if name not in content]
    if missing:
        raise DesignError(f"{path} has no matrix {missing[0]}, expected A, B, C", "Matrix")
    names = [name for name in ("A", "B", "C", "F_a") if name in content]
    return {name: numpy.atleast_2d(numpy.asarray(content[name], dtype=float)).tolist() for name in names}


class Design:
    """A designed controller: gains, checks, report; :func:`design` returns it."""

    def __init__(self, designed: _core.Designed) -> None:
        self._designed = designed
        self._report: dict[str, Any] | None = None

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

        return {own["name"]: numpy.array(own["values"], dtype=float) for own in self.report["gains"]}

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
        return Controller(self._designed)

    def page(self) -> str:
        """Return the report as an HTML page that needs no other file."""
        return self._designed.page()

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{'yes' if own['holds'] else '<b>no</b>'}</td><td>{_escaped(own['condition'])}</td></tr>"
            for own in self.checks
        )
        title = _escaped(self.report["description"])
        return f"<p>{title}: {self.verdict}</p><table><tr><th>holds</th><th>condition</th></tr>{rows}</table>"

    def __repr__(self) -> str:
        held = sum(own["holds"] for own in self.checks)
        return f"<Design: {', '.join(self.gains)}; {held} of {len(self.checks)} checks hold; {self.verdict}>"


class Controller:
    """The controller of a design."""

    def __init__(self, designed: _core.Designed) -> None:
        self._designed = designed

    def fmu(self, path: PathLike, *, base: PathLike | None = None) -> str:
        """Write the controller as an FMU; return its path.

        Args:
            path: the file to write.
            base: the packed controller from which it is made; default: that of this package.
        """
        start = os.fspath(base) if base is not None else os.fspath(fmus()["AsoController"])
        self._designed.fmu(start, os.fspath(path))
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


def _escaped(text: str) -> str:
    import html

    return html.escape(text)
