#!/usr/bin/env python3
"""What the nonlinearity of a plant does to estimates of its faults: the augmented observer beside extended and unscented
Kalman filters that carry the plant's FMU, for the same noise. Makes the table of docs/how-to/nonlinear.md.

    python scripts/study/nonlinear_filters.py [--json] [--last]

Three plants: the pendulum and the three tanks, started away from the operating point without a fault and without noise, so
that each estimate of a fault is an error; the wind turbine of the benchmark with its noise, whose wind is estimated as a fault of
the rotor. --last takes the last start of each plant only. Needs target/release/aso-ftc, dist/FrictionPendulum.fmu and
dist/KalmanFilter.fmu.
"""

import argparse
import csv
import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
METHODS = ["extended", "unscented"]
PENDULUM = f"""
plant = "{ROOT}/dist/FrictionPendulum.fmu"
operating_point = {{ theta_0 = 0, x_p_0 = 0, F_c = 0, F_s = 0 }}
sample_time = 0.005
actuators = ["u"]
measurements = ["x_p", "theta"]
actuator_faults = "all"
feedback.bandwidth = 8
observer.bandwidth = 60

[robustness]
noise = 0.001
"""
TANKS = """
plant = "ThreeTank.fmu"
sample_time = 1
measurements = ["y_1", "y_2", "y_3"]
actuator_faults = "all"
feedback.bandwidth = 0.012
observer.bandwidth = 0.1

[[actuators]]
name = "Q_1"
limits = [0, 1.2e-4]

[[actuators]]
name = "Q_2"
limits = [0, 1.2e-4]

[robustness]
noise = 0.002
"""
# The torque is held at the operating point, 12 m/s below rated power.
ROTOR = """
plant = "Rotor.fmu"
operating_point = { v = 12, omega_r = 1.6696, omega_g = 158.61, tau_g = 30527, twist = 1.3146e-3 }
sample_time = 0.01
actuators = ["tau_g", "beta"]
measurements = ["omega_r", "omega_g"]
feedback.bandwidth = 0.1
observer.bandwidth = 1
experiment.stop_time = 2200

[[faults]]
name = "wind"
input = "v"

[robustness]
noise = [0.025, 0.05]
"""


def call(*arguments, cwd=ROOT):
    """Runs the command; a design with a red verdict is one, too."""
    done = subprocess.run([ROOT / "target/release/aso-ftc", *map(str, arguments)], cwd=cwd, capture_output=True, text=True)
    if done.returncode > 1 or (done.returncode and arguments[0] != "design"):
        sys.exit(f"{arguments[0]}: {done.stderr}")


def designed(folder, text):
    """Writes Filter.fmu and Controller.fmu for a plant file into `folder`; returns the design."""
    (folder / "plant.toml").write_text(text, encoding="utf-8")
    fmus = ["--kalman-fmu", folder / "Filter.fmu", "--fmu", folder / "Controller.fmu"]
    call("design", folder / "plant.toml", "--out", folder / "design.toml", "--certificate-time", "0", *fmus)
    return tomllib.loads((folder / "design.toml").read_text(encoding="utf-8"))


def run(folder, fmus, links, settings, step, stop, more=""):
    """The results of a system as columns of numbers."""
    lines = ["[fmus]", *(f'{name} = "{path}"' for name, path in fmus.items())]
    for start, end in links:
        lines += ["[[connections]]", f'from = "{start}"', f'to = "{end}"']
    lines += ["[settings]", *(f'"{name}" = {value}' for name, value in settings.items())]
    lines += ["[algorithm]", f"step = {step}", 'extrapolation = "hold"', "[experiment]", f"stop-time = {stop}", more]
    (folder / "system.toml").write_text("\n".join(lines), encoding="utf-8")
    call("run", folder / "system.toml", "--results", folder / "results.csv")
    with (folder / "results.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    # Numbers only: an enumeration is a name.
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if number(rows[0][name])}


def number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def beside_the_controller(folder, plant, names, start, faults, step, stop):
    """The errors of the estimated faults in the loop of the controller, whose filter comes before it: so it gets the
    measurements at the end of a step, and the commands that acted in it."""
    measurements, commands = names
    fmus = {"plant": plant, "filter": folder / "Filter.fmu", "controller": folder / "Controller.fmu"}
    links = [(f"plant.{y}", f"{one}.{y}") for one in ("filter", "controller") for y in measurements]
    links += [(f"controller.{u}", f"{one}.{u}") for one in ("plant", "filter") for u in commands]
    errors = {}
    for method in METHODS:
        settings = {**start, "filter.method": f'"{method}"'}
        results = run(folder, fmus, links, settings, step, stop)
        errors["observer"] = rms([results[f"controller.{name}"] for name in faults])
        errors[method] = rms([results[f"filter.{name}"] for name in faults])
    return errors


def pendulum(folder, chosen):
    """The loop without friction, from three angles in rad."""
    designed(folder, PENDULUM)
    plant = ROOT / "dist/FrictionPendulum.fmu"
    for angle in [0.1, 0.5, 0.9][chosen]:
        start = {"plant.F_c": 0, "plant.F_s": 0, "plant.x_p_0": 0, "plant.theta_0": angle}
        start |= {f"{one}.x_hat_0[2]": angle for one in ("filter", "controller")}
        names = (["x_p", "theta"], ["u"])
        yield f"pendulum, from {angle} rad", "N", beside_the_controller(
            folder, plant, names, start, ["f_hat"], 0.005, 2
        )


def tanks(folder, chosen):
    """The loop from three differences of the first level from the operating point in m."""
    call("pack", ROOT / "examples/three-tank", "--out", folder)
    designed(folder, TANKS)
    for difference in [0.02, 0.1, 0.2][chosen]:
        start = {"plant.h_1": 0.4 + difference, "plant.h_2": 0.2 - difference / 2}
        for one in ("filter", "controller"):
            start |= {f"{one}.x_hat_0[1]": 0.4 + difference, f"{one}.x_hat_0[2]": 0.2 - difference / 2}
        names = (["y_1", "y_2", "y_3"], ["Q_1", "Q_2"])
        faults = ["f_hat[1]", "f_hat[2]"]
        errors = beside_the_controller(folder, folder / "ThreeTank.fmu", names, start, faults, 1, 500)
        errors = {name: 1e6 * error for name, error in errors.items()}
        yield f"three tanks, first level {difference} m high", "1e-6 m3/s", errors


def observed(design, start, inputs, measured):
    """The faults by the observer of a design, whose commands are those of another controller."""

    def matrix(name):
        return np.array(design[name])

    def operating(signals):
        return np.array([signal.get("operating", 0.0) for signal in design[signals]])

    u = inputs - operating("actuators")
    y = measured - operating("measurements")
    x, f = start - operating("states"), np.zeros(1)
    a, b, c, f_a, l_x, l_f = (matrix(name) for name in ("A", "B", "C", "F_a", "L_x", "L_f"))
    estimates = []
    for k in range(len(y)):
        if k > 0:
            x = a @ x + b @ u[k] + f_a @ f
        e = y[k] - c @ x
        x, f = x + l_x @ e, f + l_f @ e
        estimates.append(f[0])
    return np.array(estimates)


def turbine(folder, chosen):
    """The wind of the benchmark, which is estimated from the speeds of rotor and generator, for mean winds in m/s."""
    call("pack", ROOT / "examples/wind-turbine", ROOT / "tests/models/rotor", "--out", folder)
    design = designed(folder, ROTOR)
    fmus = {"turbine": folder / "WindTurbine.fmu", "filter": folder / "Filter.fmu"}
    links = [("turbine.omega_r_m[1]", "filter.omega_r"), ("turbine.omega_g_m[1]", "filter.omega_g")]
    links += [("turbine.tau_g_m", "filter.tau_g"), ("turbine.beta_m1[1]", "filter.beta")]
    for wind in [12, 9, 7][chosen]:
        start = {"turbine.v_mean": wind}
        errors = {}
        for method in METHODS:
            results = run(folder, fmus, links, {**start, "filter.method": f'"{method}"'}, 0.01, 400)
            late = results["time"] > 100
            truth = results["turbine.v"] - 12
            errors[method] = rms((results["filter.f_hat"] - truth)[late])
        inputs = np.array([results["filter.tau_g"], results["filter.beta"]]).T
        measured = np.array([results["filter.omega_r"], results["filter.omega_g"]]).T
        first = np.array([signal["operating"] for signal in design["states"]])
        estimates = observed(design, first, inputs, measured)
        errors["observer"] = rms((estimates - truth)[late])
        yield f"wind turbine, mean wind {wind} m/s", "m/s", errors


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--last", action="store_true", help="the last start of each plant only")
    options = parser.parse_args()
    chosen = slice(-1, None) if options.last else slice(None)
    rows = []
    for study in (pendulum, tanks, turbine):
        with tempfile.TemporaryDirectory() as folder:
            rows += study(Path(folder), chosen)
    if options.json:
        print(json.dumps(rows))
        return
    print("| plant | unit | observer | extended | unscented |\n|---|---|---|---|---|")
    for name, unit, errors in rows:
        print(f"| {name} | {unit} | " + " | ".join(f"{errors[one]:.2g}" for one in ("observer", *METHODS)) + " |")


if __name__ == "__main__":
    main()
