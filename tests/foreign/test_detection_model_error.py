"""`model_error` of `[detection]`: plants within the tolerances, driven by the worst commands, give no false alarms by
their errors; by numpy and scipy, from the design file alone. What stands beside `[detection]` in a plant file."""

import itertools
import subprocess
import tomllib

import numpy as np
import pytest
import scipy.linalg

from conftest import ROOT
from design_loop import packed_plant
from matrices import zoh
from split_mix import uniform
from stepped import Stepped
from test_detection import COMMAND, DETECTION, PLANT, Filter, T, designed, noise

SIZE = np.array([0.5, 0.4])
TOLERANCE = 0.05
COMMANDS = f"model_error = 1.0\ncommands = {{ u1 = {SIZE[0]}, u2 = {SIZE[1]} }}\n[robustness]\ntolerance = {TOLERANCE}\n"
# With an oscillating mode.
OSCILLATING = PLANT.replace("[0.0, 0.0, 0.1, -1.0]", "[0.0, 0.0, -20.0, -1.0]")


def text(method, sampled, plant=PLANT, extra=""):
    head = f"sample_time = {T}\n" if sampled else ""
    return head + plant + extra + DETECTION + f'method = "{method}"\nisolation = {str(method == "cusum").lower()}\n' + COMMANDS


def matrices(plant=PLANT):
    return [np.array(tomllib.loads(plant)[name], dtype=float) for name in "ABC"]


def sizes(plant=PLANT):
    """The largest errors of the entries; those of x_i' = x_j and of y_i = x_j are exact."""
    a, b, c = matrices(plant)
    unit = lambda row: np.count_nonzero(row) == 1 and row.max() == 1.0
    exact = [[unit(row) and not b[i].any() for i, row in enumerate(a)], [False] * len(b), [unit(row) for row in c]]
    return [TOLERANCE * np.abs(m) * ~np.array(rows)[:, None] for m, rows in zip((a, b, c), exact, strict=True)]


def worst(value, plant, generator):
    """The largest of a value over the corners of the tolerances, by flips of one entry, from several corners on."""
    sizes_, peak = sizes(plant), -np.inf
    for _ in range(4):
        signs = [np.sign(generator.standard_normal(size.shape)) for size in sizes_]
        at = lambda: value([m + s * size for m, s, size in zip(matrices(plant), signs, sizes_, strict=True)])
        largest, better = at(), True
        while better:
            better = False
            for sign, size in zip(signs, sizes_, strict=True):
                for place in zip(*np.nonzero(size), strict=True):
                    sign[place] *= -1
                    if (flipped := at()) > largest:
                        largest, better = flipped, True
                    else:
                        sign[place] *= -1
        peak = max(peak, largest)
    return peak


def perturbed(generator, plant=PLANT):
    """A plant whose entries are at their limits or within them."""
    corner = generator.random() < 0.7
    part = lambda shape: np.sign(generator.standard_normal(shape)) if corner else generator.uniform(-1, 1, shape)
    return [m + part(m.shape) * size for m, size in zip(matrices(plant), sizes(plant), strict=True)]


def means(detector, plant, period, samples):
    """The effect of a command in one sample on the tested residuals of later samples: samples x residuals x commands.

    A continuous filter is simulated with commands held over `period` s; its residuals are integrals over such times
    divided by the root of the period."""
    a, b, c = plant
    n, k, q = len(a), len(detector.a), len(detector.c)
    whole = np.block(
        [[a, np.zeros((n, k + q))], [detector.b_y @ c, detector.a, np.zeros((k, q))], [detector.d_y @ c, detector.c, np.zeros((q, q))]]
    )
    column = np.vstack([b, detector.b_u, detector.d_u])
    if period is None:
        phi, gamma = zoh(a, b, T)
        whole = np.block([[phi, np.zeros((n, k))], [detector.b_y @ c, detector.a]])
        column, read = np.vstack([gamma, detector.b_u]), np.hstack([detector.d_y @ c, detector.c])
        first = detector.d_u
    else:
        step, entry = zoh(whole, column, period)
        whole, read = np.split(step[:, : n + k], [n + k])
        column, first = np.split(entry, [n + k])
        read, first = read / np.sqrt(period), first / np.sqrt(period)
    effects = [first]
    for _ in range(samples):
        effects.append(read @ column)
        column = whole @ column
    return np.array(effects)


@pytest.mark.parametrize("plant", [PLANT, OSCILLATING])
@pytest.mark.parametrize(("method", "sampled"), [("cusum", True), ("cusum", False), ("chi-square", True)])
def test_no_plant_within_the_tolerances_has_a_larger_mean_and_the_bound_is_near(tmp_path, method, sampled, plant):
    report, file = designed(tmp_path, text(method, sampled, plant))
    detector = Filter(file["detection"])
    generator = np.random.default_rng(3)

    def reached(plant_):
        effects = means(detector, plant_, None if sampled else report["sample_time"], 250)
        # The worst commands have the signs of the effects: each residual by itself.
        each = np.abs(effects).sum(axis=0) @ SIZE
        rows = np.split(each, np.cumsum([test["residuals"] for test in detector.tests])[:-1])
        return np.array([np.linalg.norm(row) for row in rows])

    stated = np.array([test["model_error"] for test in report["tests"]])
    for _ in range(25):
        largest = reached(perturbed(generator, plant))
        assert (largest <= stated).all(), (largest, stated)
    for k, bound in enumerate(stated):
        largest = worst(lambda plant_: reached(plant_)[k], plant, generator)
        assert largest <= bound < 1.5 * largest, (k, bound / largest)


def test_the_worst_commands_give_no_more_alarms_than_the_noise_alone_may(tmp_path):
    report, file = designed(tmp_path, text("cusum", True))
    detector = Filter(file["detection"])
    generator = np.random.default_rng(5)
    drifts, thresholds = (np.array([test[name] for test in detector.tests]) for name in ("drift", "threshold"))
    bias = np.array([test["model_error"] for test in report["tests"]])
    plants = [perturbed(generator) for _ in range(50)]
    steady = [means(detector, plant, None, 100).sum(axis=0) for plant in plants]
    root_w, root_v = (np.sqrt(np.diag(covariance)) for covariance in noise())
    runs, samples = 500, 400
    allowed = 1.0 - np.exp(-samples * T / 200.0)
    for test in range(2):
        at = np.argmax([np.abs(one[test]) @ SIZE for one in steady])
        a, b, c = plants[at]
        phi, gamma = zoh(a, b, T)
        # A constant command that moves the mean of this residual as far as it can.
        u = SIZE * np.sign(steady[at][test])
        x, x_r = np.zeros((runs, 4)), np.zeros((runs, len(detector.a)))
        sums, simple = np.zeros((2, runs, 2)), np.zeros((2, runs, 2))
        over = np.zeros((2, runs), dtype=bool)
        for _ in range(samples):
            y = x @ c.T + root_v * generator.standard_normal((runs, 3))
            r = x_r @ detector.c.T + detector.d_u @ u + y @ detector.d_y.T
            x_r = x_r @ detector.a.T + detector.b_u @ u + y @ detector.b_y.T
            x = x @ phi.T + gamma @ u + root_w * generator.standard_normal((runs, 4))
            both = np.array([r, -r])
            sums, simple = np.maximum(0.0, sums + both - drifts), np.maximum(0.0, simple + both - (drifts - bias))
            over |= np.array([(one > thresholds).any(axis=(0, 2)) for one in (sums, simple)])
        alarms, without_allowance = over.mean(axis=1)
        assert alarms <= allowed and without_allowance > 2.0 * allowed, (alarms, without_allowance, allowed)


TANK = """
plant = "{fmu}"
sample_time = 1.0
operating_point = {{ Q_1 = 3e-5, Q_2 = 2e-5, h_1 = {levels[0]}, h_2 = {levels[1]}, h_3 = {levels[2]} }}
measurements = ["y_1", "y_2", "y_3"]
actuators = [{{ name = "Q_1" }}, {{ name = "Q_2" }}]
actuator_faults = "all"
feedback.eigenvalues = [-0.03, -0.035, -0.04]
observer.eigenvalues = [-0.06, -0.07, -0.08, -0.1, -0.12]
[robustness]
parameters = {{ mu_13 = 0.02, mu_32 = 0.02, mu_20 = 0.02 }}
[detection]
method = "cusum"
false_alarm_interval = 3000.0
noise = 2e-3
sizes = {{ f_Q_1 = 1e-5, f_Q_2 = 1e-5 }}
from = 0.0
model_error = 1.2
commands = {{ Q_1 = 2e-6, Q_2 = 2e-6 }}
"""


def test_tanks_with_other_pipes_stay_below_the_bound_though_their_levels_at_rest_differ(aso_ftc, tmp_path):
    """The nonlinear equations of the tanks; at the operating point tanks with other pipes are not at rest."""
    area, pipe, twice_g, nominal = 0.0154, 5e-5, 2 * 9.81, np.array([0.5, 0.5, 0.675])
    q = np.array([3e-5, 2e-5])
    flow = lambda mu, drop: mu * pipe * np.sign(drop) * np.sqrt(twice_g * np.abs(drop))
    drops = np.array([q[0], q[0], q.sum()]) ** 2 / (nominal * pipe) ** 2 / twice_g
    start = np.array([drops.sum(), drops[2], drops[1] + drops[2]])
    fmu = packed_plant(aso_ftc, "ThreeTank")
    report, file = designed(tmp_path, TANK.format(fmu=fmu, levels=list(start)))
    detector = Filter(file["detection"])
    largest = np.zeros(2)
    # The corners of the limits, and random cases within: the first ones of those that the report counts.
    number = uniform(report["parameter_cases"]["seed"])
    within = [[2 * next(number) - 1 for _ in range(3)] for _ in range(15)]
    for part in [*itertools.product([-1, 1], repeat=3), *within]:
        mu = nominal * (1 + 0.02 * np.array(part))
        for command in ([-2e-6, 2e-6], [2e-6, 2e-6], [-2e-6, -2e-6]):
            h, x_r, u = start.copy(), np.zeros(len(detector.a)), np.array(command)
            for _ in range(700):
                r = detector.c @ x_r + detector.d_u @ u + detector.d_y @ (h - start)
                x_r = detector.a @ x_r + detector.b_u @ u + detector.b_y @ (h - start)
                for _ in range(2):
                    q_13, q_32, q_20 = flow(mu, np.array([h[0] - h[2], h[2] - h[1], h[1]]))
                    inflow = q + u
                    h = h + 0.5 / area * np.array([inflow[0] - q_13, inflow[1] + q_32 - q_20, q_13 - q_32])
                largest = np.maximum(largest, np.abs(r))
    stated = np.array([test["model_error"] for test in report["tests"]])
    assert (largest <= stated).all() and (stated < 1.2 * 1.1 * largest).all(), (largest, stated)
    # Of 200 cases all miss a part of the box with probability 0.01.
    missed = report["parameter_cases"]["uncovered"]
    assert report["parameter_cases"]["cases"] == 200 and (1 - missed) ** 200 == pytest.approx(0.01)
    assert all(test["interior_excess"] == pytest.approx(0, abs=0.01) for test in report["tests"])


FAMILY = """
[[family]]
A = [[-0.55, 0.2, 0.0, 0.0], [0.1, -0.42, 0.3, 0.0], [0.0, 0.1, -0.8, 0.2], [0.0, 0.0, 0.1, -1.0]]
"""


def test_a_member_of_a_family_stays_below_the_bound(tmp_path):
    report, file = designed(tmp_path, text("cusum", True, extra=FAMILY).replace(f"tolerance = {TOLERANCE}", "tolerance = 0.0"))
    a, b, c = matrices()
    a[0, 0], a[1, 1] = -0.55, -0.42
    detector = Filter(file["detection"])
    each = np.abs(means(detector, (a, b, c), None, 250)).sum(axis=0) @ SIZE
    stated = np.array([test["model_error"] for test in report["tests"]])
    assert (each <= stated).all() and (stated < 1.05 * each).all(), (each, stated)


SCHEDULE = """
[schedule]
variable = "y1"
[[schedule.points]]
at = 0.0
[[schedule.points]]
at = 1.0
A = [[-0.55, 0.2, 0.0, 0.0], [0.1, -0.4, 0.3, 0.0], [0.0, 0.1, -0.8, 0.2], [0.0, 0.0, 0.1, -1.0]]
"""


@pytest.mark.parametrize(("extra", "change", "sentence"), [
    (SCHEDULE, ("", ""), "expected no [schedule] with [detection]"),
    (FAMILY, (COMMANDS, ""), "the other plants of [[family]] would give false alarms: expected `model_error`"),
    ("", (f"u2 = {SIZE[1]}", ""), "expected `limits` of the actuator `u2`, or commands.u2"),
    ("", (f"tolerance = {TOLERANCE}", "tolerance = 0.9"), "the tolerances of [robustness] are too large for a bound"),
    ("", ("[[-0.5, 0.2", "[[0.5, 0.2"), "bounded only if the plant is stable without the controller"),
    ("", ("model_error = 1.0", "model_error = 0.9"), "expected a factor from 1, found 0.9"),
    ("", ("model_error = 1.0\n", ""), "it belongs to `model_error`"),
])
def test_what_detection_does_not_allow_for_is_refused_at_its_line(tmp_path, extra, change, sentence):
    whole = text("cusum", True, extra=extra)
    assert whole.count(change[0]) == 1 or change[0] == ""
    (tmp_path / "plant.toml").write_text(whole.replace(*change), encoding="utf-8")
    run = subprocess.run([COMMAND, "design", "plant.toml"], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 2 and sentence in run.stderr and "plant.toml:" in run.stderr, run.stderr


REFERENCE = ('[reference]\ntrack = ["y1"]\n', ("[-1.0, -1.2, -1.4, -1.6]", "[-1.0, -1.1, -1.2, -1.4, -1.6]"))
GONE = ('[reconfiguration]\nactuators = "all"\nstuck_at = { u1 = 0.3 }\n', ("", ""))


@pytest.mark.parametrize(("extra", "change"), [REFERENCE, GONE], ids=["reference", "reconfiguration"])
@pytest.mark.parametrize("sampled", [True, False])
def test_residuals_follow_the_commands_that_are_applied(tmp_path, extra, change, sampled):
    plant_file = text("cusum", sampled, extra=extra).replace(*change)
    (tmp_path / "plant.toml").write_text(plant_file, encoding="utf-8")
    files = ("--fmu", "Detecting.fmu", "--from", ROOT / "dist/AsoController.fmu", "--certificate-time", "0")
    run = subprocess.run([COMMAND, "design", "plant.toml", *files], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    section = tomllib.loads((tmp_path / "plant-design.toml").read_text("utf-8"))["detection"]
    period = section.get("sample_time", T)
    names = ["u1", "u2", "residual[1]", "residual[2]"]
    fmu = Stepped(tmp_path / "Detecting.fmu", tmp_path / "unpacked")
    # Measurements held over a step; the filter of the design file by scipy, with the commands of the FMU.
    detector, generator = Filter(section), np.random.default_rng(2)
    step = 0.001 if not sampled else T
    state, integral, due, residuals, expected = np.zeros(len(detector.a)), np.zeros(2), period, [], []
    k = len(detector.a)
    both = np.hstack([detector.b_u, detector.b_y]), np.hstack([detector.d_u, detector.d_y])
    whole = np.block([[detector.a, np.zeros((k, 2)), both[0]], [detector.c, np.zeros((2, 2)), both[1]], [np.zeros((5, k + 7))]])
    held = scipy.linalg.expm(whole * step)
    y, commands = np.zeros(3), []
    for at in range(40 if sampled else 2000):
        if at % (1 if sampled else 100) == 0:
            y = 0.1 * generator.standard_normal(3)
        fmu.set_reals(("y1", "y2", "y3"), y)
        if "reference" in extra:
            fmu.set("r_y1", 0.4)
        elif at >= (10 if sampled else 500):
            fmu.set("actuator_gone[1]", True)
        before = fmu.get(*names[:2])
        fmu.step(at * step, step)
        values = fmu.get(*names)
        u = values[:2] if sampled else 0.5 * (before + values[:2])
        commands.append(values[:2])
        if sampled:
            # The sample at the start is not tested; that at the end of this step has the new commands.
            expected.append(detector.c @ state + detector.d_u @ u + detector.d_y @ y)
            state = detector.a @ state + detector.b_u @ u + detector.b_y @ y
            residuals.append(values[2:])
            continue
        moved = held @ np.concatenate([state, integral, u, y])
        state, integral = moved[:k], moved[k : k + 2]
        if (at + 1) * step > due - 1e-9:
            residuals.append(values[2:])
            expected.append(integral / np.sqrt(period))
            integral, due = np.zeros(2), due + period
    fmu.close()
    residuals, expected = np.array(residuals), np.array(expected)
    assert np.ptp(np.array(commands), axis=0).min() > 0.1, "the commands move"
    assert np.abs(residuals).max() > 1.0 and np.abs(residuals - expected).max() < (1e-9 if sampled else 0.02) * np.abs(residuals).max()
