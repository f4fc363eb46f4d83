"""Containers with both of our FMUs, run by our master: the results equal those of their parts.

The containers are those of Renault's fmu-manipulation-toolbox and of FMPy.
"""

import logging
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from fmpy import read_model_description
from fmpy.container_fmu.cli import create_container_fmu
from fmpy.container_fmu.config import Component, Configuration, Connection
from fmpy.model_description import CoSimulation, ModelDescription, ModelVariable, Unknown
from fmu_manipulation_toolbox.container import FMUContainer

from any_fmu import numbers, run
from held_loop import LINKS, SETTINGS, STEP, real_outputs

COUNT = 5000  # half a second
STOP = COUNT * STEP


def text(value):
    """A setting as the command and the toolbox read it."""
    return str(value).lower()


@pytest.fixture(scope="module")
def parts(aso_ftc, packed, tmp_path_factory):
    """The columns of a run of both FMUs, held inputs, with the settings of held_loop."""
    sets = [
        part
        for role, values in SETTINGS.items()
        for name, value in values.items()
        for part in ("--set", f"{role}.{name}={text(value)}")
    ]
    links = [f"{source}.{output}={sink}.{name}" for source, output, sink, name in LINKS]
    folder = tmp_path_factory.mktemp("parts")
    return run(aso_ftc, folder, packed, STEP, STOP, *sets, links=links)


def of_the_toolbox(packed, unpacked, folder):
    """A container of the toolbox; its outputs have the names of the parts' outputs."""
    container = FMUContainer("loop", packed["plant"].parent)
    for role, path in packed.items():
        container.get_fmu(path.name)
        for name, value in SETTINGS[role].items():
            container.add_start_value(path.name, name, text(value))
        for name in real_outputs(unpacked[role].description):
            container.add_output(path.name, name, f"{role}.{name}")
    for source, output, sink, name in LINKS:
        container.add_link(packed[source].name, output, packed[sink].name, name)
    container.add_implicit_rule(auto_input=True, auto_output=False, auto_link=False)
    path = folder / "loop.fmu"
    container.make_fmu(path, step_size=STEP)
    return path


def of_fmpy(packed, folder):
    """A container of FMPy: Real outputs, and the settings as start values of parameters."""
    components, exposed, outputs = {}, {}, []
    for role, path in packed.items():
        description = read_model_description(str(path))
        components[role] = Component(role, Path(path), description)
        for variable in description.modelVariables:
            start = SETTINGS[role].get(variable.name)
            output = variable.causality == "output" and variable.type == "Real"
            if start is None and not output:
                continue
            outer = ModelVariable(f"{role}.{variable.name}", None, variable.type)
            outer.causality, outer.variability = variable.causality, variable.variability
            if output:
                outer.initial = "calculated"
                outputs.append(Unknown(variable=outer))
            else:
                outer.initial, outer.start = variable.initial or "exact", text(start)
            exposed[outer] = [(components[role], variable)]
    # FMPy 0.3.32 writes the type of a connection as in FMI 2.0, but its container expects FMI 3.0.
    ends = {
        (role, v.name): evolve(v, type="Float64")
        for role, component in components.items()
        for v in component.modelDescription.modelVariables
    }
    links = [
        Connection(
            components[source], [ends[source, output]], components[sink], [ends[sink, name]]
        )
        for source, output, sink, name in LINKS
    ]
    interface = CoSimulation("container_fmu", fixedInternalStepSize=STEP)
    interface.canHandleVariableCommunicationStepSize = True
    description = ModelDescription("2.0", "loop", "own", coSimulation=interface)
    # The container gives value reference 0 to the time, even if it is not in the description.
    time = ModelVariable("time", None, "Real")
    time.causality, time.variability = "independent", "continuous"
    description.modelVariables, description.outputs = [time, *exposed], outputs
    path = folder / "loop.fmu"
    inside = folder / "inside"
    inside.mkdir()
    create_container_fmu(
        Configuration(False, description, list(components.values()), links, exposed), inside, path
    )
    return path


def expect_parts(table, parts, names):
    """Checks that the container has the bits of its parts from the first step on."""
    assert numbers(table, "time") == pytest.approx(np.arange(COUNT + 1) * STEP, abs=1e-12)
    assert {"plant.x_p", "controller.u"} < set(names)
    for name in names:
        values, expected = numbers(table, f"c.{name}")[1:], numbers(parts, name)[1:]
        assert np.array_equal(values, expected), name
        assert np.ptp(expected) > 0 or name == "controller.f_hat", name


def outputs(unpacked):
    """All Real outputs, and those that depend directly on no input."""
    every = [
        f"{role}.{name}"
        for role, fmu in unpacked.items()
        for name in real_outputs(fmu.description)
    ]
    direct = [
        f"{role}.{unknown.variable.name}"
        for role, fmu in unpacked.items()
        for unknown in fmu.description.outputs
        if any(v.causality == "input" for v in unknown.dependencies)
    ]
    return every, [name for name in every if name not in direct]


def test_a_container_of_the_toolbox_has_the_bits_of_its_parts(
    aso_ftc, packed, unpacked, parts, tmp_path, caplog
):
    caplog.set_level(logging.CRITICAL, "fmu_manipulation_toolbox")
    path = of_the_toolbox(packed, unpacked, tmp_path)
    table = run(aso_ftc, tmp_path, {"c": path}, STEP, STOP)
    expect_parts(table, parts, outputs(unpacked)[0])


def test_a_container_of_fmpy_has_the_bits_of_its_parts(aso_ftc, packed, unpacked, parts, tmp_path):
    """FMPy sets inputs of the next step before it reads outputs: directly dependent outputs are ahead."""
    path = of_fmpy(packed, tmp_path)
    every, held = outputs(unpacked)
    assert set(every) - set(held) == {"plant.f_fric"}
    table = run(aso_ftc, tmp_path, {"c": path}, STEP, STOP)
    expect_parts(table, parts, held)
    ahead = numbers(table, "c.plant.f_fric") != numbers(parts, "plant.f_fric")
    assert ahead.any()
