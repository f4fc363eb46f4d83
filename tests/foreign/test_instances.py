"""Many instances in a host program in C: nothing is leaked after loading and unloading.

The same hosts run under valgrind, see docs/explanation/robustness.md.
"""

import os
import shutil
import subprocess
from pathlib import Path

import fmpy
import pytest

ROUNDS, THREADS = 200, 4


def compiled(folder, name):
    """The program of a source file in C beside this file."""
    compiler = shutil.which(os.environ.get("CC", "cc"))
    program = folder / name
    source = Path(__file__).with_name(f"{name}.c")
    options = ["-Wall", "-Wextra", "-Werror", "-O1", "-g"]
    libraries = ["-ldl", "-lpthread", "-lm"]
    subprocess.run([compiler, *options, source, "-o", program, *libraries], check=True)
    return program


def expect_nothing_left(program, *arguments):
    """Runs a host program, which must leave nothing behind."""
    environment = {**os.environ, "GLIBC_TUNABLES": "glibc.malloc.tcache_count=0"}
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, env=environment)
    assert (done.returncode, done.stderr) == (0, ""), done
    assert done.stdout.endswith(" bytes, 0 descriptors, 0 threads\n")


def test_loading_running_and_unloading_leaks_no_memory_no_files_and_no_threads(fmu, tmp_path):
    host = compiled(tmp_path, "host")
    expect_nothing_left(host, fmu.path, fmu.description.guid, fmu.resources, ROUNDS, THREADS)


@pytest.mark.parametrize("folder", ["fmu-plant", "fmu-controller", "examples/bouncing-ball"])
def test_loading_running_and_unloading_an_fmu_of_fmi_3_leaks_nothing(aso_ftc, root, tmp_path, folder):
    done = aso_ftc("pack", root / folder, "--fmi", "3", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    (archive,) = tmp_path.glob("*.fmu")
    description = fmpy.read_model_description(str(archive))
    unpacked = Path(fmpy.extract(str(archive), tmp_path / "unpacked"))
    (library,) = unpacked.glob("binaries/*/*")
    floats = [variable for variable in description.modelVariables if variable.type == "Float64" and not variable.dimensions]
    references = [variable.valueReference for variable in floats if variable.causality == "output"][:2]
    host = compiled(tmp_path, "host3")
    resources = f"{unpacked / 'resources'}/"
    expect_nothing_left(host, library, description.guid, resources, ROUNDS, THREADS, *references)
