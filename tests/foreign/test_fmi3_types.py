"""The types of FMI 3.0 that FMI 2.0 has not, exported by us and read by FMPy, and by our master."""

import csv

import fmpy
import pytest
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

MODEL = "tests/models/types"
LONG = 2**62 + 1
OUTPUTS = {"single_out": 1.0, "int8_out": -4, "uint8_out": 200, "int16_out": -30000, "uint16_out": 60000}
OUTPUTS |= {"uint32_out": 4_000_000_000, "int64_out": -9_007_199_254_740_993, "uint64_out": 2**64 - 1}


@pytest.fixture(scope="module")
def fmu(aso_ftc, root, tmp_path_factory):
    """The FMU, packed for FMI 3.0."""
    out = tmp_path_factory.mktemp("types")
    done = aso_ftc("pack", root / MODEL, "--fmi", "3", "--out", out)
    assert done.returncode == 0, done.stderr
    return out / "Types.fmi3.fmu"


def test_fmpy_reads_the_start_value_of_every_type(fmu):
    assert validate_fmu(str(fmu)) == []
    messages = []
    result = fmpy.simulate_fmu(
        str(fmu), stop_time=0.2, output_interval=0.1, output=list(OUTPUTS), logger=lambda *message: messages.append(message)
    )
    assert messages == []
    assert {name: result[name][-1].item() for name in OUTPUTS} == OUTPUTS


def test_values_that_fmpy_sets_come_back_exactly(fmu):
    description = fmpy.read_model_description(str(fmu))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    instance = FMU3Slave(
        guid=description.guid, unzipDirectory=fmpy.extract(str(fmu)), modelIdentifier="Types", instanceName="types"
    )
    instance.instantiate()
    instance.enterInitializationMode()
    instance.setInt64([references["int64"]], [LONG])
    instance.setBinary([references["bytes"]], [b"\x00\x01\x02\x00"])
    instance.setUInt16([references["row"]], [7, 8, 9])
    instance.exitInitializationMode()
    assert list(instance.getInt64([references["int64_out"]])) == [LONG]
    assert list(instance.getBinary([references["bytes_out"]])) == [b"\x00\x01\x02\x00"]
    assert list(instance.getUInt16([references["row_out"]], 3)) == [7, 8, 9]
    instance.terminate()
    instance.freeInstance()


def test_our_master_reads_what_fmpy_reads(fmu, aso_ftc, tmp_path):
    settings = ["--set", f"m.int64={LONG}", "--set", "m.bytes=00010200", "--set", "m.row=7 8 9", "--set", "m.uint64=42"]
    done = aso_ftc("run", "--fmu", f"m={fmu}", "--stop-time", "0.2", "--step", "0.1", *settings, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "results.csv", newline="") as file:
        last = list(csv.DictReader(file))[-1]
    assert last["m.int64_out"] == str(LONG) and last["m.uint64_out"] == "42"
    assert last["m.bytes_out"] == "00010200"
    assert [last[f"m.row_out[{k}]"] for k in (1, 2, 3)] == ["7", "8", "9"]


def test_a_number_beyond_63_bits_is_an_error_that_names_the_variable(fmu, aso_ftc, tmp_path):
    done = aso_ftc("run", "--fmu", f"m={fmu}", "--stop-time", "0.2", "--step", "0.1", "--out", tmp_path)
    assert done.returncode != 0
    assert "gives uint64_out a value of type UInt64 that the importer cannot represent" in done.stderr
    answer = aso_ftc("check", fmu).stdout
    assert "runs in this master: yes" in answer
    assert "note: variable uint64_out: is above 2^63 - 1 after 0 steps" in answer
    assert "fmi3GetUInt64" not in answer


def test_a_model_with_such_a_type_is_refused_for_fmi_2_by_name(aso_ftc, root, tmp_path):
    done = aso_ftc("pack", root / MODEL, "--fmi", "2", "--out", tmp_path)
    assert done.returncode != 0
    assert "single" in done.stderr and "FMI 3.0" in done.stderr
    assert list(tmp_path.iterdir()) == []
