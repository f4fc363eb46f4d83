"""Plants that are only stabilisable or detectable, compared with scipy's Riccati solvers and eigenvalues."""

import json
import tomllib

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov, solve_discrete_are

from design_oracle import WITHOUT_PROOFS, Matrices
from matrices import zoh
from test_design_wanted import feedback_gain, observer_gain

PERIOD = 0.1


def reported(aso_ftc, folder, text):
    """The report of a plant file."""
    file = folder / "plant.toml"
    file.write_text(text, encoding="utf-8")
    done = aso_ftc("design", file, "--out", folder / "design.toml", "--json", *WITHOUT_PROOFS)
    assert done.returncode in (0, 1), done.stderr
    report = json.loads(done.stdout)
    assert all(check["holds"] for check in report["checks"]), report["checks"]
    return report


def gain(report, name):
    """A gain of the report."""
    return np.array(next(matrix["values"] for matrix in report["gains"] if matrix["name"] == name))


def matrices(**named):
    """Matrices as lines of a plant file."""
    return "".join(f"{name} = {np.asarray(value).tolist()}\n" for name, value in named.items())


def turned(rng, a, b, c):
    """The same system in other, full coordinates."""
    t = np.eye(len(a)) + 0.3 * rng.standard_normal(a.shape)
    inverse = np.linalg.inv(t)
    return t @ a @ inverse, t @ b, c @ inverse


def stabilisable(rng):
    """Three controllable states, unstable, and a stable mode and a stable pair that no command reaches."""
    a = np.zeros((6, 6))
    a[:3, :3] = rng.standard_normal((3, 3)) + 0.5 * np.eye(3)
    a[:3, 3:] = rng.standard_normal((3, 3))
    a[3, 3] = -0.7
    a[4:, 4:] = [[-1.2, 2.0], [-2.0, -1.2]]
    b = np.vstack([rng.standard_normal((3, 1)), np.zeros((3, 1))])
    return turned(rng, a, b, rng.standard_normal((2, 6)))


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_regulators_of_stabilisable_plants_are_those_of_scipy(aso_ftc, tmp_path, seed, sampled):
    a, b, c = stabilisable(np.random.default_rng(seed))
    text = matrices(A=a, B=b, C=c) + 'actuator_faults = "all"\nrobustness.cases = 10\n'
    text += "feedback.Q = [1, 2, 1, 1, 3, 1]\nfeedback.R = [0.5]\nobserver.region = { decay = 1 }\n"
    q, r = np.diag([1.0, 2, 1, 1, 3, 1]), np.array([[0.5]])
    if sampled:
        phi, gamma = zoh(a, b, PERIOD)
        p = solve_discrete_are(phi, gamma, q, r)
        expected = -np.linalg.solve(r + gamma.T @ p @ gamma, gamma.T @ p @ phi)
        text += f"sample_time = {PERIOD}\n"
    else:
        expected = -np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q, r))
    report = reported(aso_ftc, tmp_path, text)
    assert gain(report, "K_x") == pytest.approx(expected, rel=1e-7, abs=1e-7 * np.abs(expected).max())
    assert "(A, B) is stabilisable" in [check["condition"] for check in report["checks"]]
    values = " ".join(report["warnings"])
    assert "eigenvalue -0.7 1/s" in values and "eigenvalues -1.2 ± 2i 1/s" in values


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_kalman_filters_of_detectable_plants_are_those_of_scipy(aso_ftc, tmp_path, seed, sampled):
    rng = np.random.default_rng(seed)
    a, c, b = (matrix.T for matrix in stabilisable(rng))
    b = b[:, :1]
    text = matrices(A=a, B=b, C=c) + 'actuator_faults = "all"\nrobustness.cases = 10\n'
    text += "feedback.region = { decay = 0.1 }\nobserver.W = [1, 1, 1, 2, 1, 1, 5]\nobserver.V = [0.1]\n"
    w, v = np.diag([1.0, 1, 1, 2, 1, 1, 5]), np.array([[0.1]])
    c_0 = np.hstack([c, np.zeros((1, 1))])
    if sampled:
        phi, gamma = zoh(a, b, PERIOD)
        a_0 = np.block([[phi, -gamma], [np.zeros((1, 6)), np.eye(1)]])
        p = solve_discrete_are(a_0.T, c_0.T, w, v)
        expected = p @ c_0.T @ np.linalg.inv(v + c_0 @ p @ c_0.T)
        text += f"sample_time = {PERIOD}\n"
    else:
        a_0 = np.block([[a, -b], [np.zeros((1, 7))]])
        expected = solve_continuous_are(a_0.T, c_0.T, w, v) @ c_0.T @ np.linalg.inv(v)
    report = reported(aso_ftc, tmp_path, text)
    gains = np.vstack([gain(report, "L_x"), -gain(report, "L_f")])
    assert gains == pytest.approx(expected, rel=1e-7, abs=1e-7 * np.abs(expected).max())
    assert "(A, C) is detectable" in [check["condition"] for check in report["checks"]]


FIXED = [-0.7, -1.2 + 2j, -1.2 - 2j]
REQUESTED = "-0.7, { re = -1.2, im = 2.0 }"


@pytest.mark.parametrize("sampled", [False, True])
def test_only_the_movable_eigenvalues_are_assigned(aso_ftc, tmp_path, sampled):
    rng = np.random.default_rng(7)
    a, b, c = stabilisable(rng)
    text = matrices(A=a, B=b, C=c) + 'actuator_faults = "all"\nrobustness.cases = 10\n'
    text += f"feedback.eigenvalues = [-3, {REQUESTED}, -4, -5]\nobserver.region = {{ decay = 1 }}\n"
    expected = np.array([-5, -4, -3, *FIXED])
    if sampled:
        text += f"sample_time = {PERIOD}\n"
        a, b = zoh(a, b, PERIOD)
        expected = np.exp(expected * PERIOD)
    eigenvalues = np.linalg.eigvals(a + b @ gain(reported(aso_ftc, tmp_path, text), "K_x"))
    for value in expected:
        assert np.abs(eigenvalues - value).min() < 1e-7


@pytest.mark.parametrize("sampled", [False, True])
def test_an_observer_assigns_what_the_measurements_show(aso_ftc, tmp_path, sampled):
    rng = np.random.default_rng(3)
    a, c, b = (matrix.T for matrix in stabilisable(rng))
    b = b[:, :1]
    text = matrices(A=a, B=b, C=c) + 'actuator_faults = "all"\nrobustness.cases = 10\n'
    text += f"feedback.region = {{ decay = 0.1 }}\nobserver.eigenvalues = [{REQUESTED}, -6, -7, -8, -9]\n"
    expected = np.array([-6, -7, -8, -9, *FIXED])
    if sampled:
        text += f'sample_time = {PERIOD}\nestimator = "prediction"\n'
        a, b = zoh(a, b, PERIOD)
        expected = np.exp(expected * PERIOD)
    report = reported(aso_ftc, tmp_path, text)
    a_0 = np.block([[a, -b], [np.zeros((1, 6)), np.eye(1) if sampled else np.zeros((1, 1))]])
    l = np.vstack([gain(report, "L_x"), -gain(report, "L_f")])
    closed = a_0 - l @ np.hstack([c, np.zeros((1, 1))])
    eigenvalues, vectors = np.linalg.eig(closed)
    # What rounding the entries of the loop does to its worst conditioned eigenvalue (Bauer and Fike 1960).
    rounding = np.finfo(float).eps * np.linalg.norm(closed) * np.linalg.cond(vectors)
    assert rounding < 1e-4
    for value in expected:
        assert np.abs(eigenvalues - value).min() < rounding


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("norm", ["", "h_infinity = 40"])
def test_regions_and_norms_are_met_where_the_fixed_modes_are_inside(aso_ftc, tmp_path, sampled, norm):
    """Two states of their own, and one that is neither reached nor shown."""
    a = np.array([[0.0, 1, 0], [2, -1, 0], [0, 0, -4]])
    b, c = np.array([[0.0], [1], [0]]), np.array([[1.0, 0, 0]])
    text = matrices(A=a, B=b, C=c) + 'actuator_faults = "all"\nrobustness.cases = 10\n'
    for table, decay in (("feedback", 2), ("observer", 3)):
        region = f"decay = {decay}" if sampled else f"decay = {decay}, disc = {{ center = -10, radius = 8 }}"
        text += f"{table}.region = {{ {region} }}\n"
        text += f"{table}.{norm}\n" if norm else ""
    text += f"sample_time = {PERIOD}\n" if sampled else ""
    report = reported(aso_ftc, tmp_path, text)
    for table, decay in (("feedback", 2), ("observer", 3)):
        eigenvalues = np.array([complex(*pair) for pair in report[table]["eigenvalues"]])
        eigenvalues = np.log(eigenvalues) / PERIOD if sampled else eigenvalues
        assert (eigenvalues.real < -decay).all() and np.abs(eigenvalues + 4).min() < 1e-9
        assert sampled or (np.abs(eigenvalues + 10) < 8).all()
    assert sum("keeps its eigenvalue" in warning for warning in report["warnings"]) == 2
    if norm and not sampled:
        design = Matrices(tomllib.loads((tmp_path / "design.toml").read_text(encoding="utf-8")))
        assert feedback_gain(design) <= 40 and observer_gain(design) <= 40


PLANT = """A = [[1, 0], [0, -2]]
B = [[1], [0]]
C = [[1, 1]]
actuator_faults = "all"
feedback.Q = [1, 1]
feedback.R = [1]
observer.W = [1, 1, 1]
observer.V = [1]
"""
REFUSED = [
    (
        "feedback.Q = [1, 1]\nfeedback.R = [1]",
        "feedback.eigenvalues = [-3, -4]",
        "5:24: no gain moves the eigenvalue -2 1/s, which x2 dominates; expected it among the requested",
    ),
    (
        "feedback.Q = [1, 1]\nfeedback.R = [1]",
        "feedback.region = { decay = 3 }",
        "5:19: no gain moves the eigenvalue -2 1/s, which x2 dominates, into the region",
    ),
    (
        "feedback.Q = [1, 1]\nfeedback.R = [1]",
        "feedback.eigenvalues = [-3, -4]\nsample_time = 0.1",
        "5:24: no gain moves the eigenvalue -2 1/s, which x2 dominates",
    ),
    (
        "feedback.Q = [1, 1]\nfeedback.R = [1]",
        "feedback.sampled_eigenvalues = [0.5, 0.6]\nsample_time = 0.1",
        "5:32: no gain moves the eigenvalue 0.818731 of the sampled loop, which x2 dominates",
    ),
    (
        "[0, -2]]",
        "[0, 0.5]]",
        "2:5: the commands u1 reach 1 of 2 states only: no feedback moves the eigenvalue 0.5 1/s, which x2 dominates",
    ),
    (
        "C = [[1, 1]]",
        "C = [[0, 1]]",
        "3:5: the measurements y1 show 1 of 2 states only: no observer moves the eigenvalue 1 1/s, which x1 dominates",
    ),
    (
        "observer.W = [1, 1, 1]",
        "observer.W = [1, 1, 0]",
        "7:14: W states no noise for `f_u1` (its row 3 is zero)",
    ),
]


@pytest.mark.parametrize(("old", "new", "expected"), REFUSED, ids=lambda text: text[-30:])
def test_a_mode_that_no_gain_moves_is_named_with_its_eigenvalue_and_states(refusal, old, new, expected):
    assert old in PLANT
    message = refusal(PLANT.replace(old, new))
    assert f"plant.toml:{expected}" in message, message


def test_a_stable_mode_that_no_gain_moves_is_a_warning(aso_ftc, tmp_path):
    (tmp_path / "plant.toml").write_text(PLANT, encoding="utf-8")
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml")
    assert done.returncode in (0, 1), done.stderr
    assert (
        "warning: plant.toml:2:5: the commands u1 reach 1 of 2 states only: no feedback moves" in done.stdout
    )
    assert "the eigenvalue -2 1/s, which x2 dominates; it is stable" in done.stdout


def test_a_mode_that_no_gain_moves_may_be_without_weight_and_without_noise(aso_ftc, tmp_path):
    text = PLANT.replace("Q = [1, 1]", "Q = [1, 0]").replace("W = [1, 1, 1]", "W = [1, 0, 1]")
    report = reported(aso_ftc, tmp_path, text)
    assert gain(report, "K_x") == pytest.approx(np.array([[-1 - 2**0.5, 0]]), abs=1e-12)


def test_noise_does_not_reach_a_mode_that_no_gain_moves(aso_ftc, tmp_path):
    """The root-mean-square value of the command, by scipy's Lyapunov equation without the second state."""
    report = reported(aso_ftc, tmp_path, PLANT)
    k, l_x, l_f, k_f = (gain(report, name) for name in ("K_x", "L_x", "L_f", "K_f"))
    c = np.array([[1.0, 1.0]])
    # [x_1; x_hat; f_hat], driven by the noise of the measurement.
    a = np.zeros((4, 4))
    a[0] = [1, *k[0], k_f[0, 0]]
    a[1:3, :] = np.hstack(
        [l_x, np.diag([1.0, -2]) - l_x @ c + np.array([[1.0], [0]]) @ k, np.array([[1 + k_f[0, 0]], [0]])]
    )
    a[3, :] = np.hstack([l_f, -l_f @ c, [[0.0]]])
    b = np.vstack([[[0.0]], l_x, l_f])
    covariance = solve_continuous_lyapunov(a, -b @ b.T)
    row = np.array([0, *k[0], k_f[0, 0]])
    expected = np.sqrt(row @ covariance @ row)
    rms = next(entry["value"] for entry in report["robustness"]["noise_together"] if entry["name"] == "u1")
    assert rms == pytest.approx(expected, rel=1e-9)
