"""Opens a recording in the Rerun viewer without a screen, in the dark and in the light theme, and checks that its views show something.

    viewer.py RECORDING [FOLDER]     keeps the pictures in FOLDER

Run by tests/interop/run with the Python of each version of the Rerun SDK. Needs a Vulkan driver, such as that of Debian's package mesa-vulkan-drivers.
"""

import json
import pathlib
import socket
import subprocess
import sys
import tempfile
import time

import numpy as np
import rerun
from PIL import Image

WIDTH, HEIGHT = 1600, 1000
SECONDS = 60
BAR_HEIGHT = 30
# Names of tools in newer versions.
NEWER_NAMES = {"connect": "rerun_connect", "viewer_state": "rerun_get_state"}
# Parts of the window: left, top, right and bottom. Each has colors that text on a background has not.
PARTS = {"visited states": (0, 80, 960, 970), "returns": (970, 60, 1600, 370), "metrics": (970, 410, 1600, 600)}


def main(recording: pathlib.Path, folder: pathlib.Path) -> None:
    with Viewer(recording, folder / f"viewer-{rerun.__version__}.log") as viewer:
        for theme in ["Dark", "Light"]:
            viewer.choose_theme(theme)
            path = folder / f"viewer-{rerun.__version__}-{theme.lower()}.png"
            viewer.take_picture(path)
            check_picture(path, theme)
    print(f"rerun {rerun.__version__}: the viewer shows visited states, returns and metrics in both themes")


def check_picture(path: pathlib.Path, theme: str) -> None:
    """Checks that each part of the window has pixels of many colors."""
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    assert pixels.shape == (HEIGHT, WIDTH, 3), f"{path}: {pixels.shape}"
    # The bar at the top is always of the theme's color, except for its few words.
    background = np.median(pixels[:BAR_HEIGHT].mean(axis=2))
    assert (background > 128) == (theme == "Light"), f"{path}: brightness {background} in the theme {theme}"
    for name, (left, top, right, bottom) in PARTS.items():
        part = pixels[top:bottom, left:right]
        saturation = part.max(axis=2) - part.min(axis=2)
        colored = (saturation > 40).mean()
        colors = len(np.unique((part // 16).reshape(-1, 3), axis=0))
        least = 0.1 if name == "visited states" else 0.001
        assert colored > least and colors > 20, f"{path}: {name}: {100 * colored:.2f} % colored, {colors} colors"


class Viewer:
    """A viewer without a screen, and the program that controls it by JSON-RPC messages."""

    def __init__(self, recording: pathlib.Path, log: pathlib.Path):
        self.log = log.open("w")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        options = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", f"{WIDTH}x{HEIGHT}"]
        self.viewer = subprocess.Popen([program(), *options, str(recording)], stdout=self.log, stderr=self.log)
        self.control = subprocess.Popen([program(), "viewer-mcp"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.log, text=True)
        self.messages = 0
        client = {"name": "seedbed", "version": "1"}
        self.request("initialize", {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": client})
        self.send({"method": "notifications/initialized"})
        self.tools = {tool["name"] for tool in self.request("tools/list", {})["tools"]}
        self.wait_until(lambda: '"ok":true' in self.use("connect", endpoint=f"http://127.0.0.1:{port}"))
        self.wait_until(lambda: '"env_step"' in self.use("viewer_state"))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in [self.control, self.viewer]:
            process.kill()
            process.wait()
        self.log.close()

    def choose_theme(self, theme: str) -> None:
        self.click(label_contains="Menu")
        self.click(label_contains="Settings…")
        self.click(label_contains=theme)
        self.click(label_contains="Close")

    def take_picture(self, path: pathlib.Path) -> None:
        self.use("wait_for", min_steps=30, timeout_secs=SECONDS)
        self.use("screenshot", save_path=str(path))

    def click(self, **node) -> None:
        self.wait_until(lambda: '"ok":true' in self.use("click", role="Button", **node))
        self.use("wait_for", min_steps=5, timeout_secs=SECONDS)

    def wait_until(self, is_done) -> None:
        end = time.monotonic() + SECONDS
        while not is_done():
            assert time.monotonic() < end, f"the viewer does not answer: see {self.log.name}\n{self.answer}"
            time.sleep(0.2)

    def use(self, tool: str, **arguments) -> str:
        tool = tool if tool in self.tools else NEWER_NAMES[tool]
        result = self.request("tools/call", {"name": tool, "arguments": arguments})
        self.answer = " ".join(part.get("text", "") for part in result.get("content", []))
        return self.answer

    def request(self, method: str, params: dict) -> dict:
        self.messages += 1
        self.send({"id": self.messages, "method": method, "params": params})
        for line in self.control.stdout:
            message = json.loads(line)
            if message.get("id") == self.messages:
                return message.get("result", {"content": [{"text": line}]})
        raise AssertionError(f"the control program ended: see {self.log.name}")

    def send(self, message: dict) -> None:
        self.control.stdin.write(json.dumps({"jsonrpc": "2.0", **message}) + "\n")
        self.control.stdin.flush()


def program() -> str:
    """The viewer's own program. The command `rerun` of the package is a script around it."""
    package = pathlib.Path(rerun.__file__).parent
    candidates = [package.parent / "rerun_cli" / "rerun", package.parent.parent / "rerun_cli" / "rerun", package.parent / "rerun_sdk" / "rerun_cli" / "rerun"]
    return str(next(path for path in candidates if path.is_file()))


if __name__ == "__main__":
    if len(sys.argv) > 2:
        main(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(pathlib.Path(sys.argv[1]), pathlib.Path(temporary))
