"""The hook for commit messages, as git calls it and as the workflow for pull requests does."""

import os
import subprocess

import pytest

LONGEST = "ä" * 72


@pytest.fixture
def repository(root, tmp_path):
    """Runs git in a new repository that uses the hook."""
    identity = {f"GIT_{role}_{key}": f"{key}@example" for role in ("AUTHOR", "COMMITTER") for key in ("NAME", "EMAIL")}
    settings = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull}
    environment = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")} | identity | settings

    def git(*words, **options):
        return subprocess.run(["git", *words], cwd=tmp_path, env=environment, capture_output=True, text=True, **options)

    assert git("init", "--quiet").returncode == 0
    assert git("config", "core.hooksPath", root / ".githooks").returncode == 0
    return git


@pytest.mark.parametrize("message", [LONGEST, f"{LONGEST}\n\n{'a' * 200}", f"\n\n{LONGEST}\n"])
def test_a_subject_of_72_characters_is_committed(repository, message):
    done = repository("commit", "--allow-empty", "--message", message)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("message", [f"{LONGEST}ö", f"{'a' * 40}\n{'b' * 40}\n\nBody", f"\n{LONGEST}.\n\nBody"])
def test_a_longer_subject_is_refused(repository, message):
    done = repository("commit", "--allow-empty", "--message", message)
    assert done.returncode == 1 and "expected 72 at most" in done.stderr, done
    assert repository("rev-parse", "--verify", "HEAD").returncode != 0


def test_the_hook_reads_a_message_from_its_standard_input(root, repository):
    for message, status in ((f"{LONGEST}\n\nBody\n", 0), (f"{LONGEST}ö\n", 1)):
        words = [root / ".githooks" / "commit-msg", "/dev/stdin"]
        assert subprocess.run(words, input=message, capture_output=True, text=True).returncode == status
