"""Model exchange of FMI 1.0: a bouncing ball in C, `tests/c/model1.c`, beside its solution and FMPy."""

import csv
import math
import subprocess
import zipfile

import pytest
from fmpy import simulate_fmu

from conftest import ROOT

COMMAND = ROOT / "target" / "release" / "aso-ftc"
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="1.0" modelName="Ball" modelIdentifier="model1" guid="{1}" numberOfContinuousStates="2"
 numberOfEventIndicators="1"><ModelVariables>
<ScalarVariable name="h" valueReference="0" causality="output"><Real start="1" fixed="true"/></ScalarVariable>
<ScalarVariable name="v" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="depth" valueReference="0" causality="output" alias="negatedAlias"><Real/></ScalarVariable>
<ScalarVariable name="u" valueReference="2" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="e" valueReference="3" variability="parameter"><Real start="0.5"/></ScalarVariable>
<ScalarVariable name="n" valueReference="0" causality="output" variability="discrete"><Integer/></ScalarVariable>
</ModelVariables></fmiModelDescription>"""
GRAVITY = 9.81


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    """The FMU."""
    folder = tmp_path_factory.mktemp("ball")
    flags = ["-std=c11", "-shared", "-fPIC", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["cc", *flags, "-o", folder / "model1.so", ROOT / "tests/c/model1.c"], check=True)
    with zipfile.ZipFile(folder / "ball.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.write(folder / "model1.so", "binaries/linux64/model1.so")
    return folder / "ball.fmu"


def run(folder, *arguments):
    """The rows of a run, as dictionaries of numbers."""
    command = [COMMAND, "run", *arguments, "--results", folder / "results.csv"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with (folder / "results.csv").open() as file:
        return [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]


def height(time, restitution):
    """The solution, up to the second bounce."""
    bounce = math.sqrt(2 / GRAVITY)
    if time < bounce:
        return 1 - GRAVITY * time**2 / 2
    return restitution * GRAVITY * bounce * (time - bounce) - GRAVITY * (time - bounce) ** 2 / 2


TIMES = ["--stop-time", "0.8", "--step", "0.05"]


@pytest.mark.parametrize("more", [[], ["--isolate"]])
@pytest.mark.parametrize("restitution", [0.5, 0.9])
def test_a_bouncing_ball_follows_its_solution_and_counts_its_time_events(tmp_path, ball, more, restitution):
    """State events, time events, a parameter and a negated alias."""
    rows = run(tmp_path, ball, *TIMES, "--set", f"ball.e={restitution}", *more)
    assert len(rows) == 17
    for row in rows:
        assert row["ball.h"] == pytest.approx(height(row["time"], restitution), abs=1e-9)
        assert row["ball.depth"] == -row["ball.h"]
    assert [row["ball.n"] for row in rows] == [math.floor(4 * row["time"] + 1e-9) for row in rows]


def test_an_input_acts_on_the_derivatives(tmp_path, ball):
    """A force that balances the weight, set before the run."""
    rows = run(tmp_path, ball, *TIMES, "--set", f"ball.u={GRAVITY}")
    assert all(row["ball.h"] == pytest.approx(1, abs=1e-12) for row in rows)


def test_fmpy_computes_the_same(tmp_path, ball):
    """FMPy integrates with CVODE and stops at the same events."""
    rows = run(tmp_path, ball, *TIMES)
    other = simulate_fmu(str(ball), fmi_type="ModelExchange", stop_time=0.8, output_interval=0.05, relative_tolerance=1e-9)
    last = {round(float(row["time"]), 9): float(row["h"]) for row in other}
    for row in rows:
        assert row["ball.h"] == pytest.approx(last[round(row["time"], 9)], abs=1e-6)


def test_the_log_names_the_functions_of_the_version(tmp_path, ball):
    """`--log-calls`."""
    run(tmp_path, ball, *TIMES, "--log-calls", "calls.txt")
    calls = {line.split("(")[0].split()[-1] for line in (tmp_path / "calls.txt").read_text().splitlines()}
    assert {"fmiInstantiateModel", "fmiInitialize", "fmiEventUpdate", "fmiTerminate"} <= calls
    assert not any(call.startswith("fmi2") for call in calls)
