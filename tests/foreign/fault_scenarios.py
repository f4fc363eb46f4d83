"""The commands that are tried with systematic faults, the files that they write, and what these may contain."""

import io
import os
import re
import shutil
import subprocess
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow
import pyarrow.parquet

ROOT = Path(__file__).resolve().parents[2]
DIST = ROOT / "dist"
PROGRAM = Path(os.environ.get("BUILT_PROGRAMS", ROOT / "target" / "release"), "aso-ftc")
# The interpreter of scripts/wheel --test, which has the package aso_ftc.
PYTHON = Path(os.environ.get("ASO_FTC_PYTHON", ROOT / "target" / "wheel" / "test" / "bin" / "python"))
PLANT, CONTROLLER, SERVO = "FrictionPendulum.fmu", "AsoController.fmu", "DcServo.fmu"
# A small FMU in C, of which a few calls read everything.
SMALL = "Troubles.fmu"

# What differs between pages of two runs: wall-clock times, the hash of their script, messages of the run.
FREEING = re.compile(rb"(\S+ fmi2(Terminate|FreeInstance)\(.*\n)+\Z")
VARYING = re.compile(
    rb"in \d+ steps? and [^<]*? times real time|sha256-[^']*"
    rb"|<p><a href=.#messages.>[^<]*</a></p>|<section[^>]*messages.*?</section>",
    re.S,
)
TEMPORARY = re.compile(r"^\.(?=.*\.tmp$)|\.\d+\.(partial|old|tmp)")
# The first bytes of a checkpoint; a checksum and the content, with absolute paths, follow.
CHECKPOINT = b"aso-ftc-state-6\n"
SUMMED = len(CHECKPOINT) + 4

# Answers a call of cargo or rustc from the files of an earlier call with the same arguments.
RECORDED = """#!/bin/sh
answer="$0-$(printf '%s ' "$@" | cksum | tr -d ' ')"
if [ ! -e "$answer" ]; then
  "{program}" "$@" >"$answer.new" || exit
  mv "$answer.new" "$answer"
fi
exec cat "$answer"
"""

# Two runs of a campaign as a worker does them; the rows are written if no run failed.
WORKER = """
import json, sys, tempfile
from pathlib import Path
from aso_ftc.campaign import Campaign, _folder, _worker
campaign = Campaign.from_toml("campaign.toml")
with tempfile.TemporaryDirectory() as place:
    runner = _worker.Job.of(campaign).unpack(Path(place))
    runner.check()
    rows = [runner.run(number, campaign.plan.row(number)[0], 0) for number in range(2)]
wrong = [row.reason for row in rows if row.status != "ok"]
if wrong:
    sys.exit("error: " + wrong[0])
_folder.write(Path(sys.argv[1]), json.dumps([row.measures for row in rows]).encode())
"""
CAMPAIGN = """
system = "system.toml"
experiment.stop-time = 0.05
[parameters]
"Troubles.u" = { values = [1.0, 2.0] }
[measures]
peak = "max(abs(Troubles.y))"
"""
SYSTEM = """
fmus.Troubles = "Troubles.fmu"
algorithm.step = 0.001
"""


def small(folder):
    """Builds the small FMU."""
    source, library = ROOT / "tests" / "troubles", folder / "Troubles.so"
    command = ["cc", "-std=c11", "-O1", "-pthread", "-shared", "-fPIC", "-o", library, source / "troubles.c"]
    subprocess.run(command, check=True)
    with zipfile.ZipFile(folder / SMALL, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(source / "modelDescription.xml", "modelDescription.xml")
        archive.write(library, "binaries/linux64/Troubles.so")
    library.unlink()


@dataclass
class Scenario:
    """A command, the files that it reads, and those that it writes."""

    name: str
    words: list[str]
    # Writes the same files with other content; none, where the command writes new files only.
    earlier: list[str]
    outputs: list[str]
    # Files of `dist`, and what writes other inputs into the folder.
    fmus: tuple[str, ...] = ()
    write: Callable[[Path], None] = small
    status: int = 0
    program: Path = PROGRAM
    environment: dict[str, str] = field(default_factory=dict)
    # If given, only these classes of calls are tried, and only on files in the folder of the run.
    calls: tuple[str, ...] = ()

    def has(self, calls):
        """Whether a class of calls is tried."""
        return not self.calls or calls in self.calls

    def prepare(self, folder):
        """Puts the inputs into a folder."""
        for name in self.fmus:
            shutil.copy(DIST / name, folder)
        self.write(folder)


def run(name, *words, outputs):
    """A scenario of `aso-ftc run`, whose earlier files are those of a shorter run."""
    command = ["run", SMALL, "--set", "Troubles.u=1", "--step", "0.001", *words, "--stop-time"]
    return Scenario(name, [*command, "0.05"], [*command, "0.02"], outputs)


def write_plants(folder):
    """The plant file of the tutorial, sampled, and one with another eigenvalue."""
    text = (ROOT / "examples" / "dc-servo" / "plant.toml").read_text(encoding="utf-8")
    text = text.replace("../../dist/", f"{folder}/") + "sample_time = 0.001\n"
    (folder / "plant.toml").write_text(text, encoding="utf-8")
    (folder / "earlier").mkdir()
    (folder / "earlier" / "plant.toml").write_text(text.replace("-300", "-290"), encoding="utf-8")


def design():
    """A design with all of its files."""
    outputs = ["design.toml", "report.html", "Servo.fmu", "c/plant.h", "c/plant.c"]
    options = ["--out", "design.toml", "--report", "report.html", "--fmu", "Servo.fmu", "--from", CONTROLLER]
    options += ["--c-code", "c", "--force"]
    words, earlier = ["design", "plant.toml", *options], ["design", "earlier/plant.toml", *options]
    return Scenario("design", words, earlier, outputs, (CONTROLLER, SERVO), write_plants)


def pack():
    """Packing, without the work of cargo; the earlier FMU is another one."""

    def write(folder):
        for program in ("cargo", "rustc"):
            path = folder / program
            path.write_text(RECORDED.format(program=shutil.which(program)), encoding="utf-8")
            path.chmod(0o755)
        (folder / "out").mkdir()
        shutil.copy(DIST / PLANT, folder / "out" / SERVO)

    words = ["pack", str(ROOT / "examples" / "dc-servo"), "--out"]
    environment = {"CARGO": "{folder}/cargo", "RUSTC": "{folder}/rustc"}
    return Scenario("pack", [*words, "out"], [*words, "recorded"], [f"out/{SERVO}"], (), write, environment=environment)


def report():
    """The page of a results file."""

    def write(folder):
        rows = [f"{k / 100},{k * k}" for k in range(100)]
        (folder / "r.csv").write_text("\n".join(['"time","y"', *rows]) + "\n", encoding="utf-8")
        (folder / "r.html").write_text("<!doctype html><p>earlier", encoding="utf-8")

    return Scenario("report", ["report", "r.csv", "--force"], [], ["r.html"], (), write)


def worker():
    """Two runs of a campaign."""

    def write(folder):
        small(folder)
        (folder / "worker.py").write_text(WORKER, encoding="utf-8")
        (folder / "system.toml").write_text(SYSTEM, encoding="utf-8")
        (folder / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
        (folder / "rows.json").write_text("[]", encoding="utf-8")

    # Calls without a file are those of Python and numpy.
    calls = ("write", "open", "rename", "sync", "read")
    words = ["worker.py", "rows.json"]
    return Scenario("worker", words, [], ["rows.json"], (), write, program=PYTHON, calls=calls)


def scenarios():
    """All scenarios; that of a campaign only where the package is."""
    checkpoint = ["--checkpoint", "state", "--checkpoint-every", "0.01"]
    cases = [
        run("csv", "--results", "out/r.csv", outputs=["out/r.csv"]),
        run("parquet", "--results", "r.parquet", outputs=["r.parquet"]),
        run("checkpoint", "--results", "r.csv", *checkpoint, outputs=["r.csv", "state"]),
        run(
            "page",
            *("--results", "r.csv", "--report", "--plot", "*.y", "--plot-file", "p.svg"),
            outputs=["r.csv", "r.html", "p.svg"],
        ),
        run("calls", "--results", "r.csv", "--log-calls", "calls.log", outputs=["r.csv", "calls.log"]),
        run("isolated", "--results", "r.csv", "--isolate", outputs=["r.csv"]),
        design(),
        pack(),
        Scenario("check", ["check", SERVO], [], [], (SERVO,), lambda folder: None),
        report(),
    ]
    return [*cases, worker()] if PYTHON.exists() else cases


def is_whole(name, content, right, places):
    """Whether a file has the right content, apart from times; `places` are the folders of the two runs."""
    if name.endswith(".html"):
        return VARYING.sub(b"", content.replace(*places)) == VARYING.sub(b"", right)
    if right.startswith(CHECKPOINT):
        return is_checkpoint(content) and content.replace(*places)[SUMMED:] == right[SUMMED:]
    return content == right


def is_checkpoint(content):
    """Whether a file is a checkpoint whose checksum is right."""
    return content[:SUMMED] == CHECKPOINT + zlib.crc32(content[SUMMED:]).to_bytes(4, "little")


def is_prefix(name, path, right):
    """Whether a file is a start: of results, readable; of calls, any; the page or the checkpoint of a shorter run."""
    content = path.read_bytes()
    if name.endswith(".html"):
        return content.rstrip().endswith(b"</html>")
    if name.endswith(".log"):
        # A run that ends early frees the FMU.
        return right.startswith(FREEING.sub(b"", content))
    if not content:
        # The file was emptied, and its first write failed.
        return name.endswith((".csv", ".parquet"))
    if name.endswith(".csv"):
        return right.startswith(content) and content.endswith(b"\n")
    if name.endswith(".parquet"):
        try:
            rows = pyarrow.parquet.read_table(path)
        except (pyarrow.ArrowInvalid, OSError):
            return False
        return rows.equals(pyarrow.parquet.read_table(io.BytesIO(right)).slice(0, len(rows)))
    return right.startswith(CHECKPOINT) and is_checkpoint(content)


def shown(path):
    """The names by which a sentence can name a file; the path is relative to the folder of the run."""
    path = TEMPORARY.sub("", path)
    # A folder may be named for its files.
    return [path, os.path.basename(path), *([os.path.dirname(path)] if os.path.dirname(path) else [])]
