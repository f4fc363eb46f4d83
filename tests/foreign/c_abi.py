"""The C interface of FMI 2.0 by ctypes: an importer that can also make wrong calls."""

import ctypes
import math
from ctypes import CFUNCTYPE, POINTER, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import NamedTuple

from fmpy import read_model_description

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3

# Variadic in C. Our libraries pass one text for the format "%s", here the last argument.
LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)
SINK = CFUNCTYPE(None, c_void_p, c_void_p, c_size_t)


class Callbacks(ctypes.Structure):
    """`fmi2CallbackFunctions`."""

    _fields_ = [
        ("logger", LOGGER),
        ("allocate_memory", c_void_p),
        ("free_memory", c_void_p),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    ]


class EventInfo(ctypes.Structure):
    """`fmi2EventInfo`."""

    _fields_ = [
        ("new_discrete_states_needed", c_int),
        ("terminate_simulation", c_int),
        ("nominals_of_continuous_states_changed", c_int),
        ("values_of_continuous_states_changed", c_int),
        ("next_event_time_defined", c_int),
        ("next_event_time", c_double),
    ]


C_TYPES = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
REFERENCES, ORDERS = POINTER(c_uint), POINTER(c_int)
REALS, INTEGERS, STRINGS = POINTER(c_double), POINTER(c_int), POINTER(c_char_p)
STATE = POINTER(c_void_p)

# Arguments of every function that has an instance, after the instance.
FUNCTIONS: dict[str, list] = {
    "FreeInstance": [],
    "SetDebugLogging": [c_int, c_size_t, STRINGS],
    "SetupExperiment": [c_int, c_double, c_double, c_int, c_double],
    "EnterInitializationMode": [],
    "ExitInitializationMode": [],
    "Terminate": [],
    "Reset": [],
    **{
        f"{way}{kind}": [REFERENCES, c_size_t, POINTER(c_type)]
        for way in ("Get", "Set")
        for kind, c_type in C_TYPES.items()
    },
    "GetFMUstate": [STATE],
    "SetFMUstate": [c_void_p],
    "FreeFMUstate": [STATE],
    "SerializedFMUstateSize": [c_void_p, POINTER(c_size_t)],
    "SerializeFMUstate": [c_void_p, c_char_p, c_size_t],
    "DeSerializeFMUstate": [c_char_p, c_size_t, STATE],
    "GetDirectionalDerivative": [REFERENCES, c_size_t, REFERENCES, c_size_t, REALS, REALS],
    "SetRealInputDerivatives": [REFERENCES, c_size_t, ORDERS, REALS],
    "GetRealOutputDerivatives": [REFERENCES, c_size_t, ORDERS, REALS],
    "DoStep": [c_double, c_double, c_int],
    "CancelStep": [],
    "GetStatus": [c_int, INTEGERS],
    "GetRealStatus": [c_int, REALS],
    "GetIntegerStatus": [c_int, INTEGERS],
    "GetBooleanStatus": [c_int, INTEGERS],
    "GetStringStatus": [c_int, STRINGS],
    "EnterEventMode": [],
    "NewDiscreteStates": [POINTER(EventInfo)],
    "EnterContinuousTimeMode": [],
    "CompletedIntegratorStep": [c_int, INTEGERS, INTEGERS],
    "SetTime": [c_double],
    "SetContinuousStates": [REALS, c_size_t],
    "GetEventIndicators": [REALS, c_size_t],
    "GetContinuousStates": [REALS, c_size_t],
    "GetDerivatives": [REALS, c_size_t],
    "GetNominalsOfContinuousStates": [REALS, c_size_t],
}
MODEL_EXCHANGE, CO_SIMULATION = 0, 1
INSTANTIATE = [c_char_p, c_int, c_char_p, c_char_p, POINTER(Callbacks), c_int, c_int]
WITHOUT_INSTANCE = ["fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2Instantiate"]
STANDARD_FUNCTIONS = {*WITHOUT_INSTANCE, *(f"fmi2{name}" for name in FUNCTIONS)}


def load(path):
    """Loads the library at `path` and declares the types of its functions."""
    library = ctypes.CDLL(str(path))
    for name, arguments in FUNCTIONS.items():
        function = getattr(library, f"fmi2{name}")
        function.argtypes = [c_void_p, *arguments]
        function.restype = None if name == "FreeInstance" else c_int
    library.fmi2GetTypesPlatform.restype = library.fmi2GetVersion.restype = c_char_p
    library.fmi2Instantiate.argtypes, library.fmi2Instantiate.restype = INSTANTIATE, c_void_p
    if hasattr(library, "fmuDescribe"):
        library.fmuDescribe.argtypes = [c_char_p, c_void_p, SINK]
    return library


def references(*values):
    """Value references as a C array."""
    return (c_uint * len(values))(*values)


def reals(*values):
    """Real numbers as a C array."""
    return (c_double * len(values))(*values)


def integers(*values):
    """Integers as a C array."""
    return (c_int * len(values))(*values)


def texts(*values):
    """Strings as a C array."""
    return (c_char_p * len(values))(*values)


class Fmu:
    """An unpacked FMU: its description by FMPy, its library by ctypes."""

    def __init__(self, folder, library=None):
        self.folder = Path(folder)
        self.description = read_model_description(str(folder))
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.states = len(self.description.derivatives)
        self.indicators = self.description.numberOfEventIndicators
        self.identifier = self.description.coSimulation.modelIdentifier
        self.path = self.folder / "binaries" / "linux64" / f"{self.identifier}.so"
        self.library = library or load(self.path)
        self.resources = (self.folder / "resources").as_uri()

    def names(self, **attributes):
        """Names of the variables with these attributes, in the order of the description."""
        fits = lambda v: all(getattr(v, key) == value for key, value in attributes.items())
        return [name for name, variable in self.variables.items() if fits(variable)]

    def references(self, *names):
        """Value references of the named variables."""
        return references(*(self.variables[name].valueReference for name in names))


class Message(NamedTuple):
    """A call of the importer's logger."""

    environment: int
    instance: str
    status: int
    category: str
    form: str
    text: str


class Instance:
    """An instance with methods named like the C functions; only methods that say so check the status."""

    def __init__(self, fmu, name=b"one", guid=None, resources=None, kind=CO_SIMULATION, log=True):
        self.fmu, self.kind, self.messages = fmu, kind, []
        self.logger = LOGGER(self.receive) if log else LOGGER()
        self.callbacks = Callbacks(self.logger, None, None, None, 0x5EED)
        guid = fmu.description.guid.encode() if guid is None else guid
        resources = (fmu.resources if resources is None else resources).encode()
        self.component = fmu.library.fmi2Instantiate(
            name, kind, guid, resources, byref(self.callbacks), 0, 0
        )

    def __enter__(self):
        assert self.component, self.messages
        return self

    def __exit__(self, *_):
        self.free()

    def free(self):
        """Calls `fmi2FreeInstance` once."""
        if self.component:
            self.fmu.library.fmi2FreeInstance(self.component)
            self.component = None

    def receive(self, environment, instance, status, category, form, text):
        """The logger of the instance."""
        parts = (part.decode() for part in (instance, category, form, text))
        instance, category, form, text = parts
        self.messages.append(Message(environment, instance, status, category, form, text))

    def call(self, function, *arguments):
        """Calls a function and returns its status."""
        return getattr(self.fmu.library, f"fmi2{function}")(self.component, *arguments)

    def must(self, function, *arguments):
        """Calls a function that must succeed."""
        status = self.call(function, *arguments)
        assert status == OK, f"fmi2{function} gives {status}: {self.messages[-1:]}"

    def last_message(self):
        """The text of the newest message, with ## read as #."""
        return self.messages[-1].text.replace("##", "#")

    def set_one(self, name, value):
        """Sets one variable and returns the status."""
        kind = self.fmu.variables[name].type
        place = (C_TYPES[kind] * 1)(value)
        return self.call(f"Set{kind}", self.fmu.references(name), 1, place)

    def set(self, values):
        """Sets variables and checks that they take the values."""
        for name, value in values.items():
            assert self.set_one(name, value) == OK, self.messages[-1:]

    def get(self, *names):
        """Values of variables of one type."""
        kind = self.fmu.variables[names[0]].type
        values = (C_TYPES[kind] * len(names))()
        self.must(f"Get{kind}", self.fmu.references(*names), len(names), values)
        return list(values)

    def outputs(self):
        """Values of all outputs."""
        return self.get(*self.fmu.names(causality="output"))

    def setup(self, start=0.0, stop=None, tolerance=None):
        """`fmi2SetupExperiment`."""
        tolerance = (tolerance is not None, tolerance or 0.0)
        self.must("SetupExperiment", *tolerance, start, stop is not None, stop or 0.0)

    def enter(self, values=None, **experiment):
        """Enters initialization mode, with these values set before."""
        self.setup(**experiment)
        self.set(values or {})
        self.must("EnterInitializationMode")
        return self

    def start(self, values=None, **experiment):
        """Runs through initialization."""
        self.enter(values, **experiment)
        self.must("ExitInitializationMode")
        return self

    def start_exchange(self, values=None, **experiment):
        """Runs through initialization and the first event to continuous-time mode."""
        self.start(values, **experiment)
        info = EventInfo(new_discrete_states_needed=1)
        while info.new_discrete_states_needed:
            self.must("NewDiscreteStates", byref(info))
        self.must("EnterContinuousTimeMode")
        return self

    def set_slopes(self, order=1, **slopes):
        """Input derivatives of one order."""
        orders = integers(*([order] * len(slopes)))
        names = self.fmu.references(*slopes)
        self.must("SetRealInputDerivatives", names, len(slopes), orders, reals(*slopes.values()))

    def slopes_of(self, *names):
        """First derivatives of outputs."""
        values = reals(*([0.0] * len(names)))
        orders = integers(*([1] * len(names)))
        where = self.fmu.references(*names)
        self.must("GetRealOutputDerivatives", where, len(names), orders, values)
        return list(values)

    def try_directional(self, unknowns, direction):
        """Status of `fmi2GetDirectionalDerivative` and its result, by name."""
        to, of = self.fmu.references(*unknowns), self.fmu.references(*direction)
        seed, result = reals(*direction.values()), reals(*[math.nan] * len(unknowns))
        status = self.call(
            "GetDirectionalDerivative", to, len(unknowns), of, len(direction), seed, result
        )
        return status, dict(zip(unknowns, result))

    def directional(self, unknowns, direction):
        """Directional derivatives by name; the call must succeed."""
        status, result = self.try_directional(unknowns, direction)
        assert status == OK, self.messages[-1:]
        return result

    def step(self, time, size):
        """Makes a communication step that must succeed."""
        self.must("DoStep", time, size, 1)


def describe(library, resources):
    """Returns the status of `fmuDescribe` and its description for the folder `resources`."""
    said = []
    sink = SINK(lambda _, text, length: said.append(ctypes.string_at(text, length).decode()))
    return library.fmuDescribe(str(resources).encode(), None, sink), "".join(said)
