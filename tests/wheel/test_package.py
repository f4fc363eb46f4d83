"""The package: types, stubs, documentation, the command."""

import doctest
import importlib.metadata
import inspect
import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import aso_ftc as af
import pytest

PACKAGE = Path(af.__file__).parent
ROOT = Path(__file__).resolve().parents[2]


def test_the_stubs_are_those_of_the_extension_and_types_are_complete(tmp_path):
    pytest.importorskip("mypy")
    config = ROOT / "python" / "pyproject.toml"
    user = tmp_path / "user.py"
    user.write_text(
        "import aso_ftc as af\n"
        "results = af.paper().run(stop_time=0.1, record=['plant.x_p'])\n"
        "peak = float(results['plant.x_p'].max())\n"
        "reveal_type(results.last())\n",
        encoding="utf-8",
    )

    def run(*words):
        words = [sys.executable, "-I", "-m", *map(str, words)]
        done = subprocess.run(words, check=False, capture_output=True, text=True, cwd=tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    run("mypy.stubtest", "--mypy-config-file", config, "aso_ftc._core")
    run("mypy", "--config-file", config, "-p", "aso_ftc")
    assert "dict[str, Any]" in run("mypy", "--config-file", config, user)


def test_every_type_of_the_public_interface_is_stated(tmp_path):
    pytest.importorskip("pyright")
    # pyright takes the environment whose python is first in the path.
    here = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", "VIRTUAL_ENV": sys.prefix}
    words = [sys.executable, "-I", "-m", "pyright", "--verifytypes", "aso_ftc", "--ignoreexternal"]
    done = subprocess.run(words, check=False, capture_output=True, text=True, cwd=tmp_path, env=here)
    assert "Type completeness score: 100%" in done.stdout, done.stdout + done.stderr


def test_every_public_name_has_a_docstring():
    for name in af.__all__:
        value = getattr(af, name)
        if name == "__version__":
            continue
        assert inspect.getdoc(value), name
        if inspect.isclass(value):
            members = vars(value).items()
            functions = [(k, v) for k, v in members if callable(v) and not k.startswith("_")]
            assert all(inspect.getdoc(v) for _, v in functions), name


def test_the_examples_of_docstrings_hold():
    modules = [af, *(sys.modules[name] for name in list(sys.modules) if name.startswith("aso_ftc._"))]
    done = [doctest.testmod(module) for module in modules]
    assert sum(result.failed for result in done) == 0 and sum(result.attempted for result in done) >= 4


def test_importing_loads_neither_numpy_nor_other_packages(python):
    program = "import sys, aso_ftc; print([n for n in ('numpy', 'pyarrow', 'pandas', 'polars') if n in sys.modules])"
    assert python(program).stdout.strip() == "[]"


def test_the_command_and_the_module_are_one_program():
    expected = ["aso-ftc", af.__version__]
    script = Path(sysconfig.get_path("scripts"), "aso-ftc")
    for words in ([str(af.command())], [sys.executable, "-I", "-m", "aso_ftc"], [str(script)]):
        done = subprocess.run([*words, "--version"], check=True, capture_output=True, text=True)
        assert done.stdout.split()[:2] == expected


def test_a_type_checker_finds_the_marker():
    assert (PACKAGE / "py.typed").is_file()


def test_the_licences_of_the_package_and_of_the_crates_in_it_are_there():
    information = importlib.metadata.distribution("aso-ftc")
    assert "Permission is hereby granted" in information.read_text("licenses/LICENSE-MIT")
    assert "Apache License" in information.read_text("licenses/LICENSE-APACHE")
    others = (PACKAGE / "THIRD-PARTY.txt").read_text(encoding="utf-8")
    assert {"clarabel", "clap", "pyo3", "parquet"} <= {line.partition(" ")[0] for line in others.splitlines()}


def test_the_metadata_name_the_authors_and_the_python_that_runs():
    about = importlib.metadata.metadata("aso-ftc")
    version = ".".join(map(str, sys.version_info[:2]))
    assert about["Author"] and f"Programming Language :: Python :: {version}" in about.get_all("Classifier")
    assert about["License-Expression"] == "MIT OR Apache-2.0" and "pip install aso-ftc" not in about["Description"]
