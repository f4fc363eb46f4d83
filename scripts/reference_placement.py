"""Writes crates/control/tests/claims/placement_reference.txt: what scipy's place_poles reaches on many systems.

Each line: kind; n; m; A by rows; B by rows; wanted eigenvalues (real parts, then imaginary parts); the lowest condition
number of the eigenvectors of length one over KNV0 and YT and several bounds on their iterations; how it was reached;
the largest distance of an eigenvalue of A - B K from the wanted one there, relative to the latter (to the largest one
for zero). A system on which scipy misses an eigenvalue by more than 1e-6 is left out.

The first lines are the observer of fmu-controller/pendulum.toml (A_0', C_0'; continuous, and sampled with eigenvalues
exp(p Ts)) and the chemical reactor, example 1 of Kautsky, Nichols and Van Dooren (1985).

Needs Python 3.11 with numpy and scipy; writes to the path given as the first argument, or to the committed file.
"""

import sys
import tomllib
import warnings
from pathlib import Path

import numpy as np
import scipy
from scipy.linalg import expm
from scipy.optimize import linear_sum_assignment
from scipy.signal import place_poles

ROOT = Path(__file__).resolve().parent.parent
SEED = 1985
CASES = 16
ITERATIONS = [10, 30, 100, 300, 1000]
KINDS = ["real", "complex", "repeated", "discrete"]


def poles_of(kind, n, m, random):
    """n eigenvalues, closed under conjugation, none with a multiplicity above m."""
    size = 0.5 + 0.1 * random.choice(60, n, replace=False)
    if kind == "real":
        return -np.sort(size) + 0j
    pairs = random.integers(1, n // 2 + 1)
    angle = random.uniform(0.1, 1.5, pairs)
    complex_ones = np.round(-size[:pairs] * np.exp(1j * angle), 2)
    if kind == "complex":
        return np.concatenate([complex_ones, complex_ones.conj(), -size[2 * pairs :]])
    if kind == "repeated":
        times = random.integers(2, m + 1) if m > 1 else 1
        several = np.repeat(np.arange(1, n + 1), times)[:n] * -1.0
        if n >= 2 * times and times > 1:
            pair = np.repeat(complex(-1.5, 2.0), times)
            several = np.concatenate([pair, pair.conj(), several[: n - 2 * times]])
        return several + 0j
    zeros = np.zeros(random.integers(1, m + 1))[:n]
    inside = np.round(np.sort(random.uniform(0.05, 0.95, n - len(zeros))), 2) + 1e-2 * np.arange(n - len(zeros))
    return np.concatenate([zeros, inside]) + 0j


def distance(reached, wanted):
    largest = np.abs(wanted).max() or 1.0
    reference = np.where(wanted == 0, largest, np.abs(wanted))
    table = np.abs(reached[None, :] - wanted[:, None]) / reference[:, None]
    return table[linear_sum_assignment(table)].max()


def best(a, b, wanted):
    found = (np.inf, "", np.inf)
    for method in ["KNV0", "YT"]:
        if method == "KNV0" and np.any(wanted.imag):
            continue
        for iterations in ITERATIONS:
            try:
                result = place_poles(a, b, wanted, method=method, rtol=1e-14, maxiter=iterations)
            except (ValueError, np.linalg.LinAlgError):
                continue
            # If B has full row rank, scipy omits X: A - B K is then block diagonal with normal
            # blocks.
            vectors = np.eye(a.shape[0]) if np.linalg.matrix_rank(b) == a.shape[0] else result.X
            condition = np.linalg.cond(vectors / np.linalg.norm(vectors, axis=0))
            error = distance(np.linalg.eigvals(a - b @ result.gain_matrix), wanted)
            if condition < found[0] and error < 1e-6:
                found = (condition, f"{method} {iterations}", error)
    return found


def pendulum():
    """(A_0', C_0') with A_0 = [A, -F_a; 0, 0], C_0 = [C, 0], and the required eigenvalues."""
    plant = tomllib.loads((ROOT / "fmu-controller" / "pendulum.toml").read_text())
    a, c, f = (np.array(plant[name]) for name in ["A", "C", "F_a"])
    a_0 = np.block([[a, -f], [np.zeros((1, 5))]])
    c_0 = np.hstack([c, np.zeros((2, 1))])
    return a_0.T, c_0.T, np.array(plant["observer_eigenvalues"]) + 0j


def named():
    a, b, wanted = pendulum()
    yield "pendulum", a, b, wanted
    for sample_time in [1e-4, 1e-3, 2e-3]:
        yield f"pendulum at {sample_time} s", expm(a * sample_time), b, np.exp(wanted * sample_time)
    reactor = [[1.38, -0.2077, 6.715, -5.676], [-0.5814, -4.29, 0.0, 0.675], [1.067, 4.273, -6.654, 5.893], [0.048, 4.273, 1.343, -2.104]]
    inputs = [[0.0, 0.0], [5.679, 0.0], [1.136, -3.146], [1.136, 0.0]]
    yield "reactor", np.array(reactor), np.array(inputs), np.array([-0.2, -0.5, -5.0566, -8.6659]) + 0j


def random_systems():
    random = np.random.default_rng(SEED)
    for case in range(CASES * len(KINDS)):
        kind = KINDS[case % len(KINDS)]
        n = int(random.integers(2, 11))
        m = int(random.integers(1, min(4, n) + 1))
        a = np.round(random.normal(size=(n, n)) * (0.5 if kind == "discrete" else 1.0), 2)
        b = np.round(random.normal(size=(n, m)), 2)
        yield kind, a, b, poles_of(kind, n, m, random)


def line(kind, a, b, wanted, reached):
    def text(values): return " ".join(repr(float(value)) for value in np.ravel(values))

    fields = [kind, str(a.shape[0]), str(b.shape[1]), text(a), text(b), text(wanted.real), text(wanted.imag)]
    return ";".join(fields + [repr(float(reached[0])), reached[1], f"{reached[2]:.1e}"])


def main():
    warnings.simplefilter("ignore")
    default = ROOT / "crates" / "control" / "tests" / "claims" / "placement_reference.txt"
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else default
    found = [(*system, best(*system[1:])) for system in [*named(), *random_systems()]]
    lines = [line(*system) for system in found if np.isfinite(system[-1][0])]
    with path.open("w") as file:
        file.write(f"# scripts/reference_placement.py: numpy {np.__version__}, scipy {scipy.__version__} place_poles, rtol 1e-14,\n")
        file.write(f"# maxiter {ITERATIONS}, seed {SEED}; {len(found) - len(lines)} left out\n")
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
