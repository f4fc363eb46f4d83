"""Scheduled controllers with references: gains by numpy, the FMU beside an own recursion, constant errors, refused files."""

import functools
import json

import numpy as np
import pytest
from fmpy import extract

import scheduled_design
from c_abi import Fmu, Instance
from matrices import zoh
from scheduled_design import LISTS, ScheduledDesign
from stepped import Stepped

PERIOD = 0.05
INERTIAS, SPRINGS, FRICTIONS = [1.0, 2.0, 4.0], [1.0, 3.0, 1.5], [0.5, 0.3, 0.2]

DRIVE = f"sample_time = {PERIOD}\n" + scheduled_design.DRIVE.replace('"inertia"\n', '"inertia"\nrate_bound = 0.5\n')
LAWS = ["proportional-integral", "fast-adaptive", "learning"]
WITHOUT = [
    ("feedforward = true", "integral = false"),
    ("feedback.eigenvalues = [-1.2, -2.0, -2.5]", "feedback.eigenvalues = [-1.2, -2.0]"),
]


def drive(k):
    """The sampled plant at a point."""
    a = np.array([[0, 1], [-SPRINGS[k] / INERTIAS[k], -FRICTIONS[k] / INERTIAS[k]]])
    return zoh(a, np.array([[0], [1 / INERTIAS[k]]]), PERIOD)


def by(law):
    """The replacements for an estimation law; all but one need a fault that acts on a measurement directly: the speed."""
    stated = ("[schedule]", f'[estimation]\nlaw = "{law}"\n\n[schedule]')
    if law == "proportional-integral":
        return (stated,)
    return (
        stated,
        ("C = [[1, 0]]", "C = [[1, 0], [0, 1]]"),
        ('{ name = "angle", operating = 0.0 }', '{ name = "angle", operating = 0.0 }, "speed"'),
        ("y_op = [0.4]", "y_op = [0.4, 0]"), ("y_op = [0.2]", "y_op = [0.2, 0]"),
    )


class Schedule(ScheduledDesign):
    """The recursion of a sampled controller."""

    def __init__(self, text):
        super().__init__(text)
        self.current = self.file["estimator"] == "current"

    def sample(self, z, y, r, point):
        """The next estimates and integrals, and the command."""
        x_hat, f_hat, x_i = np.split(z, [self.n, self.n + self.q])
        x_hat, e = x_hat - point["x_op"], y - point["y_op"]
        r = r - point["r_op"]
        innovation = e - point["C"] @ x_hat
        if self.current:
            x_hat, f_hat = x_hat + point["L_x"] @ innovation, f_hat + point["L_f"] @ innovation
            innovation = 0 * innovation
        # With a direct term f_hat is the integral part of the estimate.
        fault = f_hat + point["P_f"] @ (e - point["C"] @ x_hat) if "P_f" in point else f_hat
        v = point["u_op"] + point["K_x"] @ x_hat + point["K_f"] @ fault
        if "N_r" in point:
            v = v + point["N_r"] @ r
        if self.integrals:
            v = v + point["K_i"] @ x_i
        u = np.clip(v, *self.limits)
        after = point["x_op"] + point["A"] @ x_hat + point["B"] @ (u - point["u_op"]) + point["F_a"] @ f_hat + point["L_x"] @ innovation
        if self.integrals:
            x_i = x_i + PERIOD * (r - np.array(self.file["H"]) @ e)
            x_i = x_i + (point["L_w"] @ (u - v) if "L_w" in point else 0)
        fault_model = np.array(self.file.get("A_f", np.eye(self.q)))
        return np.concatenate([after, fault_model @ f_hat + point["L_f"] @ innovation, x_i]), u


@pytest.fixture(scope="module")
def design(aso_ftc, packed, tmp_path_factory):
    """Schedule, report and FMU of the drive after replacements in its text; without certificates if it is so wanted."""

    @functools.cache
    def make(*replacements, certified=True):
        folder, text = tmp_path_factory.mktemp("drive"), DRIVE
        for old, new in replacements:
            assert old in text, old
            text = text.replace(old, new)
        (folder / "drive.toml").write_text(text, encoding="utf-8")
        out = folder / "design.toml"
        options = [] if certified else ["--certificate-time", "0"]
        done = aso_ftc("design", folder / "drive.toml", "--out", out, "--fmu", folder / "Drive.fmu", "--json", *options)
        assert done.returncode in (0, 1), done.stderr
        return Schedule(out.read_text(encoding="utf-8")), json.loads(done.stdout), folder / "Drive.fmu"

    return make


@pytest.fixture(scope="module")
def both(design):
    return design(certified=True)


@pytest.fixture(scope="module")
def without(design):
    return design(*WITHOUT, certified=True)


def test_each_point_has_the_gains_of_its_own_plant(both, without):
    for k, point in enumerate(both[0].points):
        a, b = drive(k)
        extended = np.block([[a, np.zeros((2, 1))], [-PERIOD * np.eye(1, 2), np.eye(1)]])
        feedback = extended + np.vstack([b, [[0]]]) @ np.hstack([point["K_x"], point["K_i"]])
        expected = np.sort(np.exp(np.array([-1.2, -2.0, -2.5]) * PERIOD))
        assert np.sort(np.linalg.eigvals(feedback).real) == pytest.approx(expected, abs=1e-9)
        values, vectors = np.linalg.eig(feedback.T)
        w = vectors[:, np.argmax(abs(values))].real
        assert point["N_r"][0][0] == pytest.approx(-PERIOD * w[2] / (w[:2] @ b[:, 0]), rel=1e-8)
        # One command: the range cancels, and L_w K_i = 1 - e^(-T / windup_time), by default of the slowest eigenvalue.
        assert point["L_w"][0][0] * point["K_i"][0][0] == pytest.approx(1 - np.exp(-1.2 * PERIOD), rel=1e-7)
        assert point["r_op"] == point["y_op"]
        feedforward = without[0].points[k]
        gain = np.linalg.solve(np.eye(2) - a - b @ feedforward["K_x"], b)[0, 0]
        assert feedforward["N_r"][0][0] == pytest.approx(1 / gain, rel=1e-8) and "K_i" not in feedforward


def run(schedule, fmu, folder, inertia, reference, count, plant, disturbance=0.0):
    """The FMU and the own recursion with the plant: angles and commands of both."""
    start = next(point for point in schedule.points if point["at"] == 1.0)
    controller = Stepped(fmu, folder, [("inertia", inertia(0)), ("r_angle", reference(0))])
    z = np.concatenate([start["x_op"], np.zeros(schedule.q + schedule.integrals)])
    x, rows = np.zeros(2), []
    a, b = plant
    measured = len(schedule.file["measurements"])
    for k in range(count):
        z, u = schedule.sample(z, x[:measured], np.array([reference(k)]), schedule.numbers(inertia(k)))
        rows.append([x[0], controller.get("torque")[0], u[0]])
        x = a @ x + b[:, 0] * (rows[-1][1] + disturbance)
        controller.set_reals(["angle", "speed"][:measured], x[:measured])
        controller.set("inertia", inertia(k + 1))
        controller.set("r_angle", reference(k + 1))
        controller.step(k * PERIOD, PERIOD)
    return np.array(rows)


@pytest.mark.parametrize(
    "change",
    [(), tuple(WITHOUT), (("sample_time", 'estimator = "prediction"\nsample_time'),)],
    ids=["both", "feedforward", "prediction"],
)
def test_the_fmu_follows_the_interpolated_recursion_at_its_limits_too(design, change, tmp_path):
    schedule, _, fmu = design(*change, certified=change in ((), tuple(WITHOUT)))
    inertia = lambda k: 0.9 + 0.015 * k
    reference = lambda k: 1.0 if k % 120 < 60 else -2.0
    rows = run(schedule, fmu, tmp_path, inertia, reference, 230, drive(1))
    assert np.allclose(rows[:, 1], rows[:, 2], rtol=1e-8, atol=1e-9)
    assert np.abs(rows[:, 1]).max() == 3.0 and inertia(229) > 4.0


@pytest.mark.parametrize("law", LAWS)
def test_the_fmu_follows_the_recursion_of_other_laws(design, law, tmp_path):
    schedule, _, fmu = design(*by(law))
    assert ("P_f" in schedule.points[0]) == (law != "learning") and ("A_f" in schedule.file) == (law == "learning")
    inertia = lambda k: 0.9 + 0.015 * k
    reference = lambda k: 1.0 if k % 120 < 60 else -2.0
    rows = run(schedule, fmu, tmp_path, inertia, reference, 230, drive(1), disturbance=0.3)
    assert np.allclose(rows[:, 1], rows[:, 2], rtol=1e-8, atol=1e-9)
    assert np.abs(rows[:, 1]).max() == 3.0 and inertia(229) > 4.0


@pytest.mark.parametrize("value", [1.0, 1.37, 2.0, 3.1, 4.0])
def test_with_integral_action_the_reference_is_reached_at_and_between_the_points(both, value, tmp_path):
    schedule, _, fmu = both
    matrices = schedule.numbers(value)
    rows = run(schedule, fmu, tmp_path, lambda k: value, lambda k: 0.9, 600, (matrices["A"], matrices["B"]), disturbance=0.2)
    assert rows[-1, 0] == pytest.approx(0.9, abs=1e-7)


def test_the_derivatives_at_the_start_include_references_and_schedule(both, tmp_path):
    fmu = Fmu(extract(str(both[2]), str(tmp_path)))
    point, outputs = {"angle": 0.3, "inertia": 1.4, "r_angle": 0.5}, ["torque", "x_hat[2]", "schedule_at"]

    def values(changed):
        with Instance(fmu) as instance:
            instance.enter(changed)
            return np.array(instance.get(*outputs))

    for name, value in point.items():
        moved = [values({**point, name: value + change}) for change in (1e-6, -1e-6)]
        with Instance(fmu) as instance:
            instance.enter(point)
            instance.get(*outputs)
            derivatives = instance.directional(outputs, {name: 1.0})
        assert list(derivatives.values()) == pytest.approx((moved[0] - moved[1]) / 2e-6, rel=1e-5, abs=1e-6), name


def constant_error(schedule, value):
    """What is missing of a step without integral action: 1 - H C (I - A - B K_x)^-1 B N_r."""
    matrices = schedule.numbers(value)
    states = np.linalg.solve(np.eye(2) - matrices["A"] - matrices["B"] @ matrices["K_x"], matrices["B"] @ matrices["N_r"])
    return 1 - (matrices["C"] @ states)[0, 0]


def test_without_it_a_warning_states_the_largest_error_between_the_points(both, without, tmp_path):
    schedule, report, fmu = without
    assert not any("reached at the points" in text for text in both[1]["warnings"])
    (warning,) = [text for text in report["warnings"] if "reached at the points" in text]
    assert "drive.toml:" in warning or "line " in warning, warning
    values = np.concatenate([np.linspace(low, high, 21) for low, high in ((1, 2), (2, 4))])
    errors = np.abs([constant_error(schedule, value) for value in values])
    assert f"misses up to {100 * errors.max():.2f} % of a step" in warning
    assert f"inertia = {values[errors.argmax()]:.6f}" in warning
    for value in schedule.at:
        assert constant_error(schedule, value) == pytest.approx(0, abs=1e-9)
    # The FMU misses by the same part.
    value = values[errors.argmax()]
    matrices = schedule.numbers(value)
    rows = run(schedule, fmu, tmp_path, lambda k: value, lambda k: 0.9, 600, (matrices["A"], matrices["B"]))
    missing = (0.9 - rows[-1, 0]) / (0.9 - matrices["r_op"][0])
    assert missing == pytest.approx(constant_error(schedule, value), abs=1e-7)


@pytest.mark.parametrize("change", [(), tuple(WITHOUT), *map(by, LAWS)], ids=["both", "feedforward", *LAWS])
def test_the_certificate_and_the_checked_values_are_about_the_loop_with_its_integrals(design, change):
    schedule, report, _ = design(*change, certified=True)
    certificate = report["schedule"]

    def loop(value):
        """The loop of interpolated plant and controller, its deviations: [x; x_hat; f_hat; x_i]."""
        matrices = schedule.numbers(value)
        point = {**matrices, **{name: np.zeros(np.shape(matrices[name])) for name in LISTS}}
        schedule.limits, before = np.transpose([[-np.inf, np.inf]]), schedule.limits
        size = 2 * schedule.n + schedule.q + schedule.integrals
        columns = []
        for unit in np.eye(size):
            after, u = schedule.sample(unit[2:], matrices["C"] @ unit[:2], np.zeros(1), point)
            columns.append(np.concatenate([matrices["A"] @ unit[:2] + matrices["B"] @ u, after]))
        schedule.limits = before
        return np.array(columns).T

    values = np.linspace(1, 4, 61)
    radii = [abs(np.linalg.eigvals(loop(value))).max() for value in values]
    assert certificate["worst_instability"] >= max(radii) - 1 - 1e-6 and max(radii) < 1
    if "p" in certificate["any_rate"]:
        p = np.array(certificate["any_rate"]["p"])
        scale = 1 / np.sqrt(np.diag(p))
        for value in values:
            left = p - loop(value).T @ p @ loop(value)
            assert np.linalg.eigvalsh(left * np.outer(scale, scale)).min() > 0
    else:
        assert "p" in certificate["bounded_rate"], certificate


@pytest.mark.parametrize("change", [(), tuple(WITHOUT), by(LAWS[0])], ids=["both", "feedforward", LAWS[0]])
def test_a_measurement_that_schedules_moves_the_references_too(design, change):
    """The Jacobian of one sample of plant and controller, by differences on each side of a point."""
    changes = [
        *change,
        ('variable = "inertia"', 'variable = "angle"'),
        ("at = 1.0\n", "at = 0.0\n"), ("at = 2.0\n", "at = 1.0\n"), ("at = 4.0\n", "at = 2.0\n"),
        ("operating = 0.0", "operating = 0.1"),
    ]
    schedule, report, _ = design(*changes, certified=False)
    schedule.limits = np.transpose([[-np.inf, np.inf]])

    def sample(k, state):
        """All as deviations from the point, but the operating points move."""
        point = schedule.points[k]
        y_op = np.array(point["y_op"])
        y = y_op + np.array(point["C"]) @ state[:2]
        theta = schedule.at[k] + (y - y_op)[0]
        z = state[2:] + np.concatenate([point["x_op"], np.zeros(schedule.q + schedule.integrals)])
        matrices = schedule.numbers(theta)
        after, u = schedule.sample(z, y, np.array(point["r_op"]), matrices)
        a, b = drive(k)
        moved = a @ state[:2] + b @ (u - point["u_op"])
        return np.concatenate([moved, after - np.concatenate([point["x_op"], np.zeros(schedule.q + schedule.integrals)])])

    for k, entry in enumerate(report["schedule"]["points"]):
        worst = -1.0
        size = 2 * schedule.n + schedule.q + schedule.integrals
        for sign in (1, -1):
            # At an end of the grid the variable is held on the other side.
            if (k, sign) in ((0, -1), (2, 1)):
                continue
            step = 1e-6
            columns = []
            for unit in np.eye(size):
                moves = sign * step * unit
                columns.append((sample(k, moves) - sample(k, 0 * unit)) / (sign * step))
            worst = max(worst, abs(np.linalg.eigvals(np.array(columns).T)).max() - 1)
        assert entry["coupled_instability"] == pytest.approx(worst, abs=2e-5), k


@pytest.mark.parametrize(
    "old, new, parts",
    [
        # K_i grows with the inertia: half of the way the product with L_w is above 2.
        (
            "B = [[0], [0.25]]",
            "B = [[0], [0.0005]]",
            ["back-calculation of the integrals is not stable while torque is at the limits", "inertia = "],
        ),
        (
            "[schedule]",
            '[estimation]\nlaw = "sliding-mode"\n\n[schedule]',
            ["with `schedule` the law is one of augmented, proportional-integral, fast-adaptive, learning; found \"sliding-mode\""],
        ),
        (
            "A = [[0, 1], [-0.375, -0.05]]\nB = [[0], [0.25]]",
            "A = [[0, 1], [-1, -1]]\nB = [[0], [1]]\nC = [[0, 1]]",
            ["no integral action exists for r_angle", "schedule with inertia = 4"],
        ),
    ],
)
def test_a_schedule_that_cannot_follow_is_refused_at_its_line(refusal, old, new, parts):
    assert old in DRIVE, old
    message = refusal(DRIVE.replace(old, new))
    for part in ["plant.toml:", *parts]:
        assert part in message, message
