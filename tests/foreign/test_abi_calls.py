"""Calls in the wrong order, without an instance, or with null arrays."""

import csv
import ctypes
from ctypes import byref, c_char_p, c_int, c_size_t, c_void_p

import pytest

from c_abi import (
    CO_SIMULATION,
    DISCARD,
    ERROR,
    FUNCTIONS,
    LAST_SUCCESSFUL_TIME,
    MODEL_EXCHANGE,
    OK,
    EventInfo,
    Instance,
    integers,
    reals,
    references,
    texts,
)
from conftest import ROOT

# The tables of FMI 2.0.5, sections 3.2.3 and 4.2.4, cell by cell.
TABLES = {
    MODEL_EXCHANGE: ("section_3_2_3.csv", ["EventMode", "ContinuousTimeMode"]),
    CO_SIMULATION: ("section_4_2_4.csv", ["StepComplete", "StepFailed"]),
}
COMMON = ["Instantiated", "InitializationMode", "Terminated", "Error"]


def cells():
    """Interface, function, state and whether the call is allowed, for all states that can occur: a
    step is never in progress or canceled after DoStep has returned, and only a panic of the model is
    fatal."""
    for kind, (file, states) in TABLES.items():
        path = ROOT / "crates" / "fmu-description" / "src" / "call_order" / file
        with path.open() as lines:
            table = {row.pop("function").removeprefix("fmi2"): row for row in csv.DictReader(lines)}
        for name in FUNCTIONS:
            for state in COMMON + states:
                yield kind, name, state, name in table and table[name][state] != "-"


CASES = [case for case in cells() if case[1] != "FreeInstance"]


def arguments(name, indicators):
    """Arguments with which the function of the plant succeeds if the call is allowed."""
    none = (None, 0, None)
    if name[3:] in ("Real", "Integer", "Boolean", "String"):
        return none
    return {
        "SetDebugLogging": (0, 0, None),
        "SetupExperiment": (0, 0.0, 0.0, 0, 0.0),
        "GetDirectionalDerivative": (None, 0, None, 0, None, None),
        "SetRealInputDerivatives": (None, 0, None, None),
        "GetRealOutputDerivatives": (None, 0, None, None),
        "DoStep": (0.0, 0.001, 1),
        "GetStatus": (0, integers(0)),
        "GetRealStatus": (LAST_SUCCESSFUL_TIME, reals(0)),
        "GetIntegerStatus": (0, integers(0)),
        "GetBooleanStatus": (3, integers(0)),
        "GetStringStatus": (1, texts(None)),
        "NewDiscreteStates": (byref(EventInfo()),),
        "CompletedIntegratorStep": (1, integers(0), integers(0)),
        "SetTime": (0.001,),
        "SetContinuousStates": (reals(0, 0, 0, 0), 4),
        "GetEventIndicators": (reals(*[0] * indicators), indicators),
        "GetContinuousStates": (reals(0, 0, 0, 0), 4),
        "GetDerivatives": (reals(0, 0, 0, 0), 4),
        "GetNominalsOfContinuousStates": (reals(0, 0, 0, 0), 4),
    }.get(name, ())


def bring(instance, state):
    """Brings a new instance of the plant to a state of the tables."""
    if state == "InitializationMode":
        instance.enter()
    if state in ("EventMode", "StepComplete", "StepFailed", "Terminated", "Error"):
        instance.start()
    if state == "ContinuousTimeMode":
        instance.start_exchange()
    if state == "StepFailed":
        instance.set({"u": 1e308})
        assert instance.call("DoStep", 0.0, 0.1, 1) == DISCARD
    if state == "Terminated":
        instance.must("Terminate")
    if state == "Error":
        assert instance.call("SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == ERROR
    instance.messages.clear()


def call_with_states(instance, name):
    """Calls one of the functions on FMU states, with a saved state and its bytes."""
    state, copy, size = c_void_p(), c_void_p(), c_size_t()
    before = Instance(instance.fmu, kind=instance.kind)
    before.must("GetFMUstate", byref(state))
    before.must("SerializedFMUstateSize", state, byref(size))
    data = ctypes.create_string_buffer(size.value)
    before.must("SerializeFMUstate", state, data, size)
    chosen = {
        "GetFMUstate": (byref(copy),),
        "SetFMUstate": (state,),
        "FreeFMUstate": (byref(copy),),
        "SerializedFMUstateSize": (state, byref(size)),
        "SerializeFMUstate": (state, data, size),
        "DeSerializeFMUstate": (data, size, byref(copy)),
    }[name]
    status = instance.call(name, *chosen)
    for place in (state, copy):
        before.must("FreeFMUstate", byref(place))
        assert place.value is None
    before.free()
    return status


def call(instance, name):
    """Calls the function with valid arguments."""
    if "FMUstate" in name:
        return call_with_states(instance, name)
    return instance.call(name, *arguments(name, instance.fmu.indicators))


@pytest.mark.parametrize(("kind", "name", "state", "allowed"), CASES)
def test_calls_succeed_and_fail_as_the_tables_of_the_standard_say(plant, kind, name, state, allowed):
    with Instance(plant, kind=kind) as instance:
        bring(instance, state)
        status = call(instance, name)
        texts_ = [message.text for message in instance.messages]
        if (name, state) == ("SetTime", "EventMode"):  # section 3.2.3, condition 8
            assert status == ERROR and "without continuous states" in texts_[0]
        elif allowed:
            pending = name in ("GetStatus", "GetIntegerStatus", "GetStringStatus")
            assert status == (DISCARD if pending else OK), texts_
            assert len(texts_) == (1 if pending else 0)
        else:
            assert status == ERROR and len(texts_) == 1
            assert f"fmi2{name}:" in texts_[0] and state in texts_[0]
            assert instance.messages[0].category == "logStatusError"


@pytest.mark.parametrize(
    ("kind", "state"),
    [(kind, state) for kind, (_, states) in TABLES.items() for state in COMMON + states],
)
def test_an_instance_can_be_freed_in_every_state(fmu, kind, state):
    if state == "StepFailed" and "u" not in fmu.names(causality="input"):
        state = "StepComplete"
    with Instance(fmu, kind=kind) as instance:
        bring(instance, state)
    assert instance.component is None and not instance.messages


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_null_instance_is_an_error_and_no_crash(fmu, name):
    function = getattr(fmu.library, f"fmi2{name}")
    zeros = [argument(0) if argument in (c_int, c_size_t) else None for argument in FUNCTIONS[name]]
    numbers = [
        0.0 if argument is ctypes.c_double else zero
        for argument, zero in zip(FUNCTIONS[name], zeros)
    ]
    if name == "FreeInstance":
        function(None)
    else:
        assert function(None, *numbers) == ERROR


KINDS = ["Real", "Integer", "Boolean", "String"]


@pytest.mark.parametrize("way", ["Get", "Set"])
@pytest.mark.parametrize("kind", KINDS)
def test_null_arrays_are_accepted_if_they_are_empty_and_otherwise_an_error(fmu, way, kind):
    with Instance(fmu) as instance:
        instance.start()
        function = f"{way}{kind}"
        assert instance.call(function, None, 0, None) == OK
        assert instance.call(function, None, 2, None) == ERROR
        assert f"fmi2{function}" in instance.last_message() and "null" in instance.last_message()
        assert instance.call("Reset") == OK
        instance.start()
        assert instance.call(function, references(1), 1, None) == ERROR
        assert "null" in instance.last_message()


@pytest.mark.parametrize("function", ["SetRealInputDerivatives", "GetRealOutputDerivatives"])
def test_derivatives_with_null_arrays_are_an_error_if_not_empty(plant, function):
    name = "u" if function.startswith("Set") else "x_p"
    whole = (plant.references(name), 1, integers(1), reals(0))
    for missing in (0, 2, 3):
        args = [None if position == missing else part for position, part in enumerate(whole)]
        with Instance(plant) as instance:
            instance.start()
            assert instance.call(function, None, 0, None, None) == OK
            assert instance.call(function, *args) == ERROR
            assert f"fmi2{function}" in instance.last_message()
            assert "null" in instance.last_message()


def test_null_pointers_to_states_are_an_error(fmu):
    size = c_size_t()
    calls = [
        ("GetFMUstate", None),
        ("SetFMUstate", None),
        ("SerializedFMUstateSize", None, byref(size)),
        ("SerializeFMUstate", None, None, 0),
        ("DeSerializeFMUstate", None, 0, None),
        ("DeSerializeFMUstate", None, 9, byref(c_void_p())),
        ("GetRealStatus", LAST_SUCCESSFUL_TIME, None),
        ("GetBooleanStatus", 3, None),
        ("NewDiscreteStates", None),
    ]
    for name, *args in calls:
        with Instance(fmu, kind=name != "NewDiscreteStates") as instance:
            instance.start()
            assert instance.call(name, *args) == ERROR, name
            assert f"fmi2{name}" in instance.last_message()


def test_freeing_a_null_state_is_accepted(fmu):
    # "If a null pointer is provided, the call is ignored" (section 2.1.8), whichever pointer this means.
    for nothing in (None, byref(c_void_p())):
        with Instance(fmu) as instance:
            assert instance.call("FreeFMUstate", nothing) == OK and not instance.messages


@pytest.mark.parametrize("way", ["Get", "Set"])
@pytest.mark.parametrize("kind", KINDS)
def test_unknown_value_references_are_an_error_that_names_them(fmu, way, kind):
    place = {"Real": reals(0), "String": texts(b"")}.get(kind, integers(0))
    for reference in (4711, 2**32 - 1):
        with Instance(fmu) as instance:
            instance.start()
            assert instance.call(f"{way}{kind}", references(reference), 1, place) == ERROR
            assert str(reference) in instance.last_message() and kind in instance.last_message()


def test_null_strings_are_an_error(fmu):
    for args in ((1, 1, texts(None)), (1, 2, (c_char_p * 2)(b"logStatusError", None))):
        with Instance(fmu) as instance:
            assert instance.call("SetDebugLogging", *args) == ERROR
            assert "null" in instance.last_message()
