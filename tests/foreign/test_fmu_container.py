"""The FMU container of Renault's fmu-manipulation-toolbox as an independent tool: both FMUs in one."""

import logging
import re

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmu_manipulation_toolbox.checker import get_checkers
from fmu_manipulation_toolbox.container import FMUContainer
from fmu_manipulation_toolbox.operations import FMU

from held_loop import COUNT, LINKS, SETTINGS, STEP, expect_equal, held_loop, real_outputs

TOOLBOX = logging.getLogger("fmu_manipulation_toolbox")
KINDS = {
    "Real": "real64",
    "Integer": "integer32",
    "Enumeration": "integer32",
    "Boolean": "boolean",
    "String": "string",
}
# The toolbox treats each FMU as a whole and reports a loop. There is none: by
# ModelStructure/InitialUnknowns (section 2.2.8) x_p and theta do not depend on u.
LOOP = (
    "Loop of links through the embedded FMU 'FrictionPendulum.fmu': "
    "it is initialized without the values its inputs get from the loop."
)
# Every container reports these progress messages as warning and as error.
PROGRESS = {
    ("WARNING", "FMUContainer 'V2.0'"),
    ("WARNING", "Container use PARALLEL mode with MONO thread."),
    ("ERROR", "Solver configure...."),
}
LOG_LINE = re.compile(r"\[(\w+)\] (.*)")


@pytest.fixture
def complaints(caplog):
    """Warnings and errors of the toolbox."""
    caplog.set_level(logging.WARNING, TOOLBOX.name)
    return lambda: [record.getMessage() for record in caplog.records]


def checked(path):
    """Lets every checker of the toolbox read an FMU."""
    checkers = get_checkers()
    assert len(checkers) >= 2, "the schema and the rules of sections 2.2.7 and 2.2.8"
    with FMU(str(path)) as fmu:
        for checker in checkers:
            fmu.apply_operation(checker())


def container(packed, unpacked, folder):
    """A container with both FMUs, connected, all inputs held over a step (Jacobi)."""
    loop = FMUContainer("loop", packed["plant"].parent)
    name_of = {role: path.name for role, path in packed.items()}
    for role, file_name in name_of.items():
        loop.get_fmu(file_name)
        for name, value in SETTINGS[role].items():
            loop.add_start_value(file_name, name, str(value).lower())
        for name in real_outputs(unpacked[role].description):
            loop.add_output(file_name, name, f"{role}.{name}")
    for source, output, sink, name in LINKS:
        loop.add_link(name_of[source], output, name_of[sink], name)
    loop.add_implicit_rule(auto_input=True, auto_output=False, auto_link=False)
    path = folder / "loop.fmu"
    loop.make_fmu(path, step_size=STEP)
    return path


@pytest.mark.parametrize("role", ["plant", "controller"])
def test_the_checkers_of_the_toolbox_find_nothing(packed, role, complaints):
    checked(packed[role])
    assert complaints() == []


def test_the_toolbox_lists_every_variable_as_described(packed, unpacked, complaints):
    loop = FMUContainer("loop", packed["plant"].parent)
    for role, fmu in unpacked.items():
        embedded = loop.get_fmu(packed[role].name)
        listed = {
            port.name: (port.vr, port.type_name, port.causality, port.variability, port.start_value)
            for port in embedded.ports.values()
            if not port.is_fmi2_aggregate
        }
        assert listed == {
            name: (v.valueReference, KINDS[v.type], v.causality, v.variability, v.start)
            for name, v in fmu.variables.items()
        }
    assert complaints() == []


def test_a_container_of_both_fmus_is_valid(packed, unpacked, tmp_path, complaints):
    path = container(packed, unpacked, tmp_path)
    assert validate_fmu(str(path)) == []
    checked(path)
    assert complaints() == [LOOP]


# The library of the container once crashed in a process in which other tests had loaded libraries before.
SIMULATION = """
import sys
import fmpy, numpy

path, step, stop, *columns = sys.argv[1:]
options = {"step_size": float(step), "output_interval": float(step), "output": columns}
result = fmpy.simulate_fmu(path, stop_time=float(stop), debug_logging=True, **options)
numpy.save(path + ".npy", result)
"""


def test_a_container_couples_both_fmus_with_the_bits_of_fmpy(packed, unpacked, tmp_path, python):
    path = container(packed, unpacked, tmp_path)
    names, expected = held_loop(unpacked, [(k * STEP, STEP) for k in range(COUNT)])
    columns = [f"{role}.{name}" for role, name in names]
    done = python("-c", SIMULATION, path, STEP, COUNT * STEP, *columns)
    assert (done.returncode, done.stderr) == (0, "")
    result = np.load(f"{path}.npy")
    assert result["time"] == pytest.approx(np.arange(COUNT + 1) * STEP, abs=1e-9)
    expect_equal(names, expected, np.transpose([result[column][1:] for column in columns]))
    entries = [LOG_LINE.fullmatch(line) for line in done.stdout.splitlines()]
    assert all(entries), done.stdout
    assert {entry.groups() for entry in entries if entry[1] != "OK"} == PROGRESS
