"""The paper in the browser: the page of `scripts/web` in Chromium, in the book if that is built, against the command."""

import base64
import csv
import gzip
import io
import json
import re
import tomllib
from contextlib import contextmanager
from urllib.parse import quote

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from browser import CHROMIUM, FIREFOX, browser, firefox, served
from conftest import ROOT

IN_BOOK = ROOT / "target" / "book" / "paper"
PAGE = IN_BOOK if IN_BOOK.exists() else ROOT / "target" / "web" / "page"
pytestmark = [
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium is installed"),
    pytest.mark.skipif(not (PAGE / "paper.wasm").exists(), reason="scripts/web has not built the page"),
]
NAMES = ["plant.x_p", "plant.theta", "plant.v_p", "plant.omega", "plant.f_fric", "plant.regime", "controller.u", "controller.f_hat"]
STATUS = "document.getElementById('status').textContent"
FILE_STATUS = "document.getElementById('file-status').textContent"
NEWEST = "window.paper.rows[0].at(-1)"


@contextmanager
def opening(folder, motion="reduce", width=1200, height=900, name="index.html"):
    """A function that opens a page with a link. A reader who wants less motion starts the run himself."""
    with served(PAGE) as address, browser(folder / "profile", width, height) as page:
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
        page.call("Emulation.setDeviceMetricsOverride", **size)
        page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": motion}])

        def opened(link=""):
            page.open("about:blank")
            page.open(f"{address}/{name}{link}")
            page.until("document.body.dataset.ready === 'true'")
            return page

        yield opened
        assert page.complaints == []
        assert all(request.startswith((address, "data:", "blob:", "about:")) for request in page.requests)


@pytest.fixture
def open_page(tmp_path):
    """A function that opens the page with a link."""
    with opening(tmp_path) as opened:
        yield opened


def click(page, identifier):
    """Presses a button of the page."""
    page.evaluate(f"document.getElementById('{identifier}').click()")


def state(page, field, text):
    """Writes a text into a field of the page and leaves the field."""
    page.evaluate(
        f"{{ const f = document.getElementById('set-{field}'); f.value = {json.dumps(text)};f.dispatchEvent(new Event('change')); }}"
    )


def run_to_the_end(page):
    page.evaluate("document.getElementById('speed').value = 'Infinity'; document.getElementById('play').click()")
    return at_the_end(page)


def at_the_end(page):
    page.until("document.body.dataset.spent !== undefined", limit=120)
    return page.evaluate("window.paper.csv()")


def rows(text):
    """The values of a results file, by name."""
    header, *lines = list(csv.reader(text.splitlines()))
    return {name: np.array(column, dtype=float) for name, column in zip(header, zip(*lines, strict=True), strict=True)}


def of_the_command(aso_ftc, page, folder, more=""):
    """The rows of the command for the system.toml that the page shows, with `more` settings."""
    text = page.evaluate("document.getElementById('native').textContent")
    text = text.replace('"dist/', f'"{ROOT}/dist/').replace("[settings]\n", f"[settings]\n{more}")
    file, results = folder / "paper.toml", folder / "results.csv"
    file.write_text(text, encoding="utf-8")
    recorded = [word for name in NAMES for word in ("--record", name)]
    done = aso_ftc("run", file, "--results", results, *recorded)
    assert done.returncode == 0, done.stderr
    return rows(results.read_text(encoding="utf-8"))


def equal(results, theirs):
    """Every row of the page is a row of the command, bit for bit."""
    at = np.searchsorted(theirs["time"], results["time"])
    assert len(results["time"]) > 100
    for name in ["time", *NAMES]:
        assert np.array_equal(results[name], theirs[name][at]), name


def amplitude(values):
    """Half of the peak-to-peak value."""
    return (values.max() - values.min()) / 2


def claims(page):
    """The column "here" of the table of claims."""
    return page.evaluate("[...document.querySelectorAll('#claims tbody tr')].map((row) => row.lastChild.textContent)")


def test_100_s_of_the_page_are_those_of_the_command_bit_for_bit(aso_ftc, open_page, tmp_path):
    page = open_page()
    results = rows(run_to_the_end(page))
    assert len(results["time"]) == 10001 and results["time"][-1] == 100
    equal(results, of_the_command(aso_ftc, page, tmp_path))
    print("100 s were computed in", page.evaluate("document.body.dataset.spent"), "ms")


@pytest.mark.skipif(not FIREFOX, reason="no Firefox is installed")
def test_100_s_in_firefox_are_those_of_the_command_bit_for_bit(aso_ftc, tmp_path):
    with served(PAGE) as address, firefox(tmp_path / "profile") as page:
        page.open(f"{address}/index.html")
        page.until("document.body.dataset.ready === 'true'")
        results = rows(run_to_the_end(page))
        assert len(results["time"]) == 10001
        equal(results, of_the_command(aso_ftc, page, tmp_path))
        assert page.complaints == []


def test_the_claims_are_those_of_the_readme_in_its_words_and_units(open_page):
    readme = (ROOT / "README.md").read_text(encoding="utf-8").partition("| claim | paper | measured |\n")[2]
    table = [[cell.strip() for cell in line.strip("|").split("|")] for line in readme.splitlines()[1:6]]
    page = open_page("#monitor=false")
    assert claims(page) == ["–"] * 5
    results = rows(run_to_the_end(page))
    page.until("!document.querySelector('#claims').textContent.includes('–')")
    shown = page.evaluate("[...document.querySelectorAll('#claims tbody tr')].map((row) => [...row.cells].map((cell) => cell.textContent))")
    assert [[claim.replace("−", "-"), paper] for claim, paper, _ in shown] == [row[:2] for row in table]
    assert [here.removesuffix(" ✓ holds") for *_, here in shown] == [row[2] for row in table]
    late, early = results["time"] >= 60, (results["time"] >= 10) & (results["time"] <= 40)
    x, theta = results["plant.x_p"], results["plant.theta"]
    rms = np.sqrt(np.mean((results["plant.f_fric"] - results["controller.f_hat"])[late] ** 2))
    numbers = [amplitude(x[early]), amplitude(theta[early]), 1e3 * amplitude(x[late]), 1e3 * amplitude(theta[late]), rms]
    assert [float(here.split()[0]) for *_, here in shown] == pytest.approx(numbers, rel=0.02)
    assert "0.962 mm" in page.evaluate("document.getElementById('summary').textContent")


def test_the_page_describes_an_experiment_only_with_its_values(open_page):
    page = open_page("#F_c=12.5&F_s=15&stop=20")
    text = "document.getElementById('preset-text').textContent"
    assert "half as large" in page.evaluate(text)
    state(page, "t_on", "30")
    assert page.evaluate(text) == ""
    click(page, "defaults")
    assert "from 40 s on" in page.evaluate(text)


def test_a_number_that_rounds_to_zero_has_no_sign(open_page):
    page = open_page("#stop=1.2")
    results = rows(run_to_the_end(page))
    assert -0.005 < results["plant.f_fric"][-1] - results["controller.f_hat"][-1] < 0
    page.until("document.getElementById('now-estimate').textContent.endsWith('f_fric − f_hat = 0.00 N')", limit=10)


def test_the_page_loads_at_most_303_kb_at_first(tmp_path):
    requested = []
    with served(PAGE, requested) as address, browser(tmp_path / "profile") as page:
        page.open(f"{address}/index.html")
        page.until("document.body.dataset.ready === 'true'")
        assert f"{address}/paper.wasm" in page.requests, "requests of the worker are seen"
        assert page.requests.count(f"{address}/paper.wasm") == 1
    names = {path.removeprefix("/") for path in requested}
    assert {"index.html", "worker.js", "paper.wasm"} <= names and not names & {"observer.wasm", "tanks.wasm", "file.js", "codecs.min.js"}
    sizes = {name: len(gzip.compress((PAGE / name).read_bytes())) for name in names}
    assert sum(sizes.values()) <= 303_000, sizes


def gains_of(page):
    """The eigenvalues of A_0 - L C_0 with the gains in the system.toml."""
    settings = tomllib.loads(page.evaluate("document.getElementById('native').textContent"))["settings"]
    file = tomllib.loads((ROOT / "fmu-controller" / "resources" / "design.toml").read_text(encoding="utf-8"))
    a, c, f_a = (np.array(file[name]) for name in ("A", "C", "F_a"))
    gain = {n: [[settings[f"controller.{n}[{i},{j}]"] for j in (1, 2)] for i in range(1, k + 1)] for n, k in (("L_x", 4), ("L_f", 1))}
    error = np.block([[a - gain["L_x"] @ c, -f_a], [gain["L_f"] @ c, np.zeros((1, 1))]])
    return np.sort_complex(np.linalg.eigvals(error))


def test_faults_noise_and_an_observer_designed_in_the_page_are_those_of_the_command(aso_ftc, open_page, tmp_path):
    link = "#stop=12&t_on=4&F_s=28&M=3.3&eigenvalues=-900+-1000+-1100+-1200+-1300&noise_theta=1e-6&bias_x=0.001&gain_u=0.95&from=6"
    page = open_page(link)
    results = rows(run_to_the_end(page))
    assert np.allclose(gains_of(page), [-1300, -1200, -1100, -1000, -900], rtol=1e-6)
    equal(results, of_the_command(aso_ftc, page, tmp_path))


@pytest.mark.parametrize("text", ["-900+200i -900-200i -1100 -1200 -1300", "-900±200i,-1100,-1200,-1300"])
def test_the_observer_may_have_complex_eigenvalues(open_page, text):
    page = open_page(f"#eigenvalues={quote(text)}")
    page.until(f"{STATUS} === 'Ready.'")
    assert np.allclose(gains_of(page), [-1300, -1200, -1100, -900 - 200j, -900 + 200j], rtol=1e-6)


def test_the_time_of_the_faults_acts_on_noise_and_delay_too(aso_ftc, open_page, tmp_path):
    page = open_page("#stop=4&t_on=1&from=2&noise_x=1e-6&delay_theta=0.0005")
    results = rows(run_to_the_end(page))
    faults = tomllib.loads(page.evaluate("document.getElementById('native').textContent"))["scenario"]["fault"]
    assert [next(iter(fault[kind] for kind in fault if kind != "connection"))["from"] for fault in faults] == [2, 2]
    equal(results, of_the_command(aso_ftc, page, tmp_path))
    open_page("#stop=4&t_on=1")
    without = rows(run_to_the_end(page))
    early = results["time"] <= 2
    assert np.array_equal(results["controller.u"][early], without["controller.u"][early])
    assert not np.array_equal(results["controller.u"], without["controller.u"])


def test_the_dashed_cart_is_the_run_of_the_command_without_compensation(aso_ftc, open_page, tmp_path):
    page = open_page("#stop=6&t_on=1")
    run_to_the_end(page)
    page.until("window.paper.ghost[0].length === window.paper.rows[0].length")
    ghost = dict(zip(["time", *NAMES], page.evaluate("window.paper.ghost.map((column) => [...column])"), strict=True))
    ghost = {name: np.array(values) for name, values in ghost.items()}
    equal(ghost, of_the_command(aso_ftc, page, tmp_path, '"controller.compensate" = false\n'))


def test_changes_during_the_run_are_in_the_system_toml_and_in_the_link(aso_ftc, open_page, tmp_path):
    page = open_page("#stop=6&t_on=1")
    page.evaluate("document.getElementById('speed').value = '5'; document.getElementById('play').click()")
    page.until(f"{NEWEST} > 2")
    state(page, "F_c", "15")
    click(page, "set-compensate")
    page.until(f"{NEWEST} > 3")
    results = rows(at_the_end(page))
    text = page.evaluate("document.getElementById('native').textContent")
    assert text.count("[[scenario.set]]") == 2 and "plant.F_c" in text
    equal(results, of_the_command(aso_ftc, page, tmp_path))
    link = page.evaluate("document.getElementById('link').getAttribute('href')")
    open_page(link)
    assert page.evaluate("document.getElementById('set-F_c').value") == "25"
    assert page.evaluate("document.getElementById('link').getAttribute('href')") == link, "before the changes are due"
    again = rows(run_to_the_end(page))
    assert all(np.array_equal(results[name], again[name]) for name in results)
    assert page.evaluate("document.getElementById('set-F_c').value") == "15"
    assert page.evaluate("document.getElementById('native').textContent") == text
    assert page.evaluate("document.getElementById('link').getAttribute('href')") == link


def test_a_link_that_has_no_room_for_the_changes_says_so_and_so_does_the_page_that_it_opens(open_page):
    page = open_page()
    changes = "Array.from({length: 2000}, (_, k) => ({variable: 'plant.f_a', at: k / 100, value: k}))"
    link = page.evaluate(f"permalink({{...DEFAULTS, F_c: 20}}, {changes}).link")
    assert len(link) < 8000
    open_page(link)
    assert "Not restored from the link: 2000 changes" in page.evaluate(STATUS)
    assert page.evaluate("document.getElementById('set-F_c').value") == "20"


def test_a_change_at_the_time_of_a_row_after_a_step_back_is_that_of_the_command(aso_ftc, open_page, tmp_path):
    page = open_page("#stop=2&t_on=1")
    page.evaluate("for (let k = 0; k < 55; k += 1) document.getElementById('step').click()")
    page.until(f"{NEWEST} > 0.545")
    click(page, "back")
    page.until(f"{NEWEST} < 0.505")
    state(page, "F_c", "15")
    results = rows(run_to_the_end(page))
    text = page.evaluate("document.getElementById('native').textContent")
    assert text.count("[[scenario.set]]") == 1 and "at = 0.5\n" in text
    assert len(results["time"]) == 201
    equal(results, of_the_command(aso_ftc, page, tmp_path))


def test_a_step_back_over_a_change_takes_it_back_in_the_run_too(aso_ftc, open_page, tmp_path):
    page = open_page("#stop=2&t_on=1")
    for steps, end in ((55, 0.545), (10, 0.595)):
        page.evaluate(f"for (let k = 0; k < {steps}; k += 1) document.getElementById('step').click()")
        page.until(f"{NEWEST} > {end}")
        click(page, "back")
        page.until(f"{NEWEST} < 0.505")
        if steps == 55:
            state(page, "F_c", "15")
    assert page.evaluate("document.getElementById('set-F_c').value") == "25"
    results = rows(run_to_the_end(page))
    assert "[[scenario.set]]" not in page.evaluate("document.getElementById('native').textContent")
    equal(results, of_the_command(aso_ftc, page, tmp_path))


def test_a_push_ends_with_its_button_also_if_the_run_is_paused_or_has_ended(open_page):
    page = open_page("#stop=60")
    native = "document.getElementById('native').textContent"

    def button(kind):
        page.evaluate(f"document.getElementById('right').dispatchEvent(new PointerEvent('{kind}'))")

    click(page, "play")
    page.until(f"{NEWEST} > 0.1")
    button("pointerdown")
    page.until(f"{native}.includes('value = 40\\n')")
    click(page, "play")
    button("pointerup")
    page.until(f"{native}.includes('value = 0\\n')")
    state(page, "stop", "2")
    page.evaluate("document.getElementById('speed').value = '1'")
    click(page, "play")
    page.until(f"{NEWEST} > 0.1")
    button("pointerdown")
    page.until(f"{STATUS}.startsWith('The run ended')")
    button("pointerup")
    click(page, "play")
    page.until(f"{NEWEST} > 0.1 && {NEWEST} < 1.5")
    button("pointerdown")
    page.until(f"{native}.includes('value = 40\\n')")


def test_each_step_back_during_a_push_is_earlier(open_page):
    page = open_page("#stop=60&push=5")
    released = "document.getElementById('native').textContent.includes('value = 0\\n')"
    click(page, "play")
    page.until(f"{NEWEST} > 0.1")
    page.evaluate("document.getElementById('right').dispatchEvent(new PointerEvent('pointerdown'))")
    page.until(f"{NEWEST} > 3.2")
    click(page, "play")
    click(page, "back")
    page.until(f"{STATUS}.startsWith('Back at') && {released}")
    for _ in range(2):
        before = page.evaluate(NEWEST)
        click(page, "back")
        page.until(f"{NEWEST} < {before} && {released}")


def test_every_control_answers(open_page):
    page = open_page("#stop=20&nonsense=1")
    assert "unknown setting nonsense" in page.evaluate(STATUS)
    for name in ["step", "step", "step", "back"]:
        click(page, name)
    page.until(f"{STATUS}.startsWith('Back at')")
    page.evaluate("document.getElementById('speed').value = '20'")
    click(page, "play")
    page.until(f"{NEWEST} > 1")
    click(page, "play")
    assert page.evaluate(STATUS) == "Paused."
    one = "document.querySelectorAll(`#set-${f.id}`).length === 1"
    assert page.evaluate(f"FIELDS.every((f) => {one} && document.getElementById(`set-${{f.id}}`).value !== '')")
    click(page, "defaults")
    page.until(f"{STATUS} === 'Ready.'")


def refusal(page, field):
    """The sentence beside a field, which the field names and which the window shows; the line of the run repeats it."""
    answer = page.evaluate(
        f"""(() => {{
        const field = document.getElementById('set-{field}');
        field.scrollIntoView({{block: 'center'}});
        const error = document.getElementById(field.getAttribute('aria-errormessage'));
        const inside = (part) => {{
          const box = part.getBoundingClientRect();
          return box.height > 0 && box.top >= 0 && box.bottom <= innerHeight;
        }};
        const line = document.getElementById('status');
        return {{
          text: error.textContent, line: line.textContent, invalid: field.getAttribute('aria-invalid'),
          seen: inside(error) && inside(line), near: error.getBoundingClientRect().top - field.getBoundingClientRect().bottom,
        }};
        }})()"""
    )
    assert answer["invalid"] == "true" and answer["seen"] and answer["near"] < 40, answer
    assert answer["line"] == answer["text"]
    return answer["text"]


NUMBERS = [
    "F_c",
    "F_s",
    "v_s",
    "delta",
    "push",
    "t_on",
    "M",
    "m",
    "x_p_0",
    "step",
    "stop",
    "from",
    "noise_x",
    "delay_theta",
    "bias_x",
    "gain_u",
]


def test_a_value_that_is_refused_says_why_beside_its_field_and_the_sentence_goes_when_it_is_mended(open_page):
    page = open_page()
    for field in NUMBERS:
        for text, sentence in [
            ("x", "expected a number"),
            ("0x10", "expected a number"),
            ("", "expected a number"),
            ("1,5", "expected a decimal point"),
        ]:
            state(page, field, text)
            assert sentence in refusal(page, field), field
        state(page, field, str(page.evaluate(f"String(DEFAULTS['{field}'])")))
        assert page.evaluate(f"document.getElementById('error-{field}').hidden && document.getElementById('status').className === ''"), (
            field
        )
    for field, text, sentence in [
        ("F_s", "20", "F_s at least as large as F_c"),
        ("F_c", "31", "F_s at least as large as F_c"),
        ("m", "1e30", "Mass of the pendulum m = 1e+30 kg: expected below 1.475 kg"),
        ("M", "0", "expected at least 0.1 kg"),
        ("delay_x", "400", "expected at most 250000 steps"),
        ("stop", "1e9", "fewer than 100 million steps"),
    ]:
        state(page, field, text)
        assert sentence in refusal(page, field)
        click(page, "restart")
        page.until(f"{STATUS} === 'Ready.'")
        assert page.evaluate(f"document.getElementById('set-{field}').value") == page.evaluate(f"String(DEFAULTS['{field}'])")


@pytest.mark.parametrize("m", [1.474, 1.476])
def test_the_largest_mass_of_the_pendulum_is_that_of_the_plant(aso_ftc, open_page, tmp_path, m):
    page = open_page("#stop=1")
    file = tmp_path / "m.toml"
    file.write_text(f'[fmus]\nplant = "{ROOT}/dist/FrictionPendulum.fmu"\n[settings]\n"plant.m" = {m}\n', encoding="utf-8")
    accepted = aso_ftc("run", file, "--stop-time", "0.01", "--step", "0.01").returncode == 0
    state(page, "m", str(m))
    assert page.evaluate("document.getElementById('set-m').getAttribute('aria-invalid')") == (None if accepted else "true")
    assert accepted == (m < 1.475)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [("-1 -2", "eigenvalues"), ("-1 -2 -3 -4 5", "below 0"), ("a b", "expected a number"), ("-9+2i -3 -4 -5 -6", "conjugate")],
)
def test_eigenvalues_without_a_design_are_refused_and_nothing_claims_to_run(open_page, text, sentence):
    page = open_page()
    state(page, "eigenvalues", text)
    page.until(f"{STATUS}.includes('{sentence}')")
    assert sentence in refusal(page, "eigenvalues")
    click(page, "play")
    page.evaluate("new Promise((done) => setTimeout(done, 500))")
    assert sentence in refusal(page, "eigenvalues")
    assert page.evaluate("document.getElementById('play').textContent") == "Run"
    click(page, "step")
    assert "refused" in page.evaluate(STATUS)
    state(page, "eigenvalues", "-900 -1000 -1100 -1200 -1300")
    page.until(f"{STATUS} === 'Ready.'")
    click(page, "play")
    page.until(f"{NEWEST} > 0.1")


def test_a_change_that_the_plant_refuses_is_refused_beforehand_and_the_run_goes_on(open_page):
    page = open_page("#stop=4")
    page.evaluate("document.getElementById('speed').value = '5'; document.getElementById('play').click()")
    page.until(f"{NEWEST} > 1")
    state(page, "F_s", "0")
    assert "F_s at least as large as F_c" in refusal(page, "F_s")
    results = rows(at_the_end(page))
    assert results["time"][-1] == 4
    assert "[[scenario.set]]" not in page.evaluate("document.getElementById('native').textContent")


def test_a_step_at_the_end_claims_no_step(open_page):
    page = open_page("#stop=1")
    run_to_the_end(page)
    click(page, "step")
    assert "has ended" in page.evaluate(STATUS)
    click(page, "back")
    page.until(f"{STATUS}.startsWith('Back at')")
    click(page, "step")
    page.until(f"{STATUS} === 'One step of 10 communication points.'")


def test_a_run_of_2501_s_has_its_summary(open_page):
    page = open_page("#t_on=2500&stop=2501")
    page.evaluate("document.getElementById('speed').value = 'Infinity'; document.getElementById('play').click()")
    page.until("document.body.dataset.spent !== undefined", limit=400)
    page.until("document.querySelector('#claims').textContent.includes('0.1')")
    assert page.evaluate("window.paper.rows[0].length") == 250_101
    x = np.array(page.evaluate("[...window.paper.rows[1]].slice(62500, 250001)"))
    assert float(claims(page)[0].split()[0]) == pytest.approx(amplitude(x), rel=1e-3)


def test_a_plot_of_500_000_rows_is_thinned_to_rows_with_all_extremes_in_a_short_time(open_page):
    page = open_page()
    answer = page.evaluate(
        """(async () => {
        const [t, x, y] = [new Column(), new Column(), new Column()];
        for (let k = 0; k < 500101; k += 1) {
          t.push(k / 100);
          x.push(k === 123456 ? 9 : Math.sin(k / 77));
          y.push(k === 400001 ? -9 : Math.cos(k / 9));
        }
        const plots = [];
        const axis = thinnedAxis("test", () => plots);
        const curves = [{label: "x", ink: "--ink-1", column: x}, {label: "y", ink: "--ink-2", column: y}];
        plots.push(new TimePlot(axis, document.getElementById("dropped"), t, curves));
        let shortest = Infinity; // of several, as other programs run too
        for (let k = 0; k < 20; k += 1) {
          const begin = performance.now();
          plots[0].update();
          await null;
          shortest = Math.min(shortest, performance.now() - begin);
          await new Promise((done) => setTimeout(done, 20));
        }
        const [times, ...values] = plots[0].plot.data;
        const places = times.map((time) => Math.round(100 * time));
        const areRows = places.every((k, j) => values[0][j] === x.values[k] && values[1][j] === y.values[k]);
        return {shortest, areRows, count: places.length, spikes: [places.includes(123456), places.includes(400001)], last: places.at(-1)};
        })()"""
    )
    print("500,101 rows are drawn in", answer["shortest"], "ms")
    assert answer["shortest"] < 60
    assert answer["areRows"] and answer["spikes"] == [True, True] and answer["last"] == 500_100
    assert answer["count"] < 8000


def test_it_plays_at_once_and_the_first_window_shows_cart_switch_position_and_friction(tmp_path):
    with opening(tmp_path, motion="no-preference", width=1280, height=720) as opened:
        page = opened()
        page.until(f"{NEWEST} > 5")
        assert page.evaluate("document.getElementById('play').textContent") == "Pause"
        for part in ["#scene", ".switch", "#motion canvas", "#force canvas", "#presets", "#tour", "#status"]:
            box = page.evaluate(f"document.querySelector({json.dumps(part)}).getBoundingClientRect().toJSON()")
            assert box["top"] >= 0 and box["bottom"] <= 720 and box["height"] > 0, part
        # The estimate lies on the friction before it is used, when the observer has settled.
        force, estimate = (np.array(page.evaluate(f"[...window.paper.rows[{k}]].slice(200, 400)")) for k in (5, 8))
        assert abs(force).max() > 20 and np.median(abs(force - estimate)) < 0.5


def test_the_page_fits_a_phone(tmp_path):
    with opening(tmp_path, width=390, height=844) as opened:
        page = opened()
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        tops = [
            page.evaluate(f"document.querySelector('{part}').getBoundingClientRect().top")
            for part in ("#scene", ".switch", "#motion", "#force", "#presets")
        ]
        assert tops == sorted(tops)
        assert page.evaluate("document.querySelector('.dock').getBoundingClientRect().height") < 130


def test_each_experiment_runs_and_ends_as_it_says(open_page):
    page = open_page()
    names = page.evaluate("[...document.querySelectorAll('#presets button')].map((button) => button.textContent)")
    lost = {}
    page.evaluate("document.getElementById('speed').value = 'Infinity'")
    for k, name in enumerate(names):
        page.evaluate(f"document.querySelectorAll('#presets button')[{k}].click()")
        page.until(f"{STATUS}.startsWith('The run ended at')")
        status = page.evaluate(STATUS)
        lost[name] = float(status.split("t = ")[1].split(" s")[0]) if " s: " in status else None
    assert [name for name, at in lost.items() if at is None] == [names[0], names[1], "Half the friction", "Sensor fault"]
    assert 41 < lost["A delay beyond the margin of 2.03 ms"] < 42
    assert 40 < lost["The gains as printed"] < 60


def test_the_tour_has_five_sentences_and_keys_move_the_cursor_and_switch_curves(open_page):
    page = open_page("#stop=5")
    run_to_the_end(page)
    texts = set()
    for _ in range(5):
        texts.add(page.evaluate("document.getElementById('tour').textContent"))
        click(page, "tour-next")
    assert len(texts) == 5 and all(text.count(". ") == 1 for text in texts)
    page.evaluate("document.getElementById('motion').focus()")

    def press(key):
        page.call("Input.dispatchKeyEvent", type="keyDown", key=key)
        page.call("Input.dispatchKeyEvent", type="keyUp", key=key)
        page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    press("ArrowRight")
    at, value = (
        float(text)
        for text in page.evaluate("[...document.querySelectorAll('#motion .u-value')].slice(0, 2).map((cell) => cell.textContent)")
    )
    results = rows(page.evaluate("window.paper.csv()"))
    k = np.argmin(abs(results["time"] - at))
    assert results["time"][k] == pytest.approx(at, rel=1e-5)
    assert value == pytest.approx(1e3 * results["plant.x_p"][k], rel=1e-5)
    press("ArrowRight")
    assert float(page.evaluate("document.querySelector('#motion .u-value').textContent")) > at
    page.evaluate("document.querySelector('#motion .u-series + .u-series .u-label').focus()")
    page.call("Input.dispatchKeyEvent", type="keyDown", key="Enter")
    assert page.evaluate("document.querySelector('#motion .u-series + .u-series .u-label').getAttribute('aria-pressed')") == "false"
    assert page.evaluate("document.querySelectorAll('[role=img] table, [role=img] canvas').length") == 0


def test_the_value_under_the_cursor_is_that_of_the_row_at_its_time(open_page):
    page = open_page("#stop=60")
    results = rows(run_to_the_end(page))
    page.evaluate("new Promise((done) => setTimeout(done, 500))")
    places = page.places("#force .u-over", [k / 101 for k in range(1, 101)])
    times = results["time"]
    for x, y in places:
        page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        page.evaluate("new Promise((done) => requestAnimationFrame(done))")
        at, force, estimate = (
            float(text) for text in page.evaluate("[...document.querySelectorAll('#force .u-value')].map((cell) => cell.textContent)")
        )
        k = np.argmin(abs(times - at))
        assert times[k] == pytest.approx(at, rel=1e-5)
        assert [force, estimate] == pytest.approx([results["plant.f_fric"][k], results["controller.f_hat"][k]], rel=1e-5)


def test_two_fingers_zoom_the_figures_until_a_double_tap_and_one_finger_scrolls_the_page(open_page):
    page = open_page("#stop=5")
    run_to_the_end(page)
    frame = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"

    def at_the_right(identifier):
        """The time at the right edge of a figure."""
        page.evaluate(f"document.getElementById('{identifier}').scrollIntoView({{block: 'center'}})")
        ((x, y),) = page.places(f"#{identifier} .u-over", [0.999])
        page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        return page.evaluate(f"{frame}.then(() => Number(document.querySelector('#{identifier} .u-value').textContent))")

    assert at_the_right("motion") > 4.9
    page.pinch("#motion .u-over", (0.4, 0.6), (0.0, 1.0))
    for identifier in ("motion", "force", "command"):
        assert at_the_right(identifier) == pytest.approx(3, abs=0.05)
    before = page.evaluate("scrollY")
    page.swipe_up("#command .u-over", 150)
    page.until(f"scrollY > {before} + 100")
    assert at_the_right("command") == pytest.approx(3, abs=0.05)
    page.double_tap("#command .u-over")
    assert at_the_right("motion") > 4.9


def drop(page, name, content):
    """Drops a file on the page."""
    page.evaluate(
        f"""(() => {{
        const bytes = Uint8Array.from(atob('{base64.b64encode(content).decode()}'), (c) => c.charCodeAt(0));
        const all = new DataTransfer(); all.items.add(new File([bytes], '{name}'));
        document.dispatchEvent(new DragEvent('drop', {{dataTransfer: all, bubbles: true, cancelable: true}}));
        }})()"""
    )


def shown(page, name, content):
    """Drops a file on the page; the names of its variables and a function that returns the values of one."""
    drop(page, name, content)
    page.until(f"document.getElementById('dropped').dataset.shown === {json.dumps(name)}")
    names = page.evaluate("[...document.querySelectorAll('.choice label')].map((label) => label.textContent.trim())")
    read = "import('./file.js').then((file) => file.values({})).then((all) => [...all].map((value) => Number.isNaN(value) ? null : value))"
    return names, lambda variable: np.array(page.evaluate(read.format(json.dumps(variable))), dtype=float)


def test_a_results_file_dropped_on_the_page_is_drawn(open_page):
    page = open_page()
    names, read = shown(page, "own.csv", b'time,a,"b[1,2]"\n0,1,2\n1,2,3\n')
    assert names == ["a", "b[1,2]"] and list(read("b[1,2]")) == [2, 3]
    assert page.evaluate("document.querySelectorAll('#dropped canvas').length") == 2
    assert page.evaluate(FILE_STATUS) == "own.csv: 2 rows, 2 variables."
    names, _ = shown(page, "texts.csv", b"time,a,mode,none\n0,1,on,\n1,2,off,\n")
    assert names == ["a"] and "Columns without numbers are left out: mode, none." in page.evaluate(FILE_STATUS)
    # The line of the run is another one, and the answer is in the window.
    assert page.evaluate(STATUS) == "Ready."
    assert page.evaluate(
        "(() => { const box = document.getElementById('file-status').getBoundingClientRect();"
        "return box.top >= 0 && box.bottom <= innerHeight; })()"
    )


def labels(page):
    """A function that returns the numbers that plots have had as labels since this call."""
    page.evaluate(
        """window.drawn = [];
        CanvasRenderingContext2D.prototype.fillText = function (text) { window.drawn.push(text); };
        0"""
    )
    return lambda: [float(text) for text in page.evaluate("window.drawn") if re.fullmatch(r"-?[\d.]+(e-?\d+)?", text)]


def test_small_values_and_seconds_since_1970_of_a_file_have_their_digits(open_page):
    page = open_page()
    drawn = labels(page)
    times = [1.7e9 + k / 4 for k in range(9)]
    shown(page, "small.csv", ("time,a\n" + "".join(f"{time},{k}e-6\n" for k, time in enumerate(times))).encode())
    assert any(0 < label < 1e-5 for label in drawn()), "uPlot's own labels are all 0"
    page.evaluate("document.querySelector('#dropped .u-over').scrollIntoView({block: 'center'})")
    ((x, y),) = page.places("#dropped .u-over", [0.4])
    page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    frame = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    assert float(page.evaluate(f"{frame}.then(() => document.querySelector('#dropped .u-value').textContent)")) in times[1:]


def test_labels_of_a_narrow_range_of_a_run_differ(open_page):
    page = open_page("#stop=6")
    run_to_the_end(page)
    page.evaluate("document.getElementById('force').scrollIntoView({block: 'center'})")
    drawn = labels(page)
    for _ in range(3):
        page.evaluate("document.getElementById('force').dispatchEvent(new KeyboardEvent('keydown', {key: '+'}))")
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert any(label != round(label, 3) for label in drawn()), "the friction of a cart that sticks is -30.000 N"


def test_values_that_hardly_vary_are_drawn_and_zoomed_and_the_page_goes_on(open_page):
    page = open_page()
    lines = [f"{t},{1 + 1e-8 * t!r},{-30 - 1e-7 * t!r},{1e5 + 1e-11 * t!r}" for t in range(9)]
    names, _ = shown(page, "narrow.csv", "\n".join(["time,a,b,c", *lines]).encode())
    assert names == ["a", "b", "c"]
    for _ in range(60):
        page.evaluate("document.querySelector('#dropped .figure').dispatchEvent(new KeyboardEvent('keydown', {key: '+'}))")
    assert page.evaluate("document.querySelectorAll('#dropped .uplot').length") == 3


def test_plots_outside_of_the_window_are_printed_with_their_curves(open_page):
    page = open_page("#stop=6")
    run_to_the_end(page)
    image = "canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data"
    blue = f"((canvas) => {image}.filter((value, k, all) => k % 4 === 2 && value > 150 && all[k - 2] < 50).length)"
    assert page.evaluate(f"dispatchEvent(new Event('beforeprint')), {blue}(document.querySelector('#command canvas'))") > 300


def test_an_infinite_value_of_a_file_is_a_gap_and_the_axis_is_that_of_the_others(open_page):
    page = open_page()
    drawn = labels(page)
    shown(page, "infinite.csv", b"time,a\n0,1001\n1,Infinity\n2,1003\n3,1002\n4,-Infinity\n5,1001\n")
    assert any(1001 < label < 1003 for label in drawn())


def test_a_file_is_read_that_is_dropped_while_a_variable_of_another_one_is(open_page):
    page = open_page()
    shown(page, "first.csv", b"time,a\n0,1\n1,2\n")
    # A worker that has not answered yet.
    page.evaluate(
        """window.post = Worker.prototype.postMessage;
        import('./file.js').then((file) => {
          Worker.prototype.postMessage = () => {};
          file.values('a');
          return Promise.resolve();
        }).then(() => { Worker.prototype.postMessage = window.post; })"""
    )
    names, read = shown(page, "second.csv", b"time,b\n0,3\n1,4\n")
    assert names == ["b"] and list(read("b")) == [3, 4]


TABLES: dict[str, tuple[bytes, dict[str, list[float]]]] = {
    "semicolon.csv": (b"time;a;b\n0;1;2\n1;2;3\n", {"time": [0, 1], "a": [1, 2], "b": [2, 3]}),
    "comma.CSV": (b"time;a\r\n0,0;1,5\r\n0,1;-1,7e-1\r\n", {"time": [0, 0.1], "a": [1.5, -0.17]}),
    "tab.txt": (b"a\ttime\n1\t0\n2\t1\n", {"time": [0, 1], "a": [1, 2]}),
    "units.csv": (b"time,a\ns,m\n0,1\n1,2\n", {"time": [0, 1], "a": [1, 2]}),
    "units-of-1.csv": (b"time,a,b\n[s],[m],1\n0,1,2\n1,2,3\n", {"time": [0, 1], "a": [1, 2], "b": [2, 3]}),
    # The numbers are those of `date -u -d TEXT +%s`.
    "dates.csv": (
        b"time,a\n2026-12-01,1\n2026-12-01 08:00:00.0005,2\n2026-12-01T10:00:00+01:00,3\n2026-12-01T10:00:00.25Z,4\n",
        {"time": [1796083200, 1796112000.0005, 1796115600, 1796119200.25], "a": [1, 2, 3, 4]},
    ),
    "bom.csv": (b"\xef\xbb\xbftime,a\n0,1\n1,2\n", {"time": [0, 1], "a": [1, 2]}),
    "utf16.csv": ("\ufefftime,a\n0,1\n1,2\n".encode("utf-16-le"), {"time": [0, 1], "a": [1, 2]}),
    "zipped.csv.gz": (gzip.compress(b"time,a\n0,1\n1,2\n"), {"time": [0, 1], "a": [1, 2]}),
    "blank.csv": (b"time,a\n0,1\n1, \n2,3\n", {"time": [0, 1, 2], "a": [1, np.nan, 3]}),
    "gaps.csv": (b"time,a,on,text\n0,1,true,x\n1,,false,y\n2,3,,z\n", {"time": [0, 1, 2], "a": [1, np.nan, 3], "on": [1, 0, np.nan]}),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_as_the_world_writes_them_are_read(open_page, name):
    content, columns = TABLES[name]
    names, read = shown(open_page(), name, content)
    assert names == [variable for variable in columns if variable != "time"]
    for variable, values in columns.items():
        assert np.array_equal(read(variable), np.array(values, dtype=float), equal_nan=True), variable


def parquet(compression="snappy"):
    """A file by pyarrow, and its values."""
    times = np.linspace(0.0, 1.0, 5001)
    values = {"time": times, "a": np.sin(times), "n": np.arange(5001) - 2**40, "on": times > 0.5, "text": ["x"] * 5001}
    file = io.BytesIO()
    pq.write_table(pa.table(values), file, compression=compression, row_group_size=2000)
    return file.getvalue(), values


BROKEN = {
    "cut.parquet": (parquet()[0][:-100], "damaged or not whole"),
    "bad.parquet": (b"PAR1 and nothing more", "damaged or not whole"),
    "cut.csv.gz": (gzip.compress("".join(["time,a\n", *[f"{k},{k * k}\n" for k in range(999)]]).encode())[:400], "damaged"),
    "backwards.csv": (b"time,a\n0,1\n2,2\n1,3\n", "line 4: the time 1 is before 2, the time of the row above; sort the rows"),
    "ragged.csv": (b"time,a\n0,1\n1\n", "line 3: expected 2 values as in the header, found 1"),
    "decimal.csv": (b"time,a\n0,0,1,5\n", "numbers with decimal commas need semicolons"),
    "empty.csv": (b"", "it is empty"),
    "header.csv": (b"time,a\n", "expected rows of numbers"),
    "prose.txt": (b"once upon a time\n", "expected a header with the time and variables"),
    "picture.png": (b"\x89PNG\r\n\x1a\n\0\0\0", "neither text nor Parquet"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_file_that_cannot_be_read_gets_a_sentence_with_advice(open_page, name):
    content, sentence = BROKEN[name]
    page = open_page()
    drop(page, name, content)
    page.until(f"{FILE_STATUS}.startsWith('{name}: ') && !{FILE_STATUS}.endsWith('…')")
    assert sentence in page.evaluate(FILE_STATUS)
    assert "rows, " not in page.evaluate(FILE_STATUS)
    names, _ = shown(page, "good.csv", b"time,a\n0,1\n1,2\n")
    assert names == ["a"] and page.evaluate("document.getElementById('file-status').className") == ""


@pytest.mark.parametrize("compression", ["none", "snappy", "gzip", "brotli", "zstd", "lz4"])
def test_a_parquet_file_is_read_as_pyarrow_wrote_it(open_page, compression):
    content, values = parquet(compression)
    page = open_page()
    names, read = shown(page, "own.PARQUET", content)
    assert names == ["a", "n", "on"]
    for name in ["time", *names]:
        assert np.array_equal(read(name), np.asarray(values[name], dtype=float)), name
    assert any(request.endswith("codecs.min.js") for request in page.requests) == (compression not in ("none", "snappy"))


def test_all_variables_of_a_file_can_be_chosen(open_page):
    page = open_page()
    header = ",".join(["time", *[f"signal {k}" for k in range(40)]])
    content = "\n".join([header, *[",".join(str(t * k) for k in range(41)) for t in (1, 2)]]).encode()
    names, read = shown(page, "wide.csv", content)
    assert len(names) == 40 and "6 are drawn, choose others below" in page.evaluate(FILE_STATUS)
    drawn = "[...document.querySelectorAll('#dropped .figure')].map((figure) => figure.getAttribute('aria-label').split(' over')[0])"
    assert page.evaluate(drawn) == names[:6]
    page.evaluate(
        "const f = document.querySelector('#dropped input[type=search]'); f.value = 'AL 37'; f.dispatchEvent(new Event('input'));"
    )
    visible = "[...document.querySelectorAll('.choice label')].filter((label) => label.offsetHeight > 0)"
    assert page.evaluate(f"{visible}.map((label) => label.textContent.trim())") == ["signal 37"]
    page.evaluate(f"{visible}[0].firstChild.click(); document.querySelector('.choice input').click()")
    page.until("document.querySelectorAll('#dropped canvas').length === 6")
    assert page.evaluate(drawn) == [*names[1:6], "signal 37"]
    assert list(read("signal 37")) == [38, 76]


def test_a_file_of_200_mb_does_not_stop_the_page(open_page):
    page = open_page()
    page.evaluate(
        """(() => {
        window.longest = 0; let before = performance.now();
        const frame = (now) => { longest = Math.max(longest, now - before); before = now; requestAnimationFrame(frame); };
        requestAnimationFrame(frame);
        const row = (k) => `0,${Array.from({length: 12}, (_, j) => (k * j / 7).toPrecision(12)).join(',')}\\n`;
        const part = Array.from({length: 7000}, (_, k) => row(k)).join('');
        const parts = Array(Math.ceil(2e8 / part.length)).fill(part);
        const file = new File(['time,a,b,c,d,e,f,g,h,i,j,k,l\\n', ...parts], 'large.csv');
        const all = new DataTransfer(); all.items.add(file);
        document.dispatchEvent(new DragEvent('drop', {dataTransfer: all, bubbles: true, cancelable: true}));
        requestAnimationFrame(() => requestAnimationFrame(() => { longest = 0; window.start = performance.now(); }));
        })()"""
    )
    page.until(f"/[0-9]+ % read/.test({FILE_STATUS})")
    page.until("document.getElementById('dropped').dataset.shown === 'large.csv'", limit=180)
    longest, whole = page.evaluate("[longest, performance.now() - start]")
    print(f"longest frame: {longest} ms of {whole} ms")
    # On a busy machine, all takes longer.
    assert longest < max(1500, whole / 4)


def test_the_results_of_the_command_in_parquet_are_drawn(aso_ftc, open_page, tmp_path):
    results = tmp_path / "results.parquet"
    plant = ROOT / "dist" / "FrictionPendulum.fmu"
    done = aso_ftc("run", plant, "--stop-time", "1", "--step", "0.01", "--results", results)
    assert done.returncode == 0, done.stderr
    page = open_page()
    names, read = shown(page, "results.parquet", results.read_bytes())
    table = pq.read_table(results)
    for name in names:
        assert np.array_equal(read(name), table[name].to_numpy().astype(float)), name


def test_axe_finds_nothing_serious_before_and_after_a_run(open_page):
    page = open_page("#stop=5")
    assert page.violations() == []
    state(page, "F_c", "99")
    run_to_the_end(page)
    shown(page, "own.csv", b"time,a\n0,1\n1,2\n")
    assert page.violations() == []
