"""The paper in the browser: the page of `scripts/web` in Chromium, in the book if that is built, against the command."""

import base64
import csv
import gzip
import json
import tomllib

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from browser import CHROMIUM, browser, served
from conftest import ROOT

IN_BOOK = ROOT / "target" / "book" / "paper"
PAGE = IN_BOOK if IN_BOOK.exists() else ROOT / "target" / "web" / "page"
pytestmark = [
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium is installed"),
    pytest.mark.skipif(not (PAGE / "paper.wasm").exists(), reason="scripts/web has not built the page"),
]
NAMES = ["plant.x_p", "plant.theta", "plant.v_p", "plant.omega", "plant.f_fric", "plant.regime", "controller.u", "controller.f_hat"]


@pytest.fixture
def open_page(tmp_path):
    """A function that opens the page with a permalink."""
    with served(PAGE) as address, browser(tmp_path / "profile") as page:

        def opened(link=""):
            page.open(f"{address}/index.html{link}")
            page.until("document.body.dataset.ready === 'true'")
            return page

        yield opened
        assert page.complaints == []
        assert all(request.startswith((address, "data:", "blob:")) for request in page.requests)


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


def of_the_command(aso_ftc, page, folder):
    """The rows of the command for the system.toml that the page shows."""
    text = page.evaluate("document.getElementById('native').textContent")
    text = text.replace('"dist/', f'"{ROOT}/dist/')
    file, results = folder / "paper.toml", folder / "results.csv"
    file.write_text(text, encoding="utf-8")
    recorded = [word for name in NAMES for word in ("--record", name)]
    done = aso_ftc("run", file, "--results", results, *recorded)
    assert done.returncode == 0, done.stderr
    return rows(results.read_text(encoding="utf-8"))


def equal(own, theirs):
    """Every row of the page is a row of the command, bit for bit."""
    at = np.searchsorted(theirs["time"], own["time"])
    assert len(own["time"]) > 100
    for name in ["time", *NAMES]:
        assert np.array_equal(own[name], theirs[name][at]), name


def test_100_s_of_the_page_are_those_of_the_command_bit_for_bit(aso_ftc, open_page, tmp_path):
    page = open_page()
    own = rows(run_to_the_end(page))
    assert len(own["time"]) == 10001 and own["time"][-1] == 100
    equal(own, of_the_command(aso_ftc, page, tmp_path))
    print("100 s were computed in", page.evaluate("document.body.dataset.spent"), "ms")


def test_the_page_loads_at_most_305_kb_at_first(tmp_path):
    requested = []
    with served(PAGE, requested) as address, browser(tmp_path / "profile") as page:
        page.open(f"{address}/index.html")
        page.until("document.body.dataset.ready === 'true'")
        assert f"{address}/paper.wasm" in page.requests, "requests of the worker are seen"
    names = {path.removeprefix("/") for path in requested}
    assert {"index.html", "worker.js", "paper.wasm"} <= names and "observer.wasm" not in names
    sizes = {name: len(gzip.compress((PAGE / name).read_bytes())) for name in names}
    assert sum(sizes.values()) <= 305_000, sizes


def test_faults_noise_and_an_observer_designed_in_the_page_are_those_of_the_command(aso_ftc, open_page, tmp_path):
    link = "#stop=12&t_on=4&F_s=28&M=3.3&eigenvalues=-900+-1000+-1100+-1200+-1300&noise_theta=1e-6&bias_x=0.001&gain_u=0.95&from=6"
    page = open_page(link)
    own = rows(run_to_the_end(page))
    settings = tomllib.loads(page.evaluate("document.getElementById('native').textContent"))["settings"]
    file = tomllib.loads((ROOT / "fmu-controller" / "resources" / "design.toml").read_text(encoding="utf-8"))
    a, c, f_a = (np.array(file[name]) for name in ("A", "C", "F_a"))
    gain = {n: [[settings[f"controller.{n}[{i},{j}]"] for j in (1, 2)] for i in range(1, k + 1)] for n, k in (("L_x", 4), ("L_f", 1))}
    error = np.block([[a - gain["L_x"] @ c, -f_a], [gain["L_f"] @ c, np.zeros((1, 1))]])
    found = np.sort(np.linalg.eigvals(error).real)
    assert np.allclose(found, [-1300, -1200, -1100, -1000, -900], rtol=1e-6)
    equal(own, of_the_command(aso_ftc, page, tmp_path))


def test_changes_during_the_run_are_in_the_system_toml(aso_ftc, open_page, tmp_path):
    page = open_page("#stop=6&t_on=1")
    page.evaluate("document.getElementById('speed').value = '5'; document.getElementById('play').click()")
    page.until("window.paper.rows[0].at(-1) > 2")
    page.evaluate(
        "const f = document.getElementById('set-F_c'); f.value = '15'; f.dispatchEvent(new Event('change'));"
        "document.getElementById('set-compensate').click()"
    )
    page.until("window.paper.rows[0].at(-1) > 3")
    own = rows(at_the_end(page))
    text = page.evaluate("document.getElementById('native').textContent")
    assert text.count("[[scenario.set]]") == 2 and "plant.F_c" in text
    equal(own, of_the_command(aso_ftc, page, tmp_path))


def test_a_change_at_the_time_of_a_row_after_a_step_back_is_that_of_the_command(aso_ftc, open_page, tmp_path):
    page = open_page("#stop=2&t_on=1")
    step = "for (let k = 0; k < {}; k += 1) document.getElementById('step').click()"
    newest = "window.paper.rows[0].at(-1)"
    page.evaluate(step.format(55))
    page.until(f"{newest} > 0.545")
    page.evaluate("document.getElementById('back').click()")
    page.until(f"{newest} < 0.505")
    page.evaluate("const f = document.getElementById('set-F_c'); f.value = '15'; f.dispatchEvent(new Event('change'));")
    own = rows(run_to_the_end(page))
    text = page.evaluate("document.getElementById('native').textContent")
    assert text.count("[[scenario.set]]") == 1 and "at = 0.5\n" in text
    assert len(own["time"]) == 201
    equal(own, of_the_command(aso_ftc, page, tmp_path))


def test_every_control_answers_and_settings_without_a_design_are_refused(open_page):
    page = open_page("#stop=20&nonsense=1")
    state = "document.getElementById('status').textContent"
    assert "unknown setting nonsense" in page.evaluate(state)
    click = "document.getElementById('{}').click()"
    for name in ["step", "step", "step", "back"]:
        page.evaluate(click.format(name))
    page.until("window.paper.rows[0].length > 0")
    page.evaluate("document.getElementById('speed').value = '20'")
    page.evaluate(click.format("play"))
    page.until("window.paper.rows[0].at(-1) > 1")
    page.evaluate(click.format("play"))
    assert page.evaluate(state) == "Paused."
    one = "document.querySelectorAll(`#set-${f.id}`).length === 1"
    assert page.evaluate(f"FIELDS.every((f) => {one} && document.getElementById(`set-${{f.id}}`).value !== '')")
    fields = json.loads(page.evaluate("JSON.stringify(FIELDS.filter((f) => typeof f.value === 'number'))"))
    for field in fields:
        page.evaluate(
            f"{{ const f = document.getElementById('set-{field['id']}'); f.value = 'x'; f.dispatchEvent(new Event('change')); }}"
        )
        assert "expected a number" in page.evaluate(state), field
        page.evaluate(f"document.getElementById('set-{field['id']}').value = '{field['value']}'")
    for text, sentence in [("-1 -2", "eigenvalues"), ("-1 -2 -3 -4 5", "below 0"), ("a b", "expected a number")]:
        page.evaluate(
            f"{{ const f = document.getElementById('set-eigenvalues'); f.value = '{text}'; f.dispatchEvent(new Event('change')); }}"
        )
        page.until(f"{state}.includes('{sentence}')", limit=10)
    page.evaluate(click.format("defaults"))
    page.until(f"{state} === 'Ready.'")


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
    page.until(f"scrollY > {before} + 100", limit=10)
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


def test_a_results_file_dropped_on_the_page_is_drawn(open_page):
    page = open_page()
    drop(page, "own.csv", b'time,a,"b[1,2]"\n0,1,2\n1,2,3\n')
    page.until("document.querySelectorAll('#dropped canvas').length === 2")
    assert "own.csv: 2 rows" in page.evaluate("document.getElementById('status').textContent")


@pytest.mark.parametrize("compression", ["none", "snappy"])
def test_a_parquet_file_is_read_as_pyarrow_wrote_it(open_page, tmp_path, compression):
    times = np.linspace(0.0, 1.0, 1001)
    values = {"time": times, "a": np.sin(times), "n": np.arange(1001) - 2**40, "on": times > 0.5, "text": ["x"] * 1001}
    pq.write_table(pa.table(values), tmp_path / "own.parquet", compression=compression)
    content = (tmp_path / "own.parquet").read_bytes()
    page = open_page()
    drop(page, "own.parquet", content)
    page.until("document.querySelectorAll('#dropped canvas').length === 3")
    data = base64.b64encode(content).decode()
    read = f"parseParquet(Uint8Array.from(atob('{data}'), (c) => c.charCodeAt(0)).buffer)"
    table = page.evaluate(read)
    assert table["names"] == ["time", "a", "n", "on"]
    assert np.array_equal(table["columns"], [np.asarray(values[name], dtype=float) for name in table["names"]])
    drop(page, "bad.parquet", b"PAR1 and nothing more")
    page.until("document.getElementById('status').textContent.startsWith('bad.parquet: ')")
    assert "rows" not in page.evaluate("document.getElementById('status').textContent")


def test_the_results_of_the_command_in_parquet_are_drawn(aso_ftc, open_page, tmp_path):
    results = tmp_path / "results.parquet"
    plant = ROOT / "dist" / "FrictionPendulum.fmu"
    done = aso_ftc("run", plant, "--stop-time", "1", "--step", "0.01", "--results", results)
    assert done.returncode == 0, done.stderr
    page = open_page()
    drop(page, "results.parquet", results.read_bytes())
    page.until("document.querySelectorAll('#dropped canvas').length > 2")
    assert "results.parquet: 101 rows" in page.evaluate("document.getElementById('status').textContent")


def test_axe_finds_nothing_serious_before_and_after_a_run(open_page):
    page = open_page("#stop=5")
    assert page.violations() == []
    run_to_the_end(page)
    assert page.violations() == []
