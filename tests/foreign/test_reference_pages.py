"""Reference pages on files begin with the smallest file that works, shown as the file that their first command reads."""

import re

import pytest

from conftest import ROOT
from test_book import blocks, name

REFERENCE = ROOT / "docs" / "reference"
FURTHER = [page for page in sorted((REFERENCE / "plant-file").glob("*.md")) if page.stem != "large-plants"]
PAGES = [REFERENCE / "plant-file.md", *FURTHER, REFERENCE / "system-toml.md", REFERENCE / "ssp.md"]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_the_page_shows_the_file_of_its_first_command_unchanged(page):
    command = next(text for _, language, text in blocks(page) if language == "sh")
    shown = next(text for _, language, text in blocks(page) if language in {"toml", "xml"})
    path = re.search(r"^aso-ftc (?:design|run) (\S+)", command, re.MULTILINE)[1]
    assert shown == (ROOT / path).read_text(encoding="utf-8")
