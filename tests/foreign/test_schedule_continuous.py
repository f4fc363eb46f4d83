"""Continuous scheduled controllers: the FMU beside equations in numpy and scipy's integrator, the report's certificates computed again."""

import functools
import json

import numpy as np
import pytest
from fmpy import extract
from scipy.integrate import solve_ivp

import scheduled_design
from c_abi import OK, WARNING, Fmu, Instance
from continuous_schedule import Exchanged, Schedule, check_certificate, states_of
from excitation import restore, serialized

DRIVE = scheduled_design.DRIVE + """
[experiment]
stop_time = 10.0
step_size = 0.01
"""
# A lightly damped mass whose spring is known: by the circle criterion no quadratic Lyapunov function serves it at any rate,
# as sqrt(9) - sqrt(1) is above 0.4; the feedback changes little.
SPRING = """A = [[0, 1], [-1, -0.4]]
B = [[0], [1]]
C = [[1, 0]]
states = ["x", "v"]
actuators = ["u"]
measurements = ["y"]
actuator_faults = "all"
feedback.Q = [1e-6, 1e-6]
feedback.R = [1]
observer.eigenvalues = [-6.0, -7.0, -8.0]
robustness.cases = 3
[schedule]
variable = "k"
[[schedule.points]]
at = 1.0
[[schedule.points]]
at = 9.0
A = [[0, 1], [-9, -0.4]]
[experiment]
stop_time = 10.0
step_size = 0.01
"""
# A fault of the sensor, which a filter and the integral action know.
FILTERED = (
    ('actuator_faults = "all"\n', 'faults = [{ name = "bias", sensor = "angle" }]\nfilter = [20.0]\n'),
    ("observer.eigenvalues = [-6.0, -7.0, -8.0]", "observer.eigenvalues = [-6.0, -7.0, -8.0, -25.0]"),
)
# The angle that is measured schedules.
MEASURED = (
    ('variable = "inertia"', 'variable = "angle"'),
    ("at = 1.0\n", "at = 0.0\n"), ("at = 2.0\n", "at = 1.0\n"), ("at = 4.0\n", "at = 2.0\n"),
)
FEEDFORWARD = (
    ("feedforward = true", "integral = false"),
    ("feedback.eigenvalues = [-1.2, -2.0, -2.5]", "feedback.eigenvalues = [-1.2, -2.0]"),
)


def by(law):
    """The replacement that states an estimation law."""
    return (("[schedule]", f'[estimation]\nlaw = "{law}"\n\n[schedule]'),)


def rate(bound):
    """The replacement that states a bound of the rate of the spring."""
    return 'variable = "k"\n', f'variable = "k"\nrate_bound = {bound}\n'


@pytest.fixture(scope="module")
def designed(aso_ftc, packed, tmp_path_factory):
    """Schedule, report and FMU of a plant file after replacements in its text."""

    @functools.cache
    def make(*replacements, certified=True, text=DRIVE):
        folder = tmp_path_factory.mktemp("plant")
        for old, new in replacements:
            assert old in text, old
            text = text.replace(old, new)
        (folder / "plant.toml").write_text(text, encoding="utf-8")
        out = folder / "design.toml"
        options = [] if certified else ["--certificate-time", "0"]
        done = aso_ftc("design", folder / "plant.toml", "--out", out, "--fmu", folder / "Made.fmu", "--json", *options)
        assert done.returncode in (0, 1), done.stderr
        fmu = Fmu(extract(str(folder / "Made.fmu"), str(folder / "unpacked")))
        return Schedule(out.read_text(encoding="utf-8")), json.loads(done.stdout), fmu

    return make


@pytest.fixture(scope="module", params=["augmented", "proportional-integral"])
def drive(designed, request):
    return designed(*FILTERED, *(by(request.param) if request.param != "augmented" else ()))


def test_in_model_exchange_derivatives_and_commands_are_those_of_the_interpolated_equations(drive):
    schedule, _, fmu = drive
    random = np.random.default_rng(5)
    model = Exchanged(fmu, {"angle": 0.0, "inertia": 1.0, "r_angle": 0.0})
    limited = 0
    for _ in range(300):
        z = schedule.start(1.0) + 0.8 * random.standard_normal(len(schedule.start(1.0)))
        # Some values are outside of the points, where they are held.
        angle, reference, inertia = random.standard_normal(), random.standard_normal(), random.uniform(0.5, 5)
        inputs = {"angle": angle, "inertia": inertia, "r_angle": reference}
        model.at(0.0, z, inputs)
        model.event(0.0)
        slopes = model.at(0.0, z, inputs)
        expected, u = schedule.equations(z, np.array([angle]), np.array([reference]), inertia)
        assert slopes == pytest.approx(expected, rel=1e-11, abs=1e-12)
        assert model.instance.get("torque", "schedule_at") == pytest.approx([u[0], min(max(inertia, 1), 4)], rel=1e-12, abs=1e-13)
        limited += abs(u[0]) == 3
    assert 20 < limited < 280, "commands at and between the limits"


def course(time):
    """Angle, reference and inertia of the runs below: piecewise linear between whole numbers of steps of 0.05 s."""
    knots = np.arange(0, 12.01, 0.05)
    angle, reference = 0.5 * np.sin(1.3 * knots), np.where(knots < 3, 0.2, 1.6)
    inertia = 2.5 + 1.8 * np.sin(0.9 * knots)
    return tuple(np.interp(time, knots, signal) for signal in (angle, reference, inertia))


def sensitivity(gains):
    """The largest change of the command for states that are one off each, with and without a direct term."""
    gains = {name: np.abs(gains[name]).sum() for name in ("K_x", "K_f", "K_i", "P_f", "C") if name in gains}
    return gains["K_x"] + gains.get("K_i", 0) + gains["K_f"] * (1 + gains.get("P_f", 0) * (1 + gains["C"]))


@pytest.mark.parametrize("size", [0.05, 0.01])
def test_in_co_simulation_the_fmu_follows_scipys_integration_of_the_equations_through_limits_and_points(drive, size):
    schedule, _, fmu = drive
    names = states_of(schedule)
    z, at_limit = schedule.start(1.0), 0
    z[schedule.n + schedule.q] = course(0)[0]
    with Instance(fmu) as instance:
        instance.start(dict(zip(["angle", "r_angle", "inertia"], course(0.0))))
        for k in range(round(12 / size)):
            now, after = course(k * size), course((k + 1) * size)
            instance.set(dict(zip(["angle", "r_angle", "inertia"], now)))
            slopes = {name: (b - a) / size for name, a, b in zip(["angle", "r_angle", "inertia"], now, after)}
            instance.set_slopes(**slopes)
            # The first value outside of the points is a warning.
            assert instance.call("DoStep", k * size, size, 1) in (OK, WARNING), instance.messages[-1:]

            def right(t, z):
                angle, reference, inertia = (a + (b - a) * (t - k * size) / size for a, b in zip(now, after))
                return schedule.equations(z, np.array([angle]), np.array([reference]), inertia)[0]

            z = solve_ivp(right, (k * size, (k + 1) * size), z, rtol=1e-11, atol=1e-13, method="DOP853").y[:, -1]
            u = schedule.equations(z, np.array(after[:1]), np.array([after[1]]), after[2])[1]
            at_limit += abs(u[0]) == 3
            assert instance.get(*names) == pytest.approx(z, rel=2e-7, abs=2e-7), k
            torque, at = instance.get("torque", "schedule_at")
            assert torque == pytest.approx(u[0], abs=2e-7 * (1 + abs(z).max()) * sensitivity(schedule.numbers(after[2])))
            assert at == pytest.approx(min(max(after[2], 1), 4), rel=1e-12)
    assert at_limit * size > 0.2, "the command is at a limit for a while"


def test_held_inputs_and_events_of_the_activation_need_no_slopes(designed):
    schedule, _, fmu = designed(("robustness.cases = 3", "robustness.cases = 3\nt_on = 0.73"))
    names = states_of(schedule)
    z = schedule.start(1.0)
    inputs = {"angle": 0.1, "r_angle": 0.4, "inertia": 3.3}

    def right(t, z):
        z = np.array(z)
        before = t < 0.73
        frozen = z.copy()
        if before:
            frozen[schedule.n] = 0
        slope, _ = schedule.equations(frozen, np.array([0.1]), np.array([0.4]), 3.3)
        if before:
            slope[schedule.n] = 0
        return slope

    with Instance(fmu) as instance:
        instance.start(inputs)
        for k in range(4):
            instance.step(0.5 * k, 0.5)
            ends = [0.5 * k, *([0.73] if k == 1 else []), 0.5 * (k + 1)]
            for a, b in zip(ends, ends[1:]):
                z = solve_ivp(right, (a, b - 1e-13), z, rtol=1e-11, atol=1e-13).y[:, -1]
            assert instance.get(*names) == pytest.approx(z, rel=1e-7, abs=1e-7)


def test_slopes_of_the_command_include_the_moving_gains(drive):
    schedule, _, fmu = drive
    random = np.random.default_rng(2)
    with Instance(fmu) as instance:
        instance.start({"angle": 0.2, "r_angle": 0.3, "inertia": 1.3})
        instance.step(0.0, 0.4)
        for _ in range(20):
            rates = dict(zip(["angle", "r_angle", "inertia"], 0.3 * random.standard_normal(3)))
            inputs = {"angle": 0.1 * random.standard_normal(), "r_angle": 0.3, "inertia": random.uniform(1.1, 3.9)}
            instance.set(inputs)
            instance.set_slopes(**rates)
            (torque_slope,) = instance.slopes_of("torque")
            (instance_slope,) = instance.slopes_of("f_hat")
            z = np.array(instance.get(*states_of(schedule)))

            def command(t):
                values = {name: inputs[name] + rates[name] * t for name in inputs}
                slope, _ = schedule.equations(z, np.array([inputs["angle"]]), np.array([inputs["r_angle"]]), inputs["inertia"])
                measured, reference = np.array([values["angle"]]), np.array([values["r_angle"]])
                return schedule.equations(z + slope * t, measured, reference, values["inertia"])[1][0]

            if "P_f" in schedule.points[0]:

                def fault(t):
                    slope, _ = schedule.equations(z, np.array([inputs["angle"]]), np.array([inputs["r_angle"]]), inputs["inertia"])
                    moved, point = z + slope * t, schedule.numbers(inputs["inertia"] + rates["inertia"] * t)
                    # The filtered measurement is the state after the one of the fault.
                    e = moved[schedule.n + 1] - point["y_op"][0] - point["C"][0] @ (moved[: schedule.n] - point["x_op"])
                    return moved[schedule.n] + point["P_f"][0, 0] * e

                assert instance_slope == pytest.approx((fault(1e-6) - fault(-1e-6)) / 2e-6, rel=1e-5, abs=1e-6)
            if abs(command(0)) < 2.9:
                assert torque_slope == pytest.approx((command(1e-6) - command(-1e-6)) / 2e-6, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize(
    "case", [FILTERED, MEASURED, (*MEASURED, *by("proportional-integral"))], ids=["input", "measurement", "direct term"],
)
def test_directional_derivatives_are_the_difference_quotients(designed, case):
    schedule, _, fmu = designed(*case, certified=case is FILTERED)
    inputs = {"angle": 0.45, "r_angle": 0.3} | ({"inertia": 2.7} if case is FILTERED else {})
    names = states_of(schedule)
    model = Exchanged(fmu, inputs)
    z = schedule.start(schedule.at[0]) + 0.05 * np.arange(1, len(names) + 1)
    faults = ["f_hat"] if "P_f" in schedule.points[0] else []
    unknowns = [f"der({name})" for name in names] + ["torque", *faults]
    structure = [*fmu.description.derivatives, *fmu.description.outputs]
    stated = {item.variable.name: {variable.name for variable in item.dependencies} for item in structure}

    def values(z, inputs):
        slopes = model.at(0.0, z, inputs)
        return np.array([*slopes, *model.instance.get("torque", *faults)])

    values(z, inputs)
    model.event(0.0)
    for k, name in enumerate([*names, *inputs]):
        step = 1e-6
        moved = []
        for sign in (1, -1):
            changed = z + sign * step * np.eye(len(z))[k] if k < len(z) else z
            input_values = inputs if k < len(z) else inputs | {name: inputs[name] + sign * step}
            moved.append(values(changed, input_values))
        values(z, inputs)
        derivatives = model.instance.directional(unknowns, {name: 1.0})
        quotient = (moved[0] - moved[1]) / (2 * step)
        assert list(derivatives.values()) == pytest.approx(quotient, rel=1e-5, abs=1e-6), name
        for unknown, slope in zip(unknowns, quotient):
            assert name in stated[unknown] or abs(slope) < 1e-9, (unknown, name)


@pytest.mark.parametrize("case", ["drive", "direct term", "spring", "slow spring"])
def test_the_certificate_holds_between_the_points_at_the_stated_rate(designed, case):
    springs = {"spring": (), "slow spring": (rate("0.1"),)}
    law = by("proportional-integral") if case == "direct term" else ()
    schedule, report, _ = designed(*springs[case], text=SPRING) if case in springs else designed(*law)
    fastest = check_certificate(schedule, report["schedule"])
    if case in springs:
        assert fastest == 0.1 if case == "slow spring" else fastest > 0.5


def test_the_energy_falls_while_the_spring_changes_at_the_proven_rate(designed):
    schedule, report, _ = designed(text=SPRING)
    proof = report["schedule"]["bounded_rate"]
    low, high = (np.array(p) for p in proof["p"])
    # From 1 to 9 and back, again and again.
    spring = lambda t: 1 + abs((proof["rate"] * t + 8) % 16 - 8)
    corners = np.arange(0, 4) * 8 / proof["rate"]
    # The loop is a polynomial of degree 2.
    first, middle, last = (schedule.loop(value) for value in (1, 5, 9))
    along = lambda s: (1 - s) * (1 - 2 * s) * first + 4 * s * (1 - s) * middle + s * (2 * s - 1) * last
    assert along(0.3) == pytest.approx(schedule.loop(1 + 8 * 0.3), rel=1e-9, abs=1e-9)
    state, before = np.arange(1.0, 1.0 + len(low)), np.inf
    for a, b in zip(corners, corners[1:]):
        done = solve_ivp(lambda t, x: along((spring(t) - 1) / 8) @ x, (a, b), state, t_eval=np.linspace(a, b, 80), rtol=1e-9, atol=1e-13)
        for t, x in zip(done.t, done.y.T):
            part = (spring(t) - 1) / 8
            energy = x @ ((1 - part) * low + part * high) @ x
            # At a corner the first value is the last one of the part before.
            assert energy < before * (1 if t > a else 1 + 1e-9)
            before = energy
        state = done.y[:, -1]


def test_a_rate_that_is_not_proven_makes_the_verdict_amber_and_says_so(designed):
    _, report, _ = designed(rate("100.0"), text=SPRING)
    certificate = report["schedule"]
    assert "no P was found for the stated rate 100 per s" in str(certificate["bounded_rate"]) and "p" not in certificate["any_rate"]
    reasons = report["verdict"]["reasons"]
    assert any("stability while k changes is not proven" in reason for reason in reasons), reasons
    assert report["verdict"]["level"] == "amber"


@pytest.mark.parametrize("law", [(), by("proportional-integral")], ids=["augmented", "direct term"])
def test_a_measurement_that_schedules_moves_its_own_operating_point(designed, law):
    schedule, report, _ = designed(*MEASURED, *law, certified=False)

    def right(k, state):
        """The plant of a point, whose controller interpolates by the angle."""
        point = schedule.points[k]
        x, z = np.split(state, [schedule.n])
        y = point["y_op"] + np.array(point["C"]) @ (x - point["x_op"])
        value = schedule.at[k] + (y - point["y_op"])[0]
        slope, u = schedule.equations(z, y, np.array(point["r_op"]), value, limited=False)
        return np.concatenate([np.array(point["A"]) @ (x - point["x_op"]) + np.array(point["B"]) @ (u - point["u_op"]), slope])

    for k, entry in enumerate(report["schedule"]["points"]):
        rest = np.concatenate([schedule.points[k]["x_op"], schedule.start(schedule.at[k])])
        worst = -np.inf
        for sign in (1, -1):
            if (k, sign) in ((0, -1), (2, 1)):
                continue
            moved = [(right(k, rest + sign * 1e-6 * e) - right(k, rest)) / (sign * 1e-6) for e in np.eye(len(rest))]
            worst = max(worst, np.linalg.eigvals(np.array(moved).T).real.max())
        assert entry["coupled_instability"] == pytest.approx(worst, abs=1e-4 * (1 + abs(worst))), k


def test_without_integral_action_a_warning_states_the_largest_error_between_the_points(designed):
    schedule, report, _ = designed(*FEEDFORWARD, certified=False)
    (warning,) = [text for text in report["warnings"] if "reached at the points" in text]

    def error(value):
        point = schedule.numbers(value)
        states = np.linalg.solve(-point["A"] - point["B"] @ point["K_x"], point["B"] @ point["N_r"])
        return 1 - (point["C"] @ states)[0, 0]

    values = np.concatenate([np.linspace(low, high, 21) for low, high in ((1, 2), (2, 4))])
    errors = np.abs([error(value) for value in values])
    assert f"misses up to {100 * errors.max():.2f} % of a step" in warning
    for value in schedule.at:
        assert error(value) == pytest.approx(0, abs=1e-9)


def test_a_value_outside_of_the_points_is_held_with_one_warning(drive):
    _, _, fmu = drive
    with Instance(fmu) as instance:
        instance.start({"angle": 0.0, "r_angle": 0.0, "inertia": 3.9})
        instance.set({"inertia": 4.5})
        assert instance.call("DoStep", 0.0, 0.1, 1) in (OK, WARNING)
        instance.set({"inertia": 4.6})
        assert instance.call("DoStep", 0.1, 0.1, 1) == OK
        warnings = [message.text for message in instance.messages if message.status == WARNING]
        assert len(warnings) == 1 and "outside of the schedule" in warnings[0]
        assert instance.get("schedule_at") == [4.0]


def test_a_restored_state_continues_with_the_same_bits(drive):
    _, _, fmu = drive
    with Instance(fmu) as instance, Instance(fmu) as other:
        instance.start(dict(zip(["angle", "r_angle", "inertia"], course(0.0))))
        for k in range(40):
            instance.set(dict(zip(["angle", "r_angle", "inertia"], course(0.1 * k))))
            assert instance.call("DoStep", 0.1 * k, 0.1, 1) in (OK, WARNING)
        saved, runs = serialized(instance), []
        for one in (instance, other):
            restore(one, saved)
            one.set({"angle": 0.7, "inertia": 1.7})
            one.set_slopes(inertia=0.4)
            one.step(4.0, 0.1)
            runs.append(one.outputs())
        assert runs[0] == runs[1]
