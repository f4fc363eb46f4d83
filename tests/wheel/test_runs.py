"""Runs of systems: the command is the reference."""

import copy
import gc
import logging
import os
import pickle
import signal
import threading
import time
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import aso_ftc as af
import numpy as np
import pytest

SSP = Path(__file__).resolve().parents[2] / "dist" / "InvertedPendulum.ssp"


def same(first, second):
    """Whether two results have the same columns, bit for bit."""
    return first.names == second.names and all(
        np.array_equal(first[name], second[name], equal_nan=first[name].dtype.kind == "f") for name in first
    )


def test_a_run_writes_the_bytes_of_the_command(paper, command, tmp_path):
    paper.start_values["plant.F_c"] = 20
    paper.add_fault("controller.x_p", "bias", value=0.01, start=0.1)
    file = tmp_path / "system.toml"
    file.write_text(paper.to_toml(), encoding="utf-8")
    command("run", file, "--out", tmp_path / "command")
    expected = (tmp_path / "command" / "results.csv").read_bytes()
    for name, system in [("built", paper), ("read", af.System.from_toml(file))]:
        system.run().to_csv(tmp_path / f"{name}.csv")
        assert (tmp_path / f"{name}.csv").read_bytes() == expected, name
    paper.run(file=tmp_path / "direct.csv")
    assert (tmp_path / "direct.csv").read_bytes() == expected


def test_the_arguments_of_a_run_do_what_the_options_of_the_command_do(paper, command, tmp_path):
    file = tmp_path / "system.toml"
    file.write_text(paper.to_toml(), encoding="utf-8")
    options = ["--set", "plant.M=3.5", "--stop-time", 0.15, "--step", 0.002, "--method", "jacobi"]
    options += ["--record", "plant.*", "--exclude", "*der*", "--record-every", "step"]
    command("run", file, "--out", tmp_path / "command", *options)
    results = paper.run(
        start_values={"plant.M": 3.5},
        stop_time=0.15,
        step=0.002,
        algorithm={"method": "jacobi"},
        record=["plant.*"],
        exclude=["*der*"],
        record_every="step",
    )
    results.to_csv(tmp_path / "own.csv")
    assert (tmp_path / "own.csv").read_bytes() == (tmp_path / "command" / "results.csv").read_bytes()
    # The system itself keeps its settings.
    assert "plant.M" not in paper.start_values and len(paper.run().time) == 21


def test_an_empty_list_of_a_run_clears_that_of_the_system(paper):
    plain = paper.run()
    paper.results["exclude"] = ["plant.*"]
    paper.algorithm["discrete"] = ["controller.u"]
    again = paper.run(exclude=[], algorithm={"discrete": []})
    assert same(again, plain) and again.settings == plain.settings
    assert "plant.x_p" not in paper.run()


def test_the_paper_is_the_experiment_of_the_command(command, tmp_path):
    packed = af.fmus()
    file = tmp_path / "system.toml"
    file.write_text(
        f"[fmus]\nplant = '{packed['FrictionPendulum']}'\ncontroller = '{packed['AsoController']}'\n",
        encoding="utf-8",
    )
    options = ["--stop-time", 5, "--step", 0.001, "--record-every", 0.01]
    command("run", file, *options, "--out", tmp_path)
    af.reproduce(stop_time=5.0).to_csv(tmp_path / "own.csv")
    assert (tmp_path / "own.csv").read_bytes() == (tmp_path / "results.csv").read_bytes()


def test_a_dict_a_text_and_calls_describe_the_same_system(paper):
    text = paper.to_toml()
    entries = paper.to_dict()
    for other in (af.System(text), af.System(entries), pickle.loads(pickle.dumps(paper)), paper.copy()):
        assert other.to_toml() == text
        assert same(other.run(), paper.run())


@pytest.mark.skipif(not SSP.exists(), reason="pack --ssp makes it")
def test_an_ssp_runs_as_by_the_command(command, tmp_path):
    command("run", SSP, "--stop-time", 0.2, "--out", tmp_path)
    system = af.System.from_ssp(SSP)
    for _ in range(2):
        system.run(stop_time=0.2).to_csv(tmp_path / "own.csv")
        assert (tmp_path / "own.csv").read_bytes() == (tmp_path / "results.csv").read_bytes()
    assert list(system.files()) == [str(SSP)]


def test_files_have_hashes_and_may_be_elsewhere(paper, tmp_path):
    packed = af.fmus()
    assert set(paper.files()) == {str(packed["FrictionPendulum"]), str(packed["AsoController"])}
    moved = {}
    for path, digest in paper.files().items():
        moved[path] = tmp_path / f"{digest}.fmu"
        moved[path].write_bytes(Path(path).read_bytes())
    other = paper.with_files(moved)
    assert sorted(other.files().values()) == sorted(paper.files().values())
    assert set(other.files()) == {str(path) for path in moved.values()}
    assert same(other.run(), paper.run())


def test_isolated_fmus_give_the_same_rows(paper):
    assert same(paper.run(isolate=True, stop_time=0.05), paper.run(stop_time=0.05))


def test_runs_in_threads_give_the_same_rows(paper):
    values = [20.0 + k for k in range(8)]

    def run(value):
        return paper.run(start_values={"plant.F_c": value})

    with ThreadPoolExecutor(4) as pool:
        threaded = list(pool.map(run, values))
    assert all(same(run(value), results) for value, results in zip(values, threaded))


def test_a_run_ends_at_its_time_limit_with_the_rows_up_to_it(paper):
    start = time.perf_counter()
    with pytest.raises(af.TimeLimitError) as caught:
        paper.run(stop_time=1e6, record_every=1.0, time_limit=0.1)
    assert 0.1 <= time.perf_counter() - start < 60.0
    error = caught.value
    assert isinstance(error, TimeoutError) and len(error.results) > 1
    assert error.results.end == "time limit" and error.time == error.results.end_time


def test_another_thread_cancels_a_run(paper):
    cancel = af.Cancel()
    threading.Timer(0.1, cancel.cancel).start()
    with pytest.raises(af.CancelledError):
        paper.run(stop_time=1e6, record_every=1.0, cancel=cancel)
    assert cancel.cancelled


@pytest.mark.parametrize("option", ["cancel", "time_limit"])
def test_a_run_that_is_complete_was_neither_cancelled_nor_ended_by_its_time_limit(option):
    cancel = af.Cancel()

    class Slow:
        outputs = ("y",)

        def step(self, t, dt, inputs):
            time.sleep(options.get("time_limit", 0) * 1.1)
            cancel.cancel()

    # Long enough for the start of the run on a busy machine.
    options = {"cancel": cancel} if option == "cancel" else {"time_limit": 3.0}
    results = af.System().add("slow", Slow()).run(stop_time=0.1, step=0.1, **options)
    assert (results.end, results.end_time) == ("stop time", 0.1)


def interrupting(paper):
    """Ctrl-C from another thread while a run is on its way; returns the seconds until the run has ended."""
    sent = []

    def interrupt():
        time.sleep(0.1)
        sent.append(time.perf_counter())
        signal.raise_signal(signal.SIGINT)

    thread = threading.Thread(target=interrupt)

    def started(part):
        if thread.ident is None:
            thread.start()

    with pytest.raises(KeyboardInterrupt):
        paper.run(stop_time=1e6, record_every=1.0, progress=started)
    seconds = time.perf_counter() - sent[0]
    thread.join()
    return seconds


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_ends_a_run_within_a_tenth_of_a_second(paper):
    # On a busy machine, the thread may wait for a processor longer than that: not each time.
    assert any(interrupting(paper) < 0.1 for _ in range(10))


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_ends_a_run_of_slow_steps_after_the_present_one():
    class Slow:
        outputs = ("y",)
        steps = 0

        def step(self, t, dt, inputs):
            self.steps += 1
            time.sleep(0.03)
            if self.steps == 3:
                signal.raise_signal(signal.SIGINT)

    slow = Slow()
    with pytest.raises(KeyboardInterrupt):
        af.System().add("slow", slow).run(stop_time=10.0, step=0.1)
    assert slow.steps <= 4


def test_progress_goes_from_zero_to_one(paper):
    fractions = []
    paper.run(stop_time=30.0, progress=fractions.append)
    assert fractions == sorted(fractions) and fractions[-1] == 1.0 and all(0.0 <= part <= 1.0 for part in fractions)

    def refuse(part):
        raise RuntimeError(f"at {part}")

    # At the end, or before it on a busy machine.
    with pytest.raises(RuntimeError, match="at "):
        paper.run(progress=refuse)


def test_warnings_go_to_logging_and_nothing_to_standard_output(paper, caplog, capfd):
    del paper.experiment["stop-time"]
    with caplog.at_level(logging.INFO, logger="aso_ftc"):
        af.System().add("plant", af.fmus()["FrictionPendulum"]).run(stop_time=0.01)
        fmu = af.fmus()["AsoController"]
        af.System({"fmus": {"a": str(fmu), "b": str(fmu)}}).run(stop_time=0.01)
    assert any("nothing is connected" in record.message for record in caplog.records)
    captured = capfd.readouterr()
    assert captured.out == "" and captured.err == ""


def resident():
    """Resident memory of this process in pages."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="Linux only")
def test_a_thousand_runs_leave_no_memory_and_no_files_open(paper):
    def runs(count):
        for k in range(count):
            paper.run(stop_time=0.002, start_values={"plant.F_c": 20.0 + k % 7})

    runs(300)
    pages, files = resident(), len(list(Path("/proc/self/fd").iterdir()))
    runs(1000)
    assert resident() <= 1.01 * pages
    assert len(list(Path("/proc/self/fd").iterdir())) == files


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_an_fmu_is_opened_once_and_closed_at_the_end(python, tmp_path):
    program = """
import os, aso_ftc as af
system = af.paper()
for _ in range(3):
    system.run(stop_time=0.01)
print(af._core.open_fmus(), len(os.listdir(os.environ["TMPDIR"])), flush=True)
af.clear()
print(af._core.open_fmus(), len(os.listdir(os.environ["TMPDIR"])), flush=True)
system.run(stop_time=0.01)
if os.fork() == 0:
    raise SystemExit  # a child must not remove the files of its parent
os.wait()
system.run(stop_time=0.01)
"""
    done = python(program, env={"TMPDIR": str(tmp_path)})
    assert done.stdout.split() == ["2", "2", "0", "0"], done.stderr
    assert done.returncode == 0 and done.stderr == ""
    assert list(tmp_path.iterdir()) == []


def test_a_changed_fmu_is_opened_again(tmp_path):
    packed, target = af.fmus(), tmp_path / "model.fmu"
    for name in ("FrictionPendulum", "AsoController"):
        target.write_bytes(packed[name].read_bytes())
        names = {variable.name for variable in af.System().add("m", target).variables()}
        assert f"m.{'F_c' if name == 'FrictionPendulum' else 'f_hat'}" in names


class Proportional:
    """A controller in Python: u = -gain y."""

    inputs = ("y",)
    outputs = {"u": 0.0, "on": False, "count": 0}

    def __init__(self, gain):
        self.gain, self.calls = gain, []

    def start(self, t, inputs):
        self.calls = [t]
        return {"u": -self.gain * inputs["y"]}

    def step(self, t, dt, inputs):
        self.calls.append(t + dt)
        return {"u": -self.gain * inputs["y"], "on": inputs["y"] > 0, "count": len(self.calls)}


def loop(slave):
    """The pendulum with a Python object in its loop."""
    system = af.System({"algorithm": {"step": 0.001}, "experiment": {"stop-time": 0.1}})
    system.add("plant", af.fmus()["FrictionPendulum"]).add("law", slave)
    return system.connect("plant.x_p", "law.y").connect("law.u", "plant.u")


def test_a_python_object_takes_part_in_the_loop():
    law = Proportional(2.0)
    results = loop(law).run()
    assert np.array_equal(results["law.u"], -2.0 * results["plant.x_p"])
    assert np.array_equal(results["law.on"][1:], results["plant.x_p"][1:] > 0)
    assert list(results["law.count"][[0, 1, -1]]) == [0, 2, 101]
    assert len(law.calls) == 101 and law.calls[-1] == pytest.approx(0.1)
    again = loop(copy.deepcopy(law)).run()
    assert same(results, again)


def test_a_signal_of_numpy_is_that_of_the_same_lists_in_every_run():
    points = [[0.0, 0.0], [0.05, 3.0], [0.1, -1.0]]
    system, other = (af.System({"experiment": {"stop-time": 0.1}}).add("p", af.fmus()["FrictionPendulum"]) for _ in range(2))
    system.add_signal("p.u", points=np.array(points))
    other.add_signal("p.u", points=points)
    assert same(system.run(), other.run()) and same(system.run(), other.run())


def test_an_object_that_knows_its_system_is_collected_with_it():
    class Source:
        outputs = ["y"]
        system: af.System

        def step(self, t, dt, inputs):
            return {"y": t}

    source = Source()
    source.system = af.System().add("source", source)
    source.system.run(stop_time=0.1, step=0.1)
    collected = weakref.ref(source)
    del source
    gc.collect()
    assert collected() is None


def test_an_equal_object_takes_the_place_of_the_one_before():
    class Equal(Proportional):
        def __eq__(self, other):
            return isinstance(other, Equal)

    first, second = Equal(2.0), Equal(2.0)
    system = loop(first)
    system.run()
    system.add("law", second, replace=True).run()
    assert len(second.calls) == len(first.calls) == 101


def test_start_values_of_numpy_have_the_types_of_python():
    class Scalars(Proportional):
        outputs = {"u": np.float32(0.0), "on": np.bool_(False), "count": np.int64(0)}

    results = loop(Scalars(2.0)).run()
    assert [results[f"law.{name}"].dtype.kind for name in Scalars.outputs] == ["f", "b", "i"]


@pytest.mark.parametrize("outputs", [["u", "u"], {"u": 0.0, "y": 0.0}])
def test_two_variables_of_a_python_object_with_one_name_are_refused(outputs):
    law = Proportional(2.0)
    law.outputs = outputs
    with pytest.raises(ValueError, match="law: two variables are called [uy], expected different names"):
        loop(law).run()


def test_an_object_is_stopped_once_also_if_its_run_fails_or_is_not_closed():
    class Stopped(Proportional):
        stops, fails = 0, False

        def step(self, t, dt, inputs):
            if self.fails and t > 0.05:
                raise ArithmeticError("no solution")
            return super().step(t, dt, inputs)

        def stop(self):
            self.stops += 1

    whole, failing, left = Stopped(1.0), Stopped(1.0), Stopped(1.0)
    failing.fails = True
    loop(whole).run()
    with pytest.raises(af.RunError, match="no solution") as caught:
        loop(failing).run()
    assert isinstance(caught.value.__cause__, ArithmeticError)
    with loop(left).simulation() as simulation:
        simulation.step()
    simulation = loop(left).simulation()
    simulation.step()
    del simulation
    assert [slave.stops for slave in (whole, failing, left)] == [1, 1, 2]


def test_a_run_whose_file_is_lost_at_its_end_leaves_all_rows_in_memory(tmp_path):
    file = tmp_path / "results.csv"

    class Remover(Proportional):
        def step(self, t, dt, inputs):
            if t > 0.0985:
                file.unlink()
            return super().step(t, dt, inputs)

    with pytest.raises(af.ResultsError, match=r"results\.csv") as caught:
        loop(Remover(2.0)).run(file=file)
    results = caught.value.results
    assert results.end == "failed" and np.array_equal(results["plant.x_p"], loop(Proportional(2.0)).run()["plant.x_p"])


def test_one_name_is_no_list_of_names():
    class Short(Proportional):
        inputs = "y"

    with pytest.raises(TypeError, match="inputs: expected names or a dict, found the text y"):
        loop(Short(2.0)).run()


def test_an_exception_of_a_python_object_is_the_cause_of_the_error():
    class Broken(Proportional):
        def step(self, t, dt, inputs):
            if t > 0.05:
                raise ArithmeticError("no solution")
            return super().step(t, dt, inputs)

    with pytest.raises(af.RunError, match="law at t = 0.05.* raised ArithmeticError: no solution") as caught:
        loop(Broken(1.0)).run()
    assert isinstance(caught.value.__cause__, ArithmeticError)
    assert caught.value.fmu == "law" and len(caught.value.results.time) > 50

    class Unknown(Proportional):
        def step(self, t, dt, inputs):
            return {"v": 1.0}

    with pytest.raises(af.RunError, match="no output v, expected one of u, on, count"):
        loop(Unknown(1.0)).run()


def test_an_output_that_is_no_number_is_named():
    class Text(Proportional):
        def step(self, t, dt, inputs):
            return {"u": "1.0"}

    with pytest.raises(af.RunError, match="raised TypeError: the output u: expected a number, found str"):
        loop(Text(1.0)).run()
    start = Proportional(1.0)
    start.outputs = {**Proportional.outputs, "u": None}
    with pytest.raises(TypeError, match="the start value of u: expected a number, found NoneType"):
        loop(start).run()


def test_an_output_that_starts_with_an_integer_is_not_cut():
    class Half(Proportional):
        def step(self, t, dt, inputs):
            return {"count": 0.5}

    with pytest.raises(af.RunError, match="the output count is 0.5, expected an integer of 32 bits"):
        loop(Half(1.0)).run()


def test_an_integer_beyond_32_bits_is_an_error():
    class Large(Proportional):
        def step(self, t, dt, inputs):
            return {"count": 2**40}

    sentence = "count is 1099511627776, expected an integer of 32 bits; a variable that starts with a float takes any"
    with pytest.raises(af.RunError, match="raised ValueError: the output " + sentence):
        loop(Large(1.0)).run()
    start = Proportional(1.0)
    start.outputs = {**Proportional.outputs, "count": 2**40}
    with pytest.raises(ValueError, match="the start value of " + sentence):
        loop(start).run()
    last = Proportional(1.0)
    last.step = lambda t, dt, inputs: {"u": 0.0, "count": -(2**31)}
    assert loop(last).run()["law.count"][-1] == -(2**31)
