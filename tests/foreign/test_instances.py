"""Many instances in a host program in C: nothing is leaked after loading and unloading.

The same host runs under valgrind, see docs/explanation/robustness.md.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROUNDS, THREADS = 200, 4


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    """The program of host.c."""
    compiler = shutil.which(os.environ.get("CC", "cc"))
    program = tmp_path_factory.mktemp("host") / "host"
    source = Path(__file__).with_name("host.c")
    options = ["-Wall", "-Wextra", "-Werror", "-O1", "-g"]
    libraries = ["-ldl", "-lpthread", "-lm"]
    subprocess.run([compiler, *options, source, "-o", program, *libraries], check=True)
    return program


def test_loading_running_and_unloading_leaks_no_memory_no_files_and_no_threads(fmu, host):
    arguments = [fmu.path, fmu.description.guid, fmu.resources, str(ROUNDS), str(THREADS)]
    environment = {**os.environ, "GLIBC_TUNABLES": "glibc.malloc.tcache_count=0"}
    done = subprocess.run([host, *arguments], capture_output=True, text=True, env=environment)
    assert (done.returncode, done.stderr) == (0, ""), done
    assert done.stdout.endswith(" bytes, 0 descriptors, 0 threads\n")
