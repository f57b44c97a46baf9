"""Connects viewers to a run that serves them, early and late, interrupts it, and checks that each got everything that is in the file.

    serve.py SEEDBED     the program

Run by tests/interop/run.
"""

import pathlib
import signal
import subprocess
import sys
import tempfile
import time

from live import free_port, states, viewer_binary


def main(seedbed: str) -> None:
    rerun = viewer_binary()
    with tempfile.TemporaryDirectory() as folder:
        run = pathlib.Path(folder) / "run"
        endless = ["--set", "agents.count=2", "--set", "stop=Episodes(1000000)", "--threads", "1", "--serve=0"]
        command = [seedbed, "run", "scenarios/cartpole.ron", "--out", run, *endless]
        serving = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        viewers = []
        try:
            said = serving.stdout.readline()
            assert said.startswith("serving    rerun+http://"), said
            address = said.split("rerun --connect ")[1].strip()
            for name in ("early.rrd", "late.rrd"):
                got = pathlib.Path(folder) / name
                connect = [rerun, "--connect", address, "--save", str(got), "--port", str(free_port())]
                viewers.append((got, subprocess.Popen(connect, stdin=subprocess.DEVNULL)))
                wait_for_data(got)
            serving.send_signal(signal.SIGINT)
            assert serving.wait(timeout=60) == 1, "an interrupted run ends with 1"
            for _, viewer in viewers:
                # Told that nothing follows, it writes what it has and ends.
                viewer.wait(timeout=60)
        finally:
            for process in [serving, *(viewer for _, viewer in viewers)]:
                process.kill()
                process.wait()
        sent = states(rerun, run / "run.rrd.part")
        arrived = [states(rerun, got) for got, _ in viewers]
        assert sent > 0 and arrived == [sent, sent], f"{sent} chunks in the file, {arrived} at the viewers"
    print(f"serve: {sent} chunks of raw states arrived at an early and a late viewer, as many as are in the file")


def wait_for_data(path: pathlib.Path) -> None:
    for _ in range(600):
        if path.exists() and path.stat().st_size > 1_000_000:
            return
        time.sleep(0.1)
    raise SystemExit(f"nothing arrived in {path.name}")


if __name__ == "__main__":
    main(sys.argv[1])
