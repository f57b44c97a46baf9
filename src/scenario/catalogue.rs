//! What a scenario can set besides its algorithm, for people.

use super::Scenario;
use crate::agent::Team;
use crate::agent::catalogue::{Parameter, parameters};

/// What each parameter of a team means, and what may stand there.
const TEAM: [(&str, &str); 3] = [
    ("count", "agents.count: how many agents, K"),
    (
        "seeds",
        "agents.seeds: what each agent's own perturbations of rewards are drawn from, once: Normal(sigma: σ) | Uniform(sigma: σ) | \
         Laplace(sigma: σ) | TwoPoint(sigma: σ)",
    ),
    (
        "initial",
        "agents.initial: how networks start: Random | Constant(c)",
    ),
];

/// The same of what else a scenario says.
const REST: [(&str, &str); 6] = [
    (
        "physics",
        "rigid bodies, or the task's closed-form twin: Rapier | Analytic",
    ),
    (
        "schedule",
        "when agents learn: Synchronous(episodes: n), all at once when each has finished n | Asynchronous(training: (env_steps: n)), \
         each when its episode ends, for n steps of the others | Lockstep(learn_every: n), value-based learners after every n steps",
    ),
    (
        "stop",
        "when the run ends: Episodes(n) | Solved(return: r, window: w, at_most: n)",
    ),
    (
        "recording",
        "what the recording shows: (lines: n, window: how many of the latest rounds and episodes are shown together, \
         colour: Agent | Episode | Return | Outcome | IntrinsicReward, \
         axes: [Observations, Action, Reward(from: a, to: b), Advantage(from: a, to: b), IntrinsicReward, Step], \
         pairs: First(n) | These([(\"x\", \"v\")]), \
         difference: MostDifferent | Between(0, 1) | Off, density_every: rounds between two pictures (more in long runs), \
         raw_every: every how many episodes states are columns, scene: None | Some((agents: [k], every: n)))",
    ),
    ("checkpoint_every", "rounds between two checkpoints"),
    (
        "seed",
        "the run's seed, from which every random number derives",
    ),
];

impl Scenario {
    /// The team's parameters and the rest, with their defaults.
    #[must_use]
    pub fn catalogue() -> Vec<Parameter> {
        let rest = parameters(&Self::shortest(), &REST)
            .into_iter()
            .filter(|parameter| !parameter.meaning.is_empty());
        parameters(&Team::default(), &TEAM)
            .into_iter()
            .chain(rest)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_is_there() {
        let names: Vec<String> = Scenario::catalogue()
            .into_iter()
            .map(|parameter| parameter.name)
            .collect();
        let expected: Vec<&str> = TEAM.iter().chain(&REST).map(|(name, _)| *name).collect();
        assert_eq!(names, expected);
        assert!(
            Scenario::catalogue()
                .iter()
                .all(|parameter| !parameter.meaning.is_empty() && !parameter.default.is_empty())
        );
    }
}
