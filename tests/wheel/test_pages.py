"""The pages about Python: every block marked `python` runs, in the order of its page."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "python/README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"(?:^<!-- ([^\n]*) -->\n)?^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
OURS = [page for page in PAGES if "aso_ftc" in page.read_text(encoding="utf-8")]


@pytest.mark.parametrize("page", OURS, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_python_block_of_a_page_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    for remark, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        if not remark.startswith("not run: "):
            exec(compile(text, page, "exec"), names)


def columns(values):
    """What a block of the page about FMPy returns, by name."""
    if getattr(values, "dtype", None) is not None:
        return {name: values[name] for name in values.dtype.names}
    return dict(values) if isinstance(values, Mapping) else {"": values}


def test_what_a_call_of_fmpy_returns_is_what_the_call_beside_it_returns(tmp_path, monkeypatch):
    pytest.importorskip("fmpy")
    pytest.importorskip("matplotlib").use("Agg")
    monkeypatch.chdir(tmp_path)
    names, compared, last = {"__name__": "page"}, 0, None
    for remark, text in BLOCK.findall((ROOT / "docs/how-to/fmpy.md").read_text(encoding="utf-8")):
        if remark:
            continue
        exec(compile(text, "fmpy.md", "exec"), names)
        if names.get("theirs") is last:
            continue
        last, theirs, ours = names["theirs"], columns(names["theirs"]), columns(names["ours"])
        assert list(theirs) == list(ours), text
        for name, values in theirs.items():
            if isinstance(values, str | None):
                assert ours[name] == values, (text, name)
            else:
                # FMPy adds up its times; its solver of model exchange is another one.
                assert np.shape(values) == np.shape(ours[name]), (text, name)
                assert np.allclose(values, ours[name], rtol=1e-6, atol=1e-6), (text, name)
        compared += 1
    assert compared == 9


def test_the_environment_for_gymnasium_follows_its_rules(monkeypatch):
    pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    monkeypatch.syspath_prepend(ROOT / "python" / "examples")
    from pendulum_env import PendulumEnv

    check_env(PendulumEnv(), skip_render_check=True)
