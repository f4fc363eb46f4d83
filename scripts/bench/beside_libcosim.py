"""Runs a system structure in aso-ftc and in libcosim, and compares the values at the end.

    .venv/bin/python scripts/bench/beside_libcosim.py system.ssp --step 1e-4 --stop-time 5

Takes an .ssp, an .ssd beside its FMUs, an OspSystemStructure.xml or a folder. Every Real output of every
FMU is compared, to six significant digits unless --digits says otherwise. Exit status: 0 all agree, 1
some do not, 2 one of the two did not come to the end. Further options go to `aso-ftc run`. libcosim's
log comes first.
"""

import argparse
import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from libcosimpy.CosimEnums import CosimVariableCausality, CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver

ROOT = Path(__file__).resolve().parents[2]
NANOSECOND = 1_000_000_000  # per s


def by_libcosim(path, step, stop):
    """The Real outputs at the stop time, by `simulator.variable`."""
    nanoseconds = None if step is None else round(step * NANOSECOND)
    is_osp = path.suffix == ".xml" or (path / "OspSystemStructure.xml").is_file()
    if is_osp:
        execution = CosimExecution.from_osp_config_file(str(path))
    else:
        execution = CosimExecution.from_ssp_file(str(path), nanoseconds)
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    if not execution.simulate_until(round(stop * NANOSECOND)):
        raise SystemExit(f"{path}: libcosim did not come to {stop} s")
    values = {}
    for info in execution.slave_infos():
        name = info.name.decode()
        for variable in execution.slave_variables(slave_index=info.index):
            is_output = variable.causality == CosimVariableCausality.OUTPUT.value
            if is_output and variable.type == CosimVariableType.REAL.value:
                (value,) = observer.last_real_values(info.index, [variable.reference])
                values[f"{name}.{variable.name.decode()}"] = value
    return values


def by_aso_ftc(command, path, step, stop, options):
    """The last row of the results."""
    with tempfile.TemporaryDirectory() as out:
        steps = [] if step is None else ["--step", repr(step)]
        arguments = [command, "run", path, "--stop-time", repr(stop), "--out", out, *steps, *options]
        done = subprocess.run(list(map(str, arguments)), stdout=subprocess.DEVNULL, check=False)
        if done.returncode != 0:
            raise SystemExit(2)
        with open(Path(out) / "results.csv", encoding="utf-8", newline="") as file:
            *_, last = csv.DictReader(file)
    return last


def main():
    """Compares, prints the differences, and counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("system", type=Path)
    parser.add_argument("--step", type=float, help="communication step in s [default: the file's]")
    parser.add_argument("--stop-time", type=float, required=True, help="in s")
    parser.add_argument("--digits", type=int, default=6, help="significant digits that must agree")
    parser.add_argument("--command", default=ROOT / "target" / "release" / "aso-ftc", help="aso-ftc")
    arguments, options = parser.parse_known_args()
    path = arguments.system.resolve()
    expected = by_libcosim(path, arguments.step, arguments.stop_time)
    outputs = by_aso_ftc(arguments.command, path, arguments.step, arguments.stop_time, options)
    differing = 0
    for name, value in sorted(expected.items()):
        output = float(outputs.get(name) or "nan")
        # libcosim writes six digits; half a unit of the last digit may be rounding.
        agrees = abs(output - value) <= 0.5 * 10 ** (1 - arguments.digits) * max(abs(output), abs(value))
        if not agrees:
            differing += 1
            print(f"{name}: {output!r}, libcosim {value!r}")
    print(f"{path.name}: {len(expected)} outputs, {differing} differ in {arguments.digits} digits")
    # libcosim may crash when Python exits.
    sys.stdout.flush()
    os._exit(1 if differing else 0)


if __name__ == "__main__":
    main()
