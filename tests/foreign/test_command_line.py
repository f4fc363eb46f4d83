"""The command as a program: help, completions, manual pages, colours, the progress bar, and its FMUs when it is
installed away from its clone."""

import os
import pty
import re
import resource
import shutil
import socket
import subprocess
import sys

import pytest

VERBS = ["reproduce", "run", "design", "campaign", "report", "check", "pack", "new"]
RED = "\x1b[1m\x1b[31merror:\x1b[0m "
YELLOW = "\x1b[1m\x1b[33mwarning:\x1b[0m "


@pytest.fixture(scope="module")
def command(root):
    """The path of the command."""
    return root / "target" / "release" / "aso-ftc"


@pytest.fixture
def folder(root, tmp_path):
    """A folder outside of the clone with the files that the examples name."""
    for name in ("dist", "docs", "examples"):
        (tmp_path / name).symlink_to(root / name)
    return tmp_path


def on_terminal(command, *words, **variables):
    """What the command writes to standard error if that is a terminal."""
    master, slave = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "80", **variables}
    with subprocess.Popen([command, *words], stdout=subprocess.DEVNULL, stderr=slave, env=environment) as process:
        os.close(slave)
        parts = []
        try:
            while part := os.read(master, 65536):
                parts.append(part)
        except OSError:
            # The terminal is closed.
            pass
        os.close(master)
    assert process.returncode is not None
    return b"".join(parts).decode()


@pytest.mark.parametrize("verb", ["run", "check"])
def test_the_examples_of_the_help_work(command, folder, packed, verb):
    text = subprocess.check_output([command, verb, "--help"], text=True)
    examples = re.findall(rf"^  aso-ftc ({verb} .*)$", text, re.MULTILINE)
    assert len(examples) == 3
    for example in examples:
        done = subprocess.run([command, *example.split()], cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


def test_the_version_names_a_commit_of_the_clone(command, root):
    text = subprocess.check_output([command, "--version"], text=True)
    match = re.fullmatch(r"aso-ftc \d+\.\d+\.\d+(?: \(([0-9a-f]{8,}) \d{4}-\d\d-\d\d\))?\n", text)
    assert match, text
    if (root / ".git").exists():
        subprocess.run(["git", "cat-file", "-e", f"{match[1]}^{{commit}}"], cwd=root, check=True)


def test_bash_completes_verbs_and_options(command, tmp_path):
    script = tmp_path / "aso-ftc.bash"
    script.write_bytes(subprocess.check_output([command, "completions", "bash"]))
    subprocess.run(["bash", "-n", script], check=True)
    program = (
        'source "$1"; function=$(complete -p aso-ftc | sed "s/.*-F \\([^ ]*\\).*/\\1/"); '
        'COMP_WORDS=("${@:2}"); COMP_CWORD=$(($# - 2)); '
        '"$function" "$2" "${@: -1}" "${@: -2:1}"; echo "${COMPREPLY[*]}"'
    )

    def complete(*words):
        words = ["bash", "-c", program, "bash", script, "aso-ftc", *words]
        return subprocess.check_output(words, text=True).split()

    assert complete("rep") == ["reproduce", "report"]
    assert complete("run", "--isol") == ["--isolate"]


@pytest.mark.parametrize("shell", ["zsh", "fish", "powershell", "elvish"])
def test_completions_of_other_shells_name_the_verbs(command, shell):
    script = subprocess.check_output([command, "completions", shell], text=True)
    assert all(verb in script for verb in VERBS)


def test_there_is_a_manual_page_for_each_verb(command, tmp_path):
    subprocess.run([command, "man", "--out", tmp_path], check=True, stdout=subprocess.DEVNULL)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"aso-ftc.1", *(f"aso-ftc-{verb}.1" for verb in VERBS)}
    assert subprocess.check_output([command, "man"], text=True) == (tmp_path / "aso-ftc.1").read_text()


def test_errors_are_coloured_on_a_terminal_only(command, monkeypatch):
    for name in ("NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE"):
        monkeypatch.delenv(name, raising=False)
    words = ["check", "missing.fmu"]
    assert on_terminal(command, *words).startswith(RED)
    assert on_terminal(command, *words, NO_COLOR="1").startswith("error: ")

    def piped(**variables):
        environment = {**os.environ, **variables}
        return subprocess.run([command, *words], env=environment, capture_output=True, text=True).stderr

    assert piped().startswith("error: ")
    assert piped(CLICOLOR_FORCE="1").startswith(RED)


def test_messages_of_a_run_are_coloured_unless_they_are_json(command, packed, monkeypatch, tmp_path):
    monkeypatch.setenv("CLICOLOR_FORCE", "1")
    run = [command, "run", packed["plant"], "--time-limit", "1", "--stop-time", "0.01", "--out", tmp_path]
    assert YELLOW in subprocess.run(run, capture_output=True, text=True, check=True).stderr
    done = subprocess.run([*run, "--log-json"], capture_output=True, text=True, check=True)
    assert done.stderr.startswith("{") and "\x1b" not in done.stderr


def test_the_progress_bar_shows_per_cent_speed_and_time_left(command, packed, tmp_path):
    words = ["run", *packed.values(), "--step", "0.00001", "--stop-time", "5", "--out", tmp_path]
    shown = on_terminal(command, *words)
    assert re.search(r" \d+ %, t = [0-9.e-]+ s, [0-9.e]+ times real time, \d+s left", shown), shown
    words[-1] = tmp_path / "other"
    assert subprocess.run([command, *words], capture_output=True, check=True).stderr == b""


def test_campaign_without_python_explains_itself(command, tmp_path):
    nowhere = {**os.environ, "ASO_FTC_PYTHON": "/nowhere/python"}
    done = subprocess.run([command, "campaign", "--help"], env=nowhere, capture_output=True, text=True)
    assert done.returncode == 0 and "python -m pip install" in done.stdout and "--workers" in done.stdout
    bare = tmp_path / "python"
    bare.write_text(f'#!/bin/sh\nexec {sys.executable} -I -S "$@"\n')
    bare.chmod(0o755)
    environment = {**os.environ, "ASO_FTC_PYTHON": str(bare)}
    done = subprocess.run([command, "campaign", "own.toml"], env=environment, capture_output=True, text=True)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert f"{bare} has no package aso_ftc" in done.stderr and "-m pip install './python[campaign]'" in done.stderr


@pytest.mark.parametrize("place", ["fmus", "../share/aso-ftc/fmus", "../fmus"])
def test_an_installed_command_finds_its_fmus_from_any_folder(command, packed, tmp_path, place):
    programs, here = tmp_path / "release" / "bin", tmp_path / "empty"
    programs.mkdir(parents=True)
    here.mkdir()
    shutil.copy(command, programs)
    fmus = programs / place
    fmus.mkdir(parents=True)
    for path in packed.values():
        shutil.copy(path, fmus)
    for words in (["run", "--stop-time", "0.1"], ["reproduce", "--stop-time", "0.1"]):
        done = subprocess.run([programs / "aso-ftc", *words], cwd=here, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert not (here / "dist").exists()


def test_a_copied_command_runs_the_fmus_of_the_clone_that_built_it(command, packed, tmp_path):
    shutil.copy(command, tmp_path)
    words = [tmp_path / "aso-ftc", "run", "--stop-time", "0.1"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_copied_command_packs_the_fmus_of_the_clone_that_built_it(command, root, tmp_path):
    shutil.copy(command, tmp_path)
    words = ["reproduce", "--stop-time", "0.1"]
    done = subprocess.run([tmp_path / "aso-ftc", *words], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f"packing the models of {root}\n" in done.stderr
    assert (tmp_path / "dist" / "AsoController.fmu").is_file()


def test_a_system_structure_without_fmus_is_named(aso_ftc, tmp_path):
    ssd = tmp_path / "SystemStructure.ssd"
    ssd.write_text(
        '<SystemStructureDescription xmlns="http://ssp-standard.org/SSP1/SystemStructureDescription" '
        'name="empty" version="1.0"><System name="root"/></SystemStructureDescription>'
    )
    done = aso_ftc("run", ssd)
    assert done.returncode == 2
    assert done.stderr == f"error: {ssd}: the system has no FMU, expected at least one\n"


def test_a_fault_after_the_stop_time_is_a_warning_and_changes_nothing(aso_ftc, packed, tmp_path):
    system = f"""[fmus]
plant = "{packed["plant"].as_posix()}"
controller = "{packed["controller"].as_posix()}"
[experiment]
stop-time = 0.05
"""
    fault = '[[scenario.fault]]\nconnection = "plant.u"\nbias = { value = 5, from = START }\n'
    results, warnings = [], []
    for index, start in enumerate([None, "0.06", "0.04"]):
        file = tmp_path / f"{index}.toml"
        file.write_text(system + (fault.replace("START", start) if start else ""))
        done = aso_ftc("run", file, "--out", tmp_path / str(index))
        assert done.returncode == 0, done
        results.append((tmp_path / str(index) / "results.csv").read_bytes())
        warnings.append("it has no effect" in done.stderr)
    assert warnings == [False, True, False]
    assert results[0] == results[1] != results[2]


def test_a_run_whose_last_write_fails_made_all_steps(aso_ftc, packed, tmp_path):
    shutil.unpack_archive(packed["plant"], tmp_path / "plant", "zip")
    words = ["run", tmp_path / "plant", "--stop-time", "0.05", "--out", tmp_path / "out"]
    # The rows, more than 4000 bytes, are written at the end.
    done = aso_ftc(*words, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000)))
    results = tmp_path / "out" / "results.csv"
    assert done.returncode == 1 and done.stderr.startswith(
        f"error: the run made all steps, up to t = 0.05 s, and failed at its end: cannot write {results}: "
    ), done


@pytest.mark.parametrize("script", ["web", "book"])
def test_a_port_in_use_is_one_sentence(root, script):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        environment = {**os.environ, "PORT": str(port)}
        words = [root / "scripts" / script, "--serve"]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and done.stdout == ""
    assert re.fullmatch(rf"scripts/{script}: port {port} is in use; PORT=\d+ scripts/{script} --serve .*\n", done.stderr)
