"""Instances and their process: second runs, many instances, loading, unloading, side effects."""

import _ctypes
import ctypes
import json
import locale
import os
import signal
import subprocess
from concurrent.futures import ThreadPoolExecutor
from math import nan
from pathlib import Path

import pytest

from c_abi import ERROR, FATAL, STANDARD_FUNCTIONS, Fmu, Instance
from excitation import START, begun, drive, serialized

HERE = Path(__file__).parent
MISHAPS = [
    "nothing",
    "values set",
    "initialization mode",
    "a run",
    "the end",
    "an error",
    "a waiting slope",
]
INSTANCES, ROUNDS, STEPS = 200, 5, 12


def happen(instance, what):
    """Brings a new instance into the state in which it will be reset."""
    name = instance.fmu.names(causality="parameter", variability="fixed", type="Real")[0]
    if what == "values set":
        instance.set({name: 7.0})
    if what == "initialization mode":
        instance.enter({name: 7.0})
    if what == "a run":
        instance.start(START[instance.fmu.identifier], stop=9.0)
        drive(instance, 0, 90)
    if what in ("the end", "an error", "a waiting slope"):
        instance.start()
    if what == "the end":
        instance.must("Terminate")
    if what == "an error":
        assert instance.call("DoStep", nan, nan, 1) == ERROR
    if what == "a waiting slope":
        instance.set_slopes(**{instance.fmu.names(causality="input")[0]: 9.0})


@pytest.mark.parametrize("before", MISHAPS)
def test_a_run_after_a_reset_has_the_same_bits_as_the_first(fmu, before):
    with begun(fmu, 0) as fresh, Instance(fmu) as instance:
        blank = serialized(instance)
        expected = drive(fresh, 0, 200)
        happen(instance, before)
        instance.must("Reset")
        assert serialized(instance) == blank
        instance.start(START[fmu.identifier])
        assert drive(instance, 0, 200) == expected


def test_two_hundred_instances_in_threads_give_the_results_of_each_alone(fmu):
    alone = []
    for k in range(INSTANCES):
        with begun(fmu, 0) as instance:
            alone.append(drive(instance, 0, ROUNDS * STEPS, shift=0.01 * k))
    together = [[] for _ in range(INSTANCES)]
    with ThreadPoolExecutor(8) as pool:
        begin = lambda k: Instance(fmu, name=b"%d" % k).start(START[fmu.identifier])
        instances = list(pool.map(begin, range(INSTANCES)))
        for turn in range(ROUNDS):
            advance = lambda k: drive(instances[k], turn * STEPS, STEPS, shift=0.01 * k)
            order = sorted(range(INSTANCES), key=lambda k: (k * 7919 + turn) % INSTANCES)
            for k, rows in zip(order, pool.map(advance, order)):
                together[k] += rows
        list(pool.map(Instance.free, instances))
    assert together == alone


def in_own_process(python, function, *arguments):
    """The output of a function of this module that is called in a process of its own."""
    code = f"import sys, test_abi_process as t; t.{function}(*sys.argv[1:])"
    return python("-c", code, *arguments, cwd=HERE)


def load_and_unload(folder):
    """Prints the results of twelve rounds of loading, running and unloading."""
    results = []
    for turn in range(12):
        fmu = Fmu(folder)

        def work(_):
            with begun(fmu, 60) as instance:
                return instance.outputs()

        if turn % 2:
            with ThreadPoolExecutor(2) as pool:
                results += list(pool.map(work, range(2)))
        else:
            results.append(work(0))
        Instance(fmu, guid=b"wrong")
        _ctypes.dlclose(fmu.library._handle)
    print(json.dumps(results))


def test_libraries_can_be_loaded_and_unloaded_repeatedly(fmu, python):
    done = in_own_process(python, "load_and_unload", fmu.folder)
    assert done.returncode == 0, done.stderr
    results = json.loads(done.stdout)
    with begun(fmu, 60) as instance:
        assert results == [instance.outputs()] * 18


def err_and_succeed(folder):
    """Makes many valid and invalid calls, and prints nothing."""
    fmu = Fmu(folder)
    for log in (True, False):
        Instance(fmu, guid=b"%s%n", log=log)
        Instance(fmu, resources="file:///nowhere", log=log).free()
        with begun(fmu, 30, log=log) as instance:
            instance.must("SetDebugLogging", 1, 0, None)
            serialized(instance)
            name = fmu.names(causality="input", type="Real")[0]
            instance.set_one(name, nan)
            instance.call("DeSerializeFMUstate", b"x", 1, ctypes.byref(ctypes.c_void_p()))
            instance.must("Reset")
            instance.start()
            instance.set_one(name, 1e308)
            instance.call("DoStep", 0.0, 0.1, 1)
            instance.call("CancelStep")


def test_nothing_is_printed(fmu, python):
    done = in_own_process(python, "err_and_succeed", fmu.folder)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def panic_in_a_step(folder):
    """Prints status and message of panics in two threads, and the results of another instance."""
    fmu = Fmu(folder)

    def panic(_):
        with Instance(fmu) as instance:
            instance.start({"panics": 1})
            status = instance.call("DoStep", 0.0, 0.5, 1)
            return status, instance.last_message(), len(instance.messages)

    with Instance(fmu) as calm, ThreadPoolExecutor(2) as pool:
        calm.start({"u": 2.5})
        outcomes = list(pool.map(panic, range(20)))
        calm.step(0.0, 0.5)
        print(json.dumps([outcomes, calm.get("y"), calm.get("steps")]))
    _ctypes.dlclose(fmu.library._handle)


def test_a_panic_is_one_message_with_file_and_line_and_nothing_on_stderr(hostile, python, root):
    done = in_own_process(python, "panic_in_a_step", hostile.folder)
    assert (done.returncode, done.stderr) == (0, "")
    outcomes, y, steps = json.loads(done.stdout)
    assert (y, steps) == ([5.0], [1])
    source = (root / "tests/models/hostile-names/src/model.rs").read_text(encoding="utf-8")
    lines = [k for k, line in enumerate(source.splitlines(), 1) if "assert!(!self.panics" in line]
    assert len(lines) == 1
    for status, message, count in outcomes:
        assert (status, count) == (FATAL, 1)
        assert message.startswith("fmi2DoStep: ") and f"model.rs:{lines[0]}:" in message
        assert "as it was told" in message


def test_a_library_exports_the_same_functions_whatever_its_module_defines(hostile, plant):
    symbols = [
        {line.split()[-1] for line in listed.splitlines()}
        for fmu in (hostile, plant)
        for listed in [
            subprocess.run(
                ["nm", "--dynamic", "--defined-only", "--extern-only", fmu.path],
                capture_output=True,
                text=True,
                check=True,
            ).stdout
        ]
    ]
    assert symbols[0] == symbols[1]
    assert symbols[0] == STANDARD_FUNCTIONS


def settings_of_the_process():
    """The settings of the process that an FMU must not change."""
    libm = ctypes.CDLL("libm.so.6")
    mask = os.umask(0)
    os.umask(mask)
    handlers = [str(signal.getsignal(number)) for number in signal.valid_signals()]
    blocked = sorted(map(int, signal.pthread_sigmask(signal.SIG_BLOCK, [])))
    status = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    caught = [line for line in status if line.startswith(("SigIgn", "SigCgt", "Threads"))]
    return {
        "locale": locale.setlocale(locale.LC_ALL),
        "folder": os.getcwd(),
        "umask": mask,
        "environment": dict(os.environ),
        "rounding": libm.fegetround(),
        "exceptions": libm.fegetexcept(),
        "handlers": handlers,
        "blocked": blocked,
        "caught": caught,
        "files": sorted(os.listdir(".")),
        "open": len(os.listdir("/proc/self/fd")),
    }


def leave_the_process_alone(folder, place):
    """Prints the settings that an FMU has changed."""
    locale.setlocale(locale.LC_ALL, "C.UTF-8")
    os.chdir(place)
    fmu = Fmu(folder)
    before = settings_of_the_process()
    err_and_succeed(folder)
    _ctypes.dlclose(fmu.library._handle)
    after = settings_of_the_process()
    print([(key, before[key], after[key]) for key in before if before[key] != after[key]])


def test_locale_folder_signals_and_rounding_are_unchanged(fmu, python, tmp_path):
    done = in_own_process(python, "leave_the_process_alone", fmu.folder, tmp_path)
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "[]", "")


def test_instances_of_one_library_do_not_affect_each_other(fmu):
    with begun(fmu, 0) as calm, begun(fmu, 0) as wild, begun(fmu, 0) as alone:
        for k in range(60):
            if k == 20:
                assert wild.call("DoStep", -1.0, 1.0, 1) == ERROR
                wild.must("Reset")
            if k == 40:
                wild.free()
            assert drive(calm, k, 1) == drive(alone, k, 1)
