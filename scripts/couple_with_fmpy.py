"""Couples the two FMUs with FMPy: Gauss-Seidel, slopes given as first input derivatives.

u, which is not yet known at the end of the step, is continued with the smaller one of its output
derivative and its last difference quotient, as the Rust master does.

A second master, none of it in Rust, to compare with; its summary goes to stdout as JSON.
"""

import argparse
import json
import re
import tempfile
from pathlib import Path

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.simulation import apply_start_values

DIST = Path(__file__).resolve().parent.parent / "dist"
MEASURED = ["x_p", "theta"]
ROW_INTERVAL, SETTLING_TIME = 0.01, 20.0  # s; settling is counted from the activation


class Slave:
    """One FMU instance, its variables addressed by name."""

    def __init__(self, path, name, start_values, folder):
        unpacked = extract(str(path), unzipdir=str(Path(folder) / name))
        description = read_model_description(unpacked)
        variables, model = description.modelVariables, description.coSimulation.modelIdentifier
        self.name, self.reference = name, {v.name: v.valueReference for v in variables}
        self.outputs = [v.name for v in variables if v.causality == "output"]
        keys = {"guid": description.guid, "modelIdentifier": model, "unzipDirectory": unpacked}
        self.fmu = FMU2Slave(name, **keys)
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        if unknown := apply_start_values(self.fmu, description, start_values):
            raise KeyError(f"{name} has no variable {', '.join(unknown)}")
        self.fmu.enterInitializationMode()

    def get(self, names):
        """Values of the named Real variables."""
        return self.fmu.getReal([self.reference[name] for name in names])

    def step(self, inputs, values, slopes, time, step):
        """Advances by `step` while the inputs start at `values` and grow with `slopes`."""
        references = [self.reference[name] for name in inputs]
        self.fmu.setReal(references, values)
        self.fmu.setRealInputDerivatives(references, [1] * len(inputs), slopes)
        self.fmu.doStep(time, step)


def limited(slope, quotient):
    """The smaller one of both, zero where their signs differ (minmod)."""
    return 0.0 if slope * quotient <= 0.0 else min(slope, quotient, key=abs)


def exchange_step(plant, controller, time, step, last_u):
    """One Gauss-Seidel step: the plant with the slope of u, then the controller with that of y.

    `last_u` is u one step ago; the u of this step is returned.
    """
    before, (u,) = plant.get(MEASURED), controller.get(["u"])
    (slope,) = controller.fmu.getRealOutputDerivatives([controller.reference["u"]], [1])
    plant.step(["u"], [u], [limited(slope, (u - last_u) / step)], time, step)
    slopes = [(new - old) / step for old, new in zip(before, plant.get(MEASURED))]
    controller.step(MEASURED, before, slopes, time, step)
    return u


def record(time, slaves):
    """Time and every output, by qualified name."""
    values = {f"{s.name}.{n}": v for s in slaves for n, v in zip(s.outputs, s.get(s.outputs))}
    return {"time": time, **values}


def run(plant, controller, step, stop_time):
    """Rows every `ROW_INTERVAL` and [x_p, theta, f_fric, f_hat] of each settled step."""
    controller.fmu.setReal([controller.reference[name] for name in MEASURED], plant.get(MEASURED))
    plant.fmu.setReal([plant.reference["u"]], controller.get(["u"]))
    plant.fmu.exitInitializationMode()
    controller.fmu.exitInitializationMode()
    settled_from = controller.get(["t_on"])[0] + SETTLING_TIME
    rows, settled = [record(0.0, (plant, controller))], []
    (u,) = controller.get(["u"])
    for k in range(1, round(stop_time / step) + 1):
        u = exchange_step(plant, controller, (k - 1) * step, step, u)
        if k * step > settled_from:
            settled.append(plant.get([*MEASURED, "f_fric"]) + controller.get(["f_hat"]))
        if k % max(1, round(ROW_INTERVAL / step)) == 0:
            rows.append(record(k * step, (plant, controller)))
    return rows, settled


def summary(final, settled):
    """The final outputs and, if the run was long enough, what is left after compensation."""
    if not settled:
        return {"final": final}
    x_p, theta, friction, estimate = np.transpose(settled)
    residual = {"x_p": np.ptp(x_p) / 2, "theta": np.ptp(theta) / 2}
    rms = np.sqrt(np.mean((friction - estimate) ** 2))
    return {"final": final, "residual": residual, "rms_f_fric_minus_f_hat": rms}


def main():
    """Runs the coupling and prints the summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plant", default=DIST / "FrictionPendulum.fmu")
    parser.add_argument("--controller", default=DIST / "AsoController.fmu")
    parser.add_argument("--step", type=float, default=1e-3, help="communication step in s")
    parser.add_argument("--stop-time", type=float, default=100.0, help="in s")
    parser.add_argument("--out", help="CSV file: every output, every 10 ms")
    parser.add_argument("--set", action="append", default=[], metavar="plant.F_c=20")
    chosen = parser.parse_args()
    start_values = {"plant": {}, "controller": {}}
    for slave, variable, value in (re.split("[.=]", text, maxsplit=2) for text in chosen.set):
        start_values[slave][variable] = value
    with tempfile.TemporaryDirectory() as folder:
        slaves = [Slave(getattr(chosen, n), n, start_values[n], folder) for n in start_values]
        rows, settled = run(*slaves, chosen.step, chosen.stop_time)
        print(json.dumps(summary(record(chosen.stop_time, slaves), settled), indent=2))
        for slave in slaves:
            slave.fmu.terminate()
            slave.fmu.freeInstance()
    if chosen.out:
        lines = [",".join(rows[0]), *(",".join(map(repr, row.values())) for row in rows)]
        Path(chosen.out).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
