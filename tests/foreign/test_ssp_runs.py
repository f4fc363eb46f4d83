"""`aso-ftc run` on system structures, ours and those in the style of other tools, with the same bits.

The loop in FMPy (`held_loop`) is the one that libcosim, Ecos and FMPy agree with in
test_ssp_judges.py.
"""

import csv
import io
import zipfile

import numpy as np
import pytest

from held_loop import STEP, expect_equal, held_loop
from ssp_files import ecos_style, libcosim_style, nested_style

COUNT = 2_000
NO_SETTINGS = {"plant": {}, "controller": {}}


@pytest.fixture
def run(aso_ftc, tmp_path):
    """Runs a system structure; returns the named columns of its results, and the times."""

    def run(path, step, stop, names):
        out = tmp_path / "out"
        options = ["--step", step, "--stop-time", stop, "--method", "jacobi", "--extrapolation", "hold"]
        done = aso_ftc("run", path, "--out", out, *options)
        assert done.returncode == 0, done.stderr
        with open(out / "results.csv", encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        values = np.array([[float(row[name]) for name in names] for row in rows])
        return np.array([float(row["time"]) for row in rows]), values

    return run


def grid(step, count):
    """Times are the start time plus multiples of the step."""
    return [(k * step, step) for k in range(count)]


@pytest.mark.parametrize(
    ("style", "plant"),
    [(libcosim_style, "plant"), (ecos_style, "plant"), (nested_style, "cart.plant")],
)
def test_structures_of_every_style_run_with_the_bits_of_the_loop_in_fmpy(
    run, packed, unpacked, tmp_path, style, plant
):
    names, expected = held_loop(unpacked, grid(STEP, COUNT))
    elements = {"plant": plant, "controller": "controller"}
    columns = [f"{elements[role]}.{name}" for role, name in names]
    times, values = run(style(packed, tmp_path), STEP, COUNT * STEP, columns)
    assert list(times) == [k * STEP for k in range(COUNT + 1)]
    expect_equal(names, expected, values[1:])


def test_our_ssp_runs_in_our_master_with_the_bits_of_the_loop_in_fmpy(run, root, unpacked):
    step = 1e-3
    names, expected = held_loop(unpacked, grid(step, COUNT), NO_SETTINGS)
    columns = [f"{role}.{name}" for role, name in names]
    _, values = run(root / "dist" / "InvertedPendulum.ssp", step, COUNT * step, columns)
    expect_equal(names, expected, values[1:])


def test_a_structure_that_cannot_be_read_is_refused_with_its_position(aso_ftc, tmp_path):
    path = tmp_path / "SystemStructure.ssd"
    path.write_text("<x>\n <y a='1' a='2'/></x>", encoding="utf-8")
    done = aso_ftc("run", path, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert f"{path}: line 2, column " in done.stderr


def for_windows(data):
    """The FMU in `data`, with its library for Linux in the folder for Windows."""
    archive = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as fmu, zipfile.ZipFile(archive, "w") as other:
        for name in fmu.namelist():
            target = name.replace("binaries/linux64", "binaries/win64").replace(".so", ".dll")
            other.writestr(target, fmu.read(name))
    return archive.getvalue()


def test_an_fmu_without_a_library_for_this_platform_is_refused_with_the_platforms_it_has(
    aso_ftc, root, packed, tmp_path
):
    path = tmp_path / "half.ssp"
    with zipfile.ZipFile(root / "dist" / "InvertedPendulum.ssp") as whole:
        with zipfile.ZipFile(path, "w") as half:
            for name in whole.namelist():
                data = whole.read(name)
                plant = name.endswith("FrictionPendulum.fmu")
                half.writestr(name, for_windows(data) if plant else data)
    alone = tmp_path / "Windows.fmu"
    alone.write_bytes(for_windows(packed["plant"].read_bytes()))
    out = tmp_path / "out"
    equations = ["--interface", "plant=model-exchange"]
    for system in ([path], ["--fmu", f"plant={alone}"], ["--fmu", f"plant={alone}", *equations]):
        done = aso_ftc("run", *system, "--out", out)
        assert done.returncode == 2 and not out.exists()
        assert "plant: " in done.stderr
        assert "expected the library binaries/linux64/FrictionPendulum.so" in done.stderr
        assert "found binaries/win64/FrictionPendulum.dll" in done.stderr
