"""A string of high-speed vehicles (A. J. Laub 1979, example 4; SLICOT benchmark CTDSX 3.1), whose T has a cluster of eigenvalues at 1."""

import numpy as np
import pytest

from design_oracle import design_and_report

COUNT, PERIOD = 12, 0.3


def vehicles(count):
    """Speeds v and distances d of neighbours: v' = -v + u, d_i' = v_i - v_(i+1); the distances are measured."""
    order = 2 * count - 1
    a, b, c = np.zeros((order, order)), np.zeros((order, count)), np.zeros((count - 1, order))
    for at in range(count):
        a[2 * at, 2 * at], b[2 * at, at] = -1, 1
    for at in range(count - 1):
        a[2 * at + 1, 2 * at], a[2 * at + 1, 2 * at + 2], c[at, 2 * at + 1] = 1, -1, 1
    return a, b, c


def loop_gain(design, frequency):
    """L at the commands: u = -L u of the loop that is opened there."""
    n, z = design.n, np.exp(1j * frequency * design.period)
    a_0, c_0, gain = design.augmented
    # The states of `augmented` are x and -f.
    feedback, b_0 = np.hstack([design.K_x, -design.K_f]), np.vstack([design.B, np.zeros((design.q, design.B.shape[1]))])
    correction = np.eye(len(a_0)) - gain @ c_0
    # xi[k+1] = (A_0 + B_0 K) ((I - L C_0) xi + L y),  u = K ((I - L C_0) xi + L y)
    moved = a_0 + b_0 @ feedback
    controller = feedback @ correction @ np.linalg.solve(z * np.eye(len(a_0)) - moved @ correction, moved @ gain) + feedback @ gain
    return -controller @ design.C @ np.linalg.solve(z * np.eye(n) - design.A, design.B)


def delay_margin(design):
    """The least delay at which an eigenvalue of -L e^(-j w tau) is 1, on a fine grid; exact for whole samples."""
    margin, grid = np.inf, np.geomspace(1e-4, 1, 20001) * np.pi / design.period
    at_ends = np.array([np.linalg.eigvals(loop_gain(design, frequency)) for frequency in grid[::10]])
    near = np.abs(np.abs(at_ends) - 1).min(axis=1) < 0.2
    # There, the eigenvalues change by 0.05 at most from one of every tenth frequency to the next.
    for at in np.flatnonzero(near[1:] | near[:-1]):
        for frequency in grid[10 * at : 10 * at + 11]:
            values = np.linalg.eigvals(loop_gain(design, frequency))
            for value in values[np.abs(np.abs(values) - 1) < 2e-3]:
                margin = min(margin, np.angle(-value) % (2 * np.pi) / frequency)
    return margin


def test_the_delay_margin_of_a_string_of_vehicles_is_that_of_the_loop_gain(aso_ftc, tmp_path):
    a, b, c = vehicles(COUNT)
    faults = "".join(f'[[faults]]\nname = "f{at + 1}"\nactuator = "u{at + 1}"\n' for at in range(COUNT - 1))
    weights = f"feedback.Q = {[1.0] * len(a)}\nfeedback.R = {[1.0] * COUNT}\nobserver.W = {[1.0] * len(a) + [100.0] * (COUNT - 1)}\n"
    weights += f"observer.V = {[0.01] * (COUNT - 1)}\n"
    text = f"sample_time = {PERIOD}\nA = {a.tolist()}\nB = {b.tolist()}\nC = {c.tolist()}\n{weights}{faults}"
    design, report = design_and_report(aso_ftc, tmp_path, text)
    assert design is not None, report
    stated = report["robustness"]["delay_margin"]
    # Below one sample the stated margin is that of the continuous plant: it is compared in whole samples.
    assert stated == pytest.approx(delay_margin(design), rel=1e-2)
