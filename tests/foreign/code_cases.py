"""Sampled designs as source code: plant files, their designs, the compiled code, the loop with the plant."""

import json
import re
import subprocess
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from conftest import ROOT
from scheduled_design import DRIVE
from test_estimation_laws import PLANT
from test_fallback import SAMPLED, VEHICLE
from test_feedthrough import SAMPLED as FEEDTHROUGH

HERE = Path(__file__).parent
# What adds inputs to a controller.
INPUTS = ("references", "schedule", "detection", "reconfigurations")
WARNINGS = "-std=c99 -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wdouble-promotion -Werror -ffp-contract=off".split()

# Two masses with a spring; the motor's force has limits, its fault is a ramp.
MASSES = """
A = [[0, 1, 0, 0], [-40, -0.5, 40, 0.1], [0, 0, 0, 1], [30, 0.1, -30, -0.3]]
B = [[0], [2.5], [0], [0]]
C = [[1, 0, 0, 0], [0, 0, 1, 0]]
states = ["x_1", "v_1", "x_2", "v_2"]
actuators = [{ name = "'motor 1'", unit = "N", limits = [-0.05, 1.05], operating = 0.5 }]
measurements = [{ name = "q[1]", unit = "m", operating = 0.2 }, { name = "Q_1", unit = "m" }]
sample_time = 0.02
estimator = "ESTIMATOR"
t_on = 1.5
monitor = MONITOR
feedback.eigenvalues = [-3, -3.5, -4, -5]
observer.eigenvalues = [-8, -9, -10, -11, -12, -13]
[[faults]]
name = "int"
actuator = "'motor 1'"
kind = "ramp"
[experiment]
stop_time = 20.0
"""

QUADRUPLE = (ROOT / "examples" / "plants" / "quadruple-tank.toml").read_text(encoding="utf-8")
TANKS = {
    name: (ROOT / "examples" / "three-tank" / f"{name}.toml").read_text(encoding="utf-8").replace("../..", str(ROOT))
    for name in ("plant", "sensor-fault", "loss-of-effectiveness", "reference", "schedule", "detection")
}


def masses(estimator, monitor):
    """The two masses with this estimator."""
    return MASSES.replace("ESTIMATOR", estimator).replace("MONITOR", monitor)


def measured(text):
    """The tanks, scheduled by a measured level, with a fault of another sensor and so a filter."""
    head, points = text.split("[schedule]")
    head = head.replace("sample_time = 1.0", "sample_time = 1.0\nfilter = 0.5")
    head = head.replace("[-0.2, -0.22, -0.25, -0.28, -0.3]", "[-0.06, -0.07, -0.08, -0.1, -0.12, -0.14, -0.16, -0.2, -0.25]")
    fault = '[[faults]]\nname = "b_2"\nsensor = "y_2"\nbound = 0.1\n\n'
    return f'{head}{fault}[schedule]\nvariable = "y_1"\n' + points[points.index("\n[[schedule.points]]") :]


def windows(isolation):
    """The two masses with faults of the motor and of a sensor, tested by sums of squares from 2 s on."""
    head, tail = masses("prediction", "true").replace(', -13]', ', -13, -14, -15]').split("[experiment]")
    head = head.replace("sample_time", "filter = 0.2\nsample_time").replace('kind = "ramp"', "step = 0.1")
    sensor = '[[faults]]\nname = "b"\nsensor = "Q_1"\nstep = 0.1\n'
    detection = f'[detection]\nmethod = "chi-square"\nisolation = {isolation}\nfalse_alarm_interval = 20.0\nfrom = 2.0\n'
    return f"{head}{sensor}{detection}noise = 2e-2\nprocess_noise = 1e-2\n[experiment]{tail}"


def vehicle(head, has_fallback=True):
    """The underwater vehicle, sampled; its lost thrusters are found by their estimates or reported."""
    text = VEHICLE.read_text(encoding="utf-8").replace("up_to = 0.6\n", "")
    text = text if has_fallback else text[: text.index("# One feedback for all of this")]
    return f"sample_time = 0.05\n{head}{text}[robustness]\ncases = 0\n"


VEHICLE_DETECTION = """
[detection]
method = "cusum"
false_alarm_interval = 100.0
noise = 1e-3
process_noise = 1e-3
from = 1.0
"""


def law(text, name):
    """The plant of a text with this law that estimates its faults."""
    return f"{text}\n[estimation]\nlaw = '{name}'\n"


def tracked_sensor():
    """The tanks with references, a fault of a sensor that they are measured by, and so a filter."""
    text = TANKS["reference"].replace("sample_time = 1.0", "sample_time = 1.0\nfilter = 0.5")
    text = text.replace("[-0.2, -0.22, -0.25, -0.28, -0.3]", "[-0.06, -0.07, -0.08, -0.1, -0.12, -0.14, -0.16, -0.2, -0.25]")
    return text.replace("[experiment]", '[[faults]]\nname = "b_1"\nsensor = "y_1"\nstep = 4e-3\n\n[experiment]')


# Stabilised by one input; tested by cumulative sums.
UNSTABLE = f"sample_time = 0.05\n{PLANT.replace('bound = 2.0', 'bound = 2.0, step = 1.0')}"
CUSUM = '[detection]\nmethod = "cusum"\nfalse_alarm_interval = 100.0\nnoise = 1e-2\nprocess_noise = 1e-3\nfrom = 1.0\n'


# The samples for which the last value of a measurement may replace it, in the designs of `held`.
MOST_HELD = 5


def held(text, has_limit=True):
    """The plant of a text with a range of each measurement and, if it has that limit, a longest time for which one is held."""
    longest = (MOST_HELD + 0.5) * tomllib.loads(text)["sample_time"]
    more = {"range": [-1e3, 1e3], **({"longest_hold": longest} if has_limit else {})}
    entries = [f"{key} = {json.dumps(value)}" for key, value in more.items()]
    if "[[measurements]]" in text:
        return text.replace("[[measurements]]", "\n".join(["[[measurements]]", *entries]))
    [line] = re.findall(r"^measurements = .*$", text, flags=re.MULTILINE)
    signals = [signal if isinstance(signal, dict) else {"name": signal} for signal in tomllib.loads(line)["measurements"]]
    tables = [", ".join([*(f"{key} = {json.dumps(value)}" for key, value in signal.items()), *entries]) for signal in signals]
    return text.replace(line, f"measurements = [{', '.join(f'{{ {table} }}' for table in tables)}]")


def spoiled(k, count):
    """The measurements of sample k that are outside of their ranges; NaN for the others."""
    values, phase = np.full(count, np.nan), k % 400
    if phase in (0, 60):
        values[0] = 1e300
    if 150 <= phase < 150 + MOST_HELD + 12:
        values[-1] = -1e5
    if 250 <= phase < 250 + MOST_HELD:
        values[:] = 1e5
    if 300 <= phase < 320 and phase % 2:
        values[phase % count] = -2e3
    return values


@dataclass
class Case:
    """A plant file; the largest faults, the deviation of the measurements, numbers of samples, whether measurements are spoiled."""

    text: str
    fault: float
    noise: float
    samples: int = 3000
    is_spoiled: bool = False
    prefix: str = field(default="", repr=False)


CASES = {
    "three-tank": Case(TANKS["plant"], 6e-5, 1e-3),
    "sensor-fault": Case(TANKS["sensor-fault"], 6e-5, 1e-3),
    "loss-of-effectiveness": Case(TANKS["loss-of-effectiveness"], 6e-5, 1e-3),
    "reference": Case(TANKS["reference"].replace("[reference]", "[reference]\nfeedforward = true"), 6e-5, 1e-3),
    "ramp-current": Case(masses("current", "false"), 0.5, 1e-3),
    "ramp-prediction": Case(masses("prediction", "true"), 0.5, 1e-3),
    "scheduled-drive": Case("sample_time = 0.1\nt_on = 2.0\n" + DRIVE, 0.3, 1e-3),
    "scheduled-by-measurement": Case(measured(TANKS["schedule"]), 6e-5, 1e-3),
    "detection-cusum": Case(TANKS["detection"], 6e-5, 2e-3),
    "detection-window": Case(windows("false"), 0.2, 2e-2),
    "detection-isolation": Case(windows("true"), 0.2, 2e-2),
    "fall-back": Case("t_on = 3.0\n" + SAMPLED, 0.3, 1e-2),
    # Its loop without a force is slower with the compensation of the estimated fault.
    "fall-back-alone": Case(
        "t_on = 3.0\n" + SAMPLED.replace("together = 2\n", "").replace("decay = 0.1", "decay = 0.3")
        .replace("[-3, -3.3, -3.6, -4, -4.4]", "[-1, -1.1, -1.2, -1.3, -1.4]"), 0.3, 1e-2,
    ),
    "reconfiguration": Case(vehicle("t_on = 3.0\n", has_fallback=False), 1.0, 1e-3),
    "reconfiguration-detection": Case(vehicle("estimator = \"prediction\"\nmonitor = true\n") + VEHICLE_DETECTION, 1.0, 1e-3),
    "learning": Case(f"sample_time = 1.0\n{QUADRUPLE}\n[estimation]\nlaw = 'learning'\n", 0.3, 1e-2),
    "proportional-integral": Case(law(masses("current", "false"), "proportional-integral"), 0.5, 1e-3),
    "proportional-integral-sensor": Case(law(tracked_sensor(), "proportional-integral"), 6e-5, 1e-3),
    "proportional-integral-detection": Case(law(TANKS["detection"], "proportional-integral"), 6e-5, 2e-3),
    "proportional-integral-schedule": Case(law("sample_time = 0.1\nt_on = 2.0\n" + DRIVE, "proportional-integral"), 0.3, 1e-3),
    "fast-adaptive": Case(law(TANKS["loss-of-effectiveness"], "fast-adaptive"), 6e-5, 1e-3),
    "fast-adaptive-schedule": Case(law("monitor = true\n" + TANKS["schedule"], "fast-adaptive"), 6e-5, 1e-3),
    "sliding-mode": Case(law(TANKS["reference"], "sliding-mode"), 6e-5, 1e-3),
    "sliding-mode-detection": Case(law(UNSTABLE + CUSUM, "sliding-mode"), 0.5, 1e-2),
    "feedthrough": Case(FEEDTHROUGH.replace('["force"]', '[{ name = "force", limits = [-4.0, 5.0], operating = 0.5 }]'), 6.0, 1e-2),
    "feedthrough-integral": Case(
        law(FEEDTHROUGH.replace("0.01\nfilter", "0.01\nestimator = 'current'\nfilter"), "proportional-integral"), 0.5, 1e-2
    ),
    "transfer-reference": Case("transfer_time = 20.0\n" + TANKS["reference"], 6e-5, 1e-3),
    "transfer-reconfiguration": Case(
        vehicle('transfer_time = 0.5\nt_on = 3.0\nestimator = "prediction"\n') + VEHICLE_DETECTION, 20.0, 1e-3
    ),
    "transfer-schedule": Case("transfer_time = 0.7\nsample_time = 0.1\nt_on = 2.0\n" + DRIVE, 0.3, 1e-3),
    "constant-prediction": Case("sample_time = 1.0\nestimator = 'prediction'\n" + QUADRUPLE, 0.3, 1e-2),
}
HELD = {
    "held-detection": Case(held(TANKS["detection"]), 6e-5, 2e-3),
    "held-window": Case(held(windows("true")), 0.2, 2e-2),
    "held-reconfiguration": Case(held(vehicle("estimator = \"prediction\"\nmonitor = true\n") + VEHICLE_DETECTION), 1.0, 1e-3),
    "held-transfer": Case(held(vehicle("transfer_time = 0.5\nt_on = 3.0\n")), 1.0, 1e-3),
    "held-schedule": Case(held("sample_time = 0.1\nt_on = 2.0\n" + DRIVE), 0.3, 1e-3),
    "held-schedule-by-measurement": Case(held(measured(TANKS["schedule"])), 6e-5, 1e-3),
    "held-feedthrough": Case(held(CASES["feedthrough-integral"].text), 0.5, 1e-2),
    "range-reference": Case(held(CASES["reference"].text, has_limit=False), 6e-5, 1e-3),
}
for case in HELD.values():
    case.is_spoiled = True
CASES |= HELD


class Built:
    """The files of `aso-ftc design` for a plant file, in `folder`."""

    def __init__(self, aso_ftc, text, folder, *options, name="plant"):
        self.folder, self.single = folder, "--float" in options
        plant = folder / f"{name}.toml"
        plant.write_text(text, encoding="utf-8")
        outputs = ("--out", folder / "design.toml", "--c-code", folder / "c", "--no-std", folder / "rust")
        self.done = aso_ftc("design", plant, *outputs, "--certificate-time", "0", *options)
        assert self.done.returncode in (0, 1), self.done.stderr
        self.design = tomllib.loads((folder / "design.toml").read_text(encoding="utf-8"))
        [header] = (path for path in (folder / "c").glob("*.h") if path.name != "aso_controller.h")
        self.name, self.header = header.stem, header.read_text(encoding="utf-8")

    def compiled(self, *options, compiler="gcc"):
        """The C code with `controller_loop.c`, as a program, which is compiled once."""
        program = self.folder / (compiler + "".join(options).replace("=", "").replace(",", ""))
        if program.exists():
            return program
        source, header = (self.folder / "c" / f"{self.name}.{end}" for end in "ch")
        unit = program.with_suffix(".o")
        run(compiler, *WARNINGS, *options, "-c", source, "-o", unit)
        macros = [f"-DNAME={self.name}", f"-DREAL={'float' if self.single else 'double'}"]
        macros += [f"-D{name.upper()}" for name in INPUTS if self.has(name)]
        run(compiler, *options, "-include", header, *macros, HERE / "controller_loop.c", unit, "-o", program)
        return program

    def crate(self):
        """The Rust crate with `controller_loop.rs`, as a program, which is compiled once."""
        library, program = self.folder / "libcontroller.rlib", self.folder / "rust-loop"
        if program.exists():
            return program
        always = ["rustc", "--edition", "2021", "-O", "-D", "warnings"]
        source = self.folder / "rust" / "src" / "lib.rs"
        run(*always, "--crate-type", "rlib", "--crate-name", "controller", source, "-o", library)
        holds = any("longest_hold" in signal for signal in self.design["measurements"])
        switches = [("single", self.single), ("outside", "schedule" in self.design), ("lost", holds)]
        switches += [(name, self.has(name)) for name in INPUTS]
        known = ["--check-cfg", f"cfg(single, outside, lost, {', '.join(INPUTS)})"]
        known += [word for name, is_set in switches if is_set for word in ("--cfg", name)] + ["--extern", f"controller={library}"]
        run(*always, *known, HERE / "controller_loop.rs", "-o", program)
        return program

    def has(self, name):
        """Whether the controller has references, a scheduling variable that is no measurement, a detection, or others gains."""
        entry = self.design.get(name)
        if name == "reconfigurations":
            return bool(entry or "fallback" in self.design)
        if name == "schedule" and entry:
            return entry["variable"] not in [signal["name"] for signal in self.design["measurements"]]
        return bool(entry)

    @property
    def sizes(self):
        """Numbers of states, actuators, measurements, faults."""
        return [len(self.design[name]) for name in ("states", "actuators", "measurements", "faults")]


def run(*command):
    """Runs a command that must succeed."""
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def fed(program, samples):
    """What a program answers to rows of measurements and the switch, and the bytes of its state."""
    done = subprocess.run([program], input=np.ascontiguousarray(samples).tobytes(), capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    return np.frombuffer(done.stdout).reshape(len(samples), -1), int(done.stderr.split()[0])


class Plant:
    """The sampled plant of a design, with faults."""

    def __init__(self, design):
        matrix = lambda name: np.array(design[name], dtype=float)
        self.a, self.b, self.f_a, self.c = (matrix(name) for name in ("A", "B", "F_a", "C"))
        self.sensors = np.zeros((len(self.c), self.f_a.shape[1]))
        if "filter" in design:
            # The last states of the design are y_f[k+1] = y_f + w (C x + F_s f - y_f).
            n, w = len(self.a) - len(self.c), np.array(design["filter"])[:, None]
            self.c, self.sensors = self.a[n:, :n] / w, self.f_a[n:] / w
            self.a, self.b, self.f_a = self.a[:n, :n], self.b[:n], self.f_a[:n]
        self.x, self.d = np.zeros(len(self.a)), np.array(design.get("D", np.zeros((len(self.c), self.b.shape[1]))))
        operating = lambda name: np.array([signal.get("operating", 0.0) for signal in design[name]])
        self.u_op, self.y_op = operating("actuators"), operating("measurements")
        self.x_op, self.u = operating("states"), self.u_op

    def measured(self, fault):
        """The measurements."""
        return self.c @ self.x + self.sensors @ fault + self.d @ (self.u - self.u_op) + self.y_op

    def step(self, u, fault):
        """The next sample."""
        self.x, self.u = self.a @ self.x + self.b @ (u - self.u_op) + self.f_a @ fault, u


def bound_of(header):
    """The coefficients in a header of single precision: rows of outputs, columns of signals and 1."""
    text = header.split("(last row: a constant):")[1].split("*/")[0].replace("*", "")
    groups = re.split(r"\n *\n", text)[1:]
    return np.array([[float(line.split()[1]) for line in group.strip().splitlines()[1:]] for group in groups])


def stated(controller):
    """The largest numbers of operations that the header of a design states."""
    text = controller.header.replace("\n *", "")
    return {kind: int(re.search(rf"(\d+) {kind}", text).group(1)) for kind in ("multiplications", "additions", "comparisons", "divisions")}
