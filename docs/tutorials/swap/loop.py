"""A co-simulation in a few lines of FMPy: a plant and a controller, inputs held, both stepped from the same values.

Usage: python docs/tutorials/swap/loop.py PLANT.fmu CONTROLLER.fmu [VARIABLE=VALUE]...

Outputs go to the inputs of the same name. A VARIABLE is a parameter of the controller. Prints, for each output of
the plant, the largest value and half of peak to peak over the last 20 s.
"""

import sys
import tempfile

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.simulation import apply_start_values

STEP, STOP = 1e-3, 60.0  # s


def instantiate(path, name, settings):
    """An instance in initialization mode, its inputs and its outputs (name to value reference)."""
    folder = extract(path, unzipdir=tempfile.mkdtemp())
    description = read_model_description(folder)
    identifier = description.coSimulation.modelIdentifier
    fmu = FMU2Slave(
        guid=description.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName=name
    )
    fmu.instantiate()
    apply_start_values(fmu, description, settings)
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    reals = [v for v in description.modelVariables if v.type == "Real"]
    ends = [{v.name: v.valueReference for v in reals if v.causality == c} for c in ("input", "output")]
    return fmu, *ends


def main():
    """Couples both for STOP seconds and prints what the plant did."""
    plant, driven, measured = instantiate(sys.argv[1], "plant", {})
    settings = dict(text.split("=") for text in sys.argv[3:])
    controller, read, commands = instantiate(sys.argv[2], "controller", settings)

    def exchange():
        for source, outputs, sink, inputs in (
            (plant, measured, controller, read),
            (controller, commands, plant, driven),
        ):
            names = [name for name in inputs if name in outputs]
            values = source.getReal([outputs[name] for name in names])
            sink.setReal([inputs[name] for name in names], values)

    exchange()
    plant.exitInitializationMode()
    controller.exitInitializationMode()
    rows = []
    for k in range(round(STOP / STEP)):
        exchange()
        plant.doStep(k * STEP, STEP)
        controller.doStep(k * STEP, STEP)
        rows.append(plant.getReal(list(measured.values())))
    for name, *values in zip(measured, *rows):
        last = values[-round(20 / STEP) :]
        swing = (max(last) - min(last)) / 2
        print(f"{name}: largest {max(map(abs, values)):.4g}, last 20 s +-{swing:.2g}")
    for fmu in (plant, controller):
        fmu.terminate()
        fmu.freeInstance()


if __name__ == "__main__":
    main()
