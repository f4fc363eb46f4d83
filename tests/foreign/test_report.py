"""Reports of runs: statistics and differences against numpy; the page in a browser."""

import json
import re
import shutil
import subprocess

import numpy as np
import pandas as pd
import pytest
from lxml import html

from browser import browser
from conftest import ROOT

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")


def table(page, identifier):
    """The rows of the table in a section, by the name of the variable; all digits."""
    section = page.xpath(f"//section[@aria-labelledby='{identifier}']")[0]
    return {
        row.xpath("./th")[0].text_content(): [float(cell.get("title")) for cell in row.xpath("./td[@title]")]
        for row in section.xpath(".//tbody/tr")
    }


def curves(page):
    """Times and values of the curves, by variable."""
    plots = json.loads(page.xpath("//script[@id='data']")[0].text)
    return {curve["name"]: curve for plot in plots for curve in plot["curves"]}


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
    return html.parse(done.stdout.splitlines()[-1]).getroot(), done.stdout


@pytest.mark.parametrize("name", ["own.csv", "own.parquet"])
def test_statistics_are_those_of_numpy_for_files_of_pandas(aso_ftc, write, name):
    own = frame()
    page, _ = report(aso_ftc, write(name, own))
    found, time = table(page, "statistics"), own["time"].to_numpy()
    for variable in ["a", "b"]:
        values = own[variable].to_numpy()
        low, high = values.argmin(), values.argmax()
        mean = np.trapezoid(values, time) / 4
        rms = np.sqrt(np.trapezoid(values**2, time) / 4)
        expected = [values[0], values[-1], values[low], time[low], values[high], time[high], mean, rms]
        assert np.allclose(found[variable], expected, rtol=1e-12, atol=1e-12)


def test_the_difference_is_that_to_the_interpolated_other_run(aso_ftc, write):
    own, other = frame(), frame(137, 0.25)
    page, said = report(aso_ftc, write("own.csv", own), "--against", write("other.csv", other.drop(columns="b")))
    there = np.interp(own["time"], other["time"], other["a"])
    expected = own["a"] - there
    at = np.abs(expected).argmax()
    scale = max(own["a"].max(), there.max()) - min(own["a"].min(), there.min())
    found = table(page, "differences")
    assert np.allclose(
        found["a"],
        [np.abs(expected).max(), own["time"][at], np.sqrt(np.mean(expected**2)), np.abs(expected).max() / scale],
        rtol=1e-9,
    )
    assert "b" not in found and "Only in this run: b." in page.text_content()
    assert "largest difference to" in said
    times, values = curves(page)["a"]["difference"]
    assert np.allclose(values, np.interp(times, own["time"], expected), atol=1e-6)


def test_equal_runs_have_no_difference_at_events_either(aso_ftc, write):
    own = pd.DataFrame({"time": [0.0, 1.0, 1.0, 2.0], "x": [0.0, 1.0, -1.0, 5.0]})
    page, said = report(aso_ftc, write("own.csv", own), "--against", write("other.csv", own))
    assert "no difference" in said and table(page, "differences")["x"][0] == 0
    assert curves(page)["x"]["own"] == [[0.0, 1.0, 1.0, 2.0], [0.0, 1.0, -1.0, 5.0]]


def test_a_peak_of_one_row_in_a_million_is_in_the_plot(aso_ftc, write):
    values = np.zeros(1_000_000)
    values[123_457] = 7.0
    own = pd.DataFrame({"time": np.arange(values.size) * 1e-3, "x": values})
    page, _ = report(aso_ftc, write("own.parquet", own))
    times, shown = curves(page)["x"]["own"]
    assert len(times) <= 8_500 and abs(times[shown.index(7.0)] - 123.457) < 1e-9


def test_texts_and_values_that_are_not_finite_are_named(aso_ftc, write):
    own = pd.DataFrame({"time": [0.0, 1.0, 2.0], "x": [1.0, np.nan, 3.0], "mode": ["a", "b", "c"]})
    page, _ = report(aso_ftc, write("own.csv", own))
    assert "Texts are not shown: mode." in page.text_content()
    assert curves(page)["x"]["own"][1] == [1.0, None, 3.0]


def test_names_with_markup_remain_text(aso_ftc, write):
    name = "</script><script>alert(1)</script>"
    page, _ = report(aso_ftc, write("own.csv", pd.DataFrame({"time": [0.0, 1.0], name: [0.0, 1.0]})))
    assert name in curves(page) and len(page.xpath("//script")) == 3


def test_nothing_of_others_is_overwritten(aso_ftc, write, tmp_path):
    own, page = write("own.csv", frame()), tmp_path / "own.html"
    page.write_text("mine", encoding="utf-8")
    done = aso_ftc("report", own)
    assert done.returncode == 2 and "--force" in done.stderr and page.read_text(encoding="utf-8") == "mine"
    assert aso_ftc("report", own, "--force").returncode == 0 == aso_ftc("report", own).returncode
    done = aso_ftc("report", own, "--out", own)
    assert done.returncode == 2 and own.read_text(encoding="utf-8").startswith("time")
    done = aso_ftc("report", own, "--against", write("apart.csv", pd.DataFrame({"time": [0.0], "z": [1.0]})))
    assert done.returncode == 2 and "no variable in common" in done.stderr


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
    found = table(page, "frames")
    assert set(found) == {"can0 100", "can0 00000101", "can1 100", "can0 error"}
    times = np.array([0.001, 0.002, 0.005])
    gaps = 1e3 * np.diff(times)
    assert found["can0 100"] == pytest.approx([3, times[0], times[-1], gaps.min(), gaps.mean(), gaps.max()])
    assert found["can1 100"][:3] == [1, 0.005, 0.005] and np.isnan(found["can1 100"][3:]).all()
    curve = curves(page)["can0 100"]
    assert curve["dots"] and not curves(page)["a"]["dots"]
    assert np.allclose(curve["own"], [times[1:], gaps])


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
    boxes = page.xpath("//*[local-name()='rect']")
    assert len(boxes) == 2 and "AsoController.u to FrictionPendulum.u" in re.sub(r"\s+", " ", text)
    plots = json.loads(page.xpath("//script[@id='data']")[0].text)
    assert "rad" in {plot["unit"] for plot in plots}


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
    script = "document.title = performance.getEntriesByType('resource').length"
    page = in_a_browser(of_a_run, tmp_path, script)
    plots = json.loads(page.xpath("//script[@id='data']")[0].text)
    assert len(page.xpath("//figure//canvas")) == len(plots) > 2
    assert page.xpath("//title")[0].text == "0"


@pytest.mark.skipif(not BROWSER, reason="no Chromium is installed")
def test_the_controls_zoom_all_plots_and_show_the_difference(aso_ftc, write, tmp_path):
    report(aso_ftc, write("own.csv", frame()), "--against", write("other.csv", frame(137, 0.25)))
    script = """
    const id = (name) => document.getElementById(name);
    const range = () => [Number(id("from").value), Number(id("to").value)];
    const curves = () => document.querySelectorAll(".u-legend .u-series").length;
    const found = [range(), curves()];
    id("closer").click(); found.push(range());
    id("later").click(); found.push(range());
    id("from").value = 1; id("to").value = 2; id("controls").requestSubmit(); found.push(range());
    document.querySelector("input[value=difference]").click(); found.push(range(), curves());
    id("all").click(); found.push(range());
    document.title = JSON.stringify(found);"""
    found = json.loads(in_a_browser(tmp_path / "own.html", tmp_path, script).xpath("//title")[0].text)
    whole, both, closer, later, typed, kept, differences, end = found
    assert (whole, closer, later, typed, kept, end) == ([0, 4], [1, 3], [2, 4], [1, 2], [1, 2], [0, 4])
    # Each plot has a line for the time, and one for each curve.
    assert both - differences == 3


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
            page.evaluate("document.querySelector('#figures, #step-1-1').scrollIntoView()")
            page.until("document.querySelector('.uplot') !== null")
            assert page.violations() == [], file
