"""Generates histories of runs that were restarted, as event files of TensorBoard, and what TensorBoard's own reader makes of them.

    python -m venv venv && venv/bin/pip install tensorboard==2.21.0
    venv/bin/python tests/external/event_files/generate.py           # write histories.json again
    venv/bin/python tests/external/event_files/generate.py --check   # compare it with what would be written

`histories.json` has the files in Base64 and, for each history, the steps and values that `EventAccumulator` keeps. Histories without
`SessionLog.START` are read from copies with one at the first step of each file: what the program would have written if it had used
`purge_step`.
"""

from __future__ import annotations

import base64
import json
import random
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.compat.proto.event_pb2 import Event, SessionLog
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.summary.writer.record_writer import RecordWriter

TAG = "charts/episodic_return"
OTHER = "losses/value_loss"


@dataclass
class File:
    """Events of a file, and whether its program is one that writes `START`."""

    version: str | None = "brain.Event:2"
    begin: float = 0.0
    start: int | None = None
    scalars: list[tuple[str, int, float]] = field(default_factory=list)
    cut: int = 0

    def first_step(self) -> int:
        return min(step for tag, step, _ in self.scalars if tag in (TAG, OTHER))

    def write(self, path: Path, start: int | None) -> None:
        with path.open("wb") as file:
            writer = RecordWriter(file)
            time = self.begin
            if self.version:
                writer.write(Event(wall_time=time, step=start or 0, file_version=self.version).SerializeToString())
            if start is not None:
                log = SessionLog(status=SessionLog.START)
                writer.write(Event(wall_time=time, step=start, session_log=log).SerializeToString())
            for tag, step, value in self.scalars:
                time += 0.25
                summary = Summary(value=[Summary.Value(tag=tag, simple_value=value)])
                writer.write(Event(wall_time=time, step=step, summary=summary).SerializeToString())
        if self.cut:
            path.write_bytes(path.read_bytes()[: -self.cut])


def write(folder: Path, files: list[File], *, with_start: bool) -> None:
    for number, file in enumerate(files):
        # A file with START says itself where it continues the run.
        implied = file.first_step() if with_start and number > 0 and file.version else None
        start = file.start if file.start is not None else implied
        file.write(folder / f"events.out.tfevents.{int(file.begin)}.host.1.{number}", start)


def kept(folder: Path) -> tuple[list[int], list[float]]:
    accumulator = EventAccumulator(str(folder), size_guidance={"scalars": 0})
    accumulator.Reload()
    scalars = accumulator.Scalars(TAG)
    return [scalar.step for scalar in scalars], [scalar.value for scalar in scalars]


def history(random: random.Random, style: str) -> list[File]:
    """A run of 2 to 5 processes, each of which begins at a checkpoint of those before."""
    files, step = [], 0
    for number in range(random.randint(2, 5)):
        file = File(begin=1_700_000_000.0 + 1000 * number)
        if style == "old":
            file.version = None
        if style == "start" and number > 0:
            file.start = step
        # A process writes returns when episodes end, and losses at every 7th step.
        first, last = step, step + random.randint(20, 120)
        next_return = first + random.randint(1, 30)
        for now in range(first, last + 1):
            if style != "one tag" and now % 7 == 0 and now > 0:
                file.scalars.append((OTHER, now, random.random()))
            while now == next_return:
                file.scalars.append((TAG, now, round(random.uniform(-50, 50), 2)))
                # Two copies of an environment may end an episode at the same step.
                next_return += random.choice([0, 3, 5, 9, 14])
        if not file.scalars:
            file.scalars.append((TAG, last, 1.0))
        if style == "cut" and number > 0:
            file.cut = random.randint(1, 20)
        files.append(file)
        # The next process continues at a checkpoint, which may lie before those of earlier ones.
        step = random.randint(max(files[0].first_step() + 1, 1), max(last, 2))
        if style == "old":
            step = max(step, 8)
    return files


def histories() -> list[dict[str, object]]:
    result = []
    for style in ["start", "implied", "one tag", "old", "cut"]:
        seed = made = 0
        while made < 5:
            random_numbers = random.Random(f"{style} {seed}")
            seed += 1
            files = history(random_numbers, style)
            if not is_usable(files):
                continue
            with tempfile.TemporaryDirectory() as name, tempfile.TemporaryDirectory() as oracle:
                write(Path(name), files, with_start=False)
                write(Path(oracle), files, with_start=style in ("implied", "one tag", "cut"))
                steps, values = kept(Path(oracle))
                made += 1
                result.append(
                    {
                        "name": f"{style} {seed}",
                        "files": {
                            path.name: base64.b64encode(path.read_bytes()).decode() for path in sorted(Path(name).iterdir())
                        },
                        "steps": steps,
                        "values": values,
                    }
                )
    return result


def is_usable(files: list[File]) -> bool:
    """Whether the first file has a return before all restarts: otherwise seedbed asks whether these are several runs."""
    first = min((step for tag, step, _ in files[0].scalars if tag == TAG), default=None)
    return first is not None and all(
        file.start is not None or first < file.first_step() for file in files[1:]
    )


def main() -> None:
    path = Path(__file__).parent / "histories.json"
    text = json.dumps(histories(), indent=1) + "\n"
    if "--check" not in sys.argv[1:]:
        path.write_text(text)
    elif path.read_text() != text:
        sys.exit(f"{path} differs from what {Path(__file__).name} writes")


if __name__ == "__main__":
    main()
