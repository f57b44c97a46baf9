"""Time of a call of `Team.act` for 16 agents, and of `Team.record`.

Usage: python benches/team_overhead.py [--repeats N]. Prints medians over repetitions in microseconds. The same actions
without Python: `cargo bench --bench learning -- "act/one step of 16 agents"`.
"""

import argparse
import statistics
import time

import numpy as np
from gymnasium import spaces

import seedbed

AGENTS = 16
STEPS = 2000


def microseconds(team: seedbed.Team, observations: np.ndarray) -> tuple[float, float]:
    """Median times of `act` and of `record` over the steps of an episode."""
    rewards, no = np.ones(AGENTS), np.zeros(AGENTS, bool)
    acting, recording = [], []
    for _ in range(STEPS):
        start = time.perf_counter_ns()
        team.act(observations)
        middle = time.perf_counter_ns()
        team.record(observations, rewards, no, no)
        acting.append(middle - start)
        recording.append(time.perf_counter_ns() - middle)
    return statistics.median(acting) / 1e3, statistics.median(recording) / 1e3


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--repeats", type=int, default=9)
    times = []
    for _ in range(parser.parse_args().repeats):
        team = seedbed.Team("SeedPg", spaces.Box(-1, 1, (4,)), spaces.Discrete(2), agents=AGENTS, threads=1)
        times.append(microseconds(team, np.tile(np.float32([0.01, -0.2, 0.03, 0.4]), (AGENTS, 1))))
    act, record = (statistics.median(column) for column in zip(*times, strict=True))
    print(f"{AGENTS} agents: act {act:.1f} µs, record {record:.1f} µs")


if __name__ == "__main__":
    main()
