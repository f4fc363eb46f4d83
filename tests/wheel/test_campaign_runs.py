"""Runs of campaigns on Dask: the same rows however they are done, and whatever is killed."""

import contextlib
import json
import logging
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import aso_ftc as af
import numpy as np
import pyarrow.parquet as parquet
import pytest
from aso_ftc.campaign._command import main
from distributed import Client, LocalCluster

ROOT = Path(__file__).resolve().parents[2]

CAMPAIGN = """
system = "paper"
seed = 5
runs-per-task = 4

[experiment]
stop-time = {stop}

[design]
method = "latin-hypercube"
runs = {runs}

[parameters]
"plant.F_c" = {{ relative = 0.2 }}
"noise.deviation" = {{ from = 1e-6, to = 1e-4, logarithmic = true }}

[disturbances.noise]
connection = ["controller.x_p", "controller.theta"]
noise = {{ deviation = 0.0 }}

[measures]
peak = "max(abs(plant.x_p))"
estimate = "rms(plant.f_fric - controller.f_hat)"

[limits]
peak = {{ below = 0.101 }}
"""


@pytest.fixture
def campaign(tmp_path):
    """Writes a campaign file; returns its path."""

    def write(runs=24, stop=0.3, text=CAMPAIGN, name="small.toml"):
        path = tmp_path / name
        path.write_text(text.format(runs=runs, stop=stop), encoding="utf-8")
        return path

    return write


def command(*words, **options):
    """Starts the command; returns the process."""
    line = [sys.executable, "-I", "-m", "aso_ftc", "campaign", *map(str, words)]
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def done(*words, **options):
    """Runs the command; returns exit status, output and messages."""
    process = command(*words, **options)
    out, messages = process.communicate(timeout=180)
    return process.returncode, out, messages


def rows(folder):
    """The rows of a campaign without the wall-clock times, as bytes of each column."""
    table = parquet.read_table(folder / "runs").drop_columns(["seconds"]).sort_by("run").combine_chunks()
    return {
        name: table[name].to_numpy().tobytes() if table[name].type == "double" else table[name].to_pylist()
        for name in table.column_names
    }


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """The rows of the campaign, each computed by a run of its own in this process."""
    folder = tmp_path_factory.mktemp("expected")
    file = folder / "small.toml"
    file.write_text(CAMPAIGN.format(runs=24, stop=0.3), encoding="utf-8")
    campaign = af.campaign.Campaign.from_toml(file)
    measures = []
    for run in range(len(campaign)):
        new = campaign.changes(run)
        results = af.paper().run(
            start_values=new["start_values"], faults=new["faults"], stop_time=0.3, record_every="step"
        )
        error = results["plant.f_fric"] - results["controller.f_hat"]
        measures.append((np.max(np.abs(results["plant.x_p"])), np.sqrt(np.mean(np.square(error)))))
    return {
        name: np.array(column).tobytes()
        for name, column in zip(("peak", "estimate"), zip(*measures, strict=True), strict=True)
    }


@pytest.mark.parametrize("workers", [1, 2])
def test_rows_are_those_of_single_runs_bit_for_bit_for_any_number_of_workers(
    campaign, tmp_path, expected, workers
):
    status, out, messages = done(campaign(), "--out", tmp_path / "out", "--workers", workers)
    assert (status, messages) == (0, "")
    table = rows(tmp_path / "out")
    assert {name: table[name] for name in expected} == expected
    assert table["run"] == list(range(24))
    assert "24 runs" in out


def free_port():
    """A port that is free now, and below those that the system gives to others."""
    with socket.socket() as listener:
        while True:
            with contextlib.suppress(OSError):
                listener.bind(("127.0.0.1", random.randrange(20_000, 32_000)))
                return listener.getsockname()[1]


class Cluster:
    """A scheduler and workers, each a process of its own, as on several machines."""

    def __init__(self, folder):
        self.folder, self.address = folder, f"tcp://127.0.0.1:{free_port()}"
        self.processes = {}

    def start(self, name, *words):
        line = [sys.executable, "-I", "-m", *words]
        log = open(self.folder / f"{name}.log", "ab")
        with log:
            self.processes[name] = subprocess.Popen(line, stdout=log, stderr=log, start_new_session=True)

    def scheduler(self):
        port = self.address.rpartition(":")[2]
        self.start(
            "scheduler",
            "distributed.cli.dask_scheduler",
            "--host",
            "127.0.0.1",
            "--port",
            port,
            "--no-dashboard",
        )

    def worker(self, name):
        place = self.folder / name
        place.mkdir(exist_ok=True)
        words = ["--nthreads", "1", "--local-directory", place, "--no-dashboard", "--death-timeout", "60"]
        self.start(name, "distributed.cli.dask_worker", self.address, *map(str, words))

    def kill(self, name):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.processes[name].pid, signal.SIGKILL)
        self.processes.pop(name).wait()


@pytest.fixture
def cluster(tmp_path):
    """A scheduler and two workers with folders of their own."""
    cluster = Cluster(tmp_path / "cluster")
    cluster.folder.mkdir()
    cluster.scheduler()
    cluster.worker("one")
    cluster.worker("two")
    yield cluster
    for name in list(cluster.processes):
        cluster.kill(name)


def parts(folder):
    """The number of parts that are written."""
    return len(list((folder / "runs").glob("part-*.parquet")))


def wait_for(condition, limit=90.0):
    """Waits until a condition holds."""
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, "nothing happens"
        time.sleep(0.02)


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no groups of processes here")
def test_ctrl_c_on_a_terminal_ends_in_one_sentence(campaign, tmp_path):
    folder = tmp_path / "out"
    process = command(campaign(runs=2000, stop=2.0), "--out", folder, "--workers", 2, start_new_session=True)
    wait_for(lambda: parts(folder) >= 1 or process.poll() is not None)
    # A terminal sends the signal to the workers, too.
    os.killpg(process.pid, signal.SIGINT)
    _, messages = process.communicate(timeout=60)
    assert messages == "error: interrupted; the same command goes on where it stopped\n"
    assert process.returncode == 130


# Sends Ctrl-C while a task is half made, and while it is released.
INTERRUPTED = """
import signal, sys
import distributed
from aso_ftc.campaign._command import main

if __name__ == "__main__":
    moment, future = sys.argv.pop(1), distributed.Future
    method = getattr(future, moment)

    def interrupted(self, *words, **options):
        if str((*words, getattr(self, "key", ""))[0]).startswith("aso-ftc-"):
            setattr(future, moment, method)
            signal.raise_signal(signal.SIGINT)
        return method(self, *words, **options)

    setattr(future, moment, interrupted)
    sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize("moment", ["__init__", "release"])
def test_ctrl_c_within_a_call_of_dask_ends_in_one_sentence(campaign, tmp_path, moment):
    program = tmp_path / "interrupted.py"
    program.write_text(INTERRUPTED, encoding="utf-8")
    line = [sys.executable, "-I", program, moment, campaign(), "--out", tmp_path / "out", "--workers", "1"]
    process = subprocess.run(line, capture_output=True, text=True, timeout=120)
    assert process.stderr == "error: interrupted; the same command goes on where it stopped\n"
    assert process.returncode == 130


def test_rows_stay_the_same_if_worker_client_and_scheduler_are_killed(campaign, tmp_path, cluster):
    file, folder = campaign(runs=120, stop=2.0), tmp_path / "out"
    words = (file, "--out", folder, "--scheduler", cluster.address)
    process = command(*words, start_new_session=True)
    wait_for(lambda: parts(folder) >= 2 or process.poll() is not None)
    cluster.kill("one")
    cluster.worker("three")
    before = parts(folder)
    wait_for(lambda: parts(folder) > before + 1 or process.poll() is not None)
    assert process.poll() is None, process.communicate()
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    count = parts(folder)
    assert 0 < count < 30
    process = command(*words)
    wait_for(lambda: parts(folder) > count or process.poll() is not None)
    cluster.kill("scheduler")
    out, messages = process.communicate(timeout=120)
    assert process.returncode == 1, (out, messages)
    assert "the same command goes on" in messages
    assert parts(folder) < 30
    cluster.scheduler()
    cluster.worker("four")
    status, out, messages = done(*words)
    assert (status, messages) == (0, "")
    assert not list(folder.rglob("*.tmp"))
    status, out, messages = done(file, "--out", tmp_path / "undisturbed", "--workers", 2)
    assert (status, messages) == (0, "")
    assert rows(folder) == rows(tmp_path / "undisturbed")


# A worker that never finishes taking the job of a campaign.
STUCK = """
import asyncio, pathlib, sys
from distributed import Worker
from distributed.cli.dask_worker import main

add, place = Worker.plugin_add, sys.argv[2]

async def plugin_add(self, plugin, name=None, **words):
    if str(name).startswith("aso-ftc"):
        pathlib.Path(place, "asked").touch()
        await asyncio.sleep(600)
    return await add(self, plugin, name, **words)

Worker.plugin_add = plugin_add
sys.argv[2:] = ["--no-nanny", "--nthreads", "1", "--local-directory", place, "--no-dashboard"]
main()
"""


def test_a_worker_that_leaves_while_it_gets_the_campaign_does_not_end_it(campaign, tmp_path, cluster):
    place = tmp_path / "stuck"
    place.mkdir()
    (place / "worker.py").write_text(STUCK, encoding="utf-8")
    line = [sys.executable, "-I", place / "worker.py", cluster.address, place]
    with Client(cluster.address, timeout=60) as client:
        client.wait_for_workers(2, timeout=60)
        with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as stuck:
            client.wait_for_workers(3, timeout=60)
            process = command(campaign(runs=8), "--out", tmp_path / "out", "--scheduler", cluster.address)
            wait_for(lambda: (place / "asked").exists() or process.poll() is not None)
            stuck.kill()
    out, messages = process.communicate(timeout=120)
    assert (process.returncode, messages) == (0, ""), out
    assert rows(tmp_path / "out")["run"] == list(range(8))


def test_rows_stay_the_same_if_an_adaptive_cluster_starts_empty_and_shrinks(campaign, tmp_path):
    file, folder = campaign(runs=120, stop=10.0), tmp_path / "out"
    adaptive = {"minimum": 0, "interval": "100ms", "wait_count": 1}
    with LocalCluster(
        n_workers=0, threads_per_worker=1, dashboard_address=":0", local_directory=tmp_path, silence_logs=logging.CRITICAL
    ) as cluster:
        workers = cluster.scheduler.workers
        cluster.adapt(maximum=2, **adaptive)
        process = command(file, "--out", folder, "--scheduler", cluster.scheduler_address)
        wait_for(lambda: (len(workers) > 1 and parts(folder) > 1) or process.poll() is not None)
        cluster.adapt(maximum=1, **adaptive)
        wait_for(lambda: len(workers) == 1 or process.poll() is not None)
        assert process.poll() is None and parts(folder) < 30, process.communicate()
        out, messages = process.communicate(timeout=180)
        assert (process.returncode, messages) == (0, ""), out
    status, out, messages = done(file, "--out", tmp_path / "undisturbed", "--workers", 2)
    assert (status, messages) == (0, "")
    assert rows(folder) == rows(tmp_path / "undisturbed")


@pytest.mark.parametrize(
    "left", [[".plan.parquet.7.tmp"], ["plan.parquet", ".system.toml.7.tmp"], ["plan.parquet", "system.toml", ".manifest.json.7.tmp"]]
)
def test_a_campaign_that_was_killed_while_its_folder_was_made_goes_on(campaign, tmp_path, left):
    folder = tmp_path / "out"
    folder.mkdir()
    for name in left:
        (folder / name).write_bytes(b"cut")
    status, _, messages = done(campaign(runs=4), "--out", folder, "--workers", 1)
    assert (status, messages) == (0, "")
    assert rows(folder)["run"] == list(range(4)) and not list(folder.glob(".*"))
    assert parquet.read_table(folder / "plan.parquet").num_rows == 4


WAITING = """
import pathlib, time

def measure(results, values):
    while not pathlib.Path({path!r}).exists():
        time.sleep(0.01)
    return 2.0 * values["plant.F_c"]
"""


def test_of_two_commands_on_one_folder_the_second_is_refused_until_the_first_one_ends(campaign, tmp_path):
    (tmp_path / "waiting.py").write_text(WAITING.format(path=str(tmp_path / "go")), encoding="utf-8")
    text = (
        'system = "paper"\nruns-per-task = 2\n[experiment]\nstop-time = 0.01\n[parameters]\n'
        '"plant.F_c" = [20.0, 21.0, 22.0, 23.0]\n[measures]\ntwice = {{ python = "waiting.py:measure" }}\n'
    )
    file, folder = campaign(text=text), tmp_path / "out"
    words = (file, "--out", folder, "--workers", 1)

    def state():
        return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}

    first = command(*words, start_new_session=True)
    try:
        wait_for(lambda: (folder / "manifest.json").exists() or first.poll() is not None)
        before = state()
        status, out, messages = done(*words)
        assert (status, out, messages.count("\n")) == (2, "", 1)
        assert f"another process runs a campaign in the folder {folder}: wait for its end" in messages
        with pytest.raises(af.ConfigurationError, match="another process runs a campaign"):
            af.campaign.Campaign.from_toml(file).run(folder, workers=1, progress=False)
        assert first.poll() is None and state() == before
        # Its workers remain; a lock that they had inherited would, too.
        first.kill()
        first.wait()
        (tmp_path / "go").touch()
        status, out, messages = done(*words)
        assert (status, messages) == (0, "")
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(first.pid, signal.SIGKILL)
        first.communicate()
    table = rows(folder)
    assert table["run"] == list(range(4))
    assert table["twice"] == np.array([40.0, 42.0, 44.0, 46.0]).tobytes()


@pytest.fixture(scope="module")
def eight_runs(tmp_path_factory):
    """The folder of the campaign with 8 runs, which are done."""
    folder = tmp_path_factory.mktemp("eight")
    (folder / "small.toml").write_text(CAMPAIGN.format(runs=8, stop=0.3), encoding="utf-8")
    assert done(folder / "small.toml", "--out", folder / "out", "--workers", 1)[0] == 0
    return folder / "out"


@pytest.fixture
def finished(campaign, eight_runs, tmp_path):
    """The file of a campaign, and a folder of its own in which it is done."""
    return campaign(runs=8), Path(shutil.copytree(eight_runs, tmp_path / "out"))


def test_a_campaign_that_is_done_is_not_done_again(finished):
    file, folder = finished
    times = {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}
    assert done(file, "--out", folder, "--workers", 1)[0] == 0
    assert times == {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}


def test_the_command_reads_no_table_of_all_columns(finished, monkeypatch):
    file, folder = finished
    monkeypatch.setattr(af.campaign.Outcome, "table", None)
    assert main([str(file), "--out", str(folder)]) == 0


def test_a_folder_with_another_campaign_or_with_other_files_is_left_alone(campaign, finished, tmp_path):
    file, folder = finished
    status, _, messages = done(campaign(runs=12), "--out", folder)
    assert status == 2
    assert "another campaign" in messages and messages.count("\n") == 1
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine", encoding="utf-8")
    status, _, messages = done(file, "--out", tmp_path / "mine")
    assert status == 2
    assert "not empty" in messages


def test_a_run_is_repeated_by_the_command_run(finished, tmp_path):
    _, folder = finished
    outcome = af.campaign.load(folder)
    status, text, _ = done(folder, "--show", 4)
    assert status == 0
    (tmp_path / "run-4.toml").write_text(text, encoding="utf-8")
    words = [
        str(af.command()),
        "run",
        tmp_path / "run-4.toml",
        "--out",
        tmp_path / "again",
        "--record-every",
        "step",
    ]
    subprocess.run([*map(str, words), "--format", "parquet"], check=True, capture_output=True)
    again = parquet.read_table(tmp_path / "again" / "results.parquet")
    assert np.max(np.abs(again["plant.x_p"].to_numpy())) == outcome.table["peak"][4]


FAILING = """
system = "paper"
time-limit = 2.0
runs-per-task = 3
[experiment]
stop-time = 0.02
[parameters]
"plant.F_c" = [20.0, -1.0, 30.0]
"algorithm.step" = [0.001, 1e-8]
[measures]
peak = "max(abs(plant.x_p))"
[keep]
runs = [0]
record = ["plant.x_p"]
"""


def test_runs_that_fail_or_last_too_long_have_their_reason_and_the_others_go_on(campaign, tmp_path):
    folder = tmp_path / "out"
    status, out, messages = done(campaign(text=FAILING), "--out", folder, "--workers", 2)
    assert status == 0, messages
    table = af.campaign.load(folder).table
    assert list(table["status"]) == ["ok", "time limit", "failed", "failed", "ok", "time limit"]
    assert "F_c" in table["reason"][2]
    assert np.isnan(table["peak"][2])
    assert "4 of 6 runs did not finish" in out
    signals = parquet.read_table(folder / "signals" / "run-000000000.parquet")
    assert signals.column_names == ["time", "plant.x_p"]
    assert np.max(np.abs(signals["plant.x_p"].to_numpy())) == table["peak"][0]


MISBEHAVING = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Slave" guid="as it should">
<CoSimulation modelIdentifier="slave" canHandleVariableCommunicationStepSize="true"/>
<ModelVariables>
<ScalarVariable name="y" valueReference="1" causality="output" initial="exact"><Real start="0"/></ScalarVariable>
<ScalarVariable name="behaviour" valueReference="2" causality="parameter" variability="fixed">
<String start="as it should"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="1" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>
"""


@pytest.fixture
def misbehaving(tmp_path):
    """Writes an FMU that does what its parameter `behaviour` says; returns its path."""
    names = ("deeds", "files", "life", "process", "steps", "values")
    sources = [str(ROOT / "tests" / "c" / f"{name}.c") for name in names]
    words = ["cc", "-std=c11", "-shared", "-fPIC", "-o", str(tmp_path / "slave.so"), *sources, "-lm"]
    subprocess.run(words, check=True)
    with zipfile.ZipFile(tmp_path / "Slave.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", MISBEHAVING)
        archive.write(tmp_path / "slave.so", "binaries/linux64/slave.so")
    return tmp_path / "Slave.fmu"


def test_a_crash_in_this_process_leaves_a_file_that_names_fmu_function_and_time(misbehaving, tmp_path):
    text = (
        "import aso_ftc as af\n"
        f"af.System({{'fmus': {{'slave': {str(misbehaving)!r}}}}}).run(stop_time=1.0, step=0.1,"
        " start_values={'slave.behaviour': 'crash in fmi2DoStep'})\n"
    )
    ended = subprocess.run([sys.executable, "-I", "-c", text], cwd=tmp_path, capture_output=True, text=True)
    assert ended.returncode == -signal.SIGSEGV, ended.stderr
    (left,) = tmp_path.glob("aso-ftc-crash-*.txt")
    said = left.read_text(encoding="utf-8")
    assert said in ended.stderr
    assert "slave at t = 0.5 s: fmi2DoStep crashed with signal 11 (SIGSEGV" in said and "isolate=True" in said


def test_isolated_runs_that_crash_or_hang_are_recorded_by_their_kind(campaign, misbehaving, tmp_path):
    (tmp_path / "system.toml").write_text('[fmus]\nslave = "Slave.fmu"\n', encoding="utf-8")
    text = (
        'system = "system.toml"\nisolate = true\ntime-limit = 2.0\nruns-per-task = 2\n'
        "[experiment]\nstop-time = 1.0\n[algorithm]\nstep = 0.1\n[parameters]\n"
        '"slave.behaviour" = ["as it should", "crash in fmi2DoStep", "abort in fmi2DoStep", "hang in fmi2DoStep"]\n'
        '[measures]\nend = "last(time)"\n'
    )
    folder = tmp_path / "out"
    status, _, messages = done(campaign(text=text), "--out", folder, "--workers", 1)
    assert status == 0, messages
    table = af.campaign.load(folder).table
    assert list(table["status"]) == ["ok", "crashed", "crashed", "time limit"]
    assert table["end"][0] == 1.0
    assert all("fmi2DoStep" in reason for reason in table["reason"][1:])


KILLER = """
import os, signal

def measure(results, values):
    if values["plant.F_c"] == 21.0:
        os.kill(os.getpid(), signal.SIGKILL)
    return results["plant.x_p"][-1]
"""


def test_a_run_that_kills_its_worker_is_recorded_and_the_others_go_on(campaign, tmp_path):
    (tmp_path / "killer.py").write_text(KILLER, encoding="utf-8")
    text = (
        'system = "paper"\nruns-per-task = 3\n[experiment]\nstop-time = 0.01\n[parameters]\n'
        '"plant.F_c" = [20.0, 21.0, 22.0]\n[measures]\nlast = {{ python = "killer.py:measure" }}\n'
    )
    folder = tmp_path / "out"
    # A new worker may take longer than a campaign waits on a loaded machine; the same command then goes on.
    for _ in range(3):
        status, _, messages = done(campaign(text=text), "--out", folder, "--workers", 1)
        if "no workers" not in messages:
            break
    assert status == 0, messages
    table = af.campaign.load(folder).table
    assert list(table["status"]) == ["ok", "worker lost", "ok"]
    assert "isolate" in table["reason"][1]


def test_a_random_campaign_ends_when_its_bound_is_tight_whatever_the_number_of_workers(campaign, tmp_path):
    text = (
        'system = "paper"\nseed = 2\nruns-per-task = 10\n[experiment]\nstop-time = 0.01\n'
        '[design]\nmethod = "random"\nruns = 4000\n[parameters]\n"plant.x_p_0" = {{ from = 0.0, to = 1.0 }}\n'
        '[measures]\nstart = "first(plant.x_p)"\n[limits]\nstart = {{ below = 0.9 }}\n'
        '[stop]\nlimit = "start"\nwidth = 0.1\n'
    )
    file = campaign(text=text)
    ends = []
    for workers in (1, 2):
        folder = tmp_path / f"out-{workers}"
        assert done(file, "--out", folder, "--workers", workers)[0] == 0
        outcome = af.campaign.load(folder)
        estimate = outcome.failure_probability("start")
        assert estimate.upper - estimate.lower <= 0.1
        assert estimate.lower < 0.1 < estimate.upper
        ends.append(rows(folder))
    assert ends[0] == ends[1]
    assert 50 < len(ends[0]["run"]) < 400


def test_a_scheduler_that_does_not_answer_and_one_without_workers_are_named(campaign, tmp_path):
    address = f"tcp://127.0.0.1:{free_port()}"
    status, _, messages = done(campaign(), "--out", tmp_path / "out", "--scheduler", address)
    assert status == 1
    assert messages.startswith(f"error: no Dask scheduler answers at {address}")


def test_an_fmu_without_binaries_for_the_workers_is_named_before_the_first_run(tmp_path):
    path = tmp_path / "Other.fmu"
    with zipfile.ZipFile(af.fmus()["FrictionPendulum"]) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            new.writestr(
                name.replace("linux64", "win64").replace("x86_64-linux", "x86_64-windows"), old.read(name)
            )
    system = af.System().add("plant", path)
    with pytest.raises(af.Error) as caught:
        af.campaign.Campaign(system, measures={"m": "last(plant.x_p)"}).run(tmp_path / "out", workers=1)
    assert "linux" in str(caught.value) or "platform" in str(caught.value)
    assert not (tmp_path / "out").exists()


SSP = ROOT / "dist" / "InvertedPendulum.ssp"


@pytest.mark.skipif(not SSP.exists(), reason="pack --ssp makes it")
def test_a_campaign_on_an_ssd_takes_the_fmus_beside_it_to_its_workers(tmp_path):
    structure = tmp_path / "system" / "SystemStructure.ssd"
    with zipfile.ZipFile(SSP) as archive:
        archive.extractall(structure.parent)
    system = af.System.from_ssp(structure)
    expected, before = system.run(stop_time=0.1, record_every="step"), system.files()
    name = next(name for name in expected if name.endswith(".x_p"))
    campaign = af.campaign.Campaign(structure, experiment={"stop_time": 0.1}, measures={"last": f"last({name})"})
    table = campaign.run(tmp_path / "out", workers=1, progress=False).table
    assert list(table["last"]) == [expected[name][-1]]
    (fmu, *_) = sorted(structure.parent.rglob("*.fmu"))
    fmu.write_bytes(fmu.read_bytes() + b"\0")
    assert set(before) == {str(structure)} and system.files() != before


def test_a_full_disk_ends_the_campaign_with_one_sentence(finished):
    file, folder = finished
    shutil.rmtree(folder / "runs")
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    manifest["complete"] = False
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    # A file in the place of the folder of parts: writing fails as on a full disk, also for root.
    (folder / "runs").write_text("", encoding="utf-8")
    status, _, messages = done(file, "--out", folder, "--workers", 1)
    assert status == 1
    assert messages.startswith("error: cannot write ") and messages.count("\n") == 1


def test_the_command_passes_campaigns_to_python(campaign, tmp_path):
    words = [str(af.command()), "campaign", str(campaign()), "--check"]
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    process = subprocess.run(
        words, capture_output=True, text=True, env={**os.environ, "PATH": path}, cwd=tmp_path
    )
    assert (process.returncode, process.stdout, process.stderr) == (0, "small: 24 runs\n", "")
    nowhere = {**os.environ, "ASO_FTC_PYTHON": "/nowhere/python"}
    process = subprocess.run(words, capture_output=True, text=True, env=nowhere)
    assert process.returncode == 2
    assert process.stderr.startswith("error: campaigns need Python, and /nowhere/python cannot be started")


def test_the_help_of_the_command_lists_the_options_of_the_package():
    def options(*words):
        text = subprocess.check_output([*words, "campaign", "--help"], text=True)
        return set(re.findall(r"--[a-z]+", text))

    assert options(str(af.command())) == options(sys.executable, "-m", "aso_ftc")


def test_the_claims_of_the_paper_have_the_values_of_the_command(campaign, tmp_path):
    file = campaign(text='system = "paper"\nclaims = true\n')
    assert done(file, "--out", tmp_path / "out", "--workers", 1)[0] == 0
    row = af.campaign.load(tmp_path / "out").table.iloc[0]
    # The table of docs/how-to/reproduce.md, which the command checks.
    shown = {"cart limit cycle": 0.1647, "pendulum limit cycle": 0.112, "cart residual": 0.962e-3}
    shown |= {"pendulum residual": 1.75e-3, "rms of f_fric - f_hat": 0.28}
    for name, value in shown.items():
        assert row[name] == pytest.approx(value, rel=2e-2), name


def test_a_script_that_its_workers_would_run_again_gets_one_error(tmp_path):
    script = tmp_path / "script.py"
    text = 'import aso_ftc as af\naf.campaign.Campaign("paper", measures={"m": "max(plant.x_p)"}).run("out", workers=1)\n'
    script.write_text(text, encoding="utf-8")
    process = subprocess.run([sys.executable, "-I", str(script)], cwd=tmp_path, capture_output=True, text=True, timeout=180)
    assert process.returncode == 1 and process.stderr.count("Traceback") == 1
    assert process.stderr.endswith('the local workers do not start; a script runs campaigns below `if __name__ == "__main__":`\n')


FUNCTIONS = """
system = "paper"
[experiment]
stop-time = 0.02
[parameters]
"plant.F_c" = {{ from = 20.0, to = 30.0, steps = 12 }}
[measures]
last = {{ python = "last.py:last" }}
"""


def test_a_function_that_fails_in_every_run_ends_the_campaign_and_the_folder_takes_the_corrected_one(campaign, tmp_path):
    words, file = (campaign(text=FUNCTIONS), "--out", tmp_path / "out", "--workers", 1), tmp_path / "last.py"
    for text, message in {
        "def last(results):\n    return 1.0\n": "measures.last: expected a function of two arguments",
        "def last(results, values):\n    return result['plant.x_p'][-1]\n": (
            "measures.last: NameError: name 'result' is not defined, in each of the first 10 runs: "
        ),
    }.items():
        file.write_text(text, encoding="utf-8")
        status, out, messages = done(*words)
        assert (status, out, messages.count("\n")) == (1, "", 1)
        assert messages.startswith("error: ") and message in messages
    body = "    if values['plant.F_c'] > 29.5:\n        raise IndexError('no row')\n    return results['plant.x_p'][-1]\n"
    file.write_text(f"def last(results, values):\n{body}", encoding="utf-8")
    status, out, messages = done(*words)
    assert status == 0 and "1 of 12 runs did not finish" in out
    assert messages.startswith("warning: 1 of 12 runs failed in a measure; run 11: measures.last: IndexError: no row (")


def test_functions_are_measures_and_a_changed_one_is_another_campaign(tmp_path):
    scale = 1e3

    def peak(results, values):
        return scale * np.max(np.abs(results["plant.x_p"])) + 0.0 * values["plant.F_c"]

    def campaign(function):
        return af.campaign.Campaign(
            af.paper(),
            experiment={"stop_time": 0.1},
            parameters={"plant.F_c": np.linspace(20.0, 30.0, 3)},
            measures={"peak": function, "last": {"python": lambda results, values: results["plant.x_p"][-1]}},
        )

    table = campaign(peak).run(tmp_path / "out", workers=np.int64(1), progress=False).table
    for row, friction in zip(table.itertuples(), np.linspace(20.0, 30.0, 3), strict=True):
        results = af.paper().run(stop_time=0.1, start_values={"plant.F_c": friction}, record_every="step")
        assert (row.peak, row.last) == (1e3 * np.abs(results["plant.x_p"]).max(), results["plant.x_p"][-1])
    with pytest.raises(af.ConfigurationError, match="another campaign .*measures"):
        campaign(lambda results, values: 1.0).run(tmp_path / "out", workers=1, progress=False)
