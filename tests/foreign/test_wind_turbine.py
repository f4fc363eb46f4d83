"""The wind turbine benchmark: the turbine against scipy, its monitor against the faults."""

import numpy as np
import pytest
from fmpy import validation
from scipy.integrate import solve_ivp

from any_fmu import numbers

PERIOD = 0.01
RADIUS, DENSITY, GEAR, ROTOR, GENERATOR = 57.5, 1.225, 95.0, 55e6, 390.0


@pytest.fixture(scope="module")
def fmus(aso_ftc, root, tmp_path_factory):
    """The packed FMUs of the turbine and of its monitor."""
    out = tmp_path_factory.mktemp("wind")
    folders = [root / "examples" / name for name in ("wind-turbine", "wind-turbine-monitor")]
    done = aso_ftc("pack", *folders, "--out", out)
    assert done.returncode == 0, done.stderr
    return {"turbine": out / "WindTurbine.fmu", "monitor": out / "WindTurbineMonitor.fmu"}


def run(aso_ftc, fmus, folder, stop, settings):
    """Runs the turbine and its monitor; returns the columns of the results."""
    sets = [part for name, value in settings.items() for part in ("--set", f"{name}={value}")]
    parts = [part for name, path in fmus.items() for part in ("--fmu", f"{name}={path}")]
    times = ["--step", PERIOD, "--stop-time", stop, "--record-every", "step"]
    done = aso_ftc("run", *parts, *times, *sets, "--out", folder)
    assert done.returncode == 0, done.stderr
    rows = (folder / "results.csv").read_text().splitlines()
    columns = zip(*(row.split(",") for row in rows[1:]))
    return dict(zip((name.strip('"') for name in rows[0].split(",")), columns))


def power_coefficient(lam, beta):
    """Heier's formula (1998), scaled to the benchmark's maximum of 0.4554 at 0 degrees."""
    inverse = 1 / (lam + 0.08 * beta) - 0.035 / (beta**3 + 1)
    lift = 0.5176 * (116 * inverse - 0.4 * beta - 5) * np.exp(-21 * inverse)
    return 0.4554 / 0.48 * (lift + 0.0068 * lam)


def slopes(state, wind, torque, errors):
    """The benchmark's equations: drive train, converter, three pitch actuators."""
    omega_r, omega_g, twist, tau = state[:4]
    beta, rate = state[4:7], state[7:]
    coefficient = np.mean([power_coefficient(omega_r * RADIUS / wind, max(b, 0.0)) for b in beta])
    aerodynamic = 0.5 * DENSITY * np.pi * RADIUS**2 * wind**3 * coefficient / omega_r
    shaft = 2.7e9 * twist + 775.49 * (omega_r - omega_g / GEAR)
    return np.concatenate((
        [
            (aerodynamic - shaft - 7.11 * omega_r) / ROTOR,
            (0.97 * shaft / GEAR - 45.6 * omega_g - tau) / GENERATOR,
            omega_r - omega_g / GEAR,
            50 * (torque - tau),
        ],
        rate,
        11.11**2 * errors - 2 * 0.6 * 11.11 * rate,
    ))


def test_the_turbine_follows_the_equations_of_the_benchmark(aso_ftc, fmus, tmp_path):
    settings = {"turbine.v_mean": 16, "turbine.turbulence": 0, "turbine.noise": 0}
    table = run(aso_ftc, fmus, tmp_path, 60, settings)
    column = {name: numbers(table, f"turbine.{name}") for name in (
        "omega_r", "omega_g", "tau_g", "beta[1]", "beta[2]", "beta[3]", "beta_ref", "tau_ref")}
    mean = np.array([
        (numbers(table, f"turbine.beta_m1[{i}]") + numbers(table, f"turbine.beta_m2[{i}]")) / 2
        for i in (1, 2, 3)
    ])
    speed = column["omega_r"][0]
    twist = (column["tau_g"][0] + 45.6 * speed * GEAR) * GEAR / 0.97 / 2.7e9
    state = np.concatenate(([speed, speed * GEAR, twist, column["tau_g"][0]], np.zeros(6)))
    assert max(column["beta[1]"]) > 5, "the pitch angle moves"
    for k in range(len(mean[0]) - 1):
        held = 16.0, column["tau_ref"][k], column["beta_ref"][k] - mean[:, k]
        solved = solve_ivp(
            lambda _, x: slopes(x, *held), (0, PERIOD), state, "DOP853", rtol=1e-10, atol=1e-10
        )
        state = solved.y[:, -1]
        values = [column[name][k + 1] for name in ("omega_r", "omega_g", "tau_g", "beta[1]", "beta[3]")]
        expected = state[[0, 1, 3, 4, 6]]
        assert np.allclose(values, expected, rtol=1e-4, atol=1e-4), (k, values, expected)


# Fault, start, end, alarm, largest number of samples until the alarm.
FAULTS = [
    (5, 60, 70, "omega_r_m[2]", 10),
    (5, 60, 70, "omega_g_m[1]", 10),
    (4, 80, 90, "omega_r_m[1]", 10),
    (1, 100, 110, "beta_m1[1]", 10),
    (2, 120, 130, "beta_m2[2]", 10),
    (3, 140, 150, "beta_m1[3]", 10),
    (8, 160, 170, "converter", 5),
    (6, 190, 290, "pitch[2]", 10_000),
    (7, 300, 400, "pitch[3]", 10_000),
]


def test_every_fault_is_isolated_and_sensor_faults_within_ten_samples(aso_ftc, fmus, tmp_path):
    settings = {"turbine.v_mean": 18, "turbine.seed": 11}
    settings |= {f"turbine.fault_from[{number}]": start for number, start, *_ in FAULTS}
    settings |= {f"turbine.fault_until[{number}]": end for number, _, end, *_ in FAULTS}
    table = run(aso_ftc, fmus, tmp_path, 410, settings)
    time = numbers(table, "time")
    alarms = {name: np.array(values) == "1" for name, values in table.items() if ".fault_" in name}
    alarms = {name.removeprefix("monitor.fault_"): on for name, on in alarms.items() if "monitor" in name}
    assert len(alarms) == 14
    for number, start, end, name, samples in FAULTS:
        first = time[alarms[name] & (time >= start - 1e-6)][0]
        assert first - start <= samples * PERIOD + 1e-6, (number, name, first - start)
        alarms[name] &= (time < start - 1e-6) | (time > end + 3)
    false = {name: (on.sum(), time[on][0], time[on][-1]) for name, on in alarms.items() if on.any()}
    assert not false, "samples, first and last time of false alarms"


@pytest.mark.parametrize("name", ["turbine", "monitor"])
def test_fmpy_finds_no_problem(fmus, name):
    assert validation.validate_fmu(str(fmus[name])) == []
