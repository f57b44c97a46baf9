"""Streams a run to a Rerun viewer, and checks that the viewer receives as many chunks of raw states as the run's recording has.

    live.py SEEDBED      SEEDBED is the path of the program

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
        received = pathlib.Path(folder) / "received.rrd"
        viewer = subprocess.Popen([rerun, "--port", str(port), "--save", str(received)], stdin=subprocess.DEVNULL)
        try:
            wait_for_viewer(port)
            run = pathlib.Path(folder) / "run"
            short_run = ["--set", "agents.count=2", "--set", "stop=Episodes(20)", "--quiet"]
            subprocess.run([seedbed, "run", "scenarios/cartpole.ron", "--out", run, f"--live={address}", *short_run], check=True, timeout=120)
            in_file = count_state_chunks(rerun, run / "run.rrd")
            wait_for_states(rerun, received, in_file)
        finally:
            viewer.kill()
            viewer.wait()
        in_viewer = count_state_chunks(rerun, received)
        assert in_file == in_viewer and in_file > 0, f"{in_file} chunks in the file, {in_viewer} received by the viewer"
    print(f"live: the viewer received all {in_viewer} chunks of raw states of the file")


def viewer_binary() -> str:
    """Path of the viewer in the installed package. If its Python wrapper were started instead, killing the wrapper would leave the viewer running."""
    return str(pathlib.Path(rr.__file__).parent.parent / "rerun_cli" / "rerun")


def free_port() -> int:
    with socket.socket() as unused_socket:
        unused_socket.bind(("127.0.0.1", 0))
        return unused_socket.getsockname()[1]


def wait_for_viewer(port: int) -> None:
    for _ in range(300):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise SystemExit("the viewer did not start")


def wait_for_states(rerun: str, path: pathlib.Path, expected: int) -> None:
    """Waits until the file has the expected number of chunks of raw states, for at most a minute."""
    deadline = time.monotonic() + 60
    while count_state_chunks(rerun, path) < expected and time.monotonic() < deadline:
        time.sleep(0.2)


def count_state_chunks(rerun: str, path: pathlib.Path) -> int:
    """Number of chunks of raw states in a recording."""
    printed = subprocess.run([rerun, "rrd", "print", str(path)], capture_output=True, text=True, timeout=120).stdout
    return sum("/raw/agent_" in line for line in printed.splitlines())


if __name__ == "__main__":
    main(sys.argv[1])
