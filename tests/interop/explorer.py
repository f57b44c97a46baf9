"""Opens a page of `seedbed explore` in Chromium and uses it: counts under brushes must equal those of the exported
states, everything must work with the keyboard alone, and the picture must be the stored one.

Usage: explorer.py SEEDBED RUN [--update]
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
from selenium.webdriver.support.wait import WebDriverWait

PICTURE = Path(__file__).parent / "explorer.png"
MAX_LEVEL = 65534


def start_browser() -> webdriver.Chrome:
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for argument in [
        "--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1400,1000", "--no-first-run", "--disable-sync",
        "--disable-background-networking", "--disable-component-update", "--force-device-scale-factor=1",
    ]:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(options=options, service=webdriver.ChromeService("/usr/bin/chromedriver"))


class Page:
    """An opened page."""

    def __init__(self, browser: webdriver.Chrome, path: Path):
        self.browser = browser
        browser.get("about:blank")
        browser.get(path.as_uri())
        WebDriverWait(browser, 60).until(lambda _: self.run("return document.documentElement.dataset.ready"))

    def run(self, script: str, *arguments: object) -> object:
        return self.browser.execute_script(script, *arguments)

    def show(self, address: str) -> None:
        """Shows the view after # in an address."""
        self.run("fromHash(explorer, arguments[0]); explorer.draw();", address)

    def counts(self, panel: int = 0) -> list[int]:
        """Numbers of selected states, all states, episodes, terminated episodes and agents, as shown."""
        text = self.run("return explorer.panels[arguments[0]].counts.textContent", panel)
        pattern = r"([\d,]+) of ([\d,]+) states?.*?, ([\d,]+) episodes? \(([\d,]+) terminated.*?\), ([\d,]+) agents?"
        return [int(number.replace(",", "")) for number in re.fullmatch(pattern, text).groups()]

    def errors(self) -> list[dict]:
        return [entry for entry in self.browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]


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
    press = lambda *keys: ActionChains(page.browser).send_keys(*keys).perform()
    everything = page.counts()
    page.run("document.activeElement.blur(); scrollTo(0, 0);")
    reached = set()
    for _ in range(200):
        press(Keys.TAB)
        name = page.run("const e = document.activeElement; return e.id || e.getAttribute('aria-label') || e.textContent.trim();")
        if name in reached:
            break
        reached.add(name)
    controls = {"color", "clear", "copy-link", "copy-command", "save-png", "save-svg", "theme", "Axes", "Help", "all-agents", "agent-list", "play", "from", "to"}
    axes = page.run("return explorer.view.axes.map((a) => axisTitle(explorer.axes[a]))")
    handles = {f"{axis}, {end} end" for axis in axes for end in ("lower", "upper")}
    chips = {name for name in reached if name.startswith("agent ")}
    assert controls | handles <= reached, (controls | handles) - reached
    assert len(chips) == page.run("return explorer.agentCount"), chips

    focus = lambda selector: page.run("document.querySelector(arguments[0]).focus()", selector)
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
    """The pointer shows the filmed state that is nearest."""
    page.show("")
    caption = lambda: page.browser.find_element(By.CSS_SELECTOR, "figcaption").text
    canvas = page.browser.find_element(By.CSS_SELECTOR, ".plot canvas")
    seen = set()
    for share in (-0.3, 0.0, 0.25):
        ActionChains(page.browser).move_to_element_with_offset(canvas, -150, int(share * canvas.size["height"])).perform()
        page.run("explorer.draw()")
        seen.add(caption())
    assert len(seen) >= 2 and all("agent 0, episode" in text for text in seen), seen
    drawn = page.run("const c = document.querySelector('.scene'); return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((value) => value > 0)")
    assert drawn, "the scene is not empty"


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


def check_two_runs(browser: webdriver.Chrome, seedbed: str, run: Path, folder: Path) -> None:
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


def check_hostile_names(browser: webdriver.Chrome, seedbed: str, folder: Path) -> None:
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


def check_report(browser: webdriver.Chrome, seedbed: str, folder: Path) -> None:
    """The report of a study has one panel per cell, in a frame, and one brush selects in both."""
    (folder / "study.ron").write_text(STUDY)
    subprocess.run([seedbed, "study", folder / "study.ron", "--out", folder / "study"], check=True, capture_output=True)
    browser.get((folder / "study" / "report.html").as_uri())
    frame = browser.find_element(By.CSS_SELECTOR, "iframe.states")
    browser.execute_script("arguments[0].scrollIntoView()", frame)
    browser.switch_to.frame(frame)
    WebDriverWait(browser, 60).until(lambda _: browser.execute_script("return document.documentElement.dataset.ready"))
    runs, agents, selected, all_states = browser.execute_script("""
        const { panels, axes } = explorer;
        const sums = () => panels.map((panel) => panel.selection.count);
        const all = sums();
        explorer.setBrush(axes.findIndex((axis) => axis.name === "theta"), [32767, MAX_LEVEL]);
        explorer.draw();
        return [panels.map((panel) => panel.run.name), panels.map((panel) => panel.run.agents), sums(), all];""")
    assert (runs, agents) == (["K 2", "K 3"], [2, 3]), (runs, agents)
    assert all(0 < some < every for some, every in zip(selected, all_states)), (selected, all_states)
    assert not browser.find_element(By.ID, "copy-link").is_displayed(), "a frame has no address of its own"
    browser.switch_to.default_content()
    assert [entry for entry in browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")] == []


def main() -> None:
    seedbed, run, update = sys.argv[1], Path(sys.argv[2]), "--update" in sys.argv
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = write_page(seedbed, folder / "page.html", run)
        assert path.read_bytes() == write_page(seedbed, folder / "again.html", run).read_bytes(), "the same run gives the same bytes"
        assert "http://" not in re.sub(r"http://www\.w3\.org/\S+", "", path.read_text()) and "https://" not in path.read_text(), "the page loads nothing"
        states, _ = read_states(seedbed, run, folder)
        browser = start_browser()
        try:
            page = Page(browser, path)
            check_random_brushes(page, states, random.Random(0))
            check_ranges_of_brushes(page, states, random.Random(1))
            check_written_ranges(page, states)
            check_difference(page)
            check_pointer(page)
            check_touch(page)
            check_keyboard(page)
            check_files(page)
            check_film(page)
            check_picture(page, update)
            assert page.errors() == [], page.errors()
            check_two_runs(browser, seedbed, run, folder)
            check_hostile_names(browser, seedbed, folder)
            check_report(browser, seedbed, folder)
        finally:
            browser.quit()
    print("the page of visited states was used in Chromium")


main()
