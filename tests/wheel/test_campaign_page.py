"""The page of a campaign: one file, no requests, escaped names, the numbers of the analysis."""

import base64
import html.parser
import json
import re
import shutil
import subprocess
import time
import zlib

import numpy as np
import pytest
from aso_ftc import ConfigurationError, ResultsError
from SALib.sample import sobol

from campaign_folder import campaign, fault_campaign, ishigami, problem, random_campaign, write

HOSTILE = "</script><script>alert(1)</script><img src=http://example.com/x onerror=alert(2)>\"'&%{x}"


class Page(html.parser.HTMLParser):
    """Tags with their attributes, text outside scripts and styles, and the data of the pictures."""

    def __init__(self, path):
        super().__init__()
        self.tags, self.text, self.packed, self.inside = [], "", {"data": "", "plotly": ""}, None
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)
        self.data, self.library = json.loads(self.unpacked("data")), self.unpacked("plotly")

    def unpacked(self, name):
        """The text of a compressed script element."""
        return zlib.decompress(base64.b85decode(self.packed[name].replace("'", "<")), -15).decode()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self.inside = (tag, dict(attrs).get("id")) if tag in ("script", "style") else None

    def handle_endtag(self, tag):
        self.inside = None

    def handle_data(self, data):
        if self.inside is None:
            self.text += data
        elif self.inside in (("script", "data"), ("script", "plotly")):
            self.packed[self.inside[1]] += data

    def column(self, name, kind):
        (column,) = [entry for entry in self.data["columns"] if (entry["name"], entry["kind"]) == (name, kind)]
        labels = column.get("labels")
        return [labels[value] for value in column["values"]] if labels else column["values"]


def page(outcome, path):
    assert outcome.page(path) == path
    return Page(path)


def test_the_page_is_one_file_that_makes_no_request(tmp_path):
    document = page(random_campaign(tmp_path / "c", np.linspace(0, 2, 90), {"below": 1.0}), tmp_path / "p.html")
    names = {name for _, attributes in document.tags for name in attributes}
    assert not names & {"src", "href", "action", "srcset", "data", "poster", "background"}
    policies = [
        attributes["content"] for tag, attributes in document.tags if attributes.get("http-equiv") == "Content-Security-Policy"
    ]
    (policy,) = policies
    assert "default-src 'none'" in policy and "http" not in policy and "connect-src" not in policy
    style = document.source[document.source.index("<style>") : document.source.index("</style>")]
    assert "url(" not in style and "@import" not in style
    assert "need JavaScript" in document.text
    assert "plotly.js v" in document.library and sorted(path.name for path in tmp_path.iterdir()) == [
        "c",
        "p.html",
    ]


def test_hostile_names_are_text(tmp_path):
    columns = {HOSTILE: np.arange(20.0), "kind": np.array([HOSTILE, "b"] * 10, dtype=object)}
    status = ["crashed", *["ok"] * 19]
    measures = {f"m {HOSTILE}": np.arange(20.0)}
    limits = {f"m {HOSTILE}": {"below": 5.0}}
    manifest = {
        "name": HOSTILE,
        "measures": {f"m {HOSTILE}": {"expression": HOSTILE, "unit": HOSTILE}},
        "parameters": [{"name": name, "unit": HOSTILE, "numeric": name != "kind"} for name in columns],
    }
    folder = tmp_path / "c <b>&'\""
    outcome = write(
        folder, {"method": "random"}, columns, measures, limits=limits, status=status, changes=manifest
    )
    document = page(outcome, tmp_path / "p.html")
    assert [tag for tag, _ in document.tags].count("script") == 3
    assert not {tag for tag, _ in document.tags} & {"img", "iframe", "object", "a", "form", "link"}
    assert not [attributes for _, attributes in document.tags if set(attributes) & {"onerror", "onclick", "onload"}]
    assert document.text.count(HOSTILE) > 8 and outcome.command(0) in document.text
    assert document.data["columns"][1]["name"] == HOSTILE and document.data["measures"][0]["unit"] == HOSTILE


def test_the_pictures_have_the_values_of_the_runs(tmp_path):
    generator = np.random.default_rng(2)
    columns = {
        "p": generator.random(700),
        "k": np.array(["b", "a", "c", "a", "b", "c", "a"] * 100, dtype=object),
    }
    values = generator.normal(size=700)
    values[3], values[4] = np.inf, np.nan
    status = ["ok"] * 4 + ["time limit"] + ["ok"] * 695
    outcome = write(tmp_path / "c", {"method": "random"}, columns, {"y": values}, status=status)
    document = page(outcome, tmp_path / "p.html")
    assert document.data["runs"] == list(range(700)) and document.column("status", "status") == status
    assert document.column("k", "input") == list(columns["k"])
    assert np.allclose(document.column("p", "input"), columns["p"], rtol=5e-6)
    drawn = [np.nan if value is None else value for value in document.column("y", "measure")]
    assert np.allclose(drawn, np.where(np.isfinite(values), values, np.nan), rtol=5e-6, equal_nan=True)
    (measure,) = document.data["measures"]
    finite = values[np.isfinite(values)]
    counts, _ = np.histogram(finite, measure["histogram"]["edges"])
    assert measure["histogram"]["counts"] == counts.tolist() and sum(counts) == 698 == len(finite)
    assert measure["histogram"]["others"] == 2 and measure["histogram"]["outside"] == 0 and not measure["logarithmic"]
    assert "5".join(document.data["command"]) == outcome.command(5) and "All runs are drawn" in document.text


def test_outliers_and_decades_do_not_hide_the_distribution(tmp_path):
    values = np.random.default_rng(3).normal(size=(20_000))
    values[7] = -1e30
    measures = {"outlier": values, "decades": 10 ** np.linspace(-6, 3, 20_000)}
    measures["even"] = np.random.default_rng(4).uniform(size=20_000)
    measures["large"] = np.where(np.arange(20_000) == 9, 160.0, measures["even"] + 0.5)
    outcome = write(tmp_path / "c", {"method": "random"}, {"p": np.arange(20_000.0)}, measures)
    outlier, decades, even, large = page(outcome, tmp_path / "p.html").data["measures"]
    assert large["logarithmic"] and not even["logarithmic"]
    assert outlier["histogram"]["edges"][0] > -10
    assert sum(outlier["histogram"]["counts"]) + outlier["histogram"]["outside"] == 20_000
    assert not outlier["logarithmic"] and decades["logarithmic"]
    assert sum(decades["histogram"]["counts"]) == 20_000 and np.ptp(decades["histogram"]["counts"]) <= 2


def test_of_many_runs_all_that_failed_are_drawn(tmp_path):
    count = 200_000
    values = np.random.default_rng(5).random(count)
    status = np.array(["ok"] * count, dtype=object)
    lost = np.arange(100, count, 4000)
    status[lost] = "crashed"
    values[lost] = np.nan
    outcome = random_campaign(tmp_path / "c", values, {"below": 0.999}, status=status, parts=30)
    begin = time.monotonic()
    document = page(outcome, tmp_path / "p.html")
    seconds = time.monotonic() - begin
    outside = np.flatnonzero(values >= 0.999)
    drawn = np.array(document.data["runs"])
    assert len(drawn) == 10_000 == len(set(drawn)) and np.all(np.diff(drawn) > 0)
    assert set(lost) | set(outside) <= set(drawn)
    assert np.allclose(document.column("y", "measure")[1], values[drawn[1]], rtol=5e-6)
    assert (
        f"50 of the 50 runs that did not finish, {len(outside)} of the {len(outside)} runs outside"
        in document.text
    )
    # The others are spread evenly over the run numbers.
    others = np.setdiff1d(drawn, np.concatenate([lost, outside]))
    parts = np.histogram(others, 10, (0, count))[0]
    assert parts.max() - parts.min() < 20
    assert sum(document.data["measures"][0]["histogram"]["counts"]) == count - 50
    assert len(document.source) < 8e6 and seconds < 60


def test_frequent_failures_leave_half_of_the_points_to_the_other_runs(tmp_path):
    values = np.r_[np.full(60_000, 2.0), np.zeros(20_000)]
    document = page(random_campaign(tmp_path / "c", values, {"below": 1.0}), tmp_path / "p.html")
    assert (
        np.count_nonzero(np.array(document.column("y", "measure")) == 2) == 5000 == len(document.data["runs"]) / 2
    )


def test_the_page_opens_on_the_answer(tmp_path):
    generator = np.random.default_rng(8)
    a, b, c = generator.random((3, 5000))
    # A straight border: a fails above 0.5 + b / 4, whatever c is.
    outcome = write(
        tmp_path / "c", {"method": "random"}, {"c": c, "b": b, "a": a}, {"other": c, "y": a - b / 4},
        limits={"y": {"below": 0.5}},
    )  # fmt: skip
    document = page(outcome, tmp_path / "p.html")
    failed = int((a - b / 4 >= 0.5).sum())
    assert f"{failed:,} of 5,000 runs ({100 * failed / 5000:.3g} %) fail: y is not below 0.5." in document.text
    assert "a decides most: rank correlation with y 0.9" in document.text and "; next b, rank correlation with y -0.2" in document.text
    assert ("option", {"value": "1", "selected": None}) in document.tags
    assert document.text.index("fail: y is not below") < document.text.index("What was run")
    border = document.data["border"]
    assert border["names"] == ["a", "b"] and border["measure"] == "y"
    surface = border["surface"]
    for along, row in zip(surface["y"], surface["z"]):
        crossing = np.interp(0.5, row, surface["x"])
        assert crossing == pytest.approx(0.5 + along / 4, abs=0.02)
    assert surface["wrong"] < 0.01 and len(document.source) < 2e6


def test_the_answer_weighs_texts_and_does_not_take_chance_for_evidence(tmp_path):
    generator = np.random.default_rng(5)
    kind = np.array(["stuck", "gain", "bias"] * 6, dtype=object)
    numbers = {name: generator.random(18) for name in ("from", "size", "mass", "rate")}
    values = {"y": np.where((kind == "stuck") & (np.arange(18) < 12), 2.0, generator.random(18))}

    def answer(name, columns):
        outcome = write(tmp_path / name, {"method": "random"}, columns, values, limits={"y": {"below": 1.0}})
        return page(outcome, tmp_path / f"{name}.html").text

    assert "No parameter decides visibly: the strongest is" in answer("c", numbers)
    text = answer("d", {**numbers, "kind": kind})
    # Four failures fall into the same one of three kinds by chance with p = 3 C(6, 4) / C(18, 4).
    stated = re.search(r"kind perhaps decides most: failures from 66.7 % with stuck to 0 % with \w+, p = ([\d.]+)", text)
    assert stated and float(stated[1]) == pytest.approx(3 * 15 / 3060, abs=0.004)
    assert "kind decides most" in answer("e", {"kind": kind})


def test_of_few_failures_no_surface_is_fitted(tmp_path):
    values = np.r_[np.zeros(95), np.full(5, 2.0)]
    outcome = write(
        tmp_path / "c", {"method": "random"}, {"p": values + np.arange(100), "q": np.arange(100.0)}, {"y": values},
        limits={"y": {"below": 1.0}},
    )  # fmt: skip
    document = page(outcome, tmp_path / "p.html")
    assert document.data["border"]["surface"] is None and "Too few runs fail" in document.text
    none = page(random_campaign(tmp_path / "n", np.zeros(100), {"below": 1.0}), tmp_path / "n.html")
    upper = 1 - 0.025 ** (1 / 100)
    assert f"None of the 100 runs fails: y is below 1. The probability of a failure is below {upper:.2g} (95 %)" in none.text


def test_runs_that_did_not_finish_are_a_table_with_their_commands(tmp_path):
    status = ["crashed", "ok"] * 60
    outcome = random_campaign(tmp_path / "c", [0.0] * 120, {"below": 1.0}, status=status)
    document = page(outcome, tmp_path / "p.html")
    assert document.text.count("the FMU ended the process") == 50 == document.source.count('<button class="copy">')
    assert outcome.command(98) in document.text and outcome.command(100) not in document.text
    assert "And 10 more runs." in document.text


def test_the_page_has_the_numbers_of_the_analysis(tmp_path):
    outcome = random_campaign(tmp_path / "c", np.linspace(0, 2, 500), {"below": 1.5})
    document = page(outcome, tmp_path / "p.html")
    chance = outcome.failure_probability("y")
    row = outcome.influence("y").loc["p"]
    for number in (chance.probability, chance.lower, chance.upper, row["correlation"], row["lowest_tenth"]):
        assert f"{number:.4g}" in document.text
    grid = page(
        random_campaign(tmp_path / "g", [0.0, 2.0], {"below": 1.0}, design={"method": "grid"}),
        tmp_path / "g.html",
    )
    assert "No bounds: a failure probability needs a design of random samples" in grid.text


def test_the_page_has_the_indices_of_the_design(tmp_path):
    unit = sobol.sample(problem(3), 64, calc_second_order=False, seed=1)
    outcome = campaign(tmp_path / "c", {"method": "saltelli", "second-order": False}, unit, ishigami)
    indices = page(outcome, tmp_path / "p.html").data["measures"][0]["indices"]
    table = outcome.sobol("y")
    assert indices["names"] == list(table.index) and [bar["name"] for bar in indices["bars"]] == ["S1", "ST"]
    for bar in indices["bars"]:
        assert np.allclose(bar["values"], table[bar["name"]], rtol=5e-6)
        assert np.allclose(bar["confidence"], table[bar["name"] + "_conf"], rtol=5e-6)
    status = ["failed", *["ok"] * (len(unit) - 1)]
    lost = campaign(
        tmp_path / "d", {"method": "saltelli", "second-order": False}, unit, ishigami, status=status
    )
    document = page(lost, tmp_path / "d.html")
    assert "1 of 320 have no value: 1 failed" in document.text and "indices" not in document.data["measures"][0]


def test_the_heat_map_marks_faults_whose_run_did_not_finish(tmp_path):
    document = page(fault_campaign(tmp_path / "c", {"below": 4.5}), tmp_path / "p.html")
    heat = document.data["measures"][0]["heat"]
    assert heat["rows"] == ["gain: a.y", "stuck: a.y", "stuck: b.y"]
    assert sorted(heat["columns"]) == ["from 1 s", "size 2, from 1 s", "size 3, from 5 s"]
    cells = {
        (row, column): "lost" if lost else value
        for row, values, marks in zip(heat["rows"], heat["values"], heat["lost"])
        for column, value, lost in zip(heat["columns"], values, marks)
        if lost or value is not None
    }
    assert cells == {
        ("gain: a.y", "size 2, from 1 s"): 3.0,
        ("gain: a.y", "size 3, from 5 s"): 5.0,
        ("stuck: a.y", "from 1 s"): 4.0,
        ("stuck: b.y", "from 1 s"): "lost",
    }
    # "stuck" and the run without a fault have no size.
    assert "4 of 7 runs, of which 2 fail, have no value of one of them" in document.text
    assert "5 faults" not in document.text and "4 faults in 6 runs" in document.text and "(none)" in document.text


def test_the_page_does_not_depend_on_the_parts(tmp_path):
    unit = sobol.sample(problem(3), 16, calc_second_order=True, seed=1)
    pages = []
    for parts in (1, 5, 128):
        shutil.rmtree(tmp_path / "c", ignore_errors=True)
        status = ["ok", "crashed", "time limit", "failed"] * 32
        outcome = campaign(
            tmp_path / "c",
            {"method": "saltelli", "second-order": True},
            unit,
            ishigami,
            status=status,
            parts=parts,
        )
        outcome.page(tmp_path / "p.html")
        pages.append((tmp_path / "p.html").read_bytes())
    assert pages[0] == pages[1] == pages[2]


def test_only_pages_of_campaigns_are_overwritten(tmp_path):
    outcome = random_campaign(tmp_path / "c", np.zeros(5), {"below": 1.0})
    path = tmp_path / "p.html"
    path.write_text("<html>my notes</html>", encoding="utf-8")
    with pytest.raises(
        ConfigurationError, match="is no page of a campaign and is kept; force=True overwrites it"
    ):
        outcome.page(path)
    assert path.read_text(encoding="utf-8") == "<html>my notes</html>"
    outcome.page(path, force=True)
    first = path.read_bytes()
    outcome.page(path)
    assert path.read_bytes() == first and len(first) > 1e6
    with pytest.raises(ResultsError, match="cannot write the page: No such file or directory"):
        outcome.page(tmp_path / "none" / "p.html")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["c", "p.html"]


def in_a_browser(outcome, folder, script, result):
    """The result, an expression, of a script that follows those of the page."""
    outcome.page(folder / "p.html")
    probe = f"""<script>
    const byId = id => document.getElementById(id);
    const waiting = setInterval(() => {{
    if (!document.documentElement.dataset.drawn) return;
    clearInterval(waiting);
    {script}
    document.title = JSON.stringify({result});
    }}, 50);
    </script></body>"""
    text = (folder / "p.html").read_text(encoding="utf-8").replace("</body>", probe)
    (folder / "probe.html").write_text(text, encoding="utf-8")
    words = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"]
    words += ["--enable-unsafe-swiftshader", "--virtual-time-budget=20000", "--enable-logging=stderr"]
    words += [f"--user-data-dir={folder / 'profile'}"]
    done = subprocess.run(
        ["chromium", *words, "--dump-dom", (folder / "probe.html").as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    assert "CONSOLE" not in done.stderr, done.stderr
    return json.loads(html.unescape(done.stdout.split("<title>")[1].split("</title>")[0]))


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs the browser chromium")
def test_a_browser_draws_the_page_and_a_click_shows_the_command(tmp_path):
    outcome = fault_campaign(tmp_path / "c", {"below": 4.5})
    script = """
    byId('scatter').emit('plotly_click', {points: [{customdata: 2}]});
    byId('input').selectedIndex = 2;
    byId('input').dispatchEvent(new Event('change'));
    """
    result = """[byId('point').querySelector('code').textContent,
      byId('scatter').data.map(own => own.x.length), byId('heat').data.length, byId('histogram-0').data.length,
      [...byId('scatter').querySelectorAll('.modebar-btn')].map(own => own.dataset.title),
      performance.getEntriesByType('resource').length, byId('parallel-note').textContent]"""
    command, points, heat, histogram, buttons, requests, note = in_a_browser(outcome, tmp_path, script, result)
    assert (
        command == outcome.command(2) and sum(points) == 7 and heat == 1 and histogram == 2 and requests == 0
    )
    # Faults that are stuck have no size.
    assert note == "A run without a value of a parameter is at the lower end of its axis."
    assert [button.lower() for button in buttons] == ["download plot as a png", "zoom", "pan", "reset axes"]


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs the browser chromium")
def test_a_run_that_did_not_finish_is_drawn_as_a_failure_whatever_value_its_measure_states(tmp_path):
    # 10 of 40 runs did not finish and have the stated value 0, 20 of the others are within the limit, 10 outside.
    values, status = np.repeat([0.0, 0.5, 2.0], [10, 20, 10]), np.repeat(["crashed", "ok", "ok"], [10, 20, 10])
    stated = {"measures": {"y": {"expression": "last(plant.x_p)", "unfinished": 0.0}}}
    columns, limits = {"p": np.arange(40.0), "q": -np.arange(40.0) ** 2}, {"y": {"below": 1.0}}
    outcome = write(tmp_path / "c", {"method": "random"}, columns, {"y": values}, limits=limits, status=status, changes=stated)
    assert outcome.failed("y").sum() == 20
    traces = "['border', 'scatter'].map(name => byId(name).data.filter(own => own.mode === 'markers').map(own => own.x.length))"
    assert in_a_browser(outcome, tmp_path, "", traces) == [[20, 20], [20, 20]]


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs the browser chromium")
def test_the_texts_of_the_first_of_parallel_axes_are_whole(tmp_path):
    columns = {"connection": np.array(["a.controller.with.long.name", "b"] * 10, dtype=object)}
    outcome = write(tmp_path / "c", {"method": "random"}, columns, {"y": np.arange(20.0)})
    texts = """[...byId('parallel').querySelectorAll('.axis text')].map(own =>
      [own.textContent, own.getBoundingClientRect().left - byId('parallel').getBoundingClientRect().left])"""
    lefts = dict(in_a_browser(outcome, tmp_path, "", texts))
    assert lefts["a.controller.with.long.na…"] >= 0
