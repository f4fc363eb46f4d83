"""The questions of scripts/reference/field and their verdicts for one FMU."""

import csv
import json
import math
import re
import shutil
import sys
import tempfile
from pathlib import Path

import numpy

from field_process import run

SIDE = Path(__file__).resolve().with_name("field_fmpy.py")
CLOSE = 1e-9  # of a variable's largest magnitude
CHAINED_STEPS = 20

# The verdicts of each question, in order from the best to the worst. docs/how-to/field.md explains
# them.
QUESTIONS = {
    "defaults": ["ok", "only aso-ftc", "neither", "lost", "crashed"],
    "values": ["bits", "close", "steps", "times", "only aso-ftc", "neither", "differ", "lost", "crashed"],
    "chained": ["same", "not judged", "differ", "lost"],
    "set": ["kept", "not judged", "lost"],
    "check": ["agrees", "finds more", "finds less", "not judged", "failed"],
}
# The verdicts that are failures.
SHORT = {
    "defaults": {"lost", "crashed"},
    "values": {"differ", "lost", "crashed"},
    "chained": {"differ", "lost"},
    "set": {"lost"},
    "check": {"failed"},
}


def verdict(word, detail=""):
    """A verdict and its detail."""
    return {"verdict": word, "detail": detail}


class Judge:
    """Compares FMUs, each in a folder of its own below `folder`."""

    def __init__(self, options, sink, folder):
        self.command, self.limit, self.steps = options.command, options.time_limit, options.steps
        self.sink, self.folder = sink, folder

    def verdicts(self, fmu):
        """The verdict of every question."""
        folder = Path(tempfile.mkdtemp(dir=self.folder))
        try:
            trial = Trial(self, fmu, folder)
            return {question: getattr(trial, question)() for question in QUESTIONS}
        finally:
            shutil.rmtree(folder, ignore_errors=True)


class Trial:
    """One FMU in both tools."""

    def __init__(self, judge, fmu, folder):
        self.judge, self.fmu, self.folder = judge, fmu, folder
        self.stop = min(fmu.stop, fmu.start + judge.steps * fmu.step)

    def fmpy(self, task, *arguments):
        """FMPy's result of a task; its entry `error` has the reason if there is none."""
        out = self.folder / f"{task}.json"
        ended = run([sys.executable, SIDE, task, self.fmu.path, out, *arguments], self.judge.limit, self.folder)
        if ended.status == 0 and out.is_file():
            return json.loads(out.read_text(encoding="utf-8"))
        return {"error": ended.why()}

    def file(self, name, content):
        """Writes a file with that content as JSON."""
        path = self.folder / f"{name}.json"
        path.write_text(json.dumps(content), encoding="utf-8")
        return path

    def ours(self, name, *arguments):
        """Runs the FMU, called m, in aso-ftc; returns how it ended and the file of its results."""
        out = self.folder / name
        command = [self.judge.command, "run", "--fmu", f"m={self.fmu.path}", *arguments, "--out", out]
        return run(command, self.judge.limit, self.folder), out / "results.csv"

    def timed(self, stop, *record):
        """Options of a run with stated times that records every step."""
        names = [part for name in record for part in ("--record", f"m.{name}")]
        times = ["--stop-time", repr(stop), "--step", repr(self.fmu.step)]
        return [*times, "--record-every", "step", *names]

    def defaults(self):
        """Question `defaults`: does it run without options wherever FMPy's default does?"""
        theirs = self.fmpy("defaults")
        ended, _ = self.ours("defaults")
        return self.both(ended, theirs) or verdict("ok")

    @staticmethod
    def both(ended, theirs):
        """The verdict if one of the two tools has no result."""
        if "error" not in theirs:
            return None if ended.status == 0 else verdict("lost", ended.why())
        if ended.status == 0:
            return verdict("only aso-ftc", f"FMPy: {theirs['error']}")
        if ended.silent():
            return verdict("crashed", f"{ended.why()}; FMPy: {theirs['error']}")
        return verdict("neither", f"aso-ftc: {ended.why()}; FMPy: {theirs['error']}")

    def values(self):
        """Question `values`: are the outputs the same with stated step and stop time?"""
        names = self.file("names", self.fmu.compared)
        theirs = self.fmpy("timed", repr(self.stop), repr(self.fmu.step), names)
        ended, results = self.ours("values", *self.timed(self.stop, *self.fmu.compared))
        other = self.both(ended, theirs)
        if other:
            return other
        rows = numpy.load(self.folder / "timed.npy", allow_pickle=True)
        outcome = compared(rows, columns(results), self.fmu.step)
        return self.replayed(outcome) if outcome["verdict"] == "differ" else outcome

    def replayed(self, outcome):
        """If values differ: do they still differ when FMPy's functions use the step sizes of aso-ftc?"""
        log = self.folder / "calls.txt"
        options = [*self.timed(self.stop, *self.fmu.compared), "--log-calls", log]
        ended, results = self.ours("replayed", *options)
        if ended.status != 0:
            return outcome
        steps = [
            [float(text) for text in match.groups()]
            for match in re.finditer(r"^m fmi2DoStep\(([^,]+), ([^,]+), true\)", log.read_text(), re.MULTILINE)
        ]
        calls = self.file("calls", {"names": self.fmu.compared, "steps": steps})
        theirs = self.fmpy("replay", repr(self.stop), repr(self.fmu.step), calls)
        if "error" in theirs:
            return outcome
        rows = numpy.load(self.folder / "replay.npy", allow_pickle=True)
        same = compared(rows, columns(results), self.fmu.step)["verdict"] in ("bits", "close")
        return verdict("steps", outcome["detail"]) if same else outcome

    def chained(self):
        """Question `chained`: are the results those of the FMU alone if it is connected to another one?"""
        port = next((name for name in self.fmu.real_outputs if "=" not in name), None)
        if port is None:
            return verdict("not judged", "no Real output")
        stop = min(self.stop, self.fmu.start + CHAINED_STEPS * self.fmu.step)
        timed = self.timed(stop, port)
        ended, results = self.ours("alone", *timed)
        if ended.status != 0:
            return verdict("not judged", f"alone: {ended.why()}")
        alone = columns(results)[f"m.{port}"]
        if not all(math.isfinite(number(text)) for text in alone):
            return verdict("not judged", f"{port} is not finite when the FMU runs alone")
        sink, target = self.judge.sink
        link = ["--fmu", f"s={sink}", "--connect", f"m.{port}=s.{target}"]
        ended, results = self.ours("chained", *link, *timed)
        if ended.status != 0:
            return verdict("lost", ended.why())
        column = columns(results)[f"m.{port}"]
        if column == alone:
            return verdict("same")
        if len(column) != len(alone):
            return verdict("differ", f"{len(column)} rows, alone {len(alone)}")
        row = next(row for row, pair in enumerate(zip(column, alone)) if pair[0] != pair[1])
        return verdict("differ", f"{port} in row {row} is {column[row]}, alone {alone[row]}")

    def set(self):
        """Question `set`: are parameters kept that FMPy can set?"""
        if not self.fmu.parameters:
            return verdict("not judged", "no Real parameter with a start value")
        stop = self.fmu.start + 2 * self.fmu.step
        values = self.file("parameters", self.fmu.parameters)
        theirs = self.fmpy("set", repr(stop), repr(self.fmu.step), values)
        if not theirs.get("kept"):
            return verdict("not judged", f"FMPy: {theirs.get('error', 'the FMU keeps none')}")
        chosen = {name: self.fmu.parameters[name] for name in theirs["kept"]}
        settings = [part for name, value in chosen.items() for part in ("--set", f"m.{name}={value!r}")]
        ended, results = self.ours("set", *settings, *self.timed(stop, *chosen))
        if ended.status != 0:
            return verdict("lost", ended.why())
        table = columns(results)
        lost = [
            name
            for name, value in chosen.items()
            if not abs(number(table.get(f"m.{name}", ["nan"])[0]) - value) <= 1e-9 * abs(value)
        ]
        return verdict("lost", f"not as set: {', '.join(lost)}") if lost else verdict("kept")

    def check(self):
        """Question `check`: does `aso-ftc check` end, and find errors where FMPy's validation finds problems?"""
        command = [self.judge.command, "check", self.fmu.path]
        ended = run(command, 4 * self.judge.limit, self.folder)
        if ended.status not in (0, 1):
            return verdict("failed", ended.why())
        theirs = self.fmpy("validate")
        if "error" in theirs:
            return verdict("not judged", f"FMPy: {theirs['error']}")
        problems = theirs["problems"]
        if bool(problems) == bool(ended.status):
            return verdict("agrees")
        return verdict("finds less", f"FMPy: {problems[0]}") if problems else verdict("finds more", ended.why())


def columns(path):
    """The columns of a CSV file by name, as text."""
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    return {name: [row[index] for row in rows[1:]] for index, name in enumerate(rows[0])}


def number(text):
    """A number of a CSV file; a Boolean is 0 or 1."""
    try:
        return float(text)
    except ValueError:
        return {"true": 1.0, "false": 0.0}.get(text.lower(), math.nan)


def compared(theirs, ours, step):
    """Compares FMPy's rows with our columns: equal bits, close, or the largest difference."""
    names = theirs.dtype.names[1:]
    if len(theirs) != len(ours["time"]):
        ends = f"the last at {ours['time'][-1]} s, FMPy {len(theirs)}, the last at {float(theirs['time'][-1])!r} s"
        return verdict("differ", f"{len(ours['time'])} rows, {ends}")
    times = numpy.array([number(text) for text in ours["time"]])
    if not numpy.allclose(times, theirs["time"], rtol=1e-9, atol=1e-6 * step):
        return verdict("differ", "the rows are at other times")
    if not names:
        return verdict("times", "no output and no Real local")
    worst, where, bits = 0.0, "", True
    for name in names:
        column = ours.get(f"m.{name}")
        if column is None:
            return verdict("differ", f"{name} is not in the results")
        deviation = distance(theirs[name], column)
        bits &= deviation is None
        if deviation is not None and deviation >= worst:
            worst, where = deviation, name
    if bits:
        return verdict("bits")
    if worst <= CLOSE:
        return verdict("close", f"{worst:.1e} in {where}")
    return verdict("differ", f"{worst:.1e} of its largest magnitude in {where}")


def distance(theirs, column):
    """The largest difference relative to the largest magnitude; None if all bits agree."""
    if theirs.dtype.kind not in "fiub":
        texts = [value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value) for value in theirs]
        return None if texts == column else math.inf
    theirs, ours = theirs.astype(float), numpy.array([number(text) for text in column])
    if numpy.array_equal(theirs, ours, equal_nan=True):
        return None
    finite = numpy.isfinite(theirs)
    if not numpy.array_equal(theirs[~finite], ours[~finite], equal_nan=True):
        return math.inf
    scale = numpy.abs(theirs[finite]).max(initial=0.0)
    apart = numpy.abs(theirs[finite] - ours[finite]).max(initial=0.0)
    return float(apart / scale) if scale > 0.0 and math.isfinite(apart) else math.inf
