"""The HTML page of a campaign: one file with its data and plotly.js, without any request."""

from __future__ import annotations

import base64
import json
import math
import os
import zlib
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .._errors import ConfigurationError, ResultsError
from ._analysis import batches, describe, evidence
from ._border import border
from ._packages import package

if TYPE_CHECKING:
    from ._analysis import Outcome

__all__ = ["write"]

_MARK = '<meta name="generator" content="aso-ftc campaign">'
_POINTS = 10_000
_ROWS = 50
# The strength from which on a parameter decides, and the p-value below which it does so beyond chance.
_DECISIVE = 0.3
_CHANCE = 0.05
_BINS = 60
# An axis of positive values is logarithmic if the largest is above the median by this factor, or the median
# above the lowest hundredth by twice this factor.
_WIDE = 50.0
_INDICES = {
    "saltelli": ("sobol", "Sobol indices"),
    "morris": ("morris", "Elementary effects of Morris"),
    "fast": ("fast", "FAST indices"),
}


def write(outcome: Outcome, path: Path, force: bool) -> None:
    """Write the page of a campaign by temporary name and rename."""
    if not force and path.exists() and _MARK not in _head(path):
        sentence = f"{path}: this file is no page of a campaign and is kept; force=True overwrites it"
        raise ConfigurationError(sentence, "FileExists", {"path": str(path)})
    script = package("plotly.offline").get_plotlyjs()
    text = _page(outcome, script)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise ResultsError(f"{path}: cannot write the page: {error.strerror}", "CannotWrite") from error


def _head(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return file.read(1000).decode("utf-8", "replace")
    except OSError as error:
        sentence = f"{path}: cannot read the file that the page would replace: {error.strerror}"
        raise ResultsError(sentence, "CannotRead") from error


def _page(outcome: Outcome, script: str) -> str:
    measures = list(outcome.manifest["measures"])
    # The page opens on a measure that can fail.
    opened = next((name for name in measures if name in outcome.limits), measures[0] if measures else "")
    rows, drawn = _choose(outcome)
    fitted = _border(outcome, opened)
    data = {
        "border": fitted,
        "command": outcome.command_parts,
        "measures": [_measure(outcome, name) for name in measures],
        "columns": _columns(outcome, measures, rows),
        "runs": outcome.runs[rows].tolist(),
    }
    indices = "".join(
        f'<div class="of-measure">{_indices_note(outcome, measure)}</div>' for measure in data["measures"]
    )
    influence = "".join(f'<div class="of-measure">{_influence(outcome, name)}</div>' for name in measures)
    options = "".join(
        f'<option value="{at}"{" selected" if name == opened else ""}>{escape(name)}</option>'
        for at, name in enumerate(measures)
    )
    inputs = "".join(
        f'<option value="{at}">{escape(name)}</option>' for at, name in enumerate([*outcome.inputs, "run"])
    )
    method = outcome.manifest["design"]["method"]
    parallel = (
        "<p>One line for each run with a value of the measure, coloured by the measure. Drag along an axis to "
        'select runs. <span id="parallel-note"></span></p><div class="wide"><div id="parallel"></div></div>'
    )
    scatter = (
        f'<p><label>Parameter: <select id="input">{inputs}</select></label> Click a point for the command that '
        f'repeats its run. {escape(drawn)}</p><div id="scatter"></div><div id="point" aria-live="polite"></div>'
    )
    heat = '<p id="heat-note"></p><div class="wide"><div id="heat"></div></div>'
    sections = [
        ("", _answer(outcome, opened)),
        ("Where the border runs", _border_text(outcome, fitted)),
        ("Limits", _limits(outcome)),
        ("What was run", _summary(outcome) + _parameters(outcome)),
        ("", f'<p class="choice"><label>Measure: <select id="measure">{options}</select></label></p>'),
        ("Influence of each parameter", influence if outcome.inputs else ""),
        (
            _INDICES.get(method, ("", ""))[1],
            indices + '<div id="indices"></div>' if method in _INDICES else "",
        ),
        ("Parallel coordinates", parallel if outcome.inputs else ""),
        ("Parameter and measure", scatter),
        ("Distribution of each measure", _histograms(data["measures"])),
        ("Faults", heat if _faults(outcome) else ""),
        ("Runs that did not finish", _unfinished(outcome)),
    ]
    if not measures:
        sections = [sections[3], sections[-1]]
    body = "".join(
        (f"<section><h2>{escape(title)}</h2>{text}</section>" if title else text)
        for title, text in sections
        if text
    )
    embedded = json.dumps(data, allow_nan=False, separators=(",", ":"))
    name = str(outcome.manifest["name"])
    name = escape(outcome.folder.name if name == "campaign" else name)
    style, drawing = (Path(__file__).with_name(file).read_text(encoding="utf-8") for file in ("page.css", "page.js"))
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">{_MARK}{_POLICY}'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Campaign {name}</title><style>\n{style}</style></head>\n<body><h1>Campaign {name}</h1>{_NOSCRIPT}{body}\n"
        f'<script type="text/plain" id="plotly">{_packed(script)}</script>\n'
        f'<script type="text/plain" id="data">{_packed(embedded)}</script>\n'
        f"<script>\n'use strict';\n(async () => {{\n{drawing}}})();\n</script></body></html>\n"
    )


def _packed(text: str) -> str:
    """Return a text compressed, in characters that a script element takes as they are: "<" cannot occur."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15, 9)
    return base64.b85encode(packer.compress(text.encode()) + packer.flush()).decode().replace("<", "'")


def _faults(outcome: Outcome) -> bool:
    return bool(outcome.manifest.get("faults"))


def _row(cells: Iterable[object], tag: str = "td") -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(_text(cell))}</{tag}>" for cell in cells) + "</tr>"


def _table(head: Iterable[str], rows: Iterable[str]) -> str:
    return f'<div class="wide"><table><thead>{_row(head, "th")}</thead><tbody>{"".join(rows)}</tbody></table></div>'


def _text(value: object) -> str:
    if isinstance(value, (float, np.floating)):
        return "" if math.isnan(value) else f"{value:.4g}"
    return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)


def _number(value: float) -> float | None:
    """A number of JSON with six digits, ``None`` if it is not finite."""
    return float(f"{value:.6g}") if math.isfinite(value) else None


def _numbers(values: Iterable[float]) -> list[float | None]:
    return [_number(float(value)) for value in values]


# The answer.


def _answer(outcome: Outcome, opened: str) -> str:
    """How many runs fail, and which parameter decides on what evidence."""
    total, lost = len(outcome), int(outcome.unfinished.sum())
    lines = []
    for name in outcome.limits:
        failures = int(outcome.failed(name).sum())
        text = f"{_share(failures, total)} fail: {name} is not {describe(outcome.limits[name])}."
        if lost:
            text = text.removesuffix(".") + f", or the run did not finish ({lost:,} runs)."
        if not failures:
            text = f"None of the {total:,} runs fails: {name} is {describe(outcome.limits[name])}."
        try:
            upper = outcome.failure_probability(name).upper
            text += "" if failures else f" The probability of a failure is below {upper:.2g} (95 %)."
        except ConfigurationError:
            pass
        lines.append(text)
    if not outcome.limits:
        lines.append(f"{_share(lost, total)} did not finish. The campaign has no limits, so that nothing else fails.")
    if outcome.inputs and opened:
        lines += _evidence(outcome, opened)
    return '<div class="answer">' + "".join(f"<p>{escape(line)}</p>" for line in lines) + "</div>"


def _evidence(outcome: Outcome, measure: str) -> list[str]:
    """Which parameter decides, and how strong the evidence is."""
    influence = outcome.influence(measure)
    ranked = evidence(outcome, influence, measure)
    if not ranked:
        return []
    limited = measure in outcome.limits and len(set(influence["failed"])) > 1

    def facts(name: str) -> str:
        rows = influence.loc[[name]]
        if outcome.inputs[name]:
            return f"rank correlation with {measure} {rows['correlation'].iloc[0]:.2f}"
        word = "failed" if limited else "median"
        ends = rows.sort_values(word, ascending=False, kind="stable").iloc[[0, -1]].to_dict("records")
        shown = [f"{100 * row[word]:.3g} %" if limited else f"{row[word]:.3g}" for row in ends]
        texts = [f"{text} with {row['value'] or '(none)'}" for text, row in zip(shown, ends)]
        return f"{'failures' if limited else f'median of {measure}'} from {texts[0]} to {texts[1]}"

    name, strength, p = ranked[0]
    reason = f"{facts(name)}, {_chance(p)}"
    if strength >= _DECISIVE and p * len(ranked) < _CHANCE:
        text = f"{name} decides most: {reason}"
    elif strength >= _DECISIVE and p < _CHANCE:
        text = f"{name} perhaps decides most: {reason}, the least of {len(ranked)} parameters"
    else:
        text = f"No parameter decides visibly: the strongest is {name}, {reason}"
    if len(ranked) > 1:
        text += f"; next {ranked[1][0]}, {facts(ranked[1][0])}, {_chance(ranked[1][2])}"
    return [text + "."]


def _chance(p: float) -> str:
    return f"p = {p:.2g}" if p >= 1e-3 else "p < 0.001"


def _share(count: int, total: int) -> str:
    return f"{count:,} of {total:,} runs ({100 * count / max(total, 1):.3g} %)"


def _border(outcome: Outcome, measure: str) -> dict[str, Any] | None:
    """The two strongest parameters, and the probability of failure over both."""
    if measure not in outcome.limits:
        return None
    influence = outcome.influence(measure)
    names = list(influence[influence["correlation"].notna()].index[:2])
    if len(names) < 2:
        return None
    frame = outcome.read(names)
    x, y = (frame[name].to_numpy(dtype=np.float64) for name in names)
    failed = outcome.failed(measure)
    fitted = border(x, y, failed)
    missing = ~(np.isfinite(x) & np.isfinite(y))
    return {
        "names": names,
        "measure": measure,
        "missing": [int(missing.sum()), int(failed[missing].sum())],
        "surface": None
        if fitted is None
        else {
            "x": _numbers(fitted.x),
            "y": _numbers(fitted.y),
            "z": [[round(float(value), 4) for value in row] for row in fitted.probability],
            "wrong": fitted.wrong,
        },
    }


def _border_text(outcome: Outcome, fitted: Mapping[str, Any] | None) -> str:
    if fitted is None:
        return ""
    a, b = fitted["names"]
    text = f"The runs over the two parameters with the strongest influence on {fitted['measure']}, {a} and {b}."
    missing, failures = fitted["missing"]
    if missing:
        text += f" {missing:,} of {len(outcome):,} runs, of which {failures:,} fail, have no value of one of them and are missing here."
    if fitted["surface"] is None:
        text += " Too few runs fail, or too few pass, to fit a surface."
    else:
        share = float(outcome.failed(fitted["measure"]).mean())
        text += (
            " Colours: the probability of a failure, by a logistic regression with squares of both; the line is one half. "
            f"In cross-validation it puts {100 * fitted['surface']['wrong']:.2g} % of the runs on the wrong side; without "
            f"these parameters it would be {100 * min(share, 1 - share):.2g} %."
        )
    return f'<p>{escape(text)}</p><div class="wide"><div id="border"></div></div>'


# What was run.


def _summary(outcome: Outcome) -> str:
    manifest = outcome.manifest
    design = dict(manifest["design"])
    method = design.pop("method")
    if "seed" in manifest:
        design.setdefault("seed", manifest["seed"])
    options = ", ".join(f"{key} {json.dumps(value)}" for key, value in design.items())
    statuses = ", ".join(f"{count:,} {name}" for name, count in outcome.statuses.items())
    early = ", ended early" if manifest.get("complete") and len(outcome) < manifest["runs"] else ""
    entries = {
        "Runs": f"{len(outcome):,} of {manifest['runs']:,}{early}: {statuses}",
        "Design": f"{method} ({options})" if options else method,
        "Faults": "none",
        "Folder": str(outcome.folder),
    }
    if _faults(outcome):
        faults = outcome.read(["fault"])["fault"]
        faults = faults[faults != ""]
        entries["Faults"] = f"{faults.nunique():,} faults in {len(faults):,} runs"
    return (
        "<dl>"
        + "".join(f"<dt>{key}</dt><dd>{escape(str(text))}</dd>" for key, text in entries.items())
        + "</dl>"
    )


def _parameters(outcome: Outcome) -> str:
    units = {entry["name"]: entry.get("unit") for entry in outcome.manifest["parameters"]}
    rows = []
    for names in batches(units):
        frame = outcome.read(names)
        for name in names:
            if outcome.inputs[name]:
                values = frame[name].to_numpy()
                ends = [float(np.nanmin(values)), float(np.nanmax(values))]
                rows.append(_row([name, units[name] or "", *ends]))
            else:
                levels = sorted(str(value) for value in frame[name].unique())
                more = f" and {len(levels) - 5:,} more" if len(levels) > 5 else ""
                rows.append(_row([name, units[name] or "", ", ".join(levels[:5]) + more, ""]))
    return _table(("parameter", "unit", "lowest", "highest"), rows) if rows else ""


# Limits and failures.


def _limits(outcome: Outcome) -> str:
    limits = outcome.limits
    if not limits:
        return "<p>The campaign has no limits.</p>"
    rows = []
    note = "Bounds: Clopper and Pearson, 95 %."
    for name in [*limits, None] if len(limits) > 1 else limits:
        failed = outcome.failed(name)
        cells: list[object] = [name or "any limit", describe(limits[name]) if name else ""]
        cells += [
            outcome.manifest["measures"][name].get("unit") or "" if name else "",
            int(failed.sum()),
            len(failed),
        ]
        try:
            estimate = outcome.failure_probability(name)
            cells += [estimate.probability, estimate.lower, estimate.upper]
            if estimate.note:
                note = f"Bounds: Clopper and Pearson, 95 %; {estimate.note}."
        except ConfigurationError as error:
            cells += [float(failed.mean()), "", ""]
            note = f"No bounds: {error}."
        rows.append(_row(cells))
    if _faults(outcome):
        note = "The fraction is over all runs and has no bounds: the faults are a list and no random sample."
    head = ("measure", "limit", "unit", "failures", "runs", "fraction", "lower bound", "upper bound")
    rule = "A run that did not finish or whose measure is no number counts as a failure."
    return _table(head, rows) + f"<p>{escape(f'{rule} {note}')}</p>"


def _unfinished(outcome: Outcome) -> str:
    runs = outcome.runs[outcome.unfinished]
    if not len(runs):
        return "<p>All runs finished.</p>"
    shown = runs[:_ROWS]
    names = ["status", "reason", *(["fault"] if _faults(outcome) else [])]
    frame = outcome.read(names, runs=shown.tolist())
    rows = []
    for run, entry in zip(shown.tolist(), frame.itertuples(index=False)):
        command = (
            f'<td><code>{escape(outcome.command(run))}</code> <button class="copy">Copy</button></td></tr>'
        )
        rows.append(_row([str(run), *entry]).removesuffix("</tr>") + command)
    more = f"<p>And {len(runs) - _ROWS:,} more runs.</p>" if len(runs) > _ROWS else ""
    table = _table(("run", *names, "command that repeats it"), rows)
    return f'<div class="runs">{table}</div>{more}'


def _influence(outcome: Outcome, measure: str) -> str:
    influence = outcome.influence(measure)
    limited = measure in outcome.limits
    numeric = influence[influence["value"].isna()]
    others = influence[influence["value"].notna()]
    text = ""
    if len(numeric):
        head = ["parameter", "rank correlation", "", "p-value"]
        head += ["fail: lowest tenth", "all runs", "highest tenth"] if limited else []
        rows = []
        for name, row in zip(numeric.index, numeric.to_dict("records")):
            rho = 0.0 if math.isnan(row["correlation"]) else row["correlation"]
            bar = (
                f'<td><span class="bar"><i class="{"up" if rho > 0 else "down"}" '
                f'style="width:{50 * abs(rho):.1f}%"></i></span></td>'
            )
            cells: list[object] = ["< 1e-300" if row["p_value"] == 0 else row["p_value"]]
            cells += [row["lowest_tenth"], row["failed"], row["highest_tenth"]] if limited else []
            start = _row([name, row["correlation"]]).removesuffix("</tr>")
            rows.append(start + bar + _row(cells).removeprefix("<tr>"))
        text += _table(head, rows) + (
            "<p>Spearman's rank correlation over the finished runs; 1 or -1 is a monotone relation, a parameter whose "
            "middle is best or worst can have 0. "
            + ("The last columns are fractions of failed runs.</p>" if limited else "</p>")
        )
    if len(others):
        head = ["parameter", "value", "runs", "median", *(["fraction of failures"] if limited else [])]
        rows = [
            _row(
                [
                    name,
                    row["value"] if row["value"] != "" else "(none)",
                    int(row["runs"]),
                    row["median"],
                    *([row["failed"]] if limited else []),
                ]
            )
            for name, row in zip(others.index[:_ROWS], others[:_ROWS].to_dict("records"))
        ]
        more = f"<p>And {len(others) - _ROWS:,} more values.</p>" if len(others) > _ROWS else ""
        text += _table(head, rows) + more
    return text


# Data of the pictures.


def _measure(outcome: Outcome, name: str) -> dict[str, Any]:
    entry = outcome.manifest["measures"][name]
    values = np.asarray(outcome.read([name])[name].to_numpy(), dtype=np.float64)
    limit = outcome.limits.get(name, {})
    data: dict[str, Any] = {
        "name": name,
        "unit": entry.get("unit"),
        "expression": str(entry.get("expression") or entry.get("python") or ""),
        "limit": {word: float(value) for word, value in limit.items()},
        "logarithmic": _is_wide(values),
        "histogram": _histogram(values),
    }
    method = outcome.manifest["design"]["method"]
    if method in _INDICES:
        try:
            frame = getattr(outcome, _INDICES[method][0])(name)
            bars = {column: column + "_conf" for column in frame.columns if column + "_conf" in frame.columns}
            bars |= {"sigma": ""} if method == "morris" else {}
            data["indices"] = {
                "names": list(frame.index),
                "bars": [
                    {
                        "name": column,
                        "values": _numbers(frame[column]),
                        "confidence": _numbers(frame[to]) if to else None,
                    }
                    for column, to in bars.items()
                ],
                "unit": entry.get("unit") if method == "morris" else None,
            }
        except ConfigurationError as error:
            data["no-indices"] = str(error)
    if _faults(outcome):
        data["heat"] = _heat(outcome, name)
    return data


def _indices_note(outcome: Outcome, measure: Mapping[str, Any]) -> str:
    if "no-indices" in measure:
        return f"<p>{escape(measure['no-indices'])}</p>"
    text = {
        "saltelli": "S1 is the part of the variance that the parameter explains alone, ST with all its interactions. "
        "Error bars: 95 %, bootstrap.",
        "morris": "mu_star is the mean absolute effect of the whole range of the parameter, with 95 % bars; sigma shows "
        "nonlinearity and interactions.",
        "fast": "S1 is the part of the variance that the parameter explains alone, ST with all its interactions. The "
        "error bars of FAST are an indication only.",
    }
    return f"<p>{text.get(outcome.manifest['design']['method'], '')}</p>"


def _is_wide(values: NDArray[np.float64]) -> bool:
    """Whether positive values need a logarithmic axis: some are far above the median, or many far below."""
    finite = values[np.isfinite(values)]
    if not len(finite) or finite.min() <= 0:
        return False
    low, middle = np.quantile(finite, [0.01, 0.5])
    return bool(finite.max() > _WIDE * middle or middle > 2 * _WIDE * low)


def _histogram(values: NDArray[np.float64]) -> dict[str, Any]:
    """Counts of all runs; one or two values far from the others do not squeeze them into one bin."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return {"edges": [], "counts": [], "outside": 0, "others": len(values)}
    low, high = finite.min(), finite.max()
    bins = max(5, min(_BINS, round(2 * math.sqrt(len(finite)))))
    if _is_wide(values):
        edges = np.geomspace(low, high, bins + 1)
    else:
        inner = np.quantile(finite, [0.001, 0.999])
        if high - low > 10 * (inner[1] - inner[0]) > 0:
            low, high = inner
        edges = np.histogram_bin_edges(finite, bins, (low, high))
    edges[0], edges[-1] = min(edges[0], low), max(edges[-1], high)
    counts, _ = np.histogram(finite, edges)
    beyond = len(finite) - int(counts.sum())
    return {
        "edges": [float(edge) for edge in edges],
        "counts": counts.tolist(),
        "outside": beyond,
        "others": len(values) - len(finite),
    }


def _histograms(measures: Iterable[Mapping[str, Any]]) -> str:
    text = ""
    for at, measure in enumerate(measures):
        notes = [f"{escape(measure['expression'])}"]
        if measure["histogram"]["others"]:
            notes.append(f"{measure['histogram']['others']:,} runs without a finite value")
        if measure["histogram"]["outside"]:
            notes.append(f"{measure['histogram']['outside']:,} runs outside the picture")
        text += (
            f'<figure><div id="histogram-{at}" class="histogram"></div>'
            f"<figcaption>{'; '.join(note for note in notes if note)}</figcaption></figure>"
        )
    return f'<p>All runs; the dashed line is the limit.</p><div class="grid">{text}</div>'


def _heat(outcome: Outcome, measure: str) -> dict[str, Any]:
    frame = outcome.heat_map(measure)

    def label(size: float, start: float) -> str:
        words = [] if math.isnan(size) else [f"size {size:g}"]
        words += [] if math.isnan(start) else [f"from {start:g} s"]
        return ", ".join(words) or "no size"

    cells = frame.to_numpy(dtype=np.float64)
    return {
        "rows": [f"{kind}: {connection}" for kind, connection in frame.index],
        "columns": [label(float(size), float(start)) for size, start in frame.columns],
        "values": [_numbers(row) for row in cells],
        "lost": np.isinf(cells).astype(int).tolist(),
    }


def _even(rows: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Choose ``count`` of these rows, evenly spaced."""
    if count >= len(rows):
        return rows
    chosen = np.linspace(0, len(rows) - 1, max(count, 0)).round().astype(np.int64)
    return np.asarray(rows[chosen], dtype=np.int64)


def _choose(outcome: Outcome) -> tuple[NDArray[np.int64], str]:
    """Choose the runs that are drawn, and say which ones."""
    total = len(outcome)
    if total <= _POINTS:
        return np.arange(total), "All runs are drawn."
    lost = outcome.unfinished
    failed = outcome.failed() & ~lost if outcome.limits else np.zeros(total, dtype=bool)
    first = _even(np.flatnonzero(lost), _POINTS)
    rest = _POINTS - len(first)
    # Rare failures are all drawn; frequent ones leave half of the points to the other runs.
    second = _even(np.flatnonzero(failed), max(rest // 2, rest - int((~lost & ~failed).sum())))
    third = _even(np.flatnonzero(~lost & ~failed), rest - len(second))
    parts = [
        f"{len(subset):,} of the {int(all_.sum()):,} {text}"
        for subset, all_, text in (
            (first, lost, "runs that did not finish"),
            (second, failed, "runs outside a limit"),
            (third, ~lost & ~failed, "other runs"),
        )
        if all_.any()
    ]
    rows = np.sort(np.concatenate([first, second, third]))
    return rows, f"Drawn: {', '.join(parts)}, chosen evenly by run number."


def _columns(outcome: Outcome, measures: list[str], rows: NDArray[np.int64]) -> list[dict[str, Any]]:
    """The columns of the chosen runs: numbers, or codes with labels."""
    units = {entry["name"]: entry.get("unit") for entry in outcome.manifest["parameters"]}
    units |= {name: outcome.manifest["measures"][name].get("unit") for name in measures} | {"fault.from": "s"}
    inputs = list(outcome.inputs)
    numeric = {**outcome.inputs, **dict.fromkeys(measures, True)}
    kinds = {"status": "status"} | dict.fromkeys(inputs, "input") | dict.fromkeys(measures, "measure")
    if _faults(outcome):
        kinds["fault"] = "fault"
    columns = []
    for names in batches(kinds):
        frame = outcome.read(names).iloc[rows]
        for name in names:
            entry: dict[str, Any] = {"name": name, "kind": kinds[name], "unit": units.get(name)}
            if numeric.get(name):
                entry["values"] = _numbers(frame[name])
            else:
                texts = frame[name].astype(str)
                texts = texts.replace("", "(none)") if kinds[name] == "input" else texts
                labels = sorted(set(texts))
                codes = {text: code for code, text in enumerate(labels)}
                entry |= {"labels": labels, "values": [codes[text] for text in texts]}
            columns.append(entry)
    return columns


_NOSCRIPT = (
    "<noscript><p>The pictures need JavaScript. Without it, the tables of all measures follow each other, in the order "
    "of the list.</p></noscript>"
)
# No source is allowed: the browser itself refuses any request. plotly.js compiles its WebGL code (eval).
_POLICY = (
    '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
    "script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'\">"
)
