"""The pages about Python: every block marked `python` runs, in the order of its page."""

import re
from pathlib import Path

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


def test_the_environment_for_gymnasium_follows_its_rules(monkeypatch):
    pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    monkeypatch.syspath_prepend(ROOT / "python" / "examples")
    from pendulum_env import PendulumEnv

    check_env(PendulumEnv(), skip_render_check=True)
