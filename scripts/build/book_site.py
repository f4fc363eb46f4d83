"""A hook of mkdocs: the page of the pendulum, the link to the repository, and what assistive technology needs.

A region that scrolls must be reachable from the keyboard, so every table and every separate formula gets a place in
the order of the Tab key. The theme gives its search dialog no name.
"""

import re
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
REGION = '<div class="scroll" tabindex="0">'


def on_config(config):
    """Links the repository of this clone, if it is on the web."""
    command = ["git", "-C", str(ROOT), "config", "--get", "remote.origin.url"]
    remote = subprocess.run(command, capture_output=True, text=True, check=False)
    # ssh://git@HOST:PORT/PATH and git@HOST:PATH have their page at https://HOST/PATH.
    secure = r"^(?:ssh://(?:[^@/]+@)?([^:/]+)(?::\d+)?/|[^@/:]+@([^:/]+):/?)"
    page = re.sub(secure, r"https://\1\2/", remote.stdout.strip())
    address = re.fullmatch(r"(https://[^@\s]+?)(\.git)?/?", page)
    config.repo_url = address[1] if address else None
    config.repo_name = "Repository"
    return config


def on_page_content(content, **_):
    """Called by mkdocs with the HTML of each page, after the formulas are MathML."""
    return re.sub(r'(<table>.*?</table>|<math [^>]*display="block".*?</math>)', rf"{REGION}\1</div>", content, flags=re.DOTALL)


def on_post_page(output, **_):
    """Called by mkdocs with each page as a whole."""
    output = output.replace('role="dialog">', 'role="dialog" aria-label="Search">')
    return output.replace('data-md-toggle="search"', 'data-md-toggle="search" aria-label="Search"')


def on_post_template(output_content, **_):
    """Called by mkdocs with the page for addresses that do not exist, among others."""
    return on_post_page(output_content)


def on_post_build(config):
    """Replaces the pages that say how to build the pendulum and the tanks by these, if they are built."""
    page, place = ROOT / "target" / "web" / "page", Path(config.site_dir) / "paper"
    if (page / "paper.wasm").exists():
        shutil.rmtree(place)
        shutil.copytree(page, place)
