"""Systematic faults: the n-th call of one kind fails, for each n, in each command.

    .venv/bin/python tests/foreign/faults.py [--scenario NAME ...] [--calls CLASS ...] [--most N] [--jobs N]

Without --most, n runs from 1 until a run reaches no fault; --most N tries N values of n, equally apart. The fault is
injected by the library tests/faults/faults.c. Every file that the command writes exists before with other content.
Prints a line for each scenario and kind of fault, and every run that breaks the rule of `judge`; exit status 1 if one
does. Needs the FMUs of `aso-ftc pack` and `aso-ftc pack examples/dc-servo`.
"""

import argparse
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue

from fault_scenarios import ROOT, Scenario, is_prefix, is_whole, scenarios, shown

# Seconds after which a run counts as hanging.
LIMIT = 60
# What differs between runs that break the rule in the same way.
VARYING = re.compile(r"/\S*?/slot\d+/|(?<=fmi2-unpacked-)\w+|(?<=\.)\d+(?=\.partial)|(?<=\.)\d+(?=\.old)")
PAGE = struct.Struct("QQ64s1024s")


@dataclass(frozen=True)
class Kind:
    """A class of calls, the error with which they fail, and whether all later calls fail, too."""

    calls: str
    error: str
    lasting: bool = False

    @property
    def number(self):
        """The value of errno."""
        return NUMBERS.get(self.error, 0)

    def __str__(self):
        return f"{self.calls} {self.error}" + (" lasting" if self.lasting else "")


NUMBERS = {"EINTR": 4, "EIO": 5, "EAGAIN": 11, "ENOMEM": 12, "EACCES": 13, "EMFILE": 24, "ENOSPC": 28}
KINDS = [
    Kind("write", "ENOSPC"),
    Kind("write", "ENOSPC", lasting=True),
    Kind("write", "EIO"),
    Kind("write", "EINTR"),
    Kind("write", "short"),
    Kind("open", "EACCES"),
    Kind("open", "EMFILE", lasting=True),
    Kind("open", "EINTR"),
    Kind("rename", "EIO"),
    Kind("rename", "ENOSPC", lasting=True),
    Kind("sync", "EIO"),
    Kind("read", "EIO"),
    Kind("read", "EINTR"),
    Kind("read", "short"),
    Kind("map", "ENOMEM"),
    Kind("map", "ENOMEM", lasting=True),
    Kind("start", "EAGAIN"),
    Kind("start", "EAGAIN", lasting=True),
    Kind("memory", "ENOMEM"),
    Kind("memory", "ENOMEM", lasting=True),
]


@dataclass
class Run:
    """A finished run: how it ended, what it printed, and what the library injected."""

    number: int
    status: int | None
    out: str
    err: str
    calls: int
    faults: int
    function: str
    path: str


@dataclass
class Sweep:
    """The runs of a scenario with one kind of fault."""

    scenario: str
    kind: Kind
    calls: int = 0
    faults: int = 0
    runs: int = 0
    statuses: Counter = field(default_factory=Counter)
    broken: list[str] = field(default_factory=list)

    def __str__(self):
        statuses = ", ".join(f"{count} x {status}" for status, count in sorted(self.statuses.items(), key=str))
        return f"{self.scenario:12} {self.kind!s:22} {self.calls:6} calls, {self.faults:6} faults [{statuses}], {self.runs} broken"


def library(folder):
    """Compiles the library of faults."""
    path = Path(folder, "faults.so")
    source = ROOT / "tests" / "faults" / "faults.c"
    subprocess.run(["cc", "-shared", "-fPIC", "-O2", "-o", path, source], check=True)
    return path


class Bench:
    """A scenario that is ready to run: its inputs, the earlier content of its outputs, and their right content."""

    def __init__(self, scenario: Scenario, preload: Path, folder: Path, jobs: int) -> None:
        self.scenario, self.preload = scenario, preload
        self.slots: SimpleQueue[Path] = SimpleQueue()
        self.template = folder / "template"
        self.template.mkdir(parents=True)
        scenario.prepare(self.template)
        if scenario.earlier:
            self.execute(self.template, scenario.earlier)
        self.earlier = {name: (self.template / name).read_bytes() for name in scenario.outputs}
        outputs = {Path(name) for name in scenario.outputs}
        self.inputs = {path.relative_to(self.template) for path in files(self.template)} - outputs
        for job in range(jobs):
            self.slots.put(folder / f"slot{job}")
        slot = self.fresh()
        self.execute(slot, scenario.words)
        self.right = {name: (slot / name).read_bytes() for name in scenario.outputs}
        if unchanged := [name for name in scenario.outputs if self.right[name] == self.earlier[name]]:
            raise AssertionError(f"{scenario.name}: the earlier content of {unchanged} is the right one")
        self.place = slot
        self.slots.put(slot)

    def execute(self, folder, words):
        """Runs the command without faults."""
        done = self.start(folder, words, {})
        out, err = done.communicate()
        if done.returncode != self.scenario.status:
            raise AssertionError(f"{self.scenario.name}: {words}: {done.returncode}\n{out.decode()}{err.decode()}")

    def start(self, folder, words, variables):
        """Starts the command in a folder, whose subfolder `tmp` has its temporary files."""
        (folder / "tmp").mkdir(exist_ok=True)
        places = {name: text.format(folder=folder) for name, text in self.scenario.environment.items()}
        environment = {**os.environ, "TMPDIR": str(folder / "tmp"), **places, **variables}
        return subprocess.Popen(
            [str(self.scenario.program), *words],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )

    def fresh(self):
        """A folder as it is before a run."""
        slot = self.slots.get()
        shutil.rmtree(slot, ignore_errors=True)
        shutil.copytree(self.template, slot)
        return slot

    def run(self, kind: Kind, number: int) -> tuple[Run, list[str]]:
        """Runs the command with the fault at call `number`; returns what breaks the rule."""
        slot = self.fresh()
        page = slot.with_suffix(".page")
        page.write_bytes(bytes(4096))
        variables = {
            "LD_PRELOAD": str(self.preload),
            "FAULTS_PAGE": str(page),
            "FAULTS_CLASS": kind.calls,
            "FAULTS_NUMBER": str(number),
            "FAULTS_ERROR": "short" if kind.error == "short" else str(kind.number),
            "FAULTS_LASTING": str(int(kind.lasting)),
            "FAULTS_PROGRAM": self.scenario.program.resolve().name,
            "FAULTS_FOLDER": f"{slot}/" if self.scenario.calls else "",
        }
        process = self.start(slot, self.scenario.words, variables)
        try:
            out, err = process.communicate(timeout=LIMIT)
            status = process.returncode
        except subprocess.TimeoutExpired:
            status = None
            os.killpg(process.pid, signal.SIGKILL)
            out, err = process.communicate()
        calls, faults, function, path = PAGE.unpack_from(page.read_bytes())
        texts = [part.rstrip(b"\0").decode(errors="replace") for part in (function, path)]
        run = Run(number, status, out.decode(errors="replace"), err.decode(errors="replace"), calls, faults, *texts)
        broken = self.judge(run, kind, slot)
        self.slots.put(slot)
        return run, broken

    def judge(self, run: Run, kind: Kind, slot: Path) -> list[str]:
        """What breaks the rule, which is the same for every fault.

        Either the status is that of the run without faults and every file is whole, or the status says that
        something failed, a sentence names the file and the cause, and every output is as before, whole, or a
        readable start (results and logs only). No panic, no hang, no other file.
        """
        if run.status is None:
            return [f"no end within {LIMIT} s"]
        broken = []
        # The standard library of Rust panics if a thread gets no stack for signal handlers, and if it cannot read
        # the output of a process; zlib-rs, if it gets no memory.
        foreign = (kind.calls == "map" and "alternative" in run.err) or run.path.startswith("pipe:")
        foreign |= kind.calls == "memory" and "MemError" in run.err
        if "panicked at" in run.err and not foreign:
            broken.append("a panic")
        done = run.status == self.scenario.status
        for name in self.scenario.outputs:
            state = self.state(name, slot)
            allowed = {"whole"} if done else {"whole", "as before", "its start"}
            if not done and kind.calls == "write" and name.endswith(".parquet"):
                # A start that can be neither written nor emptied is removed.
                allowed.add("missing")
            if state not in allowed:
                broken.append(f"{name} is {state}")
        if not done and not foreign:
            broken += self.unnamed(run, kind, slot)
            # Rust ends a process that has no memory by abort, after a sentence.
            if run.status < 0 and kind.calls != "memory":
                broken.append(f"ended by signal {-run.status}")
        known = self.inputs | {Path(name) for name in self.scenario.outputs}
        others = {path.relative_to(slot) for path in files(slot)} - known
        if any(path.parts[0] == "tmp" for path in others):
            # The next run removes unpacked FMUs that this one could not remove.
            self.execute(slot, self.scenario.words)
            others &= {path.relative_to(slot) for path in files(slot)}
        # Python cannot remove its temporary folder without a descriptor.
        if kind.calls == "open" and kind.lasting:
            others = {path for path in others if not path.match("tmp/tmp*/*/*")}
        # A thread that the standard library ended was writing.
        if foreign:
            others = {path for path in others if path.suffix != ".partial"}
        # A former content that could not be put back is named.
        others = {path for path in others if str(path) not in run.err}
        if others:
            broken.append(f"left behind: {', '.join(sorted(map(str, others))[:3])}")
        return broken

    def state(self, name, slot):
        """What an output is after a run."""
        path = slot / name
        if not path.exists():
            return "missing"
        content = path.read_bytes()
        places = (bytes(slot), bytes(self.place))
        if is_whole(name, content, self.right[name], places):
            return "whole"
        if content == self.earlier[name]:
            return "as before"
        return "its start" if is_prefix(name, path, self.right[name]) else f"damaged ({len(content)} bytes)"

    def unnamed(self, run: Run, kind: Kind, slot: Path) -> list[str]:
        """What the sentence of a failed run does not name."""
        # `check` prints what it finds to standard output.
        text = run.out + run.err
        if kind.calls == "memory":
            # The dynamic linker of glibc names another cause.
            named = "memory" in text.lower() or "shared object" in text
            return [] if named else ["the sentence does not name the memory"]
        cause = os.strerror(kind.number)
        missing = [] if cause in text else [f"the sentence does not name the cause, {cause}"]
        path = Path(run.path)
        if run.path and (not path.is_absolute() or path.is_relative_to(slot)):
            relative = str(path.relative_to(slot) if path.is_absolute() else path)
            names = shown(relative)
            if relative.startswith("tmp/"):
                names += [known.name for known in self.inputs]
            if kind.lasting:
                # The first fault may concern a file that is not needed.
                names += [*self.scenario.outputs, "fmi2-unpacked-", "--fmu-worker"]
            if not any(name in text for name in names):
                missing.append(f"the sentence does not name the file, {relative}")
        return missing


def files(folder):
    """All files of a folder, with links and empty folders in `tmp`."""
    return [path for path in Path(folder).rglob("*") if not path.is_dir() or (path.parent.name == "tmp" and path.name)]


def sweep(bench: Bench, kind: Kind, most: int | None, pool: ThreadPoolExecutor) -> Sweep:
    """Lets the n-th call fail, for every n or for `most` of them."""
    counted, broken = bench.run(kind, 0)
    result = Sweep(bench.scenario.name, kind, counted.calls)
    result.broken += [f"without a fault: {text}" for text in broken]
    numbers = list(range(1, counted.calls + 2))
    if most is not None and counted.calls > most:
        numbers = sorted({1 + round(place * (counted.calls - 1) / max(1, most - 1)) for place in range(most)})
    alike: dict[str, list[int]] = {}
    while numbers:
        reached = 0
        for run, broken in pool.map(lambda number: bench.run(kind, number), numbers):
            reached = run.faults
            if reached:
                result.faults += 1
                result.statuses["none" if run.status is None else run.status] += 1
            if broken:
                end = run.err.strip().splitlines()[-1:] or [""]
                text = f"{run.function} {run.path}: {'; '.join(broken)}: {end[0]}"
                alike.setdefault(VARYING.sub("", text), []).append(run.number)
        # The number of calls varies with the timing of threads.
        numbers = [numbers[-1] + 1] if reached and most is None else []
    result.broken += [f"{len(runs)} x, n = {runs[0]}: {text}" for text, runs in alike.items()]
    result.runs = sum(map(len, alike.values()))
    return result


def main():
    """Runs the sweeps that the command line selects."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", nargs="+", metavar="NAME", help="all without it")
    parser.add_argument("--calls", nargs="+", metavar="CLASS", help="all without it")
    parser.add_argument("--most", type=int, metavar="N", help="number of faults of each kind in each scenario")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), metavar="N", help="runs at the same time")
    options = parser.parse_args()
    total, broken = 0, 0
    with tempfile.TemporaryDirectory() as place, ThreadPoolExecutor(options.jobs) as pool:
        preload = library(place)
        for scenario in scenarios():
            if options.scenario and scenario.name not in options.scenario:
                continue
            bench = Bench(scenario, preload, Path(place, scenario.name), options.jobs)
            for kind in KINDS:
                if not scenario.has(kind.calls) or (options.calls and kind.calls not in options.calls):
                    continue
                result = sweep(bench, kind, options.most, pool)
                print(result, *result.broken, sep="\n  ", flush=True)
                total += result.faults
                broken += len(result.broken)
    print(f"{total} faults, {broken} ways to break the rule")
    sys.exit(broken > 0)


if __name__ == "__main__":
    main()
