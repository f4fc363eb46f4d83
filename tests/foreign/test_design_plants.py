"""Plant files whose names only the FMU refused, and FMUs that need a library, a step, or a cart without friction."""

import json
import os
import sys
import zipfile

import numpy as np
import pytest
from fmpy import read_model_description
from pythonfmu import FmuBuilder

from build import linearised_pendulum
from conftest import ROOT
from design_loop import packed_plant
from design_oracle import WITHOUT_PROOFS
from test_design_refusals import NO_DERIVATIVES, NO_EXCHANGE, SERVO, poorer
from test_swap import shared_python

HERE = ROOT / "tests" / "foreign"
MASS = """A = [[0, 1], [0, 0]]
B = [[0], [1]]
C = [[1, 0]]
measurements = ["y"]
feedback.eigenvalues = [-1, -2]
robustness.cases = 0
"""
FAULT = 'actuator_faults = "all"\nobserver.eigenvalues = [-5, -6, -7]\n'
# Further entries, each with variables of its own.
VARIANTS = {
    "plain": FAULT,
    "sampled": FAULT + 'sample_time = 0.01\nactuators = [{ name = "u", limits = [-5, 5], operating = 1 }]\n',
    "ramp": 'faults = [{ name = "f", actuator = "u1", kind = "ramp" }]\nobserver.eigenvalues = [-5, -6, -7, -8]\n',
    "filtered": 'filter = 50\nfaults = [{ name = "b", sensor = "y" }]\nobserver.region = { decay = 1 }\n',
    "loss": 'faults = [{ name = "f", loss_of = "u1", least_command = 0.1 }]\nobserver.region = { decay = 1 }\n',
}


def variables(aso_ftc, folder, text):
    """The names of the variables of the controller FMU, or None if the file is refused before."""
    file, fmu = folder / "plant.toml", folder / "Made.fmu"
    file.write_text(text, encoding="utf-8")
    done = aso_ftc("design", file, "--out", folder / "design.toml", "--fmu", fmu, "--force", *WITHOUT_PROOFS)
    if done.returncode == 2:
        assert "the controller FMU has a variable" in done.stderr or "stands apart" in done.stderr, (
            done.stderr
        )
        assert "plant.toml:4:17:" in done.stderr, done.stderr
        return None
    assert done.returncode in (0, 1), done.stderr
    return [variable.name for variable in read_model_description(str(fmu)).modelVariables]


@pytest.mark.parametrize("variant", VARIANTS)
def test_exactly_the_names_of_the_controllers_own_variables_are_refused(aso_ftc, tmp_path, variant):
    text = MASS + VARIANTS[variant]
    if variant == "filtered":
        # The position of a mass without a spring hides the offset of its sensor.
        text = text.replace("[0, 0]]", "[-2, -1]]")
    reserved = variables(aso_ftc, tmp_path, text)
    if reserved is None:
        pytest.fail("the plant file itself is refused")
    actuator = "u" if variant == "sampled" else "u1"
    named = lambda name: text.replace('["y"]', json.dumps([name])).replace(
        'sensor = "y"', f"sensor = {json.dumps(name)}"
    )
    arrays = {}
    for name in set(reserved) - {"y", actuator}:
        arrays.setdefault(name.partition("[")[0], name)
    for name in arrays.values():
        assert variables(aso_ftc, tmp_path, named(name)) is None, name
    free = {
        "A",
        "K_x",
        "E_hat",
        "y_f",
        "filter",
        "T_s",
        "u_max",
        "u_min",
        "x_op",
        "A_f",
        "x_hat",
        "der(y)",
    } - set(reserved)
    for name in free:
        names = variables(aso_ftc, tmp_path, named(name))
        assert names is not None and name in names, name


def test_a_cart_without_friction_is_linearised_as_one_that_nothing_holds(aso_ftc, tmp_path):
    text = f"""plant = "{ROOT}/dist/FrictionPendulum.fmu"
operating_point = {{ x_p_0 = 0, theta_0 = 0, F_c = 0, F_s = 0 }}
actuators = ["u"]
measurements = ["x_p", "theta"]
actuator_faults = "all"
feedback.eigenvalues = [-4.5, -6.0, -7.5, -9.0]
observer.eigenvalues = [-30, -33, -36, -39, -42]
"""
    (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "d.toml", "--json", *WITHOUT_PROOFS)
    assert done.returncode in (0, 1), done.stderr
    report = json.loads(done.stdout)
    matrices = {matrix["name"]: np.array(matrix["values"]) for matrix in report["plant"]["matrices"]}
    a, b = linearised_pendulum()
    # The expected values are differences, with a step of 1e-6.
    assert matrices["A"] == pytest.approx(a, abs=1e-7) and matrices["B"] == pytest.approx(b, abs=1e-8)
    assert matrices["B"][:, 0] == pytest.approx([0, 0, 0.3205, -1.0095], abs=5e-5)


@pytest.fixture(scope="module")
def cart(tmp_path_factory):
    """CartPendulum.fmu of PythonFMU with FMU states; it states no experiment."""
    folder = tmp_path_factory.mktemp("cart")
    fmu = FmuBuilder.build_FMU(HERE / "cart_pendulum.py", dest=folder, canGetAndSetFMUstate=True)
    with zipfile.ZipFile(fmu) as archive:
        assert "DefaultExperiment" not in archive.read("modelDescription.xml").decode()
    return fmu


CART = """plant = "PLANT"
actuators = ["u"]
measurements = ["x_p", "theta"]
states = ["x_p", "theta", "v_p", "omega"]
operating_point = { x_p = 0, theta = 0 }
actuator_faults = "all"
feedback.eigenvalues = [-4.5, -6.0, -7.5, -9.0]
observer.eigenvalues = [-30, -33, -36, -39, -42]
"""


@pytest.mark.parametrize("how", ["option", "entry", "step"])
def test_an_fmu_that_needs_python_and_states_no_step_is_designed_for(aso_ftc, tmp_path, cart, how):
    library = shared_python()
    if library is None:
        pytest.skip("this machine has no shared libpython")
    text = CART.replace("PLANT", str(cart))
    options = ["--preload", library] if how == "option" else []
    text += "" if how == "option" else f"preload = {json.dumps([library])}\n"
    text += "linearisation_step = 0.01\n" if how == "step" else ""
    # TOML: entries after the dotted ones are top-level entries, too.
    (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
    environment = {**os.environ, "PYTHONHOME": sys.base_prefix}
    done = aso_ftc(
        "design", tmp_path / "plant.toml", "--out", tmp_path / "d.toml", "--json", *options, env=environment
    )
    assert done.returncode in (0, 1), done.stderr
    report = json.loads(done.stdout)
    matrices = {matrix["name"]: np.array(matrix["values"]) for matrix in report["plant"]["matrices"]}
    a, b = linearised_pendulum()
    assert matrices["A"] == pytest.approx(a, abs=1e-6) and matrices["B"] == pytest.approx(b, abs=1e-7)


def test_an_fmu_whose_library_is_missing_names_the_option_and_one_that_fails_to_load_its_line(
    aso_ftc, tmp_path, cart
):
    if shared_python() is None:
        pytest.skip("this machine has no shared libpython")
    (tmp_path / "plant.toml").write_text(CART.replace("PLANT", str(cart)), encoding="utf-8")
    nowhere = {**os.environ, "PATH": str(tmp_path)}
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "d.toml", env=nowhere)
    assert done.returncode == 2 and "plant.toml:1:9: " in done.stderr and "--preload" in done.stderr
    text = CART.replace("PLANT", str(cart)) + 'preload = "libnothing.so"\n'
    (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "d.toml")
    assert done.returncode == 2 and "plant.toml:9:11: " in done.stderr and "libnothing.so" in done.stderr


def test_an_fmu_without_a_step_is_linearised_like_one_with_a_step(aso_ftc, tmp_path):
    """DcServo by steps, with and without its stepSize; held by friction no step gives a result."""
    matrices = []
    for step in ((), ((r' stepSize="[^"]*"', ""),)):
        changes = (NO_EXCHANGE, NO_DERIVATIVES, *step)
        poorer(packed_plant(aso_ftc, "DcServo"), tmp_path / "Servo.fmu", *changes)
        text = 'states = ["theta", "omega"]\n' + SERVO
        (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
        done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "d.toml", "--json", *WITHOUT_PROOFS)
        assert done.returncode == 0, done.stderr
        matrices.append(json.loads(done.stdout)["plant"]["matrices"])
    for one, other in zip(*matrices, strict=True):
        assert np.array(one["values"]) == pytest.approx(np.array(other["values"]), rel=1e-9, abs=1e-9)
    (tmp_path / "plant.toml").write_text(text.replace("friction = 0", "friction = 1"), encoding="utf-8")
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "d.toml")
    assert done.returncode == 2 and "plant.toml:2:9: " in done.stderr
    assert (
        "states no stepSize in its DefaultExperiment" in done.stderr and "`linearisation_step`" in done.stderr
    )
