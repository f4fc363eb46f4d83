"""Runs an FMU by inputs that cause stick, slip and, in the controller, the compensation.

Usage: python excitation.py FOLDER STATE FROM COUNT

continues the serialized FMU state of the file STATE in a new instance of the FMU unpacked in
FOLDER, for COUNT steps from step number FROM on, and prints the outputs in hexadecimal.
"""

import sys
from ctypes import byref, c_size_t, c_void_p, create_string_buffer
from math import cos, sin
from pathlib import Path

from c_abi import Fmu, Instance

STEP = 0.002  # s
START = {
    "FrictionPendulum": {"theta_0": 0.02, "v_p_0": 0.1},
    "AsoController": {"t_on": 0.3171, "x_hat_0[2]": 0.01, "f_hat_0": -2.0},
}


def drive(instance, begin, count, shift=0.0):
    """Makes the steps `begin` to `begin + count`; returns all outputs after each step."""
    rows = []
    for k in range(begin, begin + count):
        time = k * STEP
        phase = 40 * time + shift
        if instance.fmu.identifier == "FrictionPendulum":
            instance.set({"u": 45 * sin(phase), "f_a": 3.0})
            instance.set_slopes(u=45 * 40 * cos(phase))
        else:
            instance.set({"x_p": 0.01 * sin(phase), "theta": 0.02 * cos(phase)})
            instance.set_slopes(x_p=0.4 * cos(phase), theta=-0.8 * sin(phase))
        instance.step(time, STEP)
        rows.append(instance.outputs())
    return rows


def begun(fmu, count, shift=0.0, **options):
    """A new instance after `count` steps."""
    instance = Instance(fmu, **options).start(START[fmu.identifier])
    drive(instance, 0, count, shift)
    return instance


def serialized(instance):
    """The present state as bytes."""
    state, size = c_void_p(), c_size_t()
    instance.must("GetFMUstate", byref(state))
    instance.must("SerializedFMUstateSize", state, byref(size))
    data = create_string_buffer(size.value)
    instance.must("SerializeFMUstate", state, data, size)
    instance.must("FreeFMUstate", byref(state))
    return data.raw


def restore(instance, data):
    """Continues from a serialized state."""
    state = c_void_p()
    instance.must("DeSerializeFMUstate", data, len(data), byref(state))
    instance.must("SetFMUstate", state)
    instance.must("FreeFMUstate", byref(state))


def main():
    """Continues a state from a file."""
    folder, state, begin, count = sys.argv[1:]
    with Instance(Fmu(folder)) as instance:
        restore(instance, Path(state).read_bytes())
        for row in drive(instance, int(begin), int(count)):
            print(*(value.hex() for value in row))


if __name__ == "__main__":
    main()
