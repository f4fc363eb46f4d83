"""Writes plant files of 60 random plants for published_plants.py: python scripts/reference/random_plants.py FOLDER.

4 to 10 states, 2 to 4 commands and at least as many measurements; entries of A, B and C are normally distributed. Every third plant has
complex eigenvalues to place, which KNV0 does not. Each actuator has a constant fault. Needs numpy.
"""

import sys
from pathlib import Path

import numpy as np

SEED = 7


def eigenvalues(random, count, lowest, highest, is_complex):
    values = np.round(-np.sort(random.uniform(lowest, highest, count)), 2)
    pairs = int(random.integers(1, count // 2 + 1)) if is_complex else 0
    stated = []
    for k in range(pairs):
        size, angle = abs(values[2 * k]), random.uniform(0.2, 1.2)
        stated.append(f"{{ re = {-size * np.cos(angle):.2f}, im = {size * np.sin(angle):.2f} }}")
    return f"[{', '.join(stated + [repr(float(value)) for value in values[2 * pairs :]])}]"


def main():
    folder, random = Path(sys.argv[1]), np.random.default_rng(SEED)
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(60):
        n = int(random.integers(4, 11))
        m = int(random.integers(2, min(4, n - 1) + 1))
        p = min(int(random.integers(m, 5)), n)
        lines = [
            f"{name} = {np.round(random.normal(size=shape), 2).tolist()}"
            for name, shape in [("A", (n, n)), ("B", (n, m)), ("C", (p, n))]
        ]
        lines += ['actuator_faults = "all"']
        lines += [f"feedback.eigenvalues = {eigenvalues(random, n, 1, 4, k % 3 == 2)}"]
        lines += [f"observer.eigenvalues = {eigenvalues(random, n + m, 4, 14, k % 3 == 2)}"]
        (folder / f"r{k:02d}.toml").write_text("\n".join([*lines, "robustness.cases = 0", ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
