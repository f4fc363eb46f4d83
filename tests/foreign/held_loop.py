"""The closed loop by FMPy with held inputs, all set at once (Jacobi).

libcosim, Ecos and the FMU container do the same, each on its own time grid. Their results are
compared with these bit by bit.
"""

import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.simulation import apply_start_values

STEP, COUNT = 1e-4, 20_000  # s; two seconds
LINKS = [
    ("plant", "x_p", "controller", "x_p"),
    ("plant", "theta", "controller", "theta"),
    ("controller", "u", "plant", "u"),
]
# None of these is a default; F_s is twice that of the paper, so the cart sticks for a while.
SETTINGS = {
    "plant": {"x_p_0": 0.0625, "F_s": 60.0, "linearised": True},
    "controller": {"t_on": 0.5, "f_hat_0": 3.0},
}


def real_outputs(description):
    """Names of the Real outputs."""
    variables = description.modelVariables
    return [v.name for v in variables if v.causality == "output" and v.type == "Real"]


class Slave:
    """One instance of an unpacked FMU, its Real variables addressed by name."""

    def __init__(self, fmu, name, settings):
        description = fmu.description
        self.name, self.outputs = name, real_outputs(description)
        self.reference = {v.name: v.valueReference for v in description.modelVariables}
        self.fmu = FMU2Slave(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=str(fmu.folder),
            instanceName=name,
        )
        self.fmu.instantiate()
        assert not apply_start_values(self.fmu, description, settings)
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()

    def get(self, names):
        """Values of the named variables."""
        return self.fmu.getReal([self.reference[name] for name in names])

    def set(self, names, values):
        """Sets the named variables."""
        self.fmu.setReal([self.reference[name] for name in names], values)


class HeldLoop:
    """The plant and the controller; the caller decides when to `exchange` and to `step`."""

    def __init__(self, fmus, settings):
        self.slaves = {name: Slave(fmus[name], name, settings[name]) for name in fmus}

    def exchange(self):
        """Reads all connected outputs, then sets all inputs."""
        values = [self.slaves[source].get([name])[0] for source, name, _, _ in LINKS]
        for value, (_, _, sink, name) in zip(values, LINKS):
            self.slaves[sink].set([name], [value])

    def finish_initialization(self):
        """Leaves the initialization mode of both."""
        for slave in self.slaves.values():
            slave.fmu.exitInitializationMode()

    def step(self, time, step):
        """Advances both from `time` by `step`, in s."""
        for slave in self.slaves.values():
            slave.fmu.doStep(time, step)

    def row(self):
        """Every Real output, first those of the plant."""
        return [value for slave in self.slaves.values() for value in slave.get(slave.outputs)]

    def names(self):
        """The variables in `row`, as (slave, variable)."""
        return [(slave.name, name) for slave in self.slaves.values() for name in slave.outputs]

    def close(self):
        """Terminates and frees both."""
        for slave in self.slaves.values():
            slave.fmu.terminate()
            slave.fmu.freeInstance()


def held_loop(fmus, grid, settings=SETTINGS, exchange_before_reading=False):
    """Names and rows of all Real outputs after each step of `grid`, pairs of time and step in s.

    The values of outputs that depend directly on an input differ, depending on whether they are read
    before or after the new input is set.
    """
    loop = HeldLoop(fmus, settings)
    for _ in LINKS:
        loop.exchange()
    loop.finish_initialization()
    loop.exchange()
    rows = []
    for time, step in grid:
        loop.step(time, step)
        if exchange_before_reading:
            loop.exchange()
        rows.append(loop.row())
        if not exchange_before_reading:
            loop.exchange()
    loop.close()
    return loop.names(), np.array(rows)


def expect_equal(names, expected, results):
    """Fails at the first value whose bits differ."""
    assert expected.shape == results.shape
    for (slave, name), reference, column in zip(names, expected.T, results.T):
        different = np.flatnonzero(reference.view(np.int64) != column.view(np.int64))
        first = different[0] if different.size else 0
        text = f"{slave}.{name} after {first + 1} steps: {reference[first]} and {column[first]}"
        assert not different.size, text
