"""Scheduled controllers: the FMU beside an own recursion in numpy, and the report's certificates computed again."""

import json
import tomllib
from ctypes import byref

import numpy as np
import pytest
from fmpy import extract, simulate_fmu

from c_abi import MODEL_EXCHANGE, OK, WARNING, EventInfo, Fmu, Instance
from excitation import restore, serialized

MATRICES = ["A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f"]
LISTS = ["x_op", "u_op", "y_op"]
SIGNALS = ["x_hat[1]", "x_hat[2]", "x_hat[3]", "f_hat[1]", "f_hat[2]", "Q_1", "Q_2", "schedule_at"]

# A drive whose inertia is between 1 and 3 and known to the importer.
DRIVE = """sample_time = 0.02
A = [[0, 1], [0, -0.5]]
B = [[0], [1]]
C = [[1, 0]]
states = ["phi", "w"]
actuators = ["torque"]
measurements = ["angle"]
actuator_faults = "all"
feedback.eigenvalues = [-3.0, -4.0]
observer.eigenvalues = [-12.0, -14.0, -16.0]

[schedule]
variable = "inertia"
unit = "kg.m2"

[[schedule.points]]
at = 1.0

[[schedule.points]]
at = 2.0
A = [[0, 1], [0, -0.25]]
B = [[0], [0.5]]

[[schedule.points]]
at = 3.0
A = [[0, 1], [0, -0.16666666666666667]]
B = [[0], [0.3333333333333333]]
"""


class Design:
    """A scheduled design file: interpolation and recursion."""

    def __init__(self, text):
        design = tomllib.loads(text)
        self.period, self.current = design["sample_time"], design["estimator"] == "current"
        self.points = design["schedule"]["points"]
        self.at = [point["at"] for point in self.points]
        free = [-np.inf, np.inf]
        self.limits = np.transpose([actuator.get("limits", free) for actuator in design["actuators"]])

    def numbers(self, value):
        """Matrices and operating point at a value of the scheduling variable."""
        value = min(max(value, self.at[0]), self.at[-1])
        k = min(np.searchsorted(self.at, value, side="right"), len(self.at) - 1) - 1
        t = (value - self.at[k]) / (self.at[k + 1] - self.at[k])
        low, high = self.points[k], self.points[k + 1]
        mix = lambda name: (1 - t) * np.array(low[name]) + t * np.array(high[name])
        return [mix(name) for name in MATRICES + LISTS], value

    def run(self, z, measured, variable):
        """States, faults, commands and the variable used at each sample."""
        z, rows = np.array(z, float), []
        for y, value in zip(measured, variable):
            (A, B, C, F, K_x, K_f, L_x, L_f, x_op, u_op, y_op), used = self.numbers(value)
            (n, q), point = F.shape, np.concatenate([x_op, np.zeros(F.shape[1])])
            g, k, l = np.block([[A, F], [np.zeros((q, n)), np.eye(q)]]), np.hstack([K_x, K_f]), np.vstack([L_x, L_f])
            deviation = z - point
            correction = l @ (y - y_op - C @ deviation[:n])
            shown = deviation + correction if self.current else deviation
            u = np.clip(u_op + k @ shown, *self.limits)
            rows.append([*(shown + point), *u, used])
            following = g @ shown + np.vstack([B, np.zeros((q, B.shape[1]))]) @ (u - u_op)
            z = point + following + (0 if self.current else correction)
        return np.array(rows)


@pytest.fixture(scope="module")
def tank(aso_ftc, root, packed, tmp_path_factory):
    """Report, design and FMU of the three tanks."""
    return design_of_file(aso_ftc, root / "examples/three-tank/schedule.toml", tmp_path_factory.mktemp("tank"))


@pytest.fixture(scope="module")
def measured(aso_ftc, root, packed, tmp_path_factory):
    """The three tanks with the measured level as variable."""
    folder = tmp_path_factory.mktemp("measured")
    text = (root / "examples/three-tank/schedule.toml").read_text().replace("../../dist", str(root / "dist"))
    lines = 'variable = "level"\nunit = "m"\ndescription = "Set point of the level of tank 1"'
    assert lines in text
    (folder / "tank.toml").write_text(text.replace(lines, 'variable = "y_1"'))
    return design_of_file(aso_ftc, folder / "tank.toml", folder)


@pytest.fixture(scope="module")
def drive(aso_ftc, packed, tmp_path_factory):
    """Report, design and FMU of the drive."""
    folder = tmp_path_factory.mktemp("drive")
    (folder / "drive.toml").write_text(DRIVE)
    return design_of_file(aso_ftc, folder / "drive.toml", folder)


def design_of_file(aso_ftc, plant, folder):
    """The design of a plant file, made by the command."""
    out = folder / "design.toml"
    done = aso_ftc("design", plant, "--out", out, "--fmu", folder / "made.fmu", "--json", "--force")
    assert done.returncode in (0, 1), done.stderr
    fmu = Fmu(extract(str(folder / "made.fmu"), str(folder / "unpacked")))
    return json.loads(done.stdout), Design(out.read_text()), fmu


LEVELS, RISE = np.array([0.15, 0.08, 0.11]), np.array([0.004, 0.002, 0.003])


def started(fmu, kind=None):
    options = {} if kind is None else {"kind": kind}
    return Instance(fmu, **options).start(dict(zip(["y_1", "y_2", "y_3"], LEVELS)))


def expected(design, count):
    """The rows of `count` samples while the levels rise through the grid."""
    start = next(point for point in design.points if point["at"] == 0.4)["x_op"]
    measured = [LEVELS + k * RISE for k in range(count)]
    return design.run([*start, 0, 0], measured, [y[0] for y in measured])


@pytest.mark.parametrize("size", [1.0, 0.5, 3.0])
def test_the_fmu_follows_the_interpolated_recursion(measured, size):
    _, design, fmu = measured
    count, per_step = 100, size / design.period
    rows = expected(design, count + 1)
    with started(fmu) as instance:
        assert instance.get(*SIGNALS) == pytest.approx(rows[0], rel=1e-9, abs=1e-13)
        for i in range(int(count / per_step)):
            instance.set(dict(zip(["y_1", "y_2", "y_3"], LEVELS + i * size * RISE)))
            instance.set_slopes(**dict(zip(["y_1", "y_2", "y_3"], RISE)))
            instance.step(i * size, size)
            row = rows[int((i + 1) * per_step + 1e-9)]
            assert instance.get(*SIGNALS) == pytest.approx(row, rel=1e-9, abs=1e-13)
    assert rows[-1][-1] > 0.5, "the run passes two points of the grid"


def test_in_model_exchange_each_sample_is_interpolated(measured):
    _, design, fmu = measured
    rows = expected(design, 60)
    with started(fmu, MODEL_EXCHANGE) as instance:
        info = EventInfo()
        for k, row in enumerate(rows):
            instance.set(dict(zip(["y_1", "y_2", "y_3"], LEVELS + k * RISE)))
            instance.must("NewDiscreteStates", byref(info))
            assert instance.get(*SIGNALS) == pytest.approx(row, rel=1e-9, abs=1e-13)
            instance.must("EnterContinuousTimeMode")
            instance.must("SetTime", info.next_event_time)
            instance.must("EnterEventMode")


def test_a_restored_state_continues_with_the_same_bits(measured):
    _, _, fmu = measured
    with started(fmu) as instance, Instance(fmu) as other:
        for k in range(20):
            instance.set(dict(zip(["y_1", "y_2", "y_3"], LEVELS + k * RISE)))
            instance.step(float(k), 1.0)
        saved, runs = serialized(instance), []
        for one in (instance, other):
            restore(one, saved)
            one.set({"y_1": 0.37})
            one.step(20.0, 3.0)
            runs.append(one.outputs())
        assert runs[0] == runs[1]


def test_a_value_outside_of_the_grid_is_held_with_one_warning(measured):
    _, _, fmu = measured
    with started(fmu) as instance:
        instance.set({"y_1": 0.61})
        instance.call("DoStep", 0.0, 1.0, 1)
        instance.set({"y_1": 0.62})
        statuses = [instance.call("DoStep", float(k), 1.0, 1) for k in range(1, 4)]
        assert statuses == [OK] * 3
        warnings = [message.text for message in instance.messages if message.status == WARNING]
        assert len(warnings) == 1 and "outside of the schedule" in warnings[0]
        assert instance.get("schedule_at") == [0.6]


def test_the_derivatives_at_the_start_include_the_schedule(measured):
    _, _, fmu = measured
    names, outputs = ["y_1", "y_2", "y_3"], ["Q_1", "Q_2", "f_hat[1]", "x_hat[2]", "schedule_at"]

    def values(levels):
        with Instance(fmu) as instance:
            instance.enter(dict(zip(names, levels)))
            return np.array(instance.get(*outputs))

    for k, name in enumerate(names):
        change = 1e-6 * np.eye(3)[k]
        slopes = (values(LEVELS + change) - values(LEVELS - change)) / 2e-6
        with Instance(fmu) as instance:
            instance.enter(dict(zip(names, LEVELS)))
            instance.get(*outputs)
            derivatives = instance.directional(outputs, {name: 1.0})
        assert list(derivatives.values()) == pytest.approx(slopes, rel=1e-5, abs=1e-6)


def test_the_controller_has_no_matrices_as_parameters_but_the_value_of_its_schedule(measured):
    _, _, fmu = measured
    parameters = fmu.names(causality="parameter")
    assert not any(name.startswith(tuple(f"{entry}[" for entry in [*MATRICES, *LISTS])) for name in parameters)
    assert fmu.variables["schedule_at"].causality == "output"
    assert fmu.names(causality="input") == ["y_1", "y_2", "y_3", "compensate"]


def test_an_input_may_schedule_and_fmpy_runs_it(drive):
    report, design, fmu = drive
    assert not report["schedule"]["measured"]
    assert fmu.names(causality="input") == ["angle", "compensate", "inertia"]
    assert fmu.variables["inertia"].unit == "kg.m2"
    end, count = 2.0, 101
    times = np.linspace(0, end, count)
    angle, inertia = 0.3 - 0.1 * times, 1.2 + 0.8 * times
    signals = np.array(
        [(0.0, 0.3, 1.2), (end, 0.3 - 0.1 * end, 1.2 + 0.8 * end)],
        dtype=[("time", float), ("angle", float), ("inertia", float)],
    )
    outputs = ["x_hat[1]", "x_hat[2]", "f_hat", "torque", "schedule_at"]
    result = simulate_fmu(
        str(fmu.folder), input=signals, output=outputs, stop_time=end, output_interval=design.period,
    )
    # FMPy holds the inputs of the start of each step, at whose end the sample is.
    held = [0, *range(count - 1)]
    rows = design.run([0, 0, 0], angle[held, None], inertia[held])
    assert np.array([result[name] for name in outputs]).T == pytest.approx(rows, rel=1e-8, abs=1e-9)


def closed(design, value):
    """The loop of interpolated plant and controller at a value of the variable."""
    (A, B, C, F, K_x, K_f, L_x, L_f, *_), _ = design.numbers(value)
    n, q = F.shape
    k, l = np.hstack([K_x, K_f]), np.vstack([L_x, L_f])
    g = np.block([[A + B @ K_x, F + B @ K_f], [np.zeros((q, n)), np.eye(q)]])
    c_0 = np.hstack([C, np.zeros((len(C), q))])
    w = np.eye(n + q) - l @ c_0
    # The observer has the sampled model of the plant.
    return np.block([[A + B @ k @ l @ C, B @ k @ w], [g @ l @ C, g @ w]])


@pytest.mark.parametrize("name", ["tank", "drive"])
def test_the_certificate_holds_between_the_points(name, request):
    report, design, _ = request.getfixturevalue(name)
    schedule = report["schedule"]
    values = np.linspace(design.at[0], design.at[-1], 97)
    radii = [abs(np.linalg.eigvals(closed(design, value))).max() for value in values]
    assert schedule["worst_instability"] >= max(radii) - 1 - 1e-9
    if "p" in schedule["any_rate"]:
        p = np.array(schedule["any_rate"]["p"])
        scale = 1 / np.sqrt(np.diag(p))
        for value in values:
            a = closed(design, value)
            left = p - a.T @ p @ a
            assert np.linalg.eigvalsh(left * np.outer(scale, scale)).min() > 0
        return
    rate, grid = schedule["bounded_rate"]["rate"], [np.array(p) for p in schedule["bounded_rate"]["p"]]
    change = rate * design.period

    def energy(value):
        k = min(np.searchsorted(design.at, value, side="right"), len(design.at) - 1) - 1
        t = (value - design.at[k]) / (design.at[k + 1] - design.at[k])
        return (1 - t) * grid[k] + t * grid[k + 1]

    for value in values:
        a, p = closed(design, value), energy(value)
        scale = 1 / np.sqrt(np.diag(p))
        for following in (value - change, value, value + change):
            following = min(max(following, design.at[0]), design.at[-1])
            left = p - a.T @ energy(following) @ a
            assert np.linalg.eigvalsh(left * np.outer(scale, scale)).min() > 0


def test_a_measurement_that_moves_its_own_operating_point_leaves_no_equilibrium_stable(measured, tank):
    for point in measured[0]["schedule"]["points"]:
        # Every point of the grid is an equilibrium: an eigenvalue is 1.
        assert point["coupled_instability"] == pytest.approx(0, abs=1e-6)
        assert point["closed"]["instability"] < -0.01
    reasons = measured[0]["verdict"]["reasons"]
    assert any("the measurement moves the operating point" in reason for reason in reasons)
    assert tank[0]["verdict"]["level"] != "red"
    assert tank[2].names(causality="input") == ["y_1", "y_2", "y_3", "compensate", "level"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("at = 3.0", "at = 1.5", "expected ascending values"),
        ("at = 1.0\n", "at = 1.0\nA = [[0, 1], [0, -0.5]]\n", "expected exactly one point with only `at`"),
        ('variable = "inertia"', 'variable = "torque"', "is an actuator"),
        ('variable = "inertia"', 'variable = "angle"', "the measurement `angle` states it"),
        ('variable = "inertia"', 'variable = "T_s"', "a variable `T_s` of its own"),
        ("B = [[0], [0.5]]", "B = [[0, 0.5]]", "expected 2x1"),
        ("B = [[0], [0.5]]", "x_op = [1]", "expected 2 numbers"),
    ],
)
def test_a_wrong_schedule_is_refused_at_its_line(refusal, old, new, words):
    assert old in DRIVE
    message = refusal(DRIVE.replace(old, new))
    assert words in message and "plant.toml:" in message, message
