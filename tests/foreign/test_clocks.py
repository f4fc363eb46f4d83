"""Clocks of FMI 3.0, exported by us, called through FMPy, and run by our master."""

import csv
import re
import zipfile

import fmpy
import pytest
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from design_oracle import WITHOUT_PROOFS
from residual_over_sample_time import CONSTANT, plant_file

MODEL = "tests/models/clocks"


@pytest.fixture(scope="module")
def fmus(aso_ftc, root, tmp_path_factory):
    """The FMUs by version."""
    out = tmp_path_factory.mktemp("clocks")
    done = aso_ftc("pack", root / MODEL, "--fmi", "both", "--out", out)
    assert done.returncode == 0, done.stderr
    return {2: out / "Counter.fmu", 3: out / "Counter.fmi3.fmu"}


@pytest.fixture(scope="module")
def description(fmus):
    return fmpy.read_model_description(str(fmus[3]))


def test_fmpy_reads_the_clocks_and_the_clocked_variables(fmus, description):
    assert validate_fmu(str(fmus[3])) == []
    variables = {variable.name: variable for variable in description.modelVariables}
    sample = variables["sample"]
    assert (sample.type, sample.causality, sample.intervalVariability) == ("Clock", "input", "constant")
    # FMPy does not read the interval.
    xml = zipfile.ZipFile(fmus[3]).read("modelDescription.xml").decode()
    assert re.search(r'name="sample"[^>]* intervalDecimal="0\.1"', xml)
    assert variables["third"].intervalVariability == "triggered"
    assert [variable.name for variable in variables["count"].clocks] == ["sample", "restart"]


def test_fmi_2_leaves_the_clocks_out(fmus):
    assert validate_fmu(str(fmus[2])) == []
    names = [variable.name for variable in fmpy.read_model_description(str(fmus[2])).modelVariables]
    assert names == ["time", "count", "restarts"]


def test_ticks_that_the_importer_sets_are_counted_and_the_output_clock_answers(fmus, description):
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    slave = FMU3Slave(
        guid=description.guid, unzipDirectory=fmpy.extract(str(fmus[3])), modelIdentifier="Counter", instanceName="one"
    )
    slave.instantiate(eventModeUsed=True, earlyReturnAllowed=True)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    ticks = []
    for k in range(7):
        if k > 0:
            slave.enterEventMode()
        slave.setClock([references["sample"]], [True])
        if k == 5:
            slave.setClock([references["restart"]], [True])
        ticks.append(bool(slave.getClock([references["third"]])[0]))
        # While its clock ticks, a clocked variable has the value that the update keeps.
        count = slave.getInt32([references["count"]])[0]
        assert slave.getInt32([references["count"]])[0] == count == (1, 2, 3, 4, 5, 1, 2)[k]
        slave.updateDiscreteStates()
        assert slave.getInt32([references["count"]])[0] == count
        # A clock ticks in one event only.
        assert not slave.getClock([references["sample"]])[0]
        slave.enterStepMode()
        slave.doStep(currentCommunicationPoint=0.1 * k, communicationStepSize=0.1)
    # The sixth tick makes the counter start again and counts from there.
    assert ticks == [False, False, True, False, False, True, False]
    assert [slave.getInt32([references[name]])[0] for name in ("count", "restarts")] == [2, 1]
    with pytest.raises(Exception, match="fmi3SetClock"):
        slave.enterEventMode()
        slave.setClock([references["third"]], [True])
    slave.freeInstance()


def test_our_master_ticks_a_periodic_clock_and_passes_the_ticks_of_an_output_clock_on(fmus, aso_ftc, tmp_path):
    done = aso_ftc(
        *["run", "--fmu", f"a={fmus[3]}", "--fmu", f"b={fmus[3]}", "--connect", "a.third=b.restart"],
        *["--stop-time", "1", "--step", "0.05", "--out", tmp_path],
    )
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "results.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    last = rows[-1]
    assert float(last["time"]) == pytest.approx(1.0)
    # Ticks at 0, 0.1, ..., 1.0. At 0.2, 0.5 and 0.8 a ticks third; b starts again and counts from there.
    assert last["a.count"] == "11" and last["b.count"] == "3"
    # A value is there at the ticks of its clocks only.
    restarts = [(float(row["time"]), row["b.restarts"]) for row in rows if row["b.restarts"]]
    assert [value for _, value in restarts] == ["1", "2", "3"]
    assert [time for time, _ in restarts] == pytest.approx([0.2, 0.5, 0.8])


def test_a_sampled_controller_with_a_clock_runs_as_the_one_of_fmi_2(aso_ftc, root, tmp_path):
    done = aso_ftc("pack", root / "fmu-controller", "--fmi", "both", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    plant = tmp_path / "plant.toml"
    plant.write_text(plant_file(CONSTANT, 1e-3), encoding="utf-8")
    ends = []
    for version in ("", ".fmi3"):
        fmu = tmp_path / f"Sampled{version}.fmu"
        base = tmp_path / f"AsoController{version}.fmu"
        done = aso_ftc("design", plant, "--out", tmp_path / f"design{version}.toml", "--fmu", fmu, "--from", base, *WITHOUT_PROOFS)
        # 1: the design is red, because it is not robust.
        assert done.returncode in (0, 1), done.stderr
        run = ["run", "--plant", root / "dist" / "FrictionPendulum.fmu", "--controller", fmu, "--step", "0.0005"]
        done = aso_ftc(*run, "--stop-time", "10", "--out", tmp_path / f"out{version}")
        assert done.returncode == 0, done.stderr
        with open(tmp_path / f"out{version}" / "results.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        last = rows[-1]
        # There is a row for each sample.
        assert version == "" or {row["controller.sample_clock"] for row in rows} == {"1"}
        ends.append([float(last[name]) for name in ("plant.x_p", "plant.theta", "controller.u")])
    variables = fmpy.read_model_description(str(tmp_path / "Sampled.fmi3.fmu")).modelVariables
    assert [variable.name for variable in variables if variable.type == "Clock"] == ["sample_clock"]
    # The angle has come to rest: 1e-10 rad, from 0.1.
    assert ends[0] == pytest.approx(ends[1], rel=1e-9, abs=1e-9)


def test_a_clock_of_each_type_ticks_when_the_model_says(aso_ftc, root, tmp_path):
    done = aso_ftc("pack", root / "tests/models/clock-types", "--fmi", "3", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    fmu = next(tmp_path.glob("*.fmu"))
    assert validate_fmu(str(fmu)) == []
    types = {variable.name: variable.intervalVariability for variable in fmpy.read_model_description(str(fmu)).modelVariables}
    for name in ("constant", "fixed", "tunable", "changing", "countdown", "triggered"):
        assert types[name] == name
    (tmp_path / "in.csv").write_text("time,beat,triggered\n0,0.2,0\n0.25,0.2,1\n0.5,0.4,0\n", encoding="utf-8")
    system = tmp_path / "system.toml"
    system.write_text(
        f"[fmus]\na = {str(fmu)!r}\nb = {str(fmu)!r}\n"
        '[[connections]]\nfrom = "a.echo"\nto = "b.triggered"\n'
        '[[scenario.table]]\ncsv = "in.csv"\nelement = "a"\n',
        encoding="utf-8",
    )
    done = aso_ftc("run", system, "--stop-time", "1", "--step", "0.1", "--set", "a.period=0.125", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "results.csv", newline="") as file:
        rows = list(csv.DictReader(file))

    def ticks(name):
        return [float(row["time"]) for row in rows if row[name]]

    # By hand. a: every 0.1; every 0.125; every 0.2 until 0.5, then from the tick at 0.6 on every 0.4; each interval
    # twice the one before; 0.07 after each third tick of fixed, at 0.25, 0.625 and 1.
    assert ticks("a.n_constant") == pytest.approx([0.1 * k for k in range(11)])
    assert ticks("a.n_fixed") == pytest.approx([0.125 * k for k in range(9)])
    assert ticks("a.n_tunable") == pytest.approx([0, 0.2, 0.4, 0.6, 1.0])
    assert ticks("a.n_changing") == pytest.approx([0.05, 0.15, 0.35, 0.75])
    assert ticks("a.n_countdown") == pytest.approx([0.32, 0.695])
    assert ticks("a.n_triggered") == pytest.approx([0.25])
    # b: its own period, and the countdown of a.
    assert ticks("b.n_fixed") == pytest.approx([0.15 * k for k in range(7)])
    assert ticks("b.n_triggered") == pytest.approx([0.32, 0.695])
    assert [row["b.n_triggered"] for row in rows if row["b.n_triggered"]] == ["1", "2"]
    # FMI 3.0.2, section 2.2.8.2: an interval may be 0. The countdown then ends at the instant at which it starts.
    command = ["run", system, "--stop-time", "1", "--step", "0.1", "--set", "a.period=0.125", "--set", "a.delay=0"]
    done = aso_ftc(*command, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "results.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert ticks("a.n_countdown") == pytest.approx([0.25, 0.625, 1.0])
    assert ticks("b.n_triggered") == pytest.approx([0.25, 0.625, 1.0])
