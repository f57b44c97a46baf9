#!/usr/bin/env python3
"""Draws trained agents side by side, for `docs/known_tasks.gif`.

    for task in gym_walker2d gym_half_cheetah gym_hopper gym_bipedal_walker gym_lunar_lander dm_ball_in_cup_catch; do
        seedbed run scenarios/known_tasks/$task.ron --seed 1000 --out recordings/film/$task
    done
    scenarios/known_tasks/film.py recordings/film/* --out docs/known_tasks.gif

Each agent takes its most likely actions, from the seed 0 on; a new episode begins when one ends. The film shows them in real time. Needs the
packages seedbed and pillow.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PIL.Image import Image

COLUMNS = 3
FRAMES_PER_SECOND = 12.5  # 80 ms per frame: the film format counts in 10 ms


def frames(folder: Path, width: int, height: int, seconds: float) -> list[Image]:
    """Pictures of the agent of a run, at equal times."""
    from PIL import Image, ImageDraw

    import seedbed

    policy = seedbed.load(folder).policy(0)
    environment = seedbed.make(policy.task, render_mode="rgb_array")
    task = environment.unwrapped.task
    observation, _ = environment.reset(seed=0)
    pictures, time = [], 0.0
    while len(pictures) < seconds * FRAMES_PER_SECOND:
        if time >= len(pictures) / FRAMES_PER_SECOND:
            picture = Image.fromarray(environment.render()).resize((width, height), Image.Resampling.LANCZOS)
            ImageDraw.Draw(picture).text((8, 4), task.name, fill=(60, 60, 60))
            pictures.append(picture)
        observation, _, terminated, truncated, _ = environment.step(policy(observation))
        time += task.control_step
        if terminated or truncated:
            observation, _ = environment.reset()
    return pictures


def side_by_side(tiles: list[Image]) -> Image:
    from PIL import Image

    width, height = tiles[0].size
    rows = -(-len(tiles) // COLUMNS)
    whole = Image.new("RGB", (COLUMNS * width, rows * height), "white")
    for number, tile in enumerate(tiles):
        whole.paste(tile, (number % COLUMNS * width, number // COLUMNS * height))
    return whole.convert("P", palette=Image.Palette.ADAPTIVE, colors=32)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path, help="run directories")
    parser.add_argument("--out", type=Path, default=Path("known_tasks.gif"), help="(known_tasks.gif)")
    parser.add_argument("--seconds", type=float, default=6, help="(6)")
    parser.add_argument("--size", nargs=2, type=int, default=[270, 180], help="of each picture, in pixels (270 180)")
    arguments = parser.parse_args()
    agents = [frames(folder, *arguments.size, arguments.seconds) for folder in arguments.runs]
    film = [side_by_side(list(tiles)) for tiles in zip(*agents)]
    film[0].save(arguments.out, save_all=True, append_images=film[1:], duration=round(1000 / FRAMES_PER_SECOND), loop=0, optimize=True)
    print(f"wrote {arguments.out}: {arguments.out.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
