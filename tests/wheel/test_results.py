"""Results: shared memory, and the formats of other packages."""

import pickle

import aso_ftc as af
import numpy as np
import pytest


@pytest.fixture
def results(paper):
    return paper.run()


def test_columns_are_read_only_arrays_of_the_types_of_their_variables(results):
    kinds = {name: results[name].dtype for name in results}
    assert kinds["plant.x_p"] == np.float64 and kinds["plant.regime"] == np.int32
    assert kinds["controller.compensate"] == np.bool_
    with pytest.raises(ValueError, match="read-only"):
        results["plant.x_p"][0] = 1.0
    assert results.units["plant.x_p"] == "m" and results.units["plant.regime"] is None
    assert results.names[0] == "time" and np.array_equal(results.time, results["time"])
    assert results.last() == {name: results[name][-1] for name in results}
    with pytest.raises(KeyError, match=r"no column 'plant.x'; similar: plant.x_p"):
        results["plant.x"]


def test_a_column_outlives_its_results(paper):
    column = paper.run()["plant.x_p"]
    snapshot = column.copy()
    for _ in range(20):
        paper.run()
    assert np.array_equal(column, snapshot)


def test_results_survive_pickle(results):
    again = pickle.loads(pickle.dumps(results))
    assert again.names == results.names and again.units == results.units
    assert all(np.array_equal(again[name], results[name]) for name in results)
    assert (again.end, again.steps, again.settings) == (results.end, results.steps, results.settings)


def test_arrow_shares_the_memory_of_the_columns(results):
    pyarrow = pytest.importorskip("pyarrow")
    table = results.to_arrow()
    assert table.column_names == results.names and table.num_rows == len(results.time)
    for name in ("time", "plant.x_p", "plant.regime"):
        address = table.column(name).chunk(0).buffers()[1].address
        assert address == results[name].ctypes.data, name
    assert table.schema.field("plant.x_p").metadata == {b"unit": b"m"}
    assert pyarrow.schema(results) == table.schema
    for name in results:
        assert np.array_equal(table.column(name).to_numpy(), results[name])


def test_pandas_polars_and_xarray_have_the_same_values(results):
    frames = []
    if pytest.importorskip("pandas"):
        frame = results.to_pandas()
        assert frame.index.name == "time" and np.array_equal(frame.index, results.time)
        changed = results.to_pandas()
        changed.loc[0.0, results.names[1]] = 1.0
        assert changed.iloc[0, 0] == 1.0
        frames.append(lambda name: frame[name].to_numpy())
    if pytest.importorskip("polars"):
        other = results.to_polars()
        assert other.columns == results.names
        frames.append(lambda name: other[name].to_numpy())
    structured = results.to_numpy()
    frames.append(lambda name: structured[name])
    for get in frames:
        assert all(np.array_equal(get(name), results[name]) for name in results.names[1:])


def test_xarray_has_units(results):
    pytest.importorskip("xarray")
    dataset = results.to_xarray()
    assert dataset["plant.x_p"].attrs == {"units": "m"} and dataset.sizes == {"time": len(results.time)}


def test_files_read_back_as_the_same_numbers(results, tmp_path):
    polars = pytest.importorskip("polars")
    results.to_csv(tmp_path / "r.csv")
    results.to_parquet(tmp_path / "r.parquet")
    written = polars.read_csv(tmp_path / "r.csv")
    binary = polars.read_parquet(tmp_path / "r.parquet")
    assert written.columns == binary.columns == results.names
    for name in results:
        assert np.array_equal(binary[name].to_numpy(), results[name])
        assert np.array_equal(written[name].to_numpy(), results[name].astype(written[name].to_numpy().dtype))
    with pytest.raises(ValueError, match=r"ends in \.csv"):
        results.to_csv(tmp_path / "r.txt")


def test_a_notebook_shows_a_table_and_names_are_escaped(results):
    page = results._repr_html_()
    assert page.count("<tr>") == 21 and "plant.x_p" in page and "and 6 more<" in page


def test_the_settings_of_the_results_repeat_the_run(results, tmp_path):
    again = af.System(results.settings).run()
    assert all(np.array_equal(again[name], results[name]) for name in results)
    assert any("gauss-seidel" in sentence for sentence in results.explanation)
    assert results.end == "stop time" and results.end_time == 0.2 and results.steps == 200


def test_nothing_is_recorded_where_nothing_is_asked_for(paper):
    assert len(paper.run(record=[]).time) == 0 == len(paper.run(record_every="never").time)
    assert paper.run(record=["plant.M"]).names == ["time", "plant.M"]


def test_a_picture_has_a_panel_for_each_unit(results):
    pytest.importorskip("matplotlib").use("Agg")
    figure = results.plot("plant.x_p", "plant.theta", "controller.x_p")
    assert [axes.get_ylabel() for axes in figure.axes] == ["m", "rad"]


def test_a_picture_of_a_column_without_rows_has_its_name_and_no_points(paper):
    pytest.importorskip("matplotlib").use("Agg")
    (axes,) = paper.run(record_every="never").plot("time").axes
    (line,) = axes.lines
    assert line.get_label() == "time" and len(line.get_xdata()) == 0


def test_a_picture_is_drawn_into_axes_that_are_given(results):
    pytest.importorskip("matplotlib").use("Agg")
    from matplotlib import pyplot

    figure, (upper, lower) = pyplot.subplots(2, 1)
    assert results.plot(signals=["plant.x_p", "controller.x_p"], ax=lower) is figure and not upper.lines
    for line, name in zip(lower.lines, ("plant.x_p", "controller.x_p"), strict=True):
        assert line.get_label() == name and np.array_equal(line.get_ydata(), results[name])
    assert lower.get_ylabel() == "m" and lower.get_xlabel() == "time in s"
    with pytest.raises(KeyError, match="similar: plant.x_p"):
        results.plot(signals=["plant.xp"], ax=lower)
    with pytest.raises(TypeError, match="found ax, too"):
        results.plot("plant.x_p", ax=lower, figsize=(3, 3))


def test_a_report_is_a_page_of_a_file_of_any_program(results, tmp_path):
    parquet, other = tmp_path / "own.parquet", tmp_path / "other.csv"
    results.to_parquet(parquet)
    other.write_text("time;plant.x_p\n0,0;1,5\n0,1;1,25\n", encoding="utf-8")
    page = af.report(parquet, against=other, variables=["plant.x_p"], start_time=results.time[1], stop_time=0.05)
    text = page.read_text(encoding="utf-8")
    assert f"Rows from t = {results.time[1]} s to t = 0.05 s only." in text
    assert page == tmp_path / "own.html" and "plant.x_p" in text and "plant.theta" not in text
    assert af.report(other, out=tmp_path / "page.html") == tmp_path / "page.html"
    with pytest.raises(TypeError, match="variables: expected a sequence of names, found the name 'plant.x_p'"):
        af.report(parquet, variables="plant.x_p")
    other.write_text("time,x\n1,0\n0,0\n", encoding="utf-8")
    with pytest.raises(af.ResultsError, match="line 3: time is 0 after 1") as raised:
        af.report(other)
    assert raised.value.kind == "Report"


def test_a_report_of_results_in_memory_is_that_of_their_files(paper, results, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    against = paper.run(start_values={"plant.F_c": 20.0})
    for name, source in {"results": results, "against": against}.items():
        source.to_parquet(f"{name}.parquet")
    expected = af.report("results.parquet", against="against.parquet", out="files.html").read_bytes()
    page = af.report(results, against=against, out="memory.html")
    assert page.read_bytes() == expected
    assert sorted(path.name for path in tmp_path.iterdir()) == ["against.parquet", "files.html", "memory.html", "results.parquet"]
    with pytest.raises(TypeError, match="out: expected the path of the page"):
        af.report(results)
    page.write_text("mine", encoding="utf-8")
    with pytest.raises(af.ResultsError, match="force=True overwrites it"):
        af.report(results, out=page)
