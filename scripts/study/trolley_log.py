"""Writes docs/how-to/log/trolley.csv, the log of a trolley of 2 kg with a drag of 1 N s/m, for the page "Design from a log".

The force has steps of random size and length; the position is measured with a deviation of 2 mm.
"""

from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete

PERIOD = 0.1
ROWS = 1200
NOISE = 0.002


def main():
    """Simulates the trolley, and writes the log."""
    random = np.random.default_rng(2026)
    a, b = cont2discrete((np.array([[0, 1], [0, -0.5]]), np.array([[0], [0.5]]), np.eye(2), np.zeros((2, 1))), PERIOD)[:2]
    force = np.concatenate([np.full(random.integers(3, 25), random.uniform(-4, 4)) for _ in range(ROWS // 3)])[:ROWS]
    state, position = np.zeros(2), []
    for value in force:
        position.append(state[0] + NOISE * random.standard_normal())
        state = a @ state + b[:, 0] * value
    rows = zip(PERIOD * np.arange(ROWS), force, position, strict=True)
    lines = ["time [s],force [N],position [m]", *(f"{time:.1f},{value:.3f},{place:.4f}" for time, value, place in rows)]
    out = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "log" / "trolley.csv"
    out.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
