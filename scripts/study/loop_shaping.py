"""Compares `[loop]` of plant files with mixsyn of python-control and with normalised coprime factors, as a table in Markdown.

    python scripts/study/loop_shaping.py

Both designs have the same weights of S, T and K S, `bandwidth` of the table below and `peak` 1.5. mixsyn minimises the norm of
[W1 S; W2 K S; W3 T] at the measurements, and its controller has the order of plant and weights together. The
third controller is that of D. McFarlane and K. Glover, IEEE Trans. Autom. Control 37 (1992), for the plant with an integrator
at each command and the loop gain 1 at the bandwidth, within 10 % of the largest margin; its equations are those of
S. Skogestad and I. Postlethwaite, Multivariable Feedback Control, 2nd edition, (9.65) to (9.70).
gamma is max(|W1 S|, |W3 T|) at the measurements and the commands, and the peaks are those of S, all computed here on a grid
of 4000 frequencies. Needs target/release/aso-ftc and Python 3.11 with python-control 0.10.2 and slycot 0.7.1.
"""

import json
import re
import tomllib

import control
import numpy as np
from scipy.linalg import solve_continuous_are

from command import ROOT, design

PEAK, FLOOR, ROLL_OFF, EFFORT = 1.5, 0.01, 10.0, 100.0
# The integrators of the shaped plant act below the bandwidth by this factor.
SLOWER = 5.0

# Numerator and denominator of each plant with one command, and the bandwidth in rad/s.
SINGLE = {
    "1 / (s + 1)": ([1], [1, 1], 1.0),
    "1 / (s^2 + 0.5 s)": ([1], [1, 0.5, 0], 0.5),
    "1 / (s^2 + 0.2 s + 1)": ([1], [1, 0.2, 1], 0.7),
    "1 / (s + 1)^3": ([1], [1, 3, 3, 1], 0.4),
    "(2 - s) / (s + 1)^2": ([-1, 2], [1, 2, 1], 0.4),
    "1 / (s^2 - 1)": ([1], [1, 0, -1], 1.0),
    "1 / (s - 1)": ([1], [1, -1], 1.5),
    "(1 - s) / (s^2 + s)": ([-1, 1], [1, 1, 0], 0.2),
}
# Plants of examples/plants, and others with several commands.
SEVERAL = {
    "airc": 1.0,
    "distillation": 0.1,
    "quadruple-tank": 0.02,
    "unstable-reactor": 3.0,
}
COUPLED = {
    "1 / (s + 1) [1, 0.5; 0.3, 1]": ([[-1, 0], [0, -1]], [[1, 0.5], [0.3, 1]], [[1, 0], [0, 1]], 1.0),
    "two carts and a spring": (
        [[0, 1, 0, 0], [-1, -0.1, 1, 0.05], [0, 0, 0, 1], [1, 0.05, -1, -0.1]],
        [[0, 0], [1, 0], [0, 0], [0, 1]],
        [[1, 0, 0, 0], [0, 0, 1, 0]],
        0.7,
    ),
}


def plants():
    """The name, A, B and C and the bandwidth of each plant."""
    for name, (numerator, denominator, bandwidth) in SINGLE.items():
        n = len(denominator) - 1
        a = np.eye(n, k=1)
        a[-1] = np.negative(denominator[:0:-1])
        c = np.zeros((1, n))
        c[0, : len(numerator)] = numerator[::-1]
        yield name, a, np.eye(n)[:, -1:], c, bandwidth
    for name, bandwidth in SEVERAL.items():
        plant = tomllib.loads((ROOT / f"examples/plants/{name}.toml").read_text())
        yield name, *(np.array(plant[key], float) for key in "ABC"), bandwidth
    for name, (a, b, c, bandwidth) in COUPLED.items():
        yield name, np.array(a, float), np.array(b, float), np.array(c, float), bandwidth


def weights(bandwidth):
    """The weights of S and T, as transfer functions."""
    s = control.tf("s")
    corner = ROLL_OFF * bandwidth
    of_s = (s / PEAK + bandwidth) / (s + FLOOR * bandwidth)
    of_t = (s / corner + 1) / (s * FLOOR / corner + 1) / PEAK
    return of_s, of_t


def effort(plant, bandwidth):
    """The default of `effort`, without units of its own."""
    speeds = [abs(pole) for pole in plant.poles() if pole.real > 0]
    frequencies = [FLOOR * bandwidth, bandwidth, *(2.0 * speed for speed in speeds)]
    return max(EFFORT / np.linalg.svd(plant(1j * w, squeeze=False), compute_uv=False)[-1] for w in frequencies)


def tuned(a, b, c, bandwidth):
    """Our controller, and the gamma that the command states."""
    rows = [f"{name} = {matrix.tolist()}" for name, matrix in zip("ABC", (a, b, c), strict=True)]
    text = "\n".join([*rows, 'actuator_faults = "all"', "[loop]", f"bandwidth = {bandwidth}", f"peak = {PEAK}"])
    report, file = design(text, "--certificate-time", "0")
    stated = float(re.search(r"gamma = ([0-9.e+-]+[0-9])", json.dumps(report))[1])
    k_x, l_x, l_f = (np.array(file[key], float) for key in ("K_x", "L_x", "L_f"))
    n, m = b.shape
    a_0 = np.block([[a, b], [np.zeros((m, n + m))]])
    c_0 = np.hstack([c, np.zeros((c.shape[0], m))])
    gain = np.hstack([k_x, -np.eye(m)])
    observer = np.vstack([l_x, l_f])
    b_0 = np.vstack([b, np.zeros((m, m))])
    return control.ss(a_0 + b_0 @ gain - observer @ c_0, observer, gain, np.zeros((m, c.shape[0]))), stated


def by_coprime_factors(plant, bandwidth):
    """The controller u = K y with the largest margin of normalised coprime factors for the shaped plant, and that margin."""
    m = plant.ninputs
    weight = control.ss(np.zeros((m, m)), np.eye(m), bandwidth / SLOWER * np.eye(m), np.eye(m))
    shaped = plant * weight
    weight = weight / np.linalg.norm(shaped(1j * bandwidth, squeeze=False), 2)
    shaped = plant * weight
    a, b, c = shaped.A, shaped.B, shaped.C
    x = solve_continuous_are(a, b, c.T @ c, np.eye(m))
    z = solve_continuous_are(a.T, c.T, b @ b.T, np.eye(len(c)))
    least = np.sqrt(1 + max(abs(np.linalg.eigvals(x @ z))))
    squared = (1.1 * least) ** 2
    gain = squared * np.linalg.solve(((1 - squared) * np.eye(len(a)) + x @ z).T, z @ c.T)
    robust = control.ss(a - b @ b.T @ x + gain @ c, gain, b.T @ x, np.zeros((m, len(c))))
    return weight * robust, 1 / least


def figures(plant, controller, bandwidth):
    """gamma, and the peaks of S at the commands and the measurements, of u = K y."""
    omega = bandwidth * np.logspace(-4, 4, 4000)
    g, k = (np.moveaxis(one(1j * omega, squeeze=False), -1, 0) for one in (plant, controller))
    of_s, of_t = (abs(one(1j * omega)) for one in weights(bandwidth))
    gamma, peaks = 0.0, []
    for opened in (k @ g, g @ k):
        unit = np.eye(opened.shape[-1])
        s = np.linalg.inv(unit - opened)
        sizes = np.linalg.norm(s, 2, axis=(1, 2))
        of_complement = np.linalg.norm(unit - s, 2, axis=(1, 2))
        peaks.append(max(1.0, sizes.max()))
        gamma = max(gamma, (of_s * sizes).max(), (of_t * of_complement).max())
    return gamma, *peaks


def main():
    """Prints the table."""
    print("| plant | bandwidth, rad/s | gamma | S at the commands | S at the measurements | margin of coprime factors |")
    print("|---|---|---|---|---|---|")
    for name, a, b, c, bandwidth in plants():
        plant = control.ss(a, b, c, np.zeros((c.shape[0], b.shape[1])))
        ours, stated = tuned(a, b, c, bandwidth)
        peaks = figures(plant, ours, bandwidth)
        if peaks[0] > 1.01 * stated:
            raise RuntimeError(f"{name}: gamma {peaks[0]:.4f}, the command states {stated}")
        of_s, of_t = weights(bandwidth)
        # mixsyn has no integrators; eigenvalues on the imaginary axis move a little.
        shifted = control.ss(a - 1e-4 * bandwidth * np.eye(len(a)), b, c, plant.D)
        theirs, *_ = control.mixsyn(shifted, of_s, control.tf([1.0 / effort(plant, bandwidth)], [1]), of_t)
        other = figures(plant, -theirs, bandwidth)
        robust, margin = by_coprime_factors(plant, bandwidth)
        third = figures(plant, robust, bandwidth)
        cells = [" / ".join(f"{one:.2f}" for one in all_three) for all_three in zip(peaks, other, third, strict=True)]
        print(f"| {name} | {bandwidth:g} | {' | '.join(cells)} | {margin:.2f} |", flush=True)


if __name__ == "__main__":
    main()
