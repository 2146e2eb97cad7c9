"""The pages: each is in the site and every link leads somewhere; `make docs` builds them with warnings as errors."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from tltlrl.config.compose import as_meant, compose
from tltlrl.registry import TASKS

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    path
    for pattern in ("*.md", "docs/*.md", "runs/README.md", "examples/*/README.md")
    for path in ROOT.glob(pattern)
    if path.name != "package.md"  # of a package index, without relative links
)
FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)


def anchors(page):
    """Of its headings, as GitHub and the site make them."""
    headings = re.findall(r"^#+ (.*)$", FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading).lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_row_of_a_table_has_as_many_cells_as_its_head(page):
    for table in re.findall(r"(?:^\|.*\n)+", FENCE.sub("", page.read_text(encoding="utf-8")) + "\n", re.MULTILINE):
        head, *rows = table.splitlines()
        assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {len(re.findall(r"(?<!\\)\|", head))}, head


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", FENCE.sub("", page.read_text(encoding="utf-8"))):
        if link.startswith("https://"):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_path_of_the_code_exists(page):
    for path in re.findall(r"`((?:tltlrl|studies|tests|configs|specs)/[\w/.]+)`", page.read_text(encoding="utf-8")):
        assert (ROOT / path).exists(), path


def commands():
    """Every `tltl-run` of the pages whose experiment or task comes with tltlrl."""
    found = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8").replace("\\\n", " ")
        typed = re.findall(r"^(?: {4})?(tltl-run [^\n#]*)", text, re.MULTILINE) + re.findall(
            r"`(tltl-run [^`]*)`", text
        )
        found |= {" ".join(command.split()[1:]) for command in typed}
    there = r"experiment=[a-z_]+(?!\S)|task=(gymnasium|suite|examples/\S+)(?!\S)"
    return sorted(c for c in found if re.match(there, c))


@pytest.mark.parametrize("command", commands())
def test_every_command_of_the_pages_has_keys_and_values_that_are_there(command, monkeypatch):
    """Those that train for long, too; what the spec of a reader's own says is another matter."""
    monkeypatch.chdir(ROOT)
    assert compose([as_meant(override) for override in shlex.split(command)])


def test_every_page_is_in_the_site():
    index = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    entries = [line for tree in FENCE.findall(index) for line in tree.splitlines()[1:-1] if line and line[0] != ":"]
    listed = {(ROOT / "docs" / f"{entry}.md").resolve() for entry in entries}
    assert len(listed) == len(entries)
    assert listed == {*PAGES} - {ROOT / "docs/index.md"}


@pytest.mark.parametrize("name", ["reach_avoid", "visit_in_order", "toast"])
def test_the_page_of_tasks_lists_their_signals(name):
    page = (ROOT / "docs/tasks.md").read_text(encoding="utf-8")
    (section,) = (part for part in page.split("\n## ") if f"`{name}`" in part.splitlines()[0])
    entry = TASKS.get(name)
    task = entry.make(entry.config())
    features = np.zeros((1, 1, task.width))
    signals = task.signals(features, np.zeros((1, 1, len(task.command_scale))))
    rows = [
        f"| `{signal}{'' if values.ndim == 2 else f'[{values.shape[-1]}]'}` | {task.units[signal]} |"
        for signal, values in signals.items()
    ]
    assert [row for row in section.splitlines() if row.startswith("| `")] == [
        next(line for line in section.splitlines() if line.startswith(row)) for row in rows
    ]
    assert f"{task.steps}" in section


def unindented(code):
    return "\n".join(line.strip() for line in code.splitlines() if line.strip())


def test_the_page_on_tasks_in_python_shows_code_that_runs():
    page = (ROOT / "docs/task-in-python.md").read_text(encoding="utf-8")
    folder = ROOT / "examples/two_link"
    shown = re.findall(r"^```(python|toml)\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    code = {"python": folder / "src/two_link/task.py", "toml": folder / "pyproject.toml"}
    assert len(shown) == 7
    for language, block in shown:
        assert unindented(block) in unindented(code[language].read_text(encoding="utf-8"))
    assert re.search(r"^    python -c .*$", page, re.MULTILINE)[0] in (folder / "README.md").read_text(encoding="utf-8")
