"""Continuous scheduled controllers: the FMU beside equations in numpy and scipy's integrator, the report's certificates computed again.

The published example is the missile of examples/plants/schedule, whose nonlinear equations are those of scripts/missile.py.
"""

import functools
import json
import tomllib
from ctypes import byref

import numpy as np
import pytest
from fmpy import extract
from scipy.integrate import solve_ivp

import missile
from c_abi import MODEL_EXCHANGE, OK, WARNING, EventInfo, Fmu, Instance, reals
from excitation import restore, serialized

MATRICES = ["A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f", "K_i", "L_w", "N_r"]
LISTS = ["x_op", "u_op", "y_op", "r_op"]

# A drive whose inertia, spring and friction are known; the operating point depends on them, too.
DRIVE = """A = [[0, 1], [-1.0, -0.5]]
B = [[0], [1]]
C = [[1, 0]]
states = ["phi", "w"]
actuators = [{ name = "torque", limits = [-3.0, 3.0] }]
measurements = [{ name = "angle", operating = 0.0 }]
actuator_faults = "all"
feedback.eigenvalues = [-1.2, -2.0, -2.5]
observer.eigenvalues = [-6.0, -7.0, -8.0]
robustness.cases = 3

[reference]
track = ["angle"]
feedforward = true

[schedule]
variable = "inertia"

[[schedule.points]]
at = 1.0

[[schedule.points]]
at = 2.0
A = [[0, 1], [-1.5, -0.15]]
B = [[0], [0.5]]
x_op = [0.4, 0]
u_op = [1.2]
y_op = [0.4]

[[schedule.points]]
at = 4.0
A = [[0, 1], [-0.375, -0.05]]
B = [[0], [0.25]]
x_op = [0.2, 0]
u_op = [0.3]
y_op = [0.2]

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


def rate(bound):
    """The replacement that states a bound of the rate of the spring."""
    return 'variable = "k"\n', f'variable = "k"\nrate_bound = {bound}\n'


class Schedule:
    """A continuous scheduled design file: interpolation and equations."""

    def __init__(self, text):
        self.own = tomllib.loads(text)
        assert "sample_time" not in self.own
        self.points = self.own["schedule"]["points"]
        self.at = [point["at"] for point in self.points]
        free = [-np.inf, np.inf]
        self.limits = np.transpose([actuator.get("limits", free) for actuator in self.own["actuators"]])
        (self.n, self.q), self.t = np.shape(self.own["F_a"]), len(self.points[0].get("r_op", []))
        self.p = len(self.own["measurements"])
        self.filter = np.array(self.own["filter"]) if "filter" in self.own else None
        self.integrals = self.t if "K_i" in self.points[0] else 0

    def numbers(self, value):
        """Matrices and operating point at a value of the scheduling variable."""
        value = min(max(value, self.at[0]), self.at[-1])
        k = min(np.searchsorted(self.at, value, side="right"), len(self.at) - 1) - 1
        s = (value - self.at[k]) / (self.at[k + 1] - self.at[k])
        low, high = self.points[k], self.points[k + 1]
        names = [name for name in MATRICES + LISTS if name in low]
        return {name: (1 - s) * np.array(low[name]) + s * np.array(high[name]) for name in names}

    def start(self, at):
        """z at the operating point of a point, in the order of the FMU's states."""
        point = self.points[self.at.index(at)]
        filtered = [] if self.filter is None else point["y_op"]
        return np.concatenate([point["x_op"], np.zeros(self.q), filtered, np.zeros(self.integrals)])

    def equations(self, z, y, r, value, limited=True):
        """z' and the commands."""
        own = self.numbers(value)
        filters = 0 if self.filter is None else self.p
        x_hat, f_hat, y_f, x_i = np.split(z, np.cumsum([self.n, self.q, filters]))
        seen = y if self.filter is None else y_f
        x, e, r = x_hat - own["x_op"], seen - own["y_op"], r - own.get("r_op", np.zeros(0))
        e = e - own["C"] @ x
        v = own["u_op"] + own["K_x"] @ x + own["K_f"] @ f_hat
        if "N_r" in own:
            v = v + own["N_r"] @ r
        if self.integrals:
            v = v + own["K_i"] @ x_i
        u = np.clip(v, *self.limits) if limited else v
        parts = [own["A"] @ x + own["B"] @ (u - own["u_op"]) + own["F_a"] @ f_hat + own["L_x"] @ e, own["L_f"] @ e]
        if self.filter is not None:
            parts.append(self.filter * (y - y_f))
        if self.integrals:
            slope = r - np.array(self.own["H"]) @ (y - own["y_op"])
            if "F_i" in self.own:
                slope = slope + np.array(self.own["F_i"]) @ f_hat
            parts.append(slope + (own["L_w"] @ (u - v) if "L_w" in own else 0))
        return np.concatenate(parts), u

    def loop(self, value):
        """The dynamics of the interpolated plant with the controller without a filter, of [x; z]."""
        own, size = self.numbers(value), self.n + len(self.start(self.at[0]))
        rest = np.concatenate([own["x_op"], own["x_op"], np.zeros(self.q + self.integrals)])
        columns = []
        for unit in np.eye(size):
            x, z = np.split(rest + unit, [self.n])
            y = own["y_op"] + own["C"] @ unit[: self.n]
            slope, u = self.equations(z, y, own.get("r_op", np.zeros(0)), value, limited=False)
            columns.append(np.concatenate([own["A"] @ unit[: self.n] + own["B"] @ (u - own["u_op"]), slope]))
        return np.array(columns).T


@pytest.fixture(scope="module")
def designed(aso_ftc, root, packed, tmp_path_factory):
    """Schedule, report and FMU of a plant file after replacements in its text."""

    @functools.cache
    def make(*replacements, certified=True, file=None, text=DRIVE):
        folder = tmp_path_factory.mktemp("plant")
        text = text if file is None else (root / file).read_text(encoding="utf-8")
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


@pytest.fixture(scope="module")
def drive(designed):
    return designed(*FILTERED)


@pytest.fixture(scope="module")
def airframe(designed):
    return designed(file="examples/plants/schedule/missile.toml")


def states_of(schedule):
    """Names of the FMU's continuous states, in the order of z."""
    names = [f"x_hat[{i + 1}]" for i in range(schedule.n)]
    names += ["f_hat"] if schedule.q == 1 else [f"f_hat[{i + 1}]" for i in range(schedule.q)]
    if schedule.filter is not None:
        names += ["y_f"] if schedule.p == 1 else [f"y_f[{k + 1}]" for k in range(schedule.p)]
    if schedule.integrals:
        names += ["x_i"] if schedule.integrals == 1 else [f"x_i[{k + 1}]" for k in range(schedule.integrals)]
    return names


class Exchanged:
    """An FMU in model exchange as a function of time, states and inputs."""

    def __init__(self, fmu, values):
        self.instance = Instance(fmu, kind=MODEL_EXCHANGE)
        self.instance.start_exchange(values)

    def at(self, time, z, inputs):
        """The derivatives of the states."""
        own = self.instance
        own.must("SetTime", time)
        own.must("SetContinuousStates", reals(*z), len(z))
        own.set(inputs)
        slopes = reals(*([0.0] * len(z)))
        # The first value outside of the points is a warning.
        assert own.call("GetDerivatives", slopes, len(z)) in (OK, WARNING)
        return np.array(slopes)

    def event(self, time):
        """Handles an event."""
        info = EventInfo(new_discrete_states_needed=1)
        self.instance.must("EnterEventMode")
        while info.new_discrete_states_needed:
            self.instance.must("NewDiscreteStates", byref(info))
        self.instance.must("EnterContinuousTimeMode")


def test_in_model_exchange_derivatives_and_commands_are_those_of_the_interpolated_equations(drive):
    schedule, _, fmu = drive
    random = np.random.default_rng(5)
    own = Exchanged(fmu, {"angle": 0.0, "inertia": 1.0, "r_angle": 0.0})
    limited = 0
    for _ in range(300):
        z = schedule.start(1.0) + 0.8 * random.standard_normal(len(schedule.start(1.0)))
        # Some values are outside of the points, where they are held.
        angle, wanted, inertia = random.standard_normal(), random.standard_normal(), random.uniform(0.5, 5)
        inputs = {"angle": angle, "inertia": inertia, "r_angle": wanted}
        own.at(0.0, z, inputs)
        own.event(0.0)
        slopes = own.at(0.0, z, inputs)
        expected, u = schedule.equations(z, np.array([angle]), np.array([wanted]), inertia)
        assert slopes == pytest.approx(expected, rel=1e-11, abs=1e-12)
        assert own.instance.get("torque", "schedule_at") == pytest.approx([u[0], min(max(inertia, 1), 4)], rel=1e-12, abs=1e-13)
        limited += abs(u[0]) == 3
    assert 20 < limited < 280, "commands at and between the limits"


def course(time):
    """Angle, reference and inertia of the runs below: piecewise linear between whole numbers of steps of 0.05 s."""
    knots = np.arange(0, 12.01, 0.05)
    angle, wanted = 0.5 * np.sin(1.3 * knots), np.where(knots < 3, 0.2, 1.6)
    inertia = 2.5 + 1.8 * np.sin(0.9 * knots)
    return tuple(np.interp(time, knots, own) for own in (angle, wanted, inertia))


@pytest.mark.parametrize("size", [0.05, 0.01])
def test_in_co_simulation_the_fmu_follows_scipys_integration_of_the_equations_through_limits_and_points(drive, size):
    schedule, _, fmu = drive
    names = states_of(schedule)
    z, time, at_limit = schedule.start(1.0), 0.0, 0
    z[schedule.n + schedule.q] = course(0)[0]
    with Instance(fmu) as own:
        own.start(dict(zip(["angle", "r_angle", "inertia"], course(0.0))))
        for k in range(round(12 / size)):
            now, after = course(k * size), course((k + 1) * size)
            own.set(dict(zip(["angle", "r_angle", "inertia"], now)))
            slopes = {name: (b - a) / size for name, a, b in zip(["angle", "r_angle", "inertia"], now, after)}
            own.set_slopes(**slopes)
            # The first value outside of the points is a warning.
            assert own.call("DoStep", k * size, size, 1) in (OK, WARNING), own.messages[-1:]

            def right(t, z):
                angle, wanted, inertia = (a + (b - a) * (t - k * size) / size for a, b in zip(now, after))
                return schedule.equations(z, np.array([angle]), np.array([wanted]), inertia)[0]

            z = solve_ivp(right, (k * size, (k + 1) * size), z, rtol=1e-11, atol=1e-13, method="DOP853").y[:, -1]
            u = schedule.equations(z, np.array(after[:1]), np.array([after[1]]), after[2])[1]
            at_limit += abs(u[0]) == 3
            assert own.get(*names) == pytest.approx(z, rel=2e-7, abs=2e-7), k
            assert own.get("torque", "schedule_at") == pytest.approx([u[0], min(max(after[2], 1), 4)], rel=5e-6, abs=5e-6)
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

    with Instance(fmu) as own:
        own.start(inputs)
        for k in range(4):
            own.step(0.5 * k, 0.5)
            ends = [0.5 * k, *([0.73] if k == 1 else []), 0.5 * (k + 1)]
            for a, b in zip(ends, ends[1:]):
                z = solve_ivp(right, (a, b - 1e-13), z, rtol=1e-11, atol=1e-13).y[:, -1]
            assert own.get(*names) == pytest.approx(z, rel=1e-7, abs=1e-7)


def test_slopes_of_the_command_include_the_moving_gains(drive):
    schedule, _, fmu = drive
    random = np.random.default_rng(2)
    with Instance(fmu) as own:
        own.start({"angle": 0.2, "r_angle": 0.3, "inertia": 1.3})
        own.step(0.0, 0.4)
        for k in range(20):
            rates = dict(zip(["angle", "r_angle", "inertia"], 0.3 * random.standard_normal(3)))
            inputs = {"angle": 0.1 * random.standard_normal(), "r_angle": 0.3, "inertia": random.uniform(1.1, 3.9)}
            own.set(inputs)
            own.set_slopes(**rates)
            (found,) = own.slopes_of("torque")
            z = np.array(own.get(*states_of(schedule)))

            def command(t):
                values = {name: inputs[name] + rates[name] * t for name in inputs}
                slope, _ = schedule.equations(z, np.array([inputs["angle"]]), np.array([inputs["r_angle"]]), inputs["inertia"])
                return schedule.equations(z + slope * t, np.array([values["angle"]]), np.array([values["r_angle"]]), values["inertia"])[1][0]

            if abs(command(0)) < 2.9:
                assert found == pytest.approx((command(1e-6) - command(-1e-6)) / 2e-6, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("case", [FILTERED, MEASURED], ids=["input", "measurement"])
def test_directional_derivatives_are_the_difference_quotients(designed, case):
    schedule, _, fmu = designed(*case, certified=case is FILTERED)
    inputs = {"angle": 0.45, "r_angle": 0.3} | ({"inertia": 2.7} if case is FILTERED else {})
    names = states_of(schedule)
    own = Exchanged(fmu, inputs)
    z = schedule.start(schedule.at[0]) + 0.05 * np.arange(1, len(names) + 1)
    unknowns = [f"der({name})" for name in names] + ["torque"]
    structure = [*fmu.description.derivatives, *fmu.description.outputs]
    stated = {item.variable.name: {own.name for own in item.dependencies} for item in structure}

    def values(z, inputs):
        slopes = own.at(0.0, z, inputs)
        return np.array([*slopes, *own.instance.get("torque")])

    values(z, inputs)
    own.event(0.0)
    for k, name in enumerate([*names, *inputs]):
        step = 1e-6
        moved = []
        for sign in (1, -1):
            changed = z + sign * step * np.eye(len(z))[k] if k < len(z) else z
            given = inputs if k < len(z) else inputs | {name: inputs[name] + sign * step}
            moved.append(values(changed, given))
        values(z, inputs)
        found = own.instance.directional(unknowns, {name: 1.0})
        quotient = (moved[0] - moved[1]) / (2 * step)
        assert list(found.values()) == pytest.approx(quotient, rel=1e-5, abs=1e-6), name
        for unknown, slope in zip(unknowns, quotient):
            assert name in stated[unknown] or abs(slope) < 1e-9, (unknown, name)


def test_the_missile_flown_by_the_fmu_is_the_missile_flown_by_the_interpolated_equations(airframe):
    """The nonlinear missile slows down from Mach 3.9 to 2.4 while the acceleration follows steps."""
    schedule, _, fmu = airframe
    mach = lambda t: 3.9 - 0.5 * t
    rest = lambda t: np.interp(mach(t), schedule.at, [point["r_op"][0] for point in schedule.points])
    wanted = lambda t: rest(t) + (0 if t < 0.5 else 60 if t < 1.6 else -40)
    x_0, u_0 = missile.rest(mach(0))
    y_0 = missile.outputs(x_0, mach(0))
    z_0 = np.concatenate([x_0, [0.0, 0.0]])
    start = {"eta": y_0[0], "rate": y_0[1], "r_eta": wanted(0), "mach": mach(0)}
    own = Exchanged(fmu, start | {f"x_hat_0[{i + 1}]": value for i, value in enumerate(x_0)})
    size = len(x_0)

    def by_numpy(t, state):
        x, z = np.split(state, [size])
        slope, u = schedule.equations(z, missile.outputs(x, mach(t)), np.array([wanted(t)]), mach(t))
        return np.concatenate([missile.derivatives(x, u[0], mach(t)), slope])

    def by_fmu(t, state):
        x, z = np.split(state, [size])
        y = missile.outputs(x, mach(t))
        slope = own.at(t, z, {"eta": y[0], "rate": y[1], "r_eta": wanted(t), "mach": mach(t)})
        return np.concatenate([missile.derivatives(x, own.instance.get("fin")[0], mach(t)), slope])

    runs = []
    for right in (by_numpy, by_fmu):
        state, rows = np.concatenate([x_0, z_0]), []
        for a, b in ((0, 0.5), (0.5, 1.6), (1.6, 3.0)):
            times = np.linspace(a, b, 101)
            if right is by_fmu:
                right(a, state)
                own.event(a)
            done = solve_ivp(right, (a, b - 1e-12), state, t_eval=np.minimum(times, b - 1e-12), rtol=1e-9, atol=1e-11)
            state, rows = done.y[:, -1], [*rows, *done.y.T]
        runs.append(np.array(rows))
    difference = abs(runs[0] - runs[1]).max(axis=0)
    assert (difference < 1e-6 * (1 + abs(runs[0]).max(axis=0))).all(), difference
    # The command is within its limits, and the acceleration follows: at the end of each part within 2 m/s^2.
    for part, (a, b) in enumerate(((0, 0.5), (0.5, 1.6), (1.6, 3.0))):
        x = runs[1][101 * part + 100][:size]
        assert missile.outputs(x, mach(b))[0] == pytest.approx(wanted(b - 1e-12), abs=2.0), part
    assert abs(runs[1][:, 2]).max() < 0.5


def test_the_points_of_the_missile_are_the_linearisations_of_its_equations(root):
    own = tomllib.loads((root / "examples/plants/schedule/missile.toml").read_text(encoding="utf-8"))
    assert tuple(point["at"] for point in own["schedule"]["points"]) == missile.MACH
    operating = lambda name: [signal.get("operating", 0) for signal in own[name]]
    for point in own["schedule"]["points"]:
        a, b, c, x, u, y = missile.linearised(point["at"])
        for name, matrix in (("A", a), ("B", b), ("C", c)):
            stated = np.array(point.get(name, own[name]), float)
            assert stated == pytest.approx(matrix, rel=1e-8, abs=1e-6)
        for name, signals, values in (("x_op", "states", x), ("u_op", "actuators", [u]), ("y_op", "measurements", y)):
            assert point.get(name, operating(signals)) == pytest.approx(list(values), rel=1e-8, abs=1e-12)
        assert missile.derivatives(x, u, point["at"]) == pytest.approx(np.zeros(4), abs=1e-10)
    # The published atmosphere: 973.3 lb/ft^2 and 1036.4 ft/s.
    assert missile.PRESSURE / 47.88026 == pytest.approx(973.3, rel=1e-3)
    assert missile.SOUND / missile.FOOT == pytest.approx(1036.4, rel=1e-3)


@pytest.mark.parametrize("case", ["missile", "drive", "spring", "slow spring"])
def test_the_certificate_holds_between_the_points_at_the_stated_rate(airframe, designed, case):
    springs = {"spring": (), "slow spring": (rate("0.1"),)}
    if case in springs:
        schedule, report, _ = designed(*springs[case], text=SPRING)
    else:
        schedule, report, _ = airframe if case == "missile" else designed()
    found = report["schedule"]
    values = np.linspace(schedule.at[0], schedule.at[-1], 201)
    loops = [schedule.loop(value) for value in values]
    worst = max(np.linalg.eigvals(a).real.max() for a in loops)
    assert found["worst_instability"] >= worst - 1e-6 and worst < 0
    if "p" in found["any_rate"]:
        p = np.array(found["any_rate"]["p"])
        grid, fastest = [p] * len(schedule.at), 0.0
    else:
        grid, fastest = [np.array(p) for p in found["bounded_rate"]["p"]], found["bounded_rate"]["rate"]
        assert fastest == 0.1 if case == "slow spring" else fastest > 0.5
    assert fastest > 0 or "spring" not in case, "no P serves any rate"
    for value, a in zip(values, loops):
        k = min(np.searchsorted(schedule.at, value, side="right"), len(schedule.at) - 1) - 1
        length = schedule.at[k + 1] - schedule.at[k]
        t = (value - schedule.at[k]) / length
        p = (1 - t) * grid[k] + t * grid[k + 1]
        slope = (grid[k + 1] - grid[k]) / length
        assert np.linalg.eigvalsh(p).min() > 0
        for move in (-fastest, fastest):
            left = -(a.T @ p + p @ a + move * slope)
            scale = 1 / np.sqrt(np.diag(left))
            assert np.linalg.eigvalsh(left * np.outer(scale, scale)).min() > 0, (value, move)


def test_a_rate_that_is_not_proven_makes_the_verdict_amber_and_says_so(designed):
    _, report, _ = designed(rate("100.0"), text=SPRING)
    found = report["schedule"]
    assert "no P was found for the stated rate 100 per s" in str(found["bounded_rate"]) and "p" not in found["any_rate"]
    reasons = report["verdict"]["reasons"]
    assert any("stability while k changes is not proven" in reason for reason in reasons), reasons
    assert report["verdict"]["level"] == "amber"


def test_a_measurement_that_schedules_moves_its_own_operating_point(designed):
    schedule, report, _ = designed(*MEASURED, certified=False)

    def right(k, state):
        """The plant of a point, whose controller interpolates by the angle."""
        point = schedule.points[k]
        x, z = np.split(state, [schedule.n])
        y = point["y_op"] + np.array(point["C"]) @ (x - point["x_op"])
        value = schedule.at[k] + (y - point["y_op"])[0]
        slope, u = schedule.equations(z, y, np.array(point["r_op"]), value, limited=False)
        return np.concatenate([np.array(point["A"]) @ (x - point["x_op"]) + np.array(point["B"]) @ (u - point["u_op"]), slope])

    for k, own in enumerate(report["schedule"]["points"]):
        rest = np.concatenate([schedule.points[k]["x_op"], schedule.start(schedule.at[k])])
        worst = -np.inf
        for sign in (1, -1):
            if (k, sign) in ((0, -1), (2, 1)):
                continue
            moved = [(right(k, rest + sign * 1e-6 * e) - right(k, rest)) / (sign * 1e-6) for e in np.eye(len(rest))]
            worst = max(worst, np.linalg.eigvals(np.array(moved).T).real.max())
        assert own["coupled_instability"] == pytest.approx(worst, abs=1e-4 * (1 + abs(worst))), k


def test_without_integral_action_a_warning_states_the_largest_error_between_the_points(designed):
    schedule, report, _ = designed(*FEEDFORWARD, certified=False)
    (warning,) = [text for text in report["warnings"] if "reached at the points" in text]

    def error(value):
        own = schedule.numbers(value)
        states = np.linalg.solve(-own["A"] - own["B"] @ own["K_x"], own["B"] @ own["N_r"])
        return 1 - (own["C"] @ states)[0, 0]

    values = np.concatenate([np.linspace(low, high, 21) for low, high in ((1, 2), (2, 4))])
    errors = np.abs([error(value) for value in values])
    assert f"misses up to {100 * errors.max():.2f} % of a step" in warning
    for value in schedule.at:
        assert error(value) == pytest.approx(0, abs=1e-9)


def test_a_value_outside_of_the_points_is_held_with_one_warning(drive):
    _, _, fmu = drive
    with Instance(fmu) as own:
        own.start({"angle": 0.0, "r_angle": 0.0, "inertia": 3.9})
        own.set({"inertia": 4.5})
        assert own.call("DoStep", 0.0, 0.1, 1) in (OK, WARNING)
        own.set({"inertia": 4.6})
        assert own.call("DoStep", 0.1, 0.1, 1) == OK
        warnings = [message.text for message in own.messages if message.status == WARNING]
        assert len(warnings) == 1 and "outside of the schedule" in warnings[0]
        assert own.get("schedule_at") == [4.0]


def test_a_restored_state_continues_with_the_same_bits(drive):
    _, _, fmu = drive
    with Instance(fmu) as own, Instance(fmu) as other:
        own.start(dict(zip(["angle", "r_angle", "inertia"], course(0.0))))
        for k in range(40):
            own.set(dict(zip(["angle", "r_angle", "inertia"], course(0.1 * k))))
            assert own.call("DoStep", 0.1 * k, 0.1, 1) in (OK, WARNING)
        saved, runs = serialized(own), []
        for one in (own, other):
            restore(one, saved)
            one.set({"angle": 0.7, "inertia": 1.7})
            one.set_slopes(inertia=0.4)
            one.step(4.0, 0.1)
            runs.append(one.outputs())
        assert runs[0] == runs[1]


def test_the_command_line_says_what_is_proven(aso_ftc, root, tmp_path):
    done = aso_ftc("design", root / "examples/plants/schedule/missile.toml", "--out", tmp_path / "design.toml", "--report", tmp_path / "report.html")
    assert done.returncode in (0, 1), done.stderr
    assert "schedule: proven between the points" in done.stdout
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "At each instant plant model, gains and operating point are interpolated" in " ".join(page.split())
    assert "largest real part of the eigenvalues" in " ".join(page.split())
