"""The words of Python for sentences of the libraries, which name options of the command and types of Rust."""

from __future__ import annotations

import re
from typing import Any

__all__ = ["in_python", "similar"]

# What Python has instead of options of the command. Options that are not here are no part of a sentence.
_OPTIONS = {
    "compile": "aso_ftc.compile",
    "connect": "connect",
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
    folded = {str(own).casefold(): str(own) for own in names}
    near = difflib.get_close_matches(text, folded, 3)
    # Also the variable that the name is a part of.
    near += [own for own in folded if own.endswith(f".{text}") and own not in near][:1]
    return f"; similar: {', '.join(folded[own] for own in near)}" if near else ""


def in_python(sentence: str) -> str:
    """Return a sentence of the libraries in the words of Python."""
    sentence = _OPTION.sub(lambda option: _OPTIONS[option[1]], sentence)
    for pattern, write in ((_FIELD, _field), (_VARIANT, _variant), (_TYPE, _type), (_MISSING, _missing)):
        sentence = pattern.sub(write, sentence)
    return sentence


def _names(found: re.Match[str]) -> list[str]:
    return re.findall(r"`([^`]*)`", found["known"])


def _table(found: re.Match[str]) -> str:
    """The table in which an entry is, as the start of a sentence."""
    name = (found["table"] or "").strip(" []")
    return f"{name}: " if name else ""


def _shown(found: re.Match[str]) -> str:
    return f"{_table(found)}{found['shown']}" if found["shown"] else "the entry"


def _field(found: re.Match[str]) -> str:
    known = _names(found)
    hint = similar(found["name"], known) or f", expected {', '.join(known)}"
    return f"{_table(found)}unknown entry {found['name']}{hint}"


def _variant(found: re.Match[str]) -> str:
    known = _names(found)
    return f"{_shown(found)}: expected {', '.join(known)}{similar(found['name'], known)}"


def _type(found: re.Match[str]) -> str:
    kind = _KINDS.get(found["kind"], "a table" if found["kind"].startswith("struct ") else found["kind"])
    return f"{_shown(found)}: expected {kind}"


def _missing(found: re.Match[str]) -> str:
    return f"{_table(found)}expected the entry {found['name']}"
