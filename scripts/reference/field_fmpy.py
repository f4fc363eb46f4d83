"""FMPy's side of scripts/reference/field: does one task with one FMU in this process and writes the result as JSON.

    field_fmpy.py validate FMU OUT
    field_fmpy.py defaults FMU OUT
    field_fmpy.py timed FMU OUT STOP STEP NAMES     (the rows to OUT with the suffix .npy)
    field_fmpy.py set FMU OUT STOP STEP VALUES      (NAMES and VALUES: JSON files)
    field_fmpy.py replay FMU OUT STOP STEP CALLS    (the steps of another importer: times and sizes; rows as of timed)
"""

import json
import sys
from pathlib import Path

import fmpy
import fmpy.validation
import numpy
from fmpy.fmi2 import FMU2Slave

COMMON = {"fmi_type": "CoSimulation", "validate": False}


def validate(fmu):
    """Counts the problems that FMPy's validation finds."""
    return {"problems": [str(problem) for problem in fmpy.validation.validate_fmu(fmu)]}


def defaults(fmu):
    """Simulates without options."""
    rows = fmpy.simulate_fmu(fmu, **COMMON)
    return {"reached": float(rows["time"][-1])}


def timed(fmu, out, stop, step, names):
    """Simulates with a stated stop time and step, and records the named variables."""
    rows = fmpy.simulate_fmu(fmu, stop_time=stop, output_interval=step, output=names, **COMMON)
    numpy.save(Path(out).with_suffix(".npy"), rows)
    return {"reached": float(rows["time"][-1])}


def replay(fmu, out, stop, chosen):
    """Makes the calls of another importer by FMPy's functions; each row has the time at which its step ends."""
    description = fmpy.read_model_description(fmu, validate=False)
    variables = [v for name in chosen["names"] for v in description.modelVariables if v.name == name]
    experiment = description.defaultExperiment
    tolerance = experiment and experiment.tolerance
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(fmu),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="m",
    )
    slave.instantiate()
    start = chosen["steps"][0][0]
    slave.setupExperiment(tolerance=tolerance and float(tolerance), startTime=start, stopTime=stop)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    getters = {"Real": slave.getReal, "Boolean": slave.getBoolean, "String": slave.getString}

    def row(time):
        values = [getters.get(v.type, slave.getInteger)([v.valueReference])[0] for v in variables]
        return (time, *values)

    rows = [row(start)]
    for time, size in chosen["steps"]:
        slave.doStep(currentCommunicationPoint=time, communicationStepSize=size)
        rows.append(row(time + size))
    kinds = {"Real": "f8", "Boolean": "?", "String": "O"}
    columns = [("time", "f8"), *((v.name, kinds.get(v.type, "i4")) for v in variables)]
    numpy.save(Path(out).with_suffix(".npy"), numpy.array(rows, dtype=columns))
    return {"reached": rows[-1][0]}


def accepted_starts(fmu, stop, step, values):
    """Simulates with start values; returns which of them are in the first row."""
    rows = fmpy.simulate_fmu(
        fmu, stop_time=stop, output_interval=step, start_values=values, output=list(values), **COMMON
    )
    first = {name: float(rows[name][0]) for name in values}
    return {"kept": [name for name, value in values.items() if abs(first[name] - value) <= 1e-9 * abs(value)]}


def main():
    """Does the task of the arguments."""
    task, fmu, out, *rest = sys.argv[1:]
    numbers = [float(text) for text in rest[:2]]
    chosen = json.loads(Path(rest[2]).read_text(encoding="utf-8")) if len(rest) > 2 else None
    calls = {
        "validate": lambda: validate(fmu),
        "defaults": lambda: defaults(fmu),
        "timed": lambda: timed(fmu, out, numbers[0], numbers[1], chosen),
        "replay": lambda: replay(fmu, out, numbers[0], chosen),
        "set": lambda: accepted_starts(fmu, numbers[0], numbers[1], chosen),
    }
    try:
        said = calls[task]()
    except Exception as error:  # whatever FMPy raises is the result
        said = {"error": f"{type(error).__name__}: {error}"[:300]}
    Path(out).write_text(json.dumps(said), encoding="utf-8")


if __name__ == "__main__":
    main()
