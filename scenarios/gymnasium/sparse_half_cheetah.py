"""Gymnasium's half cheetah with a reward only far ahead, as in VIME (Houthooft et al. 2016, section 3): 1 where its torso is
5 m ahead of the start or more, otherwise 0."""

import gymnasium


class FarAhead(gymnasium.Wrapper):
    def step(self, action):
        observation, _, terminated, truncated, info = self.env.step(action)
        return observation, float(info["x_position"] > 5.0), terminated, truncated, info


def make():
    # The position belongs to the observation: no agent can learn what it cannot see.
    return FarAhead(gymnasium.make("HalfCheetah-v5", exclude_current_positions_from_observation=False))
