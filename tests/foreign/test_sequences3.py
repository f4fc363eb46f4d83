"""Random sequences of calls of FMI 3.0, legal and illegal, against the standard's lists of allowed function calls."""

import csv
import random
from ctypes import CDLL, CFUNCTYPE, byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_uint64, c_void_p
from pathlib import Path

import fmpy
import pytest

TYPES = "Float32 Float64 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Boolean String Binary".split()
SETS = {"T": TYPES, "R": TYPES[:2], "D": ["Decimal", "Fraction"]}
OK, ERROR = 0, 3
LOG = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
SEQUENCES, LENGTH = 400, 40


@pytest.fixture(scope="session")
def plant3(aso_ftc, root, tmp_path_factory):
    """The plant as FMI 3.0: its description and its library."""
    out = tmp_path_factory.mktemp("sequences3")
    done = aso_ftc("pack", root / "fmu-plant", "--fmi", "3", "--out", out)
    assert done.returncode == 0, done.stderr
    (archive,) = out.glob("*.fmu")
    unpacked = Path(fmpy.extract(str(archive)))
    library = CDLL(str(unpacked / "binaries" / "x86_64-linux" / "FrictionPendulum.so"))
    for function in ("InstantiateModelExchange", "InstantiateCoSimulation"):
        getattr(library, f"fmi3{function}").restype = c_void_p
    return fmpy.read_model_description(str(archive)), library


def allowed(root):
    """The functions that may be called, by interface and state."""
    path = root / "crates" / "fmu-description" / "src" / "call_order3" / "allowed_function_calls.csv"
    rows = csv.reader(line for line in path.read_text().splitlines() if not line.startswith("#"))
    table = {}
    for _, state, interface, functions in rows:
        names = set()
        for name in functions.replace("~", "").split():
            start, brace, kind = name.partition("{")
            names |= {start + suffix for suffix in SETS[kind[0]]} if brace else {name}
        for interface_type in ("ModelExchange", "CoSimulation") if interface == "both" else (interface,):
            table.setdefault((interface_type, state), set()).update(names)
    for interface, state in list(table):
        table[interface, state] |= table[interface, "FMUStateSettable"]
        if state in ("EventMode", "ContinuousTimeMode", "StepMode"):
            table[interface, state] |= table[interface, "Initialized"]
    return table


class Life:
    """An instance, the state that the standard prescribes, and the messages."""

    def __init__(self, plant3, table, exchange, event_mode):
        self.description, self.library = plant3
        self.table, self.event_mode = table, event_mode
        self.interface = "ModelExchange" if exchange else "CoSimulation"
        self.messages = []
        self.logger = LOG(lambda _, status, category, text: self.messages.append((status, text)))
        token = self.description.instantiationToken.encode()
        first = (b"life", token, None, c_bool(False), c_bool(True))
        last = (None, self.logger)
        if exchange:
            instance = self.library.fmi3InstantiateModelExchange(*first, *last)
        else:
            middle = (c_bool(event_mode), c_bool(False), None, c_size_t(0))
            instance = self.library.fmi3InstantiateCoSimulation(*first, *middle, *last, None)
        assert instance, self.messages
        self.instance = c_void_p(instance)
        self.saved, self.snapshot = c_void_p(), None
        self.start_over()
        self.states = self.count("GetNumberOfContinuousStates") if exchange else 0
        self.indicators = self.count("GetNumberOfEventIndicators") if exchange else 0
        self.output = next(variable.valueReference for variable in self.description.modelVariables if variable.causality == "output")
        self.count_dependencies()

    def start_over(self):
        """After the instantiation and fmi3Reset."""
        self.state, self.time, self.updated = "Instantiated", 0.0, False

    def raw(self, name, *arguments):
        """Calls the function and returns its status."""
        return getattr(self.library, f"fmi3{name}")(self.instance, *arguments)

    def count(self, name):
        """One of the two numbers of model exchange."""
        number = c_size_t()
        assert self.raw(name, byref(number)) == OK
        return number.value

    def count_dependencies(self):
        """Their number differs before and after the initialization."""
        number = c_size_t()
        assert self.raw("GetNumberOfVariableDependencies", c_uint32(self.output), byref(number)) == OK
        self.dependencies = number.value

    def free(self):
        """Frees the saved state and the instance."""
        self.raw("FreeFMUState", byref(self.saved))
        self.library.fmi3FreeInstance.restype = None
        self.raw("FreeInstance")

    def expected(self, name):
        """The statuses that the standard allows for a call with valid arguments."""
        if name in ("EnterConfigurationMode", "ExitConfigurationMode"):
            return {ERROR}  # the model has no structural parameters
        if name == "EnterEventMode" and self.interface == "CoSimulation" and not self.event_mode:
            return {ERROR}
        if name not in self.table[self.interface, self.state]:
            return {ERROR}
        if name in ("EnterContinuousTimeMode", "EnterStepMode") and not self.updated:
            return {OK, ERROR}  # the discrete states may still need an update
        return {OK}

    def arguments(self, name):
        """Valid arguments."""
        none, zero = None, c_size_t(0)
        flags = [byref(c_bool()) for _ in range(5)]
        if name in ("DoStep",):
            self.reached = c_double(self.time)
            return c_double(self.time), c_double(0.01), c_bool(True), *flags[:3], byref(self.reached)
        if name == "UpdateDiscreteStates":
            return *flags, byref(c_double())
        if name.endswith(("Binary",)):
            return none, zero, none, none, zero
        if name in ("GetClock", "SetClock"):
            return none, zero, none
        if name in ("GetIntervalDecimal", "GetShiftFraction", "SetIntervalFraction", "SetShiftFraction"):
            return none, zero, none, none
        if name == "GetIntervalFraction":
            return none, zero, none, none, none
        if name in ("GetShiftDecimal", "SetIntervalDecimal", "SetShiftDecimal"):
            return none, zero, none
        if name[3:] in TYPES:
            return none, zero, none, zero
        if name in ("GetDirectionalDerivative", "GetAdjointDerivative"):
            return none, zero, none, zero, none, zero, none, zero
        if name == "GetOutputDerivatives":
            return none, zero, none, none, zero
        if name in ("SetContinuousStates", "GetContinuousStates", "GetContinuousStateDerivatives", "GetNominalsOfContinuousStates"):
            return (c_double * 16)(), c_size_t(self.states)
        return {
            "SetDebugLogging": (c_bool(True), zero, none),
            "EnterInitializationMode": (c_bool(False), c_double(0.0), c_double(0.0), c_bool(False), c_double(0.0)),
            "GetNumberOfContinuousStates": (byref(c_size_t()),),
            "GetNumberOfEventIndicators": (byref(c_size_t()),),
            "GetEventIndicators": ((c_double * 16)(), c_size_t(self.indicators)),
            "CompletedIntegratorStep": (c_bool(True), flags[0], flags[1]),
            "SetTime": (c_double(self.time),),
            "GetNumberOfVariableDependencies": (c_uint32(self.output), byref(c_size_t())),
            "GetVariableDependencies": (c_uint32(self.output), *((c_uint64 * 99)() for _ in range(4)), c_size_t(self.dependencies)),
            "GetFMUState": (byref(self.saved),),
            "SetFMUState": (self.saved,),
            "FreeFMUState": (byref(self.saved),),
            "SerializedFMUStateSize": (self.saved, byref(c_size_t())),
        }.get(name, ())

    def call(self, name):
        """Makes a call and compares its status and its messages with the standard."""
        self.messages.clear()
        arguments, before = self.arguments(name), self.state
        expected = self.expected(name)
        status = self.raw(name, *arguments)
        what = f"{self.interface}, {before}: fmi3{name} gives {status}, expected {expected}, {self.messages}"
        assert status in expected, what
        assert (status == OK) == (self.messages == []), what
        assert all(text.decode().startswith(f"fmi3{name}: ") for _, text in self.messages), what
        self.follow(name, status)
        if name.startswith(("Enter", "Exit", "Reset", "SetFMUState")):
            self.count_dependencies()

    def follow(self, name, status):
        """The state after a call."""
        after_initialization = "EventMode" if self.interface == "ModelExchange" or self.event_mode else "StepMode"
        steps = {
            "EnterInitializationMode": "InitializationMode",
            "ExitInitializationMode": after_initialization,
            "EnterEventMode": "EventMode",
            "EnterStepMode": "StepMode",
            "EnterContinuousTimeMode": "ContinuousTimeMode",
            "Terminate": "Terminated",
        }
        if status == ERROR:
            self.state = "Terminated"
        elif name == "Reset":
            self.start_over()
        elif name == "GetFMUState":
            self.snapshot = (self.state, self.time, self.updated)
        elif name == "SetFMUState":
            self.state, self.time, self.updated = self.snapshot
        elif name == "FreeFMUState":
            self.snapshot = None
        elif name == "DoStep":
            self.time = self.reached.value
        self.updated = name == "UpdateDiscreteStates" or self.updated and name not in steps
        self.state = steps.get(name, self.state) if status == OK else self.state


def functions(table):
    """The functions that are called, whatever the state."""
    return sorted(set().union(*table.values()) - {"FreeInstance", "SerializeFMUState", "DeserializeFMUState"})


def names(life):
    """All functions, the legal ones, and those that lead on."""
    every = functions(life.table)
    legal = [name for name in every if OK in life.expected(name)]
    on = [name for name in legal if name.startswith(("Enter", "Exit", "Do", "Update", "Reset"))]
    return every, legal, on


INTERFACES = pytest.mark.parametrize("exchange, event_mode", [(True, False), (False, False), (False, True)])


def ways(exchange, event_mode):
    """The calls that lead to every state."""
    initialized = ["EnterInitializationMode", "ExitInitializationMode"]
    ended = [*initialized, "Terminate"]
    if not exchange and not event_mode:
        return [[], initialized[:1], initialized, [*initialized, "DoStep"], ended]
    on = [*initialized, "UpdateDiscreteStates", "EnterContinuousTimeMode" if exchange else "EnterStepMode"]
    return [[], initialized[:1], initialized, on, [*on, "EnterEventMode"], ended]


@INTERFACES
def test_every_function_in_every_state_is_answered_as_the_standard_says(plant3, root, exchange, event_mode):
    table = allowed(root)
    for way in ways(exchange, event_mode):
        for name in functions(table):
            life = Life(plant3, table, exchange, event_mode)
            life.call("GetFMUState")
            for step in way:
                life.call(step)
            life.call(name)
            life.free()


@INTERFACES
def test_every_sequence_of_calls_is_answered_as_the_standard_says(plant3, root, exchange, event_mode):
    table = allowed(root)
    chance = random.Random(16)
    visited = set()
    for _ in range(SEQUENCES):
        life = Life(plant3, table, exchange, event_mode)
        for _ in range(LENGTH):
            every, legal, on = names(life)
            pool = chance.choices([every, legal, on or legal], [1, 6, 6])[0]
            name = chance.choice(pool)
            if name in ("SetFMUState", "SerializedFMUStateSize") and life.snapshot is None:
                continue
            life.call(name)
            visited.add(life.state)
        life.free()
    modes = {"ContinuousTimeMode"} if exchange else {"StepMode"}
    assert visited >= {"Instantiated", "InitializationMode", "Terminated"} | modes
    assert ("EventMode" in visited) == (exchange or event_mode)
