"""The packages and their descriptions, checked by FMPy, by the schema and against the standard's text."""

import re
import struct
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from c_abi import STANDARD_FUNCTIONS

ROLES = ["plant", "controller"]
SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
LOCAL_HEADER, LOCAL_SIGNATURE = struct.Struct("<4s5H3I2H"), b"PK\x03\x04"
DATA_DESCRIPTOR, UTF8, ENCRYPTED = 1 << 3, 1 << 11, 1


@pytest.mark.parametrize("role", ROLES)
def test_fmpy_finds_no_problem(packed, role):
    assert validate_fmu(str(packed[role])) == []


@pytest.mark.parametrize("role", ROLES)
def test_the_command_fmpy_validate_finds_no_problem(packed, role, python):
    done = python("-m", "fmpy", "validate", packed[role])
    assert done.returncode == 0, done
    assert "no problems found" in done.stdout.lower()


@pytest.mark.parametrize("role", ROLES)
def test_the_packed_and_the_committed_description_follow_the_schema(packed, role, root):
    schema = etree.XMLSchema(etree.parse(SCHEMA))
    committed = root / "modelDescription" / f"{packed[role].stem}.xml"
    inside = zipfile.ZipFile(packed[role]).read("modelDescription.xml")
    schema.assertValid(etree.fromstring(inside))
    schema.assertValid(etree.parse(committed))
    assert committed.read_bytes() == inside


@pytest.mark.parametrize("role", ROLES)
def test_the_description_follows_the_text_of_the_standard(packed, role):
    text = zipfile.ZipFile(packed[role]).read("modelDescription.xml").decode("utf-8")
    assert text.startswith('<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription')
    assert not re.search(r'="[+-]?(NaN|INF)"', text, re.IGNORECASE)
    model = etree.fromstring(text.encode())
    for name in ("UnitDefinitions", "LogCategories", "ModelVariables", "ModelStructure/Outputs"):
        assert len(model.find(name)), name
    date = model.get("generationDateAndTime")
    assert date is None or re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", date)


@pytest.mark.parametrize("role", ROLES)
def test_exactly_the_required_initial_unknowns_are_listed_in_ascending_order(packed, role):
    model = etree.fromstring(zipfile.ZipFile(packed[role]).read("modelDescription.xml"))
    variables = model.find("ModelVariables")
    required = {
        index
        for index, variable in enumerate(variables, start=1)
        if variable.get("causality") == "calculatedParameter"
        or variable.get("causality") == "output"
        and variable.get("initial") != "exact"
        or variable.find("Real[@derivative]") is not None
    }
    listed = [int(unknown.get("index")) for unknown in model.find("ModelStructure/InitialUnknowns")]
    assert listed == sorted(required)
    for unknown in model.findall("ModelStructure//Unknown"):
        dependencies = [int(index) for index in unknown.get("dependencies").split()]
        assert dependencies == sorted(set(dependencies))


@pytest.mark.parametrize("role", ROLES)
def test_the_archive_uses_only_features_that_every_importer_supports(packed, role):
    data = packed[role].read_bytes()
    names = set()
    for entry in zipfile.ZipFile(packed[role]).infolist():
        header = LOCAL_HEADER.unpack_from(data, entry.header_offset)
        signature, needed, flags, method = header[:4]
        start = entry.header_offset + LOCAL_HEADER.size
        name = data[start : start + header[9]].decode("ascii")
        assert signature == LOCAL_SIGNATURE
        assert name == entry.filename and name not in names
        assert needed <= 20 and entry.extract_version <= 20
        assert method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
        assert not flags & (DATA_DESCRIPTOR | ENCRYPTED)
        assert not re.search(r"\\|^/|^[A-Za-z]:|(^|/)\.\.?(/|$)|//", name), name
        assert (entry.external_attr >> 16) & 0o170000 in (0, 0o100000), f"{name} is no plain file"
        names.add(name)
    top = {name.split("/")[0] for name in names}
    assert top <= {"modelDescription.xml", "model.png", "documentation", "binaries", "resources"}
    assert "documentation/index.html" in names


def defined_symbols(path):
    """Names of the global symbols that a 64-bit little-endian ELF library defines."""
    data = path.read_bytes()
    assert data[:6] == b"\x7fELF\x02\x01"
    table, size, count = *struct.unpack_from("<Q", data, 40), *struct.unpack_from("<HH", data, 58)
    sections = [struct.unpack_from("<IIQQQQIIQQ", data, table + k * size) for k in range(count)]
    names = set()
    for _, kind, _, _, start, length, link, _, _, entry in sections:
        if kind != 11:  # SHT_DYNSYM
            continue
        strings = sections[link][4]
        for position in range(start, start + length, entry):
            name, info, _, section = struct.unpack_from("<IBBH", data, position)
            if section and info >> 4 in (1, 2):  # defined; STB_GLOBAL, STB_WEAK
                end = data.index(b"\0", strings + name)
                names.add(data[strings + name : end].decode())
    return names


def test_the_library_exports_the_functions_of_the_standard_only(fmu):
    assert len(STANDARD_FUNCTIONS) == 44  # 34 for co-simulation, 10 more for model exchange
    # `aso-ftc design` gives a library with resources another design, and asks what it then describes.
    more = {"fmuDescribe"} if (fmu.folder / "resources").is_dir() else set()
    assert defined_symbols(fmu.path) == STANDARD_FUNCTIONS | more
    assert more == ({"fmuDescribe"} if fmu.identifier == "AsoController" else set())
    assert fmu.library.fmi2GetVersion() == b"2.0"
    assert fmu.library.fmi2GetTypesPlatform() == b"default"


def test_fmpy_runs_the_default_experiment_of_each_fmu(fmu, packed):
    role = "plant" if fmu.identifier == "FrictionPendulum" else "controller"
    experiment = fmu.description.defaultExperiment
    result = fmpy.simulate_fmu(str(packed[role]), output_interval=0.5)
    assert result["time"][0] == float(experiment.startTime)
    assert result["time"][-1] == pytest.approx(float(experiment.stopTime), abs=1e-9)
    assert np.diff(result["time"]) == pytest.approx(0.5, abs=1e-9)
    assert all(np.isfinite(result[name]).all() for name in result.dtype.names)
    assert {"time", *fmu.names(causality="output")} == set(result.dtype.names)


def test_fmpy_runs_the_plant_with_start_values_and_inputs(packed):
    dtype = [("time", float), ("u", float)]
    force = np.array([(0.0, 0.0), (0.4, 0.0), (0.4, 60.0), (1.0, 60.0)], dtype=dtype)
    start_values = {"x_p_0": -0.7, "theta_0": 0.0, "F_s": 50.0, "F_c": 45.0, "M": 4.0}
    result = fmpy.simulate_fmu(
        str(packed["plant"]),
        stop_time=1.0,
        step_size=0.01,
        output_interval=0.1,
        start_values=start_values,
        input=force,
        output=["x_p", "v_p", "f_fric", "regime"],
    )
    held = result["time"] < 0.401
    assert (result["x_p"][held] == -0.7).all() and (result["regime"][held] == 0).all()
    assert (result["v_p"][result["time"] > 0.45] > 0).all() and result["regime"][-1] == 1
    friction = 45 + 5 * np.exp(-((result["v_p"][-1] / 0.15) ** 2))
    assert result["f_fric"][-1] == pytest.approx(friction, rel=1e-12)


def test_fmpy_runs_the_controller_with_start_values_and_inputs(packed, controller):
    n, p = 4, 2
    start = {
        name: float(v.start) for name, v in controller.variables.items() if "[" in name and v.start
    }
    block = lambda name, rows, columns: np.array(
        [[start[f"{name}[{i},{j}]"] for j in range(1, columns + 1)] for i in range(1, rows + 1)]
    )
    a, b, c = block("A", n, n), block("B", n, 1), block("C", p, n)
    k_x, l_x = 0.5 * block("K_x", 1, n), block("L_x", n, p)
    y = np.array([0.02, -0.01])
    held = np.array([(0.0, *y)], dtype=[("time", float), ("x_p", float), ("theta", float)])
    gains = {f"K_x[1,{j + 1}]": gain for j, gain in enumerate(k_x[0])}
    result = fmpy.simulate_fmu(
        str(packed["controller"]),
        stop_time=0.5,
        step_size=0.01,
        output_interval=0.1,
        input=held,
        start_values={"t_on": 9.0, "compensate": True, **gains},
    )
    settled = np.linalg.solve(a + b @ k_x - l_x @ c, -l_x @ y)
    estimate = [result[f"x_hat[{k}]"][-1] for k in range(1, n + 1)]
    assert estimate == pytest.approx(settled, rel=1e-9)
    assert result["u"][-1] == pytest.approx((k_x @ settled)[0], rel=1e-8)
    assert (result["f_hat"] == 0).all()
