"""The pendulum over a CAN bus: frames as cantools makes them, and the delay margin of the design."""

import csv

import can
import cantools
import numpy as np
import pytest

import can_bus
from can_bus import NO_FRICTION, RAMP

SETTINGS = ["controller.t_on=0.2", *NO_FRICTION]


@pytest.fixture(scope="module")
def controller(aso_ftc, root, tmp_path_factory):
    """The controller FMU and its delay margin in ms."""
    done = aso_ftc("pack", "--fmi", "3", root / "examples/can-node", root / "examples/can-bus", "--out", root / "dist")
    assert done.returncode == 0, done.stderr
    done = aso_ftc("pack", "--fmi", "3", "--out", root / "dist")
    assert done.returncode == 0, done.stderr
    return can_bus.design(RAMP, tmp_path_factory.mktemp("design"))


def columns(file, *names):
    """Columns of a results file."""
    with file.open(encoding="utf-8") as rows:
        header = next(csv.reader(rows))
        return np.loadtxt(rows, delimiter=",", usecols=[header.index(name) for name in names], unpack=True)


def test_the_frames_are_those_that_cantools_makes_of_the_signals(controller, tmp_path):
    folder = can_bus.couple(controller[0], tmp_path, stop_time=0.05, settings=SETTINGS, options=["--record-every", "step"])
    network = cantools.database.can.Database()
    network.add_dbc_file(str(can_bus.NETWORK))
    time, cart, angle, force = columns(folder / "results.csv", "time", "plant.x_p", "plant.theta", "controller.u")
    trace = {can_bus.MEASUREMENTS: [], can_bus.COMMAND_FRAME: []}
    for frame in can.LogReader(folder / "trace.log"):
        trace[frame.arbitration_id].append(bytes(frame.data))
    for identifier, frames in trace.items():
        message = network.get_message_by_frame_id(identifier)
        assert 48 <= len(frames) <= 50
        for number, frame in enumerate(frames):
            sent = (number * message.cycle_time + float(message.dbc.attributes["GenMsgStartDelayTime"].value)) / 1e3
            row = np.searchsorted(time, sent - 1e-9)
            assert time[row] == pytest.approx(sent, abs=1e-9)
            signals = {"x_p": cart[row], "theta": angle[row], "u": force[row]}
            data = {signal.name: signals[signal.name] for signal in message.signals}
            assert message.encode(data, strict=False) == frame, (identifier, number)


@pytest.mark.parametrize(("measured", "is_stable"), [(0.55, True), (0.5, False)])
def test_the_loop_is_stable_up_to_its_delay_margin(controller, tmp_path, measured, is_stable):
    fmu, margin = controller
    schedule = (measured, 0.05)
    folder = can_bus.couple(fmu, tmp_path, can_bus.network(schedule), settings=SETTINGS, stop_time=3.0)
    delay = can_bus.longest_delay(folder / "trace.log", schedule)
    assert (delay < margin) == is_stable, (delay, margin)
    assert delay == pytest.approx(margin, rel=0.1), "near the margin"
    time, force = columns(folder / "results.csv", "time", "plant.u")
    largest = np.abs(force[time > 2.5]).max()
    assert (largest < 60) if is_stable else (largest > 300)
