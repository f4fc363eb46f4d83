"""FMUs by FMPy, step by step."""

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave, defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE


def instantiated(fmu, folder):
    """A slave of the FMU, unpacked in `folder`, that drops its messages, and its variables by name."""
    description = read_model_description(str(fmu))
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=extract(str(fmu), str(folder)),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="slave",
    )
    # FMPy's default callbacks pass messages to the logger of the last simulate_fmu, which may be freed.
    callbacks = fmi2CallbackFunctions.from_buffer_copy(defaultCallbacks)
    callbacks.logger = fmi2CallbackLoggerTYPE(lambda *_: None)
    slave.instantiate(callbacks=callbacks)
    return slave, {variable.name: variable for variable in description.modelVariables}


class Stepped:
    """An initialised slave whose variables are addressed by name."""

    def __init__(self, fmu, folder, start=()):
        self.slave, variables = instantiated(fmu, folder)
        self.names = {name: variable.valueReference for name, variable in variables.items()}
        for name, value in start:
            self.set(name, value)
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def set(self, name, value):
        """Sets a Boolean or a Real."""
        place = self.slave.setBoolean if isinstance(value, bool) else self.slave.setReal
        place([self.names[name]], [value])

    def get(self, *names):
        """Reals as an array."""
        return np.array(self.slave.getReal([self.names[name] for name in names]))

    def set_reals(self, names, values):
        self.slave.setReal([self.names[name] for name in names], list(values))

    def step(self, time, size):
        self.slave.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def number(self):
        """The number of the gains in use."""
        return self.slave.getInteger([self.names["reconfiguration"]])[0]

    def close(self):
        self.slave.terminate()
        self.slave.freeInstance()
