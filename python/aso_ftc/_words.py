"""The words of Python for sentences of the libraries, which name options of the command and types of Rust."""

from __future__ import annotations

import re
from typing import Any

__all__ = ["in_python", "similar"]

# What Python has instead of options of the command. Options that are not here are no part of a sentence.
_OPTIONS = {
    "compile": "aso_ftc.compile",
    "certificate-time": "`aso-ftc design --certificate-time`",
    "connect": "connect",
    "force": "force=True",
    "gain-time": "`aso-ftc design --gain-time`",
    "isolate": "isolate=True",
    "log-calls": "a log of calls",
    "memory-limit": "memory_limit",
    "out": "file",
    "preload": 'the entry "preload" of the system',
    "results": "file",
    "step": "step",
    "step-control": 'algorithm["step-control"]',
    "stop-time": "stop_time",
    "time-limit": "call_time_limit",
}
_OPTION = re.compile(rf"--({'|'.join(sorted(_OPTIONS, key=len, reverse=True))})(?![\w-])(?: [A-Z]{{2,}}\b)?")
# Sentences of the reader of a configuration, with the line that it shows.
_SHOWN = r"(?:, in(?P<table> \[[^\n]*?\])?: (?P<shown>[^\n]*))?"
_FIELD = re.compile(rf"unknown field `(?P<name>[^`]*)`, expected (?P<known>(?:one of )?(?:`[^`]*`(?:, | or )?)+){_SHOWN}$")
_VARIANT = re.compile(
    rf"unknown variant `(?P<name>[^`]*)`, expected (?P<known>(?:one of )?(?:`[^`]*`(?:, | or )?)+){_SHOWN}$"
)
_TYPE = re.compile(rf"invalid (?:type|value): [^\n]*?, expected (?P<kind>[^\n]*?){_SHOWN}$")
_MISSING = re.compile(rf"missing field `(?P<name>[^`]*)`{_SHOWN}$")
_KINDS = {
    "a boolean": "true or false",
    "a map": "a table",
    "a sequence": "a list",
    "a string": "a text",
    "f64": "a number",
    **dict.fromkeys(("i64", "u32", "u64", "usize"), "a whole number"),
}


def similar(name: object, names: Any) -> str:
    """Return the end of a sentence that states the names nearest to one that is unknown; empty without any."""
    import difflib

    text = str(name).casefold()
    folded = {str(word).casefold(): str(word) for word in names}
    near = difflib.get_close_matches(text, folded, 3)
    # Also the variable that the name is a part of.
    near += [word for word in folded if word.endswith(f".{text}") and word not in near][:1]
    return f"; similar: {', '.join(folded[word] for word in near)}" if near else ""


def in_python(sentence: str) -> str:
    """Return a sentence of the libraries in the words of Python."""
    sentence = _OPTION.sub(lambda option: _OPTIONS[option[1]], sentence)
    for pattern, write in ((_FIELD, _field), (_VARIANT, _variant), (_TYPE, _type), (_MISSING, _missing)):
        sentence = pattern.sub(write, sentence)
    return sentence


def _names(match: re.Match[str]) -> list[str]:
    """The names that the sentence expects."""
    return re.findall(r"`([^`]*)`", match["known"])


def _table(match: re.Match[str]) -> str:
    """The table in which an entry is, as the start of a sentence."""
    name = (match["table"] or "").strip(" []")
    return f"{name}: " if name else ""


def _shown(match: re.Match[str]) -> str:
    return f"{_table(match)}{match['shown']}" if match["shown"] else "the entry"


# Each of these functions writes the sentence that replaces a match of the pattern with its name.
def _field(match: re.Match[str]) -> str:
    known = _names(match)
    hint = similar(match["name"], known) or f", expected {', '.join(known)}"
    return f"{_table(match)}unknown entry {match['name']}{hint}"


def _variant(match: re.Match[str]) -> str:
    known = _names(match)
    return f"{_shown(match)}: expected {', '.join(known)}{similar(match['name'], known)}"


def _type(match: re.Match[str]) -> str:
    kind = _KINDS.get(match["kind"], "a table" if match["kind"].startswith("struct ") else match["kind"])
    return f"{_shown(match)}: expected {kind}"


def _missing(match: re.Match[str]) -> str:
    return f"{_table(match)}expected the entry {match['name']}"
