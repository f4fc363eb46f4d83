"""The detection of faults that `aso-ftc design` makes: decoupling and whiteness by frequency responses, thresholds and
run lengths by scipy and by the Markov chain of Brook and Evans, false alarms and delays by simulation."""

import json
import subprocess
import tomllib

import numpy as np
import pytest
import scipy.linalg
import scipy.stats

from conftest import ROOT
from matrices import zoh

PLANT = """
A = [[-0.5, 0.2, 0.0, 0.0], [0.1, -0.4, 0.3, 0.0], [0.0, 0.1, -0.8, 0.2], [0.0, 0.0, 0.1, -1.0]]
B = [[1.0, 0.0], [0.0, 0.5], [0.0, 0.0], [0.0, 1.0]]
C = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]
actuator_faults = "all"
feedback.eigenvalues = [-1.0, -1.2, -1.4, -1.6]
observer.region = { decay = 2.0 }
"""
DETECTION = """
[detection]
false_alarm_interval = 200.0
noise = [0.02, 0.03, 0.04]
process_noise = [0.01, 0.02, 0.01, 0.03]
sizes = { f_u1 = 0.05, f_u2 = 0.2 }
from = 0.0
"""
DISTURBANCE = """
[[disturbances]]
name = "d"
E = [0.0, 0.0, 1.0, 0.0]
"""
COMMAND = ROOT / "target" / "release" / "aso-ftc"
T = 0.1


def designed(folder, text):
    """The report and the design file for a plant file."""
    (folder / "plant.toml").write_text(text, encoding="utf-8")
    command = [COMMAND, "design", "plant.toml", "--json", "--force", "--certificate-time", "0"]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert run.returncode in (0, 1), run.stderr
    return json.loads(run.stdout)["detection"], tomllib.loads((folder / "plant-design.toml").read_text("utf-8"))


def text(method, sampled, extra="", disturbance=DISTURBANCE):
    """A plant file."""
    head = f"sample_time = {T}\n" if sampled else ""
    return head + PLANT + disturbance + DETECTION + f'method = "{method}"\n' + extra


def plant(sampled):
    """A, [B, E], C of the plant in the domain of the design; the columns are u1, u2, d."""
    file = tomllib.loads(PLANT)
    a, b, c = (np.array(file[name], dtype=float) for name in "ABC")
    b = np.hstack([b, np.array([[0.0], [0.0], [1.0], [0.0]])])
    if sampled:
        a, b = zoh(a, b, T)
    return a, b, c


def noise():
    """W and V of the plant file."""
    table = tomllib.loads(DETECTION)["detection"]
    return np.diag(np.square(table["process_noise"])), np.diag(np.square(table["noise"]))


class Filter:
    """The filter of a design file."""

    def __init__(self, section):
        self.a, self.b_u, self.b_y, self.c, self.d_u, self.d_y = (
            np.array(section[name]) for name in ("A", "B_u", "B_y", "C", "D_u", "D_y"))
        self.tests = section["tests"]

    def at(self, s):
        """The transfer functions from u and from y to r."""
        inverse = np.linalg.inv(s * np.eye(len(self.a)) - self.a)
        return self.c @ inverse @ self.b_u + self.d_u, self.c @ inverse @ self.b_y + self.d_y


def points(sampled):
    """Points on the limit of stability."""
    frequencies = np.array([0.03, 0.4, 2.0, 11.0])
    return np.exp(1j * frequencies * T) if sampled else 1j * frequencies


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("method", ["cusum", "chi-square"])
def test_residuals_are_white_and_see_neither_commands_nor_what_is_decoupled(tmp_path, sampled, method):
    report, file = designed(tmp_path, text(method, sampled, "isolation = true\n"))
    detector = Filter(file["detection"])
    a, b, c = plant(sampled)
    w, v = noise()
    rows = np.cumsum([0, *(test["residuals"] for test in detector.tests)])
    assert [test["decoupled"][0]["exact"] for test in report["tests"]] == [True, True]
    for s in points(sampled):
        from_u, from_y = detector.at(s)
        states = np.linalg.inv(s * np.eye(4) - a)
        outputs = c @ states @ b
        assert np.abs(from_u + from_y @ outputs[:, :2]).max() < 1e-9 * np.abs(from_u).max()
        spectrum = from_y @ (v + c @ states @ w @ states.conj().T @ c.T) @ from_y.conj().T
        effect = from_y @ outputs
        for k, own_test in enumerate(detector.tests):
            part = slice(rows[k], rows[k + 1])
            identity = np.eye(rows[k + 1] - rows[k])
            assert np.abs(spectrum[part, part] - identity).max() < 1e-8, own_test
            scale = np.abs(from_y[part]).max() * np.abs(outputs).max()
            assert np.abs(effect[part, [1, 0][k]]).max() < 1e-9 * scale, "the other fault"
            assert np.abs(effect[part, 2]).max() < 1e-9 * scale, "the disturbance"
    assert [test["reacts"] for test in detector.tests] == [[True, False], [False, True]]
    assert report["reacts"] == [[True, False], [False, True]]


def markov_chain(drift, threshold, states):
    """The run length of a one-sided cumulative sum from zero by Brook and Evans (1972)."""
    width = 2.0 * threshold / (2 * states - 1)
    middle = width * np.arange(states)
    upper = scipy.stats.norm.cdf((middle + 0.5 * width)[None, :] - middle[:, None] + drift)
    lower = scipy.stats.norm.cdf((middle - 0.5 * width)[None, :] - middle[:, None] + drift)
    lower[:, 0] = 0.0
    return np.linalg.solve(np.eye(states) - (upper - lower), np.ones(states))[0]


def extrapolated(drift, threshold):
    """The limit of many states: the error of the chain falls with the square of their number."""
    coarse, fine = (markov_chain(drift, threshold, states) for states in (200, 400))
    ratio = (2 * 400 - 1) ** 2 / (2 * 200 - 1) ** 2
    return (ratio * fine - coarse) / (ratio - 1.0)


def test_the_threshold_of_the_cumulative_sums_gives_the_stated_false_alarms(tmp_path):
    report, file = designed(tmp_path, text("cusum", True))
    assert len(report["tests"]) == 2
    for test, entry in zip(report["tests"], file["detection"]["tests"], strict=True):
        length = 0.5 * extrapolated(entry["drift"], entry["threshold"])
        # Two tests share the false alarms.
        assert length * T == pytest.approx(400.0, rel=1e-4)
        assert test["false_alarm_interval"] == pytest.approx(400.0, rel=1e-6)
    assert report["false_alarm_interval"] == pytest.approx(200.0, rel=1e-6)


def test_the_threshold_of_a_window_is_the_quantile_of_scipy(tmp_path):
    for extra, window in (("window = 0.8\n", 8), ("", None)):
        report, file = designed(tmp_path, text("chi-square", True, extra))
        (test,) = file["detection"]["tests"]
        window = window or test["window"]
        # One disturbance is decoupled, so that two of three measurements are left.
        assert (test["window"], test["residuals"]) == (window, 2)
        expected = scipy.stats.chi2.isf(window * T / 200.0, 2)
        assert test["threshold"] == pytest.approx(expected, rel=1e-9)
        assert report["false_alarm_interval"] == pytest.approx(200.0, rel=1e-6)


def alarms(detector, reset, fault, runs, samples, generator):
    """The sample of the first alarm of each run with noise and, from sample `reset` on, a fault; `samples` if there is
    none. Sums and windows start again at `reset` if they had an alarm before."""
    a, b, c = plant(True)
    w, v = noise()
    x, x_r = np.zeros((runs, 4)), np.zeros((runs, len(detector.a)))
    root_w, root_v = np.sqrt(np.diag(w)), np.sqrt(np.diag(v))
    sums = [np.zeros((runs, 2 if "drift" in test else test["residuals"])) for test in detector.tests]
    first = np.full(runs, samples)
    for k in range(-200, samples):
        y = x @ c.T + root_v * generator.standard_normal((runs, 3))
        r = x_r @ detector.c.T + y @ detector.d_y.T
        x_r = x_r @ detector.a.T + y @ detector.b_y.T
        x = x @ a.T + root_w * generator.standard_normal((runs, 4))
        if k >= reset:
            x = x + b[:, :2] @ fault
        at = 0
        for test, own_sums in zip(detector.tests, sums, strict=True):
            part = r[:, at:at + test["residuals"]]
            at += test["residuals"]
            if "drift" in test:
                own_sums[:] = np.maximum(0.0, own_sums + np.hstack([part, -part]) - test["drift"])
                over = own_sums.max(axis=1) > test["threshold"]
            else:
                own_sums += part
                over = np.zeros(runs, dtype=bool)
                if (k + 1) % test["window"] == 0:
                    over = (own_sums ** 2).sum(axis=1) / test["window"] > test["threshold"]
                    own_sums[:] = 0.0
            if k < reset:
                own_sums[over] = 0.0
            else:
                first[over & (first == samples)] = k
    return first


@pytest.mark.parametrize("method", ["cusum", "chi-square"])
def test_false_alarms_and_delays_of_simulated_runs_are_the_predicted_ones(tmp_path, method):
    report, file = designed(tmp_path, text(method, True, "isolation = true\n"))
    detector = Filter(file["detection"])
    generator = np.random.default_rng(1)
    runs, samples = 1000, 400
    fraction = np.mean(alarms(detector, 0, np.zeros(2), runs, samples, generator) < samples)
    predicted = 1.0 - np.exp(-samples * T / report["false_alarm_interval"])
    low, high = scipy.stats.binom.interval(0.999, runs, predicted)
    assert low <= fraction * runs <= high, (fraction, predicted)
    for fault, entry in enumerate(report["faults"]):
        column = np.zeros(2)
        column[fault] = entry["size"]
        delays = alarms(detector, 0, column, runs, 400, generator)
        # The first sample with the fault is at its start: half a sample less than on average.
        mean = (delays.mean() + 0.5) * T
        error = delays.std() * T / np.sqrt(runs)
        # Alarms of the other test shorten some delays.
        assert mean == pytest.approx(entry["delay"], abs=4.0 * error + 0.05 * entry["delay"]), entry
        assert np.mean(delays * T <= entry["delay_90"]) == pytest.approx(0.9, abs=0.04)


def test_a_disturbance_that_the_measurements_show_late_is_a_random_walk_with_its_effect_stated(tmp_path):
    # The fourth state is not measured.
    hidden = '\n[[disturbances]]\nname = "d"\nE = [0.0, 0.0, 0.0, 1.0]\n'
    (tmp_path / "plant.toml").write_text(text("cusum", False, "", hidden), encoding="utf-8")
    run = subprocess.run([COMMAND, "design", "plant.toml"], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 2 and "expected `bound`" in run.stderr, run.stderr
    report, file = designed(tmp_path, text("cusum", False, "", hidden + "bound = 0.5\n"))
    detector = Filter(file["detection"])
    a, _, c = plant(False)
    e = np.array([[0.0], [0.0], [0.0], [1.0]])
    for test in report["tests"]:
        (decoupled,) = test["decoupled"]
        assert not decoupled["exact"] and decoupled["size"] == 0.5
        assert 0.0 < decoupled["largest_mean"]
    # At s = 0 there is no effect.
    effect = detector.at(1e-9)[1] @ c @ np.linalg.inv(-a) @ e
    assert np.abs(effect).max() < 1e-6
    # The step response, averaged over intervals: from the whole system with the integral of r.
    n = len(detector.a)
    whole = np.block([
        [a, np.zeros((4, n + 2)), e],
        [detector.b_y @ c, detector.a, np.zeros((n, 2)), np.zeros((n, 1))],
        [detector.d_y @ c, detector.c, np.zeros((2, 2)), np.zeros((2, 1))],
        [np.zeros((1, 4 + n + 3))],
    ])
    period = report["sample_time"]
    step, state = scipy.linalg.expm(whole * period), np.zeros(4 + n + 3)
    state[-1] = 0.5
    largest = np.zeros(2)
    for _ in range(400):
        state = step @ state
        largest = np.maximum(largest, np.abs(state[-3:-1]) / np.sqrt(period))
        state[-3:-1] = 0.0
    stated = [test["decoupled"][0]["largest_mean"] for test in report["tests"]]
    assert largest == pytest.approx(stated, rel=1e-6)



# Two positions; the command, and its fault, act on the second mass only.
INTEGRATORS = """
A = [[0, 0, 0], [0, 0, 1], [0, 0, 0]]
B = [[1, 0], [0, 0], [0, 1]]
C = [[1, 0, 0], [0, 1, 0]]
feedback.eigenvalues = [-1.0, -1.2, -1.4]
observer.eigenvalues = [-3.0, -3.2, -3.4, -3.6]
robustness.cases = 0
[[faults]]
name = "f"
actuator = "u2"
bound = 1.0
[detection]
method = "chi-square"
false_alarm_interval = 2000.0
noise = 0.01
from = 0.0
"""


@pytest.mark.parametrize("sampled", [False, True], ids=["continuous", "sampled"])
def test_integrators_that_no_fault_moves_get_noise_and_their_filter_is_stable(tmp_path, sampled):
    report, file = designed(tmp_path, (f"sample_time = {T}\n" if sampled else "") + INTEGRATORS)
    assert "commands by one" in report["process_noise"]
    eigenvalues = np.linalg.eigvals(np.array(file["detection"]["A"]))
    assert np.abs(eigenvalues).max() < 0.99 if sampled else eigenvalues.real.max() < -0.1


def test_no_noise_for_an_integrator_is_refused_at_the_number(tmp_path):
    (tmp_path / "plant.toml").write_text(INTEGRATORS + "process_noise = [0, 0, 0.1]\n", encoding="utf-8")
    run = subprocess.run([COMMAND, "design", "plant.toml"], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 2
    assert "plant.toml:17:17: the residuals need a filter that corrects every state" in run.stderr, run.stderr
    assert "(0 1/s)" in run.stderr and not (tmp_path / "plant-design.toml").exists()


@pytest.mark.parametrize(("change", "place"), [
    (('method = "cusum"', 'method = "t-test"'), 'expected "cusum" or "chi-square", found "t-test"'),
    (("false_alarm_interval = 200.0", ""), "`detection.false_alarm_interval` is missing"),
    (("false_alarm_interval = 200.0", "false_alarm_interval = 0.05"), "at least 2"),
    (("noise = [0.02, 0.03, 0.04]", ""), "`detection.noise` is missing"),
    (("noise = [0.02, 0.03, 0.04]", "noise = [0.02, 0.03]"), "expected 3 numbers, one per measurement, found 2"),
    (("noise = [0.02, 0.03, 0.04]", "noise = 0"), "expected numbers above 0"),
    (("process_noise = [0.01,", "process_noise = [0.01, 0.01,"), "expected 4 numbers, one per state, found 5"),
    (("f_u1 = 0.05", "f_u3 = 0.05"), "did you mean `f_u1`?"),
    (("f_u1 = 0.05, ", ""), "the size of fault `f_u1` that shall be detected is missing"),
    (("from = 0.0", "from = -1.0"), "expected a time from 0, found -1"),
    (("from = 0.0", "from = 0.0\nwindow = 1.0"), 'it belongs to the method "chi-square"'),
    (("from = 0.0", "from = 0.0\nsample_time = 0.1"), "a sampled controller tests in each of its samples"),
    (("E = [0.0, 0.0, 1.0, 0.0]", "E = [0.0, 0.0, 1.0]"), "expected 4 numbers, one per state, found 3"),
    (("E = [0.0, 0.0, 1.0, 0.0]", "E = [0.0, 0.0, 0.0, 0.0]"), "expected a number other than 0"),
    (("E = [0.0, 0.0, 1.0, 0.0]", 'input = "d"'), "the plant is no FMU: expected `E`"),
    (("E = [0.0, 0.0, 1.0, 0.0]", 'actuator = "u7"'), 'no actuator is named "u7"'),
    (('actuator_faults', 'measurements = ["residual", "y2", "y3"]\nactuator_faults'), "a variable `residual` of its own"),
])
def test_a_wrong_entry_is_named_at_its_line(tmp_path, change, place):
    whole = text("cusum", True)
    assert whole.count(change[0]) == 1
    (tmp_path / "plant.toml").write_text(whole.replace(*change), encoding="utf-8")
    run = subprocess.run([COMMAND, "design", "plant.toml"], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 2 and place in run.stderr, run.stderr
    assert "plant.toml:" in run.stderr
