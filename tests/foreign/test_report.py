"""Reports of runs: statistics and differences against numpy; the page in a browser."""

import base64
import json
import re
import shlex
import shutil
import subprocess
import zlib

import numpy as np
import pandas as pd
import polars
import pytest
from lxml import html

from browser import browser
from conftest import ROOT

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
DRAWN = "document.querySelector('.uplot') && document.querySelectorAll('.uplot').length === document.querySelectorAll('figure').length"


def table(page, identifier):
    """The rows of the table in a section, by the name of the variable; all digits."""
    section = page.xpath(f"//section[@aria-labelledby='{identifier}']")[0]
    return {
        row.xpath("./th")[0].text_content(): [float(cell.get("title")) for cell in row.xpath("./td[@title]")]
        for row in section.xpath(".//tbody/tr")
    }


def data(page):
    """The data of the scripts."""
    return json.loads(page.xpath("//script[@id='data']")[0].text)


def curves(page):
    """Times and values of the curves, by variable, and how many rows the file has."""
    content = data(page)

    def column(number, rows):
        """The numbers of a column: all first bytes, then all second bytes and so on."""
        entry = content["columns"][number]
        if "block" not in entry:
            return np.full(rows, np.nan if entry["constant"] is None else entry["constant"])
        planes = np.frombuffer(zlib.decompress(base64.b64decode(entry["block"])), dtype=np.uint8)
        return np.frombuffer(planes.reshape(8, rows).T.tobytes())

    curves = {}
    for plot in content["plots"]:
        grid = content["grids"][plot["grid"]]
        for curve in plot["curves"]:
            other = curve["other"]
            curves[curve["name"]] = {
                **curve,
                "time": column(grid["time"], grid["rows"]),
                "values": column(curve["values"], grid["rows"]),
                "other": None if other is None else column(other, grid["rows"]),
                "total": grid["total"],
            }
    return curves


def unchanged(page):
    """The variables that do not change, and their values."""
    rows = page.xpath("//details[@id='unchanged']//tbody/tr")
    return {row.xpath("./th")[0].text_content(): float(row.xpath("./td[@title]")[0].get("title")) for row in rows}


@pytest.fixture
def write(tmp_path):
    """Writes a results file of another program."""

    def written(name, frame):
        path = tmp_path / name
        if path.suffix == ".csv":
            frame.to_csv(path, index=False)
        else:
            frame.to_parquet(path)
        return path

    return written


def frame(count=2001, shift=0.0):
    time = np.linspace(0.0, 4.0, count)
    return pd.DataFrame(
        {"time": time, "a": np.sin(3 * time) + shift, "b": np.exp(-time), "on": (time > 1.5).astype(np.int32)}
    )


def report(aso_ftc, *arguments):
    done = aso_ftc("report", *arguments)
    assert done.returncode == 0, done.stderr
    return html.parse(done.stdout.splitlines()[-1], html.HTMLParser(huge_tree=True)).getroot(), done.stdout


@pytest.mark.parametrize("name", ["own.csv", "own.parquet"])
def test_statistics_are_those_of_numpy_for_files_of_pandas(aso_ftc, write, name):
    results = frame()
    page, _ = report(aso_ftc, write(name, results))
    statistics, time = table(page, "statistics"), results["time"].to_numpy()
    for variable in ["a", "b"]:
        values = results[variable].to_numpy()
        low, high = values.argmin(), values.argmax()
        mean = np.trapezoid(values, time) / 4
        rms = np.sqrt(np.trapezoid(values**2, time) / 4)
        expected = [values[0], values[-1], values[low], time[low], values[high], time[high], mean, rms]
        assert np.allclose(statistics[variable], expected, rtol=1e-12, atol=1e-12)


def test_integers_and_booleans_of_csv_are_held(aso_ftc, write):
    # Reals have a point in files of pandas, not in those of FMPy: there, 0 may be a Real.
    results = pd.DataFrame({"time": [0.0, 1.0, 3.0, 4.0], "n": [0, 5, 2, 1], "on": [True, False, False, True], "x": [0.0, 5.0, 2.0, 1.0]})
    file, values = write("own.csv", results), results[["n", "on", "x"]].to_numpy(dtype=float)
    held = np.diff(results["time"]) @ values[:-1] / 4
    linear = np.trapezoid(values[:, 2], results["time"]) / 4
    page, _ = report(aso_ftc, file)
    means = {name: row[-2] for name, row in table(page, "statistics").items()}
    assert means == pytest.approx({"n": held[0], "on": held[1], "x": linear})
    assert {name: curve["holds"] for name, curve in curves(page).items()} == {"n": True, "on": True, "x": False}
    file.write_text("time,n\n0,0\n1,5\n3,2\n4,1\n", encoding="utf-8")
    page, _ = report(aso_ftc, file)
    assert table(page, "statistics")["n"][-2] == pytest.approx(linear)


@pytest.mark.parametrize("rows", [137, 5003])
def test_the_difference_is_that_to_the_interpolated_other_run(aso_ftc, write, rows):
    results, other = frame(), frame(rows, 0.25)
    page, said = report(aso_ftc, write("own.csv", results), "--against", write("other.csv", other.drop(columns="b")))
    there = np.interp(results["time"], other["time"], other["a"])
    expected = results["a"] - there
    at = np.abs(expected).argmax()
    scale = max(results["a"].max(), there.max()) - min(results["a"].min(), there.min())
    differences = table(page, "differences")
    assert np.allclose(
        differences["a"],
        [np.abs(expected).max(), results["time"][at], np.sqrt(np.mean(expected**2)), np.abs(expected).max() / scale],
        rtol=1e-9,
    )
    assert "b" not in differences and "Only in this run: b." in page.text_content()
    assert "largest difference to" in said
    curve = curves(page)["a"]
    assert (curve["time"] == results["time"]).all() and (curve["values"] == results["a"]).all()
    assert np.allclose(curve["other"], there, atol=1e-12)


def test_equal_runs_have_no_difference_at_events_either(aso_ftc, write):
    results = pd.DataFrame({"time": [0.0, 1.0, 1.0, 2.0], "x": [0.0, 1.0, -1.0, 5.0]})
    page, said = report(aso_ftc, write("own.csv", results), "--against", write("other.csv", results))
    assert "no difference" in said and table(page, "differences")["x"][0] == 0
    curve = curves(page)["x"]
    assert all((curve[name] == results[column]).all() for name, column in (("time", "time"), ("values", "x"), ("other", "x")))


def noise(count, width):
    """Noise with a peak of one row in each column."""
    generator = np.random.default_rng(2)
    columns = {f"x{k}": generator.standard_normal(count) for k in range(width)}
    for k, values in enumerate(columns.values()):
        values[123 * (k + 1)] = 50.0 + k
    return pd.DataFrame({"time": np.arange(count) * 1e-3, **columns})


def test_a_page_has_all_rows_of_a_run_bit_by_bit(aso_ftc, write):
    results = noise(10_001, 26)
    page, _ = report(aso_ftc, write("own.csv", results))
    series = curves(page)
    for name in results.columns[1:]:
        assert (series[name]["time"] == results["time"]).all() and (series[name]["values"] == results[name]).all()


def test_a_page_of_too_many_rows_has_whole_rows_with_every_peak(aso_ftc, write, tmp_path):
    results = noise(300_000, 12)
    page, _ = report(aso_ftc, write("own.parquet", results))
    assert (tmp_path / "own.html").stat().st_size < 22e6
    for name, curve in curves(page).items():
        rows = np.searchsorted(results["time"], curve["time"])
        assert (results["time"].to_numpy()[rows] == curve["time"]).all()
        assert (results[name].to_numpy()[rows] == curve["values"]).all()
        assert curve["values"].max() == results[name].max() and curve["values"].min() == results[name].min()
        assert (rows[0], rows[-1]) == (0, 299_999) and curve["total"] == 300_000 > rows.size


def test_texts_and_values_that_are_not_finite_are_named(aso_ftc, write):
    results = pd.DataFrame({"time": [0.0, 1.0, 2.0], "x": [1.0, np.nan, 3.0], "mode": ["a", "b", "c"]})
    page, _ = report(aso_ftc, write("own.csv", results))
    assert "Texts are not shown: mode." in page.text_content()
    np.testing.assert_array_equal(curves(page)["x"]["values"], results["x"])


def test_integers_that_doubles_cannot_hold_are_named(aso_ftc, write):
    results = pd.DataFrame({"time": [0.0, 1.0], "large": [2**53 + 1, 2**53 + 3], "small": [2**53 - 1, 0], "r": [1e300, 2.0]})
    large, small = (int(results[name][0]) for name in ("large", "small"))
    assert int(float(large)) != large and int(float(small)) == small
    for name in ("rows.csv", "columns.parquet"):
        page, _ = report(aso_ftc, write(name, results))
        (warning,) = page.xpath("//main//p[@class='outcome warned']")
        assert warning.text_content().endswith("not seen: large."), warning.text_content()
    other = write("other.csv", results.assign(large=results["large"] - 1))
    _, said = report(aso_ftc, write("rows.csv", results), "--against", other)
    assert "not compared: digits of integers beyond 2^53, which are rounded: large\n" in said


def test_numbers_have_six_digits_and_zero_no_sign(aso_ftc, write):
    constants = {-0.0: "0", 1.23456789: "1.23457", -999999.7: "-1e6", 5e-324: "5e-324", 1.7976931348623157e308: "1.79769e308"}
    results = pd.DataFrame({"time": [0.0, 1.0], **{f"c{k}": [value, value] for k, value in enumerate(constants)}})
    page, _ = report(aso_ftc, write("own.parquet", results))
    cells = page.xpath("//details[@id='unchanged']//td[@title]")
    assert [cell.text_content() for cell in cells] == list(constants.values())


def test_times_in_seconds_since_1970_have_their_digits_in_the_tables(aso_ftc, write):
    results = frame()
    results["time"] += 1.7e9
    other = results.assign(a=results["a"] * results["time"].eq(results["time"][700]))
    page, _ = report(aso_ftc, write("own.csv", results), "--against", write("other.csv", other))
    cells = page.xpath("//section[@aria-labelledby='statistics']//tr[th='a']/td[@title]")
    for column, row in ((3, results["a"].idxmin()), (5, results["a"].idxmax())):
        assert float(cells[column].text) == pytest.approx(results["time"][row], rel=0, abs=1e-6)
    at = (results["a"] - other["a"]).abs().idxmax()
    cells = page.xpath("//section[@aria-labelledby='differences']//tr[th='a']/td[@title]")
    assert float(cells[1].text) == pytest.approx(results["time"][at], rel=0, abs=1e-6)


def rates():
    """A variable with a value at every row, and one with a value at every second one."""
    slow = [10, np.nan, 20, np.nan, 30, np.nan, 40]
    return pd.DataFrame({"time": np.arange(7.0), "fast": np.arange(7.0), "slow": slow})


def test_statistics_with_empty_cells_are_over_the_values_and_say_so(aso_ftc, write):
    results = rates()
    page, _ = report(aso_ftc, write("own.csv", results))
    values = results["slow"].dropna().to_numpy()
    assert table(page, "statistics")["slow"][-2:] == pytest.approx([values.mean(), np.sqrt((values**2).mean())])
    rows = page.xpath("//section[@aria-labelledby='statistics']//tbody/tr")
    assert [row.xpath("./td")[-1].text_content() for row in rows] == ["time, 6 s", "4 values in 7 rows"]


def test_what_is_not_compared_is_named_on_the_terminal(aso_ftc, write):
    results = rates().assign(here=1.0, mode=["a"] * 7)
    other = pd.DataFrame({"time": np.arange(2.0, 12.0), "fast": np.arange(2.0, 12.0), "there": 0.0})
    page, said = report(aso_ftc, write("own.csv", results), "--against", write("other.csv", other))
    lines = [line.removeprefix("not compared: ") for line in said.splitlines() if line.startswith("not compared: ")]
    assert [re.sub(r"\S*/", "", line) for line in lines] == [
        "2 rows of own.csv outside of the time of other.csv",
        "5 rows of other.csv outside of the time of own.csv",
        "only in own.csv: slow, here",
        "only in other.csv: there",
        "texts: mode",
    ]
    assert "no difference to" in said and "in 5 rows of 1 variable\n" in said
    text = page.text_content()
    assert "Only in this run: slow, here." in text and "2 rows of this run outside of the time of" in text
    page, said = report(aso_ftc, write("own.csv", results), "--against", write("own.csv", results))
    assert "not compared: texts: mode" in said and said.count("not compared") == 1


def test_runs_without_a_common_time_are_not_said_to_be_equal(aso_ftc, write):
    results = pd.DataFrame({"time": [0.0, 1.0], "x": [0.0, 1.0]})
    page, said = report(aso_ftc, write("own.csv", results), "--against", write("other.csv", results + 5))
    assert "nothing was compared with" in said and "no difference" not in said
    text = page.text_content()
    assert "Nothing was compared with" in text and "variables are equal" not in text
    assert "not compared: 2 rows of" in said


def test_times_that_decrease_are_an_error_with_the_line(aso_ftc, tmp_path):
    file = tmp_path / "own.csv"
    file.write_text("time,a\n0,1\n2,2\n1,3\n3,4\n", encoding="utf-8")
    done = aso_ftc("report", file)
    assert done.returncode == 2 and "own.csv, line 4: time is 1 after 2" in done.stderr
    polars.read_csv(file).write_parquet(tmp_path / "own.parquet")
    done = aso_ftc("report", tmp_path / "own.parquet")
    assert done.returncode == 2 and "own.parquet, row 3: time is 1 after 2" in done.stderr


@pytest.mark.parametrize("compression", ["uncompressed", "snappy", "gzip", "brotli", "zstd", "lz4"])
def test_parquet_files_of_polars_are_read(aso_ftc, tmp_path, compression):
    results = frame()
    polars.from_pandas(results.assign(large=np.uint32(4_000_000_000))).write_parquet(
        tmp_path / "own.parquet", compression=compression
    )
    page, _ = report(aso_ftc, tmp_path / "own.parquet")
    series = curves(page)
    assert all((series[name]["values"] == results[name]).all() for name in ("a", "b", "on"))
    assert "large" not in series and unchanged(page) == {"large": 4e9}


def test_csv_of_other_programs_is_read(aso_ftc, tmp_path):
    from fmpy.util import write_csv

    results = frame(301)
    expected = results["a"].to_numpy()

    def check(name, values=expected):
        page, _ = report(aso_ftc, tmp_path / name)
        curve = curves(page)["a"]
        assert (curve["values"] == values).all() and (curve["time"] == results["time"]).all(), name

    write_csv(tmp_path / "fmpy.csv", results.to_records(index=False))
    check("fmpy.csv")
    results.to_csv(tmp_path / "german.csv", index=False, sep=";", decimal=",")
    check("german.csv")
    results.to_csv(tmp_path / "tabs.csv", index=False, sep="\t")
    check("tabs.csv")
    results.to_csv(tmp_path / "utf16.csv", index=False, encoding="utf-16")
    check("utf16.csv")
    results.to_csv(tmp_path / "bom.csv", index=False, encoding="utf-8-sig")
    check("bom.csv")
    # OpenModelica: names in quotation marks; some versions end each line with a comma.
    lines = [",".join(f'"{name}"' for name in results.columns), *(",".join(map(repr, row)) for row in results.values.tolist())]
    (tmp_path / "modelica.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    check("modelica.csv")
    (tmp_path / "closed.csv").write_text(",\n".join(lines) + ",\n", encoding="utf-8")
    check("closed.csv")


@pytest.mark.parametrize(
    ("name", "content", "parts"),
    [
        ("ragged.csv", b"time,a\n0,1\n1\n2,3\n", ["line 3 has 1 value, expected 2"]),
        ("last.csv", b"time,a\n0,1\n1\n", ["line 3 has 1 value, expected 2"]),
        ("commas.csv", b"time,a\n0,0,1,5\n", ["line 2 has 4 values, expected 2", "semicolons"]),
        ("names.csv", b"0,1\n1,2\n", ["expected the names of the columns"]),
        ("spaces.csv", b"time a\n0 1\n", ["no variable to show", "commas, semicolons or tabs"]),
        ("binary.csv", b"PK\x03\x04\0\0", ["binary file", "save it as CSV"]),
        ("book.xlsx", b"PK\x03\x04\0\0", [".csv, .parquet or .mat", "save them as CSV"]),
        ("five.mat", b"MATLAB 5.0 MAT-file, Platform: GLNXA64", ["version 5 or later", "Dymola or OpenModelica"]),
    ],
)
def test_what_is_not_read_is_one_sentence_with_advice(aso_ftc, tmp_path, name, content, parts):
    (tmp_path / name).write_bytes(content)
    done = aso_ftc("report", tmp_path / name)
    assert done.returncode == 2 and len(done.stderr.strip().splitlines()) == 1
    for part in parts:
        assert part in done.stderr, done.stderr


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_mat_files_of_dymola_and_openmodelica_are_read(aso_ftc, tmp_path, kind):
    scipy = pytest.importorskip("scipy.io")
    time = np.array([0.0, 0.5, 0.5, 1.0, 2.0])
    values = np.sin(time)

    def texts(lines):
        """A matrix of signs with a text in each column."""
        width = max(map(len, lines))
        return np.array(["".join(row) for row in zip(*(line.ljust(width) for line in lines), strict=True)])

    content = {
        "Aclass": np.array(["Atrajectory", "1.1", "", "binTrans"]),
        "name": texts(["time", "gain", "body.phi", "minus.phi"]),
        "description": texts(["Time in [s]", "Gain", "angle [rad|deg]", "angle [rad]"]),
        "dataInfo": np.array([[0, 1, 0, -1], [1, 2, 0, 0], [2, 2, 0, -1], [2, -2, 0, -1]], dtype=np.int32).T,
        "data_1": np.array([[0.0, 2.0], [7.0, 7.0]], dtype=kind),
        "data_2": np.array([time, values], dtype=kind),
    }
    scipy.savemat(tmp_path / "own.mat", content, format="4")
    page, _ = report(aso_ftc, tmp_path / "own.mat")
    series, stored = curves(page), values.astype(kind)
    assert (series["body.phi"]["time"] == time).all()
    assert (series["body.phi"]["values"] == stored).all() and (series["minus.phi"]["values"] == -stored).all()
    assert unchanged(page) == {"gain": 7}
    assert [plot["unit"] for plot in data(page)["plots"]] == ["rad"]
    whole = (tmp_path / "own.mat").read_bytes()
    for length in (0, 10, 25, len(whole) - 1):
        (tmp_path / "own.mat").write_bytes(whole[:length])
        assert aso_ftc("report", tmp_path / "own.mat").returncode == 2


def test_names_with_markup_remain_text(aso_ftc, write):
    name = "</script><script>alert(1)</script>"
    page, _ = report(aso_ftc, write("own.csv", pd.DataFrame({"time": [0.0, 1.0], name: [0.0, 1.0]})))
    assert name in curves(page) and len(page.xpath("//script")) == 3


def test_nothing_of_others_is_overwritten(aso_ftc, write, tmp_path):
    file, page = write("own.csv", frame()), tmp_path / "own.html"
    page.write_text("mine", encoding="utf-8")
    done = aso_ftc("report", file)
    assert done.returncode == 2 and "--force" in done.stderr and page.read_text(encoding="utf-8") == "mine"
    assert aso_ftc("report", file, "--force").returncode == 0 == aso_ftc("report", file).returncode
    done = aso_ftc("report", file, "--out", file)
    assert done.returncode == 2 and file.read_text(encoding="utf-8").startswith("time")
    done = aso_ftc("report", file, "--against", write("apart.csv", pd.DataFrame({"time": [0.0], "z": [1.0]})))
    assert done.returncode == 2 and "no variable in common" in done.stderr


def test_a_page_is_written_again_whatever_the_name_of_the_file(aso_ftc, write):
    # HTML writes &amp; for &.
    file = write("R&D.csv", frame())
    for _ in range(2):
        report(aso_ftc, file)


TRACE = """(0.001000) can0 100#0102
(0.001500) can0 00000101#
(0.002000) can0 100#0102
(0.005000) can0 100##1AA
(0.005000) can1 100#R
(0.006000) can0 20000088#0000000000000000
"""


def test_the_frames_of_a_bus_trace_are_counted_and_drawn_at_their_times(aso_ftc, write, tmp_path):
    trace = tmp_path / "trace.log"
    trace.write_text(TRACE, encoding="utf-8")
    page, _ = report(aso_ftc, write("own.csv", frame()), "--bus-trace", trace)
    frames = table(page, "frames")
    assert set(frames) == {"can0 100", "can0 00000101", "can1 100", "can0 error"}
    times = np.array([0.001, 0.002, 0.005])
    gaps = 1e3 * np.diff(times)
    assert frames["can0 100"] == pytest.approx([3, times[0], times[-1], gaps.min(), gaps.mean(), gaps.max()])
    assert frames["can1 100"][:3] == [1, 0.005, 0.005] and np.isnan(frames["can1 100"][3:]).all()
    curve = curves(page)["can0 100"]
    assert curve["dots"] and not curves(page)["a"]["dots"]
    rows = np.isfinite(curve["values"])
    assert np.allclose([curve["time"][rows], curve["values"][rows]], [times[1:], gaps])
    part, _ = report(aso_ftc, write("own.csv", frame()), "--bus-trace", trace, "--to", 0.002, "--out", tmp_path / "part.html")
    counts = {name: row[0] for name, row in table(part, "frames").items()}
    assert counts == {"can0 100": 2, "can0 00000101": 1}


def test_a_line_of_a_trace_that_is_no_frame_is_named(aso_ftc, write, tmp_path):
    trace = tmp_path / "trace.asc"
    trace.write_text("\n date Thu Jan 1\n", encoding="utf-8")
    done = aso_ftc("report", write("own.csv", frame()), "--bus-trace", trace)
    assert done.returncode == 2
    for part in ("trace.asc: line 2", "date Thu Jan 1", "--bus-trace NAME.log"):
        assert part in done.stderr, done.stderr
    done = aso_ftc("report", write("own.csv", frame()), "--bus-trace", tmp_path / "none.log")
    assert done.returncode == 2 and "none.log" in done.stderr


@pytest.fixture(scope="module")
def of_a_run(aso_ftc, tmp_path_factory):
    """The page of a run with a warning."""
    folder = tmp_path_factory.mktemp("run")
    fmus = [ROOT / "dist" / f"{name}.fmu" for name in ("FrictionPendulum", "AsoController")]
    done = aso_ftc("run", *fmus, "--stop-time", 5, "--out", folder, "--report")
    assert done.returncode == 0, done.stderr
    return folder / "results.html"


def test_the_report_of_a_run_has_its_system_its_algorithm_and_units(of_a_run):
    page = html.parse(of_a_run).getroot()
    text = page.text_content()
    assert "FrictionPendulum: model FrictionPendulum, FMI 2.0" in text and "algorithm: gauss-seidel" in text
    boxes = page.xpath("//*[@class='graph']//*[local-name()='rect']")
    assert len(boxes) == 2 and "AsoController.u to FrictionPendulum.u" in re.sub(r"\s+", " ", text)
    assert "rad" in {plot["unit"] for plot in data(page)["plots"]}


def in_a_browser(page, folder, script):
    """The page after `script`, which follows its own scripts."""
    text = page.read_text(encoding="utf-8").replace("</body>", f"<script>{script}</script></body>")
    probe = folder / "probe.html"
    probe.write_text(text, encoding="utf-8")
    words = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}"]
    words += ["--virtual-time-budget=8000", "--enable-logging=stderr", "--dump-dom", probe.as_uri()]
    done = subprocess.run([BROWSER, *words], capture_output=True, text=True, timeout=120, check=True)
    assert "CONSOLE" not in done.stderr, done.stderr
    return html.fromstring(done.stdout)


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_a_browser_draws_every_plot_without_an_error_or_a_request(of_a_run, tmp_path):
    script = "document.title = performance.getEntriesByType('resource').length;"
    script += "setInterval(() => document.querySelectorAll('#more details').forEach((fold) => { fold.open = true; }), 100)"
    page = in_a_browser(of_a_run, tmp_path, script)
    assert len(page.xpath("//figure//canvas")) == len(data(page)["plots"]) > 2
    assert page.xpath("//title")[0].text == "0"


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_the_controls_zoom_all_plots_and_show_the_difference(aso_ftc, write, tmp_path):
    report(aso_ftc, write("own.csv", frame()), "--against", write("other.csv", frame(137, 0.25)))
    with browser(tmp_path / "profile") as page:
        page.open((tmp_path / "own.html").as_uri())
        page.evaluate("""
            globalThis.id = (name) => document.getElementById(name);
            globalThis.range = () => [Number(id("from").value), Number(id("to").value)];
            globalThis.curves = () => document.querySelectorAll(".u-legend .u-series").length""")
        page.until(DRAWN)
        readings = page.evaluate("""(() => {
            const found = [range(), curves()];
            id("closer").click(); found.push(range());
            id("later").click(); found.push(range());
            id("from").value = 1; id("to").value = 2; id("controls").requestSubmit(); found.push(range());
            document.querySelector("input[value=difference]").click(); found.push(range());
            return found;
        })()""")
        page.until(f"curves() === {readings[1]} - 3")
        page.evaluate("id('all').click()")
        readings += [page.evaluate("curves()"), page.evaluate("range()")]
        # Firefox keeps a choice when the page is loaded again.
        text = (tmp_path / "own.html").read_text(encoding="utf-8").replace('value="both" checked', 'value="both"')
        (tmp_path / "own.html").write_text(text.replace('value="difference"', 'value="difference" checked'), encoding="utf-8")
        page.open((tmp_path / "own.html").as_uri())
        page.until(DRAWN)
        assert page.evaluate("document.querySelectorAll('.u-legend .u-series').length") == readings[-2]
    whole, both, closer, later, typed, compared, differences, end = readings
    assert (whole, closer, later, typed, compared, end) == ([0, 4], [1, 3], [2, 4], [1, 2], [1, 2], [0, 4])
    # Each plot has a line for the time, and one for each curve.
    assert both - differences == 3


def show(page, low, high):
    """Zooms all plots."""
    page.evaluate(f"""(() => {{
        document.getElementById("from").value = {low};
        document.getElementById("to").value = {high};
        document.getElementById("controls").requestSubmit();
    }})()""")


def read(page, figure, part):
    """What a plot shows below the cursor: the time, and the value of each curve."""
    element = f"document.querySelectorAll('figure')[{figure}]"
    page.evaluate(f"{element}.scrollIntoView()")
    box = page.evaluate(f"{element}.querySelector('.u-over').getBoundingClientRect().toJSON()")
    place = {"x": box["left"] + part * box["width"], "y": box["top"] + box["height"] / 2}
    page.call("Input.dispatchMouseEvent", type="mouseMoved", **place)
    return legend(page, figure)


def legend(page, figure):
    """What a plot shows at the cursor: the time, and the value of each curve."""
    cells = page.evaluate(f"""Array.from(
        document.querySelectorAll("figure")[{figure}].querySelectorAll(".u-series"),
        (row) => [row.querySelector(".u-label").textContent, row.querySelector(".u-value").textContent])""")
    (_, time), *values = cells
    return float(time), {name: np.nan if text == "–" else float(text) for name, text in values}


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_the_values_at_the_cursor_are_those_of_the_row_at_the_stated_time(aso_ftc, write, tmp_path):
    results = noise(10_001, 26)
    results.loc[::3, "x3"] = np.nan
    report(aso_ftc, write("own.csv", results))
    assert (tmp_path / "own.html").stat().st_size < 4e6  # Noise; the paper's run has 1.6 MB.
    times, names = results["time"].to_numpy(), set()
    with browser(tmp_path / "profile") as page:
        page.open((tmp_path / "own.html").as_uri())
        page.until(DRAWN)
        for low, high in ((0, 10), (4.0, 4.03), (0, 0.3)):
            show(page, low, high)
            for figure in range(page.evaluate("document.querySelectorAll('figure').length")):
                for part in (0.003, 0.21, 0.5, 0.77, 0.997):
                    time, values = read(page, figure, part)
                    at = np.abs(times - (low + part * (high - low))).argmin()
                    # The pointer and the end of the axis are on whole pixels.
                    width = page.evaluate(f"document.querySelectorAll('figure .u-over')[{figure}].clientWidth")
                    assert abs(time - times[at]) <= 2 * (high - low) / width + 1.01 * np.diff(times).max()
                    row = results.iloc[np.flatnonzero(times == time)[0]]
                    np.testing.assert_array_equal(list(values.values()), row[list(values)])
                    names |= set(values)
        assert names == set(results.columns[1:]) and not page.complaints


def inked(page, colour):
    """The columns of the first canvas with pixels of a colour."""
    red, green, blue = bytes.fromhex(colour)
    return page.evaluate(f"""(() => {{
        const canvas = document.querySelector("figure canvas");
        const {{ data, width, height }} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        const near = (at, value) => 40 > Math.abs(data[at] - value);
        return Array.from({{ length: width }}, (_, x) => {{
            let count = 0;
            for (let y = 0; height > y; y++) {{
                const at = 4 * (y * width + x);
                if (data[at + 3] > 128 && near(at, {red}) && near(at + 1, {green}) && near(at + 2, {blue})) count++;
            }}
            return count;
        }});
    }})()""")


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_a_peak_of_one_row_stays_as_narrow_as_it_is_in_every_zoom(aso_ftc, write, tmp_path):
    results = pd.DataFrame({"time": np.arange(500_001) * 1e-3, "x": 0.0})
    results.loc[250_000, "x"] = 1.0
    report(aso_ftc, write("own.parquet", results))
    with browser(tmp_path / "profile") as page:
        page.open((tmp_path / "own.html").as_uri())
        page.until(DRAWN)
        for length in (500.0, 5.0, 0.5):
            show(page, 250 - length / 2, 250 + length / 2)
            page.evaluate("new Promise((resume) => { requestAnimationFrame(() => requestAnimationFrame(resume)); })")
            columns = np.array(inked(page, "0072b2"))
            wide = (columns > 8).sum()
            # The flanks have 1 ms each.
            assert 1 <= wide <= 4 + 2.2e-3 / length * columns.size, (length, wide)


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_values_between_empty_cells_are_drawn_as_points_or_held(aso_ftc, write, tmp_path):
    results = rates()
    report(aso_ftc, write("own.csv", results))
    polars.DataFrame(
        {"time": results["time"].to_numpy(), "fast": results["fast"].to_numpy(), "slow": [10, None, 20, None, 30, None, 40]},
        schema_overrides={"slow": polars.Int32},
    ).write_parquet(tmp_path / "held.parquet")
    report(aso_ftc, tmp_path / "held.parquet")
    with browser(tmp_path / "profile") as page:
        page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "light"}])
        page.open((tmp_path / "own.html").as_uri())
        page.until(DRAWN)
        columns = np.array(inked(page, "d55e00")) > 0
        # The start and the end of each group of columns: four points.
        assert (np.diff(columns.astype(int)) == 1).sum() == 4
        assert read(page, 0, 0.49)[1] == {"fast": 3, "slow": pytest.approx(np.nan, nan_ok=True)}
        page.open((tmp_path / "held.html").as_uri())
        page.until(DRAWN)
        columns = np.flatnonzero(np.array(inked(page, "d55e00")) > 0)
        assert (np.diff(columns) == 1).all() and columns.size > 800


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_the_label_of_each_tick_is_its_value_also_of_a_single_one(aso_ftc, write, tmp_path):
    report(aso_ftc, write("own.csv", frame()))
    single = [(12.1, 12.91), (0.21, 0.291), (-0.291, -0.21), (1.7e9 + 0.21, 1.7e9 + 0.291)]
    several = [(0.0, 1.0), (0.0, 3e6), (1e-7, 5e-7), (1.7e9, 1.7e9 + 10), (1.7e9, 1.7e9 + 0.004)]
    script = "((places) => [places, ticks.labels(places, {0}, {1}, 4, false)])(ticks.places({0}, {1}, 4, false))"
    with browser(tmp_path / "profile") as page:
        page.open((tmp_path / "own.html").as_uri())
        for low, high in single + several:
            places, labels = page.evaluate(script.format(low, high))
            assert (len(places) == 1) == ((low, high) in single)
            assert [float(label.replace("−", "-")) for label in labels] == pytest.approx(places, rel=1e-15, abs=1e-6 * (high - low))
        # Seconds since 1970 in as many letters as they have digits.
        assert page.evaluate(script.format(1.7e9, 1.7e9 + 10))[1][1] == "1700000005"


# Notes the texts that each canvas shows: text, left and right end, and whether it is below the plot.
TEXTS = """
    globalThis.texts = new Map();
    const { clearRect, fillText } = CanvasRenderingContext2D.prototype;
    CanvasRenderingContext2D.prototype.clearRect = function (...place) {
        texts.set(this.canvas, []);
        clearRect.apply(this, place);
    };
    CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
        const half = this.measureText(text).width / 2;
        texts.get(this.canvas).push([text, x - half, x + half, this.textAlign === "center"]);
        fillText.call(this, text, x, y);
    };"""


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
@pytest.mark.parametrize("width", [1200, 390])
def test_labels_of_ticks_are_whole_and_apart_and_above_1e32_too(aso_ftc, write, tmp_path, width):
    time = 1.7e9 + np.linspace(0, 10, 1001)
    report(aso_ftc, write("own.csv", pd.DataFrame({"time": time, "x": np.sin(time), "large": 1e40 * np.sin(time)})))
    with browser(tmp_path / "profile", width) as page:
        page.call("Page.addScriptToEvaluateOnNewDocument", source=TEXTS)
        page.open((tmp_path / "own.html").as_uri())
        page.until(DRAWN)
        for low, high in [(0, 10), (0.5, 8.3), (3.3, 3.34), (4, 5)]:
            show(page, 1.7e9 + low, 1.7e9 + high)
            plots = page.evaluate("Promise.resolve().then(() => Array.from(texts, ([{ width }, list]) => [width, list]))")
            assert len(plots) == 2
            for end, labels in plots:
                below = [(left, right) for text, left, right, isBelow in labels if isBelow and text != "time in s"]
                assert below and below[-1][1] <= end
                assert all(right < left for (_, right), (left, _) in zip(below, below[1:], strict=False))
            assert any("e+" in text for text, *_ in plots[1][1])


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_a_range_above_the_largest_number_is_drawn_and_a_long_name_fits_a_narrow_screen(aso_ftc, write, tmp_path):
    report(aso_ftc, write("own.csv", pd.DataFrame({"time": [0.0, 10.0], 10 * "a_long_name.": [-1.7e308, 1.7e308]})))
    with browser(tmp_path / "profile", 390) as page:
        page.call("Page.addScriptToEvaluateOnNewDocument", source=TEXTS)
        page.open((tmp_path / "own.html").as_uri())
        page.until(DRAWN)
        width, beyond = page.evaluate("[document.querySelector('.u-over').clientWidth, document.documentElement.scrollWidth - innerWidth]")
        assert beyond <= 0
        # The axis ends at half of the largest number: the straight line is inside for this part of the time.
        assert (np.array(inked(page, "0072b2")) > 0).sum() == pytest.approx(width * 1.797 / 3.4, rel=0.03)
        assert "5e+307" in page.evaluate("Array.from(texts.values()).flat().map(([text]) => text)")
        # A4 has 180 mm between its margins.
        page.call("Emulation.setDeviceMetricsOverride", width=680, height=900, deviceScaleFactor=1, mobile=False)
        page.call("Emulation.setEmulatedMedia", media="print")
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_without_javascript_there_are_a_picture_and_the_tables_but_no_controls(aso_ftc, write, tmp_path):
    report(aso_ftc, write("own.csv", frame()))
    with browser(tmp_path / "profile") as page:
        page.call("Emulation.setScriptExecutionDisabled", value=True)
        page.open((tmp_path / "own.html").as_uri())
        heights = "['noscript svg', 'table', '#controls'].map((place) => document.querySelector(place).getBoundingClientRect().height)"
        picture, table, controls = page.evaluate(heights)
        assert picture > 300 and table > 50 and controls == 0


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_rows_at_one_time_are_drawn_also_where_times_are_seconds_apart(aso_ftc, write, tmp_path):
    with browser(tmp_path / "profile") as page:
        # The next number after 1e15 is 0.125 away, that after 1e17 is 16 away.
        for time in (1e15, 1e17):
            report(aso_ftc, write("own.csv", pd.DataFrame({"time": [time, time], "x": [0.0, 1.0]})))
            page.open((tmp_path / "own.html").as_uri())
            page.until(DRAWN)
            assert read(page, 0, 0.5) == (time, {"x": 1.0})


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_the_keyboard_reaches_each_row_of_an_event(aso_ftc, write, tmp_path):
    results = pd.DataFrame({"time": [0.0, 1.0, 1.0, 1.0, 2.0], "x": [0.0, 1.0, -1.0, 3.0, 5.0]})
    report(aso_ftc, write("own.csv", results))
    with browser(tmp_path / "profile") as page:
        page.open((tmp_path / "own.html").as_uri())
        page.until(DRAWN)
        read(page, 0, 0.001)
        page.evaluate("document.querySelector('.uplot').focus()")
        rows = []
        for _ in range(4):
            page.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowRight")
            page.evaluate("new Promise((resume) => { requestAnimationFrame(resume); })")
            time, values = legend(page, 0)
            rows.append((time, values["x"]))
        assert rows == list(results.iloc[1:].itertuples(index=False, name=None))


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_a_plot_without_all_rows_says_so_and_names_the_command_for_them(aso_ftc, write, tmp_path):
    results = noise(300_000, 12)
    report(aso_ftc, write("own.parquet", results))
    with browser(tmp_path / "profile") as page:
        page.open((tmp_path / "own.html").as_uri())
        page.until(DRAWN)
        rows = page.evaluate("JSON.parse(document.getElementById('data').textContent).grids[0].rows")
        assert f"{rows:,} of 300,000 rows" in page.evaluate("document.querySelector('figcaption').textContent")
        show(page, 40, 40.3)
        time, values = read(page, 0, 0.4)
        row = results.iloc[np.flatnonzero(results["time"] == time)[0]]
        np.testing.assert_array_equal(list(values.values()), row[list(values)])
        command = page.evaluate("document.querySelector('figcaption code').textContent")
    words = shlex.split(command)
    assert words[:2] == ["aso-ftc", "report"]
    words[words.index("part.html")] = tmp_path / "part.html"
    page, _ = report(aso_ftc, *words[2:])
    part = results[(results["time"] >= 40) & (results["time"] <= 40.3)]
    for name, curve in curves(page).items():
        assert curve["total"] == len(part) and (curve["values"] == part[name]).all()
    assert "Rows from t = 40 s to t = 40.3 s only." in page.text_content()
    page, _ = report(aso_ftc, tmp_path / "own.parquet", "--to", 0.5, "--out", tmp_path / "start.html")
    assert "Rows up to t = 0.5 s only." in page.text_content()
    done = aso_ftc("report", tmp_path / "own.parquet", "--from", 400, "--force")
    assert done.returncode == 2 and "no row from t = 400 s on" in done.stderr


@pytest.fixture(scope="module")
def of_many_signals(aso_ftc, tmp_path_factory):
    """The page of 200 signals, 11 of which do not change."""
    time = np.linspace(0.0, 10.0, 501)
    signals = {f"{'plant' if k < 100 else 'controller'}.x{k}": np.sin(time + k) for k in range(189)}
    signals |= {f"plant.p{k}": np.full(time.size, k + 0.25) for k in range(11)}
    file = tmp_path_factory.mktemp("many") / "own.csv"
    pd.DataFrame({"time": time, **signals}).to_csv(file, index=False)
    page, _ = report(aso_ftc, file)
    return file.with_suffix(".html"), page


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_a_page_of_200_signals_is_short_and_its_filter_finds_each(of_many_signals, tmp_path):
    path, page = of_many_signals
    assert unchanged(page) == {f"plant.p{k}": k + 0.25 for k in range(11)}
    assert "11 signals do not change" in page.xpath("//details[@id='unchanged']/summary")[0].text_content()
    with browser(tmp_path / "profile", 1280, 900) as page:
        page.open(path.as_uri())
        page.until(DRAWN)
        assert page.evaluate("document.documentElement.scrollHeight") < 3000
        page.evaluate("""(() => {
            const filter = document.getElementById("filter");
            filter.value = "controller X17";
            filter.dispatchEvent(new Event("input"));
        })()""")
        page.until("document.querySelectorAll('figure:not([hidden]) .uplot').length === 2")
        shown = "[...document.querySelectorAll('figure:not([hidden]) .u-series:not(.u-off) .u-label')].map((label) => label.textContent)"
        expected = {"t in s", *(f"controller.x{k}" for k in range(170, 180))}
        page.until(f"new Set({shown}).size === {len(expected)}")
        assert set(page.evaluate(shown)) == expected
        assert page.evaluate("document.getElementById('found').textContent") == "10 of 200 signals"
        # The legends keep the time of the cursor.
        times = "[...document.querySelectorAll('figure:not([hidden]) .u-series:first-child')].map((row) => row.getClientRects().length)"
        page.evaluate("document.getElementById('filter').dispatchEvent(new Event('input'))")
        assert set(page.evaluate(times)) == {1}
        assert not page.complaints


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_the_second_cursor_and_the_vertical_zoom_work_by_mouse_and_keyboard(aso_ftc, write, tmp_path):
    results = frame()
    report(aso_ftc, write("own.csv", results))
    frames = "new Promise((done) => { requestAnimationFrame(() => requestAnimationFrame(done)); })"

    def cells(page):
        return page.evaluate(f"{frames}.then(() => [...document.querySelectorAll('figure .u-value')].map((cell) => cell.textContent))")

    def assert_differences(page, at, other):
        """The legend has the values of a row, and the differences to another row."""
        for name, cell in zip(["time", "a", "b", "on"], cells(page), strict=True):
            value, difference = re.fullmatch(r"(\S+) \(Δ (\S+)\)", cell).groups()
            assert float(value) == results[name][at]
            assert float(difference) == pytest.approx(results[name][at] - results[name][other], rel=1e-5, abs=1e-12)

    def row(page):
        return int(np.flatnonzero(results["time"] == float(cells(page)[0].split(" ")[0]))[0])

    def key(page, name):
        page.call("Input.dispatchKeyEvent", type="keyDown", key=name)

    def spread(page):
        """The length of the vertical axis, from the heights at which two values are marked."""
        one, other = (float(cell.split(" ")[0]) for cell in cells(page)[1:3])
        marks = "[...document.querySelectorAll('.at-cursor')].map((mark) => Number(mark.style.translate.split(' ')[1].slice(0, -2)))"
        high, low = page.evaluate(marks)[:2]
        return page.evaluate("document.querySelector('.u-over').clientHeight") * (one - other) / (low - high)

    with browser(tmp_path / "profile") as page:
        page.open((tmp_path / "own.html").as_uri())
        page.until(DRAWN)
        read(page, 0, 0.25)
        first = row(page)
        ((x, y),) = page.places("figure .u-over", [0.25])
        for kind in ("mousePressed", "mouseReleased"):
            page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
        ((x, y),) = page.places("figure .u-over", [0.75])
        page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        second = row(page)
        assert second > first
        assert_differences(page, second, first)
        page.evaluate("document.querySelector('.uplot').focus()")
        key(page, "ArrowRight")
        assert_differences(page, row(page), first)
        assert page.evaluate("[difference(3, 1), difference(3, null), difference(3, NaN)]") == [" (Δ 2)", " (Δ –)", " (Δ –)"]
        key(page, "Escape")
        assert "Δ" not in "".join(cells(page))
        third = row(page)
        key(page, " ")
        key(page, "ArrowLeft")
        assert_differences(page, row(page), third)
        # A drag down selects a part of the vertical axis, and leaves the axis of time.
        labels = "document.querySelector('#from').value + ' ' + document.querySelector('#to').value"
        whole = page.evaluate(labels)
        before = spread(page)
        page.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y - 30, button="left", clickCount=1)
        for move in (0, 30):
            page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y + move, button="left", buttons=1)
        page.call("Input.dispatchMouseEvent", type="mouseReleased", x=x, y=y + 30, button="left", clickCount=1)
        height = page.evaluate("document.querySelector('.u-over').clientHeight")
        assert spread(page) == pytest.approx(before * 60 / height, rel=0.05) and page.evaluate(labels) == whole
        key(page, "0")
        assert spread(page) == pytest.approx(before, rel=1e-3)
        key(page, "ArrowUp")
        assert spread(page) == pytest.approx(0.8 * before, rel=1e-3)
        page.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=100, modifiers=8)
        assert spread(page) == pytest.approx(before, rel=1e-3)
        assert not page.complaints


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_changes_faults_and_messages_of_a_run_are_marked_at_their_times(aso_ftc, tmp_path):
    fmus = {name: ROOT / "dist" / f"{fmu}.fmu" for name, fmu in (("plant", "FrictionPendulum"), ("controller", "AsoController"))}
    (tmp_path / "system.toml").write_text(
        "[experiment]\nstop-time = 3\n[fmus]\n"
        + "".join(f'{name} = "{path}"\n' for name, path in fmus.items())
        + '[[scenario.set]]\nvariable = "plant.F_c"\nat = 1\nvalue = 9\n'
        + '[[scenario.fault]]\nconnection = "controller.x_p"\nbias = { value = 0.001, from = 1.5, until = 2 }\n',
        encoding="utf-8",
    )
    done = aso_ftc("run", tmp_path / "system.toml", "--out", tmp_path, "--report")
    assert done.returncode == 0, done.stderr
    page = html.parse(tmp_path / "results.html").getroot()
    marks = {mark["kind"]: mark for mark in data(page)["marks"]}
    assert (marks["change"]["time"], marks["change"]["text"]) == (1, "plant.F_c = 9.0")
    assert (marks["fault"]["time"], marks["fault"]["end"]) == (1.5, 2) and "bias" in marks["fault"]["text"]
    shown = [curve["name"] for plot in data(page)["plots"] if plot["shown"] for curve in plot["curves"]]
    # Outputs, connected or not, and the input with the fault; other inputs follow their sources.
    assert {"plant.x_p", "plant.theta", "controller.u", "controller.x_p"} <= set(shown)
    assert not {"controller.theta", "plant.u"} & set(shown)
    with browser(tmp_path / "profile") as page:
        page.open((tmp_path / "results.html").as_uri())
        page.until(DRAWN)
        page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "light"}])
        read(page, 0, 1.75 / 3)
        said = page.evaluate("document.querySelector('.happening').textContent")
        assert said.startswith("t = 1.5 s, fault: controller.x_p: bias")
        page.until(DRAWN)
        # The bar of the fault, in its colour.
        box, width = (page.evaluate(f"document.querySelector('{name}').clientWidth") for name in (".u-over", "figure canvas"))
        left = page.evaluate("document.querySelector('.u-over').offsetLeft")
        bar = np.flatnonzero(np.array(inked(page, "a83200")) > 2)
        assert np.median(bar) == pytest.approx(left + 1.75 / 3 * box, abs=0.02 * width) and bar.size > 0.1 * box


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_axe_finds_nothing_serious_in_the_reports_of_runs_and_designs(aso_ftc, of_a_run, write, tmp_path):
    report(aso_ftc, write("own.csv", frame()), "--against", write("other.csv", frame(137, 0.25)))
    plant = ROOT / "examples" / "plants" / "quadruple-tank.toml"
    outputs = ("--out", tmp_path / "design.toml", "--report", tmp_path / "design.html")
    done = aso_ftc("design", plant, *outputs)
    assert done.returncode in (0, 1), done.stderr
    with browser(tmp_path / "profile") as page:
        for file in (of_a_run, tmp_path / "own.html", tmp_path / "design.html"):
            page.open(file.as_uri())
            page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
            page.evaluate("document.querySelector('#figures, #step-1-1').scrollIntoView()")
            page.until("document.querySelector('.uplot') !== null")
            assert page.violations() == [], file
