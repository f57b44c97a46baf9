"""Examples in documentation work as they are printed."""

from __future__ import annotations

import doctest
import importlib.metadata
import re
from pathlib import Path
from types import ModuleType

import pytest
from conftest import REPOSITORY

import seedbed
from seedbed import (
    environment,
    gymnasium_task,
    making,
    parallel,
    policies,
    reading,
    recording,
    registration,
    seeding,
    spaces,
    state_files,
    studying,
    team,
    training,
    vector,
)

PAGES = [
    REPOSITORY / path
    for path in (
        "docs/python.md",
        "docs/python_training.md",
        "docs/python_studies.md",
        "docs/python_tasks.md",
        "docs/python_states.md",
        "docs/python_recording.md",
        "docs/python_runs.md",
        "docs/python_policies.md",
        "docs/from_stable_baselines3.md",
        "docs/own_algorithm_in_python.md",
        "docs/own_loop.md",
        "python/README.md",
    )
]
MODULES = [
    seedbed,
    environment,
    gymnasium_task,
    making,
    parallel,
    policies,
    reading,
    recording,
    registration,
    seeding,
    spaces,
    state_files,
    studying,
    team,
    training,
    vector,
]


def code_blocks(page: Path) -> list[tuple[int, str]]:
    """Line numbers and texts of the blocks of Python code of a page."""
    text = page.read_text()
    blocks = re.finditer(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    return [(text[: block.start()].count("\n") + 2, block[1]) for block in blocks]


def run_blocks(page: Path) -> int:
    """Runs the blocks of a page one after the other, like a reader; returns their number.

    Lines after `>>>` are examples whose output is compared.
    """
    names: dict = {}
    blocks = code_blocks(page)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    for line, text in blocks:
        if ">>>" in text:
            test = doctest.DocTestParser().get_doctest(text, names, page.name, str(page), line - 1)
            result = runner.run(test, clear_globs=False)
            assert result.failed == 0, f"{page.name}:{line}: the output differs"
            names.update(test.globs)
        else:
            exec(compile("\n" * (line - 1) + text, str(page), "exec"), names)
    return len(blocks)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    assert run_blocks(page) > 0


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_docstrings(module: ModuleType):
    assert doctest.testmod(module).failed == 0


def test_the_docstring_of_the_native_task():
    """Classes of the native part are found by `doctest` only by name."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    tests = finder.find(seedbed.Task, "Task", module=seedbed, globs={"seedbed": seedbed})
    assert sum(len(test.examples) for test in tests) >= 4
    runner = doctest.DocTestRunner()
    assert sum(runner.run(test).failed for test in tests) == 0


def test_public_names_are_documented():
    for name in seedbed.__all__:
        value = getattr(seedbed, name)
        assert isinstance(value, str) or value.__doc__, name
        if isinstance(value, type):
            for attribute, member in vars(value).items():
                if not attribute.startswith("_") and (callable(member) or isinstance(member, property)):
                    assert member.__doc__, f"{name}.{attribute}"


def test_the_package_has_the_licenses_of_the_repository():
    files = importlib.metadata.files("seedbed") or []
    licenses = {path.name: path.read_text() for path in files if path.name.startswith("LICENSE")}
    assert licenses == {path.name: path.read_text() for path in REPOSITORY.glob("LICENSE-*")}
    assert len(licenses) == 2
