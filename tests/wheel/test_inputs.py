"""Tables as inputs: what goes out comes back in, with its units."""

import csv
import pickle

import aso_ftc as af
import numpy as np
import pytest
from aso_ftc._arrays import Array, arrays

TIME = np.linspace(0.0, 1.0, 101)
FORCE = 20.0 * np.sin(6.0 * TIME)
OUTPUT = ["u", "x_p", "theta"]


def run(**options):
    return af.simulate(af.fmus()["FrictionPendulum"], stop_time=1.0, step=0.01, output=OUTPUT, **options)


@pytest.fixture(scope="module")
def first():
    return run(input={"time": TIME, "u": FORCE})


FORMS = {
    "results": lambda results: results,
    "pandas": lambda results: results.to_pandas(),
    "a series of pandas": lambda results: results.to_pandas()["u"],
    "a column of pandas": lambda results: results.to_pandas().reset_index(),
    "polars": lambda results: results.to_polars(),
    "xarray": lambda results: results.to_xarray(),
    "arrow": lambda results: results.to_arrow(),
    "a batch of arrow": lambda results: results.to_arrow().to_batches()[0],
    "numpy": lambda results: results.to_numpy(),
    "lists": lambda results: {"time": results.time.tolist(), "u": results["u"].tolist()},
}


# The packages that forms need beside NumPy.
PACKAGES = {"pandas": "pandas", "polars": "polars", "xarray": "xarray", "arrow": "pyarrow"}


@pytest.mark.parametrize("form", FORMS)
def test_results_in_every_form_are_an_input_that_repeats_them(first, form):
    package = PACKAGES.get(form.split()[-1])
    if package:
        pytest.importorskip(package)
    assert run(input=FORMS[form](first)) == first


def test_durations_are_times_in_s_and_dates_are_none(first):
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    nanoseconds = np.arange(0, 1_010_000_000, 10_000_000).astype("timedelta64[ns]")
    tables = [
        {"time": nanoseconds, "u": FORCE},
        {"time": nanoseconds.astype("timedelta64[ms]"), "u": FORCE},
        {"time": np.ma.masked_array(nanoseconds), "u": np.ma.masked_array(FORCE)},
        pandas.DataFrame({"u": FORCE}, index=pandas.TimedeltaIndex(nanoseconds, name="time")),
        xarray.Dataset({"u": ("time", FORCE)}, coords={"time": nanoseconds}),
    ]
    for table in tables:
        assert np.allclose(run(input=table)["x_p"], first["x_p"], rtol=0, atol=1e-12)
    with pytest.raises(af.ConfigurationError, match="^input: time is no number in s: found dates"):
        run(input={"time": np.datetime64("2026-11-26") + nanoseconds, "u": FORCE})


def test_values_that_are_masked_or_absent_in_pandas_are_gaps():
    pandas = pytest.importorskip("pandas")
    with pytest.raises(af.ConfigurationError, match="^input: u is None in row 51, t = 0.51 s"):
        run(input={"time": TIME, "u": np.ma.masked_array(FORCE, np.arange(len(TIME)) == 51)})

    def law(table):
        return af.simulate(af.fmus()["AsoController"], stop_time=0.5, step=0.01, output=["compensate"], input=table)

    whole = law({"time": [0.0, 0.3], "compensate": [True, False]})
    assert set(whole["compensate"]) == {False, True}
    masked = np.ma.masked_array([True, False, False], [False, True, False])
    absent = pandas.array([True, None, False], dtype="boolean")
    assert law({"time": [0.0, 0.1, 0.3], "compensate": masked}) == whole
    assert law(pandas.DataFrame({"time": [0.0, 0.1, 0.3], "compensate": absent})) == whole


def test_units_of_a_table_are_converted(first):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"u": FORCE / 1000.0}, index=pandas.Index(TIME, name="time"))
    frame.attrs["units"] = {"u": "kN"}
    assert np.allclose(run(input=frame)["x_p"], first["x_p"], rtol=0, atol=1e-12)
    assert first.to_pandas().attrs["units"] == {"time": "s", "u": "N", "x_p": "m", "theta": "rad"}
    pyarrow = pytest.importorskip("pyarrow")
    fields = [pyarrow.field("time", "float64"), pyarrow.field("u", "float64", metadata={"unit": "kN"})]
    table = pyarrow.table([TIME, FORCE / 1000.0], schema=pyarrow.schema(fields))
    assert np.allclose(run(input=table)["x_p"], first["x_p"], rtol=0, atol=1e-12)
    frame.attrs["units"] = {"u": "m"}
    with pytest.raises(af.ConfigurationError, match=r'^input: .*u is in "N", to which "m" cannot be converted'):
        run(input=frame)


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ({"time": TIME, "U": FORCE}, "no variable 'U'; similar: u"),
        ({"time": TIME, "u": FORCE, "x_p": FORCE}, r"found x_p \(continuous output\)"),
        ({"time": TIME, "u": np.where(TIME > 0.5, np.nan, FORCE)}, r"u is nan in row 51, t = 0.51 s"),
        ({"time": TIME, "u": np.where(TIME > 0.5, np.inf, FORCE)}, r"u = inf at t = 0.51 s: expected a finite"),
        ({"time": TIME[::-1], "u": FORCE}, "time is 0.99 s in row 1 after 1 s, expected ascending"),
        ({"time": np.append(TIME[:-1], np.inf), "u": FORCE}, "time is inf in row 100"),
        ({"time": ["a"], "u": [1.0]}, "time is no number"),
        ({"time": [], "u": []}, "at least one row"),
        ({"time": [0.0], "u": ["strong"]}, "u is a Real: could not convert"),
        ({"time": [0.0], "u": [1.0 + 2.0j]}, "u is a Real: expected real numbers, found complex ones"),
        ({"time": [0.0, 1.0], "u": [[1.0, 2.0], [1.0, 2.0]]}, "u is a scalar"),
        (3.0, "found float"),
    ],
)
def test_a_wrong_table_is_refused_with_its_row_and_no_path(table, text):
    with pytest.raises(af.ConfigurationError, match=text) as caught:
        run(input=table)
    assert str(caught.value).startswith("input: ") and "/" not in str(caught.value)


def test_a_large_table_takes_little_time_and_leaves_no_file(tmp_path, monkeypatch):
    import tempfile
    import time

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    times = np.linspace(0.0, 1.0, 1_000_000)
    start = time.perf_counter()
    run(input={"time": times, "u": np.sin(times)})
    assert time.perf_counter() - start < 5.0 and not list(tmp_path.iterdir())


def test_arrays_go_in_and_come_out_in_their_dimensions(packed):
    linalg = pytest.importorskip("scipy.linalg")
    fmu = packed("examples/state-space")
    a, b = np.diag([-1.0, -2.0, -4.0]), np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]])
    c, u = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 0.0]]), np.array([1.0, -2.0])
    # The structural parameters give the arrays other sizes.
    values = {"n": 3, "m": np.int64(2), "p": 2, "A": a, "B": b, "C": c, "D": np.zeros((2, 2)), "x": [1.0, 0.0, 2.0]}
    augmented = np.zeros((5, 5))
    augmented[:3, :3], augmented[:3, 3:] = a, b
    end = c @ (linalg.expm(augmented) @ np.concatenate([values["x"], u]))[:3]
    inputs = [
        {"time": [0.0, 1.0], "u": np.array([u, u])},
        lambda t: {"u": u},
        {"time": [0.0, 1.0], "u[1]": [1.0, 1.0], "u[2]": [-2.0, -2.0]},
    ]
    for signal in inputs:
        results = af.simulate(fmu, stop_time=1.0, start_values=values, input=signal, tolerance=1e-9)
        rows = len(results.time)
        assert results["y"].shape == (rows, 2) and "y" in results and results.names == ["time", "y[1]", "y[2]"]
        assert np.array_equal(results["y"][:, 1], results["y[2]"])
        assert np.allclose(results["y"][-1], end, rtol=0, atol=1e-6)
    # As FMPy gives them.
    whole = af.simulate(fmu, stop_time=0.1, output=["x", "A"])
    assert whole["x"].shape[1:] == (2,) and whole["A"].shape[1:] == (2, 2) and len(whole) == 7
    with pytest.raises(af.ConfigurationError, match=r"C has the shape \(2, 3\), found an array of the shape \(3, 2\)"):
        af.simulate(fmu, start_values={**values, "C": c.T})
    with pytest.raises(af.ConfigurationError, match=r"u has the shape \(1,\), found .* \(3,\)"):
        af.simulate(fmu, input=lambda t: {"u": np.zeros(3)})
    with pytest.raises(af.ConfigurationError, match=r"u has the shape \(1,\), found \(3,\) in each row"):
        af.simulate(fmu, input={"time": [0.0], "u": np.zeros((1, 3))})
    with af.System().add("s", fmu).simulation(start_values={"s.n": 3, "s.m": 2, "s.x": [1.0, 0.0, 2.0]}) as steps:
        assert np.array_equal(steps["s.x"], [1.0, 0.0, 2.0]) and steps["s.B"].shape == (3, 2)
        steps.set("s.u", u)
        steps.step()
        assert np.array_equal(steps["s.u"], u)
        assert [np.shape(value) for value in steps.get(["s.B", "s.n"])] == [(3, 2), ()]


def test_binaries_are_bytes_and_clocks_are_booleans(packed, tmp_path):
    fmu = packed("examples/can-node")
    data, clock = "CanChannel.Tx_Data", "CanChannel.Tx_Clock"
    results = af.simulate(fmu, stop_time=0.1, step=0.01, output=[data, clock, "CanChannel.Rx_Data"])
    assert results[clock].dtype == bool and {type(value) for value in results[data]} == {bytes}
    # The node has sent nothing but frames, and received none.
    assert all(len(value) > 8 for value in results[data][results[clock]])
    assert list(results["CanChannel.Rx_Data"]) == [None] * len(results.time)
    assert pickle.loads(pickle.dumps(results)) == results
    pyarrow = pytest.importorskip("pyarrow")
    table = pyarrow.table(results)
    assert table.schema.field(data).type == pyarrow.large_binary() and table[data].to_pylist() == list(results[data])
    # A file has hexadecimal digits, as the command writes it.
    results.to_csv(tmp_path / "results.csv")
    rows = list(csv.DictReader(open(tmp_path / "results.csv", encoding="utf-8")))
    assert [bytes.fromhex(row[data]) for row in rows] == list(results[data])


def test_100_000_elements_of_arrays_are_grouped_in_a_short_time():
    import time

    start = time.perf_counter()
    grouped = arrays(f"cell[{k}].x[{i},1]" for k in range(50_000) for i in (1, 2))
    assert time.perf_counter() - start < 5.0 and len(grouped) == 50_000
    assert grouped["cell[7].x"] == Array(("cell[7].x[1,1]", "cell[7].x[2,1]"), (2, 1))
