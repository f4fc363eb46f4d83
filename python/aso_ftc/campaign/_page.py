"""The HTML page of a campaign: one file with its data and plotly.js, without any request."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .._errors import ConfigurationError, ResultsError
from ._analysis import batches, describe
from ._packages import package

if TYPE_CHECKING:
    from ._analysis import Outcome

__all__ = ["write"]

_MARK = '<meta name="generator" content="aso-ftc campaign">'
_POINTS = 10_000
_ROWS = 50
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
    rows, drawn = _choose(outcome)
    data = {
        "command": outcome.command_parts,
        "measures": [_measure(outcome, name) for name in measures],
        "columns": _columns(outcome, measures, rows),
        "runs": outcome.runs[rows].tolist(),
    }
    indices = "".join(
        f'<div class="of-measure">{_indices_note(outcome, own)}</div>' for own in data["measures"]
    )
    influence = "".join(f'<div class="of-measure">{_influence(outcome, name)}</div>' for name in measures)
    options = "".join(f'<option value="{at}">{escape(name)}</option>' for at, name in enumerate(measures))
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
        ("What was run", _summary(outcome) + _parameters(outcome)),
        ("Limits", _limits(outcome)),
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
        sections = [sections[0], sections[-1]]
    body = "".join(
        (f"<section><h2>{escape(title)}</h2>{text}</section>" if title else text)
        for title, text in sections
        if text
    )
    # "<" cannot occur in the data of a script element; the texts come from files of the user.
    embedded = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    name = escape(str(outcome.manifest["name"]))
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">{_MARK}{_POLICY}'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Campaign {name}</title><style>{_STYLE}</style></head>\n<body><h1>Campaign {name}</h1>{body}\n"
        f"<script>{script}</script>\n"
        f'<script type="application/json" id="data">{embedded}</script>\n<script>{_SCRIPT}</script></body></html>\n'
    )


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
    """A number of JSON with seven digits, ``None`` if it is not finite."""
    return float(f"{value:.7g}") if math.isfinite(value) else None


def _numbers(values: Iterable[float]) -> list[float | None]:
    return [_number(float(value)) for value in values]


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
                found = sorted(str(value) for value in frame[name].unique())
                more = f" and {len(found) - 5:,} more" if len(found) > 5 else ""
                rows.append(_row([name, units[name] or "", ", ".join(found[:5]) + more, ""]))
    return _table(("parameter", "unit", "lowest", "highest"), rows)


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
            found = outcome.failure_probability(name)
            cells += [found.probability, found.lower, found.upper]
            if found.note:
                note = f"Bounds: Clopper and Pearson, 95 %; {found.note}."
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
    found = outcome.influence(measure)
    limited = measure in outcome.limits
    numeric = found[found["value"].isna()]
    others = found[found["value"].notna()]
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
    found: dict[str, Any] = {
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
            bars = {own: own + "_conf" for own in frame.columns if own + "_conf" in frame.columns}
            bars |= {"sigma": ""} if method == "morris" else {}
            found["indices"] = {
                "names": list(frame.index),
                "bars": [
                    {
                        "name": own,
                        "values": _numbers(frame[own]),
                        "confidence": _numbers(frame[to]) if to else None,
                    }
                    for own, to in bars.items()
                ],
                "unit": entry.get("unit") if method == "morris" else None,
            }
        except ConfigurationError as error:
            found["no-indices"] = str(error)
    if _faults(outcome):
        found["heat"] = _heat(outcome, name)
    return found


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
    for at, own in enumerate(measures):
        notes = [f"{escape(own['expression'])}"]
        if own["histogram"]["others"]:
            notes.append(f"{own['histogram']['others']:,} runs without a finite value")
        if own["histogram"]["outside"]:
            notes.append(f"{own['histogram']['outside']:,} runs outside the picture")
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
        f"{len(own):,} of the {int(all_.sum()):,} {text}"
        for own, all_, text in (
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


# No source is allowed: the browser itself refuses any request. plotly.js compiles its WebGL code (eval).
_POLICY = (
    '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
    "script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'\">"
)

_STYLE = """
:root{color-scheme:light dark;--page:#fff;--text:#1d2733;--soft:#5b6875;--line:#d5dbe1;--panel:#f3f5f7;
--good:#2f6fb3;--bad:#c0392b;--low:#c3d6ea}
@media(prefers-color-scheme:dark){:root{--page:#14181d;--text:#e4e8ec;--soft:#9aa6b2;--line:#333c46;
--panel:#1e242b;--good:#6fa8e0;--bad:#ff7565;--low:#2b4560}}
*{box-sizing:border-box}
body{margin:0 auto;padding:1rem;max-width:72rem;background:var(--page);color:var(--text);
font:16px/1.5 system-ui,sans-serif}
h1{font-size:1.6rem;line-height:1.2;overflow-wrap:anywhere}
h2{font-size:1.2rem;margin:2rem 0 .5rem}
dl{display:grid;grid-template-columns:max-content 1fr;gap:.2rem 1rem}
dt{color:var(--soft)}
dd{margin:0;overflow-wrap:anywhere}
.wide{overflow-x:auto;max-width:100%}
table{border-collapse:collapse;font-size:.9rem;margin:.5rem 0;white-space:nowrap}
.runs td{white-space:normal;min-width:5rem}
.runs td:last-child{min-width:20rem}
th,td{text-align:left;padding:.25rem .75rem .25rem 0;border-bottom:1px solid var(--line);vertical-align:top;
font-variant-numeric:tabular-nums}
th{color:var(--soft);font-weight:600}
p{color:var(--soft);font-size:.9rem;max-width:48rem;overflow-wrap:anywhere}
code{font-size:.85rem;overflow-wrap:anywhere}
select,button{font:inherit;color:inherit;background:var(--panel);border:1px solid var(--line);
border-radius:4px;padding:.15rem .5rem;max-width:100%}
.choice{position:sticky;top:0;z-index:5;background:var(--page);padding:.5rem 0;margin:1rem 0 0;
border-bottom:1px solid var(--line);max-width:none;color:var(--text);font-size:1rem}
.bar{display:block;position:relative;width:8rem;height:1rem;background:linear-gradient(var(--line),var(--line))
center/1px 100% no-repeat}
.bar i{position:absolute;top:.15rem;bottom:.15rem;background:var(--good)}
.bar .up{left:50%}.bar .down{right:50%}
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,21rem),1fr));gap:1rem}
figure{margin:0;min-width:0}
figcaption{color:var(--soft);font-size:.85rem;overflow-wrap:anywhere}
#point{background:var(--panel);border-radius:6px;padding:0 1rem}
#point:not(:empty){padding:.5rem 1rem}
[hidden]{display:none}
"""

_SCRIPT = r"""
'use strict';
const data = JSON.parse(document.getElementById('data').textContent);
const byId = id => document.getElementById(id);
const color = name => getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim();
// plotly reads a small HTML in its texts.
const plain = text => String(text).replace(/&/g, '&amp;').replace(/</g, '&lt;').replace(/>/g, '&gt;');
const short = (text, length) => text.length > length ? text.slice(0, length - 1) + '…' : text;
const titled = own => plain(short(own.name + (own.unit ? ' in ' + own.unit : ''), 50));
// More lines than these hide each other.
const LINES = 1500;
const inputs = data.columns.filter(own => own.kind === 'input');
const across = [...inputs, {name: 'run', unit: null, values: data.runs}];
const column = (name, kind) => data.columns.find(own => own.kind === kind && own.name === name);
const status = column('status', 'status'), fault = column('fault', 'fault');
const shown = (own, at) => own.labels ? own.labels[own.values[at]] : own.values[at];
const measure = () => data.measures[byId('measure').value];
const values = () => column(measure().name, 'measure').values;
const inside = value => {
  const {below, above} = measure().limit;
  return (below === undefined || value < below) && (above === undefined || value > above);
};
// By default plotly.js has a button that uploads the data of a picture.
const options = {displaylogo: false, responsive: true, showSendToCloud: false, plotlyServerURL: '',
  modeBarButtons: [['toImage', 'zoom2d', 'pan2d', 'resetScale2d']]};
function axis(title, more) {
  return {title: {text: title}, gridcolor: color('line'), zerolinecolor: color('line'), linecolor: color('line'),
    automargin: true, ...more};
}
function layout(more) {
  return {paper_bgcolor: 'rgba(0,0,0,0)', plot_bgcolor: 'rgba(0,0,0,0)', height: 420,
    font: {color: color('text'), family: 'system-ui, sans-serif', size: 12},
    hoverlabel: {align: 'left'}, margin: {l: 10, r: 10, t: 30, b: 10}, legend: {orientation: 'h', y: 1.02, yanchor: 'bottom'},
    ...more};
}

function drawIndices() {
  const place = byId('indices'), found = measure().indices;
  if (!place) return;
  place.hidden = !found;
  if (!found) return;
  const traces = found.bars.map((bar, at) => ({type: 'bar', orientation: 'h', name: bar.name,
    y: found.names.map(plain), x: bar.values, marker: {color: color(at ? 'good' : 'low')},
    error_x: bar.confidence ? {array: bar.confidence, color: color('text'), thickness: 1.2} : undefined}));
  Plotly.react(place, traces, layout({height: 110 + 44 * found.names.length,
    xaxis: axis(found.unit ? 'in ' + plain(found.unit) : '', {rangemode: 'tozero'}),
    yaxis: axis('', {autorange: 'reversed', type: 'category'})}), options);
}

function drawParallel() {
  const own = measure(), all = values(), place = byId('parallel');
  if (!place) return;
  if (!document.createElement('canvas').getContext('webgl')) {
    place.textContent = 'This browser has no WebGL, which parallel coordinates need.';
    return;
  }
  const known = data.runs.map((_, at) => at).filter(at => all[at] !== null);
  const count = Math.min(known.length, LINES);
  const rows = Array.from({length: count}, (_, at) => known[Math.floor((at * known.length) / count)]);
  byId('parallel-note').textContent = count < known.length ? 'Of the runs that are drawn below, ' + count
    + ' have a line here.' : '';
  const scaled = value => own.logarithmic ? Math.log10(value) : value;
  const dimension = (from, pick) => {
    const picked = rows.map(pick), finite = picked.filter(value => value !== null);
    let low = finite.reduce((a, b) => Math.min(a, b), Infinity), high = finite.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!(low < high)) { const half = Math.abs(low) / 10 || 1; low -= half; high += half; }
    // A run without a value of this axis, such as the size of a fault that has none, is at its lower end.
    const label = plain(short(from.name + (from.unit ? ' in ' + from.unit : ''), 26));
    return {label, values: picked.map(value => value === null ? low : value), range: [low, high]};
  };
  const dimensions = inputs.filter(from => rows.some(at => from.values[at] !== null)).map(from => {
    const found = dimension(from, at => from.values[at]);
    if (from.labels && from.labels.length <= 40) Object.assign(found, {range: [-0.5, from.labels.length - 0.5],
      tickvals: from.labels.map((_, at) => at), ticktext: from.labels.map(text => short(text, 26))});
    return found;
  });
  const last = dimension(own, at => scaled(all[at]));
  if (own.logarithmic) last.label = 'log10 of ' + last.label;
  const sorted = last.values.slice().sort((a, b) => a - b), part = p => sorted[Math.floor(p * (sorted.length - 1))];
  const worstLow = own.limit.above !== undefined && own.limit.below === undefined;
  // Within the limit from "low" to "good", outside it "bad"; the worst lines are drawn last.
  const from = part(0.02), to = part(0.98) > from ? part(0.98) : from + 1, limited = Object.keys(own.limit).length > 0;
  const shade = (value, at) => {
    const position = Math.min(Math.max((value - from) / (to - from), 0), 1), bad = worstLow ? 1 - position : position;
    return !limited ? bad : inside(all[rows[at]]) ? bad / 2 : 1;
  };
  const shades = last.values.map(shade), order = rows.map((_, at) => at).sort((a, b) => shades[a] - shades[b]);
  const axes = [...dimensions, last].map(one => ({...one, values: order.map(at => one.values[at])}));
  const line = {color: order.map(at => shades[at]), cmin: 0, cmax: 1,
    colorscale: [[0, color('low')], [0.5, color('good')], [1, color('bad')]]};
  if (!rows.length) { Plotly.purge(place); place.textContent = 'No run has a finite value of this measure.'; return; }
  if (!place.data) place.textContent = '';
  place.style.width = Math.max(place.parentElement.clientWidth, 120 * (dimensions.length + 1)) + 'px';
  Plotly.react(place, [{type: 'parcoords', dimensions: axes, line, labelangle: -15, labelside: 'top',
    labelfont: {size: 12}, tickfont: {size: 10}, rangefont: {size: 1, color: 'rgba(0,0,0,0)'}}],
    layout({height: 440, margin: {l: 60, r: 60, t: 90, b: 20}}), {...options, displayModeBar: false});
}

function drawScatter() {
  const own = measure(), all = values(), from = across[byId('input').value], place = byId('scatter');
  const groups = {good: [], bad: [], none: []};
  data.runs.forEach((_, at) => {
    if (from.values[at] === null) return;
    groups[all[at] === null ? 'none' : inside(all[at]) ? 'good' : 'bad'].push(at);
  });
  const finite = all.filter(value => value !== null);
  const top = finite.reduce((a, b) => Math.max(a, b), -Infinity);
  const text = at => 'run ' + data.runs[at] + (fault && shown(fault, at) ? '<br>' + plain(shown(fault, at)) : '')
    + '<br>' + plain(from.name) + ' = ' + plain(shown(from, at))
    + '<br>' + (all[at] === null ? plain(shown(status, at)) + ', no finite value' : plain(own.name) + ' = ' + all[at]);
  const limited = Object.keys(own.limit).length > 0;
  const trace = (rows, name, shade, symbol) => ({type: 'scatter', mode: 'markers', name, customdata: rows,
    x: rows.map(at => from.labels ? plain(shown(from, at)) : from.values[at]),
    y: rows.map(at => all[at] === null ? (finite.length ? top : 1) : all[at]), text: rows.map(text), hoverinfo: 'text',
    marker: {color: color(shade), size: symbol === 'x' ? 8 : 5, symbol, opacity: symbol === 'x' ? 1 : 0.6}});
  const gl = document.createElement('canvas').getContext('webgl') ? 'scattergl' : 'scatter';
  const traces = [[groups.good, limited ? 'within the limit' : 'finished', 'good', 'circle'],
    [groups.bad, 'outside the limit', 'bad', 'circle'],
    [groups.none, 'no finite value (at the top)', 'bad', 'x']].filter(one => one[0].length)
    .map(one => ({...trace(...one), type: gl}));
  const shapes = Object.values(own.limit).map(value => ({type: 'line', xref: 'paper', x0: 0, x1: 1, y0: value, y1: value,
    line: {color: color('text'), width: 1.5, dash: 'dash'}}));
  Plotly.react(place, traces, layout({shapes, showlegend: true, hovermode: 'closest',
    xaxis: axis(titled(from), {type: from.labels ? 'category' : '-'}),
    yaxis: axis(titled(own), {type: own.logarithmic ? 'log' : 'linear', exponentformat: 'power'})}), options);
  place.removeAllListeners('plotly_click');
  place.on('plotly_click', event => showRun(event.points[0].customdata));
}

function element(tag, text, parent) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
}

function showRun(at) {
  const place = byId('point');
  place.textContent = '';
  element('h3', 'Run ' + data.runs[at], place);
  const line = element('div', undefined, place);
  element('code', data.command.join(data.runs[at]), line);
  line.append(' ');
  element('button', 'Copy', line).className = 'copy';
  const list = element('dl', undefined, place);
  for (const own of data.columns) {
    element('dt', own.name + (own.unit ? ' in ' + own.unit : ''), list);
    const value = shown(own, at);
    element('dd', value === null ? 'no finite value' : value, list);
  }
}

function drawHistogram(own, at) {
  const place = byId('histogram-' + at), {edges, counts} = own.histogram;
  const most = counts.reduce((a, b) => Math.max(a, b), 0);
  const text = counts.map((count, bin) => count + ' runs from ' + edges[bin].toPrecision(4) + ' to '
    + edges[bin + 1].toPrecision(4));
  const traces = [{type: 'scatter', mode: 'lines', x: edges, y: [...counts, counts[counts.length - 1]], fill: 'tozeroy',
    line: {shape: 'hv', color: color('good'), width: 1}, text: [...text, ''], hoverinfo: 'text', showlegend: false}];
  for (const [word, value] of Object.entries(own.limit))
    traces.push({type: 'scatter', mode: 'lines', x: [value, value], y: [0, most], hoverinfo: 'text',
      text: word + ' ' + value, line: {color: color('bad'), width: 2, dash: 'dash'}, showlegend: false});
  Plotly.react(place, traces, layout({height: 280, xaxis: axis(titled(own), {type: own.logarithmic ? 'log' : 'linear',
    exponentformat: 'power'}), yaxis: axis('runs', {rangemode: 'tozero'}), margin: {l: 10, r: 10, t: 10, b: 10}}),
    {...options, displayModeBar: false});
}

function drawHeat() {
  const place = byId('heat'), own = measure();
  if (!place) return;
  const {rows, columns, values, lost} = own.heat, names = rows.map(plain), heads = columns.map(plain);
  const lowest = own.limit.above !== undefined && own.limit.below === undefined;
  byId('heat-note').textContent = 'The ' + (lowest ? 'smallest' : 'largest') + ' value of the measure under each fault. '
    + (lost.some(row => row.some(Boolean)) ? 'A cross: a run did not finish or its measure is no number.' : '');
  const label = values.map((row, i) => row.map((value, j) => names[i] + '<br>' + heads[j] + '<br>'
    + (lost[i][j] ? 'a run without value' : value === null ? 'no such run' : plain(own.name) + ' = ' + value)));
  const traces = [{type: 'heatmap', x: heads, y: names, text: label, hoverinfo: 'text', xgap: 1, ygap: 1,
    z: own.logarithmic ? values.map(row => row.map(value => value === null ? null : Math.log10(value))) : values,
    colorscale: [[0, color('low')], [0.5, color('good')], [1, color('bad')]], reversescale: lowest,
    colorbar: {title: {text: (own.logarithmic ? 'log10 of ' : '') + titled(own), side: 'right'}, thickness: 12, exponentformat: 'power'}}];
  const annotations = [];
  lost.forEach((row, i) => row.forEach((flag, j) => flag && annotations.push({x: heads[j], y: names[i], text: '✕',
    showarrow: false, font: {color: color('bad'), size: 16}})));
  place.style.width = Math.max(place.parentElement.clientWidth, 260 + 40 * heads.length) + 'px';
  Plotly.react(place, traces, layout({height: 140 + 26 * rows.length, annotations,
    xaxis: axis('', {type: 'category', showgrid: false}), yaxis: axis('', {type: 'category', autorange: 'reversed',
    showgrid: false})}), {...options, displayModeBar: false});
}

function drawMeasure() {
  const index = Number(byId('measure').value), count = data.measures.length;
  document.querySelectorAll('.of-measure').forEach((block, at) => { block.hidden = at % count !== index; });
  drawIndices(); drawParallel(); drawScatter(); drawHeat();
}
function drawAll() {
  data.measures.forEach(drawHistogram);
  if (data.measures.length) drawMeasure();
}

byId('measure')?.addEventListener('change', drawMeasure);
byId('input')?.addEventListener('change', drawScatter);
document.addEventListener('click', event => {
  if (!event.target.classList.contains('copy')) return;
  const button = event.target, code = button.parentElement.querySelector('code');
  const range = document.createRange(), selection = getSelection();
  range.selectNodeContents(code);
  selection.removeAllRanges();
  selection.addRange(range);
  const done = () => { button.textContent = 'Copied'; };
  if (navigator.clipboard) navigator.clipboard.writeText(code.textContent).then(done, () => document.execCommand('copy') && done());
  else if (document.execCommand('copy')) done();
});
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', drawAll);
let pending;
addEventListener('resize', () => {
  clearTimeout(pending);
  pending = setTimeout(() => { if (data.measures.length) { drawParallel(); drawHeat(); } }, 200);
});
drawAll();
"""
