"""The page with the viewer and a recording shows the run in Chromium."""

from __future__ import annotations

import importlib.metadata
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import seedbed

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]

# A software renderer needs long on a busy machine.
SECONDS = 300


@pytest.fixture
def browser() -> Iterator[Any]:
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for argument in [
        "--headless=new",
        "--no-sandbox",
        "--window-size=1000,700",
        "--no-first-run",
        "--disable-sync",
        "--disable-background-networking",
        "--disable-component-update",
        "--force-device-scale-factor=1",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
    ]:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService("/usr/bin/chromedriver"))
    browser.set_page_load_timeout(SECONDS)
    yield browser
    browser.quit()


def pixels(browser: Any) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB")).astype(int)


def colored_share(picture: np.ndarray) -> float:
    """Share of pixels that are not gray."""
    return float((picture.max(axis=2) - picture.min(axis=2) > 40).mean())


def test_the_page_shows_the_run(cartpole_run: Path, browser: Any, tmp_path: Path):
    from selenium.common.exceptions import TimeoutException
    from selenium.webdriver.support.wait import WebDriverWait

    page = seedbed.load(cartpole_run).to_html(tmp_path / "run.html")
    assert page.stat().st_size < 40_000_000 + 2 * (cartpole_run / "run.rrd").stat().st_size
    browser.get(page.as_uri())
    # While the page draws, it may not answer in time.
    wait = WebDriverWait(browser, SECONDS, poll_frequency=1, ignored_exceptions=[TimeoutException])
    wait.until(lambda _: browser.execute_script("return document.documentElement.dataset.ready"))
    assert browser.title == "cartpole, run seed 0"
    # Views of visited states are colored: lines of four agents, and densities. The viewer's own widgets are gray.
    wait.until(lambda _: colored_share(pixels(browser)) > 0.05)
    errors = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert errors == []


def test_the_page_needs_nothing_else(cartpole_run: Path, tmp_path: Path):
    run = seedbed.load(cartpole_run)
    first, second = run.to_html(tmp_path / "a.html"), run.to_html(tmp_path / "b.html")
    assert first.read_bytes() == second.read_bytes(), "the same recording gives the same page"
    assert not re.search(r'<(script|link|img)[^>]*(src|href)="(?!data:)', first.read_text())


def test_other_versions_of_the_viewer_are_refused(cartpole_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "0.40.0")
    with pytest.raises(ImportError, match=r"needs rerun-notebook 0\.36\.3: .*; version 0\.40\.0 is installed"):
        seedbed.load(cartpole_run).to_html(tmp_path / "page.html")


def test_notebooks_show_the_page_of_visited_states(cartpole_run: Path, browser: Any, tmp_path: Path):
    """The output of a cell, in a page of its own. Brushes work there, although the frame has no address."""
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.wait import WebDriverWait

    page = seedbed.load(cartpole_run).explore(tmp_path / "explore.html", states=2000)
    (tmp_path / "output.html").write_text(f"<!doctype html><meta charset=utf-8>{page._repr_html_()}", encoding="utf-8")
    browser.get((tmp_path / "output.html").as_uri())
    browser.switch_to.frame(browser.find_element(By.TAG_NAME, "iframe"))
    WebDriverWait(browser, SECONDS, poll_frequency=1).until(lambda _: browser.find_elements(By.TAG_NAME, "canvas"))
    assert colored_share(pixels(browser)) > 0.01
    button = next(each for each in browser.find_elements(By.TAG_NAME, "button") if each.is_displayed())
    button.click()
