"""Designs by the H-infinity norm with measurement noise and weights, beside Riccati equations and a frequency sweep in numpy.

The plant is the quadruple tank in its minimum phase (Johansson, IEEE Trans. Control Syst. Technol. 8 (2000))."""

import json
import re
import tomllib

import numpy as np
import pytest
from scipy.linalg import schur

from design_oracle import WITHOUT_PROOFS, Matrices

A = np.array([[-1 / 62, 0, 1 / 23, 0], [0, -1 / 90, 0, 1 / 30], [0, 0, -1 / 23, 0], [0, 0, 0, -1 / 30]])
B = np.array([[0.08325, 0], [0, 0.0628125], [0, 0.04785714285714286], [0.03121875, 0]])
C = np.array([[0.5, 0, 0, 0], [0, 0.5, 0, 0]])
NOISE, WEIGHTS = 0.01, [2.0, 1.0]
A_0 = np.block([[A, -B], [np.zeros((2, 6))]])
C_0 = np.hstack([C, np.zeros((2, 2))])
RATES = np.vstack([np.zeros((4, 2)), np.eye(2)])
ERRORS = np.diag(WEIGHTS) @ RATES.T
PLANT = f"""A = {A.tolist()}
B = {B.tolist()}
C = {C.tolist()}
actuator_faults = "all"
feedback.region = {{ decay = 0.03, disc = {{ center = -0.1, radius = 0.09 }} }}
"""
REGION = "observer.region = { decay = 0.15, disc = { center = -0.5, radius = 0.45 }, sector = 45 }\n"
CHANNEL = f"observer.noise = {NOISE}\nobserver.weights = {{ f_u1 = {WEIGHTS[0]} }}\n"


def norm(gain, noise=NOISE, weights=ERRORS):
    """The largest singular value from rates and noise to the weighted errors."""
    entering, closed = np.hstack([RATES, -gain * noise]), A_0 - gain @ C_0
    sweep = 1j * np.concatenate([[0], np.logspace(-4, 5, 3000)])
    stacked = np.linalg.solve(sweep[:, None, None] * np.eye(6) - closed, entering.astype(complex))
    return np.linalg.norm(weights @ stacked, 2, axis=(1, 2)).max()


def least_norm():
    """Bisection over the Hamiltonian matrix of the filter's Riccati equation."""
    low, high = 1e-3, 1e3
    while high > low * 1.0001:
        gamma = np.sqrt(low * high)
        quadratic = ERRORS.T @ ERRORS / gamma**2 - C_0.T @ C_0 / NOISE**2
        triangle, basis, stable = schur(np.block([[A_0.T, quadratic], [-RATES @ RATES.T, -A_0]]), sort="lhp")
        solution = basis[6:, :6] @ np.linalg.pinv(basis[:6, :6])
        exists = stable == 6 and np.linalg.eigvalsh(solution + solution.T).min() > -1e-9
        low, high = (low, gamma) if exists else (gamma, high)
    return high


def after(method, text):
    """The number after a text."""
    return float(re.match(r"[-+.\de]*\d", method.split(text)[1])[0])


@pytest.fixture
def designed(aso_ftc, tmp_path):
    """Designs for the observer's requirement; returns the gain L and the report's sentence."""

    def design(observer):
        plant = tmp_path / "plant.toml"
        plant.write_text(PLANT + observer)
        done = aso_ftc("design", plant, "--out", tmp_path / "design.toml", "--json", "--force", *WITHOUT_PROOFS)
        assert done.returncode in (0, 1), done.stderr
        report = json.loads(done.stdout)
        matrices = Matrices(tomllib.loads((tmp_path / "design.toml").read_text()))
        return np.vstack([matrices.L_x, -matrices.L_f]), report["observer"]["method"]

    return design


def test_the_least_norm_with_noise_is_near_that_of_the_riccati_equation_with_a_moderate_gain(designed):
    gain, method = designed('observer.h_infinity = "least"\n' + CHANNEL)
    least = least_norm()
    assert least < norm(gain) < 1.2 * least
    assert np.linalg.norm(gain) < 1000
    assert after(method, "Norm ") == pytest.approx(norm(gain), rel=1e-3)
    assert 0.998 * least < after(method, "has a norm below ") < 1.0002 * least


def test_a_bound_of_the_norm_with_noise_and_weights_is_kept(designed):
    gain, _ = designed("observer.h_infinity = 1.2\n" + CHANNEL)
    assert norm(gain) < 1.2


def test_the_least_norm_in_a_region_is_not_above_that_of_the_region_alone(designed):
    plain, _ = designed(REGION)
    least, method = designed('observer.h_infinity = "least"\n' + REGION)
    alone = norm(plain, 0.0, RATES.T)
    assert norm(least, 0.0, RATES.T) <= alone * 1.001
    assert after(method, "region alone ") == pytest.approx(alone, rel=1e-3)
    assert after(method, "Norm ") == pytest.approx(norm(least, 0.0, RATES.T), rel=1e-3)


def test_a_larger_weight_lowers_the_error_of_its_fault(designed):
    errors = []
    for weight in (1.0, 10.0):
        gain, _ = designed(
            f'observer.h_infinity = "least"\nobserver.noise = {NOISE}\nobserver.weights = {{ f_u2 = {weight} }}\n'
        )
        errors.append(norm(gain, NOISE, RATES.T[1:]))
    assert errors[1] < errors[0]


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ("observer.h_infinity = 2\nobserver.noise = [1, 2, 3]\n", "expected 2 numbers, one per measurement, found 3"),
        ("observer.h_infinity = 2\nobserver.weights = { f = 2 }\n", "expected one of f_u1, f_u2"),
        (REGION + "observer.noise = 1\n", "it belongs to `h_infinity`"),
    ],
)
def test_a_bad_channel_is_refused_at_its_line(refusal, entries, message):
    error = refusal(PLANT + entries)
    line = (PLANT + entries).count("\n")
    assert f"plant.toml:{line}:" in error and message in error, error
