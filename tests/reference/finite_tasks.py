"""Tabular tasks and teams that explore them, in NumPy, many runs at once.

Written from definitions, not from the Rust code:
  [DV] Dimakopoulou and Van Roy 2018, "Coordinated exploration in concurrent reinforcement learning", arXiv 1802.01282;
  [O]  Osband et al. 2019, "Behaviour suite for reinforcement learning", arXiv 1908.03568, and `deep_sea` of bsuite.

Shapes: R runs, K agents, S states, A actions, O outcomes of an action, P unknown parameters of rewards.
An unknown parameter is link(x) with a Gaussian x, and an observation of it tells x + N(0, noise^2):
  link = identity  a mean reward;  link = exp  a log-normal one;
  link = sign      -1 or 1 with equal probability, as x ~ N(0, 1), observed exactly (noise 0).
"""

from types import SimpleNamespace

import numpy as np

NEVER = -1e9  # the reward of actions that do not exist
EPSILON, UCRL_WIDTH = 0.2, 2.0


def bipolar_chain(rng, runs, vertices=20):
    """[DV] 4.1: N vertices, start N // 2; the step into one end pays N, into the other -N, all others -1; at most 3N/2 steps."""
    moves = np.clip(np.arange(vertices)[:, None] + [-1, 1], 0, vertices - 1)
    is_end = np.isin(moves, [0, vertices - 1])
    task = tables(runs, moves[..., None], start=vertices // 2, horizon=3 * vertices // 2)
    task.known[:] = np.where(is_end, 0, -1)[..., None]
    task.known[:, [0, -1]] = NEVER  # no actions at the ends
    task.factor[:] = (is_end * np.where(moves == 0, -vertices, vertices))[..., None]  # theta = 1: the right end is rewarded
    return with_prior(task, rng, parameters=1, link=np.sign, mean=0, deviation=1, noise=0)


def parallel_chains(rng, runs, chains=4, edges=3, variance=1.0, noise=2.0):
    """[DV] 4.2: the first action chooses a chain of H edges; the last edge of chain c pays N(theta, noise^2), theta ~ N(0, variance + c)."""
    states = 1 + chains * edges
    chain, depth = np.divmod(np.arange(states) - 1, edges)
    after = np.minimum(np.arange(states) + 1, states - 1)[:, None].repeat(chains, axis=1)
    after[0] = 1 + np.arange(chains) * edges
    task = tables(runs, after[..., None], start=0, horizon=edges)
    task.known[:, 1:][:, depth[1:] == edges - 1] = NEVER  # the ends of chains
    task.known[:, 1:, 1:] = NEVER  # a choice at the first vertex only
    task.factor[1:][depth[1:] == edges - 2, 0] = 1
    task.parameter[:] = chain[:, None, None]
    prior = np.sqrt(variance + 1 + np.arange(chains))
    return with_prior(task, rng, parameters=chains, link=lambda x: x, mean=0, deviation=prior, noise=noise)


def random_paths(rng, runs, vertices=12, steps=5, mean=0.3, deviation=0.5, noise=0.7):
    """[DV] 4.3: H steps from vertex 0 of a connected random graph, whose edges have rewards with the log-normal means theta.

    ln theta ~ N(mean, deviation^2), and the logarithm of a reward is N(ln theta - noise^2 / 2, noise^2). Action j goes to vertex j.
    """
    vertex = np.arange(vertices)
    task = tables(runs, np.tile(vertex[:, None], (vertices, 1, 1)), start=0, horizon=steps)
    graphs = np.array([connected_graph(rng, vertices) for _ in range(runs)])
    task.known[:] = np.where(graphs, 0, NEVER)[..., None]
    task.factor[:] = 1
    task.parameter[:] = (np.minimum.outer(vertex, vertex) * vertices + np.maximum.outer(vertex, vertex))[..., None]
    return with_prior(task, rng, parameters=vertices**2, link=np.exp, mean=mean, deviation=deviation, noise=noise)


def connected_graph(rng, vertices):
    """Erdos and Renyi's random graph with edge probability 2 ln N / N, drawn again until it is connected."""
    while True:
        upper = np.triu(rng.random((vertices, vertices)) < 2 * np.log(vertices) / vertices, 1)
        graph = upper | upper.T
        if np.linalg.matrix_power(np.eye(vertices) + graph, vertices).all():
            return graph


def deep_sea(rng, runs, size=5, move_cost=0.01, slip=0.0, weight=1.0, deviation=1.0):
    """[O]: a diver sinks by one row per step, to the left or right; only a right move in the last row's last column pays 1.

    Which action moves right is drawn per cell and unknown: the prior of (left, right) is Dirichlet(weight, weight). The rewards of
    right moves in the last row are unknown as well, with the prior N(0, deviation^2), and observed exactly.
    """
    row, column = np.tril_indices(size)  # cells that can be reached, row by row
    below = np.cumsum(np.arange(size) + 1)[row]  # first cell of the row below; of the last row: the terminal state
    left, right = below + np.maximum(column - 1, 0), below + column + 1
    last = row == size - 1
    after = np.stack([np.where(last, row.size, left), np.where(last, row.size, right)], axis=-1)
    after = np.vstack([after, [[row.size, row.size]]])[:, None].repeat(2, axis=1)
    task = tables(runs, after, start=0, horizon=size)
    task.known[..., 1] = -move_cost / size
    task.known[:, -1] = NEVER
    task.factor[:-1, :, 1] = last[:, None]
    task.parameter[:-1] = np.where(last, column, 0)[:, None, None]
    task.weight = weight
    goes_right = rng.random((runs, row.size + 1)) < 0.5  # whether action 1 does
    task.chance[..., 1] = np.stack([~goes_right, goes_right], axis=-1) * (1 - slip)
    task.chance[..., 0] = 1 - task.chance[..., 1]
    task = with_prior(task, rng, parameters=size, link=lambda x: x, mean=0, deviation=deviation, noise=0)
    task.truth[:] = np.arange(size) == size - 1
    return task


def tables(runs, after, start, horizon):
    """A task with next states `after` [S, A, O], without rewards. Rewards are known + factor * link(x[parameter])."""
    shape = after.shape
    return SimpleNamespace(
        runs=runs, after=after, start=start, horizon=horizon, known=np.zeros((runs, *shape)), factor=np.zeros(shape),
        parameter=np.zeros(shape, int), chance=np.full((runs, *shape), 1 / shape[2]), weight=None,
    )  # fmt: skip


def with_prior(task, rng, parameters, link, mean, deviation, noise):
    """Adds the prior of x, and draws the true x of each run from it: [R, P]."""
    task.link, task.noise = link, noise
    task.goes_on = (task.known[..., 0] > NEVER).any(-1)  # states with actions: [R, S]
    task.mean, task.deviation = np.full(parameters, float(mean)), np.full(parameters, 1.0) * deviation
    task.truth = task.mean + task.deviation * rng.standard_normal((task.runs, parameters))
    return task


def slippery_sea(rng, runs):
    """A sea in which one of five moves to the right goes to the left instead, with other priors."""
    return deep_sea(rng, runs, size=4, slip=0.2, weight=0.5, deviation=2.0)


TASKS = {
    "bipolar chain": bipolar_chain,
    "parallel chains": parallel_chains,
    "random paths": random_paths,
    "deep sea": deep_sea,
    "slippery sea": slippery_sea,
}


def expectation(chance, value):
    """sum_o p value over the outcomes o, with the actions as the first axis: [A, n, S]."""
    return np.einsum("nsao,nsao->ans", chance, value, order="C")


def plan(task, runs, theta, chance, steps_left, state):
    """Backward induction in the MDP of each run with parameters theta [n, P] and outcome probabilities [n, S, A, O]:
    Q_h(s, a) = sum_o p (r + V_{h+1}(s')), V_h(s) = max_a Q_h(s, a). Returns the best action, the first of equal ones, and its value.
    """
    row = np.arange(len(state))
    reward = expectation(chance, task.known[runs] + task.factor * theta.take(task.parameter, axis=1))
    goes_on = task.goes_on[runs]
    value = np.zeros(goes_on.shape)
    action, at_state = np.zeros(len(state), int), np.zeros(len(state))
    for left in range(1, steps_left.max() + 1):
        of_action = reward + expectation(chance, value.take(task.after, axis=1))
        now = steps_left == left
        action[now] = of_action[:, row, state].argmax(0)[now]
        value = of_action.max(0) * goes_on
        at_state[now] = value[row, state][now]
    return action, at_state


class Team:
    """K agents in each of R runs, which share one posterior of their run's task and act at random times ([DV] 2 and 3)."""

    def __init__(self, task, algorithm, agents, episodes, rng):
        self.task, self.algorithm, self.rng = task, algorithm, rng
        runs, size = task.runs, (task.runs, agents)
        self.center, self.precision = np.tile(task.mean, (runs, 1)), np.tile(1 / task.deviation**2, (runs, 1))
        self.counts = np.zeros((runs, *task.after.shape))
        # Agents begin one after the other, or all at once if the gap is 0; actions and beginnings are events at these times.
        self.time = np.cumsum(rng.exponential(size=size), axis=1) * task.mean_gap
        self.begun, self.state, self.step = np.zeros(size, bool), np.full(size, task.start), np.zeros(size, int)
        self.episode, self.regret = np.zeros(size, int), np.zeros((*size, episodes))
        self.visited = np.zeros((runs, len(task.after)), bool)
        self.steps = np.zeros(runs, int)
        everything = np.arange(runs)
        start = np.full(runs, task.start)
        _, self.optimum = plan(task, everything, task.link(task.truth), task.chance, start * 0 + task.horizon, start)
        self.draw_seeds(agents)

    def draw_seeds(self, agents):
        """Agent seeds, drawn once: z of each parameter and, of each outcome, the Gamma-distributed prior weight; [DV] 3."""
        shared = self.algorithm == "shared seed"
        size = (self.task.runs, 1 if shared else agents)
        self.z = self.rng.standard_normal((*size, len(self.task.mean))).repeat(agents if shared else 1, axis=1)
        # Martingale: (prior sample - prior mean) / prior variance, to which each observation adds its noise / noise^2.
        self.drift = self.z / self.task.deviation
        self.kept = [None, None]  # theta and chance of "sample once"
        if self.task.weight:
            self.weights = self.rng.gamma(self.task.weight, size=(*size, *self.task.after.shape)).repeat(agents if shared else 1, axis=1)

    def play(self):
        """Advances each run by its earliest event, until all agents of all runs have finished their episodes."""
        while (runs := np.flatnonzero(np.isfinite(self.time).any(axis=1))).size:
            agent = self.time[runs].argmin(axis=1)
            begun = self.begun[runs, agent]
            self.begin(runs[~begun], agent[~begun])
            if begun.any():
                self.act(runs[begun], agent[begun])
            self.time[runs, agent] += self.rng.exponential(size=len(runs))
        return self

    def begin(self, runs, agent):
        self.begun[runs, agent], self.state[runs, agent], self.step[runs, agent] = True, self.task.start, 0
        self.visited[runs, self.task.start] = True

    def act(self, runs, agent):
        state, task = self.state[runs, agent], self.task
        theta, chance = self.sample(runs, agent)
        action, _ = plan(task, runs, theta, chance, task.horizon - self.step[runs, agent], state)
        if self.algorithm == "ε-greedy":
            exists = task.known[runs, state, :, 0] > NEVER
            drawn = np.where(exists, self.rng.random(exists.shape), -1).argmax(axis=1)
            action = np.where(self.rng.random(len(runs)) < EPSILON, drawn, action)
        outcome = (self.rng.random(len(runs)) >= task.chance[runs, state, action, 0]) * (task.after.shape[2] - 1)
        self.learn(runs, (state, action, outcome))
        self.move(runs, agent, (state, action, outcome))

    def sample(self, runs, agent):
        """theta [n, P] and outcome probabilities of the MDP that each acting agent plans in."""
        if self.algorithm == "Thompson resampling":
            return self.posterior_sample(runs)
        if self.algorithm == "sample once":
            first = self.step[runs, agent] == 0
            self.keep(runs[first], agent[first])
            return self.kept[0][runs, agent], self.kept[1][runs, agent]
        if self.algorithm == "ε-greedy":
            return self.posterior_mean(runs), self.shares(runs, (self.task.weight or 1) + self.counts[runs])
        deviation = 1 / np.sqrt(self.precision[runs])
        shift = deviation * self.z[runs, agent]
        if self.algorithm == "martingale seeds":
            shift = self.drift[runs, agent] * deviation**2
        elif self.algorithm == "UCRL":  # only for tasks with known transitions and Gaussian parameters
            shift = deviation * UCRL_WIDTH
        return self.task.link(self.center[runs] + shift), self.shares(runs, self.task.weight and self.weights[runs, agent])

    def keep(self, runs, agent):
        """Samples an MDP for the whole episode, at its first action."""
        for place, sample in enumerate(self.posterior_sample(runs)):
            if self.kept[place] is None:
                self.kept[place] = np.zeros((*self.time.shape, *sample.shape[1:]))
            self.kept[place][runs, agent] = sample

    def posterior_sample(self, runs):
        z = self.rng.standard_normal((len(runs), len(self.task.mean)))
        theta = self.task.link(self.center[runs] + z / np.sqrt(self.precision[runs]))
        return theta, self.shares(runs, self.task.weight and self.rng.gamma(self.task.weight + self.counts[runs]))

    def posterior_mean(self, runs):
        """E link(x): exp(m + v / 2) if log-normal, 0 of an unknown sign."""
        return self.task.link(self.center[runs] + (self.task.link is np.exp) / (2 * self.precision[runs]))

    def shares(self, runs, weights):
        """Dirichlet: each outcome's share of the weights of its action. Tasks with a single outcome have the chance 1."""
        return self.task.chance[runs] if self.task.weight is None else weights / weights.sum(-1, keepdims=True)

    def learn(self, runs, outcome):
        """Conjugate updates: 1/v += 1/noise^2 and m/v += y/noise^2; an agent adds Exp(1) to its weight of an observed outcome [DV] 3."""
        self.counts[(runs, *outcome)] += 1
        if self.task.weight:
            added = self.rng.exponential(size=(len(runs), 1 if self.algorithm == "shared seed" else self.time.shape[1]))
            self.weights[(runs, slice(None), *outcome)] += added
        told = self.task.factor[outcome] != 0
        runs, parameter, noise = runs[told], self.task.parameter[outcome][told], self.task.noise
        seen = self.task.truth[runs, parameter] + noise * self.rng.standard_normal(len(runs))
        if noise == 0:
            self.center[runs, parameter], self.precision[runs, parameter] = seen, np.inf
            return
        before = self.precision[runs, parameter]
        self.precision[runs, parameter] += 1 / noise**2
        self.center[runs, parameter] += (seen - self.center[runs, parameter]) / (1 + noise**2 * before)
        own_noise = self.rng.standard_normal((len(runs), self.time.shape[1])) / noise
        self.drift[runs, :, parameter] += own_noise

    def move(self, runs, agent, outcome):
        task, episode = self.task, self.episode[runs, agent]
        theta = task.link(task.truth[runs, task.parameter[outcome]])
        self.regret[runs, agent, episode] -= task.known[(runs, *outcome)] + task.factor[outcome] * theta
        self.state[runs, agent] = state = task.after[outcome]
        self.step[runs, agent] += 1
        self.steps[runs] += 1
        self.visited[runs, state] = True
        ended = (self.step[runs, agent] == task.horizon) | ~task.goes_on[runs, state]
        self.end(runs[ended], agent[ended])

    def end(self, runs, agent):
        self.regret[runs, agent, self.episode[runs, agent]] += self.optimum[runs]
        self.episode[runs, agent] += 1
        finished = self.episode[runs, agent] == self.regret.shape[2]
        self.time[runs[finished], agent[finished]] = np.inf
        self.begin(runs[~finished], agent[~finished])


def measures(name, algorithm, agents, runs, rng, change):
    """The measures of `runs` runs, by their names in results.csv. `change(task)` may falsify what agents are told of the drawn task."""
    task = TASKS[name](rng, runs)
    task.mean_gap, episodes = (0.0, 25) if name.endswith("sea") else (1.0, 1)
    change(task)
    team = Team(task, algorithm, agents, episodes, rng).play()
    found = {
        "regret": team.regret.sum(-1).mean(-1),
        "reach": (team.regret < 1e-9).any(-1).mean(-1),  # share of agents with an episode without regret
        "env_steps": team.steps,
        "team_coverage": team.visited.mean(-1),
    }
    if episodes > 1:
        found["At(of:Regret,episode:5)"] = team.regret[..., 4].mean(-1)
        found["Last(of:Regret)"] = team.regret[..., -1].mean(-1)
    return found
