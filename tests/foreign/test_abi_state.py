"""FMU states: a copy continues bit by bit, a damaged or foreign one is refused."""

import random
from ctypes import byref, c_size_t, c_void_p, create_string_buffer
from pathlib import Path

import pytest

from c_abi import ERROR, OK, Instance
from design_file import design_text, redesigned, shipped_design
from excitation import START, STEP, begun, drive, restore, serialized

BEFORE, AFTER = 120, 200  # steps; the compensation starts and the cart stops and starts in both


def fmu_state(instance):
    """The present state."""
    state = c_void_p()
    instance.must("GetFMUstate", byref(state))
    return state


def refused(instance, data, size=None):
    """The message with which serialized bytes are refused."""
    state = c_void_p()
    status = instance.call(
        "DeSerializeFMUstate", data, len(data) if size is None else size, byref(state)
    )
    assert status == ERROR and state.value is None
    message = instance.last_message()
    assert message.startswith("fmi2DeSerializeFMUstate: ")
    return message


def test_the_excitation_covers_stick_slip_and_compensation(plant, controller):
    with begun(plant, 0) as instance:
        regimes = [
            drive(instance, k, 1) and instance.get("regime")[0] for k in range(BEFORE + AFTER)
        ]
    for part in (regimes[:BEFORE], regimes[BEFORE:]):
        assert {-1, 0, 1} == set(part)
    with begun(controller, 0) as instance:
        drive(instance, 0, BEFORE)
        assert instance.get("f_hat") == [-2.0]
        drive(instance, BEFORE, AFTER)
        assert instance.get("f_hat") != [-2.0]


@pytest.mark.parametrize("mark", [0, 1, 37, BEFORE, 160])
def test_restoring_a_state_gives_the_same_bits(fmu, mark):
    with begun(fmu, mark) as instance:
        state = fmu_state(instance)
        first = drive(instance, mark, AFTER)
        for _ in range(2):
            instance.must("SetFMUstate", state)
            assert drive(instance, mark, AFTER) == first
        instance.must("FreeFMUstate", byref(state))


def test_a_state_continues_bit_by_bit_in_another_instance(fmu):
    with begun(fmu, BEFORE) as instance, Instance(fmu, name=b"two") as other:
        state = fmu_state(instance)
        other.must("SetFMUstate", state)
        assert drive(other, BEFORE, AFTER) == drive(instance, BEFORE, AFTER)
        other.must("FreeFMUstate", byref(state))


@pytest.mark.parametrize("mark", [0, BEFORE, 160])
def test_a_serialized_state_continues_bit_by_bit_in_another_process(fmu, mark, python, tmp_path):
    with begun(fmu, mark) as instance:
        file = tmp_path / "state"
        file.write_bytes(serialized(instance))
        script = Path(__file__).with_name("excitation.py")
        done = python(script, fmu.folder, file, mark, AFTER)
        assert done.returncode == 0, done.stderr
        lines = done.stdout.splitlines()
        continued = [[float.fromhex(value) for value in line.split()] for line in lines]
        assert continued == drive(instance, mark, AFTER)


def test_saving_and_serializing_a_state_changes_nothing(fmu):
    with begun(fmu, 0) as watched, begun(fmu, 0) as left_alone:
        for k in range(AFTER):
            serialized(watched)
            assert drive(watched, k, 1) == drive(left_alone, k, 1)


def test_a_state_contains_inputs_and_slopes_set_for_the_next_step(fmu):
    names = fmu.names(causality="input", type="Real")
    with begun(fmu, BEFORE) as instance:
        for name in names:
            instance.set({name: 0.03})
        instance.set_slopes(**{names[0]: 5.0})
        data, time = serialized(instance), BEFORE * STEP
        instance.step(time, STEP)
        expected = instance.outputs()
        instance.must("Reset")
        restore(instance, data)
        instance.step(time, STEP)
        assert instance.outputs() == expected
        restore(instance, data)
        instance.set_slopes(**{names[0]: 0.0})
        instance.step(time, STEP)
        assert instance.outputs() != expected


def test_a_state_contains_parameters_start_time_and_stop_time(plant):
    with Instance(plant) as instance:
        instance.start({"F_c": 11.0, "u": 4.0}, start=3.0, stop=3.5)
        data = serialized(instance)
        instance.must("Reset")
        instance.start()
        restore(instance, data)
        assert instance.get("F_c", "u", "time") == [11, 4, 3]
        instance.step(3.0, 0.4)
        assert instance.call("DoStep", 3.4, 0.2, 1) == ERROR
        assert "stopTime" in instance.last_message()


def test_a_state_restores_an_instance_after_every_kind_of_end(fmu):
    with begun(fmu, BEFORE) as instance:
        data = serialized(instance)
        expected = drive(instance, BEFORE, 20)
        instance.must("Terminate")
        restore(instance, data)
        assert drive(instance, BEFORE, 20) == expected
        assert instance.call("DoStep", -1.0, STEP, 1) == ERROR
        restore(instance, data)
        assert drive(instance, BEFORE, 20) == expected


def test_a_state_can_be_saved_before_initialization(fmu):
    with Instance(fmu) as instance:
        instance.set(START[fmu.identifier])
        data = serialized(instance)
        instance.start({})
        expected = drive(instance, 0, 40)
        restore(instance, data)
        instance.start({})
        assert drive(instance, 0, 40) == expected


def test_a_state_can_be_overwritten_and_freed_and_freeing_null_is_accepted(fmu):
    with begun(fmu, 10) as instance:
        state = fmu_state(instance)
        drive(instance, 10, 10)
        instance.must("GetFMUstate", byref(state))
        first = drive(instance, 20, 10)
        instance.must("SetFMUstate", state)
        assert drive(instance, 20, 10) == first
        instance.must("FreeFMUstate", byref(state))
        assert state.value is None
        instance.must("FreeFMUstate", byref(state))


def test_a_buffer_too_small_for_the_bytes_is_refused_and_unchanged(fmu):
    with begun(fmu, 3) as instance:
        state, size = fmu_state(instance), c_size_t()
        instance.must("SerializedFMUstateSize", state, byref(size))
        place = create_string_buffer(b"\x5a" * size.value)
        assert instance.call("SerializeFMUstate", state, place, size.value - 1) == ERROR
        assert str(size.value) in instance.last_message()
        assert place.raw[: size.value] == b"\x5a" * size.value
        assert instance.call("SerializeFMUstate", state, place, size.value) == OK
        instance.must("FreeFMUstate", byref(state))


def test_every_truncated_state_is_refused(fmu):
    with begun(fmu, BEFORE) as instance:
        data = serialized(instance)
        for length in range(len(data)):
            refused(instance, data, length)
        restore(instance, data)


def test_every_altered_byte_is_detected(fmu):
    with begun(fmu, BEFORE) as instance:
        data = serialized(instance)
        for position in range(len(data)):
            for flip in (0x01, 0x80):
                altered = bytearray(data)
                altered[position] ^= flip
                refused(instance, bytes(altered))
        refused(instance, data + b"\0")
        restore(instance, data)


def test_bytes_that_are_not_a_state_are_refused(fmu):
    chance = random.Random(20)
    with begun(fmu, 5) as instance:
        for length in (0, 1, 8, 39, 40, 41, 100, 5000):
            refused(instance, chance.randbytes(length))
            assert "version" in refused(instance, b"FMI2ST02" + chance.randbytes(length))
            refused(instance, bytes(length))


def test_a_state_of_another_fmu_is_refused(plant, controller, tmp_path):
    design = shipped_design(controller)
    design["t_on"] = 39.0
    other = redesigned(controller, design_text(design), tmp_path / "other")
    with begun(plant, 5) as one, begun(controller, 5) as two, begun(other, 5) as three:
        for target, source in ((one, two), (two, one), (two, three), (three, two)):
            assert "another FMU" in refused(target, serialized(source))
        state = fmu_state(three)
        assert two.call("SetFMUstate", state) == ERROR
        assert other.description.guid in two.last_message()
        three.must("FreeFMUstate", byref(state))
