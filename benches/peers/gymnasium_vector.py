"""Steps of Gymnasium's `CartPoleVectorEnv` (one NumPy formula for all copies) per second of CPU time."""

import argparse
import json
import time

import gymnasium
import numpy as np

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("copies", type=int, help="number of copies M")
parser.add_argument("--seconds", type=float, default=1.0, help="CPU time of the measurement")
arguments = parser.parse_args()

environment = gymnasium.make_vec(
    "CartPole-v1", num_envs=arguments.copies, vectorization_mode="vector_entry_point"
)
environment.reset(seed=0)
actions = np.random.default_rng(0).integers(0, 2, (64, arguments.copies))
for row in actions:
    environment.step(row)
count, start = 0, time.process_time()
while time.process_time() - start < arguments.seconds:
    for row in actions:
        environment.step(row)
    count += actions.size
print(json.dumps({"units": count, "cpu_seconds": time.process_time() - start}))
