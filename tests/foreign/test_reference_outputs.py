"""The published output of each example, MODEL_out.csv: a new run, and FMPy's run in co-simulation and in model exchange."""

import csv
import shutil

import numpy as np
import pytest
from fmpy import simulate_fmu

from conftest import ROOT
from reference_outputs import RUNS, outputs, pack

# Of the largest value of a variable.
SAME, INTEGRATED = 1e-9, 1e-5
SINGLE = [name for name, run in RUNS.items() if list(run.fmus) == ["m"]]
BOTH = ["BouncingBall", "DcServo", "StateSpace", "ThreeTank", "VanDerPol", "FrictionPendulum", "AsoController"]
MONITOR = "examples/wind-turbine-monitor/WindTurbineMonitor_out.csv"


@pytest.fixture(scope="module")
def fmus(packed, tmp_path_factory):
    """The folder of all FMUs."""
    folder = tmp_path_factory.mktemp("fmus")
    pack(folder)
    for path in packed.values():
        shutil.copy(path, folder)
    return folder


def columns(path):
    """The columns of a published file."""
    with open(ROOT / path, encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, np.array(rows, dtype=float).T))


def compare(results, published, tolerance):
    """Compares each published variable; the times must be the same."""
    assert len(published) > 1
    for name, column in published.items():
        assert len(results[name]) == len(column), name
        largest = abs(column).max()
        assert results[name] == pytest.approx(column, rel=0, abs=1e-9 if name == "time" else tolerance * largest), name


def inputs(run, ramp):
    """The inputs as a table for FMPy, which ends a step at a jump: in co-simulation a jump is a ramp between two steps."""
    signals = {name.partition(".")[2]: steps for name, steps in run.signals.items()}
    if not signals:
        return None
    values = {name: steps[0][1] for name, steps in signals.items()}
    rows = [(0.0, *values.values())]
    for time in sorted({time for steps in signals.values() for time, _ in steps[1:]}):
        rows.append((time - ramp, *values.values()))
        values |= {name: value for name, steps in signals.items() for at, value in steps if at == time}
        rows.append((time - ramp / 2, *values.values()))
    rows.append((run.stop, *values.values()))
    return np.array(rows, dtype=[(name, float) for name in ("time", *signals)])


def simulated(fmus, run, **options):
    """FMPy's results of the FMU of a run."""
    settings = {name.partition(".")[2]: value for name, value in run.settings.items()}
    (names,) = run.files.values()
    recorded = [name.partition(".")[2] for name in names]
    return simulate_fmu(str(fmus / run.fmus["m"]), stop_time=run.stop, start_values=settings, output=recorded, **options)


@pytest.mark.parametrize("name", RUNS)
def test_a_new_run_gives_the_published_output(fmus, tmp_path, name):
    for path, (names, *rows) in outputs(RUNS[name], fmus, tmp_path).items():
        published = columns(path)
        assert list(published) == names
        compare(dict(zip(names, np.array(rows, dtype=float).T)), published, SAME)


@pytest.mark.parametrize("name", SINGLE)
def test_fmpy_gives_the_published_output_in_co_simulation(fmus, name):
    run = RUNS[name]
    results = simulated(fmus, run, fmi_type="CoSimulation", output_interval=run.step, input=inputs(run, 0.75 * run.step))
    (path,) = run.files
    compare(results[:: round(run.every / run.step)], columns(path), SAME)


@pytest.mark.parametrize("name", BOTH)
def test_cvode_gives_the_published_output_in_model_exchange(fmus, name):
    run = RUNS[name]
    solver = {"solver": "CVode", "relative_tolerance": 1e-8, "record_events": False}
    results = simulated(fmus, run, fmi_type="ModelExchange", output_interval=run.every, input=inputs(run, 0.0), **solver)
    (path,) = run.files
    compare(results, columns(path), INTEGRATED)


def test_fmpy_gives_the_published_alarms_of_the_monitor_after_its_own_run_of_the_turbine(fmus):
    run, published = RUNS["WindTurbineMonitor"], columns(MONITOR)
    times = {"stop_time": run.stop, "output_interval": run.step}
    settings = {name.partition(".")[2].strip("'"): value for name, value in run.settings.items()}
    wind = inputs(run, 0.75 * run.step)
    turbine = simulate_fmu(str(fmus / "WindTurbine.fmu"), start_values=settings, input=wind, **times)
    alarms = simulate_fmu(str(fmus / "WindTurbineMonitor.fmu"), input=turbine, output=list(published)[1:], **times)
    compare(alarms[:: round(run.every / run.step)], published, SAME)
    assert published["fault_beta_m1[1]"].max() == 1 and published["fault_beta_m2[1]"].max() == 0


def test_the_receiving_node_has_what_was_sent_at_most_two_milliseconds_before():
    run = RUNS["CanBus"]
    bus, node = (columns(path) for path in run.files)
    for name in ("x_p", "theta"):
        (before, (at, after)) = run.signals[f"sender.send.Measurements.{name}"]
        received, time = node[f"received.Measurements.{name}"], node["time"]
        assert received[(time > 0.002) & (time < at)] == pytest.approx(before[1])
        assert received[time > at + 0.002] == pytest.approx(after)
    assert not bus["lost"].any() and bus["frames"] == pytest.approx(2000 * bus["time"], abs=2)
