"""Sampled observers by the least H-infinity norm for published plants, beside scipy's indefinite Riccati equation and a frequency sweep."""

import numpy as np
import pytest
from scipy.linalg import LinAlgError, block_diag, solve_discrete_are

from design_oracle import design_and_report

NOISE = 0.01
# Planar vertical take-off aircraft: Astrom and Murray, Feedback Systems (2008), example 5.12; the values of python-control.
MASS, INERTIA, LEVER, GRAVITY, DAMPING = 4, 0.0475, 0.25, 9.8, 0.05
AIRCRAFT = (
    [
        [0, 0, 0, 1, 0, 0],
        [0, 0, 0, 0, 1, 0],
        [0, 0, 0, 0, 0, 1],
        [0, 0, -GRAVITY, -DAMPING / MASS, 0, 0],
        [0, 0, 0, 0, -DAMPING / MASS, 0],
        [0] * 6,
    ],
    [[0, 0], [0, 0], [0, 0], [1 / MASS, 0], [0, 1 / MASS], [LEVER / INERTIA, 0]],
    [[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0]],
    0.5,
)
# HIMAT aircraft: Safonov, Laub, Hartmann, IEEE Trans. Autom. Control 26 (1981); rates in 1/s, angles in rad, outputs in degrees.
HIMAT = (
    [[-0.0226, -36.6, -18.9, -32.1], [0, -1.9, 0.983, 0], [0.0123, -11.7, -2.63, 0], [0, 0, 1, 0]],
    [[0, 0], [-0.414, 0], [-77.8, 22.4], [0, 0]],
    [[0, 57.3, 0, 0], [0, 0, 0, 57.3]],
    0.08,
)
# Position of a DC motor with a fast current: Control Tutorials for MATLAB and Simulink.
MOTOR = ([[0, 1, 0], [0, -1.0865, 8487.2], [0, -9963.6, -1454545.5]], [[0], [0], [363636.4]], [[1, 0, 0]], 2e-7)
# Bus suspension of the same tutorials: quarter of a bus, the distance of body and wheel is measured.
SUSPENSION = (
    [[0, 1, 0, 0], [-6.57125, 0, -25.255, -0.14], [46.9375, 0, -48.1725, 1], [250, 0, -1844.5, 0]],
    [[0], [0.0004], [0], [0.003525]],
    [[0, 0, 1, 0]],
    0.007,
)


def problem(design, noise):
    """A, C, B, D, E of the error dynamics A - L C; the disturbances are the rates of the faults and the noise."""
    a_0, c_0, gain = design.augmented
    rates = np.vstack([np.zeros((design.n, design.q)), design.period * np.eye(design.q)])
    b = np.hstack([rates, np.zeros((len(a_0), len(c_0)))])
    d = np.hstack([c_0 @ rates, noise * np.eye(len(c_0))])
    return a_0, c_0 @ a_0, b, d, rates.T / design.period, gain


def sweep(a, c, b, d, e, gain):
    """The norm of the error dynamics, from below."""
    closed, entering = a - gain @ c, b - gain @ d
    angles = np.concatenate([[0], np.logspace(-9, np.log10(np.pi), 4000), np.abs(np.angle(np.linalg.eigvals(closed)))])
    stacked = np.linalg.solve(np.exp(1j * angles)[:, None, None] * np.eye(len(a)) - closed, entering.astype(complex))
    return np.linalg.norm(e @ stacked, 2, axis=(1, 2)).max()


def least_norm(a, c, b, d, e):
    """Bisection over the Riccati equation of the a priori filter (Hassibi, Sayed, Kailath 1996)."""

    def exists(gamma):
        both, weight = np.vstack([c, e]), block_diag(d @ d.T, -(gamma**2) * np.eye(len(e)))
        try:
            x = solve_discrete_are(a.T, both.T, b @ b.T, weight, s=np.hstack([b @ d.T, np.zeros((len(a), len(e)))]))
        except (LinAlgError, ValueError):
            return False
        size = np.abs(x).max()
        return np.linalg.eigvalsh(x).min() > -1e-8 * size and np.linalg.eigvalsh(gamma**2 * np.eye(len(e)) - e @ x @ e.T).min() > 0

    low, high = 1e-6, 1e6
    while high > low * 1.001:
        gamma = np.sqrt(low * high)
        low, high = (low, gamma) if exists(gamma) else (gamma, high)
    return high


@pytest.mark.parametrize("plant", [AIRCRAFT, HIMAT, MOTOR, SUSPENSION], ids=["aircraft", "himat", "motor", "suspension"])
def test_a_sampled_observer_has_nearly_the_least_norm_of_any_filter(aso_ftc, tmp_path, plant):
    a, b, c, period = plant
    text = f"sample_time = {period}\nA = {a}\nB = {b}\nC = {c}\nactuator_faults = \"all\"\n"
    text += f"feedback.Q = {[1.0] * len(a)}\nfeedback.R = {[1.0] * len(b[0])}\nobserver.h_infinity = \"least\"\nobserver.noise = {NOISE}\n"
    design, report = design_and_report(aso_ftc, tmp_path, text)
    assert design is not None, report
    matrices = problem(design, NOISE)
    norm, least = sweep(*matrices), least_norm(*matrices[:-1])
    stated = report["observer"]["norm"]
    assert stated["norm"] == pytest.approx(norm, rel=1e-3)
    assert 0.999 * least < norm < 1.13 * least
    if stated["lower_bound"] is not None:
        assert 0.99 * least < stated["lower_bound"] < 1.002 * least
