"""Every block of code and every command of the pages, and which test runs it."""

import argparse
import importlib
import re
import shlex
from pathlib import Path

import pytest

from tltlrl.cli import main as cli

ROOT = Path(__file__).parents[1]
README = "tests/test_readme.py::"
DOCS = "tests/test_docs.py::"
HERE = "tests/test_blocks.py::"
LANGUAGE = "tests/logic/test_language_page.py::"
COMPOSED = f"{DOCS}test_every_command_of_the_pages_has_keys_and_values_that_are_there"
OPTIONS = f"{HERE}test_every_other_command_of_the_pages_has_arguments_that_are_there"
EXAMPLES = "tests/examples/test_examples.py::test_an_example_trains_and_goes_on_where_it_was_stopped"
LAST = f"{README}test_the_page_of_a_package_index_needs_no_checkout"

# page => kind of block => how many there are, and the tests that run them, or why none can. The kind of a block in ```
# is written there; an indented one is "indented".
BLOCKS: dict[str, dict[str, tuple[int, str]]] = {
    "README.md": {"sh": (2, f"{README}test_reproduce_figures_in_small {README}test_write_your_own_spec")},
    "CONTRIBUTING.md": {"indented": (1, f"{HERE}test_the_entry_point_of_contributing")},
    "docs/api.md": {
        "python": (1, f"{README}test_python_code_says_what_it_gives"),
        "{eval-rst}": (4, f"{HERE}test_what_the_reference_describes_is_there"),
    },
    "docs/bring-your-robot.md": {
        "sh": (3, "tests/cli/test_new_robot.py::test_the_page_on_robots_as_written"),
        "yaml": (1, "tests/cli/test_new_robot.py::test_the_page_on_robots_as_written"),
        "indented": (3, f"tests/cli/test_new_robot.py::test_the_page_on_robots_as_written {COMPOSED} {OPTIONS}"),
    },
    "docs/clusters.md": {
        "sh": (
            2,
            "tests/experiments/test_distributed.py::test_the_clusters_pages_commands "
            "tests/experiments/test_distributed.py::test_the_certificate_of_the_page_is_what_dask_asks_for",
        ),
        "sbatch": (1, "tests/experiments/test_distributed.py::test_the_clusters_pages_commands"),
        "indented": (
            2,
            f"{COMPOSED} tests/experiments/test_distributed.py::test_the_launchers_of_the_page_have_its_keys",
        ),
    },
    "docs/comparing.md": {"sh": (1, f"{README}test_comparing_rewards")},
    "docs/configs.md": {
        "": (1, f"{README}test_an_experiment_of_ones_own_as_documented"),
        "yaml": (1, f"{README}test_an_experiment_of_ones_own_as_documented"),
        "indented": (1, f"{README}test_an_experiment_of_ones_own_as_documented"),
    },
    "docs/covariance.md": {"indented": (1, OPTIONS)},  # hours
    "docs/getting-started.md": {
        "sh": (4, f"{README}test_getting_started_has_the_readmes_spec_and_commands"),
        "tltl": (1, f"{README}test_getting_started_has_the_readmes_spec_and_commands"),
    },
    "docs/index.md": {"{toctree}": (6, f"{DOCS}test_every_page_is_in_the_site")},
    "docs/online.md": {
        "python": (1, "tests/logic/online/test_online_page.py::test_the_pages_code_does_what_it_says"),
        "indented": (
            6,
            "tests/logic/online/test_online_page.py::test_what_a_formula_asks_of_now_and_of_the_next_sample "
            "tests/logic/online/test_online_page.py::test_a_robot_is_watched "
            "tests/test_gym.py::test_the_pages_environments "
            "and the line on alpha is mathematics: tests/logic/online compare its values with whole evaluations",
        ),
    },
    "docs/package.md": {"sh": (1, f"{LAST} {OPTIONS}"), "python": (1, LAST)},  # pip install asks an index
    "docs/reading.md": {
        "sh": (1, "tests/cli/test_commands.py::test_the_page_on_reading_results_names_commands_that_work"),
    },
    "docs/results.md": {"indented": (1, f"{COMPOSED} {OPTIONS}")},  # an hour; test_claims runs studies.claims
    "docs/search.md": {
        "sh": (2, "tests/experiments/test_search.py::test_the_commands_of_the_page"),
        "": (1, "what a search of an hour printed"),
    },
    "docs/spec-case-study.md": {"tltl": (6, f"{LANGUAGE}test_specs {LANGUAGE}test_the_specs_are_the_files")},
    "docs/spec-examples.md": {
        "tltl": (12, "tests/logic/test_examples_page.py::test_example"),
        "csv": (24, "tests/logic/test_examples_page.py::test_example"),
    },
    "docs/spec-language.md": {
        "python": (4, f"{LANGUAGE}test_python"),
        "tltl": (2, f"{LANGUAGE}test_specs"),
        "text": (1, f"{LANGUAGE}test_the_message"),
    },
    "docs/task-in-python.md": {
        "python": (6, f"{DOCS}test_the_page_on_tasks_in_python_shows_code_that_runs"),
        "toml": (1, f"{DOCS}test_the_page_on_tasks_in_python_shows_code_that_runs"),
        "indented": (1, f"{DOCS}test_the_page_on_tasks_in_python_shows_code_that_runs"),
    },
    "docs/toast-notes.md": {"sh": (1, f"{COMPOSED} {OPTIONS}")},  # an hour
    "examples/ball_in_cup/README.md": {"indented": (1, f"{EXAMPLES} {OPTIONS}")},
    "examples/cartpole/README.md": {"indented": (1, f"{EXAMPLES} {OPTIONS}")},
    "examples/mountain_car/README.md": {"indented": (1, f"{EXAMPLES} {OPTIONS}")},
    "examples/jaco/README.md": {"indented": (1, f"{EXAMPLES} {OPTIONS}")},
    "examples/reacher/README.md": {"indented": (1, f"{EXAMPLES} {OPTIONS}")},
    "examples/stable_baselines3/README.md": {"indented": (1, f"{COMPOSED} tests/examples/test_stable_baselines3.py::")},
    "examples/two_link/README.md": {"indented": (2, "tests/examples/test_two_link.py::")},
}
PAGES = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for pattern in ("*.md", "docs/*.md", "runs/README.md", "examples/*/README.md")
    for path in sorted(ROOT.glob(pattern))
}
FENCE = re.compile(r"^```(.*)\n((?:.*\n)*?)```$", re.MULTILINE)
INDENTED = re.compile(r"(?<=\n\n)(?: {4}.*\n|\n(?= {4}))+")


def blocks(text):
    """The blocks of a page, as (kind, code)."""
    fenced = [(kind.strip(), code) for kind, code in FENCE.findall(text)]
    return [*fenced, *(("indented", code) for code in INDENTED.findall(FENCE.sub("", text)))]


def test_every_block_of_code_is_run_by_a_test_or_it_is_said_why_not():
    counted = {
        page: {kind: [found for found, _ in blocks(text)].count(kind) for kind, _ in blocks(text)}
        for page, text in PAGES.items()
    }
    assert {page: kinds for page, kinds in counted.items() if kinds} == {
        page: {kind: number for kind, (number, _) in kinds.items()} for page, kinds in BLOCKS.items()
    }


def test_the_tests_that_run_blocks_are_there():
    for kinds in BLOCKS.values():
        for _, tests in kinds.values():
            for path, name in re.findall(r"(tests/[\w/]+\.py)::(\w*)", tests):
                assert f"def {name}" in (ROOT / path).read_text(encoding="utf-8"), name


def commands():
    """Every command of the pages, in a block or among words, that is not tltl-run."""
    found = set()
    start = r"(?:tltl|make|python -m (?:studies|benchmarks)[\w.]*)(?= )"
    for text in PAGES.values():
        code = "".join(code for kind, code in blocks(text) if kind in ("sh", "indented")).replace("\\\n", " ")
        typed = re.findall(rf"^ *({start}.*?)(?: +#.*| \|.*)?$", code, re.MULTILINE)
        typed += re.findall(rf"`({start}[^`]+)`", text)
        found |= {" ".join(command.split()) for command in typed}
    return sorted(found)


class ArgumentsRead(Exception):
    """The arguments of a command are in order."""


@pytest.mark.parametrize("command", commands())
def test_every_other_command_of_the_pages_has_arguments_that_are_there(command, monkeypatch, capsys):
    """They are read as if typed, and nothing is done. Capitals and dots stand for what a reader puts there."""
    program, *words = shlex.split(re.sub(r"\bN\b", "1", command.replace("...", "")))
    if program == "make":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
        assert {word for word in words if "=" not in word} <= {*targets, ".venv/.ready"}
    elif program == "tltl":
        name, *arguments = words
        monkeypatch.setattr(importlib.import_module(f"tltlrl.cli.{name}"), "run", lambda _: 0)
        complete = any(not word.startswith("-") for word in arguments)
        with pytest.raises(SystemExit) as ended:
            cli.main(words if complete else [name, "--help"])
        assert ended.value.code == 0
        assert complete or {*arguments} <= {*re.findall(r"--[\w-]+", capsys.readouterr().out)}
    else:
        parse = argparse.ArgumentParser.parse_args

        def parsed(*arguments):
            parse(*arguments)
            raise ArgumentsRead

        monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parsed)
        with pytest.raises(ArgumentsRead):
            importlib.import_module(words[1]).main(words[2:])


def test_what_the_reference_describes_is_there():
    for code in (code for kind, code in blocks(PAGES["docs/api.md"]) if kind == "{eval-rst}"):
        for name in re.findall(r"^\.\. auto\w+:: (\S+)$", code, re.MULTILINE):
            module, _, attribute = name.rpartition(".")
            assert getattr(importlib.import_module(module), attribute).__doc__


def test_the_entry_point_of_contributing():
    ((_, code),) = blocks(PAGES["CONTRIBUTING.md"])
    shown = "\n".join(line.strip() for line in code.strip().splitlines())
    assert shown in (ROOT / "examples/two_link/pyproject.toml").read_text(encoding="utf-8")


# picture => what is typed to make it, on a page that shows it
PICTURES = {
    "docs/figure_3_3.png": "make reproduce-figures",
    "docs/figure_3_4.png": "make reproduce-figures",
    "docs/online.png": "python -m studies.online docs/online.png",
    "docs/reach_avoid_calm.gif": "tltl-run experiment=reach_avoid_best seeds=1",
    "docs/reach_avoid_calm.png": "tltl render runs/reach_avoid_best/tltl_episodic/seed_0",
    "docs/reach_avoid_learned.gif": "tltl-run experiment=reach_avoid_best seeds=1",
    "docs/reach_avoid_learned.png": "tltl render runs/reach_avoid_best/tltl_episodic/seed_0",
    "docs/reading_clauses.png": "tltl-run experiment=reach_avoid name=reading seeds=3 algorithm.iterations=60",
    "docs/reading_over_time.png": "tltl render runs/reading/tltl_episodic/seed_1",
    "docs/reading_workspace.png": "tltl-run experiment=reach_avoid name=reading seeds=3 algorithm.iterations=60",
    "docs/toast.png": "tltl render runs/toast/tltl_episodic/seed_0",
    "examples/cartpole/motion.png": "tltl render runs/cartpole/tltl_episodic/seed_0",
    "examples/jaco/workspace.png": "tltl render runs/jaco/tltl_episodic/seed_0",
    "examples/mountain_car/over_time.png": "tltl render runs/mountain_car/tltl_episodic/seed_0",
    "examples/reacher/motion.png": "tltl render runs/reacher/tltl_episodic/seed_0",
}


def test_every_picture_of_the_pages_is_made_by_a_command_that_is_named():
    shown = {
        (str((ROOT / page).parent.joinpath(link).resolve().relative_to(ROOT)), page)
        for page, text in PAGES.items()
        for link in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text)
    }
    assert {picture for picture, _ in shown} == {*PICTURES}
    for picture, command in PICTURES.items():
        assert any(command in PAGES[page] for other, page in shown if other == picture), picture
    assert {str(path.relative_to(ROOT)) for path in (ROOT / "docs").glob("*.[pg][ni][gf]")} <= {*PICTURES}
