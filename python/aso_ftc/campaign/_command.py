"""The command ``aso-ftc campaign``."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
import textwrap
import warnings
from pathlib import Path

from .._errors import ConfigurationError, Error
from ._analysis import Outcome, describe, load
from ._campaign import Campaign
from ._folder import MANIFEST, system_of

__all__ = ["main"]

_REPORT = "report.html"
# Characters of a reason in the summary.
_LONGEST = 100
# Faults or parameters that the summary names.
_SHOWN = 3
# Colours of words at the start of a message, as in the command.
_COLOURS = {"error": 31, "warning": 33}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="aso-ftc campaign",
        description="Do many runs of a system: sweeps, Monte Carlo, fault campaigns, sensitivity",
    )
    parser.add_argument(
        "campaign", type=Path, help="a campaign.toml; with --report or --show, the folder of its results"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="folder of the results [default: results/NAME]; a folder where this campaign was interrupted goes on",
    )
    parser.add_argument(
        "--workers", type=int, metavar="N", help="number of local processes [default: number of processors]"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="address of a Dask scheduler, such as tcp://host:8786"
    )
    parser.add_argument(
        "--live", action="store_true", help="show the runs on a page on this machine while they are done"
    )
    parser.add_argument(
        "--check", action="store_true", help="find what is wrong before the first run, and do not run"
    )
    parser.add_argument(
        "--show", type=int, metavar="RUN", help="print the system.toml of a run, for aso-ftc run"
    )
    parser.add_argument(
        "--report", type=Path, metavar="FILE", help="only write the page of the results in this folder"
    )
    return parser


def main(words: list[str]) -> int:
    """Run the command; return its exit status."""
    chosen = _parser().parse_args(words)
    warnings.showwarning = lambda message, *_, **__: _say("warning", message)
    try:
        return _perform(chosen)
    except Error as error:
        _say("error", error)
        return 2 if isinstance(error, (ConfigurationError, ImportError)) else 1
    except KeyboardInterrupt:
        _say("error", "interrupted; the same command goes on where it stopped")
        return 130


def _say(word: str, text: object) -> None:
    """Print an error or a warning; the word has a colour on a terminal."""
    forced = os.environ.get("CLICOLOR_FORCE", "0") != "0"
    if (forced or sys.stderr.isatty()) and not os.environ.get("NO_COLOR"):
        print(f"\x1b[1m\x1b[{_COLOURS[word]}m{word}:\x1b[0m {text}", file=sys.stderr)
    else:
        print(f"{word}: {text}", file=sys.stderr)


def _perform(chosen: argparse.Namespace) -> int:
    path: Path = chosen.campaign
    if chosen.show is not None:
        sys.stdout.write(system_of(path, chosen.show).to_toml())
        return 0
    if chosen.report is not None:
        load(path).page(chosen.report)
        return 0
    if (path / MANIFEST).is_file():
        raise ConfigurationError(f"{path} has results: name the campaign.toml, or use --report or --show")
    campaign = Campaign.from_toml(path)
    folder = chosen.out if chosen.out is not None else Path("results") / campaign.name
    if chosen.check:
        campaign.check()
        print(f"{campaign.name}: {len(campaign)} runs")
        return 0
    outcome = campaign.run(
        folder, workers=chosen.workers, scheduler=chosen.scheduler, live=_announce if chosen.live else None
    )
    page = folder / _REPORT
    outcome.page(page, force=True)
    print(_summary(outcome))
    print(f"report: {shlex.quote(str(page))}")
    return 0 if "ok" in outcome.statuses else 1


def _announce(address: str) -> None:
    print(f"live view: {address}", flush=True)


def _summary(outcome: Outcome) -> str:
    """What the user must know: unfinished runs, limits, and which parameter matters for each limit."""
    runs = len(outcome)
    lines = [f"{outcome.manifest['name']}: {runs} runs"]
    statuses = {name: count for name, count in outcome.statuses.items() if name != "ok"}
    if statuses:
        shown = ", ".join(f"{count} {name}" for name, count in statuses.items())
        first = int(outcome.runs[outcome.unfinished][0])
        reason = textwrap.shorten(outcome.read(["reason"], runs=[first])["reason"].iloc[0], _LONGEST)
        lines.append(
            f"{sum(statuses.values())} of {runs} runs did not finish ({shown}); run {first}: {reason}"
        )
    for name, limit in outcome.limits.items():
        failures = int(outcome.failed(name).sum())
        line = f"{name} {describe(limit)}: {runs - failures} of {runs} runs"
        try:
            chance = outcome.failure_probability(name)
            notes = [f"{100 * chance.confidence:g} %", *([chance.note] if chance.note else [])]
            line += f", failure probability {chance.lower:.3g} to {chance.upper:.3g} ({'; '.join(notes)})"
        except ConfigurationError:
            # The design has no random samples: a fraction, but no probability.
            pass
        lines.append(line)
        lines += _reasons(outcome, name)
    return "\n".join(lines)


def _reasons(outcome: Outcome, name: str) -> list[str]:
    """Which faults, or which parameters, bring runs outside of a limit."""
    if outcome.manifest["faults"]:
        labels = list(dict.fromkeys(outcome.read(["fault"])["fault"][outcome.failed(name)]))
        shown = "; ".join(label or "no fault" for label in labels[:_SHOWN])
        more = f"; and {len(labels) - _SHOWN} more" if len(labels) > _SHOWN else ""
        return [f"  outside: {shown}{more}"] if labels else []
    influence = outcome.influence(name).dropna(subset=["lowest_tenth", "highest_tenth"])
    order = (influence["highest_tenth"] - influence["lowest_tenth"]).abs().sort_values(ascending=False)
    parts = [
        f"{parameter} {100 * influence['lowest_tenth'][parameter]:.0f} % to {100 * influence['highest_tenth'][parameter]:.0f} %"
        for parameter in order.index[:_SHOWN]
        if order[parameter] > 0
    ]
    return [f"  runs outside, from the lowest to the highest tenth: {', '.join(parts)}"] if parts else []
