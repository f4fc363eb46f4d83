"""The benchmark of the master works: every system gives the outputs of a loop in C, and a figure."""

import subprocess
import sys


def test_the_master_gives_the_outputs_of_a_loop_in_c_on_every_system_of_the_benchmark(root):
    command = [sys.executable, root / "scripts" / "bench" / "benchmark-peers", "--alone"]
    command += ["--repeats", "1", "--seconds", "0.01"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, cwd=root)
    assert done.returncode == 0, done.stderr
    # A system whose outputs differ, or that does not run, has no figure, and a line that says why.
    assert "No figure for" not in done.stdout
    rows = [line for line in done.stdout.splitlines() if line.startswith("| this master |")]
    assert len(rows) == 3
    cells = [cell.strip() for row in rows for cell in row.strip("|").split("|")[1:]]
    assert len(cells) == 11 and all(cell[0].isdigit() for cell in cells), cells
