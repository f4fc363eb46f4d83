"""Couples a plant FMU and a controller FMU with FMPy: Gauss-Seidel, slopes as input derivatives.

Outputs go to the inputs of the same name; --connect states others. The plant is stepped first, then
the controller. A command, which is not yet known at the end of the step, is continued with the
smaller one of its output derivative and its last difference quotient, as the Rust master does.

A second master, none of it in Rust, to compare with; its summary goes to stdout as JSON: the final
outputs and, over the second half of the time with compensation, half of peak to peak of each
measurement and the root mean square of each difference that --compare states.
"""

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.simulation import apply_start_values

DIST = Path(__file__).resolve().parents[2] / "dist"


class Slave:
    """One FMU instance, its variables addressed by name."""

    def __init__(self, path, name, start_values, folder, hold):
        unpacked = extract(str(path), unzipdir=str(Path(folder) / name))
        description = read_model_description(unpacked)
        flags, self.experiment = description.coSimulation, description.defaultExperiment
        self.takes_slopes = flags.canInterpolateInputs and not hold
        self.gives_slopes = flags.maxOutputDerivativeOrder > 0
        reals = [v for v in description.modelVariables if v.type == "Real"]
        self.name, self.reference = name, {v.name: v.valueReference for v in reals}
        self.inputs = [v.name for v in reals if v.causality == "input"]
        self.outputs = [v.name for v in reals if v.causality == "output"]
        keys = {"guid": description.guid, "modelIdentifier": flags.modelIdentifier}
        self.fmu = FMU2Slave(instanceName=name, unzipDirectory=unpacked, **keys)
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        if unknown := apply_start_values(self.fmu, description, start_values):
            raise ValueError(f"{name} has no variable {', '.join(unknown)}")
        self.fmu.enterInitializationMode()

    def get(self, names):
        """Values of the named Real variables."""
        return self.fmu.getReal([self.reference[name] for name in names])

    def slopes(self, names):
        """Derivatives of the named outputs; zero if the FMU gives none."""
        if not self.gives_slopes:
            return [0.0] * len(names)
        references = [self.reference[name] for name in names]
        return self.fmu.getRealOutputDerivatives(references, [1] * len(names))

    def set(self, names, values):
        """Sets the named Real inputs."""
        self.fmu.setReal([self.reference[name] for name in names], values)

    def step(self, names, begin, latest, slopes, time, step):
        """Advances by `step` while the inputs start at `begin` and grow with `slopes`.

        An FMU that takes no slopes holds the values `latest`.
        """
        self.set(names, begin if self.takes_slopes else latest)
        if self.takes_slopes:
            references = [self.reference[name] for name in names]
            self.fmu.setRealInputDerivatives(references, [1] * len(names), slopes)
        self.fmu.doStep(time, step)


def split(text):
    """Name of the slave and name of its variable."""
    slave, _, variable = text.partition(".")
    if slave not in ("plant", "controller") or not variable:
        raise ValueError(f"expected plant.VARIABLE or controller.VARIABLE, found {text}")
    return slave, variable


def links(source, target, stated):
    """Outputs of `source` and the inputs of `target` connected to them, in two lists."""
    pairs = {name: name for name in target.inputs if name in source.outputs}
    for text in stated:
        (begin, output), (end, port) = map(split, text.rsplit("=", 1))
        if (begin, end) == (source.name, target.name):
            if output not in source.outputs or port not in target.inputs:
                raise ValueError(f"expected OUTPUT=INPUT, both Real, found {text}")
            pairs[port] = output
    if not pairs:
        raise ValueError(f"nothing goes from {source.name} to {target.name}: state --connect")
    return list(pairs.values()), list(pairs)


def limited(slope, quotient):
    """The smaller one in magnitude, or zero if their signs differ (minmod)."""
    return 0.0 if slope * quotient <= 0.0 else min(slope, quotient, key=abs)


def exchange_step(plant, controller, wires, time, step, last):
    """One Gauss-Seidel step: the plant with the slopes of u, then the controller with those of y.

    `last` is u one step ago; the u of this step is returned.
    """
    (measured, read), (commands, driven) = wires
    before, u = plant.get(measured), controller.get(commands)
    quotients = [(new - old) / step for old, new in zip(last, u)]
    plant.step(driven, u, u, list(map(limited, controller.slopes(commands), quotients)), time, step)
    after = plant.get(measured)
    slopes = [(new - old) / step for old, new in zip(before, after)]
    controller.step(read, before, after, slopes, time, step)
    return u


def run(plant, controller, wires, step, stop_time):
    """Time and every output at each communication point, by qualified name."""
    (measured, read), (commands, driven) = wires
    controller.set(read, plant.get(measured))
    plant.set(driven, controller.get(commands))
    plant.fmu.exitInitializationMode()
    controller.fmu.exitInitializationMode()
    record = lambda time: [time, *plant.get(plant.outputs), *controller.get(controller.outputs)]
    rows, u = [record(0.0)], controller.get(commands)
    for k in range(round(stop_time / step)):
        u = exchange_step(plant, controller, wires, k * step, step, u)
        rows.append(record((k + 1) * step))
    names = [f"{slave.name}.{name}" for slave in (plant, controller) for name in slave.outputs]
    return dict(zip(["time", *names], np.transpose(rows)))


def summary(table, measured, t_on, compared):
    """The final outputs, and the residual after the compensation has settled."""
    report = {"final": {name: column[-1] for name, column in table.items()}}
    settled = table["time"] > (t_on + table["time"][-1]) / 2
    if settled.any():
        amplitude = lambda name: np.ptp(table[f"plant.{name}"][settled]) / 2
        report["residual"] = {name: amplitude(name) for name in measured}
        pairs = {text: [table[name] for name in text.rsplit("=", 1)] for text in compared}
        squares = {text: (one - two)[settled] ** 2 for text, (one, two) in pairs.items()}
        report["rms"] = {text: np.sqrt(np.mean(square)) for text, square in squares.items()}
    return report


def write(path, table, every):
    """Writes every n-th row as CSV."""
    rows = np.transpose(list(table.values()))[::every].tolist()
    lines = [",".join(table), *(",".join(map(repr, row)) for row in rows)]
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")


def options():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--plant", default=DIST / "FrictionPendulum.fmu")
    add("--controller", default=DIST / "AsoController.fmu")
    add("--connect", action="append", default=[], metavar="controller.u=plant.v")
    add("--set", action="append", default=[], metavar="plant.F_c=20")
    add("--compare", action="append", default=[], metavar="plant.f_fric=controller.f_hat")
    usual = "by default that of the controller's default experiment"
    add("--step", type=float, help=f"communication step in s, {usual}")
    add("--stop-time", type=float, help=f"in s, {usual}")
    add("--hold", action="store_true", help="hold the inputs over each step, no slopes")
    add("--out", help="CSV file: every output")
    add("--record-every", type=float, default=0.01, help="interval of its rows in s (0.01)")
    return parser, parser.parse_args()


def couple(chosen, folder):
    """Runs the coupling and writes the requested files; returns its summary."""
    values = {"plant": {}, "controller": {}}
    for text in chosen.set:
        name, _, value = text.partition("=")
        slave, variable = split(name)
        values[slave][variable] = value
    plant, controller = both = [Slave(getattr(chosen, n), n, values[n], folder, chosen.hold) for n in values]
    wires = links(plant, controller, chosen.connect), links(controller, plant, chosen.connect)
    experiment = controller.experiment
    step = chosen.step or float(experiment.stepSize)
    stop_time = chosen.stop_time or float(experiment.stopTime)
    t_on = controller.get(["t_on"])[0] if "t_on" in controller.reference else 0.0
    table = run(plant, controller, wires, step, stop_time)
    for slave in both:
        slave.fmu.terminate()
        slave.fmu.freeInstance()
    if chosen.out:
        write(chosen.out, table, max(1, round(chosen.record_every / step)))
    return summary(table, wires[0][0], t_on, chosen.compare)


def main():
    """Runs the coupling and prints the summary."""
    parser, chosen = options()
    with tempfile.TemporaryDirectory() as folder:
        try:
            print(json.dumps(couple(chosen, folder), indent=2))
        except ValueError as error:
            parser.error(str(error))


if __name__ == "__main__":
    main()
