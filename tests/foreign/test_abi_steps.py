"""Communication steps: their time and size, the stop time, the results of the status functions."""

import re
from ctypes import c_int
from math import inf, nan, nextafter

import pytest

from c_abi import (
    DISCARD,
    ERROR,
    LAST_SUCCESSFUL_TIME,
    OK,
    TERMINATED,
    Instance,
    integers,
    reals,
    texts,
)


def last_successful_time(instance):
    """`fmi2LastSuccessfulTime` of an instance."""
    value = reals(nan)
    instance.must("GetRealStatus", LAST_SUCCESSFUL_TIME, value)
    return value[0]


@pytest.mark.parametrize("size", [0.0, -0.0, -1e-3, nan, inf, -inf])
def test_step_sizes_that_are_not_positive_are_an_error(fmu, size):
    with Instance(fmu) as instance:
        instance.start()
        assert instance.call("DoStep", 0.0, size, 1) == ERROR
        assert "fmi2DoStep" in instance.last_message()
        assert "communicationStepSize" in instance.last_message()
        assert instance.get("time") == [0.0]


@pytest.mark.parametrize("point", [0.0, 0.009, 0.011, -0.01, 1e9, nan, inf, -inf])
def test_a_communication_point_other_than_the_time_reached_is_an_error(fmu, point):
    with Instance(fmu) as instance:
        instance.start()
        instance.step(0.0, 0.01)
        assert instance.call("DoStep", point, 0.01, 1) == ERROR
        assert "currentCommunicationPoint" in instance.last_message()
        assert "0.01" in instance.last_message()


def test_a_communication_point_off_by_rounding_is_accepted(fmu):
    with Instance(fmu) as instance:
        instance.start(stop=100.0)
        time = 0.0
        for _ in range(1000):
            instance.step(time, 0.1)
            time += 0.1
        assert time != 100.0
        assert instance.get("time") == [pytest.approx(100.0, abs=1e-9)]


@pytest.mark.parametrize(("time", "size"), [(1e3, 1e-20), (1e9, 1e-8), (1.0, 1e-16), (-4.0, 1e-17)])
def test_a_step_below_the_resolution_of_time_is_an_error_with_the_smallest_step(fmu, time, size):
    smallest = nextafter(time, inf) - time
    assert size < smallest
    with Instance(fmu) as instance:
        instance.start(start=time)
        assert instance.call("DoStep", time, size, 1) == ERROR
        said = instance.last_message()
        numbers = {float(word) for word in re.findall(r"-?\d[\d.]*(?:e-?\d+)?", said)}
        assert "communicationStepSize" in said and {time, size, smallest} <= numbers
        assert instance.get("time") == [time]
        instance.must("Reset")
        instance.start(start=time)
        instance.step(time, smallest)
        assert instance.get("time") == [time + smallest]


def test_a_step_that_ends_before_the_time_reached_is_an_error(fmu):
    with Instance(fmu) as instance:
        instance.start()
        instance.step(0.0, 5e-10)
        assert instance.call("DoStep", 0.0, 1e-10, 1) == ERROR
        assert "the instance is at 0.0000000005 s" in instance.last_message()
        assert instance.get("time") == [5e-10]


def test_time_is_the_sum_of_the_steps(fmu):
    with Instance(fmu) as instance:
        instance.start(start=-2.5)
        assert instance.get("time") == [-2.5] and last_successful_time(instance) == -2.5
        for start, size, end in (
            (-2.5, 0.25, -2.25),
            (-2.25, 1e-6, -2.249999),
            (-2.249999, 1.0, -1.249999),
        ):
            instance.step(start, size)
            assert instance.get("time") == [pytest.approx(end, abs=1e-15)]
            assert last_successful_time(instance) == instance.get("time")[0]


def test_a_step_past_the_stop_time_is_an_error(fmu):
    for defined, status in ((True, ERROR), (False, OK)):
        with Instance(fmu) as instance:
            instance.must("SetupExperiment", 0, 0.0, 0.0, defined, 0.5)
            instance.must("EnterInitializationMode")
            instance.must("ExitInitializationMode")
            instance.step(0.0, 0.25)
            instance.step(0.25, 0.25)
            assert instance.call("DoStep", 0.5, 0.001, 1) == status
            assert defined == bool(instance.messages)
            assert not defined or "stopTime" in instance.last_message()


@pytest.mark.parametrize(
    ("experiment", "word"),
    [
        ((0, 0.0, nan, 0, 0.0), "startTime"),
        ((0, 0.0, inf, 0, 0.0), "startTime"),
        ((0, 0.0, 1.0, 1, 0.5), "stopTime"),
        ((0, 0.0, 1.0, 1, nan), "stopTime"),
        ((1, 0.0, 0.0, 0, 0.0), "tolerance"),
        ((1, -1e-6, 0.0, 0, 0.0), "tolerance"),
        ((1, nan, 0.0, 0, 0.0), "tolerance"),
        ((1, inf, 0.0, 0, 0.0), "tolerance"),
    ],
)
def test_invalid_experiments_are_refused(fmu, experiment, word):
    with Instance(fmu) as instance:
        assert instance.call("SetupExperiment", *experiment) == ERROR
        assert "fmi2SetupExperiment" in instance.last_message() and word in instance.last_message()


def test_undefined_tolerance_and_stop_time_are_ignored(fmu):
    with Instance(fmu) as instance:
        instance.must("SetupExperiment", 0, nan, 0.0, 0, -1.0)
        instance.must("EnterInitializationMode")
        instance.must("ExitInitializationMode")
        instance.step(0.0, 0.001)


def test_without_setup_the_run_starts_at_zero(fmu):
    with Instance(fmu) as instance:
        instance.must("EnterInitializationMode")
        instance.must("ExitInitializationMode")
        instance.step(0.0, 0.001)


def test_a_step_that_cannot_be_completed_is_discarded_with_the_time_reached(plant):
    with Instance(plant) as instance:
        instance.start()
        instance.step(0.0, 0.5)
        instance.set({"u": 1e308})
        assert instance.call("DoStep", 0.5, 0.5, 1) == DISCARD
        assert instance.messages[-1].category == "logStatusDiscard"
        assert "fmi2DoStep" in instance.last_message() and "t = " in instance.last_message()
        assert 0.5 <= last_successful_time(instance) < 1.0
        assert instance.get("time") == [last_successful_time(instance)]
        instance.must("Terminate")


def test_no_call_is_pending_and_no_instance_requests_the_end(fmu):
    with Instance(fmu) as instance:
        instance.start()
        instance.step(0.0, 0.001)
        value = integers(7)
        instance.must("GetBooleanStatus", TERMINATED, value)
        assert value[0] == 0 and not instance.messages
        others = [("GetStatus", 0, (c_int * 1)()), ("GetStringStatus", 1, texts(None))]
        others += [("GetIntegerStatus", kind, integers(0)) for kind in range(4)]
        others += [("GetRealStatus", kind, reals(0)) for kind in (0, 1, 3, 9, -1)]
        others += [("GetBooleanStatus", kind, integers(0)) for kind in (0, 1, 2, 9)]
        for name, kind, place in others:
            assert instance.call(name, kind, place) == DISCARD, (name, kind)
            assert f"fmi2{name}" in instance.last_message()
        instance.step(0.001, 0.001)


def test_steps_from_a_microsecond_to_a_second_are_accepted(fmu):
    with Instance(fmu) as instance:
        instance.start()
        time = 0.0
        for size in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0):
            instance.step(time, size)
            time += size
        assert instance.get("time") == [pytest.approx(1.111111, abs=1e-12)]
