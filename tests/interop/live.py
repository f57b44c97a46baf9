"""Streams a run into a server of Rerun's and checks that everything arrived, and that the file is as it is without a viewer.

    live.py SEEDBED      the program

Run by tests/interop/run.
"""

import pathlib
import socket
import subprocess
import sys
import tempfile
import time

import rerun as rr


def main(seedbed: str) -> None:
    rerun, port = viewer_binary(), free_port()
    address = f"rerun+http://127.0.0.1:{port}/proxy"
    with tempfile.TemporaryDirectory() as folder:
        got = pathlib.Path(folder) / "got.rrd"
        viewer = subprocess.Popen([rerun, "--port", str(port), "--save", str(got)], stdin=subprocess.DEVNULL)
        try:
            wait_for(port)
            run = pathlib.Path(folder) / "run"
            small = ["--set", "agents.count=2", "--set", "stop=Episodes(20)", "--quiet"]
            subprocess.run([seedbed, "run", "scenarios/cartpole.ron", "--out", run, f"--live={address}", *small], check=True, timeout=120)
            sent = states(rerun, run / "run.rrd")
            wait_for_states(rerun, got, sent)
        finally:
            viewer.kill()
            viewer.wait()
        arrived = states(rerun, got)
        assert sent == arrived and sent > 0, f"{sent} chunks in the file, {arrived} at the viewer"
    print(f"live: {arrived} chunks of raw states arrived at the viewer, as many as are in the file")


def viewer_binary() -> str:
    """The wheel's own: the Python wrapper would leave it running."""
    return str(pathlib.Path(rr.__file__).parent.parent / "rerun_cli" / "rerun")


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def wait_for(port: int) -> None:
    for _ in range(300):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise SystemExit("the viewer did not start")


def wait_for_states(rerun: str, path: pathlib.Path, expected: int) -> None:
    """Until as many chunks of raw states are in the file, or for a minute."""
    patience = time.monotonic() + 60
    while states(rerun, path) < expected and time.monotonic() < patience:
        time.sleep(0.2)


def states(rerun: str, path: pathlib.Path) -> int:
    """Chunks of raw states in a recording."""
    printed = subprocess.run([rerun, "rrd", "print", str(path)], capture_output=True, text=True, timeout=120).stdout
    return sum("/raw/agent_" in line for line in printed.splitlines())


if __name__ == "__main__":
    main(sys.argv[1])
