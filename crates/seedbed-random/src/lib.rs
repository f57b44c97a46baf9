//! Named random streams: every random number of the workbench comes from a stream whose name is
//! (run seed, purpose, agent, round).
//!
//! A stream is derived from its name wherever it is needed, so that no generator has to be stored
//! in a checkpoint, and no draw depends on what other agents or threads did before. Nothing may use
//! randomness from the system.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// A stream of random bits: ChaCha with 8 rounds, the same on every machine.
pub type Stream = ChaCha8Rng;

/// What a stream is used for. Two purposes never share bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// The initial parameters φ̂ and θ̂ of an agent.
    InitialParameters = 1,
    /// An agent's reward seeds `z_1 … z_T`, drawn once.
    RewardSeeds = 2,
    /// The start states of an agent's episodes in one round.
    Reset = 3,
    /// The actions that an agent samples in one round.
    Action = 4,
    /// The order in which an agent trains on trajectories in one round.
    Shuffle = 5,
    /// Subsampling for the recording. It never affects learning.
    Recording = 6,
    /// Random actions in previews and benchmarks.
    Preview = 7,
    /// The initial parameters of a bonus model or of a model to plan in.
    ModelParameters = 8,
    /// The part of an agent seed that modifies the agent's bonus model or draws the model that it
    /// plans in, drawn once.
    ModelSeeds = 9,
    /// Minibatches and sampled weights for training a bonus model or a model to plan in in one round.
    ModelTraining = 10,
    /// Sampled weights for an agent's bonuses in one round.
    BonusNoise = 11,
    /// Sampled weights for comparing the bonuses of all agents on the same steps in one round. It
    /// never affects learning.
    BonusProbe = 12,
    /// The noise that an agent adds to the rewards of one trajectory, with [`transition_stream`].
    FreshRewardNoise = 13,
    /// A number of a task of rigid bodies that is drawn once per run. The index of the number takes
    /// the place of the agent.
    RunConstant = 14,
    /// The states of a round that an entropy bonus compares states with. The number of the update takes
    /// the place of the round.
    ReferenceStates = 15,
    /// The numbers of a task of rigid bodies that are drawn in each step. A number that is drawn at the
    /// start of the episode takes the place of the run seed, the step that of the agent.
    StepNumbers = 16,
    /// Start states and actions with which a task is tried before it is used.
    Trial = 17,
    /// The MDP of a tabular task, drawn from its prior once per run or, with `drawn_with`, once for
    /// all runs.
    TabularTask = 40,
    /// The fixed additive prior of a value model, drawn once.
    ValuePrior = 20,
    /// Transitions that a value model draws from the replay buffer in one round.
    Replay = 21,
    /// The reward seeds z of single transitions, with [`transition_stream`].
    TransitionSeeds = 22,
    /// Which transitions a value model learns from, with [`transition_stream`].
    TransitionMasks = 23,
    /// Which value model an agent acts by in one round.
    ModelChoice = 24,
    /// The index ξ by which an agent acts: for a run (round 0), or for one round.
    AgentIndex = 25,
    /// The indices ξ that a value model learns with in one round.
    TrainedIndices = 26,
    /// The random vectors z that perturb single transitions, with [`transition_stream`].
    TransitionNoise = 27,
    /// The draws of the models that an agent plans in, one per episode of a round, if they are not
    /// those of its agent seed.
    FreshModelSeeds = 28,
    /// The actions that a policy samples in the gradient steps of one round, and the critics that are drawn
    /// for them.
    UpdateNoise = 29,
    /// The part of an agent seed for the rewards of a tabular task, drawn once.
    TabularSeeds = 41,
    /// The noise that an agent seed adds to the observations of one parameter. The index of the
    /// parameter takes the place of the round.
    TabularNoise = 42,
    /// The exponentially distributed numbers of an agent seed for one outcome. The index of the
    /// outcome takes the place of the round.
    TabularTransitions = 43,
    /// An MDP that an agent samples before an action. The index of the action takes the place of
    /// the round.
    TabularResampling = 44,
    /// The times at which agents of a tabular task act.
    TabularClock = 45,
    /// The outcomes of an agent's actions in a tabular task.
    TabularOutcomes = 46,
    /// The times at which agents of a tabular task begin.
    TabularArrivals = 47,
    /// The points of example distributions in figures. The index of the distribution takes the place
    /// of the agent.
    ExamplePoints = 60,
    /// The values of one configuration that a search for parameters tries. The run seed is the search
    /// seed, a hash of the method's name takes the place of the agent, and the index of the
    /// configuration that of the round.
    TuningConfiguration = 61,
    /// The runs of a study that are repeated to verify its results. The number of the draw takes the place of
    /// the run seed.
    VerifiedRuns = 62,
}

/// The stream of one (run seed, purpose, agent, round).
///
/// The four numbers are the ChaCha key itself, little-endian, so distinct names give independent
/// streams.
#[must_use]
pub fn stream(run_seed: u64, purpose: Purpose, agent: u32, round: u32) -> Stream {
    let mut key = [0_u8; 32];
    key[..8].copy_from_slice(&run_seed.to_le_bytes());
    key[8..16].copy_from_slice(&(purpose as u64).to_le_bytes());
    key[16..24].copy_from_slice(&u64::from(agent).to_le_bytes());
    key[24..].copy_from_slice(&u64::from(round).to_le_bytes());
    Stream::from_seed(key)
}

/// The stream of one transition for one value model, whose name is (run seed, purpose, model,
/// acting agent, episode, step).
///
/// The first four numbers are the key of [`stream`], the episode is ChaCha's nonce, and each step
/// has a ChaCha block of its own.
#[must_use]
pub fn transition_stream(
    run_seed: u64,
    purpose: Purpose,
    model: u32,
    (agent, episode, step): (u32, u32, u32),
) -> Stream {
    const BLOCK_WORDS: u128 = 16;
    let mut stream = stream(run_seed, purpose, model, agent);
    stream.set_stream(episode.into());
    stream.set_word_pos(BLOCK_WORDS * u128::from(step));
    stream
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn streams_differ_in_every_part_of_the_name() {
        let first =
            |seed, purpose, agent, round| stream(seed, purpose, agent, round).random::<u64>();
        let base = first(1, Purpose::Action, 2, 3);
        assert_eq!(base, first(1, Purpose::Action, 2, 3));
        assert_ne!(base, first(2, Purpose::Action, 2, 3));
        assert_ne!(base, first(1, Purpose::Reset, 2, 3));
        assert_ne!(base, first(1, Purpose::Action, 3, 3));
        assert_ne!(base, first(1, Purpose::Action, 2, 4));
    }

    #[test]
    fn transition_streams_differ_in_every_part_of_the_name() {
        let first = |model, agent, episode, step| {
            transition_stream(1, Purpose::TransitionSeeds, model, (agent, episode, step))
                .random::<u64>()
        };
        let names = [
            (0, 0, 0, 0),
            (1, 0, 0, 0),
            (0, 1, 0, 0),
            (0, 0, 1, 0),
            (0, 0, 0, 1),
            (0, 0, 0, 2),
        ];
        let bits = names.map(|(model, agent, episode, step)| first(model, agent, episode, step));
        for (index, one) in bits.iter().enumerate() {
            assert!(bits[index + 1..].iter().all(|other| other != one));
        }
        assert_eq!(bits[4], first(0, 0, 0, 1));
    }
}
