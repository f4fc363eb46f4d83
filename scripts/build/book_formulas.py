"""A hook of mkdocs that converts formulas to MathML while the book is built, so that pages need no script."""

import html
import re

from latex2mathml.converter import convert

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def mathml(match):
    """The formula as MathML, inline or as a separate paragraph."""
    display = "block" if match[2] == "[" else "inline"
    return convert(html.unescape(match[3]), display=display)


def on_page_content(content, **_):
    """Called by mkdocs with the HTML of each page."""
    return FORMULA.sub(mathml, content)
