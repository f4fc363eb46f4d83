"""The examples of this workspace, each alone in our master: the bits equal those of FMPy's fmi2DoStep."""

import numpy as np
import pytest
from fmpy import read_model_description

from any_fmu import numbers, run, stepped
from conftest import EXAMPLES

STEP, COUNT = 2.0**-7, 384  # s; three seconds
# One input of each FMU that has inputs, so that its outputs move.
DRIVEN = {
    "Pid": {"w": 1.0, "mode": 2},
    "LookupTable": {"speed": 90.0},
    "ThreeTank": {"Q_1": 1e-4},
    "DcServo": {"u": 6.0},
}


def driven(model, variables):
    """Settings of an example: the inputs of DRIVEN that it has."""
    return {name: value for name, value in DRIVEN.get(model, {}).items() if name in variables}


@pytest.mark.parametrize("model", EXAMPLES.values())
def test_an_example_alone_has_the_bits_of_fmpy(aso_ftc, examples, model, tmp_path):
    description = read_model_description(str(examples[model]))
    variables = {variable.name: variable for variable in description.modelVariables}
    settings = driven(model, variables)
    assert bool(settings) == (model in DRIVEN), "an input of DRIVEN is there"
    outputs = [
        name for name, v in variables.items() if v.causality == "output" and v.type == "Real"
    ]
    sets = [part for name, value in settings.items() for part in ("--set", f"m.{name}={value}")]
    table = run(aso_ftc, tmp_path, {"m": examples[model]}, STEP, STEP * COUNT, *sets)
    expected = stepped(examples[model], tmp_path / "fmu", STEP, COUNT, outputs, settings)
    assert np.array_equal(numbers(table, "time"), np.arange(COUNT + 1) * STEP)
    assert outputs and expected[1:].any(), "something happens"
    for name, column in zip(outputs, expected.T):
        assert np.array_equal(numbers(table, f"m.{name}"), column), name
