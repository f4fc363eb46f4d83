"""Writes the published output of each example, MODEL_out.csv in its folder, by `aso-ftc run`.

    python scripts/build/reference_outputs.py [FMUS]

FMUS is the folder of the packed FMUs; without it the examples are packed into target/examples. Needs
target/release/aso-ftc and Python 3.11. tests/foreign/test_reference_outputs.py compares the files with new runs, and with FMPy.
"""

import csv
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMMAND = ROOT / "target" / "release" / "aso-ftc"
# A library for FMI 3.0 only cannot be packed for FMI 2.0.
PACKED = {
    "2": [
        *("bouncing-ball", "dc-servo", "lookup-table", "pid", "state-space", "three-tank"),
        *("van-der-pol", "wind-turbine", "wind-turbine-monitor"),
    ],
    "3": ["can-bus", "can-node"],
}


@dataclass(frozen=True)
class Run:
    """A run of FMUs, and the outputs that are published."""

    fmus: dict[str, str]  # file by name
    step: float
    stop: float
    every: float  # between rows
    files: dict[str, list[str]]  # outputs by file
    settings: dict[str, float | str] = field(default_factory=dict)
    signals: dict[str, list[list[float]]] = field(default_factory=dict)  # steps: times and values
    connections: dict[str, str] = field(default_factory=dict)

    def system(self, fmus):
        """The system as a system.toml."""
        lines = ["[fmus]", *(f"{name} = {str(fmus / file)!r}" for name, file in self.fmus.items()), "[settings]"]
        lines += [f"{name} = {value!r}" for name, value in self.settings.items()]
        for one, other in self.connections.items():
            lines += ["[[connections]]", f"from = {one!r}", f"to = {other!r}"]
        for name, steps in self.signals.items():
            lines += ["[[scenario.signal]]", f"variable = {name!r}", f"steps = {steps}"]
        lines += ["[algorithm]", f"step = {self.step}", "method = 'jacobi'", "extrapolation = 'hold'"]
        return "\n".join([*lines, "[experiment]", f"stop-time = {self.stop}"])


def single(folder, model, step, stop, every, outputs, settings=None, signals=None):
    """A run of one FMU of FMI 2.0; names are those of its variables."""
    named = [{f"m.{name}": value for name, value in (one or {}).items()} for one in (settings, signals)]
    files = {f"{folder}/{model}_out.csv": [f"m.{name}" for name in outputs]}
    return Run({"m": f"{model}.fmu"}, step, stop, every, files, *named)


RUNS = {
    "BouncingBall": single("examples/bouncing-ball", "BouncingBall", 0.01, 3, 0.02, ["h", "v"]),
    # Dry friction; a constant fault of the voltage from 0.6 s on.
    "DcServo": single(
        *("examples/dc-servo", "DcServo", 0.001, 1, 0.005, ["theta", "omega", "T_f"]),
        settings={"f_u": 2.0, "t_fault": 0.6},
        signals={"u": [[0, 0], [0.101, 6], [0.401, 0], [0.701, -6]]},
    ),
    "LookupTable": single(
        *("examples/lookup-table", "LookupTable", 1, 100, 1, ["torque", "fuel"]),
        signals={"speed": [[t, 60 + 2 * t] for t in range(100)]},
    ),
    "Pid": single(
        *("examples/pid", "Pid", 0.05, 20, 0.1, ["u", "samples"]),
        settings={"mode": 2, "K": 2.0, "T_i": 3.0, "T_d": 0.2},
        signals={"w": [[0, 0], [1, 5], [12, -1]], "y": [[0, 0], [2, 2], [4, 3.5], [7, 4.5], [14, 1]]},
    ),
    "StateSpace": single(
        *("examples/state-space", "StateSpace", 0.01, 10, 0.05, ["y[1]"]),
        signals={"u[1]": [[0, 0], [1, 1], [7, -1]]},
    ),
    # A pump that delivers half, and a sensor with a bias.
    "ThreeTank": single(
        *("examples/three-tank", "ThreeTank", 1, 2000, 10, ["h_1", "h_2", "h_3", "y_2"]),
        settings={"E_1": 0.5, "t_fault_1": 800.0, "t_bias": 1400.0, "b_2": 0.02},
        signals={"Q_1": [[0, 3.5e-5], [200, 5e-5]]},
    ),
    "VanDerPol": single("examples/van-der-pol", "VanDerPol", 0.1, 20, 0.1, ["x0", "x1"]),
    "WindTurbine": single(
        *("examples/wind-turbine", "WindTurbine", 0.01, 60, 0.5),
        ["v_m", "omega_r_m[1]", "omega_g_m[1]", "p_g_m", "beta_m1[1]", "tau_ref"],
        signals={"v_mean": [[0, 10], [20, 13], [40, 16]]},
    ),
    # The models of the paper, each alone.
    "FrictionPendulum": single(
        *("fmu-plant", "FrictionPendulum", 0.001, 5, 0.025, ["x_p", "theta", "v_p", "f_fric"]),
        signals={"u": [[0, 0], [0.51, 30], [1.51, -35], [3.01, 0]]},
    ),
    "AsoController": single(
        *("fmu-controller", "AsoController", 0.001, 2, 0.02, ["u", "f_hat", "x_hat[1]"]),
        settings={"t_on": 0.2},
        signals={"x_p": [[0, 0.1], [1, 0]], "theta": [[0, -0.1], [0.5, 0.05], [1.5, 0]]},
    ),
    # The first sensor of the angle of the first blade is stuck from 20 s to 40 s.
    "WindTurbineMonitor": Run(
        {"turbine": "WindTurbine.fmu", "monitor": "WindTurbineMonitor.fmu"},
        *(0.01, 60, 0.2),
        {
            "examples/wind-turbine-monitor/WindTurbineMonitor_out.csv": [
                *("monitor.fault_beta_m1[1]", "monitor.fault_beta_m2[1]", "monitor.alarms")
            ]
        },
        settings={"turbine.'fault_from[1]'": 20.0, "turbine.'fault_until[1]'": 40.0},
        signals={"turbine.v_mean": [[0, 14], [30, 18]]},
    ),
    # One node sends what the other one receives.
    "CanBus": Run(
        {"sender": "CanNode.fmi3.fmu", "receiver": "CanNode.fmi3.fmu", "bus": "CanBus.fmi3.fmu"},
        *(0.001, 0.2, 0.001),
        {
            "examples/can-bus/CanBus_out.csv": ["bus.frames", "bus.lost", "bus.load"],
            "examples/can-node/CanNode_out.csv": [f"receiver.received.Measurements.{name}" for name in ("x_p", "theta")],
        },
        settings={"sender.node": "Plant", "receiver.node": "Controller"},
        signals={
            "sender.send.Measurements.x_p": [[0, 0], [0.05, 0.5]],
            "sender.send.Measurements.theta": [[0, -0.2], [0.1, 0.2]],
        },
        connections={"sender.CanChannel": "bus.Node1", "receiver.CanChannel": "bus.Node2"},
    ),
}


def pack(folder):
    """Packs the examples into a folder."""
    for version, names in PACKED.items():
        paths = [ROOT / "examples" / name for name in names]
        subprocess.run([COMMAND, "pack", "--fmi", version, *paths, "--out", folder], cwd=ROOT, check=True)


def outputs(run, fmus, folder):
    """Runs FMUs; returns the names of the variables and the rows of each file, as texts."""
    system = folder / "system.toml"
    system.write_text(run.system(fmus), encoding="utf-8")
    names = [name for columns in run.files.values() for name in columns]
    record = [word for name in names for word in ("--record", name)]
    words = [COMMAND, "run", system, "--out", folder, "--record-every", str(run.every), *record]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    with open(folder / "results.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        path: [["time", *(name.partition(".")[2] for name in columns)], *([row[name] for name in ("time", *columns)] for row in rows)]
        for path, columns in run.files.items()
    }


def main():
    """Writes all files."""
    fmus = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "target" / "examples"
    if len(sys.argv) == 1:
        pack(fmus)
    for run in RUNS.values():
        with tempfile.TemporaryDirectory() as folder:
            for path, rows in outputs(run, fmus.resolve(), Path(folder)).items():
                with open(ROOT / path, "w", encoding="utf-8", newline="") as file:
                    csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    main()
