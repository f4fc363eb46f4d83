"""An FMU by FMPy, step by step."""

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave, defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE


class Stepped:
    """An FMU by FMPy, step by step."""

    def __init__(self, fmu, folder, start=()):
        description = read_model_description(str(fmu))
        self.names = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=extract(str(fmu), str(folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="own",
        )
        # FMPy's default callbacks pass messages to the logger of the last simulate_fmu, which may be freed.
        self.callbacks = fmi2CallbackFunctions.from_buffer_copy(defaultCallbacks)
        self.callbacks.logger = fmi2CallbackLoggerTYPE(lambda *_: None)
        self.slave.instantiate(callbacks=self.callbacks)
        for name, value in start:
            self.set(name, value)
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def set(self, name, value):
        self.slave.setReal([self.names[name]], [value])

    def get(self, name):
        return self.slave.getReal([self.names[name]])[0]

    def step(self, time, size):
        self.slave.doStep(currentCommunicationPoint=time, communicationStepSize=size)
