"""Model exchange and directional derivatives through the C interface, with valid and invalid calls."""

import ctypes
import math
from ctypes import byref, c_size_t, c_void_p

import pytest
from lxml import etree

from c_abi import (
    CO_SIMULATION,
    DISCARD,
    ERROR,
    MODEL_EXCHANGE,
    OK,
    EventInfo,
    Instance,
    integers,
    reals,
    references,
)

VECTORS = {
    "SetContinuousStates": "states",
    "GetContinuousStates": "states",
    "GetDerivatives": "states",
    "GetNominalsOfContinuousStates": "states",
    "GetEventIndicators": "indicators",
}


def exchange(fmu, **options):
    """A new instance for model exchange."""
    return Instance(fmu, kind=MODEL_EXCHANGE, **options)


def vector(instance, function, count=None):
    """The values that a function of model exchange returns."""
    count = getattr(instance.fmu, VECTORS[function]) if count is None else count
    values = reals(*[0.0] * count)
    instance.must(function, values, count)
    return list(values)


@pytest.mark.parametrize("function", VECTORS)
def test_vectors_of_a_wrong_length_are_an_error_that_gives_both_lengths(fmu, function):
    expected = getattr(fmu, VECTORS[function])
    for wrong in {expected - 1, expected + 1, 10**6} - {-1}:
        with exchange(fmu) as instance:
            instance.start_exchange()
            assert instance.call(function, reals(*[0.0] * wrong), wrong) == ERROR
            assert f"found {wrong}" in instance.last_message()
            assert f"expected {expected}" in instance.last_message()


@pytest.mark.parametrize("function", VECTORS)
def test_null_vectors_are_an_error_if_not_empty(fmu, function):
    expected = getattr(fmu, VECTORS[function])
    with exchange(fmu) as instance:
        instance.start_exchange()
        status = instance.call(function, None, expected)
        assert status == (OK if expected == 0 else ERROR)
        assert expected == 0 or "null" in instance.last_message()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_states_that_are_nan_or_infinite_are_discarded_and_change_nothing(fmu, value):
    with exchange(fmu) as instance:
        instance.start_exchange()
        before = vector(instance, "GetContinuousStates")
        for position in range(fmu.states):
            states = [1.0] * fmu.states
            states[position] = value
            assert instance.call("SetContinuousStates", reals(*states), fmu.states) == DISCARD
            assert "finite" in instance.last_message()
        assert vector(instance, "GetContinuousStates") == before


@pytest.mark.parametrize("time", [math.nan, math.inf, -1.0])
def test_times_that_are_nan_infinite_or_before_the_start_are_an_error(fmu, time):
    with exchange(fmu) as instance:
        instance.start_exchange(start=0.0, stop=10.0)
        assert instance.call("SetTime", time) == ERROR
        assert "fmi2SetTime" in instance.last_message()


def test_no_step_is_completed_past_stop_time(fmu):
    with exchange(fmu) as instance:
        instance.start_exchange(start=0.0, stop=10.0)
        instance.must("SetTime", 10.1)
        vector(instance, "GetDerivatives")
        assert instance.call("CompletedIntegratorStep", 1, integers(0), integers(0)) == ERROR
        assert "stopTime" in instance.last_message()


def test_the_states_are_set_and_read_back_and_the_derivative_follows(plant):
    with exchange(plant) as instance:
        instance.start_exchange()
        states = [0.3, 0.2, 0.5, -0.1]
        instance.must("SetTime", 0.25)
        instance.must("SetContinuousStates", reals(*states), 4)
        assert vector(instance, "GetContinuousStates") == states
        assert instance.get("time", "x_p", "theta", "v_p", "omega") == [0.25, *states]
        slopes = vector(instance, "GetDerivatives")
        assert slopes[:2] == states[2:]
        names = [f"der({name})" for name in ("x_p", "theta", "v_p", "omega")]
        assert instance.get(*names) == slopes


def test_nominal_values_are_positive_and_indicators_not_zero_after_the_first_event(fmu):
    with exchange(fmu) as instance:
        instance.start_exchange()
        assert all(value > 0 for value in vector(instance, "GetNominalsOfContinuousStates"))
        assert all(value != 0 for value in vector(instance, "GetEventIndicators"))


def test_no_step_needs_to_be_completed(fmu):
    xml = etree.parse(fmu.folder / "modelDescription.xml")
    assert xml.find("ModelExchange").get("completedIntegratorStepNotNeeded") == "true"
    with exchange(fmu) as instance:
        instance.start_exchange()
        answers = integers(7), integers(7)
        instance.must("CompletedIntegratorStep", 1, *answers)
        assert [list(answer) for answer in answers] == [[0], [0]]


def test_a_saved_state_resumes_in_the_same_mode_and_with_the_same_bits(fmu):
    state, size = c_void_p(), c_size_t()
    with exchange(fmu) as instance, exchange(fmu, name=b"two") as other:
        instance.start_exchange()
        instance.must("SetTime", 0.5)
        values = reals(*[0.1 * k for k in range(fmu.states)])
        instance.must("SetContinuousStates", values, fmu.states)
        slopes = vector(instance, "GetDerivatives")
        instance.must("GetFMUstate", byref(state))
        instance.must("SerializedFMUstateSize", state, byref(size))
        data = ctypes.create_string_buffer(size.value)
        instance.must("SerializeFMUstate", state, data, size)
        instance.must("FreeFMUstate", byref(state))
        other.must("DeSerializeFMUstate", data, size, byref(state))
        other.must("SetFMUstate", state)
        other.must("FreeFMUstate", byref(state))
        assert vector(other, "GetDerivatives") == slopes
        other.must("EnterEventMode")
        assert other.get("time") == [0.5]


@pytest.mark.parametrize("kind", [MODEL_EXCHANGE, CO_SIMULATION])
def test_a_state_of_the_other_interface_is_refused(fmu, kind):
    state = c_void_p()
    with Instance(fmu, kind=kind) as one, Instance(fmu, kind=1 - kind) as other:
        one.start()
        one.must("GetFMUstate", byref(state))
        assert other.call("SetFMUstate", state) == ERROR
        assert "ModelExchange" in other.last_message() and "CoSimulation" in other.last_message()
        one.must("FreeFMUstate", byref(state))


def test_a_run_after_a_reset_starts_in_the_same_way(fmu):
    def run(instance):
        instance.start_exchange()
        instance.must("SetTime", 0.1)
        instance.must("SetContinuousStates", reals(*[0.2] * fmu.states), fmu.states)
        return vector(instance, "GetDerivatives"), instance.outputs()

    with exchange(fmu) as instance:
        first = run(instance)
        instance.must("Reset")
        assert run(instance) == first


@pytest.mark.parametrize("kind", [MODEL_EXCHANGE, CO_SIMULATION])
def test_directional_derivatives_are_linear_in_the_seed(fmu, kind):
    with Instance(fmu, kind=kind) as instance:
        instance.start()
        unknowns = [unknown.variable.name for unknown in fmu.description.derivatives]
        states = [unknown.variable.derivative.name for unknown in fmu.description.derivatives]
        columns = [instance.directional(unknowns, {state: 1.0}) for state in states]
        seed = [0.5 - k for k in range(len(states))]
        together = instance.directional(unknowns, dict(zip(states, seed)))
        for name, value in together.items():
            parts = [factor * column[name] for factor, column in zip(seed, columns)]
            scale = sum(map(abs, parts)) or 1.0
            assert abs(value - sum(parts)) <= 1e-13 * scale


def test_directional_derivatives_of_wrong_variables_are_an_error_that_names_them(fmu):
    output = fmu.names(causality="output", type="Real")[0]
    parameter = fmu.names(causality="parameter", type="Real")[0]
    real_input = fmu.names(causality="input", type="Real")[0]
    for unknown, known, named in [
        (parameter, real_input, parameter),
        (output, parameter, parameter),
        (real_input, real_input, real_input),
    ]:
        with Instance(fmu) as instance:
            instance.start()
            assert instance.try_directional([unknown], {known: 1.0})[0] == ERROR
            assert named in instance.last_message()


def test_directional_derivatives_with_null_or_unknown_references_are_an_error(fmu):
    output, real_input = (
        fmu.references(fmu.names(causality=causality, type="Real")[0])
        for causality in ("output", "input")
    )
    whole = (output, 1, real_input, 1, reals(1.0), reals(0.0))
    for missing in (0, 2, 4, 5):
        arguments = [None if position == missing else part for position, part in enumerate(whole)]
        with Instance(fmu) as instance:
            instance.start()
            assert instance.call("GetDirectionalDerivative", *arguments) == ERROR
            assert "null" in instance.last_message()
    for position in (0, 2):
        arguments = [references(4711) if k == position else part for k, part in enumerate(whole)]
        with Instance(fmu) as instance:
            instance.start()
            assert instance.call("GetDirectionalDerivative", *arguments) == ERROR
            assert "4711" in instance.last_message()


def test_every_field_of_the_event_info_is_written(fmu):
    with exchange(fmu) as instance:
        instance.start()
        info = EventInfo(7, 7, 7, 7, 7, math.nan)
        instance.must("NewDiscreteStates", byref(info))
        flags = [getattr(info, name) for name, *_ in EventInfo._fields_[:5]]
        assert set(flags) <= {0, 1} and math.isfinite(info.next_event_time)
