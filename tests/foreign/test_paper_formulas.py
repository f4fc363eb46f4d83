"""The repairs of the paper's formulas that docs/explanation/aso.md lists, each beside the printed formula."""

import numpy as np
import pytest

# The printed matrices, in the order x_p, theta, x_p', theta'.
A = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [0, -1.9333, -1.9872, 0.0091], [0, 36.9771, 6.2589, -0.1738]])
B = np.array([0, 0, 0.3205, -1.0095])
M, m, J, L, F_X, F_THETA, G = 3.2, 0.535, 0.062, 0.365, 6.2, 0.009, 9.807


def accelerations(x, u, arm):
    """x_p'' and theta'' of (20); `arm` is the factor of theta'' cos theta in its first line, m l or, as printed, m."""
    _, angle, speed, rate = x
    mass = np.array([[M + m, arm * np.cos(angle)], [m * L * np.cos(angle), J]])
    force = [u - F_X * speed + arm * rate**2 * np.sin(angle), m * G * L * np.sin(angle) - F_THETA * rate]
    return np.linalg.solve(mass, force)


def linearised(arm):
    """The last two rows of A and B by central differences."""

    def column(at):
        step = 1e-6 * np.eye(5)[at]
        high, low = (accelerations(sign * step[:4], sign * step[4], arm) for sign in (1, -1))
        return (high - low) / 2e-6

    return np.stack([column(at) for at in range(5)], axis=1)


def test_equation_20_with_the_length_gives_the_printed_matrices():
    printed = np.column_stack([A[2:], B[2:]])
    assert linearised(m * L) == pytest.approx(printed, abs=6e-5)
    assert np.abs(linearised(m) - printed).max() > 1, "as printed, without l"


def test_the_printed_matrices_are_not_in_the_printed_order_of_the_states():
    order = [0, 2, 1, 3]  # the printed x = [x_p, x_p', theta, theta']
    rows = linearised(m * L)[:, :4]
    as_stated = np.zeros((4, 4))
    as_stated[[0, 2], [1, 3]] = 1
    as_stated[1], as_stated[3] = rows[0][order], rows[1][order]
    assert np.abs(as_stated - A).max() > 1
    assert as_stated[np.ix_(order, order)] == pytest.approx(A, abs=6e-5)


def test_the_errors_obey_8_and_the_sum_of_4_and_5_with_plus_but_not_9_and_6_as_printed():
    rng = np.random.default_rng(2009)
    n, q, p = 4, 1, 2
    a, b, c = rng.normal(size=(n, n)), rng.normal(size=(n, q)), rng.normal(size=(p, n))
    k_x, l_x, l_f = rng.normal(size=(q, n)), rng.normal(size=(n, p)), rng.normal(size=(q, p))
    x, estimate, f_hat, f = (rng.normal(size=size) for size in (n, n, q, q))
    f_a, k_f = -b, np.eye(q)  # (19): friction acts against the command; B K_f = -F_a
    residual = c @ (x - estimate)
    plant = a @ x + b @ (k_x @ estimate + k_f @ f_hat) + f_a @ f  # (1), (2)
    observer = (a + b @ k_x) @ estimate + l_x @ residual  # (4)
    integral = l_f @ residual  # (5) with the dot
    error = x - estimate
    of_error = (a - l_x @ c) @ error + b @ k_f @ f_hat
    assert plant - observer == pytest.approx(of_error + f_a @ f), "(8)"
    assert np.abs(plant - observer - (of_error - f_a @ f)).max() > 0.1, "(9) as printed"
    assert b @ k_f == pytest.approx(-f_a), "A_0 has -F_a"
    both, gain = np.concatenate([observer, integral]), np.vstack([l_x, l_f])
    dynamics = np.zeros((n + q, n + q))
    dynamics[:n, :n] = a + b @ k_x
    states = np.concatenate([estimate, f_hat])
    assert both == pytest.approx(dynamics @ states + gain @ residual), "(6)"
    assert np.abs(both - (dynamics @ states - gain @ residual)).max() > 0.1, "(6) as printed"


def test_the_exponent_of_21_as_printed_is_another_friction():
    speed, at, power = 0.05, 0.15, 2
    repaired, printed = np.exp(-((speed / at) ** power)), np.exp(-speed / at) ** power
    assert 25 + 5 * repaired == pytest.approx(29.474, abs=1e-3)
    assert 25 + 5 * printed == pytest.approx(27.567, abs=1e-3)
