"""README.md and the book: every command in them runs, and the outputs shown are those of the commands.

The blocks marked `sh` of a page run in the order of the page, with the built command, in a copy of the folder with
packed FMUs. A comment on the line before a block says why it cannot run here, or which exit status it has:
`<!-- not run: REASON -->`, `<!-- ends with status N -->`.
"""

import os
import re
import shutil
import subprocess
import sys
from functools import cache

import pytest

from conftest import ROOT

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"(?:^<!-- ([^\n]*) -->\n)?^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LANGUAGES = {"sh", "text", "toml", "python", "rust", "lua", "xml", "c"}
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", "target", "results", "dist", "__pycache__", "fuzz")

# Replaces `aso-ftc` and `cargo run --release --` on PATH. Commands that build libraries run in the
# real folder, where the libraries are built already, and write into the copy.
STAND_IN = f'''#!{sys.executable}
import os, shutil, sys
from pathlib import Path

arguments, root, here = sys.argv[1:], {str(ROOT)!r}, os.getcwd()
if Path(sys.argv[0]).name == "cargo":
    if arguments[:3] != ["run", "--release", "--"]:
        sys.exit("only cargo run --release -- is expected in a page")
    arguments = arguments[3:]
verb = arguments[0]
if verb in ("pack", "reproduce"):
    for place, text in enumerate(arguments):
        if text.startswith(("results/", "../")):
            arguments[place] = os.path.abspath(text)
        if text.startswith("../"):
            shutil.copy(os.path.join(root, "Cargo.lock"), arguments[place])
            os.environ["CARGO_TARGET_DIR"] = os.path.join(root, "target", "author")
    if verb == "reproduce" and "--out" not in arguments:
        arguments += ["--out", os.path.abspath("results/reproduce")]
    arguments += ["--out" if verb == "pack" else "--dist", os.path.abspath("dist")]
    os.chdir(root)
os.environ["PATH"] = os.environ["PATH"].split(os.pathsep, 1)[1]
command = os.path.join(root, "target", "release", "aso-ftc")
os.execv(command, [command, *arguments])
'''


def blocks(page):
    """Each block of a page: the comment before it, its language, its text."""
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def name(page):
    """The path of a page in the repository."""
    return str(page.relative_to(ROOT))


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """Runs a shell text in a copy of the folder, once: a later call returns the same exit status and output."""
    home = tmp_path_factory.mktemp("book")
    folder, programs = home / "copy", home / "programs"
    shutil.copytree(ROOT, folder, ignore=LEFT_OUT, symlinks=True)
    (folder / ".venv").symlink_to(sys.prefix)
    programs.mkdir()
    for program in ("aso-ftc", "cargo"):
        (programs / program).write_text(STAND_IN, encoding="utf-8")
        (programs / program).chmod(0o755)
    environment = {**os.environ, "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
    # Campaigns need the wheel, which scripts/test installs here before.
    environment["ASO_FTC_PYTHON"] = str(ROOT / "target" / "wheel" / "test" / "bin" / "python")
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, "timeout": 300}

    @cache
    def once(text):
        command = ["bash", "-e", "-c", text]
        return subprocess.run(command, cwd=folder, env=environment, check=False, **options)

    def run(text):
        text = text.replace("cargo run --release --", "aso-ftc")
        return once(re.sub(r" +#.*$", "", text, flags=re.MULTILINE))

    examples = "examples/dc-servo examples/pid examples/three-tank"
    done = run(f"aso-ftc pack --ssp\naso-ftc pack {examples}")
    assert done.returncode == 0, done.stdout
    return run


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_block_is_marked_by_its_language(page):
    text = page.read_text(encoding="utf-8")
    found = blocks(page)
    assert text.count("```") == 2 * len(found), "a block that is not closed, or inside of a list"
    for remark, language, content in found:
        assert language in LANGUAGES, content
        assert not remark or re.match(r"not run: .{10}|ends with status \d+$", remark), remark
    outside = BLOCK.sub("", text)
    assert not re.search(r"^ {4}\S", outside, re.MULTILINE), "a block without a mark"


@pytest.mark.parametrize("page", [p for p in PAGES if any(b[1] == "sh" for b in blocks(p))], ids=name)
def test_every_command_of_the_page_runs(copy, page):
    for remark, language, content in blocks(page):
        if language != "sh" or remark.startswith("not run: "):
            continue
        expected = int(remark.rsplit(" ", 1)[1]) if remark else 0
        done = copy(content)
        assert done.returncode == expected, f"{content}\n{done.stdout}"


def shown(page, index):
    """The lines of the block with this index among those marked `text`."""
    return [b[2] for b in blocks(page) if b[1] == "text"][index].splitlines()


def test_the_first_tutorial_shows_the_printed_output_and_the_files_unchanged(copy):
    page = ROOT / "docs" / "tutorials" / "first-coupled-system.md"
    commands = [b[2] for b in blocks(page) if b[1] == "sh"]
    for index, command in ((0, 0), (1, 1), (2, 3)):
        printed = copy(commands[command]).stdout.splitlines()
        assert set(shown(page, index)) <= set(printed), printed
    files = page.parent / "first"
    whole, added = [b[2] for b in blocks(page) if b[1] == "toml"]
    assert whole == (files / "servo.toml").read_text(encoding="utf-8")
    assert (files / "biased.toml").read_text(encoding="utf-8") == f"{whole}\n{added}"


def test_the_page_on_campaigns_shows_the_printed_summary_and_the_file_unchanged(copy):
    page = ROOT / "docs" / "how-to" / "campaigns.md"
    (command,) = [b[2] for b in blocks(page) if b[1] == "sh" and "campaigns/faults.toml" in b[2]]
    assert set(shown(page, 0)) <= set(copy(command).stdout.splitlines()), copy(command).stdout
    (file,) = [b[2] for b in blocks(page) if b[1] == "toml"]
    assert file == (page.parent / "campaigns" / "faults.toml").read_text(encoding="utf-8")


def test_the_swapped_controller_has_the_residual_shown_on_the_page(copy):
    page = ROOT / "docs" / "tutorials" / "swap.md"
    build, theirs, ours = [b[2] for b in blocks(page) if b[1] == "sh"][:3]
    assert copy(build).returncode == 0
    for index, command in ((0, theirs.splitlines()[1]), (1, ours)):
        printed = copy(command).stdout.splitlines()
        assert set(shown(page, index)) <= set(printed), printed
