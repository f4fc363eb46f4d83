"""README.md, the book and their neighbours: every command in them runs as it is written, and the outputs shown are
those of the commands.

The blocks marked `sh` of a page run in the order of the page, in a copy of the checkout, with cargo and with the Python
environment that the commands of README.md make: outside of the checkout, empty at the start. README.md is first.
Many blocks begin with the same installation or the same packing: such a line runs once, and counts in each of them.
If BUILT_PROGRAMS is set, the copy gets what is built here, and cargo does not build it again; else all is built from
nothing.
A comment on the line before a block may say `<!-- ends with status N -->`, `<!-- runs until interrupted -->`, or
`<!-- not run: REASON -->` with a reason of NOT_RUN.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.request
import venv
from collections import Counter
from contextlib import ExitStack
from fcntl import LOCK_SH, flock
from functools import cache
from pathlib import Path

import pytest

from conftest import ROOT

README = ROOT / "README.md"
NEIGHBOURS = [
    *(ROOT / "CONTRIBUTING.md", ROOT / "examples" / "README.md", ROOT / "python" / "README.md"),
    *sorted(ROOT.glob("crates/*/README.md")),
]
PAGES = [README, *NEIGHBOURS, *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"(?:^<!-- ([^\n]*) -->\n)?^```([\w,]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LANGUAGES = {"sh", "text", "toml", "python", "rust", "lua", "xml", "c"}
# The reasons for which a command is not run, with the number of blocks.
NOT_RUN = {
    "the test command": 5,
    r"\d+ minutes": 12,
    "scripts/test-long runs it": 2,
    "scripts/release runs it": 2,
    "not in the registries: Reference-FMUs": 2,
    "not in the registries: fmi-ls-bus-examples": 2,
}
REMARK = re.compile(rf"not run: ({'|'.join(NOT_RUN)})|ends with status \d+|runs until interrupted")
ADDRESS = re.compile(r"http://127\.0\.0\.1:\d+[\w/.-]*")
# A line that does the same each time and leaves no variable of the shell.
ONCE = re.compile(r"(python -m pip install|aso-ftc pack)\b[^|>&;\\$]*")
SECONDS = 1800


def blocks(page):
    """Each block of a page: the comment before it, its language, its text."""
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def commands(page):
    """The blocks of a page that run: the comment before each, and its text."""
    return [(remark, text) for remark, language, text in blocks(page) if language == "sh" and not remark.startswith("not run")]


def name(page):
    """The path of a page in the repository."""
    return str(page.relative_to(ROOT))


def files():
    """The files of the checkout, with those that are not committed yet."""
    listed = subprocess.check_output(["git", "ls-files", "-coz", "--exclude-standard"], cwd=ROOT, text=True)
    return [path for path in listed.split("\0") if path and (ROOT / path).is_file()]


def copy(target, folder):
    """Copies a folder of cargo, while no other test packs a model into it."""
    with ExitStack() as stack:
        for path in target.glob("*/.cargo*lock"):
            flock(stack.enter_context(path.open(encoding="ascii")), LOCK_SH)
        subprocess.run(["cp", "--archive", target, folder], check=True)


class Reader:
    """Somebody who types the commands of the pages into a shell."""

    def __init__(self, home):
        self.folder = home / "copy"
        for path in files():
            (self.folder / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / path, self.folder / path)
        if built := os.environ.get("BUILT_PROGRAMS"):
            (self.folder / "target").mkdir()
            for name in ("release", "libraries"):
                copy(Path(built).parent / name, self.folder / "target")
        venv.create(home / "python", with_pip=True)
        ours = str(Path(sys.prefix) / "bin")
        path = [part for part in os.environ["PATH"].split(os.pathsep) if part != ours]
        changes = {"PATH": os.pathsep.join([str(home / "python" / "bin"), *path])}
        changes["CARGO_INSTALL_ROOT"] = str(home / "installed")
        dropped = {"VIRTUAL_ENV", "PYTHONPATH", "PYTHONHOME", "BUILT_PROGRAMS", "CARGO_TARGET_DIR"}
        self.environment = {key: value for key, value in os.environ.items() if key not in dropped} | changes
        self.run = cache(self.run)

    def start(self, text):
        """A shell with these commands, in a process group of its own."""
        return subprocess.Popen(
            ["bash", "-e", "-c", text],
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )

    def run(self, text):
        """Runs the commands once: a later call returns the same exit status and output."""
        first, _, rest = text.partition("\n")
        if rest and ONCE.fullmatch(first):
            done = self.run(f"{first}\n")
            if done.returncode == 0:
                after = self.run(rest)
                return subprocess.CompletedProcess(text, after.returncode, done.stdout + after.stdout)
            return done
        shell = self.start(text)
        try:
            output, _ = shell.communicate(timeout=SECONDS)
        except subprocess.TimeoutExpired:
            os.killpg(shell.pid, signal.SIGKILL)
            raise
        return subprocess.CompletedProcess(text, shell.returncode, output)

    def visit(self, text):
        """Runs commands that serve a page, loads the page and interrupts them."""
        shell, printed = self.start(text), ""
        try:
            for line in shell.stdout:
                printed += line
                if address := ADDRESS.search(line):
                    with urllib.request.urlopen(address[0], timeout=60) as page:
                        assert page.status == 200 and b"<html" in page.read().lower(), address[0]
                    return
        finally:
            os.killpg(shell.pid, signal.SIGINT)
            shell.wait(60)
        raise AssertionError(f"{text}\nno address:\n{printed}")

    def follow(self, page):
        """Runs all commands of a page, each as its remark says."""
        for remark, text in commands(page):
            if remark == "runs until interrupted":
                self.visit(text)
                continue
            expected = int(remark.rsplit(" ", 1)[1]) if remark else 0
            done = self.run(text)
            assert done.returncode == expected, f"{text}\n{done.stdout}"


@pytest.fixture(scope="module")
def reader(tmp_path_factory):
    """A reader who has followed README.md."""
    reader = Reader(tmp_path_factory.mktemp("book"))
    for _, text in commands(README):
        reader.run(text)
    return reader


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_block_is_marked_by_its_language(page):
    text = page.read_text(encoding="utf-8")
    marked = blocks(page)
    assert text.count("```") == 2 * len(marked), "a block that is not closed, or inside of a list"
    for remark, language, content in marked:
        assert language.split(",")[0] in LANGUAGES, content
        assert not remark or language != "sh" or REMARK.fullmatch(remark), remark
    outside = BLOCK.sub("", text)
    assert not re.search(r"^ {4}\S", outside, re.MULTILINE), "a block without a mark"


def test_the_commands_that_are_not_run_are_counted():
    remarks = [remark.removeprefix("not run: ") for page in PAGES for remark, language, _ in blocks(page) if language == "sh"]
    counts = Counter(next((r for r in NOT_RUN if re.fullmatch(r, remark)), None) for remark in remarks)
    del counts[None]
    assert counts == NOT_RUN


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)], ids=name)
def test_every_command_of_the_page_runs(reader, page):
    reader.follow(page)


def shown(page, index):
    """The lines of the block with this index among those marked `text`."""
    return [b[2] for b in blocks(page) if b[1] == "text"][index].splitlines()


def test_the_first_tutorial_shows_the_printed_output_and_the_files_unchanged(reader):
    page = ROOT / "docs" / "tutorials" / "first-coupled-system.md"
    commands = [b[2] for b in blocks(page) if b[1] == "sh"]
    for index, command in ((0, 0), (1, 1), (2, 3)):
        printed = reader.run(commands[command]).stdout.splitlines()
        assert set(shown(page, index)) <= set(printed), printed
    files = page.parent / "first"
    whole, added = [b[2] for b in blocks(page) if b[1] == "toml"]
    assert whole == (files / "servo.toml").read_text(encoding="utf-8")
    assert (files / "biased.toml").read_text(encoding="utf-8") == f"{whole}\n{added}"


def test_the_page_on_campaigns_shows_the_printed_summary_and_the_file_unchanged(reader):
    page = ROOT / "docs" / "how-to" / "campaigns.md"
    (command,) = [b[2] for b in blocks(page) if b[1] == "sh" and "campaigns/faults.toml" in b[2]]
    assert set(shown(page, 0)) <= set(reader.run(command).stdout.splitlines()), reader.run(command).stdout
    (file,) = [b[2] for b in blocks(page) if b[1] == "toml"]
    assert file == (page.parent / "campaigns" / "faults.toml").read_text(encoding="utf-8")


def test_the_swapped_controller_has_the_residual_shown_on_the_page(reader):
    page = ROOT / "docs" / "tutorials" / "swap.md"
    build, theirs, ours = [b[2] for b in blocks(page) if b[1] == "sh"][:3]
    assert reader.run(build).returncode == 0
    for index, command in ((0, theirs.splitlines()[1]), (1, ours)):
        printed = reader.run(command).stdout.splitlines()
        assert set(shown(page, index)) <= set(printed), printed
