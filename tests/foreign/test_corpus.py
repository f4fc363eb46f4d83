"""Replays the corpus of the fuzz target `design_file` on the built library."""

import re
from pathlib import Path

import pytest

from c_abi import FATAL, OK, Instance, describe, reals

CORPUS = Path(__file__).resolve().parents[2] / "fuzz" / "corpus" / "design_file"


@pytest.mark.parametrize("path", sorted(CORPUS.iterdir()), ids=lambda path: path.name)
def test_a_design_file_is_refused_with_a_message_or_gives_a_controller(controller, tmp_path, path):
    (tmp_path / "design.toml").write_bytes(path.read_bytes())
    status, said = describe(controller.library, tmp_path)
    assert said and "panicked" not in said
    if status != OK:
        assert Instance(controller, resources=tmp_path.as_uri()).component is None
        return
    guid = re.search(r'guid="([^"]*)"', said).group(1).encode()
    with Instance(controller, guid=guid, resources=tmp_path.as_uri()) as instance:
        statuses = [instance.call("EnterInitializationMode"), instance.call("ExitInitializationMode")]
        for k in range(3):
            statuses.append(instance.call("DoStep", k * 0.01, 0.01, 1))
            statuses.append(instance.call("GetReal", (controller.references("time")), 1, reals(0)))
        assert all(OK <= status < FATAL for status in statuses), instance.messages
