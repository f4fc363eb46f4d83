"""Losses of effectiveness up to a stated fraction: the report's proofs and limits by numpy and simulations."""

import itertools
import json
import tomllib

import numpy as np
import pytest
from scipy.linalg import cholesky

from design_oracle import Matrices, closed_loop
from matrices import zoh

# A mass on a spring whose two forces act together; the first works with 2 N at the operating point.
PLANT = """
A = [[0, 1], [2, -0.5]]
B = [[0, 0.3], [1, 0.6]]
C = [[1, 0]]
actuators = [{ name = "u1", operating = 2.0 }, "u2"]
feedback.Q = [10, 1]
feedback.R = [1, 1]
observer.eigenvalues = [-6, -7, -8]
robustness.cases = 10

[[faults]]
name = "loss"
loss_of = "u1"
least_command = 0.1
up_to = UP_TO
"""
ANOTHER = """
[[faults]]
name = "push"
actuator = "u2"
bound = 1.5
"""


def designed(aso_ftc, folder, text):
    folder.mkdir(exist_ok=True)
    (folder / "plant.toml").write_text(text, encoding="utf-8")
    done = aso_ftc("design", folder / "plant.toml", "--out", folder / "design.toml", "--json")
    assert done.returncode in (0, 1), done.stderr
    report = json.loads(done.stdout)
    assert done.returncode == (report["verdict"]["level"] == "red")
    return Matrices(tomllib.loads((folder / "design.toml").read_text(encoding="utf-8"))), report


def compensated(report):
    (entry,) = (loop for loop in report["losses"]["loops"] if loop["name"] == "compensation on")
    return entry


def decrease(p, a, period):
    """The matrix that is negative definite if x'Px falls, in coordinates in which P is the identity."""
    root = cholesky(np.array(p))
    dynamics = root @ a @ np.linalg.inv(root)
    return dynamics + dynamics.T if period is None else dynamics.T @ dynamics - np.eye(len(a))


@pytest.mark.parametrize("sampled", ["", "sample_time = 0.05\n"], ids=["continuous", "sampled"])
def test_the_certificate_of_the_report_holds_for_every_loss_in_the_stated_range(aso_ftc, tmp_path, sampled):
    design, report = designed(aso_ftc, tmp_path, sampled + PLANT.replace("UP_TO", "0.3"))
    proof = compensated(report)["proof"]
    assert "reason" not in proof and report["losses"]["stated"] == [{"name": "u1", "unit": None, "value": 0.3}]
    for loss in np.linspace(0, 0.3, 7):
        a = closed_loop(design, [loss, 0])[0]
        assert np.linalg.eigvalsh(decrease(proof["p"], a, design.period)).max() < 0


@pytest.mark.parametrize("sampled", ["", "sample_time = 0.05\n"], ids=["continuous", "sampled"])
def test_losses_that_vary_keep_the_decay_rate_and_the_bounds_of_the_report(aso_ftc, tmp_path, sampled):
    """Bang-bang losses and pushes, chosen greedily and at random, from rest."""
    text = (sampled + PLANT.replace("UP_TO", "0.3")).replace("C = [[1, 0]]", "C = [[1, 0], [0, 1]]")
    text = text.replace("[-6, -7, -8]", "[-6, -7, -8, -9]") + ANOTHER
    design, report = designed(aso_ftc, tmp_path, text)
    proof = compensated(report)["proof"]
    step = design.period or 0.02
    order = 2 * design.n + design.q
    random = np.random.default_rng(1)

    def moved(loss, column):
        a = closed_loop(design, [loss, 0])[0]
        if design.period:
            return a, column
        a, column = zoh(a, column[:, None], step)
        return a, column[:, 0]

    inputs = {"lost part of u1 at the operating point": design.B[:, 0], "push": design.F_a[:, 1]}
    sizes = {"lost part of u1 at the operating point": 0.6, "push": 1.5}
    bounds = {(peak["disturbance"], peak["state"]): peak["largest"] for peak in proof["peaks"]}
    assert {name for name, _ in bounds} == set(inputs)
    for name, column in inputs.items():
        column = np.concatenate([column * sizes[name], np.zeros(order - design.n)])
        cases = [moved(loss, column) for loss in (0.0, 0.3)]
        for state, aim in itertools.product(range(2), ("greedy", "random")):
            x, largest = np.zeros(order), np.zeros(2)
            for _ in range(1500):
                options = [a @ x + sign * b for a, b in cases for sign in (-1, 1)]
                if aim == "greedy" and random.random() < 0.9:
                    x = max(options, key=lambda option: option[state])
                else:
                    x = options[random.integers(4)]
                largest = np.maximum(largest, abs(x[:2]))
            assert (largest <= [bounds[name, "x1"], bounds[name, "x2"]]).all(), (name, state, aim)
    # The decay rate: x'Px of its own certificate is not known, so the norm over a long time decides.
    cases = [moved(loss, np.zeros(order))[0] for loss in (0.0, 0.3)]
    x = random.normal(size=order)
    start, count = np.linalg.norm(x), int(20 / step)
    for _ in range(count):
        x = cases[random.integers(2)] @ x
    assert np.log(np.linalg.norm(x) / start) / (count * step) < -0.8 * proof["decay"]


def test_the_limits_of_the_report_are_those_of_eigenvalues(aso_ftc, tmp_path):
    design, report = designed(aso_ftc, tmp_path, PLANT.replace("UP_TO", "0.3"))
    loop = compensated(report)
    unstable = lambda loss: np.linalg.eigvals(closed_loop(design, [loss, 0])[0]).real.max() > 0
    limit, certified = loop["constant"][0], loop["certified"][0]
    value, proven = limit["losses"][0]["value"], certified["losses"][0]["value"]
    assert 0.3 <= proven <= value <= 1
    if not limit["stable"]:
        assert unstable(value + 1e-6) and not unstable(value - 1e-6)


def test_a_stated_loss_that_destabilises_is_red_and_says_from_where_on(aso_ftc, tmp_path):
    """One force against an unstable spring: the loop needs a part of it."""
    text = PLANT.replace("UP_TO", "0.95").replace("[0, 0.3], [1, 0.6]", "[0], [1]").replace(', "u2"', "")
    text = text.replace("R = [1, 1]", "R = [1]")
    design, report = designed(aso_ftc, tmp_path, text)
    loop = compensated(report)
    limit = loop["constant"][0]["losses"][0]["value"]
    assert limit < 0.95 and np.linalg.eigvals(closed_loop(design, [limit + 1e-6])[0]).real.max() > 0
    assert report["verdict"]["level"] == "red" and "unstable" in loop["proof"]["reason"]
    (reason,) = (one for one in report["verdict"]["reasons"] if "loop unstable, compensation on" in one)
    assert f"u1 {limit:.3f}"[:7] in reason and reason.endswith("(red)")


@pytest.mark.parametrize(
    "entry, message",
    [("1.5", "expected a fraction above 0 and at most 1"), ("0", "expected a number above 0"), ('"all"', "up_to")],
)
def test_a_bad_fraction_is_refused_at_its_line(refusal, entry, message):
    error = refusal(PLANT.replace("UP_TO", entry))
    assert message in error and "plant.toml:15:9" in error, error


SENSOR = """
A = [[0, 1], [-2, -0.5]]
B = [[0], [1]]
C = [[1, 0], [0, 1], [1, 0]]
filter = [20.0, 30.0, 25.0]
feedback.eigenvalues = [-2, -3]
observer.eigenvalues = [-6, -7, -8, -9, -10, -11, -12]
robustness.cases = 0

[[faults]]
name = "offset"
sensor = "y1"
bound = 0.2
rate_bound = 0.05

[[faults]]
name = "push"
actuator = "u1"
bound = 1.0
"""


@pytest.mark.parametrize("sampled", ["", "sample_time = 0.02\n"], ids=["continuous", "sampled"])
def test_the_worst_sensor_fault_reaches_the_bounds_of_the_report_and_never_exceeds_them(aso_ftc, tmp_path, sampled):
    """The fault that has the sign of the impulse response, backwards, is the worst one: states, errors, estimates."""
    design, report = designed(aso_ftc, tmp_path, sampled + SENSOR)
    a, b, c, d = closed_loop(design)
    step = design.period or 1e-3
    if design.period is None:
        a, b = zoh(a, b, step)
    names = ["x1", "x2"] + ["filtered"] * 3 + ["error of x1", "error of x2"] + ["filtered"] * 3
    names += ["error of offset", "error of push"]
    bounds = {bound["error"]: bound for bound in report["bounds"] if bound["fault"] == "offset"}
    count = int(8 / step)
    powers, x = [], b[:, 0]
    for _ in range(count):
        powers.append(x)
        x = a @ x
    for row, name in enumerate(names):
        if name == "filtered":
            continue
        response = np.array([c[row] @ x for x in powers])
        # The worst fault as a run of the loop, step by step.
        worst = 0.2 * np.sign(response[::-1])
        x = np.zeros(len(a))
        for value in worst:
            x = a @ x + b[:, 0] * value
        reached = c[row] @ x + 0.2 * abs(d[row, 0])
        bound = 0.2 * bounds[name]["gain_of_fault"]
        assert reached <= bound * (1 + 1e-9), name
        assert reached > (0.98 if design.period is None else 0.7) * bound, name
        assert bounds[name]["largest"] <= bound * (1 + 1e-12), name
