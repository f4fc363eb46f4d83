"""Reports of runs: one HTML file with interactive plots."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

from ._command import command
from ._errors import ResultsError
from ._system import PathLike

__all__ = ["report"]


def report(
    results: PathLike,
    *,
    against: PathLike | None = None,
    variables: Sequence[str] = (),
    start_time: float | None = None,
    stop_time: float | None = None,
    out: PathLike | None = None,
    force: bool = False,
) -> Path:
    """Write the report of a results file, and return its path; see "Look at a run" in the documentation.

    Args:
        results: the file of any run, also of other programs: ``.csv``, ``.parquet``, or ``.mat`` of Dymola
            or OpenModelica.
        against: a second file, from which the first one is subtracted.
        variables: names or patterns of the variables that are shown; all if empty.
        start_time, stop_time: the first and the last time in s of the rows that are read.
        out: the page; by default beside the results, with the ending ``.html``.
        force: overwrite a page of other results, or a file of another program.

    Raises:
        ResultsError: a file cannot be read, or the page cannot be written.
    """
    if isinstance(variables, str):
        raise TypeError(f"variables: expected a sequence of names, found the name {variables!r}")
    page = Path(out) if out is not None else Path(results).with_suffix(".html")
    words = [str(command()), "report", os.fspath(results), "--out", os.fspath(page)]
    words += ["--against", os.fspath(against)] if against is not None else []
    words += [word for name in variables for word in ("--variables", name)]
    # A number of NumPy has its type in its representation.
    words += [f"--from={float(start_time)!r}"] if start_time is not None else []
    words += [f"--to={float(stop_time)!r}"] if stop_time is not None else []
    words += ["--force"] if force else []
    done = subprocess.run(words, capture_output=True, encoding="utf-8", check=False)
    if done.returncode != 0:
        raise ResultsError(done.stderr.strip().removeprefix("error: ") or "no report was written", "Report")
    return page
