"""Linearisation of an FMU of PythonFMU: co-simulation only, over its FMU states.

Oracle: differences of the equations themselves (build.py).
"""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from pythonfmu import FmuBuilder

from build import linearised_pendulum
from test_swap import shared_python

HERE = Path(__file__).parent
STATES = "x_p,theta,v_p,omega"
UPRIGHT = ["at.x_p=0", "at.theta=0"]


@pytest.fixture(scope="module")
def cart_pendulum(tmp_path_factory):
    """CartPendulum.fmu with FMU states."""
    folder = tmp_path_factory.mktemp("states")
    script = HERE / "cart_pendulum.py"
    return FmuBuilder.build_FMU(script, dest=folder, canGetAndSetFMUstate=True)


@pytest.fixture
def linearise(root):
    """Runs the example `linearise` of the crate; returns its output, or its error message."""
    library = shared_python()
    if library is None:
        pytest.skip("this machine has no shared libpython")

    def run(fmu, *arguments, status=0):
        command = [root / "target" / "release" / "examples" / "linearise", fmu]
        command += [f"preload={library}", *arguments]
        environment = {**os.environ, "PYTHONHOME": sys.base_prefix}
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        assert done.returncode == status, done.stderr
        return done.stderr if status else tomllib.loads(done.stdout)

    return run


def test_a_cart_pendulum_of_pythonfmu_is_linearised_over_its_fmu_states(linearise, cart_pendulum):
    arguments = ["inputs=u", "outputs=x_p,theta", f"states={STATES}", "step=0.01", *UPRIGHT]
    model = linearise(cart_pendulum, *arguments)
    a, b = linearised_pendulum()
    expected = np.hstack([a, b])
    size = abs(expected).max(axis=1, keepdims=True)
    # The expected values are themselves differences, with a step of 1e-6.
    assert (abs(np.hstack([model["A"], model["B"]]) - expected) < 1e-8 * size).all(), model
    assert model["relative_error"] < 1e-8
    assert (np.array(model["C"]) == np.eye(4)[:2]).all()
    assert abs(np.array(model["D"])).max() == 0
    assert model["residual"] < 1e-6
    assert model["x_0"] == dict.fromkeys(STATES.split(","), 0.0)
    assert "over FMU states in co-simulation" in model["method"]


def test_without_names_for_the_states_the_error_lists_candidates(linearise, cart_pendulum):
    message = linearise(cart_pendulum, "inputs=u", "outputs=x_p", "step=0.01", status=1)
    assert "name the variables that are its states among x_p, theta, v_p, omega" in message


def test_without_fmu_states_the_error_says_so(linearise, tmp_path):
    fmu = FmuBuilder.build_FMU(HERE / "cart_pendulum.py", dest=tmp_path)
    message = linearise(fmu, "inputs=u", "outputs=x_p", f"states={STATES}", status=1)
    assert "canGetAndSetFMUstate" in message and "providesDirectionalDerivative" in message
