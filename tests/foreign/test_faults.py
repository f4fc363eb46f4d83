"""Systematic faults: whichever call fails, files are whole or the failure is named. `faults.py` tries every call."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from fault_scenarios import scenarios
from faults import KINDS, Bench, library, sweep

# A full disk, no access, no more files or threads, a disk with errors, interrupted and short calls, no memory.
CHOSEN = {
    "write ENOSPC lasting",
    "write short",
    "open EACCES",
    "open EMFILE lasting",
    "rename EIO",
    "rename ENOSPC lasting",
    "sync EIO",
    "read EIO",
    "start EAGAIN",
    "memory ENOMEM",
}


@pytest.fixture(scope="module")
def preload(tmp_path_factory):
    """The compiled library of faults."""
    return library(tmp_path_factory.mktemp("faults"))


@pytest.mark.usefixtures("packed")
@pytest.mark.parametrize("scenario", scenarios(), ids=lambda scenario: scenario.name)
def test_a_failed_call_leaves_whole_files_or_a_sentence_that_names_it(scenario, preload, tmp_path):
    bench = Bench(scenario, preload, tmp_path / scenario.name, 1)
    with ThreadPoolExecutor(1) as pool:
        sweeps = [sweep(bench, kind, 2, pool) for kind in KINDS if str(kind) in CHOSEN and scenario.has(kind.calls)]
    assert sum(one.faults for one in sweeps) > 0
    assert [f"{one.scenario}, {one.kind}, {text}" for one in sweeps for text in one.broken] == []
