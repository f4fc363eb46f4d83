"""The pendulum's loop over a CAN bus: the tables of docs/explanation/can-bus.md.

Usage: python scripts/study/can_bus.py

Needs dist/ with FrictionPendulum.fmi3.fmu, AsoController.fmi3.fmu, CanNode.fmi3.fmu and CanBus.fmi3.fmu, and
target/release/aso-ftc; takes four minutes. Each run is that of examples/can-bus/system.toml with another design of
the controller, another bit rate, or another examples/can-node/resources/network.dbc.
"""

import json
import math
import re
import subprocess
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from command import COMMAND, ROOT, columns

SYSTEM = ROOT / "examples" / "can-bus" / "system.toml"
NETWORK = ROOT / "examples" / "can-node" / "resources" / "network.dbc"
PLANT = ROOT / "examples" / "can-bus" / "controller.toml"
NODE = ROOT / "dist" / "CanNode.fmi3.fmu"
MEASUREMENTS, COMMAND_FRAME = 0x100, 0x101
SAMPLE_TIME = 1e-3  # s
SETTLED = 60.0  # s: compensation starts at 40 s

CONSTANT, RAMP = "constant", "ramp"
# Times in a sample at which the nodes send the measurements and the command, in ms.
SCHEDULES = [(0.7, 0.05), (0.6, 0.05), (0.55, 0.05), (0.5, 0.05), (0.4, 0.05), (0.3, 0.05), (0, 0.05), (0, 0.5)]
NO_FRICTION = ("plant.F_c=0", "plant.F_s=0")
BIT_RATES = [1_000_000, 500_000, 400_000, 350_000, 300_000]
RESOLUTIONS = ["1E-008", "1E-007", "1E-006", "1E-005", "1E-004"]  # m and rad


@dataclass(frozen=True)
class Run:
    """What a run over the bus showed."""

    residual: float  # half of peak to peak of the cart for t > 60 s in mm; NaN where the pendulum falls
    force: float  # largest force for t > 60 s in N
    delay: float  # longest time from a sample of the measurements to the command that uses it, in ms
    load: float
    lost: int


def plant_file(fault):
    """The text of examples/can-bus/controller.toml for the observer of a constant or of a ramp."""
    text = PLANT.read_text(encoding="utf-8").replace("../../dist", str(ROOT / "dist"))
    assert f'kind = "{RAMP}"' in text
    return text if fault == RAMP else text.replace(f'kind = "{RAMP}"', f'kind = "{CONSTANT}"').replace("-2500, ", "")


def design(fault, folder):
    """Makes the controller FMU in `folder`; returns its path and the delay margin in ms."""
    plant, fmu = folder / f"{fault}.toml", folder / f"{fault}.fmu"
    plant.write_text(plant_file(fault), encoding="utf-8")
    files = ["--out", folder / f"{fault}-design.toml", "--fmu", fmu]
    base = ["--from", ROOT / "dist" / "AsoController.fmi3.fmu"]
    command = [COMMAND, "design", plant, *files, *base, "--json", "--force", "--certificate-time", "0"]
    # Status 1: the verdict on the design is red.
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode in (0, 1), done.stderr
    return fmu, 1e3 * json.loads(done.stdout)["robustness"]["delay_margin"]


def network(schedule=None, resolution=None):
    """The text of the DBC file with another schedule in ms or another resolution of the measurements, 32 bits each."""
    text = NETWORK.read_text(encoding="utf-8")
    for identifier, delay in zip((MEASUREMENTS, COMMAND_FRAME), schedule or ()):
        text, count = re.subn(rf'("GenMsgStartDelayTime" BO_ {identifier}) .*;', rf"\1 {delay};", text)
        assert count == 1
    if resolution:
        text = text.replace("Measurements: 6", "Measurements: 8")
        text = text.replace("x_p : 0|24@", "x_p : 0|32@").replace("theta : 24|24@", "theta : 32|32@")
        text = text.replace("(1E-006,0)", f"({resolution},0)")
    return text


def couple(controller, folder, text=None, bit_rate=500_000, settings=(), stop_time=100.0, options=()):
    """Runs the loop with the network of the DBC `text`; returns the folder with results.csv and trace.log."""
    node = folder / "node"
    with zipfile.ZipFile(NODE) as archive:
        archive.extractall(node)
    (node / "resources" / "network.dbc").write_text(text or network(), encoding="utf-8")
    command = [COMMAND, "run", SYSTEM, "--fmu", f"controller={controller}", "--stop-time", str(stop_time)]
    command += ["--fmu", f"plant_node={node}", "--fmu", f"controller_node={node}"]
    command += ["--results", folder / "results.csv", "--bus-trace", folder / "trace.log"]
    for setting in [f"plant_node.bit_rate={bit_rate}", f"controller_node.bit_rate={bit_rate}", *settings]:
        command += ["--set", setting]
    command += options
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


def frames(trace):
    """The frames of a trace by candump: times and identifiers."""
    pattern = re.compile(r"\((.*)\) can0 (\w+)#")
    entries = [pattern.match(line).groups() for line in trace.read_text(encoding="utf-8").splitlines()]
    return np.array([float(time) for time, _ in entries]), np.array([int(name, 16) for _, name in entries])


def longest_delay(trace, schedule):
    """The longest time in ms from a sample of the measurements to the arrival of the command that uses it."""
    times, names = frames(trace)
    measured, commanded = times[names == MEASUREMENTS], times[names == COMMAND_FRAME]
    sampled = SAMPLE_TIME * np.arange(len(measured)) + 1e-3 * schedule[0]
    # The controller uses a frame at the first sample after its arrival, and sends the command at its time.
    sent = SAMPLE_TIME * np.ceil(measured / SAMPLE_TIME - 1e-6) + 1e-3 * schedule[1]
    arrival = np.searchsorted(commanded, sent)
    whole = arrival < len(commanded)
    return 1e3 * (commanded[arrival[whole]] - sampled[whole]).max()


def measure(controller, schedule=(0.7, 0.05), resolution=None, bit_rate=500_000, settings=()):
    """Runs the loop and measures it."""
    with tempfile.TemporaryDirectory() as name:
        folder = couple(controller, Path(name), network(schedule, resolution), bit_rate, settings)
        names = ("time", "plant.x_p", "plant.theta", "plant.u", "bus.load", "bus.lost")
        time, cart, angle, force, load, lost = columns(folder / "results.csv", names)
        late = time > SETTLED
        falls = np.abs(angle).max() > math.pi / 2
        delay = longest_delay(folder / "trace.log", schedule) if lost[-1] == 0 else math.inf
        residual = math.nan if falls else 5e2 * np.ptp(cart[late])
        return Run(residual, np.abs(force[late]).max(), delay, load[-1], int(lost[-1]))


def shown(run):
    """The residual in mm, or that the pendulum falls."""
    return "falls" if math.isnan(run.residual) else f"{run.residual:.3g}"


def main():
    with tempfile.TemporaryDirectory() as name:
        designs = {fault: design(fault, Path(name)) for fault in (CONSTANT, RAMP)}
        for fault, (_, margin) in designs.items():
            print(f"{fault}: delay margin {margin:.3g} ms")
        constant, ramp = designs[CONSTANT][0], designs[RAMP][0]
        print("\n| measurements sent at | command sent at | delay | constant | ramp | ramp, no friction |\n|---|---|---|---|---|---|")
        for schedule in SCHEDULES:
            runs = [measure(controller, schedule) for controller in (constant, ramp)]
            free = measure(ramp, schedule, settings=NO_FRICTION)
            force = "falls" if math.isnan(free.residual) else f"{free.force:.3g}"
            sent = " | ".join(f"{time:g}" for time in schedule)
            print(f"| {sent} | {runs[0].delay:.3g} | {shown(runs[0])} | {shown(runs[1])} | {force} |")
        print("\n| bit rate in kbit/s | load | delay | constant | ramp |\n|---|---|---|---|---|")
        for bit_rate in BIT_RATES:
            runs = [measure(controller, bit_rate=bit_rate) for controller in (constant, ramp)]
            first = runs[0]
            print(f"| {bit_rate / 1e3:g} | {first.load:.0%} | {first.delay:.3g} | {shown(first)} | {shown(runs[1])} |")
        print("\n| resolution | constant | ramp | largest force |\n|---|---|---|---|")
        for resolution in RESOLUTIONS:
            runs = [measure(controller, resolution=resolution) for controller in (constant, ramp)]
            forces = " / ".join(f"{run.force:.3g}" for run in runs)
            print(f"| {1e6 * float(resolution):g} | {shown(runs[0])} | {shown(runs[1])} | {forces} |")


if __name__ == "__main__":
    main()
