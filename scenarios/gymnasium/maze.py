"""A maze of square cells, which a disc crosses with velocities that fade. The reward is 1 at the goal."""

import gymnasium
import numpy as np
from gymnasium.spaces import Box

WALLS = [
    "#########",
    "#S  #   #",
    "### # # #",
    "#   # # #",
    "# ### # #",
    "#   # # #",
    "### # # #",
    "#     #G#",
    "#########",
]


class Maze(gymnasium.Env):
    observation_space = Box(np.array([0, 0, -1, -1], np.float32), np.array([9, 9, 1, 1], np.float32))
    action_space = Box(-1, 1, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.position = np.array([1.5, 1.5]) + self.np_random.uniform(-0.2, 0.2, 2)
        self.velocity = np.zeros(2)
        return self.observe(), {}

    def step(self, action):
        self.velocity = 0.8 * self.velocity + 0.1 * np.clip(action, -1, 1)
        for axis in range(2):
            moved = self.position.copy()
            moved[axis] += self.velocity[axis]
            if self.cell(moved) == "#":
                self.velocity[axis] = 0.0
            else:
                self.position = moved
        is_at_goal = self.cell(self.position) == "G"
        return self.observe(), float(is_at_goal), is_at_goal, False, {}

    def cell(self, place):
        return WALLS[int(place[1])][int(place[0])]

    def observe(self):
        return np.concatenate([self.position, self.velocity]).astype(np.float32)


def make():
    return Maze()
