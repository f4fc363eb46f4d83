"""FMPy's side of scripts/field: does one thing with one FMU in this process and writes what came of it as JSON.

    field_fmpy.py validate FMU OUT
    field_fmpy.py defaults FMU OUT
    field_fmpy.py timed FMU OUT STOP STEP NAMES     (the rows to OUT with the suffix .npy)
    field_fmpy.py set FMU OUT STOP STEP VALUES      (NAMES and VALUES: JSON files)
"""

import json
import sys
from pathlib import Path

import fmpy
import fmpy.validation
import numpy

COMMON = {"fmi_type": "CoSimulation", "validate": False}


def validate(fmu):
    """Says how many problems FMPy's validation finds."""
    return {"problems": [str(problem) for problem in fmpy.validation.validate_fmu(fmu)]}


def defaults(fmu):
    """Simulates without options."""
    rows = fmpy.simulate_fmu(fmu, **COMMON)
    return {"reached": float(rows["time"][-1])}


def timed(fmu, out, stop, step, names):
    """Simulates with a stated stop time and step and records the variables named."""
    rows = fmpy.simulate_fmu(fmu, stop_time=stop, output_interval=step, output=names, **COMMON)
    numpy.save(Path(out).with_suffix(".npy"), rows)
    return {"reached": float(rows["time"][-1])}


def kept(fmu, stop, step, values):
    """Simulates with start values; says which of them are in the first row."""
    rows = fmpy.simulate_fmu(
        fmu, stop_time=stop, output_interval=step, start_values=values, output=list(values), **COMMON
    )
    first = {name: float(rows[name][0]) for name in values}
    return {"kept": [name for name, value in values.items() if abs(first[name] - value) <= 1e-9 * abs(value)]}


def main():
    """Does what the arguments say."""
    task, fmu, out, *rest = sys.argv[1:]
    numbers = [float(text) for text in rest[:2]]
    chosen = json.loads(Path(rest[2]).read_text(encoding="utf-8")) if len(rest) > 2 else None
    calls = {
        "validate": lambda: validate(fmu),
        "defaults": lambda: defaults(fmu),
        "timed": lambda: timed(fmu, out, *numbers, chosen),
        "set": lambda: kept(fmu, *numbers, chosen),
    }
    try:
        said = calls[task]()
    except Exception as error:  # noqa: BLE001 - whatever FMPy raises is the result
        said = {"error": f"{type(error).__name__}: {error}"[:300]}
    Path(out).write_text(json.dumps(said), encoding="utf-8")


if __name__ == "__main__":
    main()
