"""Published plants whose slow, fast and weakly coupled modes stopped a design: gains by scipy, peaks and bounds by numpy.

Source: F. Leibfritz, COMPl_eib: constraint matrix-optimization problem library, University of Trier (2004); the names are its own.
"""

import json

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from design_oracle import WITHOUT_PROOFS, closed_loop, commands, design_and_report

NN6 = np.zeros((9, 9))
NN6[[0, 2, 5, 7], [1, 3, 6, 8]] = 1
NN6[1, [1, 2, 4, 5, 7]] = -20, -4.2, 4.45, 12.5, 100
NN6[3, [1, 2, 4]] = 4.7, 8.35, -1.1
NN6[4, 4] = -3.3
NN6[6, [1, 4, 5]] = 10.9, -2.55, -250
NN6[8, [1, 4, 7]] = 5.9, -1.39, -3700
# A, B, C and a sample time.
PLANTS = {
    "AC4, missile": (
        [[-0.876, 1, -0.1209, 0], [8.9117, 0, -130.75, 0], [0, 0, -150, 0], [-1, 0, 0, -0.05]],
        [[0], [0], [150], [0]],
        [[-1, 0, 0, 0], [0, -1, 0, 0]],
        0.002,
    ),
    "TF2, terrain following": (
        [
            [-1, 0, 0, 0, 0, 0, 0],
            [1, 0, 0, 0, 0, 0, 0],
            [0, 1, 0, 0, 0, 0, 0],
            [0, 0, 0, 0, 0, 0, 0],
            [0, 0, 0, 1, -1, 0, 0],
            [-0.088, 0.0345, 0, 0, 1, -0.0032, 0],
            [0, 0, 0.05, 0, 0, 0, -1e-5],
        ],
        [[1, 0], [0, 0], [0, 0], [0, 0.09], [0, 0], [0, 0], [0, 0]],
        np.eye(7)[[2, 1, 3]],
        0.1,
    ),
    "PAS, piezoelectric actuator": (
        [
            [0, 1, 0, 0, 0],
            [-274921.63, -73.2915, -274921.63, 0, 0],
            [0, 0, -0.9597, 0, 0],
            [1, 0, 0, 0, 0],
            [0, 0, 0, 1, 0],
        ],
        [[0], [0.12841], [-3.39561e-7], [0], [0]],
        np.eye(5)[[0, 3, 4]],
        0.00057,
    ),
    "NN6, academic": (
        NN6,
        np.eye(9)[:, [4]] * 3.3,
        [*np.eye(9)[:2], [0, 0, 1, 0, 0, 0.66, 0, 1.2, 0], [0, 0, 0, 1, 0, 0, 0.66, 0, 1.2]],
        0.0049,
    ),
}


def designed(aso_ftc, folder, name, sampled, options=WITHOUT_PROOFS):
    """Plant, report and matrices of a linear-quadratic design with a fault of the first command."""
    *plant, period = PLANTS[name]
    a, b, c = map(np.array, plant)
    text = f"sample_time = {period}\n" if sampled else ""
    text += "".join(f"{name} = {matrix.tolist()}\n" for name, matrix in zip("ABC", (a, b, c)))
    text += f"feedback.Q = {[1.0] * len(a)}\nfeedback.R = {[1.0] * b.shape[1]}\n"
    text += f"observer.W = {[1.0] * len(a) + [100.0]}\nobserver.V = {[0.01] * len(c)}\n"
    text += '[[faults]]\nname = "f"\nactuator = "u1"\nbound = 1.0\nrate_bound = 1.0\n'
    matrices, report = design_and_report(aso_ftc, folder, text, options)
    assert matrices is not None, report
    return (a, b, c), report, matrices


def peak_of_s(matrices, near):
    """The largest singular value of S, from a signal that is added to the commands to the actuators, on a grid around `near`."""
    a, *_ = closed_loop(matrices)
    b = np.vstack([matrices.B, np.zeros((matrices.n + matrices.q, matrices.B.shape[1]))])
    c = commands(matrices)

    def largest(w):
        point = 1j * w if matrices.period is None else np.exp(1j * w * matrices.period)
        return np.linalg.norm(np.eye(len(c)) + c @ np.linalg.solve(point * np.eye(len(a)) - a, b), 2)

    return max(largest(w) for w in near * np.geomspace(0.5, 2, 2001))


@pytest.mark.parametrize("sampled", [False, True], ids=["continuous", "sampled"])
@pytest.mark.parametrize("name", PLANTS)
def test_stiff_plants_are_designed_and_examined(aso_ftc, tmp_path, name, sampled):
    (a, b, c), report, matrices = designed(aso_ftc, tmp_path, name, sampled)
    if not sampled:
        p = solve_continuous_are(a, b, np.eye(len(a)), np.eye(b.shape[1]))
        assert np.abs(matrices.K_x + b.T @ p).max() < 1e-7 * np.abs(matrices.K_x).max()
        a_0, c_0, gain = matrices.augmented
        weights = np.diag([1.0] * len(a) + [100.0]), 0.01 * np.eye(len(c))
        p = solve_continuous_are(a_0.T, c_0.T, *weights)
        assert np.abs(gain - p @ c_0.T / 0.01).max() < 1e-6 * np.abs(gain).max()
    at_commands = report["robustness"]["points"][0]
    expected = peak_of_s(matrices, at_commands["s_frequency"])
    assert at_commands["s_peak"] == pytest.approx(expected, rel=1e-3)


def test_bounds_of_a_slow_sampled_loop_are_sums_of_its_impulse_response(aso_ftc, tmp_path):
    """The fault may change 16 times in a sample: more than at the samples, by no more than a jump between them."""
    _, report, matrices = designed(aso_ftc, tmp_path, "AC4, missile", sampled=True, options=())
    a, b, c, d = closed_loop(matrices)
    sums, state = np.abs(d), b
    for _ in range(200_000):
        sums, state = sums + np.abs(c @ state), a @ state
    gains = {bound["error"]: bound["gain_of_fault"] for bound in report["bounds"]}
    for row, name in enumerate(["x1", "x2", "x3", "x4"]):
        assert 0.999 * sums[row, 0] <= gains[name] <= 1.5 * sums[row, 0], name


def test_a_design_whose_responses_overflow_is_written_and_red(aso_ftc, tmp_path):
    """BDT1, a binary distillation tower: the observer that is asked for has eigenvectors with a condition of 1e16."""
    diagonal = [-0.014, -0.0138, -0.0141, -0.0158, -0.0312, -0.0352, -0.0422, -0.0482, -0.0572, -0.0483, -0.0185]
    above = [0.0043, 0.0046, 0.0063, 0.011, 0.015, 0.022, 0.028, 0.037, 0.042, 0.0005]
    below = [0.0095, 0.0095, 0.0095, 0.0095, 0.0202, 0.0202, 0.0202, 0.0202, 0.0202, 0.0255]
    a = np.diag(diagonal) + np.diag(above, 1) + np.diag(below, -1)
    a[[1, 2, 7, 8, 10], [10, 10, 10, 10, 0]] = 0.0005, 0.0002, 0.0002, 0.0005, 0.0255
    b = 1e-6 * np.array(
        [
            [0, 5, 2, 1, 0, 0, -5, -10, -40, -20, 460],
            [0, -40, -20, -10, 0, 0, 10, 30, 5, 2, 460],
            [0, 2500, 5000, 5000, 5000, 5000, 5000, 5000, 2500, 2500, 0],
        ]
    )
    plant = ("A", a), ("B", b.T), ("C", np.eye(11)[[9, 0, 10]])
    text = "".join(f"{name} = {matrix.tolist()}\n" for name, matrix in plant)
    text += 'actuator_faults = "all"\nrobustness.cases = 0\n'
    text += f"feedback.eigenvalues = {[-0.3 - 0.045 * i for i in range(11)]}\n"
    text += f"observer.eigenvalues = {[-1.2 - 0.18 * i for i in range(14)]}\n"
    (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--json")
    assert done.returncode == 1, done.stderr
    report = json.loads(done.stdout)
    assert report["verdict"]["level"] == "red" and report["steps"] == []
    assert any("responses to faults cannot be computed" in reason for reason in report["verdict"]["reasons"])
    assert (tmp_path / "design.toml").exists()
