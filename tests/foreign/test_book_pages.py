"""The built book in a browser: at the width of a telephone no page scrolls sideways, every picture is there, and
axe-core finds nothing serious, in light and in dark colours. Needs `scripts/book` first."""

import pytest

from browser import CHROMIUM, MOUSE, browser
from conftest import ROOT

BOOK = ROOT / "target" / "book"
# The page of the pendulum is tested by test_web.py.
PAGES = sorted(page for page in BOOK.rglob("*.html") if page.parent.name != "paper")

pytestmark = [
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium"),
    pytest.mark.skipif(not PAGES, reason="the book is not built: scripts/book"),
]

WIDTH = 390
# The colours of the theme follow an attribute of the body. A change step by step would be measured on its way.
SCHEME = """
document.head.insertAdjacentHTML("beforeend", "<style>* { transition: none !important }</style>");
document.body.dataset.mdColorScheme = "%s"
"""
# The first element without children of each kind: of equal classes, in and around it. Contrast takes long to measure.
KINDS = """(() => {
  const first = new Map();
  for (const leaf of document.querySelectorAll(".md-content :not(:has(*)), .md-header :not(:has(*))")) {
    const kind = [leaf, leaf.parentElement, leaf.parentElement.parentElement].map((e) => e.tagName + e.className).join();
    if (!first.has(kind)) first.set(kind, leaf);
  }
  return { include: [...first.values()] };
})()"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A page as wide as a telephone's."""
    with browser(tmp_path_factory.mktemp("profile"), flags=[MOUSE]) as opened:
        size = {"width": WIDTH, "height": 844, "deviceScaleFactor": 1, "mobile": False}
        opened.call("Emulation.setDeviceMetricsOverride", **size)
        yield opened


def test_no_page_scrolls_sideways_or_lacks_a_picture_and_axe_finds_nothing_serious(page):
    wrong = []
    for path in PAGES:
        page.open(path.as_uri())
        width = page.evaluate("document.documentElement.scrollWidth")
        problems = [f"{width} pixels wide"] if width > WIDTH else []
        problems += page.evaluate("[...document.images].filter((image) => !image.naturalWidth).map((image) => image.src)")
        # What surrounds the article is the same on all pages.
        place = "document" if path == PAGES[0] else "'.md-content'"
        problems += page.serious(place, rules={"color-contrast": {"enabled": False}})
        for scheme in ("default", "slate"):
            page.evaluate(SCHEME % scheme)
            problems += [f"{scheme}: {rule}" for rule in page.serious(KINDS, runOnly=["color-contrast"])]
        wrong += [f"{path.relative_to(BOOK)}: {one}" for one in problems]
    assert not wrong, "\n".join(wrong)
