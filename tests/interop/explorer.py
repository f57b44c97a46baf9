"""Opens a page of `seedbed explore` in Chromium and in Firefox and uses it: counts under brushes must equal those of the
exported states, everything must work with the keyboard alone, and the picture must be the stored one.

Usage: explorer.py SEEDBED RUN GECKODRIVER [--update]
"""

import base64
import csv
import io
import json
import random
import re
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path
from urllib.parse import quote

import numpy as np
from PIL import Image
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.select import Select
from selenium.webdriver.support.wait import WebDriverWait

PICTURE = Path(__file__).parent / "explorer.png"
MAX_LEVEL = 65534
# The context of a copy of a canvas, because browsers warn of pages that read their own canvases often.
READ_CANVAS = """window.contextOf = (canvas) => {
    const { width, height } = canvas, copy = Object.assign(document.createElement("canvas"), { width, height });
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(canvas, 0, 0);
    return context;
};"""


Browser = webdriver.Chrome | webdriver.Firefox


def start_chromium() -> webdriver.Chrome:
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for argument in [
        "--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1400,1000", "--no-first-run", "--disable-sync",
        "--disable-background-networking", "--disable-component-update", "--force-device-scale-factor=1",
    ]:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(options=options, service=webdriver.ChromeService("/usr/bin/chromedriver"))


def start_firefox(geckodriver: str, log: Path) -> webdriver.Firefox:
    options = webdriver.FirefoxOptions()
    options.binary_location = "/usr/bin/firefox-esr"
    options.add_argument("--headless")
    # Messages of pages are in the log of the driver, which has no other way to them.
    options.set_preference("devtools.console.stdout.content", True)
    browser = webdriver.Firefox(options=options, service=webdriver.FirefoxService(geckodriver, log_output=str(log)))
    browser.set_window_size(1400, 1000)
    browser.log_of_driver = log
    return browser


def messages(browser: Browser) -> list[str]:
    """Errors and warnings of pages since the last call in Chromium, since the start in Firefox."""
    if isinstance(browser, webdriver.Firefox):
        lines = browser.log_of_driver.read_text().splitlines()
        # Not those of the browser itself.
        return [line for line in lines if re.match(r"JavaScript (error|warning): file:", line)]
    return [entry["message"] for entry in browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]


class Page:
    """An opened page."""

    def __init__(self, browser: Browser, path: Path, address: str = ""):
        self.browser = browser
        browser.get("about:blank")
        browser.get(f"{path.as_uri()}#{address}" if address else path.as_uri())
        WebDriverWait(browser, 60).until(lambda _: self.run("return document.documentElement.dataset.ready"))
        self.run(READ_CANVAS)

    def run(self, script: str, *arguments: object) -> object:
        return self.browser.execute_script(script, *arguments)

    def show(self, address: str) -> None:
        """Shows the view after # in an address."""
        self.run("fromHash(explorer, arguments[0]); explorer.draw();", address)

    def find(self, selector: str) -> WebElement:
        return self.browser.find_element(By.CSS_SELECTOR, selector)

    def press(self, *keys: str) -> None:
        ActionChains(self.browser).send_keys(*keys).perform()

    def counts(self, panel: int = 0) -> list[int]:
        """Numbers of selected states, all states, episodes, terminated episodes and agents, as shown."""
        text = self.run("return explorer.panels[arguments[0]].counts.textContent", panel)
        pattern = r"([\d,]+) of ([\d,]+) states?.*?, ([\d,]+) episodes? \(([\d,]+) terminated.*?\), ([\d,]+) agents?"
        return [int(number.replace(",", "")) for number in re.fullmatch(pattern, text).groups()]

    def errors(self) -> list[str]:
        return messages(self.browser)


def write_page(seedbed: str, out: Path, *runs: Path) -> Path:
    subprocess.run([seedbed, "explore", *runs, "--out", out], check=True, stdout=subprocess.DEVNULL)
    return out


def read_states(seedbed: str, run: Path, folder: Path) -> tuple[dict[str, np.ndarray], list[dict[str, str]]]:
    subprocess.run([seedbed, "export", run, "--to", folder / "states.npz"], check=True, stdout=subprocess.DEVNULL)
    states = {name.replace("_", " ") if name == "intrinsic_reward" else name: column for name, column in np.load(folder / "states.npz").items()}
    with (run / "episodes.csv").open() as file:
        episodes = list(csv.DictReader(file))
    returns = {(int(row["agent"]), int(row["episode"])): float(row["return"]) for row in episodes}
    states["return"] = np.array([returns[key] for key in zip(states["agent"].tolist(), states["episode"].tolist())], dtype=np.float32)
    return states, episodes


def expected_counts(states: dict[str, np.ndarray], brushes: list[tuple[str, float, float]], agents: list[int], episodes: tuple[int, int]) -> list[int]:
    """What `Page.counts` must be: the exported values within all ranges, compared in double precision."""
    selected = np.isin(states["agent"], agents) & (states["episode"] >= episodes[0]) & (states["episode"] <= episodes[1])
    for name, low, high in brushes:
        values = states[name].astype(np.float64)
        selected &= (values >= low) & (values <= high)
    keys = set(zip(states["agent"][selected].tolist(), states["episode"][selected].tolist(), states["outcome"][selected].tolist()))
    terminated = sum(outcome == "terminated" for _, _, outcome in keys)
    return [int(selected.sum()), len(selected), len(keys), terminated, len(set(states["agent"][selected].tolist()))]


def check_random_brushes(page: Page, states: dict[str, np.ndarray], rng: random.Random) -> None:
    axes = page.run("return explorer.axes")
    agent_count, last = int(states["agent"].max()) + 1, int(states["episode"].max())
    with_states = 0
    for _ in range(10):
        brushes = []
        for axis in rng.sample(axes, rng.randint(1, 3)):
            # Ends half way between two levels, as the page's own ranges have them.
            low, high = sorted(rng.sample(range(1, MAX_LEVEL), 2))
            value = lambda level: axis["low"] + (level + 0.5) / MAX_LEVEL * (axis["high"] - axis["low"])
            brushes.append((axis["name"], value(low), value(high)))
        agents = sorted(rng.sample(range(agent_count), rng.randint(1, agent_count)))
        episodes = tuple(sorted(rng.sample(range(last + 1), 2)))
        ranges = ",".join(f"{quote(name)}:{low!r}:{high!r}" for name, low, high in brushes)
        page.show(f"brush={ranges}&agents={','.join(map(str, agents))}&episodes={episodes[0]}-{episodes[1]}")
        expected = expected_counts(states, brushes, agents, episodes)
        assert page.counts() == expected, (brushes, agents, episodes, page.counts(), expected)
        with_states += expected[0] > 0
        # The address holds the view.
        address = page.run("return toHash(explorer)")
        page.show("")
        page.show(address)
        assert page.counts() == expected, address
    assert with_states >= 5, "most random brushes select states"


def check_ranges_of_brushes(page: Page, states: dict[str, np.ndarray], rng: random.Random) -> None:
    """The range in the address of a brush has exactly the values that the brush selects, compared as numbers."""
    axes = page.run("return explorer.axes")
    agents, last = sorted(set(states["agent"].tolist())), int(states["episode"].max())
    for _ in range(20):
        a = rng.randrange(len(axes))
        # Levels of values, so that states are at the ends of the brush.
        numbers = states[axes[a]["name"]][np.isfinite(states[axes[a]["name"]])].tolist()
        levels = sorted(page.run("return levelOf(explorer.axes[arguments[0]], arguments[1])", a, float(rng.choice(numbers))) for _ in range(2))
        if levels == [0, MAX_LEVEL]:
            continue  # the whole axis, which also selects states without a value
        page.show("")
        low, high = page.run("return rangeTexts(explorer.axes[arguments[0]], arguments[1])", a, levels)
        page.run("explorer.setBrush(arguments[0], arguments[1]); explorer.draw();", a, levels)
        brushes = [(axes[a]["name"], float(low or "-inf"), float(high or "inf"))]
        expected = expected_counts(states, brushes, agents, (0, last))
        assert page.counts() == expected, (axes[a]["name"], levels, low, high, page.counts(), expected)


def check_written_ranges(page: Page, states: dict[str, np.ndarray]) -> None:
    """Ranges that people write include both of their ends, also after the page has written them in its address."""
    agents, last = sorted(set(states["agent"].tolist())), int(states["episode"].max())
    lowest = float(states["return"].min())
    for name, low, high in [("step", 0, 10), ("step", 7, 7), ("episode", 0, 49), ("episode", 3, last), ("return", 100, 150), ("return", lowest, 300)]:
        page.show(f"brush={name}:{low}:{high}")
        expected = expected_counts(states, [(name, low, high)], agents, (0, last))
        assert page.counts() == expected and expected[0] > 0, (name, low, high, page.counts(), expected)
        page.show(page.run("return toHash(explorer)"))
        assert page.counts() == expected, (name, low, high)


def check_difference(page: Page) -> None:
    """The difference is that from all agents, of which some may be hidden."""
    page.show("agents=1&color=difference&compared=1")
    drawn = page.run("return [explorer.panels[0].drawn.count, explorer.panels[0].selection.count]")
    assert drawn[0] > drawn[1] > 0, drawn
    page.show("agents=2")
    page.run("const color = document.getElementById('color'); color.value = 'difference'; color.onchange({ target: color }); explorer.draw();")
    assert page.run("return explorer.view.compared") == 2, "a shown agent is compared"
    page.show("")


def check_address(page: Page) -> None:
    """The page says which parts of an address it does not understand, and shows the others."""
    page.show("")
    page.run("location.hash = arguments[0]", "brush=speed:0:1,theta:-0.1:0.1&agents=x&colors=agent&axes=nothing%20here,theta,x&episodes=3")
    WebDriverWait(page.browser, 60).until(lambda _: page.find("#ignored").is_displayed())
    expected = "These parts of the address mean nothing here: colors=agent · brush=speed:0:1 · agents=x · episodes=3 · axes=nothing here"
    assert page.find("#ignored").text == expected, page.find("#ignored").text
    assert page.run("return explorer.view.axes.map((a) => explorer.axes[a].name).join()") == "theta,x"
    hidden = page.run("return explorer.axes.length") - 2
    assert page.run("return explorer.axesSummary.textContent") == f"Axes ({hidden} hidden)"
    page.run("location.hash = arguments[0]", "brush=theta:-0.1:0.1&agents=0")
    WebDriverWait(page.browser, 60).until(lambda _: not page.find("#ignored").is_displayed())
    page.show("")


def check_pointer(page: Page) -> None:
    """A drag along an axis selects, a drag of the range moves it, a click removes it."""
    page.show("")
    everything = page.counts()
    canvas = page.browser.find_element(By.CSS_SELECTOR, ".plot canvas")
    width, height = canvas.size["width"], canvas.size["height"]
    x = page.run("return explorer.panels[0].x(2)") - width / 2
    drag = lambda start, end: ActionChains(page.browser).move_to_element_with_offset(canvas, int(x), int(start * height)).click_and_hold().move_by_offset(0, 5).move_by_offset(0, int((end - start) * height) - 5).release().perform()
    drag(-0.1, 0.2)
    page.run("explorer.draw()")
    brush = page.run("return explorer.view.brushes[explorer.view.axes[2]]")
    assert brush and 0 < brush[0] < brush[1] < MAX_LEVEL and page.counts()[0] < everything[0], brush
    drag(0.05, 0.1)
    page.run("explorer.draw()")
    moved = page.run("return explorer.view.brushes[explorer.view.axes[2]]")
    assert moved[0] < brush[0] and abs((moved[1] - moved[0]) - (brush[1] - brush[0])) <= 1, (brush, moved)
    ActionChains(page.browser).move_to_element_with_offset(canvas, int(x), int(-0.2 * height)).click().perform()
    page.run("explorer.draw()")
    assert page.counts() == everything


def check_touch(page: Page) -> None:
    """A finger that moves along an axis selects."""
    page.show("")
    everything = page.counts()
    page.run("window.scrollTo(0, 0)")
    x, top, height = page.run("const { canvas } = explorer.panels[0]; const box = canvas.getBoundingClientRect(); return [box.left + explorer.panels[0].x(2), box.top, box.height];")
    page.browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True, "maxTouchPoints": 1})
    touch = lambda kind, points: page.browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    touch("touchStart", [{"x": x, "y": top + 0.35 * height}])
    for step in range(1, 8):
        touch("touchMove", [{"x": x, "y": top + (0.35 + 0.03 * step) * height}])
    touch("touchEnd", [])
    page.browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})
    page.run("explorer.draw()")
    assert 0 < page.counts()[0] < everything[0], page.counts()
    page.show("")


def check_keyboard(page: Page) -> None:
    """Every control is reached by Tab and works by keys."""
    page.show("")
    press = page.press
    everything = page.counts()
    page.run("document.querySelectorAll('details').forEach((menu) => (menu.open = false)); document.activeElement.blur(); scrollTo(0, 0);")
    reached = set()
    for _ in range(200):
        press(Keys.TAB)
        name = page.run("const e = document.activeElement; return e.id || e.getAttribute('aria-label') || e.textContent.trim();")
        if name in reached:
            break
        reached.add(name)
    controls = {
        "color", "clear", "theme", page.run("return explorer.axesSummary.textContent"), "Share", "Help", "all-agents", "agent-list", "play", "from", "to", "Type a range",
        "Horizontal axis of the scatter plot", "Vertical axis of the scatter plot", "Scatter plot per agent",
        "Filmed episode", "Play the film", "Step of the filmed episode",
    }
    axes = page.run("return explorer.view.axes.map((a) => axisTitle(explorer.axes[a]))")
    handles = {f"{axis}, {end} end" for axis in axes for end in ("lower", "upper")}
    chips = {name for name in reached if name.startswith("agent ")}
    assert controls | handles <= reached, (controls | handles) - reached
    assert len(chips) == page.run("return explorer.agentCount"), chips

    focus = lambda selector: page.run("document.querySelector(arguments[0]).focus()", selector)
    focus("details:has(#copy-link) summary")
    press(Keys.ENTER)
    for name in ("copy-link", "copy-command", "save-png", "save-svg"):
        press(Keys.TAB)
        assert page.run("return document.activeElement.id") == name
    press(Keys.ESCAPE)
    assert page.run("return [document.querySelectorAll('details[open]').length, document.activeElement.textContent]") == [0, "Share"]
    focus(f'.handle[aria-label="{axes[1]}, lower end"]')
    press(*[Keys.ARROW_UP] * 60)
    page.run("explorer.draw()")
    fewer = page.counts()
    assert 0 < fewer[0] < everything[0], fewer
    press(Keys.DELETE)
    page.run("explorer.draw()")
    assert page.counts() == everything
    focus(".chip")
    press(Keys.SPACE)
    page.run("explorer.draw()")
    assert page.counts()[4] == everything[4] - 1
    focus("#to")
    press(Keys.HOME)
    page.run("explorer.draw()")
    assert page.run("return explorer.view.to") == 0
    focus("#play")
    press(Keys.ENTER)
    WebDriverWait(page.browser, 60).until(lambda _: page.run("return explorer.view.to === explorer.view.last && !explorer.playing"))
    focus("#color")
    press("d", "i")
    assert page.run("explorer.draw(); return explorer.view.color") == "difference"
    focus("#clear")
    press(Keys.ENTER)
    page.run("explorer.draw()")
    assert page.counts() == everything and page.run("return explorer.view.color") == "density"


def check_files(page: Page) -> None:
    """The picture as SVG is well-formed and names all axes; a command is printed."""
    page.show("brush=theta:-0.1:0.1&agents=0,1&episodes=0-9&color=agent")
    svg = page.run("return toSvg(explorer)")
    assert svg.startswith("<svg ") and page.run("return new DOMParser().parseFromString(arguments[0], 'image/svg+xml').querySelector('parsererror')", svg) is None
    for axis in page.run("return explorer.view.axes.map((a) => axisTitle(explorer.axes[a]))"):
        assert axis in svg, axis
    size = page.browser.execute_async_script("const done = arguments[0]; toPng(explorer).then((blob) => done(blob.size));")
    assert size > 10_000, size
    command = page.run("return toCommand(explorer)")
    assert "--agents 0,1 --episodes 0..10 --where theta=-0.1" in command, command
    renamed = page.run("const axes = explorer.axes.map((a) => ({ ...a, name: 'x' })); return axes.map((_, a) => commandName(axes, a))")
    assert renamed == page.run("return explorer.axes.map((a) => a.kind + ':x')"), renamed


def check_film(page: Page) -> None:
    """The pointer shows the filmed state that is nearest, a menu and a slider choose one, and films are played."""
    page.show("")
    shown = lambda: page.run("const { state, filmed } = explorer.panels[0].player; return [filmed.agent, filmed.episode, state - filmed.first]")
    canvas = page.find(".plot canvas")
    seen = set()
    for share in (-0.3, 0.0, 0.25):
        ActionChains(page.browser).move_to_element_with_offset(canvas, -150, int(share * canvas.size["height"])).perform()
        seen.add(tuple(shown()))
    assert len(seen) >= 2, seen
    is_drawn = lambda selector: page.run("const c = document.querySelector(arguments[0]); return contextOf(c).getImageData(0, 0, c.width, c.height).data.some((value) => value > 0)", selector)
    assert is_drawn(".scene") and is_drawn(".plot .mark") and is_drawn(".pair .mark"), "the scene, the line and the dot are not empty"

    episodes = page.run("return explorer.runs[0].film.episodes")
    menu = Select(page.find(".filmed"))
    assert len(menu.options) == len(episodes) >= 2
    menu.select_by_index(len(episodes) - 1)
    last = episodes[-1]
    assert shown() == [last["agent"], last["episode"], 0], shown()
    page.run("const slider = document.querySelector('.step'); slider.value = 7; slider.oninput();")
    assert shown()[2] == 7 and page.find(".film output").text == f"step 7 of {last['count'] - 1}"
    # The dot is where the state is.
    axes = page.run("return explorer.view.scatter")
    x, y = (page.run("return explorer.runs[0].film.levels[arguments[0]][arguments[1]]", a, last["first"] + 7) / MAX_LEVEL for a in axes)
    color = page.run("""
        const { scatter, app } = explorer.panels[0], [plot] = scatter.plots;
        const data = contextOf(scatter.mark).getImageData(plot.left + arguments[0] * plot.width, plot.top + (1 - arguments[1]) * plot.height, 1, 1).data;
        return [[...data].slice(0, 3), agentColor(app.theme, arguments[2])];""", x, y, last["agent"])
    assert color[0] == color[1], color
    longest = max(range(len(episodes)), key=lambda f: episodes[f]["count"])
    menu.select_by_index(longest)
    assert page.run(COLOR_OF_BODY, [51, 170, 51]) == [51, 170, 51, 255], "bodies have the colors of their task"
    button, end = page.find(".play-film"), episodes[longest]["count"] - 1
    assert end > 50
    page.run("arguments[0].click()", button)
    WebDriverWait(page.browser, 60, 0.05).until(lambda _: shown()[2] > 2)
    assert button.text == "Pause"
    page.run("arguments[0].click()", button)
    paused = shown()
    page.browser.execute_async_script("setTimeout(arguments[0], 200)")
    assert shown() == paused and 2 < paused[2] < end and button.text == "Play", paused
    page.run("explorer.panels[0].player.show(arguments[0]); arguments[1].click()", episodes[longest]["first"] + end - 3, button)
    WebDriverWait(page.browser, 60).until(lambda _: shown()[2] == end and button.text == "Play")


COLOR_OF_BODY = """
const context = Object.assign(document.createElement("canvas"), { width: 40, height: 40 }).getContext("2d");
const square = { points: [[-9, -9], [9, -9], [9, 9], [-9, 9]], thickness: null };
drawShape(context, square, ([x, y]) => [20 + x, 20 + y], colorOf({ color: arguments[0], fixed: false }), 1);
return [...context.getImageData(20, 20, 1, 1).data];"""
"""The color of the pixels of a body to which its task gives a color."""


def check_films(browser: Browser, seedbed: str, folder: Path) -> None:
    """The films of all agents can be chosen. The fixed bodies of a task are behind states on its coordinates, and only there."""
    run = folder / "corridors"
    settings = ["stop=Episodes(2)", "agents.count=2", "recording.scene.agents=[0,1]", "recording.scene.every=1"]
    subprocess.run([seedbed, "run", "corridors", *(word for setting in settings for word in ("--set", setting)), "--out", run], check=True, capture_output=True)
    page = Page(browser, write_page(seedbed, folder / "corridors.html", run))
    titles = [option.text for option in Select(page.find(".filmed")).options]
    assert {title.split(", return")[0] for title in titles} == {f"agent {agent}, episode {episode}" for agent in (0, 1) for episode in (0, 1)}, titles
    names = lambda: page.run("return explorer.view.scatter.map((a) => axisTitle(explorer.axes[a]))")
    assert names() == ["x [m]", "y [m]"]
    plots = "explorer.draw(); const { scatter } = explorer.panels[0], [x, y] = explorer.view.scatter.map((a) => explorer.axes[a]); const { left, top, width, height } = scatter.plots[0];"
    # The middle of the triangle between the corridors to the east and to the northeast is a wall, the corridor to the east is none.
    pixels = plots + """
        const at = (px, py) => [...contextOf(scatter.canvas).getImageData(left + (px - x.low) / (x.high - x.low) * width, top + (y.high - py) / (y.high - y.low) * height, 1, 1).data];
        return [at(4, 1.8)[3], at(5.9, 0.3)[3], width / (x.high - x.low), height / (y.high - y.low)];"""
    wall, corridor, *scales = page.run(pixels)
    assert wall == 255 and corridor == 0 and abs(scales[0] - scales[1]) < 1e-6, (wall, corridor, scales)
    page.show("scatter=y,x")
    assert page.run(plots + "return scatter.scenery().length") == 0
    assert page.errors() == [], page.errors()


def pairs_of_bins(axes: list[dict], columns: list[np.ndarray], is_selected: np.ndarray) -> dict[tuple[int, int], np.ndarray]:
    """Indices of the selected states per pair of bins of two axes."""
    bins = []
    for axis, column in zip(axes, columns):
        share = (column[is_selected].astype(np.float64) - axis["low"]) / (axis["high"] - axis["low"])
        bins.append(np.floor(np.clip(share, 0, 1) * MAX_LEVEL + 0.5).astype(int) * 96 >> 16)
    pairs: dict[tuple[int, int], list[int]] = {}
    for index, *pair in zip(np.flatnonzero(is_selected).tolist(), *(bin.tolist() for bin in bins)):
        pairs.setdefault(tuple(pair), []).append(index)
    return {pair: np.array(indices) for pair, indices in pairs.items()}


def check_scatter(page: Page, states: dict[str, np.ndarray]) -> None:
    """Menus choose the axes; each plot has the bins of exported states, and one per agent those of the agent."""
    page.show("")
    axes = page.run("return explorer.axes")
    names = [axis["name"] for axis in axes]
    assert page.run("return explorer.view.scatter") == [0, 1], "the first two observations"
    for selector, name in ((".pair .x", "theta"), (".pair .y", "theta_dot")):
        Select(page.find(selector)).select_by_value(str(names.index(name)))
    page.find(".each input").click()
    page.run("explorer.draw()")
    address = page.run("return toHash(explorer)")
    assert address == "scatter=theta,theta_dot&per=agent", address
    pixels = """explorer.draw(); return explorer.panels[0].scatter.plots.map(({ agent, count, image }) => {
        const { data } = contextOf(image).getImageData(0, 0, 96, 96), pairs = [];
        for (let i = 0; i < 96 * 96; i++) if (data[4 * i + 3]) pairs.push([i % 96, 95 - Math.floor(i / 96)]);
        return [agent, count, pairs]; });"""
    pair = [axes[names.index(name)] for name in ("theta", "theta_dot")]
    page.show(f"{address}&brush=theta:-0.1:0.1,theta_dot:-1:&agents=0-2&episodes=3-40")
    plots = page.run(pixels)
    assert [agent for agent, _, _ in plots] == [0, 1, 2]
    selected = (states["theta"] >= -0.1) & (states["theta"] <= 0.1) & (states["theta_dot"] >= -1)
    context = (states["episode"] >= 3) & (states["episode"] <= 40)
    for agent, count, pairs in plots:
        of_agent = context & (states["agent"] == agent)
        assert count == int((of_agent & selected).sum()) > 0, (agent, count)
        assert {tuple(bins) for bins in pairs} == set(pairs_of_bins(pair, [states["theta"], states["theta_dot"]], of_agent)), agent
    for color in ("agent", "outcome", "difference"):
        page.show(f"{address}&color={color}")
        assert len(page.run(pixels)) == len(set(states["agent"].tolist())), color
    page.show("scatter=theta,theta_dot")
    [[agent, count, pairs]] = page.run(pixels)
    assert (agent, count) == (None, len(states["theta"]))
    page.show("")
    assert page.run("return toHash(explorer)") == ""


def check_colors(page: Page, states: dict[str, np.ndarray]) -> None:
    """Outcomes have a color each. The color of an episode is that of the mean, so that early episodes are not hidden."""
    page.show("color=outcome")
    outcomes = {(int(agent), int(episode)): outcome for agent, episode, outcome in zip(states["agent"], states["episode"], states["outcome"].tolist())}
    classes = page.run("""
        const [run] = explorer.runs, { agent, episode } = run.episodes, { classes } = classesOf(run, explorer.view, explorer.theme);
        return Array.from(classes, (index, e) => [agent[e], episode[e], ["terminated", "truncated"][index]]);""")
    assert {(agent, episode): name for agent, episode, name in classes} == outcomes and len(set(outcomes.values())) == 2
    assert "terminated" in page.find("#key").text and "truncated" in page.find("#key").text
    assert "--color outcome" in page.run("return toCommand(explorer)")
    page.show("color=episode&scatter=x,theta")
    axes = page.run("return explorer.view.scatter.map((a) => explorer.axes[a])")
    pairs = pairs_of_bins(axes, [states["x"], states["theta"]], np.ones(len(states["x"]), dtype=bool))
    spread = max(pairs, key=lambda pair: np.ptp(states["episode"][pairs[pair]]))
    last = int(states["episode"].max())
    mean = states["episode"][pairs[spread]].mean() / last
    color, expected = page.run("""
        const panel = explorer.panels[0], [bin, other, mean] = arguments;
        return [panel.painter.colorsOfPairs(...explorer.view.scatter, panel.drawn)[96 * bin + other], explorer.theme.sequentialTable[Math.round(255 * mean)]];""", *spread, mean)
    assert np.ptp(states["episode"][pairs[spread]]) > last / 2 and np.abs(np.array(color) - expected).max() < 3, (color, expected)


def check_typed_ranges(page: Page, states: dict[str, np.ndarray]) -> None:
    """Ranges are typed, changed and removed; a range without values is refused."""
    page.show("")
    everything = page.counts()
    axes = page.run("return explorer.axes.map((axis) => axis.name)")
    brush = lambda: page.run("explorer.draw(); return explorer.view.brushes[arguments[0]]", axes.index("theta"))
    written = lambda low, high: page.run("return brushOf(explorer.axes[arguments[0]], arguments[1] ?? -Infinity, arguments[2])", axes.index("theta"), low, high)
    agents, last = sorted(set(states["agent"].tolist())), int(states["episode"].max())
    canvas = page.find(".plot canvas")
    theta = page.run("return explorer.view.axes.findIndex((a) => explorer.axes[a].name === 'theta')")
    x = page.run("return explorer.panels[0].x(arguments[0])", theta) - canvas.size["width"] / 2
    title = 30 - canvas.size["height"] / 2
    ActionChains(page.browser).move_to_element_with_offset(canvas, int(x), int(title)).double_click().perform()
    assert page.run("return document.activeElement.getAttribute('aria-label')") == "theta [rad], from"
    page.press("-0.05", Keys.TAB, "0.1", Keys.ENTER)
    assert brush() == written(-0.05, 0.1) and 0 < page.counts()[0] < everything[0], brush()
    inputs = lambda: page.run("return Array.from(document.querySelectorAll('#ranges input'), ({ value }) => value)")
    assert inputs() == ["-0.05", "0.1"], inputs()
    page.find("#ranges input").clear()
    page.press(Keys.TAB)
    assert brush() == written(None, 0.1), "an empty number is the end of the axis"
    page.run("document.querySelector('#ranges input').focus()")
    page.press("0.2", Keys.TAB)
    assert brush() == written(None, 0.1), "a range without values changes nothing"
    assert page.run("return document.querySelectorAll('#ranges :invalid').length") == 1
    page.find("#ranges button").click()
    page.run("explorer.draw()")
    assert page.counts() == everything and inputs() == []
    # Enter on an axis, and the menu.
    page.run("document.querySelector('.handle[aria-label=\"step, upper end\"]').focus()")
    page.press(Keys.ENTER)
    page.press("3", Keys.TAB, "5", Keys.TAB)
    page.run("explorer.draw()")
    assert page.counts() == expected_counts(states, [("step", 3, 5)], agents, (0, last))
    page.find("#add-range summary").click()
    page.find("#add-range button").click()
    page.run("document.activeElement.blur(); explorer.draw()")
    assert inputs() == ["3", "5"], "a range without numbers is not kept"
    # Ranges that were dragged are in the list, too.
    page.run("explorer.setBrush(0, [20000, 30000]); explorer.draw();")
    low, high, *_ = inputs()
    assert page.run("return brushOf(explorer.axes[0], arguments[0], arguments[1])", float(low), float(high)) == [20000, 30000], (low, high)
    page.show("")


def check_hint(browser: Browser, path: Path) -> None:
    """A hint says what to do until there is a range, in words for a finger on touch screens."""
    hint = lambda page: [element.text for element in page.browser.find_elements(By.CSS_SELECTOR, ".hint")]
    page = Page(browser, path)
    assert hint(page) == ["Drag along an axis to select states"], hint(page)
    page.run("explorer.setBrush(0, [20000, 30000]); explorer.draw(); explorer.setBrush(0, null); explorer.draw();")
    assert hint(page) == []
    for address in ("brush=theta:0:", "agents=0", "episodes=0-3"):
        assert hint(Page(browser, path, address)) == [], address
    assert len(hint(Page(browser, path, "color=agent"))) == 1
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True})
    browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True, "maxTouchPoints": 1})
    touched = hint(Page(browser, path))
    browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert touched == ["Slide a finger along an axis to select states"], touched


def check_layout(browser: Browser, path: Path) -> None:
    """The panels of a run fill the window; on a phone nothing is beyond its edge, and titles of axes do not touch."""
    boxes = """
        const box = (selector) => { const { left, top, right, bottom } = document.querySelector(selector).getBoundingClientRect(); return [left, top, right, bottom]; };
        return [[".plot", ".pair", ".film"].map(box), box("header"), box("footer"), document.documentElement.scrollWidth, document.documentElement.scrollHeight];"""
    for width, height in ((1440, 900), (1920, 1080), (390, 844)):
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500})
        page = Page(browser, path)
        panels, header, footer, page_width, page_height = page.run(boxes)
        sizes = [(right - left) * (bottom - top) for left, top, right, bottom in panels]
        assert page_width == width, (width, page_width)
        if width > 1000:
            assert page_height == height == footer[3], (height, page_height, footer)
            room = width * (footer[1] - header[3])
            assert sum(sizes) > 0.85 * room and min(sizes) > 0.15 * room, (width, sizes, room)
            continue
        assert all(left >= 0 and right <= width and right - left > 0.9 * width for left, _, right, _ in panels), panels
        beyond = page.run("""
            return [...document.querySelectorAll("header button, header select, header input, header summary, figcaption *, footer summary")]
                .filter((element) => { const { left, right } = element.getBoundingClientRect(); return right > innerWidth || left < 0; }).map((element) => element.outerHTML);""")
        assert beyond == [], beyond
        titles = page.run("""
            const panel = explorer.panels[0], titles = [], pen = document.createElement("canvas").getContext("2d");
            panel.drawOn({ image() {}, line() {}, box() {}, text(text, x, y, _color, size, _align, maxWidth) {
                pen.font = `${size}px system-ui, sans-serif`;
                const natural = pen.measureText(text).width, width = Math.min(natural, maxWidth);
                if (size === 12) titles.push([x - width / 2, x + width / 2, y, width / natural]);
            } }, explorer.theme);
            return titles;""")
        assert min(squeezed for *_, squeezed in titles) > 0.75, titles
        for row in {y for _, _, y, _ in titles}:
            ends = [(left, right) for left, right, y, _ in titles if y == row]
            assert all(right <= left for (_, right), (left, _) in zip(ends, ends[1:])), (row, ends)
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def check_picture(page: Page, update: bool) -> None:
    """The lines of all colors, without texts, whose font differs between machines."""
    pictures = []
    for view in ("", "brush=theta:-0.05:0.05&color=agent", "color=return", "color=difference&compared=1"):
        page.show(view)
        data = page.run("return explorer.panels[0].image.toDataURL()")
        picture = Image.open(io.BytesIO(base64.b64decode(data.split(",")[1])))
        white = Image.new("RGBA", picture.size, "white")
        pictures.append(np.asarray(Image.alpha_composite(white, picture).convert("RGB")))
    drawn = np.concatenate(pictures)
    assert all((picture < 200).any() for picture in pictures), "no picture is blank"
    if update:
        Image.fromarray(drawn).quantize(256, dither=Image.Dither.NONE).save(PICTURE, optimize=True)
        return
    stored = np.asarray(Image.open(PICTURE).convert("RGB"))
    assert stored.shape == drawn.shape, (stored.shape, drawn.shape)
    difference = np.abs(stored.astype(int) - drawn.astype(int)).mean()
    assert difference < 3, f"the picture differs from {PICTURE.name} by {difference:.2f} levels on average; look at it, and update it with --update"


def check_two_runs(browser: Browser, seedbed: str, run: Path, folder: Path) -> None:
    """Two runs have the same brushes; a recording alone can be shown."""
    page = Page(browser, write_page(seedbed, folder / "two.html", run, run / "run.rrd"))
    page.show("brush=theta:0:0.1")
    assert page.counts(0) == page.counts(1) and page.counts(0)[0] > 0
    assert page.errors() == []


def write_states(folder: Path, axes: list[tuple[str, str]], states: np.ndarray) -> Path:
    """A run of one episode that another program recorded: docs/state_files.md describes the file."""

    def frame(kind: bytes, payload: bytes) -> bytes:
        start = kind + struct.pack("<II", len(payload), zlib.crc32(payload))
        return start + struct.pack("<I", zlib.crc32(start)) + payload

    axis = lambda name, unit: {"name": name, "unit": unit, "low": None, "high": None}
    observations = [axis(name, unit) for name, unit in axes]
    header = {"agent": 0, "environment": axes[0][0], "observations": observations, "actions": [axis("push", "N")], "time_limit": None, "step_seconds": None}
    steps = len(states) - 1
    numbers = np.concatenate([states.ravel(), np.zeros(steps), np.ones(steps)]).astype("<f4")
    episode = struct.pack("<IIIId", 0, 0, steps, 1, steps) + numbers.tobytes()
    start = b"SBSTATES" + struct.pack("<I", 1)
    start += struct.pack("<I", zlib.crc32(start))
    (folder / "states").mkdir(parents=True)
    (folder / "states" / "agent_0.states").write_bytes(start + frame(b"HEAD", json.dumps(header).encode()) + frame(b"EPIS", episode))
    return folder


def check_hostile_names(browser: Browser, seedbed: str, folder: Path) -> None:
    """Names and units that try to become markup stay texts; states that are NaN are marked."""
    name = "<!--<script>a,b:c;1=|\x1b[31m\u202e\x9b</script><img src=x onerror=\"window.wasRun = 1\">"
    states = np.stack([np.linspace(-1, 1, 101), np.linspace(0, 5, 101)], axis=1)
    states[::2, 1] = np.nan
    run = write_states(folder / "hostile", [(name, "<!--<script>"), ("x", "</script>")], states)
    page = Page(browser, write_page(seedbed, folder / "hostile.html", run))
    assert page.run("return explorer.axes.slice(0, 2).map((axis) => [axis.name, axis.unit])") == [[name, "<!--<script>"], ["x", "</script>"]]
    assert page.run("return explorer.runs[0].nan.slice(0, 2)") == [0, 51]
    page.run("explorer.setBrush(0, [0, 40000]); explorer.draw();")
    selected = page.counts()
    address = page.run("return toHash(explorer)")
    page.show("")
    page.show(address)
    assert page.counts() == selected and 0 < selected[0] < 101, address
    svg = page.run("return toSvg(explorer)")
    assert page.run("return new DOMParser().parseFromString(arguments[0], 'image/svg+xml').querySelector('parsererror')", svg) is None
    assert page.run("return [window.wasRun ?? null, document.images.length, document.scripts.length]") == [None, 0, 2]
    assert page.errors() == [], page.errors()


STUDY = """Study(
    title: "Two teams",
    scenario: "cartpole",
    set: ["stop=Episodes(6)"],
    grid: [(name: "K", set: ["agents.count={}"], values: ["2", "3"])],
    repeats: 2,
    measures: [Coverage],
    figures: [Visitation(episodes: [First(3), All])],
)"""


def check_report(browser: Browser, seedbed: str, folder: Path) -> None:
    """The report of a study has one panel per cell, in a frame, and one brush selects in both."""
    (folder / "study.ron").write_text(STUDY)
    subprocess.run([seedbed, "study", folder / "study.ron", "--out", folder / "study"], check=True, capture_output=True)
    browser.get((folder / "study" / "report.html").as_uri())
    frame = browser.find_element(By.CSS_SELECTOR, "iframe.states")
    browser.execute_script("arguments[0].scrollIntoView()", frame)
    browser.switch_to.frame(frame)
    WebDriverWait(browser, 60).until(lambda _: browser.execute_script("return document.documentElement?.dataset.ready"))
    runs, agents, selected, all_states = browser.execute_script("""
        const { panels, axes } = explorer;
        const sums = () => panels.map((panel) => panel.selection.count);
        const all = sums();
        explorer.setBrush(axes.findIndex((axis) => axis.name === "theta"), [32767, arguments[0]]);
        explorer.draw();
        return [panels.map((panel) => panel.run.name), panels.map((panel) => panel.run.agents), sums(), all];""", MAX_LEVEL)
    assert (runs, agents) == (["K 2", "K 3"], [2, 3]), (runs, agents)
    assert all(0 < some < every for some, every in zip(selected, all_states)), (selected, all_states)
    assert browser.find_element(By.ID, "copy-link").get_property("hidden"), "a frame has no address of its own"
    assert browser.execute_script("return [explorer.colors().includes('outcome'), explorer.panels[0].scatter.plots.length]") == [False, 1]
    browser.switch_to.default_content()
    assert messages(browser) == []


def check_everywhere(page: Page, states: dict[str, np.ndarray], seedbed: str, run: Path, folder: Path) -> None:
    """What works in every browser."""
    check_random_brushes(page, states, random.Random(0))
    check_ranges_of_brushes(page, states, random.Random(1))
    check_written_ranges(page, states)
    check_difference(page)
    check_address(page)
    check_pointer(page)
    check_keyboard(page)
    check_files(page)
    check_film(page)
    check_scatter(page, states)
    check_colors(page, states)
    check_typed_ranges(page, states)
    assert page.errors() == [], page.errors()
    check_films(page.browser, seedbed, folder)
    check_two_runs(page.browser, seedbed, run, folder)
    check_hostile_names(page.browser, seedbed, folder)
    check_report(page.browser, seedbed, folder)


def check_in_chromium(page: Page, path: Path, update: bool) -> None:
    """What is compared with a stored picture, or needs fingers and windows of given sizes, which only Chromium imitates."""
    check_touch(page)
    check_picture(page, update)
    check_hint(page.browser, path)
    check_layout(page.browser, path)
    assert page.errors() == [], page.errors()


def main() -> None:
    seedbed, run, geckodriver, update = sys.argv[1], Path(sys.argv[2]), sys.argv[3], "--update" in sys.argv
    for name, start in (("Chromium", lambda _: start_chromium()), ("Firefox", lambda log: start_firefox(geckodriver, log))):
        with tempfile.TemporaryDirectory() as folder_name:
            folder = Path(folder_name)
            path = write_page(seedbed, folder / "page.html", run)
            assert path.read_bytes() == write_page(seedbed, folder / "again.html", run).read_bytes(), "the same run gives the same bytes"
            assert "http://" not in re.sub(r"http://www\.w3\.org/\S+", "", path.read_text()) and "https://" not in path.read_text(), "the page loads nothing"
            states, _ = read_states(seedbed, run, folder)
            browser = start(folder / "driver.log")
            try:
                page = Page(browser, path)
                if name == "Chromium":
                    check_in_chromium(page, path, update)
                    page = Page(browser, path)
                check_everywhere(page, states, seedbed, run, folder)
            finally:
                browser.quit()
        print(f"the page of visited states was used in {name}")


main()
