"""Requirements of a plant file: weights, regions, norms; each checked by numpy and scipy."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are, solve_discrete_are

from design_loop import Designed, changed, packed_plant
from design_oracle import Matrices

PENDULUM, TANKS = "fmu-controller/pendulum.toml", "examples/three-tank/plant.toml"
FEEDBACK = {
    PENDULUM: "feedback.eigenvalues = [-4.5, -6.0, -7.5, -9.0]",
    TANKS: "feedback.eigenvalues = [-0.03, -0.035, -0.04]",
}
OBSERVER = {
    PENDULUM: "observer.eigenvalues = [-1200.0, -1500.0, -1800.0, -2100.0, -3000.0]",
    TANKS: "observer.eigenvalues = [-0.2, -0.22, -0.25, -0.28, -0.3]",
}


@pytest.fixture
def wanting(aso_ftc, tmp_path):
    """Makes designs for a plant file with other requirements."""
    packed_plant(aso_ftc, "ThreeTank")

    def design(file, *changes):
        return Designed(aso_ftc, changed(file, tmp_path, *changes), tmp_path)

    return design


REGULATORS = [
    (PENDULUM, [10.0, 20.0, 1.0, 2.0], [0.01]),
    (TANKS, [1.0, 2.0, 0.5], [1e7, 2e7]),
]


@pytest.mark.parametrize(("file", "states", "commands"), REGULATORS, ids=["pendulum", "tanks"])
def test_weights_give_the_linear_quadratic_regulator_of_scipy(wanting, file, states, commands):
    wish = f"feedback.Q = {states}\nfeedback.R = {commands}"
    designed = wanting(file, (FEEDBACK[file], wish))
    matrices, q, r = Matrices(designed.design), np.diag(states), np.diag(commands)
    if matrices.period is None:
        p = solve_continuous_are(matrices.A, matrices.B, q, r)
        expected = -np.linalg.solve(r, matrices.B.T @ p)
    else:
        p = solve_discrete_are(matrices.A, matrices.B, q, r)
        expected = -np.linalg.solve(r + matrices.B.T @ p @ matrices.B, matrices.B.T @ p @ matrices.A)
    assert matrices.K_x == pytest.approx(expected, rel=1e-7)
    assert designed.report["feedback"]["method"].startswith("Linear-quadratic regulator")
    assert designed.report["feedback"]["required"] == []


FILTERS = [
    (PENDULUM, "", [1e-4, 1e-4, 1.0, 4.0, 1e4], [1e-6, 2e-6]),
    (TANKS, "current", [1e-6, 2e-6, 1e-6, 1e-12, 2e-12], [1e-6, 1e-6, 3e-6]),
    (TANKS, "prediction", [1e-6, 2e-6, 1e-6, 1e-12, 2e-12], [1e-6, 1e-6, 3e-6]),
]


@pytest.mark.parametrize(
    ("file", "estimator", "process", "measured"), FILTERS, ids=["pendulum", "current", "prediction"]
)
def test_intensities_give_the_kalman_filter_of_scipy(wanting, file, estimator, process, measured):
    wish = f"observer.W = {process}\nobserver.V = {measured}"
    if estimator:
        wish = f'estimator = "{estimator}"\n{wish}'
    designed = wanting(file, (OBSERVER[file], wish))
    matrices, w, v = Matrices(designed.design), np.diag(process), np.diag(measured)
    a_0, c_0, gain = matrices.augmented
    if matrices.period is None:
        p = solve_continuous_are(a_0.T, c_0.T, w, v)
        expected = p @ c_0.T @ np.linalg.inv(v)
    else:
        p = solve_discrete_are(a_0.T, c_0.T, w, v)
        expected = p @ c_0.T @ np.linalg.inv(c_0 @ p @ c_0.T + v)
        expected = expected if matrices.current else a_0 @ expected
    assert gain == pytest.approx(expected, rel=1e-6, abs=1e-9 * abs(expected).max())
    assert designed.report["observer"]["method"].startswith("Kalman filter")


def test_the_eigenvalues_satisfy_all_parts_of_a_region(wanting):
    region = "{ decay = 3.0, disc = { center = -12.0, radius = 8.0 }, sector = 30.0 }"
    observer = "{ decay = 100.0, disc = { center = -800.0, radius = 600.0 }, sector = 30.0 }"
    designed = wanting(
        PENDULUM,
        (FEEDBACK[PENDULUM], f"feedback.region = {region}"),
        (OBSERVER[PENDULUM], f"observer.region = {observer}"),
    )
    matrices = Matrices(designed.design)
    for name, dynamics, decay, center, radius in (
        ("feedback", matrices.A + matrices.B @ matrices.K_x, 3.0, -12.0, 8.0),
        ("observer", matrices.error_dynamics, 100.0, -800.0, 600.0),
    ):
        values = np.linalg.eigvals(dynamics)
        assert (values.real < -decay).all()
        assert (abs(values - center) < radius).all()
        assert (abs(values.imag) < np.tan(np.radians(30.0)) * -values.real).all()
        stated = {"decay": decay, "disc_center": center, "disc_radius": radius, "sector": 30.0}
        assert designed.report[name]["region"] == stated


def test_a_sampled_loop_has_the_required_decay_rate(wanting):
    designed = wanting(
        TANKS,
        (FEEDBACK[TANKS], "feedback.region = { decay = 0.03 }"),
        (OBSERVER[TANKS], "observer.region = { decay = 0.2 }"),
    )
    matrices = Matrices(designed.design)
    for dynamics, decay in ((matrices.A + matrices.B @ matrices.K_x, 0.03), (matrices.error_dynamics, 0.2)):
        assert abs(np.linalg.eigvals(dynamics)).max() < np.exp(-decay * matrices.period)


def largest_gain(a, b, c, d, highest):
    """The H-infinity norm on a fine grid of frequencies."""
    gain = lambda w: np.linalg.norm(c @ np.linalg.solve(1j * w * np.eye(len(a)) - a, b) + d, 2)
    return max(map(gain, np.concatenate([[0], np.geomspace(1e-3, highest, 2000)])))


def observer_gain(matrices):
    """From the rate of the fault to the error of its estimate."""
    rate = np.eye(matrices.n + matrices.q)[:, matrices.n :]
    return largest_gain(matrices.error_dynamics, rate, rate.T, 0, 1e6)


def feedback_gain(matrices):
    """From the fault to measurements and command."""
    a, m = matrices.A + matrices.B @ matrices.K_x, matrices.B.shape[1]
    return largest_gain(a, matrices.F_a, np.vstack([matrices.C, matrices.K_x]), np.zeros((len(matrices.C) + m, 1)), 1e4)


def test_an_h_infinity_bound_is_met(wanting):
    designed = wanting(
        PENDULUM,
        (FEEDBACK[PENDULUM], "feedback.h_infinity = 2.0\nfeedback.region = { decay = 1.0 }"),
        (OBSERVER[PENDULUM], "observer.h_infinity = 0.01\nobserver.region = { decay = 50.0 }"),
    )
    matrices = Matrices(designed.design)
    assert feedback_gain(matrices) <= 2.0
    assert np.linalg.eigvals(matrices.A + matrices.B @ matrices.K_x).real.max() < -1.0
    assert observer_gain(matrices) <= 0.01
    assert np.linalg.eigvals(matrices.error_dynamics).real.max() < -50.0
    norms = {norm["name"]: norm["value"] for norm in designed.report["certificate"]["norms"]}
    assert norms["H-infinity"] == pytest.approx(observer_gain(matrices), rel=1e-2)


def test_the_least_h_infinity_norm_is_below_that_of_assigned_eigenvalues(wanting):
    assigned = observer_gain(Matrices(wanting(PENDULUM).design))
    disc = "{ disc = { center = -2100.0, radius = 900.0 } }"
    wish = f'observer.h_infinity = "least"\nobserver.region = {disc}'
    matrices = Matrices(wanting(PENDULUM, (OBSERVER[PENDULUM], wish)).design)
    assert observer_gain(matrices) < assigned
    assert (abs(np.linalg.eigvals(matrices.error_dynamics) + 2100) < 900).all()
