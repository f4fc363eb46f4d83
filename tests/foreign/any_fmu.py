"""Runs any FMUs by `aso-ftc run`, and makes the same calls by FMPy's C functions."""

import csv
from contextlib import contextmanager

import numpy as np

from stepped import instantiated

# Every input is held over a step at its value at the start.
HELD = ("--method", "jacobi", "--extrapolation", "hold")


def run(aso_ftc, folder, fmus, step, stop, *more, links=(), status=0, **options):
    """Couples `fmus`, paths by name; returns the columns of results.csv as texts, or the messages."""
    arguments = [part for name, path in fmus.items() for part in ("--fmu", f"{name}={path}")]
    arguments += [part for link in links for part in ("--connect", link)]
    arguments += ["--step", step, "--stop-time", stop, "--out", folder / "out", *HELD, *more]
    done = aso_ftc("run", *arguments, **options)
    assert done.returncode == status, done.stderr
    if status:
        return done.stderr
    with open(folder / "out" / "results.csv", encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    assert len(set(names)) == len(names) and {len(row) for row in rows} == {len(names)}
    return dict(zip(names, zip(*rows)))


def numbers(table, name):
    """A column as doubles."""
    return np.array(table[name], dtype=float)


@contextmanager
def instance(path, folder, settings=None):
    """An initialised instance by FMPy with Reals, Booleans and Integers set, and its variables by name."""
    slave, variables = instantiated(path, folder)
    slave.setupExperiment(startTime=0.0)
    for name, value in (settings or {}).items():
        variable = variables[name]
        place = {"Real": slave.setReal, "Boolean": slave.setBoolean}.get(variable.type, slave.setInteger)
        place([variable.valueReference], [value])
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    yield slave, variables
    slave.terminate()
    slave.freeInstance()


@contextmanager
def referenced(path, folder, settings=None):
    """Such an instance, and its value references by name."""
    with instance(path, folder, settings) as (slave, variables):
        yield slave, {name: variable.valueReference for name, variable in variables.items()}


def stepped(path, folder, step, count, names, settings=None):
    """The Real outputs `names` at 0, H, ..., count H, by FMPy's fmi2DoStep."""
    with instance(path, folder, settings) as (slave, variables):
        references = [variables[name].valueReference for name in names]
        rows = [slave.getReal(references)]
        for k in range(count):
            slave.doStep(currentCommunicationPoint=k * step, communicationStepSize=step)
            rows.append(slave.getReal(references))
    return np.array(rows)
