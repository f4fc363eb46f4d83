"""Each phase of `aso-ftc design` has a budget, says where it is, and ends at Ctrl-C."""

import resource
import signal
import subprocess

import large_plants
from conftest import ROOT

COMMAND = ROOT / "target" / "release" / "aso-ftc"
# A program of this size takes minutes for each iteration.
PATIENCE = 60
LEAST = 'h_infinity = "least"\n{0}.region = {{ decay = 0.05, disc = {{ center = -5, radius = 4.95 }} }}\n'


def processor_time():
    """The seconds of all commands that have ended: other programs on the machine do not count."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def chain(folder, states):
    """A chain of masses; with a disc for the feedback its linear matrix inequalities have thousands of rows."""
    text = large_plants.plant_file(states)
    lines = [line for line in text.splitlines(keepends=True) if not line.startswith("feedback")]
    file = folder / "chain.toml"
    file.write_text("feedback." + LEAST.format("feedback") + "".join(lines), encoding="utf-8")
    return file


def test_gains_that_are_not_found_in_time_are_refused(aso_ftc, tmp_path):
    start = processor_time()
    done = aso_ftc("design", chain(tmp_path, 40), "--gain-time", "2", "--out", tmp_path / "design.toml")
    assert processor_time() - start < PATIENCE
    assert done.returncode == 2, done
    assert "left out after 2 s, the time for the search for gains; --gain-time allows more" in done.stderr
    assert not (tmp_path / "design.toml").exists()


def test_a_search_says_where_it_is_every_ten_seconds_and_ends_at_an_interrupt(tmp_path):
    file = chain(tmp_path, 40)
    command = [COMMAND, "design", file, "--out", tmp_path / "design.toml"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        lines = [process.stderr.readline()]
        assert lines[0].startswith("10 s, ") and lines[0].endswith(": gains\n"), lines
        process.send_signal(signal.SIGINT)
        rest = process.communicate(timeout=PATIENCE)[1]
    assert "interrupted: the design leaves out optional work" in rest and "the design was interrupted" in rest
    assert process.returncode == 2


def test_certificates_keep_their_time_and_the_design_is_written(aso_ftc, tmp_path):
    file = tmp_path / "chain.toml"
    file.write_text(large_plants.plant_file(28), encoding="utf-8")
    start = processor_time()
    aso_ftc("design", file, "--certificate-time", "0", "--out", tmp_path / "design.toml")
    without = processor_time() - start
    done = aso_ftc("design", file, "--certificate-time", "1", "--out", tmp_path / "design.toml", "--json", "--force")
    assert done.returncode in (0, 1), done.stderr
    assert processor_time() - start < 2 * without + 0.5 * PATIENCE
    assert "left out after 1 s, the time for certificates and bounds" in done.stdout
