"""Linear plants as Python people have them, as entries of a plant file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ._arrays import plain
from ._errors import DesignError
from ._results import _package

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["of_file", "of_system", "stated", "with_names"]

# The part of an eigenvalue below which the distance from its conjugate counts as rounding.
_ROUNDING = 1e-10
# The parts of C, or of A, below which a further row of an observable part counts as rounding: the first one that leaves
# the response as it is, up to _CHANGE of its largest value.
_DEPENDENT = (1e-8, 1e-10, 1e-12)
_CHANGE = 1e-7
# What a file has: a plant, and the time of a sample in s.
_MATRICES = ("A", "B", "C", "D", "F_a", "Ts")
_NAMES = (("states", "A", 0, "x"), ("actuators", "B", 1, "u"), ("measurements", "C", 0, "y"))
_LABELS = {"states": "state_labels", "actuators": "input_labels", "measurements": "output_labels"}


def stated(value: Any, entry: str) -> Any:
    """Return a value as a plant file states it: lists for arrays, one of each pair of complex numbers."""
    value = plain(value)
    if isinstance(value, dict):
        return {name: stated(inner, str(name)) for name, inner in value.items()}
    if isinstance(value, list) and any(isinstance(element, complex) for element in value):
        return _pairs(value, entry)
    return value


def _pairs(values: Any, entry: str) -> list[Any]:
    """Return real numbers, and one ``{"re": ..., "im": ...}`` for each pair of complex ones."""
    rest = [complex(value) for value in values]
    eigenvalues: list[Any] = []
    while rest:
        value = rest.pop(0)
        if value.imag == 0.0:
            eigenvalues.append(value.real)
            continue
        nearest = min(rest, key=lambda other: abs(other - value.conjugate()), default=None)
        if nearest is None or abs(nearest - value.conjugate()) > _ROUNDING * abs(value):
            raise DesignError(f"{entry}: {value} stands without its conjugate {value.conjugate()}", "Eigenvalues")
        rest.remove(nearest)
        eigenvalues.append({"re": value.real, "im": abs(value.imag)})
    return eigenvalues


def with_names(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Add names of states, commands and measurements where there are none."""
    named = dict(entries)
    for entry, matrix, axis, letter in _NAMES:
        rows = named.get(matrix)
        # Of a matrix that is none the design says what is wrong.
        if entry in named or not isinstance(rows, list) or not all(isinstance(row, list) for row in rows):
            continue
        if rows:
            count = len(rows) if axis == 0 else len(rows[0])
            named[entry] = [{"name": f"{letter}{k + 1}"} for k in range(count)]
    return named


def of_system(plant: Any) -> dict[str, Any]:
    """Return the entries of a linear system, or of a tuple of matrices (A, B, C) or (A, B, C, D)."""
    if isinstance(plant, (tuple, list)) and len(plant) in (3, 4):
        return _entries(*plant)
    return {**_of_model(plant), **_sampling(getattr(plant, "dt", None))}


def _sampling(period: Any) -> dict[str, Any]:
    """Return the entries of matrices in sampled time; none for a plant in continuous time."""
    if period in (None, 0, False):
        return {}
    if period is True:
        raise DesignError("the plant is sampled with dt = True; expected the time of a sample in s", "Sampled")
    return {"matrices": "sampled", "sample_time": float(period)}


def _of_model(plant: Any) -> dict[str, Any]:
    """Return the matrices of a system of python-control or scipy.signal."""
    if all(hasattr(plant, name) for name in "ABC"):
        entries = _entries(plant.A, plant.B, plant.C, getattr(plant, "D", 0.0))
        for entry, attribute in _LABELS.items():
            labels = getattr(plant, attribute, None)
            if labels and all(str(label).isidentifier() for label in labels):
                entries[entry] = [{"name": str(label)} for label in labels]
        return entries
    if hasattr(plant, "num") and hasattr(plant, "ninputs"):
        # Its own realisation of several inputs needs Slycot.
        return _entries(*_realisation(plant.num, plant.den))
    if hasattr(plant, "to_ss"):
        return _of_model(plant.to_ss())
    kind = type(plant).__name__
    raise TypeError(
        "expected a path, a dict, a linear system of python-control or scipy, or matrices (A, B, C) or "
        f"(A, B, C, D), found {kind}"
    )


def _entries(a: Any, b: Any, c: Any, d: Any = 0.0) -> dict[str, Any]:
    """Return the matrices as lists of rows; a vector is a column of B, a row of C."""
    import numpy

    for name, matrix in zip("ABCD", (a, b, c, d)):
        if numpy.iscomplexobj(matrix) and numpy.imag(matrix).any():
            raise DesignError(f"{name}: expected real numbers, found complex ones", "Entry")
    matrices = {name: numpy.asarray(matrix, dtype=float) for name, matrix in zip("ABC", (a, b, c))}
    matrices["A"] = numpy.atleast_2d(matrices["A"])
    states = len(matrices["A"])
    for name, shape in (("B", (states, 1)), ("C", (1, states))):
        # scipy writes an array of one dimension into a .mat file as a row, or as a column.
        if matrices[name].ndim < 2 or matrices[name].shape == shape[::-1]:
            if matrices[name].size != states:
                raise DesignError(
                    f"{name} has {matrices[name].size} elements and A {states} rows: expected a matrix of "
                    f"{'n x m' if name == 'B' else 'p x n'}, or a vector of {states} elements",
                    "Shape",
                )
            matrices[name] = matrices[name].reshape(shape)
    feedthrough = numpy.asarray(d, dtype=float)
    if feedthrough.any():
        size = (len(matrices["C"]), matrices["B"].shape[1])
        is_vector = feedthrough.ndim < 2 or feedthrough.shape == size[::-1]
        if is_vector and feedthrough.size == size[0] * size[1] and 1 in size:
            feedthrough = feedthrough.reshape(size)
        matrices["D"] = feedthrough
    return {name: matrix.tolist() for name, matrix in matrices.items()}


def _realisation(numerators: Any, denominators: Any) -> tuple[NDArray[Any], ...]:
    """Return A, B, C, D of a transfer function: realisations of its elements without what they share."""
    import numpy

    signal = _package("scipy.signal", "a transfer function")
    linalg = _package("scipy.linalg", "a transfer function")
    outputs, inputs = len(numerators), len(numerators[0])
    feedthrough = numpy.zeros((outputs, inputs))
    blocks = []
    for i in range(outputs):
        for j in range(inputs):
            a, b, c, d = signal.tf2ss(numerators[i][j], denominators[i][j])
            feedthrough[i, j] = d.item()
            if outputs * inputs > 1:
                # The companion form has rows and columns of very different lengths.
                whole = numpy.block([[a, b], [c, numpy.zeros((1, 1))]])
                _, (scale, _) = linalg.matrix_balance(whole, permute=False, separate=True)
                scale = scale[:-1] / scale[-1]
                a, b, c = a * scale / scale[:, None], b / scale[:, None], c * scale
            blocks.append((a, b @ numpy.eye(1, inputs, j), numpy.eye(outputs, 1, -i) @ c))
    a = linalg.block_diag(*(block[0] for block in blocks))
    b, c = numpy.vstack([block[1] for block in blocks]), numpy.hstack([block[2] for block in blocks])
    return *(_minimal(a, b, c) if len(blocks) > 1 else (a, b, c)), feedthrough


def _minimal(a: NDArray[Any], b: NDArray[Any], c: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Return a realisation of the same transfer functions without the states that no input or no output has."""
    import numpy

    # Next to the eigenvalues, where each mode shows; in no direction in which eigenvalues usually are.
    sizes = numpy.abs(numpy.linalg.eigvals(a))
    points = numpy.exp(1.3j) * numpy.unique(sizes[sizes > 0])

    def response(a: NDArray[Any], b: NDArray[Any], c: NDArray[Any]) -> NDArray[Any]:
        return numpy.array([c @ numpy.linalg.solve(s * numpy.eye(len(a)) - a, b) for s in points])

    expected = response(a, b, c)
    for tolerance in _DEPENDENT:
        part = _observable(a, b, c, tolerance)
        dual = _observable(part[0].T, part[2].T, part[1].T, tolerance)
        reduced = dual[0].T, dual[2].T, dual[1].T
        change = numpy.abs(response(*reduced) - expected)
        if (change <= _CHANGE * numpy.abs(expected).max(axis=0, initial=0.0)).all():
            return reduced
    return a, b, c


def _observable(
    a: NDArray[Any], b: NDArray[Any], c: NDArray[Any], tolerance: float
) -> tuple[NDArray[Any], ...]:
    """Return the part that the outputs see: its states are the row space of C, C A, C A^2, ...

    Of each product only what is new counts, so that slow modes do not vanish beside powers of fast ones.
    """
    import numpy

    part, rows, size = numpy.zeros((0, len(a))), c, numpy.linalg.norm(c, 2)
    while len(rows):
        _, sizes, basis = numpy.linalg.svd(rows - rows @ part.T @ part, full_matrices=False)
        new = basis[sizes > tolerance * size]
        new = numpy.linalg.qr((new - new @ part.T @ part).T)[0].T
        part, rows, size = numpy.vstack([part, new]), new @ a, numpy.linalg.norm(a, 2)
    return part @ a @ part.T, part @ b, c @ part.T


def _read_npz(path: str) -> dict[str, Any]:
    import numpy

    with numpy.load(path) as file:
        return {name: file[name] for name in _MATRICES if name in file}


def of_file(path: str) -> dict[str, Any]:
    """Read the matrices of a ``.npz`` or ``.mat`` file."""
    import numpy

    read = _read_npz if path.lower().endswith(".npz") else _package("scipy.io", "a .mat file").loadmat
    try:
        content: Mapping[str, Any] = read(path)
    except Exception as error:
        # Of the operating system, of zipfile, of NumPy or of scipy, which refuses files of MATLAB 7.3.
        reason = getattr(error, "strerror", None) or error
        raise DesignError(f"cannot read {path}: {reason}", "File", {"path": path}) from error
    missing = [name for name in "ABC" if name not in content]
    if missing:
        raise DesignError(f"{path} has no matrix {missing[0]}, expected A, B, C", "Matrix")
    a, b, c = (content[name] for name in "ABC")
    entries = _entries(a, b, c, content["D"] if "D" in content else 0.0)
    if "F_a" in content:
        entries["F_a"] = numpy.atleast_2d(numpy.asarray(content["F_a"], dtype=float)).tolist()
    return {**entries, **_sampling(numpy.ravel(content.get("Ts", 0))[0])}
