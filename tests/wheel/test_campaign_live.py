"""`campaign --live`: the runs on a page, and what it may do; the results are those without the page."""

import json
import re
import subprocess
import sys
import time
import urllib.error
import urllib.request
from contextlib import contextmanager

import aso_ftc as af
import numpy as np
import pyarrow.parquet as parquet
import pytest

CAMPAIGN = """
system = "paper"
runs-per-task = 2

[experiment]
stop-time = {stop}

[design]
method = "latin-hypercube"
runs = {runs}

[parameters]
"plant.F_c" = {{ relative = 0.2 }}

[measures]
friction = "rms(plant.f_fric)"
gate = {{ python = "gate.py:measure" }}
"""
# Only the first runs end before there is a file `go`, so that the campaign is not done before it is paused.
GATE = """
import pathlib, time

def measure(results, values):
    folder = pathlib.Path({folder!r})
    with open(folder / "calls", "a") as calls:
        calls.write(".")
    while (folder / "calls").stat().st_size > 4 and not (folder / "go").exists():
        time.sleep(0.01)
    return 0.0
"""
LIMIT = 60  # s


class Page:
    """What a browser sees of a campaign."""

    def __init__(self, process):
        self.process = process
        self.url = re.match(r"live view: (\S+)", process.stdout.readline())[1]

    def ask(self, path, post=False):
        request = urllib.request.Request(
            self.url + path, b"" if post else None, {"Content-Type": "application/toml"} if post else {}
        )
        with urllib.request.urlopen(request, timeout=LIMIT) as answer:
            return json.load(answer)

    def until(self, holds):
        end = time.monotonic() + LIMIT
        while not holds(state := self.ask("state?show=0")):
            assert time.monotonic() < end, state
            time.sleep(0.02)
        return state

    def rest(self):
        """The state when no run ends any more."""
        before, state = None, self.ask("state?show=0")
        while state["time"] != before:
            time.sleep(1)
            before, state = state["time"], self.ask("state?show=0")
        return state

    def end(self):
        out, errors = self.process.communicate(timeout=LIMIT)
        return self.process.returncode, out, errors


@contextmanager
def watched(file, folder):
    line = [sys.executable, "-I", "-m", "aso_ftc", "campaign", str(file), "--out", str(folder), "--workers", "1", "--live"]
    process = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield Page(process)
    finally:
        process.kill()
        process.wait()


def measures(folder):
    """The measure of each run."""
    return parquet.read_table(folder / "runs").sort_by("run")["friction"].to_pylist()


def expected(file):
    """The same by runs in this process."""
    plan, friction = af.campaign.Campaign.from_toml(file), []
    for run in range(len(plan)):
        values = plan.changes(run)["start_values"]
        results = af.paper().run(start_values=values, stop_time=3.0, record_every="step")
        friction.append(float(np.sqrt(np.mean(np.square(results["plant.f_fric"])))))
    return friction


@pytest.fixture
def campaign(tmp_path):
    """Writes a campaign file; returns its path."""

    def write(runs, stop):
        path = tmp_path / "small.toml"
        path.write_text(CAMPAIGN.format(runs=runs, stop=stop), encoding="utf-8")
        (tmp_path / "gate.py").write_text(GATE.format(folder=str(tmp_path)), encoding="utf-8")
        return path

    return write


def test_a_campaign_that_is_watched_paused_and_stopped_goes_on_to_the_same_rows(campaign, tmp_path):
    file, folder = campaign(24, 3.0), tmp_path / "seen"
    with watched(file, folder) as page:
        facts = page.ask("facts")
        assert (facts["subject"], facts["stop"], facts["signals"][0]["name"]) == ("campaign", 24, "friction")
        wrong = page.url[:-2] + ("1/" if page.url.endswith("0/") else "0/")
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(wrong, timeout=LIMIT)
        page.until(lambda state: state["time"] >= 1)
        assert page.ask("pause", post=True)["answer"] == "No further run starts."
        with pytest.raises(urllib.error.HTTPError, match="422"):
            page.ask("step", post=True)
        (tmp_path / "go").touch()
        held = page.rest()
        assert held["phase"] == "paused" and 0 < held["time"] < 24
        assert held["counts"] == {"ok": held["time"]} and held["messages"][0]["text"].startswith("run 0: ok, friction = ")
        assert len(held["values"][0]) == held["time"]
        assert page.ask("stop", post=True)["answer"].startswith("The campaign is stopped")
        status, _, errors = page.end()
        assert status == 130 and "the same command goes on" in errors
    with watched(file, folder) as page:
        assert page.ask("facts")["start"] > 0
        state = page.until(lambda state: state["outcome"])
        assert state["outcome"] == "All 24 runs are done." and state["time"] == 24
        assert page.end()[0] == 0
    values = measures(folder)
    assert values == expected(file) and len(set(values)) > 20
