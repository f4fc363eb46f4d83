"""Files of results, read by FMPy, numpy, pandas, polars and pyarrow.

The example write_results writes a table whose Reals have the bits of a random generator. The same
generator is here in Python: every number must be read with the same bits.
"""

import io
import json
import os
import random
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from fmpy.util import read_csv

ROWS = 70_000
NAMES = ["time", "plant.x_p", "plant.mode", "ctrl.x_hat[1]", "ctrl.on", "ctrl.text"]
UNITS = {"time": "s", "plant.x_p": "m", "ctrl.x_hat[1]": "rad/s"}


def expected(rows=ROWS):
    """The table of the example: Knuth's MMIX generator for arbitrary doubles."""
    bits, state = np.empty(2 * rows, dtype=np.uint64), 1
    for place in range(2 * rows):
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        bits[place] = state
    reals = bits.view(np.float64).reshape(rows, 2)
    k = np.arange(rows, dtype=np.uint32)
    texts = [f'row {j}, "ä"' + ("\n" if j % 3 == 0 else "") for j in range(rows)]
    return {
        "time": np.arange(rows) * 1e-3,
        "plant.x_p": reals[:, 0],
        "plant.mode": (k * np.uint32(2654435761)).view(np.int32),
        "ctrl.x_hat[1]": reals[:, 1],
        "ctrl.on": k % 2 == 1,
        "ctrl.text": texts,
    }


@pytest.fixture(scope="module")
def example(root):
    """The path of an example, which is built unless scripts/test has built it."""

    def path(name):
        folder = os.environ.get("BUILT_PROGRAMS")
        if folder is None:
            cargo = ["cargo", "build", "--release", "--locked", "--package", "cosim-results"]
            subprocess.run([*cargo, "--example", name], cwd=root, check=True)
            folder = root / "target" / "release"
        return Path(folder) / "examples" / name

    return path


@pytest.fixture(scope="module")
def write_results(example):
    """Runs the example; returns its exit status."""
    program = example("write_results")
    return lambda *arguments: subprocess.run([program, *arguments], capture_output=True).returncode


@pytest.fixture(scope="module")
def files(write_results, tmp_path_factory):
    """A file of each format with all types, a CSV file without texts, and their content."""
    folder = tmp_path_factory.mktemp("results")
    csv, parquet, numbers = (folder / name for name in ("a.csv", "a.parquet", "numbers.csv"))
    assert write_results(csv, parquet) == 0
    assert write_results("--numbers", numbers) == 0
    return SimpleNamespace(csv=csv, parquet=parquet, numbers=numbers, table=expected())


def same(values, reference):
    """Checks that the bits are equal; all NaN values count as equal."""
    values, reference = np.asarray(values, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    either = np.isnan(reference)
    assert np.array_equal(np.isnan(values), either)
    return np.array_equal(values[~either].view(np.uint64), reference[~either].view(np.uint64))


def assert_table(column, names, table, rows=ROWS):
    """Checks every column of a reader, which is a function of the column's name."""
    for name in names:
        values = column(name)
        assert len(values) == rows
        if name == "ctrl.text":
            assert list(values) == table[name][:rows]
        else:
            assert same(values, table[name][:rows]), name


def test_the_table_contains_difficult_numbers(files):
    reals = files.table["plant.x_p"]
    assert np.isnan(reals).any() and (np.abs(reals[np.isfinite(reals)]) < 1e-300).any()
    assert (np.abs(reals[np.isfinite(reals)]) > 1e300).any()


def test_fmpy_reads_the_csv_file_with_the_same_bits(files):
    table = read_csv(files.numbers)
    assert list(table.dtype.names) == NAMES[:-1]
    assert_table(lambda name: table[name], NAMES[:-1], files.table)


def test_genfromtxt_of_numpy_reads_the_csv_file_with_the_same_bits(files):
    table = np.genfromtxt(files.numbers, delimiter=",", skip_header=1)
    assert_table(lambda name: table[:, NAMES.index(name)], NAMES[:-1], files.table)
    named = np.genfromtxt(
        files.numbers, delimiter=",", names=True, deletechars="", max_rows=1
    )
    assert [name.strip('"') for name in named.dtype.names] == NAMES[:-1]


def test_pandas_reads_the_csv_file_with_the_same_bits(files):
    table = pd.read_csv(files.csv)
    assert list(table.columns) == NAMES
    assert table.dtypes["plant.mode"] == np.int64
    assert_table(lambda name: table[name].to_numpy(), NAMES, files.table)


def test_polars_reads_the_csv_file_with_the_same_bits(files):
    table = pl.read_csv(files.csv)
    assert table.columns == NAMES
    assert table.schema["time"] == pl.Float64 and table.schema["plant.mode"] == pl.Int64
    assert_table(lambda name: table[name].to_numpy(), NAMES, files.table)


def test_pyarrow_reads_the_parquet_file_typed_without_nulls_and_with_units(files):
    table = pq.read_table(files.parquet)
    types = [pa.float64(), pa.float64(), pa.int32(), pa.float64(), pa.bool_(), pa.string()]
    assert table.schema.names == NAMES and table.schema.types == types
    assert not any(field.nullable for field in table.schema)
    assert json.loads(table.schema.metadata[b"units"]) == UNITS
    assert_table(lambda name: table[name].to_pandas().to_numpy(), NAMES, files.table)
    assert pq.ParquetFile(files.parquet).metadata.num_row_groups > 1
    assert pq.read_table(files.parquet, columns=["ctrl.x_hat[1]"]).num_columns == 1


def test_pandas_reads_the_parquet_file_with_the_same_bits_and_the_units(files):
    table = pd.read_parquet(files.parquet)
    assert list(table.columns) == NAMES
    assert table.dtypes["ctrl.on"] == np.bool_ and table.dtypes["plant.mode"] == np.int32
    assert table.attrs["units"] == UNITS
    assert_table(lambda name: table[name].to_numpy(), NAMES, files.table)


def test_polars_reads_the_parquet_file_with_the_same_bits_and_the_units(files):
    table = pl.read_parquet(files.parquet)
    kinds = [pl.Float64, pl.Float64, pl.Int32, pl.Float64, pl.Boolean, pl.String]
    assert table.schema == dict(zip(NAMES, kinds))
    assert json.loads(pl.read_parquet_metadata(files.parquet)["units"]) == UNITS
    assert_table(lambda name: table[name].to_numpy(), NAMES, files.table)
    some = pl.scan_parquet(files.parquet).filter(pl.col("ctrl.on")).select("plant.x_p").collect()
    assert same(some["plant.x_p"], files.table["plant.x_p"][1::2])


def test_a_crash_leaves_every_row_up_to_the_flush_before_it(write_results, tmp_path, files):
    csv, parquet = tmp_path / "a.csv", tmp_path / "a.parquet"
    assert write_results("--interrupt", csv) != 0
    assert write_results("--interrupt", parquet) != 0
    table = pd.read_csv(csv)
    assert_table(lambda name: table[name].to_numpy(), NAMES, files.table)
    assert csv.read_bytes().endswith(b"\n")
    table = pd.read_parquet(parquet)
    assert_table(lambda name: table[name].to_numpy(), NAMES, files.table)


# A few columns that are written in full blocks, and so many that a partial block takes several writes.
@pytest.mark.parametrize(("columns", "pause"), [(400, 0), (1000, 0.0005)])
@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_kill_at_any_instant_leaves_a_file_without_the_rows_of_the_last_second_at_most(
    example, tmp_path, ending, columns, pause
):
    program, instants = example("write_until_killed"), random.Random(columns)
    for _ in range(int(os.environ.get("KILLS", "3"))):
        file, times = tmp_path / f"a.{ending}", tmp_path / "times"
        file.unlink(missing_ok=True)
        with times.open("wb") as out:
            run = subprocess.Popen([program, file, str(columns), str(pause)], stdout=out)
        while times.stat().st_size == 0:
            time.sleep(0.001)
        time.sleep(instants.uniform(0.1, 2))
        run.kill()
        run.wait()
        timestamps = np.fromfile(times)
        names = ["time", f"x[{columns - 1}]"]
        if ending == "csv":
            # The last line can be a part.
            text = file.read_bytes()
            whole = io.BytesIO(text[: text.rindex(b"\n") + 1])
            table = pl.read_csv(whole, columns=names)
        else:
            table = pl.from_arrow(pq.read_table(file, columns=names))
            assert pl.read_parquet(file, columns=names).equals(table)
        rows = np.arange(len(table), dtype=float)
        assert np.array_equal(table[names[0]].to_numpy(), rows)
        assert np.array_equal(table[names[1]].to_numpy(), rows + (columns - 1) / 1024)
        # The row that is in work is among the times or not. A write on a busy machine takes a while.
        lost = timestamps[len(table) : len(timestamps)]
        assert len(lost) == 0 or timestamps[-1] - lost[0] < 1, f"{len(lost)} of {len(timestamps)} rows"
