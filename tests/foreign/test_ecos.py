"""Ecos, a co-simulation engine in C++, as an independent importer."""

import ctypes
import re
from importlib import metadata

import numpy as np

from held_loop import COUNT, LINKS, SETTINGS, STEP, expect_equal, held_loop

# libecosc needs this library; the package tbb installs it outside of the dynamic linker's search
# path.
(TBB,) = (file for file in metadata.files("tbb") if file.name == "libtbb.so.12")
ctypes.CDLL(str(TBB.locate()))

from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure  # noqa: E402

COLUMNS = {"Real": "REAL", "Integer": "INT", "Boolean": "BOOL", "String": "STR"}
GETTERS = {"Real": "real", "Integer": "integer", "Boolean": "bool", "String": "string"}
# Names of array elements contain commas, which Ecos does not quote.
HEADING = re.compile(r"\w+::.+?\[(?:REAL|INT|BOOL|STR)\]")
LOG_LINE = re.compile(r"\[[^]]*\] \[ecos\] \[(\w+)\] (.*)")
# Ecos ignores the status of each call and logs messages of FMUs at the level debug: only these
# lines may appear.
USUAL = {
    "Initializing simulation..",
    "Parameterset 'settings' applied to 2 instances",
    "Initialized.",
    "Terminating simulation..",
    "Terminated.",
}


def simulation(packed):
    """Both FMUs in Ecos, connected; its fixed-step algorithm holds all inputs (Jacobi)."""
    EcosLib.set_log_level("debug")
    with EcosSimulationStructure() as structure:
        for role, path in packed.items():
            structure.add_model(role, path)
        for source, output, sink, name in LINKS:
            structure.make_real_connection(f"{source}::{output}", f"{sink}::{name}")
        pairs = [(f"{role}::{n}", v) for role in SETTINGS for n, v in SETTINGS[role].items()]
        structure.add_parameter_set("settings", dict(pairs))
        return EcosSimulation(STEP, structure=structure)


def value(running, role, variable):
    """Value of a variable."""
    return getattr(running, f"get_{GETTERS[variable.type]}")(f"{role}::{variable.name}")


def start_value(variable):
    """The start value as a number, a truth value or a text."""
    convert = {"Real": float, "Integer": int, "Boolean": "true".__eq__, "String": str}
    return convert[variable.type](variable.start)


def grid():
    """Ecos adds the step to the time."""
    time = 0.0
    for _ in range(COUNT):
        yield time, STEP
        time += STEP


def test_ecos_lists_every_variable_as_described(packed, unpacked, tmp_path):
    path = tmp_path / "all.csv"
    with simulation(packed) as running:
        running.add_csv_writer(str(path))
        assert running.init()
        running.step()
        running.terminate()
    header = path.read_text(encoding="utf-8").splitlines()[0]
    listed = HEADING.findall(header)
    described = {
        f"{role}::{name}[{COLUMNS[variable.type]}]"
        for role, fmu in unpacked.items()
        for name, variable in fmu.variables.items()
        if variable.type != "Enumeration"
    }
    assert ", ".join(["iterations", "time", *listed]) == header
    assert len(listed) == len(described) and set(listed) == described


def test_ecos_reads_the_described_start_values_if_nothing_is_set(packed, unpacked):
    with simulation(packed) as running:
        assert running.init()
        for role, fmu in unpacked.items():
            parameters = [v for v in fmu.variables.values() if v.causality == "parameter"]
            assert parameters
            for variable in parameters:
                assert value(running, role, variable) == start_value(variable), variable.name


def test_ecos_couples_both_fmus_with_the_bits_of_fmpy_and_no_fmu_reports_anything(
    packed, unpacked, capfd
):
    names, expected = held_loop(unpacked, grid(), exchange_before_reading=True)
    texts = [f"{role}::{name}" for role, name in names]
    rows = []
    with simulation(packed) as running:
        assert running.init(parameter_set="settings")
        for _ in range(COUNT):
            running.step()
            rows.append([running.get_real(text) for text in texts])
        for role, settings in SETTINGS.items():
            for name, setting in settings.items():
                assert value(running, role, unpacked[role].variables[name]) == setting
        running.terminate()
    expect_equal(names, expected, np.array(rows))
    ctypes.CDLL(None).fflush(None)
    log = capfd.readouterr()
    entries = [LOG_LINE.fullmatch(line) for line in log.out.splitlines()]
    assert all(entries) and {entry[2] for entry in entries} == USUAL, log.out
    assert log.err == ""
