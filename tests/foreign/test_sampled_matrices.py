"""Plants whose matrices are of sampled time, beside scipy's discretisation."""

import json
import tomllib

import numpy as np
import pytest
from scipy.io import savemat
from scipy.linalg import solve_discrete_are
from scipy.signal import cont2discrete

from design_oracle import WITHOUT_PROOFS, closed_loop, commands, design_and_report, responses, says_nothing
from test_delays import response

PERIOD = 0.05
# A motor with a flexible shaft: angle and speed of both ends.
A = np.array([[0, 1, 0, 0], [-40, -0.4, 40, 0.1], [0, 0, 0, 1], [20, 0.05, -20, -0.3]])
B = np.array([[0], [5], [0], [0]])
C = np.array([[1, 0, 0, 0], [0, 0, 1, 0]])
F = np.array([[0], [0], [0], [2]])
SAMPLED, INPUTS = cont2discrete((A, np.hstack([B, F]), C, np.zeros((2, 2))), PERIOD)[:2]
REST = f"""C = {C.tolist()}
sample_time = {PERIOD}
feedback.Q = [1, 0.1, 1, 0.1]
feedback.R = [1]
observer.W = [0.01, 0.1, 0.01, 0.1, 1]
observer.V = [0.01, 0.01]
"""
CONTINUOUS = f"A = {A.tolist()}\nB = {B.tolist()}\nF_a = {F.tolist()}\n{REST}"
PLANT = f"""matrices = "sampled"
A = {SAMPLED.tolist()}
B = {INPUTS[:, :1].tolist()}
F_a = {INPUTS[:, 1:].tolist()}
{REST}"""


@pytest.fixture
def design(aso_ftc, tmp_path):
    """Designs a plant file; returns what the command printed and wrote."""

    def run(text, *options):
        (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
        return aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--force", *options)

    return run


def test_sampled_matrices_give_the_design_of_the_plant_that_was_sampled(design):
    reports = []
    for text in (PLANT, CONTINUOUS):
        done = design(text, "--json", *WITHOUT_PROOFS)
        assert done.returncode in (0, 1), done.stderr
        reports.append(json.loads(done.stdout))
    for one, other in zip(reports[0]["gains"], reports[1]["gains"], strict=True):
        np.testing.assert_allclose(one["values"], other["values"], rtol=1e-8, atol=1e-9)
    peaks, expected = ([point["s_peak"] for point in report["robustness"]["points"]] for report in reports)
    np.testing.assert_allclose(peaks, expected, rtol=1e-6)


def test_the_worst_plant_of_sampled_matrices_is_a_plant_file(design, aso_ftc, tmp_path):
    done = design(PLANT, "--worst-case", tmp_path / "worst.toml", *WITHOUT_PROOFS)
    assert done.returncode in (0, 1), done.stderr
    worst = tomllib.loads((tmp_path / "worst.toml").read_text(encoding="utf-8"))
    assert "matrices" not in worst
    np.testing.assert_allclose(worst["F_a"], F, atol=1e-9)
    np.testing.assert_allclose(worst["A"], A, rtol=0.11, atol=1e-9)
    assert aso_ftc("design", tmp_path / "worst.toml", "--out", tmp_path / "other.toml", *WITHOUT_PROOFS).returncode in (0, 1)


def test_matlab_variables_with_a_sample_time_become_a_sampled_plant(aso_ftc, tmp_path):
    savemat(tmp_path / "plant.mat", {"A": SAMPLED, "B": INPUTS[:, :1], "C": C, "Ts": PERIOD})
    done = aso_ftc("design", "--init", tmp_path / "plant.mat", "--out", tmp_path / "plant.toml")
    assert done.returncode == 0 and says_nothing(done), done.stderr
    plant = tomllib.loads((tmp_path / "plant.toml").read_text(encoding="utf-8"))
    assert (plant["matrices"], plant["sample_time"]) == ("sampled", PERIOD)
    assert plant["observer"]["bandwidth"] > plant["feedback"]["bandwidth"] > 0
    np.testing.assert_array_equal(plant["A"], SAMPLED)


def test_the_plant_file_of_a_sampled_plant_with_feedthrough_names_d(aso_ftc, tmp_path):
    savemat(tmp_path / "plant.mat", {"A": [[0.9]], "B": [[0.1]], "C": [[1.0]], "D": [[0.5]], "Ts": 0.1})
    done = aso_ftc("design", "--init", tmp_path / "plant.mat", "--out", tmp_path / "plant.toml")
    text = (tmp_path / "plant.toml").read_text(encoding="utf-8")
    assert tomllib.loads(text)["D"] == [[0.5]], done.stderr
    assert "# x[k+1] = A x[k] + B u[k], y = C x + D u, in deviations from the operating point.\n" in text


SCALAR = 'B = [[1]]\nC = [[1]]\nactuator_faults = "all"\n'


@pytest.mark.parametrize(
    "text, message",
    [
        (f'matrices = "sampled"\nA = [[0.5]]\n{SCALAR}', "1:12: matrices: expected `sample_time`, too"),
        (f'matrices = "discrete"\nA = [[0.5]]\n{SCALAR}', 'expected "continuous" or "sampled", found "discrete"'),
        (PLANT + "[[family]]\nA = [[1]]\n", "expected continuous matrices"),
        (
            f'matrices = "sampled"\nsample_time = 0.1\nA = [[-0.5]]\nactuators = [{{ name = "u", delay = 0.1 }}]\n{SCALAR}',
            "4:13: a delay needs a continuous plant with the samples of A and B, and there is none; expected states of the delay",
        ),
    ],
)
def test_sampled_matrices_that_cannot_be_used_are_refused_with_the_reason(design, text, message):
    done = design(text)
    assert done.returncode == 2 and message in done.stderr, done.stderr


def test_a_state_apart_that_no_continuous_plant_has_changes_no_gain_and_no_threshold(design, tmp_path):
    """The plant above with x5[k+1] = -0.5 x5[k], which nothing acts on and nothing shows."""
    apart = np.zeros((5, 5))
    apart[:4, :4], apart[4, 4] = SAMPLED, -0.5
    more = lambda rows: np.vstack([rows, np.zeros((1, rows.shape[1]))]).tolist()
    rest = REST.replace(str(C.tolist()), str(np.hstack([C, np.zeros((2, 1))]).tolist()))
    # Weights that do not look at the fifth state; a bound, so that the residuals are bounded.
    rest = rest.replace("1, 0.1, 1, 0.1]", "1, 0.1, 1, 0.1, 1]").replace("0.1, 0.01, 0.1, 1]", "0.1, 0.01, 0.1, 1, 1]")
    texts = (
        f'matrices = "sampled"\nA = {SAMPLED.tolist()}\nB = {INPUTS[:, :1].tolist()}\n{REST}',
        f'matrices = "sampled"\nA = {apart.tolist()}\nB = {more(INPUTS[:, :1])}\n{rest}',
    )
    tables = """faults = [{ name = "f", actuator = "u1", bound = 1 }]
[robustness]
tolerance = { C = 0.1 }
[detection]
method = "cusum"
noise = 0.001
process_noise = 0.001
false_alarm_interval = 1000
"""
    reports, files = [], []
    for text in texts:
        done = design(text + tables, "--json")
        assert done.returncode in (0, 1), done.stderr
        reports.append(json.loads(done.stdout))
        files.append(tomllib.loads((tmp_path / "design.toml").read_text(encoding="utf-8")))
    assert [report["plant"]["sample_time"] for report in reports] == [None, PERIOD]
    for name in ("K_x", "K_f", "L_x", "L_f"):
        one, two = (np.array(file[name]) for file in files)
        rows, columns = one.shape
        np.testing.assert_allclose(two[:rows, :columns], one, rtol=1e-7, atol=1e-9)
    peaks = [[point["s_peak"] for point in report["robustness"]["points"]] for report in reports]
    np.testing.assert_allclose(peaks[1], peaks[0], rtol=1e-6)
    tests = [report["detection"]["tests"] for report in reports]
    for one, two in zip(*tests, strict=True):
        np.testing.assert_allclose(two["threshold"], one["threshold"], rtol=1e-6)


# A, B, C, T. The first three: examples 1.1, 1.4 and 1.5 of P. Benner, A. Laub and V. Mehrmann, A collection of benchmark
# examples for the numerical solution of algebraic Riccati equations II: discrete-time case (1995).
BENCHMARKS = [
    ([[4, 3], [-4.5, -3.5]], [[1], [-1]], [[3, 2]], 1.0),
    ([[0, 1], [0, -1]], [[1, 0], [2, 1]], [[1, 0], [0, 1]], 1.0),
    ([[0, 1], [0, 0]], [[0], [1]], [[1, 2]], 1.0),
]
UNSTABLE = ([[0.9, 0.2, 0], [0, -1.1, 0.3], [0, 0, 0.7]], [[0.1], [1.0], [0.5]], [[1, 0, 0.3], [0, 1, 0]], 0.05)
REGISTERS = ([[0.99, 0, 0.1], [0, 0, 0], [0, 1, 0]], [[0], [1], [0]], [[1, 0, 0]], 0.1)


def only_samples(plant, more='actuator_faults = "all"\n'):
    a, b, c, period = plant
    return f'matrices = "sampled"\nsample_time = {period}\nA = {a}\nB = {b}\nC = {c}\n{more}'


@pytest.mark.parametrize("plant", BENCHMARKS)
def test_gains_of_published_plants_without_a_continuous_one_solve_scipys_riccati_equation(aso_ftc, tmp_path, plant):
    a, b, c, _ = (np.array(part, dtype=float) for part in plant)
    n, m, p = len(a), b.shape[1], len(c)
    weights = f"feedback = {{ Q = {[1] * n}, R = {[1] * m} }}\nobserver = {{ W = {[1] * (n + m)}, V = {[1] * p} }}\n"
    design, report = design_and_report(aso_ftc, tmp_path, only_samples(plant, weights + 'actuator_faults = "all"\n'))
    np.testing.assert_array_equal(design.A, a)
    x = solve_discrete_are(a, b, np.eye(n), np.eye(m))
    expected = -np.linalg.solve(np.eye(m) + b.T @ x @ b, b.T @ x @ a)
    np.testing.assert_allclose(design.K_x, expected, rtol=1e-8, atol=1e-9)
    a_0, c_0, gain = design.augmented
    x = solve_discrete_are(a_0.T, c_0.T, np.eye(n + m), np.eye(p))
    np.testing.assert_allclose(gain, x @ c_0.T @ np.linalg.inv(np.eye(p) + c_0 @ x @ c_0.T), rtol=1e-7, atol=1e-8)
    assert any("no continuous plant has these samples" in warning for warning in report["warnings"])


def radius_of(design, a, b, c):
    """The largest modulus of the eigenvalues of the loop of another plant and the controller of a design."""
    n, q = design.n, design.q
    x, x_hat, f_hat = np.split(np.eye(2 * n + q), [n, 2 * n])
    innovation = c @ x - design.C @ x_hat
    corrected, faults = x_hat + design.L_x @ innovation, f_hat + design.L_f @ innovation
    if not design.current:
        corrected, faults = x_hat, f_hat
    command = design.K_x @ corrected + design.K_f @ faults
    rest = (0 if design.current else 1) * innovation
    model = design.A @ corrected + design.B @ command + design.F_a @ faults + design.L_x @ rest
    return max(abs(np.linalg.eigvals(np.vstack([a @ x + b @ command, model, faults + design.L_f @ rest]))))


@pytest.mark.parametrize("estimator", ["current", "prediction"])
@pytest.mark.parametrize("plant", [UNSTABLE, REGISTERS])
def test_peak_delay_margin_bounds_and_worst_plant_of_samples_alone_are_those_of_numpy(aso_ftc, tmp_path, plant, estimator):
    faults = 'faults = [{ name = "f", actuator = "u1", bound = 2, rate_bound = 0.5 }]\n'
    tolerance = "robustness.tolerance = 0.05\n"
    text = only_samples(plant, f'estimator = "{estimator}"\n{faults}{tolerance}')
    design, report = design_and_report(aso_ftc, tmp_path, text, ())
    a, b, c, period = map(np.array, plant)
    n = len(a)
    loop, entry, _, direct = closed_loop(design)
    to_command = commands(design)
    added = np.vstack([b, np.zeros((n + 1, 1))])
    frequencies = np.linspace(0, np.pi, 20_001)[1:]
    sums = 1 + response(loop, added, to_command, np.exp(1j * frequencies)[:, None, None])
    robustness = report["robustness"]
    np.testing.assert_allclose(robustness["points"][0]["s_peak"], np.max(np.abs(sums)), rtol=1e-4)
    # The largest delay in whole samples.
    whole = round(robustness["delay_margin"] / period)
    np.testing.assert_allclose(robustness["delay_margin"], whole * period)

    def delayed(samples):
        size = len(loop)
        all_states = np.zeros((size + samples, size + samples))
        all_states[:size, :size] = loop
        if samples:
            all_states[:n, :size] -= b @ to_command
            all_states[:n, -1:] = b
            all_states[size, :size] = to_command
            all_states[size + 1 :, size:-1] = np.eye(samples - 1)
        return max(abs(np.linalg.eigvals(all_states)))

    assert delayed(whole) < 1 <= delayed(whole + 1)
    # |f| <= 2, and |f'| <= 0.5: the sums of the moduli of the responses.
    system = (loop, entry, np.vstack([np.eye(n, len(loop)), closed_loop(design)[2][n:]]), direct)
    _, impulse, step = responses(system, period, 4000)
    of_fault = np.abs(impulse).sum(axis=0)[:, 0] + np.abs(direct[:, 0])
    of_rate = np.abs(step).sum(axis=0)[:, 0] * period
    for bound, fault, rate in zip(report["bounds"], of_fault, of_rate, strict=True):
        np.testing.assert_allclose(bound["gain_of_fault"], fault, rtol=2e-3, atol=1e-9)
        np.testing.assert_allclose(bound["gain_of_rate"], rate, rtol=2e-3, atol=1e-6)
        assert bound["largest"] <= 2 * fault * 1.002
    # The worst plant is on the limit of stability at the stated multiple of the tolerances.
    worst = {matrix["name"]: np.array(matrix["values"]) for matrix in robustness["tolerance"]["worst"]}
    nominal = {"A": a, "B": b, "C": c}

    limit = robustness["tolerance"]["first_unstable"]
    changed = [nominal[name] + limit * (worst[name] - nominal[name]) for name in "ABC"]
    np.testing.assert_allclose(radius_of(design, *changed), 1, rtol=1e-6)
    assert 0.9 * limit < robustness["tolerance_proof"]["fraction"] <= limit


def test_residuals_of_a_wrong_model_need_a_plant_that_is_stable_in_its_samples(aso_ftc, tmp_path):
    detection = """faults = [{ name = "f", actuator = "u1", bound = 1 }]
actuators = [{ name = "u1", limits = [-1, 1] }]
[detection]
method = "cusum"
noise = 0.01
false_alarm_interval = 100
model_error = 1
"""
    refused, message = design_and_report(aso_ftc, tmp_path, only_samples(UNSTABLE, detection))
    assert refused is None and "bounded only if the plant is stable without the controller" in message, message
    stable = ([[0.9, 0.2], [0, -0.5]], *([[0.1], [1.0]], [[1, 0]], 0.05))
    design, report = design_and_report(aso_ftc, tmp_path, only_samples(stable, detection))
    assert design is not None and report["detection"]["tests"], message
