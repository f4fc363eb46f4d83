"""Functions of the scripts that write reference files of control: path of the file, matrices as text, held inputs."""

import sys
from pathlib import Path

import numpy as np
from scipy.linalg import expm

ROOT = Path(__file__).resolve().parents[2]
CONTROL = ROOT / "crates" / "control" / "tests"


def target(name):
    """The path of the first argument, or of the committed file."""
    return Path(sys.argv[1]) if len(sys.argv) > 1 else CONTROL / "data" / name


def numbers(values):
    """Numbers with all their digits, row by row."""
    return " ".join(repr(float(value)) for value in np.ravel(values))


def write(file, kind, name, **matrices):
    """Writes a case: a heading, and for each matrix a line with its name, its size and its entries row by row."""
    file.write(f"{kind}: {name}\n")
    for key, values in matrices.items():
        m = np.atleast_2d(values)
        file.write(f"{key} {m.shape[0]} {m.shape[1]} {numbers(m)}\n")


def zoh(a, b, period):
    """A and B over a period with a held input, by the matrix exponential."""
    n, m = b.shape
    whole = expm(np.block([[a, b], [np.zeros((m, n + m))]]) * period)
    return whole[:n, :n], whole[:n, n:]
