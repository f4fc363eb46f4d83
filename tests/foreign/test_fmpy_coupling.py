"""The two FMUs coupled by FMPy: final state and residual equal those of our master."""

import csv
import json

import numpy as np
import pytest

DIFFERENCE = "plant.f_fric=controller.f_hat"
PAPER = {"step": "0.001", "stop": "100", "settings": []}
EARLY = {"step": "0.0001", "stop": "2", "settings": ["controller.t_on=0.5"]}
OTHER = {
    "step": "0.001",
    "stop": "32",
    "settings": ["controller.t_on=8", "plant.F_c=20", "controller.f_hat_0=3"],
}


def by_fmpy(scenario, python, root, packed):
    """The summary that the FMPy script prints."""
    settings = [part for setting in scenario["settings"] for part in ("--set", setting)]
    done = python(
        root / "scripts" / "reference" / "couple_with_fmpy.py",
        "--step",
        scenario["step"],
        "--stop-time",
        scenario["stop"],
        "--plant",
        packed["plant"],
        "--controller",
        packed["controller"],
        "--compare",
        DIFFERENCE,
        *settings,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def by_rust(scenario, aso_ftc, packed, folder):
    """Every communication point of our master, as a table with named columns."""
    settings = [part for setting in scenario["settings"] for part in ("--set", setting)]
    done = aso_ftc(
        "run",
        "--step",
        scenario["step"],
        "--stop-time",
        scenario["stop"],
        "--record-every",
        scenario["step"],
        "--plant",
        packed["plant"],
        "--controller",
        packed["controller"],
        "--out",
        folder,
        *settings,
    )
    assert done.returncode == 0, done.stderr
    path = folder / "results.csv"
    names = next(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    return dict(zip(names, table.T))


def residual(table, t_on):
    """Half of the peak-to-peak values of position and angle, and the rms of the estimation error.

    Over the second half of the time with compensation, as in scripts/reference/couple_with_fmpy.py.
    """
    settled = table["time"] > (t_on + table["time"][-1]) / 2
    x_p, theta = table["plant.x_p"][settled], table["plant.theta"][settled]
    error = table["plant.f_fric"][settled] - table["controller.f_hat"][settled]
    return np.ptp(x_p) / 2, np.ptp(theta) / 2, np.sqrt(np.mean(error**2))


@pytest.mark.parametrize(
    ("scenario", "t_on"),
    [(PAPER, 40.0), (EARLY, 0.5), (OTHER, 8.0)],
    ids=["paper", "early", "other"],
)
def test_fmpy_and_our_master_agree_in_final_state_and_residual(
    scenario, t_on, python, root, packed, aso_ftc, tmp_path
):
    mine = by_fmpy(scenario, python, root, packed)
    table = by_rust(scenario, aso_ftc, packed, tmp_path)
    assert len(table["time"]) == round(float(scenario["stop"]) / float(scenario["step"])) + 1
    for name, value in mine["final"].items():
        assert table[name][-1] == pytest.approx(value, rel=1e-9, abs=0), name
    expected = [*mine["residual"].values(), mine["rms"][DIFFERENCE]]
    assert residual(table, t_on) == pytest.approx(expected, rel=1e-9, abs=0)
