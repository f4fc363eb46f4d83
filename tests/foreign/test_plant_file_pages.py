"""The pages on the plant file show the smallest example of each table as the file that their first command reads."""

import re

import pytest

from conftest import ROOT
from test_book import blocks, name

REFERENCE = ROOT / "docs" / "reference"
PAGES = [REFERENCE / "plant-file.md", *sorted((REFERENCE / "plant-file").glob("*.md"))]


@pytest.mark.parametrize("page", [page for page in PAGES if page.stem != "large-plants"], ids=name)
def test_the_page_shows_the_file_of_its_first_command_unchanged(page):
    command = next(text for _, language, text in blocks(page) if language == "sh")
    shown = next(text for _, language, text in blocks(page) if language == "toml")
    (path,) = re.findall(r"^aso-ftc design (\S+\.toml) ", command, re.MULTILINE)
    assert shown == (ROOT / path).read_text(encoding="utf-8")
