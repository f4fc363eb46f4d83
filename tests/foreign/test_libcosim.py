"""libcosim, the co-simulation library of the Open Simulation Platform, as an independent importer."""

import ctypes
import re

import numpy as np
import pytest
from libcosimpy.CosimEnums import (
    CosimVariableCausality,
    CosimVariableType,
    CosimVariableVariability,
)
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

from held_loop import COUNT, LINKS, SETTINGS, expect_equal, held_loop

NANOSECOND, STEP = 1_000_000_000, 100_000  # per s; 0.1 ms in ns
LOG_LINE = re.compile(r"\[[^]]*\] \[[^]]*\] \[(\w+)\]\s+(.*)")
PLACE = re.compile(r"\[FMI Library: FMI2XML\] \[Line:(\d+)\] Detected during parsing:")
NO_START = (
    "[FMI Library: FMI2XML] "
    "Start attribute is required for this causality, variability and initial combination"
)
NO_ENUMERATION = (
    "FMI 2.0 Enumeration variable type not supported, variable with name {} will be ignored"
)
# libcosim does not support independent variables (section 2.2.7) and calls them local.
CAUSALITIES = {"independent": "LOCAL", "calculatedParameter": "CALCULATED_PARAMETER"}


class Execution:
    """Both FMUs in libcosim, connected; its fixed-step algorithm holds all inputs (Jacobi)."""

    def __init__(self, packed, unpacked):
        log_output_level(CosimLogLevel.TRACE)
        self.execution = CosimExecution.from_step_size(STEP)
        self.variables = {role: unpacked[role].variables for role in packed}
        self.slaves = {role: CosimLocalSlave(str(path), role) for role, path in packed.items()}
        self.index = {r: self.execution.add_local_slave(s) for r, s in self.slaves.items()}
        for source, output, sink, name in LINKS:
            ends = (*self.address(source, output), *self.address(sink, name))
            assert self.execution.connect_real_variables(*ends) == 0

    def address(self, role, name):
        """Index of the slave and value reference."""
        return self.index[role], self.variables[role][name].valueReference

    def set(self, role, name, value):
        """Sets a start value."""
        kind = self.variables[role][name].type.lower()
        assert getattr(self.execution, f"{kind}_initial_value")(*self.address(role, name), value)

    def listed(self, role):
        """The properties of each variable that libcosim reads."""
        return {
            variable.name.decode(): (
                variable.reference,
                CosimVariableType(variable.type).name,
                CosimVariableCausality(variable.causality).name,
                CosimVariableVariability(variable.variability).name,
            )
            for variable in self.execution.slave_variables(self.index[role])
        }

    def run(self, names):
        """Every value of the named Real variables after each of `COUNT` steps."""
        observer = CosimObserver.create_time_series(COUNT + 1)
        assert self.execution.add_observer(observer)
        places = [self.address(*name) for name in names]
        for place in places:
            assert observer.start_time_series(*place, CosimVariableType.REAL)
        assert self.execution.step(COUNT)
        columns = []
        for place in places:
            samples = observer.time_series_real_samples(*place, from_step=1, sample_count=COUNT)
            assert samples[0] == [k * STEP for k in range(1, COUNT + 1)]
            columns.append(samples[2])
        return np.transpose(columns)


def start_missing_at(folder):
    """The line of the description at which libcosim reports a missing start value of the independent variable.

    Section 2.2.7 forbids such a value: "If initial = calculated or causality = independent, it is not
    allowed to provide a start value."
    """
    lines = (folder / "modelDescription.xml").read_text(encoding="utf-8").splitlines()
    (line,) = [k for k, line in enumerate(lines, start=1) if 'causality="independent"' in line]
    assert lines[line].strip() == '<Real unit="s"/>'
    return line + 1


def complaints(capfd):
    """Warnings and errors with the place that the previous line names; none may come from an FMU."""
    ctypes.CDLL(None).fflush(None)
    log, errors = capfd.readouterr()
    assert errors == "" and "[FMI status=" not in log, log
    entries = [LOG_LINE.fullmatch(line) for line in log.splitlines()]
    assert all(entries), log
    texts = [(entry[1], entry[2]) for entry in entries]
    places = [None, *(PLACE.fullmatch(text) for _, text in texts)]
    return {
        (place and int(place[1]), text)
        for (level, text), place in zip(texts, places)
        if level not in ("trace", "debug", "info")
    }


def known_complaints(fmu):
    """Messages that are due to errors or limitations of libcosim."""
    variables = fmu.variables.values()
    enumerations = [variable.name for variable in variables if variable.type == "Enumeration"]
    limits = {(None, NO_ENUMERATION.format(name)) for name in enumerations}
    return {(start_missing_at(fmu.folder), NO_START), *limits}


def test_libcosim_lists_every_variable_as_described(packed, unpacked):
    execution = Execution(packed, unpacked)
    for role, fmu in unpacked.items():
        described = {
            name: (
                variable.valueReference,
                variable.type.upper(),
                CAUSALITIES.get(variable.causality, variable.causality.upper()),
                variable.variability.upper(),
            )
            for name, variable in fmu.variables.items()
            if variable.type != "Enumeration"
        }
        assert execution.listed(role) == described


def test_libcosim_couples_both_fmus_with_the_bits_of_fmpy(packed, unpacked, capfd):
    execution = Execution(packed, unpacked)
    for role, settings in SETTINGS.items():
        for name, value in settings.items():
            execution.set(role, name, value)
    times = [k * STEP / NANOSECOND for k in range(COUNT + 1)]
    grid = [(start, end - start) for start, end in zip(times, times[1:])]
    names, expected = held_loop(unpacked, grid)
    expect_equal(names, expected, execution.run(names))
    observer = CosimObserver.create_last_value()
    assert execution.execution.add_observer(observer)
    assert execution.execution.step()
    for role, settings in SETTINGS.items():
        for name in settings.keys() - {"linearised"}:
            index, reference = execution.address(role, name)
            assert observer.last_real_values(index, [reference]) == [settings[name]]
    assert complaints(capfd) == known_complaints(unpacked["plant"]) | known_complaints(
        unpacked["controller"]
    )


@pytest.mark.parametrize("role", ["plant", "controller"])
def test_libcosim_reports_only_a_missing_start_value_that_the_standard_forbids(
    role, packed, unpacked, capfd
):
    log_output_level(CosimLogLevel.TRACE)
    slave = CosimLocalSlave(str(packed[role]), role)
    assert CosimExecution.from_step_size(STEP).add_local_slave(slave) == 0
    assert complaints(capfd) == known_complaints(unpacked[role])
