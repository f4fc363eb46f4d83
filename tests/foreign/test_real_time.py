"""`run --real-time`: runs paced by the clock. Bounds on wall-clock time are lower bounds, so that a busy machine passes."""

import re
import signal
import subprocess
import time

import pytest

from conftest import ROOT

FMUS = [ROOT / "dist" / f"{name}.fmu" for name in ("FrictionPendulum", "AsoController")]
SYSTEMS: dict[str, list] = {
    "FMUs": FMUS,
    "--fmu": ["--fmu", f"plant={FMUS[0]}", "--fmu", f"controller={FMUS[1]}"],
    "SSP": [ROOT / "dist" / "InvertedPendulum.ssp"],
    "system.toml": ["system.toml"],
}


def overruns(text):
    """Late steps, steps, largest lateness in s (0 without one)."""
    match = re.search(r"(\d+) of (\d+) steps ended late(?:, at most by (\S+) s, at t = \S+ s)?", text)
    assert match, text
    return int(match[1]), int(match[2]), float(match[3] or 0)


@pytest.mark.parametrize("system", SYSTEMS)
def test_a_paced_run_takes_its_time_and_keeps_its_bits(aso_ftc, tmp_path, system):
    paced, free = tmp_path / "paced", tmp_path / "free"
    files = "".join(f"{name} = '{fmu}'\n" for name, fmu in zip(["plant", "controller"], FMUS))
    (tmp_path / "system.toml").write_text(f"[fmus]\n{files}", encoding="utf-8")
    named = [tmp_path / one if one == "system.toml" else one for one in SYSTEMS[system]]
    options = [*named, "--stop-time", 0.4, "--out"]
    begin = time.monotonic()
    done = aso_ftc("run", *options, paced, "--real-time", 2)
    assert done.returncode == 0, done.stderr
    assert time.monotonic() - begin >= 0.2
    assert "paced at 2 times real time" in done.stdout
    done = aso_ftc("run", *options, free)
    assert done.returncode == 0 and "paced at" not in done.stdout
    assert (paced / "results.csv").read_bytes() == (free / "results.csv").read_bytes()


def test_steps_that_cannot_keep_up_are_counted_also_in_the_report(aso_ftc, tmp_path):
    options = ["--stop-time", 0.1, "--step", 1e-5, "--out", tmp_path, "--real-time", 1e6, "--report"]
    done = aso_ftc("run", *FMUS, *options)
    assert done.returncode == 0, done.stderr
    late, steps, largest = overruns(done.stdout)
    assert late == steps == 10_000 and largest > 0
    assert overruns((tmp_path / "results.html").read_text(encoding="utf-8")) == (late, steps, largest)


def test_the_default_factor_is_one(aso_ftc, tmp_path):
    done = aso_ftc("run", *FMUS, "--stop-time", 0.05, "--out", tmp_path, "--real-time")
    assert done.returncode == 0 and "paced at 1 times real time" in done.stdout


def test_a_wait_ends_with_ctrl_c(tmp_path):
    command = [ROOT / "target" / "release" / "aso-ftc", "run", *FMUS, "--out", tmp_path, "--real-time", "1e-6"]
    process = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert "->" in process.stdout.readline()
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130 and "the run was interrupted" in said
    assert len((tmp_path / "results.csv").read_text(encoding="utf-8").splitlines()) > 1


@pytest.mark.parametrize("factor", ["0", "-1", "nan", "inf", "1e999", "system.toml"])
def test_a_factor_that_is_none_is_one_error(aso_ftc, tmp_path, factor):
    done = aso_ftc("run", *FMUS, "--out", tmp_path / "none", "--real-time", factor)
    assert done.returncode == 2 and done.stderr.count("error:") == 1
    assert "expected a finite number above 0" in done.stderr and not (tmp_path / "none").exists()
