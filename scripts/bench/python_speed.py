"""Speed of the Python package beside the command and FMPy: prints a table.

Run it in an environment with the wheel and FMPy, on an idle machine:

    target/wheel/test/bin/python -P scripts/bench/python_speed.py
"""

import os
import re
import subprocess
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import aso_ftc as af

STEP, STOP = 1e-3, 100.0
REPEATS = 5


def best(function, repeats=REPEATS):
    """The shortest time of several calls in s, and the last result."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - start)
    return min(times), result


def command(folder):
    """Wall-clock time of the steps that the command states, in s."""
    file = Path(folder) / "system.toml"
    file.write_text(af.paper().to_toml(), encoding="utf-8")
    words = [str(af.command()), "run", str(file), "--out", folder]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    return float(re.search(r"and ([0-9.]+) s of wall-clock", done.stdout)[1])


def fmpy_loop():
    """The paper's loop by FMPy's classes: Jacobi, a row every ten steps."""
    import shutil

    import fmpy
    from fmpy.fmi2 import FMU2Slave

    slaves, folders = [], []
    for name in ("FrictionPendulum", "AsoController"):
        path = str(af.fmus()[name])
        description, folder = fmpy.read_model_description(path), fmpy.extract(path)
        identifier = description.coSimulation.modelIdentifier
        slave = FMU2Slave(
            guid=description.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName=name
        )
        slave.instantiate()
        slave.setupExperiment(startTime=0.0, stopTime=STOP)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        names = {variable.name: variable.valueReference for variable in description.modelVariables}
        slaves.append((slave, names))
        folders.append(folder)
    (plant, p), (controller, c) = slaves
    outputs, inputs = [p["x_p"], p["theta"]], [c["x_p"], c["theta"]]
    rows = []
    start = time.perf_counter()
    for k in range(round(STOP / STEP)):
        controller.setReal(inputs, plant.getReal(outputs))
        plant.setReal([p["u"]], controller.getReal([c["u"]]))
        plant.doStep(k * STEP, STEP)
        controller.doStep(k * STEP, STEP)
        if k % 10 == 9:
            rows.append(plant.getReal(list(range(len(p)))[:8]))
    seconds = time.perf_counter() - start
    for slave, _ in slaves:
        slave.terminate()
        slave.freeInstance()
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)
    return seconds


def threads(system, count):
    """Runs per second of several threads, and processor time of a run in ms."""
    each = 12
    with ThreadPoolExecutor(count) as pool:
        start, used = time.perf_counter(), time.process_time()
        list(pool.map(lambda _: [system.run(stop_time=20.0) for _ in range(each)], range(count)))
        used, runs = time.process_time() - used, count * each
        return runs / (time.perf_counter() - start), used / runs * 1e3


def resident():
    """Resident memory in MB."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 1e6


def main():
    """Measures and prints."""
    system = af.paper()
    system.run()
    with tempfile.TemporaryDirectory() as folder:
        of_command = min(command(folder) for _ in range(REPEATS))
    call, _ = best(system.run)
    stepping = min(system.run().seconds for _ in range(REPEATS))
    lines = [("the command, steps", of_command * 1e3, "ms"), ("aso_ftc, steps", stepping * 1e3, "ms")]
    lines += [("aso_ftc, the whole call", call * 1e3, "ms")]
    try:
        lines.append(("FMPy's loop, steps", min(fmpy_loop() for _ in range(3)) * 1e3, "ms"))
    except ImportError:
        print("FMPy is not installed")
    short = lambda: [system.run(stop_time=STEP) for _ in range(200)]
    lines.append(("start of a run of one step", best(short)[0] / 200 * 1e3, "ms"))
    (one, of_one), (two, of_two) = (max(threads(system, count) for _ in range(3)) for count in (1, 2))
    lines += [("one thread, runs of 20 s", one, "per s"), ("two threads", two, "per s")]
    lines.append(("two threads against one", two / one, ""))
    lines += [("processor time of a run, one thread", of_one, "ms"), ("two threads", of_two, "ms")]
    short()
    before, files = resident(), len(os.listdir("/proc/self/fd"))
    start = time.perf_counter()
    for k in range(10_000):
        system.run(stop_time=2 * STEP, start_values={"plant.F_c": 20.0 + k % 7})
    lines.append(("10,000 short runs", time.perf_counter() - start, "s"))
    lines.append(("growth of memory over them", 100 * (resident() / before - 1), "%"))
    lines.append(("files left open", len(os.listdir("/proc/self/fd")) - files, ""))
    for name, value, unit in lines:
        print(f"{name:36} {value:10.3f} {unit}")


if __name__ == "__main__":
    main()
