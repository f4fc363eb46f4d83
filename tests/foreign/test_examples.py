"""The examples of `fmu` and a new crate, packed, checked and simulated by FMPy.

Oracles: the published output of the Reference-FMUs, closed forms, and numpy.
"""

import os
import shutil
import subprocess

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

from any_fmu import referenced
from conftest import EXAMPLES


def published(root, name):
    """A table of the published output of the Reference-FMUs."""
    return np.genfromtxt(root / "tests" / "data" / name, delimiter=",", names=True, skip_header=1)


@pytest.mark.parametrize("model", EXAMPLES.values())
def test_fmpy_finds_no_problem(examples, model, python):
    assert validate_fmu(str(examples[model])) == []
    done = python("-m", "fmpy", "validate", examples[model])
    assert done.returncode == 0 and "no problems found" in done.stdout.lower(), done


@pytest.mark.parametrize("model", EXAMPLES.values())
def test_fmpy_simulates_it_with_its_default_options(examples, model):
    result = simulate_fmu(str(examples[model]))
    assert len(result) > 1


def test_the_van_der_pol_oscillator_with_euler_steps_gives_the_published_output_up_to_rounding(
    examples, root
):
    table = published(root, "published_van_der_pol.csv")
    result = simulate_fmu(
        str(examples["VanDerPol"]),
        fmi_type="ModelExchange",
        solver="Euler",
        step_size=0.01,
        stop_time=20.0,
        output_interval=0.01,
    )
    assert result["time"][::100] == pytest.approx(table["time"])
    for name in ("x0", "x1"):
        assert result[name][::100] == pytest.approx(table[name], rel=1e-12, abs=1e-12)


def van_der_pol(_, x):
    return [x[1], (1 - x[0] ** 2) * x[1] - x[0]]


def test_cvode_gives_the_solution_of_the_van_der_pol_equation(examples):
    result = simulate_fmu(
        str(examples["VanDerPol"]),
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=1e-9,
        stop_time=20.0,
        output_interval=0.1,
        output=["x0", "x1", "der(x1)"],
    )
    solution = solve_ivp(
        van_der_pol, (0, 20), [2, 0], "DOP853", result["time"], rtol=1e-12, atol=1e-12
    )
    states = np.array([result["x0"], result["x1"]])
    assert abs(states - solution.y).max() < 1e-5
    assert result["der(x1)"] == pytest.approx(van_der_pol(0, states)[1], abs=1e-12)


@pytest.mark.parametrize("interval", [0.01, 0.1, 1.0, 20.0])
@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-9])
def test_co_simulation_integrates_the_van_der_pol_equation_to_the_tolerance_of_the_importer(
    examples, interval, tolerance
):
    result = simulate_fmu(
        str(examples["VanDerPol"]),
        fmi_type="CoSimulation",
        relative_tolerance=tolerance,
        stop_time=20.0,
        output_interval=interval,
    )
    solution = solve_ivp(
        van_der_pol, (0, 20), [2, 0], "DOP853", result["time"], rtol=1e-12, atol=1e-12
    )
    states = np.array([result["x0"], result["x1"]])
    # The oscillator multiplies local errors, by less than 100 in four periods.
    assert abs(states - solution.y).max() < 100 * tolerance


def test_the_directional_derivatives_of_the_van_der_pol_oscillator_give_its_jacobian(
    examples, tmp_path
):
    with referenced(examples["VanDerPol"], tmp_path, {"x0": 0.7, "x1": -1.3}) as (instance, names):
        for known, column in {"x0": [0, 2 * 0.7 * 1.3 - 1], "x1": [1, 1 - 0.7**2]}.items():
            slopes = [names["x1"], names["der(x1)"]]
            derivatives = instance.getDirectionalDerivative(slopes, [names[known]], [1.0])
            assert derivatives == pytest.approx(column, rel=1e-15)


def euler_ball(size, e=0.7, v_min=0.1):
    """The bouncing ball by forward Euler steps; each impact is at the first step below the ground."""
    height, velocity, gravity, heights = 1.0, 0.0, -9.81, [1.0]
    for _ in range(round(3 / size)):
        height, velocity = height + size * velocity, velocity + size * gravity
        if height <= 0 and velocity < 0:
            height, velocity = np.finfo(float).tiny, -velocity * e
            if velocity < v_min:
                velocity = gravity = 0.0
        heights.append(height)
    return np.array(heights)


def test_the_ball_is_the_limit_of_the_published_output_for_small_steps(examples, root):
    table = published(root, "published_bouncing_ball.csv")
    result = simulate_fmu(str(examples["BouncingBall"]), stop_time=3.0, output_interval=0.1)
    assert result["time"] == pytest.approx(table["time"])
    assert euler_ball(1e-3)[::100] == pytest.approx(table["h"], rel=1e-12, abs=1e-12)
    errors = [
        abs(euler_ball(size)[:: round(0.1 / size)] - result["h"]).max()
        for size in (1e-3, 1e-4, 1e-5)
    ]
    assert errors[0] < 0.03
    assert all(small < large / 5 for large, small in zip(errors, errors[1:]))


def closed_form_ball(time, e, v_min=0.1, g=9.81):
    """Height and velocity; the times of the impacts are a geometric series."""
    impact, speed = np.sqrt(2 / g), np.sqrt(2 * g)
    if time < impact:
        return 1.0 - g * time**2 / 2, -g * time
    while (speed := e * speed) >= v_min:
        if time < impact + 2 * speed / g:
            flown = time - impact
            return flown * (speed - g * flown / 2), speed - g * flown
        impact += 2 * speed / g
    return 0.0, 0.0


@pytest.mark.parametrize("size", [3.0, 0.5, 0.01])
@pytest.mark.parametrize("e", [0.5, 0.7, 0.9])
def test_the_ball_follows_the_closed_form_for_every_step(examples, tmp_path, e, size):
    with referenced(examples["BouncingBall"], tmp_path, {"e": e}) as (ball, names):
        for k in range(round(3.0 / size)):
            ball.doStep(k * size, size)
            state = ball.getReal([names["h"], names["v"]])
            assert state == pytest.approx(closed_form_ball((k + 1) * size, e), abs=1e-9)


def test_cvode_and_the_co_simulation_give_the_same_flights_of_the_ball(examples):
    result = simulate_fmu(
        str(examples["BouncingBall"]),
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=1e-9,
        stop_time=3.0,
        output_interval=0.01,
    )
    heights = [closed_form_ball(time, 0.7)[0] for time in result["time"]]
    assert result["h"] == pytest.approx(heights, abs=1e-6)
    # An event has two rows: before and after it.
    impacts = result["time"][:-1][np.diff(result["time"]) == 0]
    expected = [np.sqrt(2 / 9.81)]
    for k in range(1, len(impacts)):
        expected.append(expected[-1] + 2 * 0.7**k * np.sqrt(2 * 9.81) / 9.81)
    assert len(impacts) > 10 and impacts == pytest.approx(expected, abs=1e-6)


def limited(signal, limit):
    return np.clip(signal, -limit, limit)


class VelocityForm:
    """The same controller in velocity form, which computes increments of u."""

    def __init__(self, gain, integral_time, derivative_time, sample_time, limit):
        self.gain, self.limit = gain, limit
        self.integral = sample_time / integral_time
        self.derivative = derivative_time / sample_time
        self.before = None

    def sample(self, mode, setpoint, measurement, manual):
        """Returns u and whether it is at a limit."""
        error = setpoint - measurement
        last = self.before or (0.0, None, measurement)
        rest = self.gain * (error - self.derivative * (measurement - last[2]))
        last_rest = 0.0 if last[1] is None else last[1]
        automatic = last[0] + rest - last_rest + self.gain * self.integral * error
        demand = {0: 0.0, 1: manual, 2: automatic}[mode]
        command = limited(demand, self.limit)
        self.before = (command, rest, measurement)
        return command, abs(demand) > self.limit


PARAMETERS = {"K": 2.0, "T_i": 0.7, "T_d": 0.05, "T_s": 0.1, "u_max": 3.0}
WORDS = {0: "off", 1: "manual", 2: "automatic"}


def drive(fmu, folder, steps, size, inputs, anti_windup=True):
    """Returns u, samples and status after each step; `inputs(k)` gives w, y, u_manual and the mode."""
    rows = []
    with referenced(fmu, folder, PARAMETERS) as (pid, names):
        reals = [names[name] for name in ("w", "y", "u_manual")]
        for k in range(steps):
            *values, mode = inputs(k)
            pid.setReal(reals, values)
            pid.setInteger([names["mode"]], [mode])
            pid.doStep(k * size, size)
            [status] = pid.getString([names["status"]])
            [samples] = pid.getInteger([names["samples"]])
            rows.append((pid.getReal([names["u"]])[0], samples, status.decode()))
    return rows


def test_the_pid_agrees_with_its_velocity_form_in_all_modes_and_at_the_limits(examples, tmp_path):
    random = np.random.default_rng(1)
    signals = random.normal(scale=1.5, size=(400, 3))
    modes = [[0, 1, 2][(k // 23) % 3] for k in range(400)]
    rows = drive(examples["Pid"], tmp_path, 400, 0.1, lambda k: (*signals[k], modes[k]))
    oracle = VelocityForm(*PARAMETERS.values())
    statuses = set()
    for k, (command, samples, status) in enumerate(rows):
        expected, at_limit = oracle.sample(modes[k], *signals[k])
        assert command == pytest.approx(expected, abs=1e-9)
        assert samples == k + 1
        assert status == WORDS[modes[k]] + (", limited" if at_limit else "")
        statuses.add(status)
    assert statuses == {"off", "manual", "automatic", "manual, limited", "automatic, limited"}


def test_the_pid_in_automatic_mode_is_the_sum_of_its_three_terms(examples, tmp_path):
    time = 0.1 * np.arange(60)
    setpoint, measurement = 0.1 * np.ones(60), 0.1 * np.sin(time)
    rows = drive(
        examples["Pid"], tmp_path, 60, 0.1, lambda k: (setpoint[k], measurement[k], 0.0, 2)
    )
    error = setpoint - measurement
    slope = np.diff(measurement, prepend=measurement[0]) / 0.1
    expected = 2.0 * (error + np.cumsum(error) * 0.1 / 0.7 - 0.05 * slope)
    assert (abs(expected) < 3.0).all()
    assert [row[0] for row in rows] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("size", "samples"), [(0.025, [1, 1, 1, 1, 2]), (0.25, [3, 5, 8, 10])])
def test_the_pid_samples_at_multiples_of_its_sample_time(examples, tmp_path, size, samples):
    rows = drive(examples["Pid"], tmp_path, len(samples), size, lambda _: (1.0, 0.0, 0.0, 2))
    assert [row[1] for row in rows] == samples


def test_the_table_agrees_with_numpy_between_at_and_outside_of_its_rows(examples, root, tmp_path):
    path = root / "examples/lookup-table/resources/table.csv"
    table = np.genfromtxt(path, delimiter=",", names=True)
    x, *outputs = table.dtype.names
    points = np.concatenate([np.linspace(-100.0, 900.0, 777), table[x]])
    with referenced(examples["LookupTable"], tmp_path) as (lookup, names):
        for point in points:
            lookup.setReal([names[x]], [point])
            for name in outputs:
                [value] = lookup.getReal([names[name]])
                expected = np.interp(point, table[x], table[name])
                assert value == pytest.approx(expected, rel=1e-14)


def test_a_new_crate_is_tested_packed_and_simulated_outside_of_the_workspace(
    aso_ftc, root, tmp_path
):
    crate = tmp_path / "heat-pump"
    done = aso_ftc("new", "heat-pump", "--path", crate)
    assert done.returncode == 0, done.stderr
    # The versions of this workspace, which most tests have downloaded already.
    shutil.copy(root / "Cargo.lock", crate)
    target = os.environ.get("CARGO_TARGET_DIR", root / "target" / "author")
    shared = {**os.environ, "CARGO_TARGET_DIR": str(target), "CARGO_PROFILE_DEV_DEBUG": "false"}
    done = subprocess.run(["cargo", "test"], cwd=crate, env=shared, capture_output=True, text=True)
    assert done.returncode == 0 and "2 passed" in done.stdout, done.stdout + done.stderr
    done = aso_ftc("pack", crate, "--out", tmp_path, env=shared)
    assert done.returncode == 0, done.stderr
    fmu = str(tmp_path / "HeatPump.fmu")
    assert validate_fmu(fmu) == []
    power = np.array([(0.0, 1500.0), (7200.0, 1500.0)], dtype=[("time", float), ("power", float)])
    result = simulate_fmu(fmu, stop_time=7200.0, output_interval=60.0, input=power)
    expected = 288.15 + 5.0 * np.exp(-result["time"] / 3600.0)
    assert result["T"] == pytest.approx(expected, rel=1e-12)
