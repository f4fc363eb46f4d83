"""Plants with delays, beside loops with the delays themselves by numpy and scipy."""

import tomllib

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from design_oracle import WITHOUT_PROOFS, Matrices, design_and_report
from matrices import zoh

# A heated tank, a pendulum that falls, a cart with its position and speed.
TANK = ([[-0.01]], [[0.02]], [[1]])
FALLING = ([[0, 1], [4, -0.2]], [[0], [2]], [[1, 0]])
CART = ([[0, 1], [0, -0.5]], [[0], [0.5]], [[1, 0], [0, 1]])


def plant_text(plant, inputs, outputs, more=""):
    """A plant file with delays in s."""
    a, b, c = plant
    signals = {
        "actuators": [f'{{ name = "u{k}", delay = {delay} }}' for k, delay in enumerate(inputs)],
        "measurements": [f'{{ name = "y{k}", delay = {delay} }}' for k, delay in enumerate(outputs)],
    }
    lines = [f"{name} = [{', '.join(values)}]" for name, values in signals.items()]
    lines = [f"A = {a}", f"B = {b}", f"C = {c}", *lines, 'actuator_faults = "all"', more]
    return "\n".join(lines) + "\n"


def command_dynamics(design):
    """The continuous controller: x' = M x + L y, u = K x with the states [x_hat; f_hat]."""
    gain = np.hstack([design.K_x, design.K_f])
    dynamics = np.block([[design.A, design.F_a], [np.zeros((design.q, design.n)), design.A_f]])
    correction = np.vstack([design.L_x, design.L_f])
    entry = np.vstack([design.B, np.zeros((design.q, design.B.shape[1]))])
    output = np.hstack([design.C, np.zeros((len(design.C), design.q))])
    return dynamics + entry @ gain - correction @ output, correction, gain


def response(a, b, c, s):
    """C (s I - A)^-1 B; for each s if it has the shape (count, 1, 1)."""
    return c @ np.linalg.solve(s * np.eye(len(a)) - a, b)


@pytest.mark.parametrize(
    "plant, inputs, outputs, more",
    [
        (TANK, [30], [5], ""),
        (TANK, [30], [0], "delay_order = 2"),
        (FALLING, [0.05], [0.03], ""),
        (CART, [0.1], [0.1, 0.4], ""),
        (CART, [0.1], [0.1, 0.4], "[loop]\nbandwidth = 0.5"),
    ],
)
def test_the_peaks_of_a_continuous_loop_are_those_with_the_delays_themselves(
    aso_ftc, tmp_path, plant, inputs, outputs, more
):
    design, report = design_and_report(aso_ftc, tmp_path, plant_text(plant, inputs, outputs, more))
    dynamics, correction, gain = command_dynamics(design)
    a, b, c = map(np.array, plant)
    s = 1j * np.geomspace(1e-4, 1e3, 20_000)[:, None, None]
    late = np.exp(-s * np.array(outputs)[:, None]) * np.exp(-s * np.array(inputs))
    g, k = response(a, b, c, s) * late, response(dynamics, correction, gain, s)
    sensitivities = (np.linalg.inv(np.eye(loop.shape[-1]) - loop) for loop in (k @ g, g @ k))
    peaks = [np.linalg.norm(matrices, 2, axis=(1, 2)).max() for matrices in sensitivities]
    s_peaks = report["robustness"]["delays"]["s_peaks"]
    np.testing.assert_allclose(s_peaks, peaks, rtol=2e-3)
    # The loop of the other figures has delays of ten states each.
    np.testing.assert_allclose([point["s_peak"] for point in report["robustness"]["points"]], peaks, rtol=2e-3)
    assert report["robustness"]["delays"]["difference"] < 1


def held(plant, delay, period):
    """x[n+1] = phi x + late u[n-k-1] + early u[n-k] of a plant whose command acts `delay` late; k."""
    a, b, _ = map(np.array, plant)
    k = int(delay // period)
    rest = delay - k * period
    phi, _ = zoh(a, b, period)
    free, early = zoh(a, b, period - rest)
    _, late = zoh(a, b, rest)
    return phi, free @ late, early, k


@pytest.mark.parametrize(
    "plant, inputs, outputs, period, estimator",
    [
        (TANK, [30], [5], 2.0, "current"),
        (TANK, [30], [5], 8.0, "current"),
        (TANK, [30], [5], 40.0, "prediction"),
        (FALLING, [0.05], [0.03], 0.02, "current"),
        (FALLING, [0.05], [0.03], 0.03, "prediction"),
    ],
)
def test_a_sampled_loop_with_the_delays_themselves_has_the_stated_peak_and_rejects_a_fault(
    aso_ftc, tmp_path, plant, inputs, outputs, period, estimator
):
    more = f'sample_time = {period}\nestimator = "{estimator}"'
    design, report = design_and_report(aso_ftc, tmp_path, plant_text(plant, inputs, outputs, more))
    c = np.array(plant[2])
    # With one command and one measurement only the sum of the delays counts.
    phi, late, early, k = held(plant, inputs[0] + outputs[0], period)
    n, order, q = len(phi), design.n, design.q
    a_0 = np.block([[design.A, design.F_a], [np.zeros((q, order)), design.A_f]])
    output, gain = np.hstack([design.C, np.zeros((1, q))]), np.hstack([design.K_x, design.K_f])
    entry = np.vstack([design.B, np.zeros((q, 1))])
    correction = np.vstack([design.L_x, design.L_f])
    # States: x, the commands of the last k + 1 samples (newest first), prediction of [x_hat; f_hat].
    size = n + k + 1 + order + q
    whole, added = np.zeros((size, size)), np.zeros((size, 1))
    estimate = np.zeros((order + q, size))
    estimate[:, n + k + 1 :] = np.eye(order + q)
    innovation = -output @ estimate
    innovation[:, :n] += c
    if estimator == "current":
        corrected = estimate + correction @ innovation
        command = gain @ corrected
        following = a_0 @ corrected + entry @ command
    else:
        command = gain @ estimate
        following = a_0 @ estimate + entry @ command + correction @ innovation
    # What acts is the command and what is added to it, in front of the delay.
    whole[:n, :n] = phi
    whole[:n, n + k : n + k + 1] += late
    if k == 0:
        whole[:n] += early @ command
        added[:n] += early
    else:
        whole[:n, n + k - 1 : n + k] += early
    whole[n] = command
    added[n] = 1
    for at in range(k):
        whole[n + 1 + at, n + at] = 1
    whole[n + k + 1 :] = following
    assert max(abs(np.linalg.eigvals(whole))) < 1
    frequencies = np.linspace(0, np.pi, 20_001)[1:]
    sums = 1 + response(whole, added, command, np.exp(1j * frequencies)[:, None, None])
    peak = np.max(np.abs(sums))
    np.testing.assert_allclose(report["robustness"]["delays"]["s_peaks"], [peak, peak], rtol=2e-3)
    # A constant fault of 1 is estimated, and what is measured returns to zero.
    rest = np.linalg.solve(np.eye(size) - whole, added)
    np.testing.assert_allclose((c @ rest[:n])[0, 0], 0, atol=1e-6)
    np.testing.assert_allclose(rest[-q:], 1, rtol=1e-6)


def test_a_loop_that_only_the_approximation_holds_stable_is_red(aso_ftc, tmp_path):
    """Eigenvalues 40 times as fast as the delay: the observer's approximation of order one is far away."""
    more = "delay_order = 1\nfeedback.bandwidth = 10\nobserver.bandwidth = 40"
    text = plant_text(FALLING, [1.0], [0], more)
    (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml")
    assert done.returncode == 1, done.stderr
    assert "does not hold: plant and controller are stable together" in done.stdout
    design = Matrices(tomllib.loads((tmp_path / "design.toml").read_text(encoding="utf-8")))
    dynamics, correction, gain = command_dynamics(design)
    loop = np.block([[design.A, design.B @ gain], [correction @ design.C, dynamics]])
    assert max(np.linalg.eigvals(loop).real) < 0
    assert "no controller has a peak of S below 5.7" in done.stdout  # e^1.9 - 1


def test_a_plant_without_a_stable_loop_is_refused_with_what_its_delay_forces(aso_ftc, tmp_path):
    (tmp_path / "plant.toml").write_text(plant_text(([[2]], [[1]], [[1]]), [1.0], [0]), encoding="utf-8")
    refused = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml")
    assert refused.returncode == 2
    # e^2 - 1
    assert "loop is stable; no controller has a peak of S below 6.389" in refused.stderr, refused.stderr


def test_the_worst_plant_keeps_its_delays_and_is_designed(aso_ftc, tmp_path):
    text = plant_text(CART, [0.1], [0.1, 0.4], '[robustness.tolerance]\nentries = { "B[2][1]" = 0.3, "A[2][2]" = 0.2 }')
    (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
    worst = tmp_path / "worst.toml"
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--worst-case", worst, *WITHOUT_PROOFS)
    assert done.returncode in (0, 1), done.stderr
    assert "B[2][1]" in done.stdout
    plant = tomllib.loads(worst.read_text(encoding="utf-8"))
    assert np.shape(plant["A"]) == (2, 2) and plant["measurements"][1]["delay"] == 0.4
    assert 0.35 * 0.999 <= plant["B"][1][0] <= 0.65 * 1.001 and plant["B"][1][0] != 0.5
    assert aso_ftc("design", worst, "--out", tmp_path / "other.toml", *WITHOUT_PROOFS).returncode in (0, 1)


def test_weights_are_those_of_the_states_of_the_plant(aso_ftc, tmp_path):
    """Q and W of two states: the regulator of the plant with zeros for the delay."""
    weights = "feedback.Q = [1, 0.1]\nfeedback.R = [1]\nobserver.W = [0.01, 0.1, 1]\nobserver.V = [0.1, 0.1]"
    design, _ = design_and_report(aso_ftc, tmp_path, plant_text(CART, [0.1], [0, 0], weights))
    q = np.diag([1, 0.1, 0, 0, 0])
    p = solve_continuous_are(design.A, design.B, q, np.eye(1))
    np.testing.assert_allclose(design.K_x, -design.B.T @ p, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    "text, message",
    [
        (plant_text(CART, [-0.1], [0, 0]), "expected a time in s, 0 or more, found -0.1"),
        (plant_text(CART, [0], [0, 0], "delay_order = 2"), "no actuator and no measurement has a `delay`"),
        (plant_text(TANK, [1e-12], [0]), "a delay of 1e-12 s is too short beside the fastest time constant of the plant, 100 s"),
        (plant_text(TANK, [0], [1e300]), "too long beside the fastest time constant of the plant, 100 s"),
        (plant_text(CART, [0.1], [0, 0], "delay_order = 0"), "expected a whole number from 1 to 8, found 0"),
        (plant_text(CART, [0.1], [0, 0], "delay_order = 2.5"), "expected a whole number from 1 to 8, found 2.5"),
        (
            plant_text(CART, [0.1], [0, 0], "feedback.eigenvalues = [-1, -2]"),
            "expected 5 eigenvalues, one for each of the states (3 of them those of delays), found 2",
        ),
        ('states = [{ name = "x", delay = 1 }]\nA = [[-1]]\nB = [[1]]\nC = [[1]]\n', "unknown entry `states[1].delay`"),
    ],
)
def test_a_wrong_delay_is_one_error_at_its_place(refusal, text, message):
    error = refusal(text)
    assert message in error, error


def test_a_shift_register_is_a_plant_and_the_delay_that_takes_its_place_is_named(aso_ftc, tmp_path):
    """y[k+1] = 0.9 y[k] + 0.1 u[k-3]."""
    rest = 'sample_time = 0.1\nactuator_faults = "all"\nC = [[1{}]]\n'
    a = [[0.9, 0, 0, 0.1], [0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]
    text = f'matrices = "sampled"\nA = {a}\nB = [[0], [1], [0], [0]]\n' + rest.format(", 0, 0, 0")
    registers, report = design_and_report(aso_ftc, tmp_path, text)
    assert any("`delay = 0.3` in the actuator" in warning for warning in report["warnings"]), report["warnings"]
    np.testing.assert_array_equal(registers.A, a)
    text = 'matrices = "sampled"\nA = [[0.9]]\nB = [[0.1]]\nactuators = [{ name = "u", delay = 0.3 }]\n' + rest.format("")
    design, report = design_and_report(aso_ftc, tmp_path, text)
    assert report["verdict"]["level"] == "green" and design.K_x.shape == (1, 4)
    np.testing.assert_allclose(design.A[0, 0], 0.9, rtol=1e-12)
