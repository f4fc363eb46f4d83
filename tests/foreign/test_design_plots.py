"""The plots in the report of a design, in a browser: their numbers are those of the JSON report."""

import json
import math
import re
from bisect import bisect_right

import pytest

from browser import CHROMIUM, browser
from conftest import ROOT

pytestmark = pytest.mark.skipif(not CHROMIUM, reason="no Chromium is installed")


@pytest.fixture(scope="module")
def designed(aso_ftc, tmp_path_factory):
    """The page of a design and its numbers."""
    folder = tmp_path_factory.mktemp("design")
    outputs = ("--out", folder / "design.toml", "--report", folder / "design.html", "--json")
    done = aso_ftc("design", ROOT / "examples" / "plants" / "quadruple-tank.toml", *outputs)
    assert done.returncode in (0, 1), done.stderr
    return folder / "design.html", json.loads(done.stdout)


@pytest.fixture
def opened(designed, tmp_path):
    """The page in a browser; afterwards, nothing was requested and nothing complained about."""
    with browser(tmp_path / "profile") as page:
        page.open(designed[0].as_uri())
        yield page
        assert page.complaints == [] and page.requests == [designed[0].as_uri()]


def curve(numbers, identifier):
    """Places and lists of values of a plot, without the places that an axis with decades cannot show."""
    kind, *place = identifier.split("-")
    place = [int(part) - 1 for part in place]
    if kind == "step":
        entry = numbers["steps"][place[0]]["curves"][place[1]]
        places, lists = entry["times"], [entry["values"]]
    else:
        entry = (numbers["robustness"]["curves"] if kind == "sensitivity" else numbers["frequency"])[place[0]]
        places, lists = entry["frequencies"], entry["singular_values"]
    first = next(k for k, at in enumerate(places) if at > 0)
    return places[first:], [values[first:] for values in lists]


def show(page, identifier):
    page.evaluate(
        f"document.getElementById('{identifier}').closest('details').open = true;"
        f"document.getElementById('{identifier}').scrollIntoView({{block: 'center'}})"
    )
    page.until(f"document.querySelector('#{identifier} .u-over') !== null")


def place(page, identifier, share):
    """Where a share of the horizontal axis of a plot is on the screen."""
    words = ("left", "top", "width", "height")
    box = page.evaluate(
        f"(({{ left, top, width, height }}) => ({{ left, top, width, height }}))"
        f"(document.querySelector('#{identifier} .u-over').getBoundingClientRect())"
    )
    left, top, width, height = (box[word] for word in words)
    return left + share * width, top + height / 2


def mouse(page, kind, point, **words):
    page.call("Input.dispatchMouseEvent", type=kind, x=point[0], y=point[1], **words)


def key(page, name):
    """Presses a key in the plot that has the focus."""
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", type=kind, key=name)


def legend(page, identifier):
    """The numbers in the legend of a plot: the place of the cursor and the values there; None without a cursor."""
    frame = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    cells = f"[...document.querySelectorAll('#{identifier} .u-value')].map((cell) => cell.textContent)"
    texts = page.evaluate(f"{frame}.then(() => {cells})")
    return None if "–" in texts or "--" in texts else [float(text) for text in texts]


def nearest(places, at):
    """The index of the point next to a place, as uPlot finds it: by the distance of the values."""
    after = min(max(bisect_right(places, at), 1), len(places) - 1)
    return after if places[after] - at <= at - places[after - 1] else after - 1


def nine(value):
    return float(f"{value:.8e}")


def assert_reads_the_numbers(page, numbers, identifier, share, ends=None):
    """The legend shows a point of the JSON report, and the one at this share of the axis."""
    places, lists = curve(numbers, identifier)
    at, *values = legend(page, identifier)
    index = min(range(len(places)), key=lambda k: abs(places[k] - at))
    assert at == nine(places[index]) and values == [nine(series[index]) for series in lists], identifier
    low, high = ends or (places[0], places[-1])
    expected = nearest(places, low * (high / low) ** share)
    # The pointer is on a whole pixel of the axis, and the ends of what was dragged are on whole pixels of the whole axis.
    width = page.evaluate(f"document.querySelector('#{identifier} .u-over').clientWidth")
    pixels = [math.log(end / start) / width for start, end in ((low, high), (places[0], places[-1]))]
    assert abs(index - expected) <= 1 or abs(math.log(places[index] / places[expected])) < sum(pixels)
    return places[index]


def test_the_cursor_shows_the_numbers_of_the_json_report_in_all_plots_of_its_axis(designed, opened):
    _, numbers = designed
    for identifier, others, share in (
        ("step-1-1", ("step-1-2", "step-1-5"), 0.3),
        ("step-2-3", ("step-2-1",), 0.8),
        ("sensitivity-1", ("sensitivity-2", "sensitivity-3"), 0.5),
        ("frequency-1", ("frequency-2",), 0.25),
    ):
        show(opened, identifier)
        mouse(opened, "mouseMoved", place(opened, identifier, share))
        at = assert_reads_the_numbers(opened, numbers, identifier, share)
        for other in others:
            same = curve(numbers, other)[0]
            linked = assert_reads_the_numbers(opened, numbers, other, share, (same[0], same[-1]))
            assert abs(math.log(linked / at)) < 0.02 * math.log(same[-1] / same[0])
    unlike = opened.evaluate("document.querySelector('#step-1-1 .u-value')?.textContent ?? '–'")
    assert unlike == "–", "time does not follow the cursor of a frequency"


def test_a_drag_zooms_all_plots_of_the_axis_and_a_double_click_shows_all(designed, opened):
    _, numbers = designed
    show(opened, "step-1-1")
    places, _ = curve(numbers, "step-1-1")
    low, high = (places[0] * (places[-1] / places[0]) ** share for share in (0.4, 0.7))
    ends = [place(opened, "step-1-1", share) for share in (0.4, 0.55, 0.7)]
    mouse(opened, "mousePressed", ends[0], button="left", clickCount=1)
    for point in ends[1:]:
        mouse(opened, "mouseMoved", point, button="left", buttons=1)
    mouse(opened, "mouseReleased", ends[-1], button="left", clickCount=1)
    for identifier in ("step-1-1", "step-1-2"):
        for share, end in ((0.01, low), (0.99, high)):
            mouse(opened, "mouseMoved", place(opened, identifier, share))
            at = assert_reads_the_numbers(opened, numbers, identifier, share, (low, high))
            assert abs(math.log(at / end)) < 0.05 * math.log(high / low)
    # A plot that was not yet drawn follows.
    show(opened, "step-3-2")
    mouse(opened, "mouseMoved", place(opened, "step-3-2", 0.99))
    assert_reads_the_numbers(opened, numbers, "step-3-2", 0.99, (low, high))
    point = place(opened, "step-3-2", 0.5)
    for count in (1, 2):
        mouse(opened, "mousePressed", point, button="left", clickCount=count)
        mouse(opened, "mouseReleased", point, button="left", clickCount=count)
    mouse(opened, "mouseMoved", place(opened, "step-3-2", 0.999))
    assert legend(opened, "step-3-2")[0] > 0.98 * places[-1]


def test_two_fingers_zoom_all_plots_of_the_axis_and_a_double_tap_shows_all(designed, opened):
    _, numbers = designed
    show(opened, "step-1-1")
    places, _ = curve(numbers, "step-1-1")
    first, last = places[0], places[-1]
    # What is below the fingers moves with them: of the axis, shares 0.4 and 0.6 become its ends.
    opened.pinch("#step-1-1 .u-over", (0.4, 0.6), (0.0, 1.0))
    low, high = (first * (last / first) ** share for share in (0.4, 0.6))
    for identifier in ("step-1-1", "step-1-2"):
        for share, end in ((0.01, low), (0.99, high)):
            mouse(opened, "mouseMoved", place(opened, identifier, share))
            at = assert_reads_the_numbers(opened, numbers, identifier, share, (low, high))
            assert abs(math.log(at / end)) < 0.1 * math.log(high / low)
    # Both fingers to the right: what was at the left edge moves to the middle.
    opened.pinch("#step-1-1 .u-over", (0.1, 0.3), (0.6, 0.8))
    mouse(opened, "mouseMoved", place(opened, "step-1-1", 0.5))
    assert abs(math.log(legend(opened, "step-1-1")[0] / low)) < 0.1 * math.log(high / low)
    opened.double_tap("#step-1-1 .u-over")
    mouse(opened, "mouseMoved", place(opened, "step-1-1", 0.999))
    assert legend(opened, "step-1-1")[0] > 0.98 * last
    # Zoomed out, there is not more than everything.
    opened.pinch("#step-1-1 .u-over", (0.1, 0.9), (0.45, 0.55))
    mouse(opened, "mouseMoved", place(opened, "step-1-1", 0.999))
    assert legend(opened, "step-1-1")[0] > 0.98 * last


def test_one_finger_on_a_plot_scrolls_the_page_and_does_not_zoom(opened):
    show(opened, "step-1-1")
    mouse(opened, "mouseMoved", place(opened, "step-1-1", 0.999))
    before, right = opened.evaluate("scrollY"), legend(opened, "step-1-1")[0]
    opened.swipe_up("#step-1-1 .u-over", 200)
    opened.until(f"scrollY > {before} + 100")
    mouse(opened, "mouseMoved", place(opened, "step-1-1", 0.999))
    assert legend(opened, "step-1-1")[0] == right


def test_the_keyboard_moves_the_cursor_and_zooms(designed, opened):
    _, numbers = designed
    places, (values,) = curve(numbers, "step-1-2")
    show(opened, "step-1-2")
    opened.evaluate("document.querySelector('#step-1-2 .uplot').focus()")
    key(opened, "ArrowRight")
    first, value = legend(opened, "step-1-2")
    assert value == nine(values[places.index(first)])
    key(opened, "ArrowRight")
    second = legend(opened, "step-1-2")[0]
    assert second > first and legend(opened, "step-1-1")[0] == second
    for _ in range(9):
        key(opened, "+")
    index = places.index(second)
    for step in (1, 2, 3):
        key(opened, "ArrowRight")
        at, value = legend(opened, "step-1-2")
        assert (at, value) == (nine(places[index + step]), nine(values[index + step])), "zoomed in: point by point"
    mouse(opened, "mouseMoved", place(opened, "step-1-2", 0.99))
    assert legend(opened, "step-1-2")[0] < 2 * second
    key(opened, "0")
    mouse(opened, "mouseMoved", place(opened, "step-1-2", 0.999))
    assert legend(opened, "step-1-2")[0] > 0.98 * places[-1]


def test_a_vertical_axis_with_decades_zooms_out_to_the_smallest_number_and_the_page_goes_on(opened):
    show(opened, "frequency-1")
    x, y = place(opened, "frequency-1", 0.5)
    top = y - 0.45 * opened.evaluate("document.querySelector('#frequency-1 .u-over').clientHeight")
    for _ in range(40):
        mouse(opened, "mouseWheel", (x, top), deltaX=0, deltaY=100, modifiers=8)
    mouse(opened, "mouseMoved", (x, y))
    assert all(value > 0 for value in legend(opened, "frequency-1"))


def test_zoomed_out_by_keys_at_the_end_of_an_axis_there_is_not_more_than_everything(opened):
    # Places of pixels are rounded.
    script = """([low, high], isLogarithmic, part) => {
        const axis = new LinkedAxis({ name: 'end', isLogarithmic, whole: [low, high] });
        axis.zoomAbout({
            cursor: { left: 1 }, over: { clientHeight: 1 }, scales: { x: { min: low, max: high } },
            posToVal: () => high * part, valToPos: () => 1, setCursor: () => undefined,
        }, 2);
        return axis.range;
    }"""
    for ends, is_logarithmic in (([0, 10], "false"), ([0.001, 300], "true"), ([1e-9, 1e3], "true")):
        for part in (1 - 1e-15, 1, 1 + 1e-15):
            assert opened.evaluate(f"({script})({ends}, {is_logarithmic}, {part!r})") is None


def test_plots_are_drawn_when_they_come_into_view_and_all_of_them_for_paper(opened):
    count = "document.querySelectorAll('.uplot canvas').length"
    everything = opened.evaluate("document.querySelectorAll('.plot').length")
    assert opened.evaluate(count) < everything > 40
    opened.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark"}])
    # The numbers of drawn pixels before the script ends: a browser may print before the microtasks.
    pixels = "canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.filter(Boolean).length"
    drawn = opened.evaluate(
        f"dispatchEvent(new Event('beforeprint')), [...document.querySelectorAll('.uplot canvas')].map((canvas) => {pixels})"
    )
    assert len(drawn) == everything and min(drawn) > 1000
    text = "getComputedStyle(document.documentElement).getPropertyValue('--text').trim()"
    assert opened.evaluate(text) == "#1c1f23", "paper is light"
    opened.evaluate("dispatchEvent(new Event('afterprint'))")
    opened.until(f"{count} < {everything}")
    assert opened.evaluate(text) == "#e4e7eb"


def test_the_first_screen_has_the_verdict_its_reasons_and_what_to_change(designed, opened):
    _, numbers = designed
    assert opened.evaluate("document.querySelector('.verdict').getBoundingClientRect().bottom") < 900
    assert opened.evaluate("document.documentElement.scrollHeight") < 2500
    text = opened.evaluate("document.querySelector('.verdict').innerText")
    level, reasons = numbers["verdict"]["level"], numbers["verdict"]["reasons"]
    assert f"Verdict: {level}" in text and all(reason in text for reason in reasons)
    assert ("What to change" in text) == (level != "green")
    figures = opened.evaluate("document.querySelector('.key').innerText")
    peaks = [point["judged"] for point in numbers["robustness"]["points"]]
    assert all(f"{peak:.5g}" in figures for peak in peaks)


def test_a_link_to_a_section_and_paper_open_what_is_folded(opened):
    folded = "document.querySelectorAll('main section > details:not([open])').length"
    everything = opened.evaluate("document.querySelectorAll('main section').length")
    assert opened.evaluate(folded) == everything
    opened.evaluate("location.hash = '#frequency-1'")
    opened.until("document.querySelector('#frequency-1 .u-over') !== null")
    assert opened.evaluate(folded) == everything - 1
    opened.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert opened.evaluate(folded) == 0
    opened.evaluate("dispatchEvent(new Event('afterprint'))")
    assert opened.evaluate(folded) == everything - 1


def test_a_plot_can_be_enlarged(opened):
    show(opened, "frequency-1")
    width = "document.querySelector('#frequency-1 canvas').clientWidth"
    before = opened.evaluate(width)
    opened.evaluate("document.querySelector('#frequency-1').closest('figure').querySelector('button').click()")
    opened.until(f"{width} > 1.5 * {before}")


def test_without_javascript_the_page_says_where_the_numbers_are(designed):
    text = designed[0].read_text(encoding="utf-8")
    said = re.search(r"<noscript>(.*?)</noscript>", text, re.DOTALL).group(1)
    assert "need JavaScript" in said and "--json" in said
