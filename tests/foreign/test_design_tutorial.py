"""docs/tutorials/controller.md: its commands run and give its numbers."""

import json
import re
import sys

import numpy as np
import pytest

from conftest import ROOT
from design_loop import Designed, changed, coupled, packed_plant
from design_oracle import WITHOUT_PROOFS

TEXT = (ROOT / "docs" / "tutorials" / "controller.md").read_text(encoding="utf-8")
COMMANDS = "".join(re.findall(r"^```sh\n(.*?)^```$", TEXT, flags=re.MULTILINE | re.DOTALL)).splitlines()


def table(path):
    """The columns of a CSV file."""
    names = path.read_text(encoding="utf-8").split("\n", 1)[0].split(",")
    return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1).T))


def row(name):
    """The numbers of a row of the table."""
    (cells,) = re.findall(rf"^\| {re.escape(name)} \| (.*) \| (.*) \|$", TEXT, flags=re.MULTILINE)
    return [float(cell.split()[0]) if cell != "never" else None for cell in cells]


@pytest.fixture(scope="module")
def runs(aso_ftc, python, tmp_path_factory):
    """The output of both runs of the tutorial, by name, and the report of the design."""
    packed_plant(aso_ftc, "DcServo")
    results = tmp_path_factory.mktemp("results")
    tables, report = {}, None
    for command in COMMANDS[3:7]:
        program, arguments = command.split(" ", 1)
        arguments = arguments.replace("results/servo", str(results)).split()
        if program == "aso-ftc":
            done = aso_ftc(*arguments, "--json")
            report = done.stdout
        else:
            assert program == "python"
            done = python(*arguments, cwd=ROOT)
        assert done.returncode == 0, done.stderr
    for path in results.glob("*.csv"):
        tables[path.stem] = table(path)
    return tables, json.loads(report)


def test_the_commands_of_the_page_are_those_run_here():
    assert len(COMMANDS) == 8 and sys.version_info >= (3, 11)
    assert COMMANDS[:3] == ["aso-ftc pack", "aso-ftc pack examples/dc-servo", "python -m pip install fmpy"]


def test_the_plant_file_of_the_page_is_that_of_the_example_and_below_ten_lines():
    (block,) = re.findall(r"```toml\n(.*?)```", TEXT, flags=re.DOTALL)
    assert block == (ROOT / "examples/dc-servo/plant.toml").read_text(encoding="utf-8")
    assert len(block.splitlines()) == 7


def test_the_table_of_the_page_has_the_results(runs):
    both = [runs[0][name] for name in ("compensated", "uncompensated")]
    largest = [abs(columns["plant.theta"]).max() for columns in both]
    assert row("largest angle") == pytest.approx(largest, abs=5.1e-5)
    final = [columns["plant.theta"][-1] for columns in both]
    assert row("angle at 0.5 s") == pytest.approx(final, abs=5.1e-5)
    final = [columns["controller.f_hat"][-1] for columns in both]
    assert row("`f_hat` at 0.5 s") == pytest.approx(final, abs=5.1e-5)
    outside = np.flatnonzero(abs(both[0]["plant.theta"]) > 1e-3)[-1]
    assert row("below 1 mrad from")[0] == pytest.approx(both[0]["time"][outside + 1], abs=1e-9)
    friction = -both[0]["plant.T_f"][-1] * 4.0 / 0.0274
    assert f"friction, which takes {friction:.4f} V" in TEXT
    assert final[0] == pytest.approx(3 + friction, abs=1e-4)


def test_the_text_repeats_the_numbers_of_the_report(runs):
    report = runs[1]
    (k_x,) = next(gain["values"] for gain in report["gains"] if gain["name"] == "K_x")
    assert f"K_x = [{k_x[0]:.4f}, {k_x[1]:.6f}]" in TEXT
    slow, fast = sorted((re for re, _ in report["plant"]["eigenvalues"]), key=abs)
    assert abs(slow) < 1e-9 and f"0 and {fast:.1f}" in TEXT
    curves = {curve["name"]: curve for curve in report["steps"][0]["curves"]}
    assert f"turns by up to {curves['theta']['peak']:.4f} rad" in TEXT
    assert f"2 % after {curves['error of f_u']['settling_time']:.4f} s" in TEXT
    bounds = {bound["error"]: bound["gain_of_rate"] for bound in report["bounds"]}
    assert f"at most {bounds['error of f_u']:.4f} V" in TEXT


def test_without_the_operating_point_the_error_is_the_one_shown(aso_ftc, tmp_path):
    change = ("operating_point = { friction = 0 }\n", "")
    file = changed("examples/dc-servo/plant.toml", tmp_path, change)
    done = aso_ftc("design", file, "--out", tmp_path / "design.toml")
    (shown,) = re.findall(r"`(plant\.toml:.*)`", TEXT)
    assert done.returncode == 2 and shown in done.stderr


def test_the_error_of_the_constant_model_is_the_one_shown(aso_ftc, python, tmp_path):
    designed = Designed(aso_ftc, "examples/dc-servo/plant.toml", tmp_path, WITHOUT_PROOFS)
    settings = {"plant.friction": "false", "plant.r_u": 10}
    table, _ = coupled(python, designed, packed_plant(aso_ftc, "DcServo"), settings)
    error = 10 * table["time"][-1] - table["controller.f_hat"][-1]
    assert f"an error of {error:.4f} V" in TEXT
