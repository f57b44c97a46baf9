"""Measures the page of `seedbed explore` in headless Chromium without GPU: time of a brush and of the first picture, size of the page.

    python3 -m venv venv && venv/bin/pip install selenium==4.41.0
    venv/bin/python benches/explorer.py target/release/seedbed

Trains eight agents on the cart-pole for 700 episodes, about a million states. Times are medians of 40 brushes, with 90 % below the second number; they
include selection, drawing and reading a pixel of the finished picture.
"""

import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.support.wait import WebDriverWait

BRUSHES = """
explorer.change({ color: arguments[0] });
const axis = explorer.view.axes[2];
const times = [];
for (let i = 0; i < 40; i++) {
  const start = performance.now();
  explorer.setBrush(axis, [1000 * i, 1000 * i + 20000]);
  explorer.draw();
  explorer.panels[0].canvas.getContext("2d").getImageData(0, 0, 1, 1);
  times.push(performance.now() - start);
}
explorer.reset();
return times;
"""


def start_browser() -> webdriver.Chrome:
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for argument in ["--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1400,1000", "--disable-background-networking", "--disable-component-update"]:
        options.add_argument(argument)
    return webdriver.Chrome(options=options, service=webdriver.ChromeService("/usr/bin/chromedriver"))


def open_page(browser: webdriver.Chrome, path: Path) -> float:
    """Opens a page and returns the milliseconds until its first picture."""
    browser.get("about:blank")
    browser.get(path.as_uri())
    WebDriverWait(browser, 60).until(lambda _: browser.execute_script("return document.documentElement.dataset.ready"))
    return browser.execute_script("return Number(document.documentElement.dataset.ready)")


def main() -> None:
    seedbed = sys.argv[1]
    with tempfile.TemporaryDirectory() as name:
        run = Path(name) / "run"
        subprocess.run([seedbed, "run", "cartpole", "--quiet", "--set", "agents.count=8", "--set", "stop=Episodes(700)", "--out", run], check=True)
        browser = start_browser()
        try:
            for label, options in [("200,000 states", []), ("all states", ["--all"])]:
                page = Path(name) / "page.html"
                printed = subprocess.run([seedbed, "explore", run, "--out", page, *options], check=True, capture_output=True, text=True).stdout
                first = statistics.median(open_page(browser, page) for _ in range(5))
                print(f"{label}: {page.stat().st_size / 1e6:.2f} MB, first picture after {first:.0f} ms ({printed.split(': ', 1)[1].strip()})")
                for color in ["density", "agent", "return", "difference"]:
                    times = sorted(browser.execute_script(BRUSHES, color))
                    print(f"  brush, colored by {color}: {times[20]:.0f} ms, {times[36]:.0f} ms")
        finally:
            browser.quit()


main()
