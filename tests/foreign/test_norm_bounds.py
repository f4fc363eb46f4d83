"""Lower bounds of the H-infinity norm of observers without noise, beside zeros by scipy and frequency sweeps in numpy."""

import tomllib

import numpy as np
import pytest
from scipy.linalg import eig, expm, null_space

from design_oracle import design_and_report

LEAST = 'observer.h_infinity = "least"\n'
# A fault that acts through the zero at 2 on the angle.
ZERO = """A = [[-3.0, -2.0], [1.0, 0.0]]
B = [[1], [0]]
C = [[-1, 2]]
actuator_faults = "all"
feedback.region = { decay = 0.3 }
"""
PERIOD = 0.1
SAMPLED = f"""A = [[-0.5, 0.2], [0.1, -0.4]]
B = [[1], [0.3]]
C = [[1, 0]]
sample_time = {PERIOD}
actuator_faults = "all"
feedback.region = {{ decay = 0.3 }}
"""


@pytest.fixture
def designed(aso_ftc, tmp_path):
    """Designs; returns the matrices and what the report says of the observer, or None and the error."""

    def design(text):
        matrices, report = design_and_report(aso_ftc, tmp_path, text)
        return matrices, report if matrices is None else report["observer"]

    return design


def augmented(a, f_a, c):
    """A_0, C_0 and the column of the rates."""
    n, q = f_a.shape
    return np.block([[a, -f_a], [np.zeros((q, n + q))]]), np.hstack([c, np.zeros((len(c), q))]), np.vstack([np.zeros((n, q)), np.eye(q)])


def hidden(a_0, c_0, rates):
    """At the only zero of the right half plane: the errors of the faults for each unit of their rates."""
    n, q = rates.shape
    pencil = np.block([[a_0, rates], [c_0, np.zeros((len(c_0), q))]])
    zeros = eig(pencil, np.diag([1.0] * n + [0.0] * q), right=False)
    (zero,) = [zero.real for zero in zeros if np.isfinite(zero) and 1e-6 < zero.real < 1e6]
    motion = null_space(pencil - zero * np.diag([1.0] * n + [0.0] * q), rcond=1e-9)
    return zero, np.linalg.norm(motion[n - q : n]) / np.linalg.norm(motion[n:])


def norm(design, points):
    """The largest error of the faults for each unit of their rates, without noise, of a continuous observer."""
    a_0, c_0, rates = augmented(design.A, design.F_a, design.C)
    closed = a_0 - np.vstack([design.L_x, -design.L_f]) @ c_0
    responses = np.linalg.solve(points[:, None, None] * np.eye(len(a_0)) - closed, rates.astype(complex))
    return np.linalg.norm(rates.T @ responses, 2, axis=(1, 2)).max()


SWEEP = 1j * np.concatenate([[0], np.logspace(-4, 5, 4000)])


def test_a_zero_of_the_right_half_plane_limits_every_filter(designed):
    design, report = designed(ZERO + "observer.h_infinity = 0.7\n")
    zero, least = hidden(*augmented(design.A, design.F_a, design.C))
    assert zero == pytest.approx(2) and least == pytest.approx(0.5)
    assert report["norm"]["lower_bound_for"] == "filters"
    assert report["norm"]["lower_bound"] == pytest.approx(least, rel=1e-5)
    assert report["norm"]["norm"] == pytest.approx(norm(design, SWEEP), rel=1e-3)
    assert least < norm(design, SWEEP) < 0.7
    assert "No gain and no filter of any order has a norm below 5.0000e-1" in report["method"]
    _, error = designed(ZERO + "observer.h_infinity = 0.49\n")
    assert "nor does a filter of any order: expected a bound above 5.0000e-1" in error, error
    # The trace in a disc: the three eigenvalues, each at least 1 / 39, add to the zero.
    _, report = designed(ZERO + LEAST + "observer.region = { disc = { center = -20, radius = 19 } }\n")
    assert report["norm"]["lower_bound_for"] == "disc"
    assert report["norm"]["lower_bound"] == pytest.approx(least + 3 / 39, rel=1e-5)


def test_zeros_of_two_faults_are_those_that_scipy_finds(designed, root):
    """The quadruple tank in its nonminimum phase (Johansson 2000)."""
    file = tomllib.loads((root / "examples/plants/quadruple-tank-nonminimum-phase.toml").read_text())
    text = "".join(f"{name} = {file[name]}\n" for name in "ABC")
    text += 'actuator_faults = "all"\nfeedback.region = { decay = 0.003 }\nobserver.h_infinity = 1000.0\n'
    design, report = designed(text)
    zero, least = hidden(*augmented(design.A, design.F_a, design.C))
    assert report["norm"]["lower_bound"] == pytest.approx(least, rel=1e-5)
    assert least == pytest.approx(1 / zero)
    sweep = norm(design, SWEEP)
    assert least < sweep < 1000 and report["norm"]["gap"] == pytest.approx(sweep / least - 1, rel=1e-2)


def test_without_such_zeros_the_bound_is_zero_and_larger_gains_lower_the_norm(designed):
    plant = ZERO.replace("[[-1, 2]]", "[[1, 2]]")
    norms = []
    for bound in (0.1, 0.01):
        design, report = designed(plant + f"observer.h_infinity = {bound}\n")
        assert report["norm"]["lower_bound"] == 0 and report["norm"]["gap"] is None
        assert "there is no lower bound above 0" in report["method"]
        norms.append(norm(design, SWEEP))
    assert norms[0] < 0.1 and norms[1] < 0.01


def test_measurement_noise_does_not_lower_the_least_error_of_a_sample(designed):
    """Three tanks, two of them measured: J. Lunze, Regelungstechnik 1. One sample hides a change of T times the rate."""
    period = 10.337211310523381
    plant = "A = [[-0.01, 0.01, 0], [0.01, -0.021, 0.01], [0, 0.01, -0.018]]\nB = [[65, 0], [0, 0], [0, 65]]\n"
    plant += f'C = [[1, 0, 0], [0, 0, 1]]\nactuator_faults = "all"\nsample_time = {period}\n'
    plant += 'feedback.h_infinity = "least"\nobserver.h_infinity = "least"\nobserver.noise = 0.01\n'
    _, report = designed(plant)
    assert report["norm"]["lower_bound"] in (None, pytest.approx(period, rel=1e-5))
    assert period <= report["norm"]["norm"] < 1.01 * period


@pytest.mark.parametrize("estimator", ["current", "prediction"])
def test_a_sampled_observer_reaches_the_bound_of_the_delay(designed, estimator):
    design, report = designed(f'estimator = "{estimator}"\n' + SAMPLED + LEAST)
    # The newest measurement shows the fault of the sample before; a prediction knows that of one sample before only.
    delay = {"current": 1, "prediction": 2}[estimator]
    least = PERIOD * np.linalg.norm(np.tril(np.ones((delay, delay))), 2)
    assert report["norm"]["lower_bound"] == pytest.approx(least, rel=1e-5) and report["norm"]["lower_bound_for"] == "filters"
    n, slopes = 2, np.array([[-0.5, 0.2, 1], [0.1, -0.4, 0.3], [0, 0, 0]])
    a, b = np.split(expm(PERIOD * slopes)[:n], [n], axis=1)
    assert design.A == pytest.approx(a) and design.B == pytest.approx(b)
    a_0 = np.block([[a, -b], [np.zeros((1, n)), np.eye(1)]])
    c_0 = np.array([[1.0, 0, 0]])
    gain, rates = np.vstack([design.L_x, -design.L_f]), np.array([[0.0], [0], [PERIOD]])
    # The error before the correction, or after it.
    keep = np.eye(3) - gain @ c_0 if estimator == "current" else np.eye(3)
    closed, entering = (keep @ a_0, keep @ rates) if estimator == "current" else (a_0 - gain @ c_0, rates)
    points = np.exp(1j * np.linspace(0, np.pi, 4000))
    errors = np.linalg.solve(points[:, None, None] * np.eye(3) - closed, entering.astype(complex))[:, 2, 0]
    assert report["norm"]["norm"] == pytest.approx(abs(errors).max(), rel=1e-3)
    assert least < abs(errors).max() < 1.01 * least


def test_a_disc_limits_the_gains_with_their_eigenvalues_in_it(designed):
    plant = ZERO.replace("[[-1, 2]]", "[[0, 1]]")
    region = "observer.region = { disc = { center = -6, radius = 4 } }\n"
    design, report = designed(plant + LEAST + region)
    # No zeros: the trace is the sum of the inverse eigenvalues, each at least 1 / 10.
    assert report["norm"]["lower_bound"] == pytest.approx(0.3, rel=1e-5) and report["norm"]["lower_bound_for"] == "disc"
    assert 0.3 < norm(design, SWEEP) < 0.6
    _, error = designed(plant + region + "observer.h_infinity = 0.29\n")
    assert "no gain with all eigenvalues in the disc keeps this bound: expected a bound above 3.0000e-1" in error, error
