"""MiniGrid's room with a locked door (Chevalier-Boisvert et al. 2023): agents see 7 × 7 cells of three numbers each, in a row. Where they
are is in `info`, so that recordings show where they went."""

import gymnasium
import minigrid  # noqa: F401  registers its environments
from minigrid.wrappers import ImgObsWrapper


class WithPlace(gymnasium.Wrapper):
    def with_place(self, info):
        x, y = self.unwrapped.agent_pos
        return {**info, "x": float(x), "y": float(y), "has_key": float(self.unwrapped.carrying is not None)}

    def reset(self, **options):
        observation, info = self.env.reset(**options)
        return observation, self.with_place(info)

    def step(self, action):
        observation, reward, terminated, truncated, info = self.env.step(action)
        return observation, reward, terminated, truncated, self.with_place(info)


def make():
    return gymnasium.wrappers.FlattenObservation(ImgObsWrapper(WithPlace(gymnasium.make("MiniGrid-DoorKey-6x6-v0"))))
