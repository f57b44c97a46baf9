"""Steps of an environment per second of CPU time from Python, with random actions and resets, on one thread.

    python_environments.py seedbed:cartpole                          one environment, stepped in a loop
    python_environments.py seedbed:cartpole 64 --physics analytic    a vector environment of 64 copies
    python_environments.py CartPole-v1 64                            Gymnasium's own vector environment
    python_environments.py envpool:CartPole-v1 64                    EnvPool

A Gymnasium task without a vector environment of its own is stepped by `SyncVectorEnv`.
"""

import argparse
import json
import os
import time

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np  # noqa: E402

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("task", help="Gymnasium's id, `seedbed:NAME` or `envpool:ID`")
parser.add_argument("copies", type=int, nargs="?", help="number of copies M; by default a single environment")
parser.add_argument("--physics", default="rapier", help="physics of the workbench's task (default: rapier)")
parser.add_argument("--seconds", type=float, default=1.0, help="CPU time of the measurement")
arguments = parser.parse_args()
library, _, name = arguments.task.rpartition(":")
copies = arguments.copies


def make():
    if library == "seedbed":
        import seedbed

        if copies is None:
            return seedbed.make(name, physics=arguments.physics)
        return seedbed.make(name, copies, physics=arguments.physics, threads=1)
    if library == "envpool":
        import envpool

        return envpool.make_gymnasium(name, num_envs=copies, num_threads=1)
    import gymnasium

    return gymnasium.make(name) if copies is None else gymnasium.make_vec(name, copies)


def sampled_actions(space, rows):
    """Random actions for some steps, drawn beforehand."""
    space.seed(0)
    samples = [space.sample() for _ in range(rows)]
    if library != "envpool" or copies is None:
        return samples
    # EnvPool's space is that of one copy.
    return [np.array([space.sample() for _ in range(copies)]) for _ in range(rows)]


environment = make()
actions = sampled_actions(environment.action_space, 64)
if library == "envpool":
    environment.reset()
else:
    environment.reset(seed=0)


def step_one():
    for action in actions:
        _, _, terminated, truncated, _ = environment.step(action)
        if terminated or truncated:
            environment.reset()


def step_many():
    for row in actions:
        environment.step(row)


step = step_one if copies is None else step_many
step()
count, start = 0, time.process_time()
while time.process_time() - start < arguments.seconds:
    step()
    count += len(actions) * (copies or 1)
print(json.dumps({"units": count, "cpu_seconds": time.process_time() - start}))
