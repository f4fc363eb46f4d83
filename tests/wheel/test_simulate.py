"""One FMU: FMPy is the reference."""

from pathlib import Path

import aso_ftc as af
import numpy as np
import pytest

fmpy = pytest.importorskip("fmpy")


@pytest.fixture
def pendulum():
    return str(af.fmus()["FrictionPendulum"])


def test_the_description_is_that_of_fmpy():
    for path in af.fmus().values():
        description, theirs = af.read_model_description(path), fmpy.read_model_description(str(path))
        assert (description.model_name, description.guid, description.fmi_version) == (
            theirs.modelName,
            theirs.guid,
            theirs.fmiVersion,
        )
        assert description.model_identifier == theirs.coSimulation.modelIdentifier
        assert description.capabilities["canGetAndSetFMUstate"] == theirs.coSimulation.canGetAndSetFMUstate
        assert len(description.variables) == len(theirs.modelVariables)
        for variable, other in zip(description.variables, theirs.modelVariables):
            assert (variable.name, variable.value_reference) == (other.name, other.valueReference)
            assert (variable.type, variable.causality) == (other.type, other.causality)
            assert (variable.variability, variable.unit) == (other.variability, other.unit)
            assert variable.description == other.description
            if variable.type == "Real":
                start = None if other.start is None else float(other.start)
                assert variable.start == start, variable.name
        assert description[description.variables[3].name] is description.variables[3]


def test_the_identifier_of_scheduled_execution_alone_is_known(tmp_path):
    (tmp_path / "modelDescription.xml").write_text("""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Tasks" instantiationToken="t">
<ScheduledExecution modelIdentifier="tasks_3"/>
<ModelVariables><Clock name="tick" valueReference="1" causality="input" intervalVariability="triggered"/></ModelVariables>
<ModelStructure/>
</fmiModelDescription>
""")
    description = af.read_model_description(tmp_path)
    assert (description.interfaces, description.model_identifier) == (("scheduled-execution",), "tasks_3")


def columns(result):
    return {name: result[name] for name in result.dtype.names}


def test_outputs_and_values_are_those_of_fmpy(pendulum):
    values = {"x_p_0": 0.2, "F_c": 15.0}
    theirs = columns(
        fmpy.simulate_fmu(pendulum, stop_time=1.0, step_size=0.01, output_interval=0.01, start_values=values)
    )
    results = af.simulate(pendulum, stop_time=1.0, step=0.01, start_values=values)
    assert results.names == list(theirs)
    assert np.allclose(results.time, theirs["time"], rtol=0, atol=1e-12)
    for name in results.names[1:]:
        # FMPy adds up its times, so that the last bits of a step's length differ.
        assert np.allclose(results[name], theirs[name], rtol=1e-9, atol=1e-12), name


@pytest.mark.parametrize("form", ["array", "mapping", "pandas"])
def test_inputs_over_time_act_as_in_fmpy(pendulum, form):
    # A staircase: FMPy holds the input during a step, aso_ftc passes its slope on.
    time, force = np.array([0.0, 0.3, 0.3, 0.7, 0.7, 1.0]), np.array([5.0, 5.0, -4.0, -4.0, 2.0, 2.0])
    array = np.array(list(zip(time, force)), dtype=[("time", float), ("u", float)])
    inputs = {"array": array, "mapping": {"u": force, "time": list(time)}}
    if form == "pandas":
        inputs[form] = pytest.importorskip("pandas").DataFrame({"time": time, "u": force})
    options = {"stop_time": 1.0, "start_values": {"F_c": 1.0, "F_s": 1.5}}
    names = ["u", "x_p", "theta"]
    theirs = fmpy.simulate_fmu(
        pendulum,
        step_size=0.01,
        output_interval=0.01,
        input=array,
        output=names,
        **options,
    )
    results = af.simulate(pendulum, step=0.01, input=inputs[form], output=names, **options)
    for name in names[1:]:
        assert np.allclose(results[name], theirs[name], rtol=1e-9, atol=1e-12), name
    # A row has the input at its time; FMPy's rows have the one that the FMU got for the step before.
    assert np.allclose(results["u"][:-1], theirs["u"][1:], rtol=0, atol=1e-9)


def test_a_function_of_time_drives_inputs(pendulum):
    results = af.simulate(pendulum, stop_time=0.5, step=0.01, input=lambda t: {"u": 2.0 * t}, output=["u", "x_p"])
    assert np.array_equal(results["u"], 2.0 * results.time)
    # The same signal as a staircase: each value holds from its communication point to the next.
    system = af.System().add("p", pendulum)
    system.add_signal("p.u", steps=[[float(t), 2.0 * float(t)] for t in results.time])
    stairs = system.run(stop_time=0.5, step=0.01, record=["p.u", "p.x_p"])
    assert np.array_equal(results["x_p"], stairs["p.x_p"])
    with pytest.raises(af.ConfigurationError, match="no variable"):
        af.simulate(pendulum, input=lambda t: {"force": t})
    with pytest.raises(af.ConfigurationError, match="expected an input without a connection"):
        af.simulate(pendulum, input=lambda t: {"x_p": t})
    with pytest.raises(ZeroDivisionError):
        af.simulate(pendulum, input=lambda t: {"u": 1 / 0})
    with pytest.raises(TypeError, match="input: expected a dict of values at t = 0 s, found NoneType"):
        af.simulate(pendulum, input=lambda t: None)


def test_a_function_of_time_returns_a_dict_or_a_row_of_pandas(pendulum):
    pandas = pytest.importorskip("pandas")
    of_rows, of_dicts = (
        af.simulate(pendulum, stop_time=0.1, input=lambda t, kind=kind: kind({"u": 3.0 * t})) for kind in (pandas.Series, dict)
    )
    assert of_rows == of_dicts


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="Linux only")
def test_an_isolated_fmu_is_never_loaded_into_this_process(python):
    program = """
import aso_ftc as af
fmu = af.fmus()["FrictionPendulum"]
af.simulate(fmu, stop_time=0.01, isolate=True)
af.simulate(fmu, stop_time=0.01, isolate=True, input={"time": [0.0], "u": [1.0]})
print("FrictionPendulum.so" in open("/proc/self/maps").read())
af.simulate(fmu, stop_time=0.01)
print("FrictionPendulum.so" in open("/proc/self/maps").read())
"""
    done = python(program)
    assert done.stdout.split() == ["False", "True"], done.stderr


def test_wrong_inputs_are_refused(pendulum):
    for wrong, text in [
        ({"u": [1.0]}, 'a column "time"'),
        ({"time": [0.0], "v": [1.0]}, "no variable 'v'"),
        ({"time": [0.0, 1.0], "u": [1.0]}, "columns of one length"),
        (np.zeros((3, 2)), r"structured array.*found ndarray of the shape \(3, 2\)"),
    ]:
        with pytest.raises(af.ConfigurationError, match=text):
            af.simulate(pendulum, input=wrong)


def test_a_check_has_the_findings_of_the_command(pendulum):
    report = af.check(pendulum)
    assert report.ok and report.errors == 0 and len(report.findings) == report.warnings + report.notes
    assert "errors 0" in str(report)


def test_a_start_value_with_the_unit_of_its_variable_is_taken_and_another_unit_is_refused(pendulum):
    values = {"x_p_0": 0.2, "F_c": 15.0}
    results = af.simulate(pendulum, stop_time=0.1, start_values={"x_p_0": (0.2, "m"), "F_c": 15.0})
    assert results == af.simulate(pendulum, stop_time=0.1, start_values=values)
    with pytest.raises(af.ConfigurationError, match="start_values: expected F_c in N, found kN"):
        af.simulate(pendulum, start_values={"F_c": (0.025, "kN")})
    with pytest.raises(af.ConfigurationError, match="start_values: expected linearised in no unit, found s"):
        af.simulate(pendulum, start_values={"linearised": (True, "s")})
    with pytest.raises(af.ConfigurationError, match="no variable"):
        af.simulate(pendulum, start_values={"friction": (25.0, "N")})
