"""Arrays whose extents are structural parameters: exported by us, called through FMPy, run by our master."""

import csv
import math

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.validation import validate_fmu
from scipy.linalg import expm

MODEL = "examples/state-space"
# A system of order 3 with two inputs and two outputs.
A = np.array([[0.0, 1.0, 0.0], [-2.0, -0.5, 1.0], [0.0, 0.0, -3.0]])
B = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
C = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]])
D = np.array([[0.0, 0.5], [0.0, 0.0]])
U = np.array([1.0, -2.0])
X0 = np.array([0.3, 0.0, -1.0])


def exact(time, x0=X0):
    """Outputs at a time with constant inputs, by the exponential of the augmented matrix."""
    augmented = np.zeros((5, 5))
    augmented[:3, :3], augmented[:3, 3:] = A, B
    x = (expm(augmented * time) @ np.concatenate([x0, U]))[:3]
    return C @ x + D @ U


@pytest.fixture(scope="module")
def fmus(aso_ftc, root, tmp_path_factory):
    """The FMUs by version."""
    out = tmp_path_factory.mktemp("state-space")
    done = aso_ftc("pack", root / MODEL, "--fmi", "both", "--out", out)
    assert done.returncode == 0, done.stderr
    return {2: out / "StateSpace.fmu", 3: out / "StateSpace.fmi3.fmu"}


@pytest.fixture(scope="module")
def references(fmus):
    """Value references of FMI 3.0 by name."""
    description = fmpy.read_model_description(str(fmus[3]))
    return {variable.name: variable.valueReference for variable in description.modelVariables}


def instance(kind, fmus):
    """An instance of FMI 3.0."""
    description = fmpy.read_model_description(str(fmus[3]))
    folder = fmpy.extract(str(fmus[3]))
    fmu = kind(guid=description.guid, unzipDirectory=folder, modelIdentifier="StateSpace", instanceName="system")
    fmu.instantiate()
    return fmu


def resize(fmu, references, n, m, p):
    """Sets the extents in configuration mode or in reconfiguration mode."""
    fmu.enterConfigurationMode()
    fmu.setUInt64([references[name] for name in "nmp"], [n, m, p])
    fmu.exitConfigurationMode()


def fill(fmu, references, **more):
    """Sets all matrices and the inputs."""
    for name, values in ({"A": A, "B": B, "C": C, "D": D, "u": U} | more).items():
        fmu.setFloat64([references[name]], values.flatten().tolist())


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_fmpy_simulates_the_extents_of_the_description_in_both_versions(fmus, version, interface):
    fmu = str(fmus[version])
    assert validate_fmu(fmu) == []
    output = "y" if version == 3 else "y[1]"
    result = fmpy.simulate_fmu(
        fmu, stop_time=3, output_interval=0.1, fmi_type=interface, output=[output], relative_tolerance=1e-9
    )
    assert np.ravel(result[output])[-1] == pytest.approx(math.cos(3), abs=1e-5)


def test_after_configuration_mode_the_arrays_have_the_new_extents(fmus, references):
    fmu = instance(FMU3Slave, fmus)
    resize(fmu, references, 3, 2, 2)
    fill(fmu, references, x=X0)
    assert list(fmu.getFloat64([references["A"]], 9)) == A.flatten().tolist()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(currentCommunicationPoint=0, communicationStepSize=2)
    y = list(fmu.getFloat64([references["y"]], 2))
    assert y == pytest.approx(exact(2).tolist(), abs=1e-6)
    fmu.terminate()
    fmu.freeInstance()


def test_in_reconfiguration_mode_the_arrays_change_between_two_steps(fmus, references):
    fmu = instance(FMU3Slave, fmus)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(currentCommunicationPoint=0, communicationStepSize=1)
    state = fmu.getFMUState()
    resize(fmu, references, 3, 2, 2)
    fill(fmu, references)
    fmu.doStep(currentCommunicationPoint=1, communicationStepSize=2)
    # The states of the oscillator at 1 s stay, and the new one is zero.
    expected = exact(2, [math.cos(1), -math.sin(1), 0.0])
    assert list(fmu.getFloat64([references["y"]], 2)) == pytest.approx(expected.tolist(), abs=1e-5)
    # The saved state has the extents of before.
    fmu.setFMUState(state)
    assert list(fmu.getFloat64([references["y"]], 1)) == pytest.approx([math.cos(1)], abs=1e-5)
    fmu.freeFMUState(state)
    fmu.reset()
    resize(fmu, references, 1, 1, 1)
    assert list(fmu.getFloat64([references["A"]], 1)) == [0.0]
    fmu.freeInstance()


def test_in_model_exchange_the_number_of_states_follows(fmus, references):
    fmu = instance(FMU3Model, fmus)
    resize(fmu, references, 3, 2, 2)
    assert fmu.getNumberOfContinuousStates() == 3
    fill(fmu, references, x=X0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.enterContinuousTimeMode()
    assert list(fmu.getFloat64([references["der(x)"]], 3)) == pytest.approx((A @ X0 + B @ U).tolist())
    fmu.terminate()
    fmu.freeInstance()


def test_our_master_sets_the_extents_and_gets_the_exact_solution(fmus, aso_ftc, tmp_path):
    settings = []
    for name, values in {"n": [3], "m": [2], "p": [2], "A": A, "B": B, "C": C, "D": D, "u": U, "x": X0}.items():
        settings += ["--set", f"s.{name}=" + " ".join(f"{value}" for value in np.array(values).ravel().tolist())]
    run = ["run", "--fmu", f"s={fmus[3]}", "--stop-time", "2", "--step", "0.1"]
    done = aso_ftc(*run, *settings, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "results.csv", newline="") as file:
        last = list(csv.DictReader(file))[-1]
    outputs = [float(last[f"s.y[{k}]"]) for k in (1, 2)]
    assert outputs == pytest.approx(exact(2).tolist(), abs=1e-5)


def test_an_extent_out_of_range_or_outside_of_configuration_mode_is_refused(fmus, references, aso_ftc, tmp_path):
    fmu = instance(FMU3Slave, fmus)
    with pytest.raises(Exception, match="setUInt64|fmi3SetUInt64"):
        fmu.setUInt64([references["n"]], [3])
    fmu.freeInstance()
    run = ["run", "--fmu", f"s={fmus[3]}", "--stop-time", "1", "--step", "0.1", "--out", tmp_path]
    for value in ("0", "101"):
        done = aso_ftc(*run, "--set", f"s.n={value}")
        assert done.returncode == 2 and "s.n" in done.stderr, done.stderr


def test_a_connection_of_a_whole_array_replaces_those_of_its_elements_in_the_file(fmus, aso_ftc, tmp_path):
    system = "[fmus]\n" + "".join(f'{name} = "{fmus[3].as_posix()}"\n' for name in "abc")

    def run(ends, *more):
        file = tmp_path / "system.toml"
        file.write_text(system + "[[connections]]\nfrom = '{}'\nto = '{}'\n".format(*ends))
        done = aso_ftc("run", file, *more, "--stop-time", "1", "--set", "c.x=5 0", "--out", tmp_path / "out")
        return done, done.returncode == 0 and (tmp_path / "out" / "results.csv").read_bytes()

    _, whole = run(("a.y", "b.u"))
    done, replaced = run(("c.y[1]", "b.u[1]"), "--connect", "a.y=b.u")
    assert whole and whole == replaced, done
    done, _ = run(("a.y", "b.u"), "--connect", "c.y[1]=b.u[1]")
    assert done.returncode == 2 and "the file connects all of b.u" in done.stderr, done
