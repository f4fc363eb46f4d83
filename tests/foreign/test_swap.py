"""Plant and controller, each replaced by an FMU that PythonFMU exported.

The library of PythonFMU 0.7 uses some 45 symbols of Python and does not say which library has
them: they must be in the process already. So the command, which has no Python, loads libpython first.
"""

import csv
import os
import sys
import sysconfig
from ctypes.util import find_library
from pathlib import Path

import numpy as np
import pytest

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def foreign(python, tmp_path_factory):
    """Folder with LqrController.fmu and CartPendulum.fmu."""
    folder = tmp_path_factory.mktemp("foreign")
    done = python(HERE / "build.py", folder)
    assert done.returncode == 0, done.stderr
    return folder


def shared_python():
    """The shared library of this Python; None if it was built without one and none is installed."""
    names = sysconfig.get_config_vars("LIBDIR", "INSTSONAME")
    beside = Path(*filter(None, names))
    if ".so" in beside.name and beside.is_file():
        return str(beside)
    return find_library(f"python{sys.version_info.major}.{sys.version_info.minor}")


@pytest.fixture(scope="module")
def preload():
    """The option that loads libpython."""
    library = shared_python()
    if library is None:
        pytest.skip(
            "this machine has no shared libpython: FMUs of PythonFMU can run in Python only"
        )
    return ["--preload", library]


@pytest.fixture
def run(aso_ftc, packed, tmp_path):
    """Runs `aso-ftc run` for 20 s, by default with our FMUs; returns the columns of results.csv."""

    def simulate(*options, plant=packed["plant"], controller=packed["controller"], status=0):
        # An embedded Python searches its modules beside the first python3 in PATH.
        environment = {**os.environ, "PYTHONHOME": sys.base_prefix}
        done = aso_ftc(
            "run",
            "--plant",
            plant,
            "--controller",
            controller,
            "--stop-time",
            20,
            "--out",
            tmp_path / "out",
            *options,
            env=environment,
        )
        assert done.returncode == status, done.stderr
        if status:
            return done.stderr
        path = tmp_path / "out" / "results.csv"
        names = next(csv.reader(path.read_text(encoding="utf-8").splitlines()))
        return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1).T))

    return simulate


def test_a_regulator_of_pythonfmu_holds_the_friction_pendulum_upright(run, foreign, preload):
    controller = foreign / "LqrController.fmu"
    table = run(*preload, controller=controller)
    assert table["time"][-1] == pytest.approx(20)
    assert abs(table["plant.theta"]).max() < 0.15 and abs(table["plant.x_p"]).max() < 0.2
    assert {-1, 0, 1} == set(table["plant.regime"]), "the cart sticks and slips all the time"
    off = [part for k in range(1, 5) for part in ("--set", f"controller.k{k}=0")]
    assert abs(run(*preload, *off, controller=controller)["plant.theta"]).max() > 1.5


def test_the_aso_controller_brings_a_pendulum_of_pythonfmu_to_rest(run, foreign, preload):
    table = run(*preload, "--set", "controller.t_on=2", plant=foreign / "CartPendulum.fmu")
    assert table["plant.theta"][0] == -0.1 and table["plant.x_p"][0] == 0.1
    end = table["time"] > 15
    for name in ("plant.x_p", "plant.theta", "plant.u"):
        assert abs(table[name]).max() > 1e-2 and abs(table[name][end]).max() < 1e-6, name
    assert abs(table["controller.f_hat"][end]).max() < 1e-6, "there is no friction to estimate"


def test_a_missing_library_to_preload_is_refused_by_name_and_reason(run):
    message = run("--preload", "libnowhere.so.7", status=2)
    assert "libnowhere.so.7" in message
    assert "No such file" in message or "cannot open shared object" in message
