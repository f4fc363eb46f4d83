"""H-infinity designs with weights over frequency, beside frequency sweeps and Riccati equations in numpy and scipy.

The plant is the quadruple tank of test_norm_designs.py. The sweeps multiply the closed loop by the documented formula of each
weight at each frequency; they know nothing of states of weights."""

import numpy as np
import pytest
from scipy.linalg import eig

from design_oracle import design_and_report
from test_norm_designs import A_0, C_0, NOISE, PLANT, RATES, A, B, C

SWEEP = np.logspace(-5, 5, 3000)
# The noise is coloured, and the error of the first fault matters at low frequencies.
COLOURED = (0.002, 1.0, 0.1, 1)
LOW = (4.0, 0.5, 0.4, 2)


def toml(low, frequency, high, order):
    return f"{{ low = {low}, frequency = {frequency}, high = {high}, order = {order} }}"


OBSERVER = f"""observer.h_infinity = "least"
observer.noise = {toml(*COLOURED)}
observer.weights = {{ f_u1 = {toml(*LOW)} }}
"""


def formula(weight, frequencies, period=None):
    """The documented weight; in a sampled design frequencies are mapped by (2 / T) tan(w T / 2)."""
    low, frequency, high, order = weight
    bilinear = (lambda w: w) if period is None else (lambda w: 2 / period * np.tan(w * period / 2))
    s, frequency = 1j * bilinear(frequencies), bilinear(frequency)
    low, high = low ** (1 / order), high ** (1 / order)
    return ((high * s + frequency * np.sqrt(low * high)) / (s + frequency * np.sqrt(high / low))) ** order


def response(points, dynamics, entering, output, direct=0.0):
    eye = np.eye(len(dynamics))
    return output @ np.linalg.solve(points[:, None, None] * eye - dynamics, entering.astype(complex)) + direct


def peak(transfer):
    return np.linalg.norm(transfer, 2, axis=(1, 2)).max()


def observer_norm(gain, weight_of_noise, weight_of_error):
    """From rates and noise to the errors, continuous."""
    transfer = response(1j * SWEEP, A_0 - gain @ C_0, np.hstack([RATES, -gain]), RATES.T)
    transfer[:, :, 2:] *= weight_of_noise[:, None, None]
    transfer[:, 0] *= weight_of_error[:, None]
    return peak(transfer)


def least_filter(a, b, c, d, e):
    """The least norm of a filter of x' = a x + b w, y = c x + d w for e x: bisection over its Riccati equation."""
    inverse = d.T @ np.linalg.inv(d @ d.T)
    dynamics, process = a - b @ inverse @ c, b @ (np.eye(b.shape[1]) - inverse @ d) @ b.T
    n, (low, high) = len(a), (1e-4, 1e4)
    while high > low * 1.0002:
        gamma = np.sqrt(low * high)
        quadratic = e.T @ e / gamma**2 - c.T @ np.linalg.inv(d @ d.T) @ c
        values, vectors = eig(np.block([[dynamics.T, quadratic], [-process, -dynamics]]))
        stable = vectors[:, values.real < -1e-9]
        exists = stable.shape[1] == n
        if exists:
            solution = (stable[n:] @ np.linalg.inv(stable[:n])).real
            exists = np.linalg.eigvalsh(solution + solution.T).min() > -1e-8 * np.abs(solution).max()
        low, high = (low, gamma) if exists else (gamma, high)
    return high


@pytest.fixture
def designed(aso_ftc, tmp_path):
    """Designs a plant file; returns the matrices of the design file and the report."""

    def design(text):
        matrices, report = design_and_report(aso_ftc, tmp_path, text)
        assert matrices is not None, report
        return matrices, report

    return design


def observer_gain(design):
    return np.vstack([design.L_x, -design.L_f])


def test_the_norm_of_an_observer_with_weights_is_that_of_a_frequency_sweep(designed):
    design, report = designed(PLANT + OBSERVER)
    norm = report["observer"]["norm"]
    expected = observer_norm(observer_gain(design), formula(COLOURED, SWEEP), formula(LOW, SWEEP))
    assert norm["norm"] == pytest.approx(expected, rel=1e-3)
    assert norm["unweighted"] == pytest.approx(peak(response(1j * SWEEP, *unweighted(observer_gain(design)))), rel=2e-3)
    assert norm["gain"] < 1000
    assert norm["certified"] is None or norm["norm"] < 1.001 * norm["certified"] < 1.02 * norm["norm"]


def unweighted(gain):
    return A_0 - gain @ C_0, RATES, RATES.T


def test_the_lower_bound_is_the_least_norm_of_the_filter_that_knows_the_weights(designed):
    _, report = designed(PLANT + OBSERVER)
    norm = report["observer"]["norm"]
    low, frequency, high, _ = COLOURED
    pole, zero = frequency * np.sqrt(high / low), frequency * np.sqrt(low / high)
    error_pole = LOW[1] * (LOW[2] / LOW[0]) ** 0.25
    error_high, error_low = np.sqrt(LOW[2]), np.sqrt(LOW[0])
    step = (error_low - error_high) * error_pole
    # States: plant and faults; the colour of the noise of each measurement; the weight of the first error, twice first order.
    a = np.zeros((10, 10))
    a[:6, :6] = A_0
    a[6:8, 6:8] = -pole * np.eye(2)
    a[8, 8] = a[9, 9] = -error_pole
    a[8, 4], a[9, 8], a[9, 4] = 1.0, step, error_high
    b = np.zeros((10, 4))
    b[4:6, :2], b[6:8, 2:] = np.eye(2), np.eye(2)
    c = np.zeros((2, 10))
    c[:, :6], c[:, 6:8] = C_0, high * (zero - pole) * np.eye(2)
    d = np.hstack([np.zeros((2, 2)), high * np.eye(2)])
    e = np.zeros((2, 10))
    e[0, 9], e[0, 8], e[0, 4] = step, error_high * step, error_high**2
    e[1, 5] = 1.0
    least = least_filter(a, b, c, d, e)
    assert norm["lower_bound"] == pytest.approx(least, rel=2e-3)
    assert norm["lower_bound"] < norm["norm"] < 1.5 * least
    assert norm["gap"] == pytest.approx(norm["norm"] / norm["lower_bound"] - 1, abs=1e-9)


def test_a_bound_below_the_lower_bound_is_refused_with_the_lower_bound(refusal):
    message = refusal(PLANT + f"observer.h_infinity = 0.5\nobserver.noise = {NOISE}\n")
    assert "plant.toml:6:" in message
    assert "no gain keeps this bound, nor does a filter of any order: expected a bound above" in message


def test_the_norm_of_a_sampled_observer_with_weights_is_that_of_a_frequency_sweep(designed):
    period = 0.5
    feedback = "feedback.region = { decay = 0.03 }\n"
    text = PLANT[: PLANT.index("feedback.region")] + feedback + f"sample_time = {period}\n" + OBSERVER
    design, report = designed(text)
    a_0, c_0, gain = design.augmented
    rates = np.vstack([np.zeros((4, 2)), period * np.eye(2)])
    frequencies = np.append(np.logspace(-5, np.log10(0.9999 * np.pi / period), 3000), 1e-7)
    output = c_0 @ a_0
    entering = np.hstack([rates - gain @ c_0 @ rates, -gain])
    transfer = response(np.exp(1j * frequencies * period), a_0 - gain @ output, entering, RATES.T)
    transfer[:, :, 2:] *= formula(COLOURED, frequencies, period)[:, None, None]
    transfer[:, 0] *= formula(LOW, frequencies, period)[:, None]
    norm = report["observer"]["norm"]
    assert norm["norm"] == pytest.approx(peak(transfer), rel=1e-3)
    assert 0.4 * norm["norm"] < norm["lower_bound"] < norm["norm"]
    z = np.exp(1j * frequencies[::100] * period)
    assert {weight["signal"] for weight in norm["weights"]} == {"f_u1", "noise of y1", "noise of y2"}
    for weight in norm["weights"]:
        stated = np.polyval(weight["numerator"], z) / np.polyval(weight["denominator"], z)
        expected = formula(LOW if weight["signal"] == "f_u1" else COLOURED, frequencies[::100], period)
        assert np.abs(stated / expected - 1).max() < 1e-5


def test_a_weight_of_a_command_that_rises_with_frequency_slows_the_feedback_down(designed):
    rising = (1.0, 0.3, 30.0, 1)
    text = PLANT[: PLANT.index("feedback.region")] + 'feedback.h_infinity = "least"\n' + "observer.eigenvalues = "
    text += "[-0.2, -0.22, -0.24, -0.26, -0.28, -0.3]\nfeedback.region = { disc = { center = -3, radius = 2.999 } }\n"
    norms, gains = [], []
    for command in ("1.0", toml(*rising)):
        design, report = designed(text + f"feedback.weights = {{ y1 = 20.0, u1 = {command} }}\n")
        k = design.K_x
        transfer = response(1j * SWEEP, A + B @ k, B, np.vstack([np.diag([20.0, 1.0]) @ C, k]))
        if command != "1.0":
            transfer[:, 2] *= formula(rising, SWEEP)[:, None]
        norm = report["feedback"]["norm"]
        assert norm["norm"] == pytest.approx(peak(transfer), rel=1e-3)
        assert norm["lower_bound"] <= norm["norm"]
        norms.append(norm)
        gains.append(k)
    assert np.linalg.norm(gains[1][0]) < np.linalg.norm(gains[0][0])


def test_the_norm_of_a_state_feedback_is_close_to_its_lower_bound(designed):
    """Without weights over frequency the inequalities of the state feedback are exact; the gain is designed 5 % above."""
    text = PLANT[: PLANT.index("feedback.region")] + 'feedback.h_infinity = "least"\nobserver.h_infinity = 3.0\n'
    text += f"observer.noise = {NOISE}\n"
    _, report = designed(text + "feedback.region = { disc = { center = -3, radius = 2.999 } }\n")
    assert 0 <= report["feedback"]["norm"]["gap"] < 0.2


def test_a_weight_by_table_has_the_stated_deviation(designed):
    table = [[0.01, 3.0], [0.1, 2.5], [1.0, 0.6], [10.0, 0.1], [100.0, 0.08]]
    text = PLANT + f'observer.h_infinity = "least"\nobserver.noise = {NOISE}\n'
    _, report = designed(text + f"observer.weights = {{ f_u2 = {{ table = {table}, order = 2 }} }}\n")
    (weight,) = report["observer"]["norm"]["weights"]
    frequencies, magnitudes = np.array(table).T
    fit = np.abs(np.polyval(weight["numerator"], 1j * frequencies) / np.polyval(weight["denominator"], 1j * frequencies))
    deviation = np.exp(np.abs(np.log(fit / magnitudes)).max())
    assert deviation <= weight["table_deviation"] + 1e-9 < 1.4
    for polynomial in (weight["numerator"], weight["denominator"]):
        assert np.roots(polynomial).real.max() < 0


@pytest.mark.parametrize(
    ("weight", "message"),
    [
        ("{ low = 1, high = 2 }", "frequency"),
        ("{ low = 1, frequency = 1, high = 0 }", "expected a number above 0, found 0"),
        ("{ low = 1, frequency = 1, high = 2, order = 3 }", "expected 1 or 2, found 3"),
        ("{ table = [[1, 2]] }", "expected two or more pairs"),
        ("{ table = [[1, 2], [1, 3]] }", "expected frequencies in ascending order"),
        ("{ table = [[1, 2], [3]] }", "expected [frequency in rad/s, magnitude]"),
        ("{ table = [[1, 2], [3, 4]], low = 1 }", "stated by `table` or by `low`"),
        ("{ low = 1, frequency = 7, high = 2 }", "expected a frequency below pi / sample_time = 6.2832e0 rad/s, found 7"),
    ],
)
def test_a_bad_weight_is_refused_at_its_line(refusal, weight, message):
    text = PLANT[: PLANT.index("feedback.region")] + "feedback.region = { decay = 0.03 }\nsample_time = 0.5\n"
    text += f'observer.h_infinity = "least"\nobserver.noise = {weight}\n'
    error = refusal(text)
    assert f"plant.toml:{text.count(chr(10))}:" in error and message in error, error
