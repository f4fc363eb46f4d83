"""Kalman filters that carry the plant's FMU, beside those of filterpy with the plant's equations by scipy."""

import json
import tomllib
import zipfile

import fmpy
import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from scipy.integrate import solve_ivp

from any_fmu import instance
from design_oracle import WITHOUT_PROOFS
from stepped import instantiated

METHODS = {"extended": 1, "unscented": 2}
T = 5.0
TANKS = """
plant = "{plant}"
sample_time = 5.0
measurements = ["y_1", "y_2", "y_3"]
actuators = ["Q_1", "Q_2"]
actuator_faults = "all"
feedback.bandwidth = 0.012
observer.bandwidth = 0.1
"""
NOISE = "\n[robustness]\nnoise = 0.002\n"


@pytest.fixture(scope="module")
def packed_filter(aso_ftc):
    """The template, where the command looks for it."""
    done = aso_ftc("pack", "fmu-kalman")
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def attempt(aso_ftc, packed_filter, tmp_path_factory):
    """Designs for a plant file; returns what the command did, and the path of the filter."""

    def run(text, *options):
        folder = tmp_path_factory.mktemp("filter")
        (folder / "plant.toml").write_text(text, encoding="utf-8")
        path = folder / "Filter.fmu"
        outputs = ("--out", folder / "design.toml", "--kalman-fmu", path)
        done = aso_ftc("design", folder / "plant.toml", *outputs, *WITHOUT_PROOFS, *options)
        return done, path

    return run


@pytest.fixture(scope="module")
def tanks(attempt, examples):
    """The filter of the three tanks, and its folder."""
    done, path = attempt(TANKS.format(plant=examples["ThreeTank"]) + NOISE)
    assert path.exists(), done.stderr
    return path


def covariances(path):
    with zipfile.ZipFile(path) as archive:
        file = tomllib.loads(archive.read("resources/filter.toml").decode())
    return [np.array(file[name]) for name in "WVP"]


def flow(mu, difference):
    """Torricelli's law for a pipe of 5e-5 m2."""
    return mu * 5e-5 * np.sign(difference) * np.sqrt(2 * 9.81 * abs(difference))


def levels_of(z, u, time):
    """z after `time` in s: levels of tanks of 0.0154 m2, and faults of the pumps, which stay."""

    def slope(_, h):
        q_1, q_2 = np.clip(u + z[3:], 0.0, 1.2e-4)
        q_13, q_32, q_20 = flow(0.5, h[0] - h[2]), flow(0.5, h[2] - h[1]), flow(0.675, h[1])
        return np.array([q_1 - q_13, q_2 + q_32 - q_20, q_13 - q_32]) / 0.0154

    end = solve_ivp(slope, (0, time), z[:3], rtol=1e-11, atol=1e-13).y[:, -1]
    return np.concatenate([end, z[3:]])


def jacobian(function, z):
    """By two-sided differences."""
    columns = []
    for k, size in enumerate([1e-4] * 3 + [1e-8] * 2):
        step = np.zeros(5)
        step[k] = size
        columns.append((function(z + step) - function(z - step)) / (2 * size))
    return np.array(columns).T


def experiment(count):
    """Commands that act from each sample on, and noisy levels at the samples, with faults of both pumps."""
    random = np.random.default_rng(7)
    z, commands, measured = np.array([0.45, 0.2, 0.25, 0.0, 0.0]), [], []
    for k in range(count):
        measured.append(z[:3] + random.normal(0, 0.002, 3))
        commands.append(np.array([4e-5 + 2e-5 * np.sin(k / 9), 3e-5 if k % 40 < 20 else 6e-5]))
        if k == 30:
            z[3:] = [-1e-5, 8e-6]
        z = levels_of(z, commands[-1], T)
    return np.array(commands), np.array(measured)


def by_filterpy(method, path, commands, measured, every=1):
    """With the third level at one of `every` samples."""
    w, v, p = covariances(path)
    initial = np.array([0.4, 0.2, 0.3, 0.0, 0.0])
    output = np.eye(3, 5)
    if method == "extended":
        estimator = ExtendedKalmanFilter(5, 3)
    else:
        points = MerweScaledSigmaPoints(5, alpha=1.0, beta=0.0, kappa=0.0)
        estimator = UnscentedKalmanFilter(5, 3, T, lambda z: z[:3], levels_of, points)
    estimator.x, estimator.P, estimator.Q, estimator.R = initial, p, w, v
    results = []
    for k, y in enumerate(measured):
        if method == "extended":
            if k > 0:

                def advance(z, u=commands[k - 1]):
                    return levels_of(z, u, T)

                estimator.F = jacobian(advance, estimator.x)
                estimator.predict_x = lambda u, advance=advance: setattr(estimator, "x", advance(estimator.x))
                estimator.predict()
            due = slice(None) if k % every == 0 else slice(2)
            estimator.update(y[due], lambda _, due=due: output[due], lambda z, due=due: z[:3][due], R=v[due, due])
        else:
            if k > 0:
                estimator.predict(fx=lambda z, time, u=commands[k - 1]: levels_of(z, u, time))
            # Anew for the predicted estimate, so that they contain the process noise.
            estimator.sigmas_f = points.sigma_points(estimator.x, estimator.P)
            due = slice(None) if k % every == 0 else slice(2)
            estimator.update(y[due], R=v[due, due], hx=lambda z, due=due: z[:3][due])
        squared = estimator.y @ np.linalg.solve(estimator.S, estimator.y)
        results.append(np.concatenate([estimator.x, np.sqrt(np.diag(estimator.P)), [squared]]))
    return np.array(results)


NAMES = [
    *(f"x_hat[{k}]" for k in (1, 2, 3)),
    *(f"f_hat[{k}]" for k in (1, 2)),
    *(f"x_deviation[{k}]" for k in (1, 2, 3)),
    *(f"f_deviation[{k}]" for k in (1, 2)),
    "innovation_squared",
]


def by_the_fmu(method, path, folder, commands, measured, parts=1, every=1):
    """The outputs at the samples; each sample is `parts` communication steps."""
    start = {f"x_hat_0[{k + 1}]": x for k, x in enumerate([0.4, 0.2, 0.3])}
    settings = {"method": METHODS[method], "integration_steps": 20, "every[3]": every, **start}
    with instance(path, folder, settings) as (slave, variables):

        def references(names):
            return [variables[name].valueReference for name in names]

        inputs, outputs = references(["y_1", "y_2", "y_3", "Q_1", "Q_2"]), references(NAMES)
        # Sample 0 belongs to the initialisation, whose measurements are those of the operating point.
        rows = [slave.getReal(outputs)]
        for k in range(1, len(measured)):
            slave.setReal(inputs, [*measured[k], *commands[k - 1]])
            for part in range(parts):
                step = T / parts
                slave.doStep(currentCommunicationPoint=(k - 1) * T + part * step, communicationStepSize=step)
            rows.append(slave.getReal(outputs))
    return np.array(rows)


@pytest.fixture(scope="module")
def record():
    commands, measured = experiment(120)
    measured[0] = [0.4, 0.2, 0.3]
    return commands, measured


@pytest.mark.parametrize("every", [1, 4])
@pytest.mark.parametrize("method", METHODS)
def test_the_estimates_and_their_deviations_are_those_of_filterpy(tanks, tmp_path, record, method, every):
    """Also if one of the levels is measured at one of four samples only."""
    commands, measured = record
    estimates = by_the_fmu(method, tanks, tmp_path, commands, measured, every=every)
    theirs = by_filterpy(method, tanks, commands, measured, every=every)
    scale = np.abs(theirs).max(axis=0)
    assert np.abs((estimates - theirs) / scale).max() < 1e-6


def test_communication_steps_within_a_sample_change_nothing(tanks, tmp_path, record):
    commands, measured = record
    one, several = (by_the_fmu("extended", tanks, tmp_path / str(n), commands, measured, n) for n in (1, 5))
    assert np.abs((one - several) / np.abs(one).max(axis=0)).max() < 1e-12


def test_the_filter_is_consistent_with_its_noise(tanks, tmp_path):
    """With the noise and the walks of W and V, the mean of the squared innovation is the number of measurements."""
    w, v, _ = covariances(tanks)
    random = np.random.default_rng(1)
    z, commands, measured = np.array([0.4, 0.2, 0.3, 0.0, 0.0]), [], []
    for _ in range(800):
        measured.append(z[:3] + random.multivariate_normal(np.zeros(3), v))
        commands.append(np.array([3.5e-5, 3.2e-5]) - 0.5 * (z[:2] - [0.4, 0.2]) * 1e-3)
        z = levels_of(z, commands[-1], T) + random.multivariate_normal(np.zeros(5), w)
    for method in METHODS:
        squared = by_the_fmu(method, tanks, tmp_path / method, np.array(commands), np.array(measured))[20:, -1]
        # 780 values of chi-squared with 3 degrees of freedom: the mean has the deviation sqrt(6 / 780) = 0.088.
        assert abs(squared.mean() - 3) < 4 * 0.088, method


SERVO = """
plant = "{plant}"
operating_point = {{ friction = 0 }}
sample_time = 0.001
actuators = ["u"]
measurements = ["theta_m"]
actuator_faults = "all"
feedback.bandwidth = 30
observer.bandwidth = 200
robustness.noise = 1e-4
"""


def results_of(aso_ftc, folder, fmus, links, settings, stop):
    """The columns of a run of FMUs with a communication step of 1 ms; the first one is the time."""
    text = "[fmus]\n" + "".join(f'{name} = "{fmu}"\n' for name, fmu in fmus.items())
    text += "".join(f'[[connections]]\nfrom = "{start}"\nto = "{end}"\n' for start, end in links)
    text += "[settings]\n" + "".join(f'"{name}" = {value}\n' for name, value in settings.items())
    text += f'[algorithm]\nstep = 0.001\nextrapolation = "hold"\n[experiment]\nstop-time = {stop}\n'
    (folder / "system.toml").write_text(text, encoding="utf-8")
    done = aso_ftc("run", folder / "system.toml", "--results", folder / "results.csv")
    assert done.returncode == 0, done.stderr
    return np.genfromtxt(folder / "results.csv", delimiter=",", names=True, dtype=None, encoding=None, deletechars="")


@pytest.mark.parametrize("method", METHODS)
def test_for_a_linear_plant_the_estimates_are_those_of_the_designed_observer(attempt, aso_ftc, examples, method):
    """Whose gain is that of the stationary Kalman filter, with which the filter starts."""
    text = SERVO.format(plant=examples["DcServo"])
    done, path = attempt(text, "--fmu", (controller := examples["DcServo"].parent / f"{method}.fmu"))
    assert path.exists(), done.stderr
    fmus = {"plant": examples["DcServo"], "filter": path, "controller": controller}
    links = [("plant.theta_m", "filter.theta_m"), ("plant.theta_m", "controller.theta_m")]
    links += [("controller.u", "plant.u"), ("controller.u", "filter.u")]
    settings = {"plant.friction": 0, "plant.theta": 0.3, "filter.method": f'"{method}"'}
    table = results_of(aso_ftc, path.parent, fmus, links, settings, 0.3)
    for name in ("f_hat", *(f"x_hat[{k}]" for k in (1, 2))):
        theirs, estimates = (table[f"{one}.{name}"].astype(float) for one in ("controller", "filter"))
        assert np.abs(theirs).max() > 0
        assert np.abs(estimates - theirs).max() < 1e-6 * np.abs(theirs).max(), name


@pytest.fixture(scope="module")
def servo(attempt, tmp_path_factory):
    """Makes the FMUs of a plant file for the servo: the filter, the controllers with and without observer."""

    def design(text):
        folder = tmp_path_factory.mktemp("controllers")
        paths = {name: folder / f"{name}.fmu" for name in ("controller", "feedback")}
        options = ["--fmu", paths["controller"], "--feedback-fmu", paths["feedback"]]
        done, paths["filter"] = attempt(text, *options)
        assert all(path.exists() for path in paths.values()), done.stderr
        return paths

    return design


FROM_THE_FILTER = [("plant.theta_m", "filter.theta_m"), ("filter.x_hat[1]", "feedback.x_filter[1]")]
FROM_THE_FILTER += [("filter.x_hat[2]", "feedback.x_filter[2]"), ("filter.f_hat", "feedback.f_filter")]
FROM_THE_FILTER += [("feedback.u", "plant.u"), ("feedback.u", "filter.u")]


VARIANTS = {
    "regulator": ("", ""),
    "t_on": ("t_on = 0.1\nmonitor = true", ""),
    "reference": ("", '[reference]\ntrack = ["theta_m"]'),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_linear_plant_moves_alike_with_the_filter_and_with_the_observer(servo, aso_ftc, examples, tmp_path, variant):
    """With a friction, which acts like a fault; the reference is large enough to overcome it."""
    before, after = VARIANTS[variant]
    paths = servo(before + SERVO.format(plant=examples["DcServo"]) + after)
    settings = {"plant.friction": "true", "plant.theta": 0.3}
    angles, with_reference = [], variant == "reference"
    for name in ("controller", "feedback"):
        links = [("plant.theta_m", "controller.theta_m"), ("controller.u", "plant.u")]
        fmus = {"plant": examples["DcServo"], "controller": paths["controller"]}
        if name == "feedback":
            links = [*FROM_THE_FILTER, *([("plant.theta_m", "feedback.theta_m")] if with_reference else [])]
            fmus = {"plant": examples["DcServo"], "filter": paths["filter"], "feedback": paths["feedback"]}
        reference = {f"{name}.r_theta_m": 3} if with_reference else {}
        table = results_of(aso_ftc, tmp_path, fmus, links, settings | reference, 0.4)
        angles.append(table["plant.theta_m"].astype(float))
    assert np.ptp(angles[0]) > 0.1
    assert np.abs(angles[0] - angles[1]).max() < 1e-6


def test_a_sensor_of_every_seventh_sample_gives_the_loop_of_the_periodic_kalman_filter(servo, aso_ftc, examples, tmp_path):
    """That of numpy, for the sampled plant of the design, with its gains."""
    paths = servo(SERVO.format(plant=examples["DcServo"]))
    fmus = {"plant": examples["DcServo"], "filter": paths["filter"], "feedback": paths["feedback"]}
    settings = {"plant.friction": 0, "plant.theta": 0.3, "filter.every": 7}
    table = results_of(aso_ftc, tmp_path, fmus, FROM_THE_FILTER, settings, 0.4)
    with zipfile.ZipFile(paths["controller"]) as archive:
        design = tomllib.loads(archive.read("resources/design.toml").decode())
    a, b, c, f_a, k_x, k_f = (np.array(design[name]) for name in ("A", "B", "C", "F_a", "K_x", "K_f"))
    w, v, p = covariances(paths["filter"])
    n = len(a)
    a_0 = np.block([[a, f_a], [np.zeros((1, n)), np.eye(1)]])
    c_0 = np.hstack([c, np.zeros((1, 1))])
    b_0 = np.vstack([b, np.zeros((1, 1))])
    x, z, commands = np.array([0.3, 0.0]), np.zeros(n + 1), []
    for k in range(len(table)):
        if k % 7 == 0:
            gain = p @ c_0.T / (c_0 @ p @ c_0.T + v)
            z, p = z + gain @ (c @ x - c_0 @ z), (np.eye(n + 1) - gain @ c_0) @ p
        u = k_x @ z[:n] + k_f @ z[n:]
        commands.append(u[0])
        x, z, p = a @ x + b @ u, a_0 @ z + b_0 @ u, a_0 @ p @ a_0.T + w
    actual = table["feedback.u"].astype(float)
    assert np.abs(actual - commands).max() < 1e-5 * np.abs(commands).max()


DETECTION = """
[detection]
method = "cusum"
false_alarm_interval = 1e6
noise = 0.002
sizes = { f_Q_1 = 1e-5, f_Q_2 = 1e-5 }
"""


def test_a_controller_without_observer_has_no_decisions_on_faults(attempt, examples, tmp_path):
    text = TANKS.format(plant=examples["ThreeTank"]) + NOISE + DETECTION
    done, path = attempt(text, "--feedback-fmu", tmp_path / "Feedback.fmu")
    assert (done.returncode, path.exists()) == (2, False)
    assert "no controller for the estimates of the Kalman filter" in done.stderr
    assert "a plant file without [detection]" in done.stderr


def test_far_from_the_operating_point_the_filters_take_no_nonlinearity_for_a_fault(root, aso_ftc, packed_filter, python):
    """The last row of each plant in the table of docs/how-to/nonlinear.md."""
    done = python(root / "scripts/study/nonlinear_filters.py", "--json", "--last")
    assert done.returncode == 0, done.stderr
    page = (root / "docs/how-to/nonlinear.md").read_text(encoding="utf-8")
    rows = json.loads(done.stdout)
    assert len(rows) == 3
    for name, _, errors in rows:
        part = 0.75 if "turbine" in name else 0.02
        assert max(errors["extended"], errors["unscented"]) < part * errors["observer"], name
        assert f"| {name} |" in page
        assert f"| {errors['observer']:.2g} |" in page, name


REFUSALS = {
    "sample_time = 5.0\n": ("", "it needs a `sample_time`"),
    "observer.bandwidth = 0.1": ("observer.eigenvalues = [-0.1, -0.11, -0.12, -0.13, -0.14]", "follows from no noise"),
    "noise = 0.002": ("", "`robustness.noise`, the standard deviation of each measurement"),
    'measurements = ["y_1", "y_2", "y_3"]': (
        'measurements = [{ name = "y_1", delay = 5 }, "y_2", "y_3"]',
        "it has no `delay` and no `structure`",
    ),
}


def test_the_description_states_the_noise_that_the_filter_assumes(tanks):
    """With a bandwidth, the noise of the file is the geometric mean of what the filter assumes."""
    _, v, _ = covariances(tanks)
    stated = fmpy.read_model_description(str(tanks)).description.split("assumed standard deviations: ")[1]
    names, values, units = zip(*(signal.split() for signal in stated.split(", ")), strict=True)
    assert names == ("y_1", "y_2", "y_3") and set(units) == {"m"}
    np.testing.assert_allclose(np.array(values, float), np.sqrt(np.diag(v)), rtol=1e-4)
    np.testing.assert_allclose(np.prod(np.diag(v)) ** (1 / 6), 0.002, rtol=1e-6)


@pytest.mark.parametrize("entry", REFUSALS)
def test_what_the_filter_cannot_have_is_refused_with_its_line(attempt, examples, entry):
    text = TANKS.format(plant=examples["ThreeTank"]) + NOISE
    other, reason = REFUSALS[entry]
    done, path = attempt(text.replace(entry, other))
    assert (done.returncode, path.exists()) == (2, False)
    assert "no Kalman filter with the plant's FMU: " in done.stderr
    assert reason in done.stderr
    assert "plant.toml:" in done.stderr


def test_a_plant_with_events_that_cannot_save_its_state_is_refused(attempt, examples, tmp_path):
    plain = tmp_path / "Plain.fmu"
    with zipfile.ZipFile(examples["DcServo"]) as archive, zipfile.ZipFile(plain, "w") as other:
        for name in archive.namelist():
            other.writestr(name, archive.read(name).replace(b'canGetAndSetFMUstate="true"', b""))
    done, path = attempt(SERVO.format(plant=plain))
    assert (done.returncode, path.exists()) == (2, False)
    assert "no estimator can carry DcServo: it lacks canGetAndSetFMUstate" in done.stderr


def test_a_plant_of_matrices_is_refused(attempt):
    done, path = attempt('A = [[-1]]\nB = [[1]]\nC = [[1]]\nactuator_faults = "all"\nsample_time = 0.1\n')
    assert (done.returncode, path.exists()) == (2, False)
    assert '`plant = "NAME.fmu"` states an FMU' in done.stderr


def test_a_plant_that_cannot_save_its_state_gives_the_same_estimates(attempt, aso_ftc, root, tmp_path):
    """If it has no events."""
    done = aso_ftc("pack", root / "tests/models/rotor", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    plain = tmp_path / "Plain.fmu"
    with zipfile.ZipFile(tmp_path / "Rotor.fmu") as archive, zipfile.ZipFile(plain, "w") as other:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "modelDescription.xml":
                content = content.replace(b'canGetAndSetFMUstate="true"', b'canGetAndSetFMUstate="false"')
                content = content.replace(b'canSerializeFMUstate="true"', b'canSerializeFMUstate="false"')
            other.writestr(name, content)
    text = (
        'plant = "{}"\noperating_point = {{ omega_r = 1.67, omega_g = 158.6, tau_g = 30527, twist = 1.3e-3 }}\n'
        'sample_time = 0.05\nactuators = ["tau_g", "beta"]\nmeasurements = ["omega_r", "omega_g"]\n'
        "feedback.bandwidth = 0.1\nobserver.bandwidth = 1\nrobustness.noise = [0.025, 0.05]\n"
        '[[faults]]\nname = "wind"\ninput = "v"\n'
    )
    rows = []
    for plant in (tmp_path / "Rotor.fmu", plain):
        done, path = attempt(text.format(plant))
        assert path.exists(), done.stderr
        with instance(path, tmp_path / plant.stem, {"method": METHODS["unscented"]}) as (slave, variables):
            inputs = [variables[name].valueReference for name in ("omega_r", "omega_g", "tau_g", "beta")]
            outputs = [variables[name].valueReference for name in ("x_hat[1]", "x_hat[3]", "f_hat", "innovation_squared")]
            for k in range(50):
                slave.setReal(inputs, [1.67 + 1e-3 * k, 158.6 + 0.095 * k, 3e4, 0.0])
                slave.doStep(currentCommunicationPoint=k * 0.05, communicationStepSize=0.05)
            rows.append(slave.getReal(outputs))
    assert rows[0] == rows[1]


def test_the_template_names_the_command_that_gives_it_a_plant(aso_ftc, packed_filter, root):
    done = aso_ftc("check", root / "dist/KalmanFilter.fmu")
    assert "aso-ftc design PLANT.toml --kalman-fmu FILTER.fmu" in done.stdout + done.stderr


def test_a_saved_state_repeats_the_estimates(tanks, tmp_path, record):
    """In this instance, and as bytes in others, which have other instances of the plant: initialised, and only instantiated."""
    commands, measured = record
    settings = {"method": METHODS["unscented"]}

    def samples(slave, variables, numbers):
        inputs = [variables[name].valueReference for name in ("y_1", "y_2", "y_3", "Q_1", "Q_2")]
        outputs = [variables[name].valueReference for name in NAMES]
        rows = []
        for k in numbers:
            slave.setReal(inputs, [*measured[k], *commands[k - 1]])
            slave.doStep(currentCommunicationPoint=(k - 1) * T, communicationStepSize=T)
            rows.append(slave.getReal(outputs))
        return rows

    with instance(tanks, tmp_path / "one", settings) as (one, variables):
        samples(one, variables, range(1, 10))
        state = one.getFMUstate()
        data = one.serializeFMUstate(state)
        expected = samples(one, variables, range(10, 20))
        one.setFMUstate(state)
        assert samples(one, variables, range(10, 20)) == expected
        one.freeFMUstate(state)
    with instance(tanks, tmp_path / "other", settings) as (other, variables):
        state = other.deSerializeFMUstate(data)
        other.setFMUstate(state)
        assert samples(other, variables, range(10, 20)) == expected
        other.freeFMUstate(state)
    new, variables = instantiated(tanks, tmp_path / "new")
    state = new.deSerializeFMUstate(data)
    new.setFMUstate(state)
    assert samples(new, variables, range(10, 20)) == expected
    new.freeFMUstate(state)
    new.freeInstance()


def test_a_bias_of_a_sensor_is_estimated(attempt, examples, tmp_path):
    """Beside a pump that is right: the levels tell a wrong level from water that is missing."""
    text = TANKS.format(plant=examples["ThreeTank"]).replace('actuator_faults = "all"', "filter = 0.5")
    text += '\n[[faults]]\nname = "bias"\nsensor = "y_1"\n' + NOISE
    done, path = attempt(text)
    assert path.exists(), done.stderr
    z, measured, commands = np.array([0.55, 0.2, 0.25, 0.0, 0.0]), [], []
    count = 1200
    for _ in range(count):
        measured.append(z[:3] + [0.01, 0.0, 0.0])
        commands.append(np.array([3.5e-5, 3e-5]))
        z = levels_of(z, commands[-1], T)
    with instance(path, tmp_path) as (slave, variables):
        inputs = [variables[name].valueReference for name in ("y_1", "y_2", "y_3", "Q_1", "Q_2")]
        for k in range(1, count):
            slave.setReal(inputs, [*measured[k], *commands[k - 1]])
            slave.doStep(currentCommunicationPoint=(k - 1) * T, communicationStepSize=T)
        (bias,) = slave.getReal([variables["f_hat"].valueReference])
    assert abs(bias - 0.01) < 1e-5
