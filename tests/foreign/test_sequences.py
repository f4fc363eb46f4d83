"""Calls from inside of the logger, while the instance is busy: section 4.2.4, stepInProgress."""

from ctypes import byref, c_double, c_int, c_size_t, c_void_p
from math import nan

import pytest

from c_abi import (
    C_TYPES,
    CO_SIMULATION,
    ERROR,
    FUNCTIONS,
    MODEL_EXCHANGE,
    EventInfo,
    Instance,
    integers,
    reals,
    references,
    texts,
)
from excitation import START, begun, drive


class Meddler(Instance):
    """An instance whose logger calls every function of that instance and stores the statuses in `answers`."""

    answers = None

    def receive(self, *message):
        """The logger."""
        super().receive(*message)
        if self.component and self.answers is None:
            self.answers = {}
            for name in FUNCTIONS:
                self.answers[name] = self.call(name, *arguments(name, self.state))

    def __init__(self, fmu, **options):
        self.state = c_void_p()
        super().__init__(fmu, **options)

    def keep(self):
        """Saves the present state."""
        self.must("GetFMUstate", byref(self.state))

    def let_go(self):
        """Frees the saved state."""
        self.must("FreeFMUstate", byref(self.state))


def arguments(name, state):
    """Arguments that are valid outside of the logger."""
    one, real = references(1), reals(0.5)
    values = {f"{way}{kind}": kind for way in ("Get", "Set") for kind in C_TYPES}
    if name in values:
        kind = values[name]
        value = texts(b"text") if kind == "String" else (C_TYPES[kind] * 1)(1)
        return references(1 if kind == "Real" else 0), 1, value
    return {
        "SetDebugLogging": (1, 0, None),
        "SetupExperiment": (0, 0.0, 0.0, 0, 0.0),
        "GetFMUstate": (byref(c_void_p()),),
        "SetFMUstate": (state,),
        "FreeFMUstate": (byref(state),),
        "SerializedFMUstateSize": (state, byref(c_size_t())),
        "SerializeFMUstate": (state, b" " * 100_000, 100_000),
        "DeSerializeFMUstate": (b"bytes", 5, byref(c_void_p())),
        "GetDirectionalDerivative": (one, 1, one, 1, real, real),
        "SetRealInputDerivatives": (one, 1, integers(1), real),
        "GetRealOutputDerivatives": (one, 1, integers(1), real),
        "DoStep": (0.0, 0.1, 1),
        "NewDiscreteStates": (byref(EventInfo()),),
        "CompletedIntegratorStep": (1, byref(c_int()), byref(c_int())),
        "SetTime": (0.5,),
        **{f"Get{kind}Status": (2, (c_type * 1)()) for kind, c_type in C_TYPES.items()},
        "GetStatus": (0, byref(c_int())),
        **{
            name: (real, 1)
            for name in (
                "SetContinuousStates",
                "GetEventIndicators",
                "GetContinuousStates",
                "GetDerivatives",
                "GetNominalsOfContinuousStates",
            )
        },
    }.get(name, ())


@pytest.mark.parametrize("kind", [CO_SIMULATION, MODEL_EXCHANGE])
def test_every_call_from_the_logger_of_a_failing_call_is_an_error_and_does_nothing(fmu, kind):
    with Meddler(fmu, kind=kind) as instance:
        instance.start(START[fmu.identifier])
        before = len(instance.messages)
        instance.keep()
        failing = "DoStep" if kind == CO_SIMULATION else "SetTime"
        arguments = (0.0, nan, 1) if kind == CO_SIMULATION else (nan,)
        assert instance.call(failing, *arguments) == ERROR
        assert instance.answers.pop("FreeInstance") is None
        assert instance.answers == dict.fromkeys(instance.answers, ERROR)
        assert len(instance.answers) == len(FUNCTIONS) - 1
        assert len(instance.messages) == before + 1, "no message about a call from the logger"
        instance.must("SetFMUstate", instance.state)
        instance.let_go()


def test_a_run_continues_with_the_same_bits_after_calls_from_the_logger(fmu):
    with begun(fmu, 0) as alone, Meddler(fmu) as instance:
        instance.start(START[fmu.identifier])
        assert drive(instance, 0, 40) == drive(alone, 0, 40)
        instance.keep()
        assert instance.call("DoStep", nan, 0.1, 1) == ERROR
        assert set(instance.answers.values()) == {ERROR, None}
        instance.must("SetFMUstate", instance.state)
        assert drive(instance, 40, 40) == drive(alone, 40, 40)
        instance.let_go()


def test_another_instance_may_be_called_from_the_logger(fmu):
    with begun(fmu, 0) as other:

        class Friend(Instance):
            """Steps the other instance from its own logger."""

            def receive(self, *message):
                """The logger."""
                super().receive(*message)
                other.step(0.0, 0.01)

        with Friend(fmu) as instance:
            instance.start()
            assert instance.call("DoStep", 0.0, nan, 1) == ERROR
        time = c_double()
        other.must("GetRealStatus", 2, byref(time))
        assert time.value == 0.01
