"""Reports of runs: one HTML file with interactive plots."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import cast

from ._command import command
from ._errors import ResultsError
from ._results import Results
from ._system import PathLike

__all__ = ["report"]


def report(
    results: PathLike | Results,
    *,
    against: PathLike | Results | None = None,
    variables: Sequence[str] = (),
    start_time: float | None = None,
    stop_time: float | None = None,
    out: PathLike | None = None,
    force: bool = False,
) -> Path:
    """Write the report of results, and return its path; see "Look at a run" in the documentation.

    Args:
        results: results, or the file of any run, also of other programs: ``.csv``, ``.parquet``, or ``.mat`` of
            Dymola or OpenModelica.
        against: results or a second file, which are subtracted from the first one.
        variables: names or patterns of the variables that are shown; all if empty.
        start_time, stop_time: the first and the last time in s of the rows that are read.
        out: the page; by default beside the file, with the ending ``.html``.
        force: overwrite a page of other results, or a file of another program.

    Raises:
        ResultsError: a file cannot be read, or the page cannot be written.
    """
    if isinstance(variables, str):
        raise TypeError(f"variables: expected a sequence of names, found the name {variables!r}")
    if out is None and isinstance(results, Results):
        raise TypeError('out: expected the path of the page, such as "run.html"; results in memory have no file')
    page = Path(out) if out is not None else Path(cast("PathLike", results)).with_suffix(".html")
    in_memory = isinstance(results, Results) or isinstance(against, Results)
    with tempfile.TemporaryDirectory() as folder:

        def file(source: PathLike | Results, name: str) -> str:
            # The page shows the paths, so those of the temporary folder are relative to it.
            if isinstance(source, Results):
                source.to_parquet(os.path.join(folder, name))
                return name
            return os.path.abspath(source) if in_memory else os.fspath(source)

        words = [str(command()), "report", file(results, "results.parquet")]
        words += ["--out", os.path.abspath(page) if in_memory else os.fspath(page)]
        words += ["--against", file(against, "against.parquet")] if against is not None else []
        words += [word for name in variables for word in ("--variables", name)]
        # A number of NumPy has its type in its representation.
        words += [f"--from={float(start_time)!r}"] if start_time is not None else []
        words += [f"--to={float(stop_time)!r}"] if stop_time is not None else []
        words += ["--force"] if force else []
        place = folder if in_memory else None
        done = subprocess.run(words, capture_output=True, encoding="utf-8", check=False, cwd=place)
    if done.returncode != 0:
        raise ResultsError(done.stderr.strip().removeprefix("error: ") or "no report was written", "Report")
    return page
