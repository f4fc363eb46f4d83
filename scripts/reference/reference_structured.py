"""Writes crates/control/tests/data/structured.txt: peaks of the bound of the structured singular value by slycot.

Kind "system": a stable A, B, C in continuous time with as many inputs as outputs, the kind of each block (1: a real
number, 2: a complex number), and the largest value over frequency of the bound by D and G, SLICOT AB13MD, on a grid
that is refined about its maximum. Needs Python with numpy, scipy and slycot; writes to the path given as the first
argument, or to the committed file.
"""

import numpy as np
import scipy
from scipy.optimize import minimize_scalar
from slycot import ab13md

from matrices import target, write

SEED = 20261128
# States, real and complex blocks.
SIZES = (2, 2, 0), (4, 3, 0), (6, 4, 0), (4, 2, 2), (6, 0, 4), (5, 6, 1), (8, 5, 0), (8, 1, 5)


def peak(a, b, c, kinds):
    def mu(w):
        m = c @ np.linalg.solve(1j * w * np.eye(len(a)) - a, b)
        return ab13md(m, np.ones(len(kinds), int), kinds)[0]

    size = abs(np.linalg.eigvals(a))
    grid = np.concatenate([[0.0], np.geomspace(size.min() / 100, 100 * size.max(), 2000)])
    values = [mu(w) for w in grid]
    at = int(np.argmax(values))
    ends = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
    fine = minimize_scalar(lambda w: -mu(w), bounds=ends, method="bounded", options={"xatol": 1e-9 * ends[1]})
    return max(values[at], -fine.fun)


def main():
    rng = np.random.default_rng(SEED)
    with target("structured.txt").open("w", encoding="utf-8") as file:
        versions = f"slycot 0.7.1, scipy {scipy.__version__}"
        file.write(f"# scripts/reference/reference_structured.py: {versions}\n")
        for n, real, whole in SIZES:
            r = real + whole
            a = rng.normal(size=(n, n))
            a -= (np.linalg.eigvals(a).real.max() + 0.2) * np.eye(n)
            b, c = rng.normal(size=(n, r)), rng.normal(size=(r, n))
            kinds = np.array([1] * real + [2] * whole)
            name = f"{n} states, {real} real, {whole} complex"
            write(file, "system", name, A=a, B=b, C=c, kinds=kinds, peak=peak(a, b, c, kinds))


if __name__ == "__main__":
    main()
