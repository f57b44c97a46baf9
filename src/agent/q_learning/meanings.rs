//! What each parameter of the value-based learners means, for people.

/// What each algorithm is for.
pub(in crate::agent) const PURPOSES: [&str; 3] = [
    "Q-learning (thesis §1.4.1) on the team's newest transitions: one network for all, or one each.",
    "Seed TD, seed LSVI, seed ensembles (thesis §2.4): models of Q, each with its own fixed seeds of rewards (`agents.seeds`), start and prior.",
    "Bootstrapped DQN with randomised priors: each round an agent follows a model drawn from one set.",
];

/// What each parameter of Q-learning means, and what may stand there.
pub(in crate::agent) const Q_LEARNING: [(&str, &str); 5] = [
    (
        "networks",
        "who has a network: Shared, the team has one | Own, each agent has one",
    ),
    ("exploration", EXPLORATION),
    ("double", DOUBLE),
    ("learning", LEARNING),
    ("bonus", BONUS),
];

/// The same of Seed TD.
pub(in crate::agent) const SEED_TD: [(&str, &str); 8] = [
    (
        "models",
        "how many models there are: Own, one an agent | Ensemble(most: n), one an agent up to n, then agent k follows model k mod n",
    ),
    (
        "fit",
        "how a model is fitted: Td | Lsvi(iterations: n), anew from its start at the end of every round, n regressions each on the one before",
    ),
    (
        "regularisation",
        "λ, the pull of a model back to its initial parameters",
    ),
    ("prior_scale", PRIOR),
    ("exploration", EXPLORATION),
    ("double", DOUBLE),
    ("learning", LEARNING),
    ("bonus", BONUS),
];

/// The same of bootstrapped DQN.
pub(in crate::agent) const BOOTSTRAPPED_DQN: [(&str, &str); 7] = [
    (
        "models",
        "models in the set from which each agent draws one for a round",
    ),
    ("prior_scale", PRIOR),
    (
        "mask",
        "how much of the transitions each model learns from, above 0 to 1",
    ),
    ("exploration", EXPLORATION),
    ("double", DOUBLE),
    ("learning", LEARNING),
    ("bonus", BONUS),
];

const EXPLORATION: &str = "how actions are chosen: Greedy | EpsilonGreedy(from: ε, to: ε, steps: n), in a straight line over the first n \
                           steps of each agent | Gibbs(temperature: τ), in proportion to exp(Q/τ)";
const DOUBLE: &str =
    "whether the learning network chooses the action that the target network judges: true | false";
const PRIOR: &str =
    "β: a value is the learned network's plus β times that of a fixed random one; 0 is none";
const LEARNING: &str = "discount: γ; time_limit: Ends | Bootstraps; observations: Raw | Range | Running; hidden: units of the layers; \
                        replay: transitions of the team that are kept; minibatch: transitions of a gradient step; minibatches: \
                        gradient steps whenever a model learns; target_every: gradient steps between two target networks; \
                        gradient_clip: Some(c) | None; optimiser: Adam";
const BONUS: &str = "what is added to rewards: None | Vime(…) | Rnd(…), as for SeedPg";
