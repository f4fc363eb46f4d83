"""`OspSystemStructure.xml` in `aso-ftc run` and in libcosim: functions, variable groups, steps."""

import csv

import numpy as np
import pytest
from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver

from held_loop import real_outputs

COUNT, STEP = 400, 1e-3
ROLES = {"first": "plant", "second": "plant", "controller": "controller"}

# The controller gets the sum of the positions and angles of both plants. One plant gets its command
# with a factor and an offset, the other the sum of the command and of the first one's position.
SYSTEM = """<?xml version="1.0" encoding="UTF-8"?>
<OspSystemStructure xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure" version="0.1">
  <StartTime>0.0</StartTime>
  <BaseStepSize>0.001</BaseStepSize>
  <Algorithm>fixedStep</Algorithm>
  <Simulators>
    <Simulator name="first" source="{plant}">
      <InitialValues><InitialValue variable="theta_0"><Real value="0.02"/></InitialValue></InitialValues>
    </Simulator>
    <Simulator name="second" source="{plant}" stepSize="{second}">
      <InitialValues>
        <InitialValue variable="theta_0"><Real value="0.01"/></InitialValue>
        <InitialValue variable="linearised"><Boolean value="true"/></InitialValue>
      </InitialValues>
    </Simulator>
    <Simulator name="controller" source="{controller}"/>
  </Simulators>
  <Functions>
    <LinearTransformation name="part" factor="0.6" offset="0.125"/>
    <Sum name="force" inputCount="2"/>
    <VectorSum name="position" inputCount="2" dimension="2"/>
  </Functions>
  <Connections>
    <SignalGroupConnection>
      <SignalGroup function="position" name="in[0]"/><VariableGroup simulator="first" name="pose"/>
    </SignalGroupConnection>
    <SignalGroupConnection>
      <SignalGroup function="position" name="in[1]"/><VariableGroup simulator="second" name="pose"/>
    </SignalGroupConnection>
    <SignalGroupConnection>
      <SignalGroup function="position" name="out"/><VariableGroup simulator="controller" name="pose"/>
    </SignalGroupConnection>
    <SignalConnection>
      <Variable simulator="controller" name="u"/><Signal function="part" name="in"/>
    </SignalConnection>
    <SignalConnection>
      <Signal function="part" name="out"/><Variable simulator="first" name="u"/>
    </SignalConnection>
    <SignalConnection>
      <Variable simulator="controller" name="u"/><Signal function="force" name="in[0]"/>
    </SignalConnection>
    <SignalConnection>
      <Variable simulator="first" name="x_p"/><Signal function="force" name="in[1]"/>
    </SignalConnection>
    <SignalConnection>
      <Signal function="force" name="out"/><Variable simulator="second" name="u"/>
    </SignalConnection>
  </Connections>
</OspSystemStructure>
"""

GROUPS = """<?xml version="1.0" encoding="UTF-8"?>
<OspModelDescription xmlns="https://open-simulation-platform.com/OspModelDescription/1.0.0" version="1.0">
  <VariableGroups><Generic name="pose"><Variable ref="x_p"/><Variable ref="theta"/></Generic></VariableGroups>
</OspModelDescription>
"""


def columns(unpacked):
    """Every Real output: (simulator, variable, value reference)."""
    for name, role in ROLES.items():
        fmu = unpacked[role]
        for output in real_outputs(fmu.description):
            yield name, output, fmu.variables[output].valueReference


def by_libcosim(path, places):
    """The values after each step, identical in two successive runs.

    libcosim steps in threads, and occasionally one run differs from all others.
    """
    runs = [once_by_libcosim(path, places)]
    for _ in range(5):
        runs.append(once_by_libcosim(path, places))
        if all(np.array_equal(one, other) for one, other in zip(*runs[-2:])):
            return runs[-1]
    raise AssertionError("libcosim never repeats its values")


def once_by_libcosim(path, places):
    """The values after each step of one run."""
    execution = CosimExecution.from_osp_config_file(str(path))
    index = {info.name.decode(): info.index for info in execution.slave_infos()}
    observer = CosimObserver.create_time_series(COUNT + 1)
    assert execution.add_observer(observer)
    for name, _, reference in places:
        assert observer.start_time_series(index[name], reference, CosimVariableType.REAL)
    assert execution.step(COUNT)
    series = [
        observer.time_series_real_samples(index[name], reference, from_step=1, sample_count=COUNT)
        for name, _, reference in places
    ]
    return [np.array(each[2]) for each in series]


@pytest.mark.parametrize("second", [0.001, 0.002])
def test_functions_and_groups_give_the_values_of_libcosim(
    aso_ftc, packed, unpacked, tmp_path, second
):
    path = tmp_path / "OspSystemStructure.xml"
    text = SYSTEM.format(plant=packed["plant"], controller=packed["controller"], second=second)
    path.write_text(text.replace('source="/', 'source="file:///'), encoding="utf-8")
    for role in ("plant", "controller"):
        model = unpacked[role].description.modelName
        groups = tmp_path / f"{model}_OspModelDescription.xml"
        groups.write_text(GROUPS, encoding="utf-8")
    places = list(columns(unpacked))
    expected = by_libcosim(path, places)
    out = tmp_path / "out"
    done = aso_ftc("run", tmp_path, "--stop-time", COUNT * STEP, "--out", out)
    assert done.returncode == 0, done.stderr
    with open(out / "results.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))[1:]
    assert len(rows) == COUNT
    for (name, output, _), values in zip(places, expected, strict=True):
        samples = np.array([float(row[f"{name}.{output}"]) for row in rows])
        # The slower plant has new values only at the end of each of its own steps.
        each = round(second / STEP) if name == "second" else 1
        at_ends = samples[each - 1 :: each]
        # libcosim's times are whole nanoseconds, ours multiples of the step.
        limit = 1e-9 * np.abs(values).max()
        message = f"{name}.{output}"
        np.testing.assert_allclose(at_ends, values, rtol=0, atol=limit, err_msg=message)
    assert np.abs(expected[0]).max() > 0.0
