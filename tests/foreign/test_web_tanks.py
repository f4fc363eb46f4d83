"""The three tanks in the browser: the second page of `scripts/web` in Chromium, against the command."""

import gzip
import json
import tomllib

import numpy as np
import pytest

from browser import CHROMIUM
from conftest import ROOT
from design_oracle import WITHOUT_PROOFS
from test_web import PAGE, opening, rows

pytestmark = [
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium is installed"),
    pytest.mark.skipif(not (PAGE / "tanks.wasm").exists(), reason="scripts/web has not built the page"),
]
DECISION = "document.getElementById('decision').textContent"
STOP = 1000


@pytest.fixture
def open_page(tmp_path):
    """A function that opens the page with a link."""
    with opening(tmp_path, name="tanks.html") as opened:
        yield opened


@pytest.fixture(scope="module")
def designed(aso_ftc, tmp_path_factory):
    """The folder with the design file and the FMU that the command makes of the example."""
    folder = tmp_path_factory.mktemp("tanks")
    plant = ROOT / "examples" / "three-tank" / "detection.toml"
    done = aso_ftc("design", plant, "--out", folder / "design.toml", "--fmu", folder / "TankDetection.fmu", *WITHOUT_PROOFS)
    assert done.returncode == 0, done.stderr
    return folder


def run_of(page):
    """The rows of the page, by name."""
    return {name: np.array(values) for name, values in page.evaluate("window.tanks.rows").items()}


def show(page, time):
    """Shows the tanks at a time."""
    page.evaluate(f"{{ const t = document.getElementById('time'); t.value = {time}; t.dispatchEvent(new Event('input')); }}")


def choose(page, name):
    """Presses the button of an experiment and stops the drawing."""
    label = json.dumps(name)
    page.evaluate(f"[...document.querySelectorAll('#presets button')].find((button) => button.textContent === {label}).click()")
    show(page, STOP)


def test_the_module_has_the_design_of_the_example(designed):
    texts = [(folder / "design.toml").read_text(encoding="utf-8") for folder in (ROOT / "web" / "tanks", designed)]
    ours, expected = (tomllib.loads(text) for text in texts)
    assert ours == expected


LINKS = [
    "",
    "#compensate=false&leak=3.5&blocked=30&blocked_from=410&offset=-12&noise=1.5",
    "#leak=20&noise=0",
    "#leak=1e-7&noise=2e-8",
]


@pytest.mark.parametrize("link", LINKS)
def test_1000_s_of_the_page_are_those_of_the_command_bit_for_bit(aso_ftc, open_page, designed, tmp_path, link):
    page = open_page(link)
    run = run_of(page)
    text = page.evaluate("document.getElementById('native').textContent")
    assert ('f_1" = -1e-13\n' in text) == ("leak=1e-7" in link), text
    text = text.replace('"dist/', f'"{ROOT}/dist/').replace('"results/', f'"{designed}/')
    file, results = tmp_path / "tanks.toml", tmp_path / "results.csv"
    file.write_text(text, encoding="utf-8")
    recorded = [word for name in run if name != "time" for word in ("--record", name)]
    done = aso_ftc("run", file, "--results", results, *recorded)
    assert done.returncode == 0, done.stderr
    theirs = rows(results.read_text(encoding="utf-8"))
    assert len(run["time"]) == STOP + 1 and len(run) == 16
    for name, values in run.items():
        assert np.array_equal(values, theirs[name]), name


# The experiments, the fault that is isolated at the end, and that fault with its estimate at its true size.
EXPERIMENTS = {
    "A leak": (1, "controller.f_hat[1]", -8e-6),
    "A blocked pump": (2, "controller.f_hat[2]", None),
    "A wrong sensor": (3, "controller.f_hat[3]", 0.02),
    "Two faults": (-1, "controller.f_hat[1]", -8e-6),
    "A small leak": (1, "controller.f_hat[1]", -1e-6),
    "No fault": (0, "controller.f_hat[1]", 0.0),
}


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_each_experiment_ends_with_its_decision_and_an_estimate_of_the_right_size(open_page, name):
    isolated, estimate, size = EXPERIMENTS[name]
    page = open_page()
    choose(page, name)
    run = run_of(page)
    late = run["time"] >= 600
    if size is None:  # 30 % of what the pump is told
        size = -0.3 * run["plant.Q_2"][late].mean()
    spread = run[estimate][late].std()
    assert abs(run[estimate][late].mean() - size) < spread, "the estimates are correlated over tens of seconds"
    assert run["controller.fault_isolated"][-1] == isolated
    assert run["controller.fault_detected"][run["time"] < 200].max() == 0
    if name == "A small leak":
        assert run["controller.t_detected"][-1] == 200 + 255, "as the page says, and later than the 120 s of the design"
    sentence = page.evaluate(DECISION)
    words = {1: "Leak, f_1", 2: "Blockage, f_2", 3: "Sensor 1, b_1", -1: "several faults"}
    assert (words[isolated] in sentence) if isolated else sentence == "No fault is detected."
    decisions = page.evaluate("[...document.querySelectorAll('#faults tbody tr')].map((row) => row.cells[3].textContent)")
    assert decisions == [{-1: "several", row: "✓ this one"}.get(isolated, "–") for row in (1, 2, 3)]


def test_compensation_returns_the_level_to_its_set_point_and_without_it_the_level_stays_low(open_page):
    page = open_page("#noise=0")
    on = run_of(page)
    page.evaluate("document.getElementById('set-compensate').click()")
    off = run_of(page)
    assert "compensate=false" in page.evaluate("location.hash")
    assert abs(on["plant.h_1"][-1] - 0.4) < 1e-5 and off["plant.h_1"][-1] < 0.39
    # At rest the volume of tank 1 is constant: what the pump delivers flows through the pipe, by Torricelli's law.
    for run in (on, off):
        pipe = 0.5 * 5e-5 * np.sqrt(2 * 9.81 * (run["plant.h_1"][-1] - run["plant.h_3"][-1]))
        assert run["plant.q_01"][-1] == pytest.approx(run["plant.Q_1"][-1] - 8e-6, rel=1e-9)
        assert run["plant.q_01"][-1] == pytest.approx(pipe, rel=1e-3)


def test_the_picture_the_table_and_the_sentence_are_those_of_the_row_at_the_time(open_page):
    page = open_page("#offset=20&offset_from=300")
    run = run_of(page)
    detected = int(run["controller.t_detected"][-1])
    assert 200 < detected < 300
    show(page, detected - 1)
    assert page.evaluate(DECISION) == "No fault is detected."
    show(page, detected)
    assert page.evaluate(DECISION).startswith(f"Fault detected at {detected} s")
    cells = "[...document.querySelectorAll('#faults tbody tr')].map((row) => [row.cells[1].textContent, row.cells[2].textContent])"
    numbers = [[float(text.replace("−", "-").split()[0]) for text in row] for row in page.evaluate(cells)]
    k = detected
    assert [row[0] for row in numbers] == [-8, 0, 0]
    scales = [1e6, 1e6, 1e3]
    assert [row[1] for row in numbers] == pytest.approx([scales[i] * run[f"controller.f_hat[{i + 1}]"][k] for i in range(3)], abs=0.0501)
    full = "[1, 2, 3].map((tank) => document.querySelectorAll('#drawing .water')[[0, 2, 1][tank - 1]].getAttribute('height') / 185 * 0.62)"
    for at in (100, detected, STOP):
        show(page, at)
        expected = [point + 5 * (run[f"plant.h_{tank}"][at] - point) for tank, point in ((1, 0.4), (2, 0.2), (3, 0.3))]
        assert page.evaluate(full) == pytest.approx(expected, abs=1e-9)


def test_it_plays_at_once_and_every_control_answers(tmp_path):
    with opening(tmp_path, motion="no-preference", name="tanks.html") as opened:
        page = opened("#leak=99&nonsense=1&blocked=many")
        assert page.evaluate("document.getElementById('value-leak').textContent") == "20 mL/s"
        page.until("Number(document.getElementById('time').value) > 20")
        page.evaluate("document.getElementById('speed').value = '200'")
        page.until("Number(document.getElementById('time').value) === 1000")
        page.until("document.getElementById('play').textContent === 'Run'")
        page.evaluate("document.getElementById('play').click()")
        assert page.evaluate("document.getElementById('play').textContent") == "Pause"
        names = page.evaluate("[...document.querySelectorAll('#fields input')].map((input) => input.id)")
        assert len(names) == 7
        before = page.evaluate("document.getElementById('native').textContent")
        for name in names:
            move = "f.value = f.value === f.max ? 0 : f.max; f.dispatchEvent(new Event('input'));"
            page.evaluate(f"{{ const f = document.getElementById('{name}'); {move} }}")
            after = page.evaluate("document.getElementById('native').textContent")
            assert after != before, name
            before = after
        assert run_of(page)["plant.q_01"].shape == (STOP + 1,)


@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_nothing_and_the_page_is_as_wide_as_the_window(tmp_path, width):
    with opening(tmp_path, width=width, name="tanks.html") as opened:
        page = opened()
        show(page, STOP)
        assert page.violations() == []
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_the_page_loads_at_most_300_kb_and_not_the_pendulum(open_page):
    page = open_page()
    names = {request.rpartition("/")[2] for request in page.requests if request.startswith("http")}
    assert {"tanks.html", "tanks.wasm", "module.js"} <= names and not names & {"paper.wasm", "page.js", "observer.wasm"}
    sizes = {name: len(gzip.compress((PAGE / name).read_bytes())) for name in names}
    assert sum(sizes.values()) <= 300_000, sizes
