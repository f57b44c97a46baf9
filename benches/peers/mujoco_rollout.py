"""Control steps of MuJoCo's `rollout` per second of CPU time, on one thread: M copies with random controls.

MuJoCo's `rollout` is its fastest interface for many copies: a loop in C++. It computes states only; there are no
observations, rewards, ends of episodes and resets, which the workbench's steps include.
"""

import argparse
import importlib.util
import json
import time
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("model", help="MJCF file, or `gymnasium:NAME` or `suite:NAME` for one of Gymnasium's or dm_control's")
parser.add_argument("copies", type=int, help="number of copies M")
parser.add_argument("--substeps", type=int, default=1, help="steps of MuJoCo per control step")
parser.add_argument("--seconds", type=float, default=1.0, help="CPU time of the measurement")
arguments = parser.parse_args()

FOLDERS = {"gymnasium": ("gymnasium", "envs/mujoco/assets"), "suite": ("dm_control", "suite")}
path = Path(arguments.model)
source, _, name = arguments.model.partition(":")
if source in FOLDERS:
    package, folder = FOLDERS[source]
    path = Path(importlib.util.find_spec(package).origin).parent / folder / name
model = mujoco.MjModel.from_xml_path(str(path))
data = mujoco.MjData(model)
random = np.random.default_rng(0)
steps = max(1, 1024 // arguments.copies)
state_size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
initial = np.empty(state_size)
mujoco.mj_resetData(model, data)
mujoco.mj_getState(model, data, initial, mujoco.mjtState.mjSTATE_FULLPHYSICS)
initial = np.tile(initial, (arguments.copies, 1))
# Starts as in the workbench's cart-pole: positions and velocities uniform within ±0.05.
width = model.nq + model.nv
initial[:, 1 : 1 + width] += random.uniform(-0.05, 0.05, (arguments.copies, width))
control = random.uniform(-1.0, 1.0, (arguments.copies, steps, model.nu))
control = np.repeat(control, arguments.substeps, axis=1)
output = np.empty((arguments.copies, steps * arguments.substeps, state_size))

with mujoco.rollout.Rollout(nthread=0) as rollout:

    def play():
        rollout.rollout(model, data, initial, control, state=output, skip_checks=False)

    play()
    count, start = 0, time.process_time()
    while time.process_time() - start < arguments.seconds:
        play()
        count += arguments.copies * steps
    print(json.dumps({"units": count, "cpu_seconds": time.process_time() - start}))
