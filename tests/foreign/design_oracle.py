"""The loop of a plant and a designed controller by numpy and scipy, computed from the design file alone.

The states are those of plant, observer and fault estimate, [x; x_hat; f_hat]; in a sampled loop
x_hat and f_hat are the predictions. The input is the fault f, the outputs are
[x; x - x_hat; f_hat - f].
"""

import json
import re
import tomllib

import numpy as np
from scipy.linalg import expm, matrix_balance, solve_continuous_lyapunov, solve_discrete_lyapunov


class Matrices:
    """The matrices of a design file as arrays; without a fault model the fault is constant."""

    def __init__(self, design):
        self.period = design.get("sample_time")
        self.current = design.get("estimator") == "current"
        self.A, self.B, self.C, self.F_a = (np.array(design[name]) for name in ("A", "B", "C", "F_a"))
        self.K_x, self.K_f, self.L_x, self.L_f = (np.array(design[name]) for name in ("K_x", "K_f", "L_x", "L_f"))
        self.n, self.q = self.F_a.shape
        self.filtered = "filter" in design
        constant = np.zeros((self.q, self.q)) if self.period is None else np.eye(self.q)
        self.A_f = np.array(design.get("A_f", constant))

    @property
    def fed_back(self):
        """A + B K_x of the plant, without the filters of the measurements."""
        feels = self.n - (len(self.C) if self.filtered else 0)
        return (self.A + self.B @ self.K_x)[:feels, :feels]

    @property
    def augmented(self):
        """A_0, C_0, L."""
        a_0 = np.block([[self.A, -self.F_a], [np.zeros((self.q, self.n)), self.A_f]])
        c_0 = np.hstack([self.C, np.zeros((len(self.C), self.q))])
        return a_0, c_0, np.vstack([self.L_x, -self.L_f])

    @property
    def error_dynamics(self):
        """A_0 - L C_0, or A_0 - L C_0 A_0 for a current estimator."""
        a_0, c_0, gain = self.augmented
        return a_0 - gain @ c_0 @ (a_0 if self.current else np.eye(len(a_0)))


# The distillation column of S. Skogestad, M. Morari and J. C. Doyle, IEEE Trans. Autom. Control 33 (1988).
COLUMN = """A = [[-0.0133333333, 0], [0, -0.0133333333]]
B = [[0.0117066667, -0.01152], [0.0144266667, -0.0146133333]]
C = [[1, 0], [0, 1]]
actuator_faults = "all"
"""


def says_nothing(done):
    """Whether a design reports no more than where it is, as after each ten seconds."""
    return re.fullmatch(r"(\d+ s, .*\n)*", done.stderr) is not None


# Proofs, bounds and remedies take most of the time of a design, and its gains do not depend on them.
WITHOUT_PROOFS = ("--certificate-time", "0")


def design_and_report(aso_ftc, folder, text, options=WITHOUT_PROOFS):
    """The matrices of the design file for a plant file, and the report; None and the error if it is refused."""
    plant, file = folder / "plant.toml", folder / "design.toml"
    plant.write_text(text, encoding="utf-8")
    done = aso_ftc("design", plant, "--out", file, "--json", "--force", *options)
    if done.returncode == 2:
        return None, done.stderr
    assert done.returncode in (0, 1), done.stderr
    return Matrices(tomllib.loads(file.read_text(encoding="utf-8"))), json.loads(done.stdout)


def commands(matrices):
    """u = K_x x_hat + K_f f_hat as a matrix for [x; x_hat; f_hat]; with a current estimator after the correction."""
    n, q = matrices.n, matrices.q
    x, x_hat, f_hat = np.split(np.eye(2 * n + q), [n, 2 * n])
    if matrices.current:
        innovation = matrices.C @ (x - x_hat)
        x_hat, f_hat = x_hat + matrices.L_x @ innovation, f_hat + matrices.L_f @ innovation
    return matrices.K_x @ x_hat + matrices.K_f @ f_hat


def closed_loop(matrices, losses=None):
    """A, B, C, D of the loop; `losses` reduce the effect of each actuator of the plant."""
    n, q = matrices.n, matrices.q
    left = np.eye(matrices.B.shape[1]) - np.diag(losses if losses is not None else [0] * matrices.B.shape[1])
    x, x_hat, f_hat = np.split(np.eye(2 * n + q), [n, 2 * n])
    innovation = matrices.C @ (x - x_hat)
    if matrices.current:
        x_hat, f_hat = x_hat + matrices.L_x @ innovation, f_hat + matrices.L_f @ innovation
    command = matrices.K_x @ x_hat + matrices.K_f @ f_hat
    correction = (1 - matrices.current) * innovation
    a = np.vstack(
        [
            matrices.A @ x + matrices.B @ left @ command,
            matrices.A @ x_hat + matrices.B @ command + matrices.F_a @ f_hat + matrices.L_x @ correction,
            matrices.A_f @ f_hat + matrices.L_f @ correction if matrices.period else matrices.L_f @ correction,
        ]
    )
    if matrices.period is None:
        a[2 * n :] += matrices.A_f @ f_hat
    b = np.vstack([matrices.F_a, np.zeros((n + q, q))])
    c = np.vstack([x, x - x_hat, f_hat])
    d = np.vstack([np.zeros((2 * n, q)), -np.eye(q)])
    return a, b, c, d


def balanced(a, b, c):
    """The same system in coordinates in which A has rows and columns of equal size."""
    scaled, (scale, order) = matrix_balance(a, permute=False, separate=True)
    assert (order == np.arange(len(a))).all()
    return scaled, b / scale[:, None], c * scale


def responses(system, period, horizon):
    """Times, responses to an impulse, without D, and to a step: one p x m matrix each.

    `horizon` in s or in samples; in continuous time the step response is D + C A^-1 (e^(A t) - I) B.
    """
    a, b, c = balanced(*system[:3])
    if period is None:
        times = np.concatenate([[0], np.geomspace(1e-7, horizon, 6000)])
        states = expm(a * times[:, None, None]) @ b
        step = system[3] + c @ np.linalg.solve(a, states - b)
        return times, c @ states, step
    states = [b]
    for _ in range(horizon):
        states.append(a @ states[-1])
    impulse = np.array([c @ state for state in states])
    step = system[3] + np.concatenate([0 * impulse[:1], np.cumsum(impulse, axis=0)])
    return np.arange(1, horizon + 2), impulse, step


def total(times, values, period):
    """The integral of the values, or their sum in sampled time."""
    if period is not None:
        return values.sum(axis=0)
    return (np.diff(times)[:, None, None] * (values[1:] + values[:-1]) / 2).sum(axis=0)


def frequency_response(system, period, frequency):
    """C (s I - A)^-1 B + D at s = j w or z = e^(j w T)."""
    a, b, c, d = system
    point = 1j * frequency if period is None else np.exp(1j * frequency * period)
    return c @ np.linalg.solve(point * np.eye(len(a)) - a, b) + d


def lyapunov(a, q, period):
    """P with A' P + P A = -Q, or A' P A - P = -Q, solved by scipy in balanced coordinates."""
    scaled, (scale, _) = matrix_balance(a, permute=False, separate=True)
    inner = q * np.outer(scale, scale)
    if period is None:
        solution = solve_continuous_lyapunov(scaled.T, -inner)
    else:
        solution = solve_discrete_lyapunov(scaled.T, inner)
    return solution / np.outer(scale, scale)
