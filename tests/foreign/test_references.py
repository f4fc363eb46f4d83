"""References of a design: the loop by numpy from the design file, the FMU by FMPy, the master, refused plant files.

Oracle: tracking_oracle.py, which integrates plant, observer, filter, fault estimate and integrals together.
"""

import json
import re
import tomllib

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from scipy.linalg import solve_continuous_are

from conftest import ROOT
from design_loop import packed_plant
from design_oracle import WITHOUT_PROOFS
from stepped import Stepped
from tracking_oracle import TrackingLoop

A = [[-1.0, 0.6, 0.0], [0.4, -1.5, 0.7], [0.2, 0.5, -0.8]]
B = [[1.0, 0.0], [0.0, 0.5], [0.3, 1.0]]
C = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.2, 1.0]]
REFERENCES = """
[reference]
track = ["y1", { name = "difference", combination = { y2 = 1, y3 = -1 }, step = -2.0 }]
"""
SENSOR = """
[[faults]]
name = "b2"
sensor = "y2"
"""
KINDS = {
    "continuous": "",
    "current": "sample_time = 0.1\n",
    "prediction": 'sample_time = 0.1\nestimator = "prediction"\n',
}
FEEDBACK = [-1.0, -1.2, -1.4, -1.6, -1.8]
ACTIONS = {"integral": "", "feedforward": "integral = false", "both": "feedforward = true"}


def plant_file(kind, sensor, action):
    """A plant of three states with two references and an actuator fault; perhaps with a sensor fault."""
    feedback = FEEDBACK[:3] if action == "feedforward" else FEEDBACK
    observer = [-4.0, -4.5, -5.0, -5.5] + ([-6.0, -6.5, -7.0, -7.5] if sensor else [])
    return (
        f"A = {A}\nB = {B}\nC = {C}\n{KINDS[kind]}{'filter = [20, 21, 22]' if sensor else ''}\n"
        f'feedback.eigenvalues = {feedback}\nobserver.eigenvalues = {observer}\nmeasurements = ["y1", "y2", "y3"]\n'
        f'[[faults]]\nname = "f1"\nactuator = "u1"\n{SENSOR if sensor else ""}{REFERENCES}'
        f"{ACTIONS[action]}\n[robustness]\ncases = 3\n"
    )


def entries(sensor):
    """The plant for the oracle."""
    F_s = np.zeros((3, 2 if sensor else 1))
    F = np.zeros_like(F_s)
    F[:, 0] = np.array(B)[:, 0]
    if sensor:
        F_s[1, 1] = 1.0
    return A, B, C, F, F_s


def designed(aso_ftc, folder, text, *options):
    """Design file and report."""
    file = folder / "plant.toml"
    file.write_text(text, encoding="utf-8")
    done = aso_ftc("design", file, "--out", folder / "design.toml", "--json", *WITHOUT_PROOFS, *options)
    assert done.returncode in (0, 1), done.stderr
    return tomllib.loads((folder / "design.toml").read_text(encoding="utf-8")), json.loads(done.stdout)


@pytest.fixture(scope="module", params=[(k, s, a) for k in KINDS for s in (False, True) for a in ACTIONS])
def case(request, aso_ftc, tmp_path_factory):
    """Oracle, design file and report of each kind."""
    kind, sensor, action = request.param
    design, report = designed(aso_ftc, tmp_path_factory.mktemp("case"), plant_file(*request.param))
    return TrackingLoop(entries(sensor), design), design, report, sensor, action


def test_the_loop_is_stable_and_has_the_requested_eigenvalues(case):
    loop, design, report, _, action = case
    eigenvalues = np.linalg.eigvals(loop.matrices()[0])
    period = design.get("sample_time")
    assert (abs(eigenvalues) < 1 if period else eigenvalues.real < 0).all()
    for required in FEEDBACK[:3] if action == "feedforward" else FEEDBACK:
        assert np.abs(eigenvalues - (np.exp(required * period) if period else required)).min() < 1e-6
    assert all(check["holds"] for check in report["checks"])


def test_constant_references_and_faults_leave_no_error(case):
    loop, _, report, sensor, action = case
    outputs = np.array([[1.0, 0, 0], [0, 1.0, -1.0]]) @ np.array(C)
    constant = outputs @ loop.constant()[:3]
    assert np.allclose(constant[:, :2], np.eye(2), atol=1e-9)
    # An actuator fault is compensated, too, and a sensor fault does not move the plant.
    assert np.allclose(constant[:, 2:], 0, atol=1e-9)
    assert all(abs(step["steady_state_error"]) < 1e-9 for step in report["references"])


def test_another_plant_is_held_at_its_references_by_integral_action(case):
    loop, design, _, sensor, action = case
    matrices = list(entries(sensor))
    matrices[0] = np.array(A) * 1.1 + 0.03
    matrices[1] = np.array(B) * 0.9
    other = TrackingLoop(matrices, design)
    outputs = np.array([[1.0, 0, 0], [0, 1.0, -1.0]]) @ np.array(C)
    error = np.abs(outputs @ other.constant()[:3, :2] - np.eye(2)).max()
    # The estimate of the sensor fault depends on the model, and so does what it is subtracted from.
    if action != "feedforward" and not sensor:
        assert error < 1e-9
    elif action == "feedforward":
        assert error > 1e-3


def test_the_report_has_the_responses_of_the_whole_loop(case):
    loop, design, report, _, _ = case
    sizes = [1.0, -2.0]
    rows = {f"y{k + 1}": np.array(C)[k] for k in range(3)}
    rows["output of difference"] = rows["y2"] - rows["y3"]
    for which, (step, size) in enumerate(zip(report["references"], sizes)):
        assert step["size"] == size and step["reference"] == ["r_y1", "difference"][which]
        curves = {curve["name"]: curve for curve in step["curves"]}
        assert list(curves)[0] == ["y1", "output of difference"][which]
        for name, curve in curves.items():
            some = slice(0, 400, 29)
            times = np.array(curve["times"])[some]
            states, commands = loop.step(which, size, times)
            command = name.removeprefix("command ")
            expected = states @ rows[name] if name in rows else commands[:, ["u1", "u2"].index(command)]
            assert np.allclose(expected, np.array(curve["values"])[some], atol=1e-7), name


def test_rise_time_overshoot_settling_time_and_command_peaks_are_those_of_the_response(case):
    loop, design, report, _, _ = case
    times = np.arange(0, 12, 0.02)
    rows = [np.array(C)[0], np.array(C)[1] - np.array(C)[2]]
    for which, (step, row) in enumerate(zip(report["references"], rows)):
        states, commands = loop.step(which, step["size"], times)
        share = states @ row / step["size"]
        outside = np.flatnonzero(np.abs(share - 1) > 0.02)[-1]
        assert abs(times[outside] - step["settling_time"]) < 0.05
        first = lambda level: times[np.argmax(share >= level)]
        assert abs(first(0.9) - first(0.1) - step["rise_time"]) < 0.05
        assert abs(max(share.max() - 1, 0) - step["overshoot"]) < 2e-3
        for command, entry in zip(commands.T, step["commands"]):
            scale = np.abs(command).max()
            assert abs(min(command.min(), 0) - entry["range"][0]) < 5e-3 * scale
            assert abs(max(command.max(), 0) - entry["range"][1]) < 5e-3 * scale
            assert entry["limits"] is None
        assert step["largest_step"] == [None, None]


MOTOR = """A = [[0, 1], [0, -1]]
B = [[0], [1]]
C = [[1, 0]]
feedback.eigenvalues = [-2, -2.5, -3]
observer.eigenvalues = [-8, -9, -10]
actuators = [{ name = "u", limits = [-0.5, 0.5] }]
measurements = [{ name = "theta", unit = "rad", operating = 1.0 }]
faults = [{ name = "f", actuator = "u" }]
reference = { track = { measurement = "theta", step = 1.0 } }
robustness = { cases = 3 }
"""


@pytest.fixture(scope="module", params=["current", "prediction"])
def motor(request, aso_ftc, packed, tmp_path_factory):
    """A sampled motor with limits: oracle without and with limits, FMU, report."""
    folder = tmp_path_factory.mktemp("motor")
    text = KINDS[request.param].replace("0.1", "0.05") + MOTOR
    design, report = designed(aso_ftc, folder, text, "--fmu", folder / "Motor.fmu")
    return design, report, folder / "Motor.fmu", folder


def follow(fmu, folder, start, count=400):
    """The motor under the FMU after a step of the reference by 1 rad: angles and commands."""
    instance = Stepped(fmu, folder, [("theta", 1.0), ("r_theta", 2.0), *start])
    period = 0.05
    decay = np.exp(-period)
    x, rows = np.array([1.0, 0.0]), []
    for k in range(count):
        u, integral = instance.get("u", "x_i")
        rows.append((x[0], u, integral))
        x = np.array([x[0] + (1 - decay) * x[1] + (period - 1 + decay) * u, decay * x[1] + (1 - decay) * u])
        # The sample at the end of the step takes the angle at that time.
        instance.set("theta", x[0])
        instance.step(k * period, period)
    return np.array(rows).T


@pytest.mark.parametrize("conditioned", [True, False])
def test_the_fmu_at_its_limits_is_the_recursion_and_back_calculation_prevents_windup(motor, conditioned, tmp_path):
    design, report, fmu, _ = motor
    settings = () if conditioned else [("L_w[1,1]", 0.0)]
    angle, command, integral = follow(fmu, tmp_path, settings)
    variant = dict(design)
    if not conditioned:
        variant["L_w"] = [[0.0]]
    loop = TrackingLoop(([[0, 1], [0, -1]], [[0], [1]], [[1, 0]], [[0], [1]], [[0]]), variant, limits=(-0.5, 0.5))
    state, angles, commands, integrals = np.zeros(loop.order), [], [], []
    for _ in angle:
        after, u = loop.evaluate(state, np.ones(1), np.zeros(1))
        angles.append(1.0 + state[0])
        commands.append(u[0])
        integrals.append(state[-1])
        state = after
    assert np.abs(np.array(commands)).max() == 0.5
    assert np.allclose(command, commands, atol=1e-9)
    assert np.allclose(angle, angles, atol=1e-9) and np.allclose(integral, integrals, atol=1e-9)
    overshoot = angle.max() - 2.0
    assert overshoot < 1e-3 if conditioned else overshoot > 0.2
    assert abs(angle[-1] - 2.0) < (1e-9 if conditioned else 1e-3)


def test_a_step_beyond_the_limits_is_a_warning_with_the_largest_step(motor):
    _, report, _, _ = motor
    (step,) = report["references"]
    (warning,) = [text for text in report["warnings"] if "r_theta" in text]
    low, high = step["largest_step"]
    assert -low == pytest.approx(high) and 0 < high < 1
    (shown,) = re.findall(r"takes u to a limit; steps from (\S+) rad to (\S+) rad stay", warning)
    assert [float(limit) for limit in shown] == pytest.approx([low, high], rel=1e-4)
    # In proportion: a step of this size reaches the limit.
    (command,) = step["commands"]
    assert command["range"][1] * high == pytest.approx(0.5, rel=1e-9)


def test_an_unconnected_reference_holds_the_operating_point(motor):
    _, report, fmu, _ = motor
    variables = {one["name"]: one for one in report["interface"]}
    assert variables["r_theta"]["causality"] == "input" and variables["r_theta"]["unit"] == "rad"
    assert variables["r_theta"]["start"] == "1.0" and variables["x_i"]["unit"] == "rad.s"
    assert validate_fmu(str(fmu)) == []
    result = simulate_fmu(str(fmu), start_values={"theta": 1.0}, stop_time=2.0)
    assert np.abs(result["u"]).max() < 1e-12


@pytest.fixture(scope="module")
def tank(aso_ftc, packed, tmp_path_factory):
    """The three tanks with references, with each estimator or in continuous time; FMUs of plant and controller."""
    plant = packed_plant(aso_ftc, "ThreeTank")
    folder = tmp_path_factory.mktemp("tank")
    text = (ROOT / "examples/three-tank/reference.toml").read_text(encoding="utf-8")
    text = text.replace("../../dist", str(ROOT / "dist"))
    controllers = {}
    for kind, change in [("current", ""), ("continuous", "sample_time = 1.0\n")]:
        subfolder = folder / kind
        subfolder.mkdir()
        designed(aso_ftc, subfolder, text.replace(change, ""), "--fmu", subfolder / "Tank.fmu")
        controllers[kind] = subfolder / "Tank.fmu"
    return plant, controllers


SYSTEM = """[fmus]
plant = {plant!r}
controller = {controller!r}

[settings]
plant.E_1 = 0.15
plant.t_fault_1 = 1500.0
{settings}

[algorithm]
step = 1.0

[experiment]
stop-time = 3500.0

[[scenario.set]]
variable = "controller.r_y_1"
at = 200.0
value = {r_1}

[[scenario.set]]
variable = "controller.r_y_2"
at = 200.0
value = {r_2}
"""


@pytest.mark.parametrize("kind", ["current", "continuous"])
def test_the_tanks_reach_their_references_in_spite_of_a_fault(tank, kind, aso_ftc, tmp_path):
    plant, controllers = tank
    description = read_model_description(str(controllers[kind]))
    starts = {variable.name: variable.start for variable in description.modelVariables}
    targets = [float(starts["r_y_1"]) + 0.05, float(starts["r_y_2"]) + 0.03]
    text = SYSTEM.format(plant=str(plant), controller=str(controllers[kind]), settings="", r_1=targets[0], r_2=targets[1])
    (tmp_path / "system.toml").write_text(text, encoding="utf-8")
    done = aso_ftc("run", tmp_path / "system.toml", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    results = tmp_path / "results.csv"
    names = results.read_text(encoding="utf-8").split("\n", 1)[0].replace('"', "").split(",")
    table = dict(zip(names, np.loadtxt(results, delimiter=",", skiprows=1).T))
    time = table["time"]
    for level, target in zip(("plant.h_1", "plant.h_2"), targets):
        before = table[level][time < 199]
        assert np.abs(before - before[0]).max() < 1e-9, "the operating point is held"
        for end in (1499.0, 3500.0):
            at = np.argmin(np.abs(time - end))
            assert abs(table[level][at] - target) < 1e-9, (level, end)
    faults = table["controller.f_hat[1]"]
    assert faults[-1] < -1e-6, "the fault is estimated, too"


BASE = """A = [[0, 1], [-2, -3]]
B = [[0], [1]]
C = [[1, 0], [0, 1]]
actuator_faults = "all"
feedback.eigenvalues = [-1, -2, -3]
observer.eigenvalues = [-5, -6, -7]
measurements = ["h", "v"]
"""


@pytest.mark.parametrize(
    "table, line, parts",
    [
        ('reference.track = ["z"]', 8, ['no measurement is named "z"', "h, v"]),
        ('reference.track = ["v"]', 8, ["no integral action exists for r_v", "rank [A, B; H C, 0] is 2, expected 3"]),
        ('reference = { track = ["v"], integral = false }', 8, ["no feedforward exists"]),
        ('reference.track = ["h", "v"]', 8, ["2 references (r_h, r_v) need at least 2 commands, found 1"]),
        ("reference.track = []", 8, ["expected at least one measurement"]),
        ('reference = { track = ["h"], windup_time = 0 }', 8, ["windup_time"]),
        ('reference = { track = ["h"], integral = false, windup_time = 1 }', 8, ["only integral action winds up"]),
        ('reference = { track = ["h"], integrals = true }', 8, ["integrals"]),
        ('reference.track = [{ measurement = "h", name = "v" }]', 8, ["actuator or a measurement", "another `name`"]),
        ('reference.track = [{ measurement = "h", name = "x_i" }]', 8, ["has a variable `x_i` of its own"]),
        ('reference.track = [{ measurement = "h", name = "a b" }]', 8, ["cannot be the name"]),
        ("reference.track = [{ combination = { h = 1 } }]", 8, ["name"]),
        ("reference.track = [{ combination = { h = 0 }, name = 'r' }]", 8, ["a factor other than 0"]),
        ('reference.track = [{ measurement = "h", step = 0 }]', 8, ["a step other than 0"]),
    ],
)
def test_a_reference_that_cannot_be_is_refused_at_its_line(refusal, table, line, parts):
    message = refusal(BASE + table + "\n")
    for part in [f"plant.toml:{line}:", *parts]:
        assert part in message, message


@pytest.mark.parametrize(
    "old, new, parts",
    [
        ("[-1, -2, -3]", "[-1, -2]", ["expected 3 eigenvalues", "states and integrals of references"]),
        ("feedback.eigenvalues = [-1, -2, -3]", "feedback.Q = [1, 1]\nfeedback.R = [1]", ["Q is 2x2, expected 3x3"]),
        ("feedback.eigenvalues = [-1, -2, -3]", "feedback.h_infinity = 10", ["`region` with `decay`"]),
    ],
)
def test_the_requirement_of_the_feedback_is_for_states_and_integrals(refusal, old, new, parts):
    message = refusal(BASE.replace(old, new) + 'reference.track = "h"\n')
    for part in parts:
        assert part in message, message


def test_weights_region_and_norm_design_the_extended_feedback(aso_ftc, tmp_path):
    a, b = np.array([[0.0, 1, 0], [-2, -3, 0], [-1, 0, 0]]), np.array([[0.0], [1], [0]])
    regulator = -10 * b.T @ solve_continuous_are(a, b, np.diag([1.0, 1, 4]), np.array([[0.1]]))
    sector = np.tan(np.radians(50))
    for at, (feedback, is_met) in enumerate(
        [
            ("feedback.Q = [1, 1, 4]\nfeedback.R = [0.1]", lambda k, _: k == pytest.approx(regulator, rel=1e-7)),
            (
                "feedback.region = { decay = 1, sector = 50, disc = { center = -5, radius = 4.5 } }",
                lambda _, v: (v.real < -1).all() and (abs(v + 5) < 4.5).all() and (abs(v.imag) < -sector * v.real).all(),
            ),
            ("feedback.h_infinity = 20\nfeedback.region = { decay = 0.8 }", lambda _, v: (v.real < -0.8).all()),
        ]
    ):
        folder = tmp_path / str(at)
        folder.mkdir()
        text = BASE.replace("feedback.eigenvalues = [-1, -2, -3]", feedback) + 'reference.track = "h"\n'
        design, report = designed(aso_ftc, folder, text)
        loop = TrackingLoop(([[0, 1], [-2, -3]], [[0], [1]], [[1, 0], [0, 1]], [[0], [1]], np.zeros((2, 1))), design)
        assert (np.linalg.eigvals(loop.matrices()[0]).real < -0.1).all()
        k = np.hstack([loop.design["K_x"], loop.design["K_i"]])
        assert is_met(k, np.linalg.eigvals(a + b @ k))
        assert np.allclose(loop.constant()[0, :1], 1, atol=1e-9)
        assert len(report["feedback"]["eigenvalues"]) == 3
