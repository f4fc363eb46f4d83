"""Measures time and memory of the command for FMUs with many variables: 10,000, 100,000 and 1,000,000.

Half of the variables are inputs, the others outputs, in a hierarchy of names as a Modelica tool has them.

    python3 scripts/bench/many_variables.py [--command target/release/aso-ftc] [--counts 10000,1000000]
"""

import argparse
import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def variables(count: int) -> Iterator[str]:
    """The elements of ModelVariables."""
    for k in range(count):
        name = f"plant.cell[{k // 2 // 100 + 1}].{'y' if k % 2 else 'u'}[{k // 2 % 100 + 1}]"
        kind = 'causality="output"><Real/>' if k % 2 else 'causality="input"><Real start="0"/>'
        yield f'<ScalarVariable name="{name}" valueReference="{k}" {kind}</ScalarVariable>'


def description(count: int) -> str:
    """The model description."""
    outputs = "".join(f'<Unknown index="{k + 1}" dependencies=""/>' for k in range(1, count, 2))
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" '
        f'modelName="Many" guid="{count}"><CoSimulation modelIdentifier="many" '
        f'canHandleVariableCommunicationStepSize="true"/><ModelVariables>{"".join(variables(count))}'
        f"</ModelVariables><ModelStructure><Outputs>{outputs}</Outputs><InitialUnknowns>"
        f"{outputs}</InitialUnknowns></ModelStructure></fmiModelDescription>"
    )


def build(folder: Path, count: int) -> Path:
    """Writes an FMU with `count` variables to `folder`."""
    library = folder / "many.so"
    source = ROOT / "tests/c/many.c"
    flags = ["-std=c11", "-O2", "-shared", "-fPIC", "-fvisibility=hidden"]
    subprocess.run(["cc", *flags, "-o", library, source], check=True)
    path = folder / f"many{count}.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description(count))
        archive.write(library, "binaries/linux64/many.so")
    return path


def measure(command: list[str], folder: Path) -> tuple[float, float]:
    """Processor time in s and peak memory in MiB; `check` may find faults (exit status 1)."""
    child = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode > (command[1] == "check"):
        sys.exit(f"{' '.join(command)}: exit status {child.returncode}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--command", default=str(ROOT / "target/release/aso-ftc"))
    parser.add_argument("--counts", default="10000,100000,1000000")
    options = parser.parse_args()
    program = str(Path(options.command).resolve())
    print("| variables | command | processor time, s | peak memory, MiB |\n|---|---|---|---|")
    for count in map(int, options.counts.split(",")):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            fmu = str(build(folder, count))
            size = ["--stop-time", "1", "--step", "0.1"]
            pairs = [
                f'[[connections]]\nfrom = "a.plant.cell[{k // 100 + 1}].y[{k % 100 + 1}]"\n'
                f'to = "b.plant.cell[{k // 100 + 1}].u[{k % 100 + 1}]"\n'
                for k in range(count // 2)
            ]
            system = f'[fmus]\na = "{fmu}"\nb = "{fmu}"\n{"".join(pairs)}'
            (folder / "system.toml").write_text(system)
            one = "plant.cell[1].y[1]"
            commands = {
                "`run`, one variable recorded": ["run", fmu, *size, "--record", f"many{count}.{one}"],
                "`run`, all recorded": ["run", fmu, *size],
                "`run` of two, half of them connected, one recorded": [
                    "run",
                    "system.toml",
                    *size,
                    "--record",
                    f"b.{one}",
                ],
                "`check`": ["check", fmu],
            }
            for text, arguments in commands.items():
                seconds, memory = measure([program, *arguments], folder)
                print(f"| {count:,} | {text} | {seconds:.2f} | {memory:.0f} |", flush=True)


if __name__ == "__main__":
    main()
