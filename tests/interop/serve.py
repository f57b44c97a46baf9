"""Connects two viewers to a run with `--serve`, one after the other, interrupts the run, and checks that each viewer has received as many chunks of raw states as the run's recording has.

    serve.py SEEDBED     SEEDBED is the path of the program

Run by tests/interop/run.
"""

import pathlib
import signal
import subprocess
import sys
import tempfile
import time

from live import count_state_chunks, free_port, viewer_binary


def main(seedbed: str) -> None:
    rerun = viewer_binary()
    with tempfile.TemporaryDirectory() as folder:
        run = pathlib.Path(folder) / "run"
        endless = ["--set", "agents.count=2", "--set", "stop=Episodes(1000000)", "--threads", "1", "--serve=0"]
        command = [seedbed, "run", "scenarios/cartpole.ron", "--out", run, *endless]
        run_process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        viewers = []
        try:
            first_line = run_process.stdout.readline()
            assert first_line.startswith("serving    rerun+http://"), first_line
            address = first_line.split("rerun --connect ")[1].strip()
            for name in ("early.rrd", "late.rrd"):
                received = pathlib.Path(folder) / name
                connect = [rerun, "--connect", address, "--save", str(received), "--port", str(free_port())]
                viewers.append((received, subprocess.Popen(connect, stdin=subprocess.DEVNULL)))
                wait_for_data(received)
            run_process.send_signal(signal.SIGINT)
            interrupted = 128 + signal.SIGINT
            assert run_process.wait(timeout=60) == interrupted, f"expected exit status {interrupted} of an interrupted run"
            for _, viewer in viewers:
                # The run has told its viewers that no more data follow, so they write their files and end.
                viewer.wait(timeout=60)
        finally:
            for process in [run_process, *(viewer for _, viewer in viewers)]:
                process.kill()
                process.wait()
        in_file = count_state_chunks(rerun, run / "run.rrd.part")
        in_viewers = [count_state_chunks(rerun, received) for received, _ in viewers]
        assert in_file > 0 and in_viewers == [in_file, in_file], f"{in_file} chunks in the file, {in_viewers} received by the viewers"
    print(f"serve: an early and a late viewer received all {in_file} chunks of raw states of the file")


def wait_for_data(path: pathlib.Path) -> None:
    """Waits until the file has more than a megabyte, for at most a minute."""
    for _ in range(600):
        if path.exists() and path.stat().st_size > 1_000_000:
            return
        time.sleep(0.1)
    raise SystemExit(f"the viewer wrote too little data to {path.name}")


if __name__ == "__main__":
    main(sys.argv[1])
