"""The FMUs of FMI 3.0, run by FMPy, beside those of FMI 2.0 from the same library."""

import re
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from c_abi import STANDARD_FUNCTIONS

RUN = {"stop_time": 2.0, "output_interval": 1e-2}


@pytest.fixture(scope="session")
def archives(aso_ftc, root, tmp_path_factory):
    """The FMUs of both versions, by model: FMI 2.0, FMI 3.0."""
    out = tmp_path_factory.mktemp("fmi3")
    models = {"FrictionPendulum": "fmu-plant", "AsoController": "fmu-controller"}
    models["BouncingBall"] = "examples/bouncing-ball"
    done = aso_ftc("pack", *(root / folder for folder in models.values()), "--fmi", "both", "--out", out)
    assert done.returncode == 0, done.stderr
    return {name: (out / f"{name}.fmu", out / f"{name}.fmi3.fmu") for name in models}


def simulate(path, interface, **options):
    """Runs the FMU and returns its results; fails at the first message."""
    messages = []

    def logger(*message):
        messages.append(message)

    result = fmpy.simulate_fmu(str(path), fmi_type=interface, logger=logger, **RUN, **options)
    assert messages == []
    return result


def same_bits(one, other):
    names = [name for name in one.dtype.names if name in other.dtype.names]
    return len(names) > 1 and all(one[name].tobytes() == other[name].tobytes() for name in names)


MODELS = ["FrictionPendulum", "AsoController", "BouncingBall"]


@pytest.mark.parametrize("model", MODELS)
def test_fmpy_finds_no_problem_in_the_fmu(archives, model):
    assert validate_fmu(str(archives[model][1])) == []


@pytest.mark.parametrize("model", MODELS)
def test_both_versions_have_the_same_results_in_co_simulation(archives, model):
    two, three = (simulate(path, "CoSimulation") for path in archives[model])
    assert same_bits(two, three)


@pytest.mark.parametrize("model", MODELS)
def test_both_versions_have_the_same_results_in_model_exchange(archives, model):
    two, three = (simulate(path, "ModelExchange") for path in archives[model])
    assert same_bits(two, three)


def test_the_ball_returns_early_at_its_bounces_and_rises_as_high(archives):
    path = archives["BouncingBall"][1]
    stops = simulate(path, "CoSimulation", use_event_mode=True, early_return_allowed=True)
    whole = simulate(path, "CoSimulation")
    height = whole.dtype.names[1]
    assert abs(stops[height][-1] - whole[height][-1]) < 1e-6
    bounces = sorted({float(time) for time in stops["time"]} - {float(time) for time in whole["time"]})
    fall = (2 / 9.81) ** 0.5
    assert bounces == pytest.approx([fall, fall * (1 + 1.4), fall * (1 + 1.4 + 0.98), fall * (1 + 1.4 + 0.98 + 0.686)], abs=1e-6)


def test_the_plant_returns_early_where_the_cart_stops_or_breaks_away_and_moves_as_without_events(archives):
    path = archives["FrictionPendulum"][1]
    start = {"v_p_0": 0.8, "theta_0": 0.02}
    output = ["x_p", "v_p", "omega", "regime"]
    whole = simulate(path, "CoSimulation", start_values=start, output=output)
    stops = simulate(
        path, "CoSimulation", start_values=start, output=output, use_event_mode=True, early_return_allowed=True
    )
    grid = {float(time) for time in whole["time"]}
    events = [row for row in stops if float(row["time"]) not in grid]
    assert len(events) >= 2
    assert all(row["v_p"] == 0.0 for row in events)
    last = {float(row["time"]): row for row in stops}
    assert all(last[float(row["time"])].tobytes() == row.tobytes() for row in whole)


@pytest.mark.parametrize("model", MODELS)
def test_the_terminal_is_valid_and_has_all_inputs_and_outputs(archives, model):
    path = archives[model][1]
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    with zipfile.ZipFile(path) as archive:
        file = etree.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))
    etree.XMLSchema(etree.parse(schema)).assertValid(file)
    members = {member.get("variableName") for member in file.iter("TerminalMemberVariable")}
    variables = fmpy.read_model_description(str(path)).modelVariables
    assert members == {variable.name for variable in variables if variable.causality in ("input", "output")}


def test_the_library_defines_every_function_of_the_header(archives):
    header = Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h"
    names = set(re.findall(r"\b(fmi3\w+)TYPE\b", header.read_text()))
    assert len(names) == 75
    unpacked = Path(fmpy.extract(str(archives["BouncingBall"][1])))
    library = (unpacked / "binaries" / "x86_64-linux" / "BouncingBall.so").read_bytes()
    for name in names | STANDARD_FUNCTIONS | {"fmuDescribe", "fmuDescribe3"}:
        assert b"\0" + name.encode() + b"\0" in library, name


def test_matrices_of_the_controller_are_arrays(archives):
    description = fmpy.read_model_description(str(archives["AsoController"][1]))
    extents = {variable.name: [int(one.start) for one in variable.dimensions] for variable in description.modelVariables}
    assert extents["A"] == [4, 4] and extents["B"] == [4, 1] and extents["C"] == [2, 4]
    assert extents["x_hat[1]"] == []  # units differ


@pytest.mark.parametrize("model", MODELS[:2])
def test_the_committed_descriptions_of_fmi_3_are_those_of_the_libraries(archives, root, model):
    unpacked = Path(fmpy.extract(str(archives[model][1])))
    packed = (unpacked / "modelDescription.xml").read_bytes()
    committed = (root / "modelDescription" / f"{model}.fmi3.xml").read_bytes()
    assert packed == committed, "run: aso-ftc pack --update-descriptions"
