"""What the examples refuse in FMI 3.0, through the C functions."""

from ctypes import CDLL, CFUNCTYPE, byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p
from pathlib import Path

import fmpy
import pytest

OK, DISCARD, ERROR = 0, 2, 3
LOG = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
MODELS = {
    "ThreeTank": "three-tank",
    "WindTurbine": "wind-turbine",
    "WindTurbineMonitor": "wind-turbine-monitor",
    "DcServo": "dc-servo",
}


@pytest.fixture(scope="session")
def archives(aso_ftc, root, tmp_path_factory):
    """The folders of the unpacked examples, by model."""
    out = tmp_path_factory.mktemp("refusals")
    folders = [root / "examples" / name for name in MODELS.values()]
    done = aso_ftc("pack", *folders, "--fmi", "3", "--out", out)
    assert done.returncode == 0, done.stderr
    return {model: Path(fmpy.extract(str(out / f"{model}.fmi3.fmu"))) for model in MODELS}


class CoSimulation:
    """An instance with `loggingOn = false`, and the messages that come nevertheless."""

    def __init__(self, folder, model):
        self.description = fmpy.read_model_description(str(folder))
        self.library = CDLL(str(folder / "binaries" / "x86_64-linux" / f"{model}.so"))
        self.library.fmi3InstantiateCoSimulation.restype = c_void_p
        self.messages = []
        self.logger = LOG(lambda _, status, category, text: self.messages.append((status, text.decode())))

    def instantiate(self, required=()):
        """Returns the instance, or None."""
        token, none = self.description.instantiationToken.encode(), c_bool(False)
        references = (c_uint32 * len(required))(*required)
        self.instance = self.library.fmi3InstantiateCoSimulation(
            b"one", token, None, none, none, none, none, references, c_size_t(len(required)), None, self.logger, None
        )
        return self.instance

    def start(self):
        """Runs through initialization."""
        assert self.instantiate(), self.messages
        none, zero = c_bool(False), c_double(0.0)
        assert self.call("EnterInitializationMode", none, zero, zero, none, zero) == OK
        assert self.call("ExitInitializationMode") == OK

    def call(self, name, *arguments):
        """Returns the status of a function."""
        return getattr(self.library, f"fmi3{name}")(c_void_p(self.instance), *arguments)

    def step(self, time, size):
        """Returns the status of a step and the time reached."""
        flags, reached = [byref(c_bool()) for _ in range(3)], c_double(-1.0)
        status = self.call("DoStep", c_double(time), c_double(size), c_bool(True), *flags, byref(reached))
        return status, reached.value

    def reference(self, name):
        """The value reference of a variable."""
        return next(variable.valueReference for variable in self.description.modelVariables if variable.name == name)


@pytest.fixture(params=MODELS)
def instance(archives, request):
    """Each example."""
    return CoSimulation(archives[request.param], request.param)


@pytest.mark.parametrize("size", [1e300, 1e12])
def test_a_step_that_would_not_end_is_discarded_and_a_shorter_one_goes_on(instance, size):
    instance.start()
    assert instance.step(0.0, size) == (DISCARD, 0.0)
    assert instance.step(0.0, 0.01) == (OK, 0.01)


def test_a_failed_instantiation_names_the_variable_although_logging_is_off(instance):
    output = next(variable for variable in instance.description.modelVariables if variable.causality == "output")
    assert instance.instantiate([output.valueReference]) is None
    ((status, text),) = instance.messages
    assert status == ERROR and output.name in text and "intermediateUpdate" in text


def test_the_derivative_of_the_angle_is_not_set_and_the_velocity_is(archives):
    for name, expected in [("omega", OK), ("der(theta)", ERROR)]:
        servo = CoSimulation(archives["DcServo"], "DcServo")
        assert servo.instantiate()
        reference, value = byref(c_uint32(servo.reference(name))), byref(c_double(1.0))
        assert servo.call("SetFloat64", reference, c_size_t(1), value, c_size_t(1)) == expected, name
        assert [status for status, _ in servo.messages] == [expected] * (expected == ERROR)
