//! Every random number of the workbench comes from a stream named by (run seed, purpose, agent, round).
//!
//! A stream is derived afresh wherever it is needed, so no generator has to be stored in a checkpoint and
//! no draw depends on what other agents or threads did before it. Ambient randomness may not enter.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// A stream of random bits: ChaCha with 8 rounds, the same on every machine.
pub type Stream = ChaCha8Rng;

/// What a stream is drawn for. Two purposes never share bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// An agent's initial parameters φ̂ and θ̂.
    InitialParameters = 1,
    /// An agent's seeds `z_1 … z_T`, drawn once.
    RewardSeeds = 2,
    /// The start states of an agent's episodes in one round.
    Reset = 3,
    /// The actions that an agent samples in one round.
    Action = 4,
    /// The order in which an agent trains on trajectories in one round.
    Shuffle = 5,
    /// Subsampling for the recording. Never touches learning.
    Recording = 6,
    /// Random behaviour in previews and benchmarks.
    Preview = 7,
    /// The initial parameters of a model of the dynamics.
    ModelParameters = 8,
    /// What an agent's seeds make of such a model, drawn once.
    ModelSeeds = 9,
    /// Minibatches and draws of weights for a model's training in one round.
    ModelTraining = 10,
    /// Draws of weights for an agent's bonuses in one round.
    BonusNoise = 11,
    /// Draws of weights for judging the same steps in one round. Never touches learning.
    Judgement = 12,
    /// Redrawing runs for intervals, always from run seed 0. Never touches learning.
    Bootstrap = 13,
    /// Which finite task it is: drawn from its prior, once a run.
    TabularTask = 40,
    /// The fixed additive prior of a value model, drawn once.
    ValuePrior = 20,
    /// Transitions that a value model draws from the replay in one round.
    Replay = 21,
    /// The seeds z of single transitions, by [`transition_stream`].
    TransitionSeeds = 22,
    /// Which transitions a value model learns from, by [`transition_stream`].
    TransitionMasks = 23,
    /// Which value model an agent follows in one round.
    ModelChoice = 24,
    /// What an agent's seed makes of beliefs about a finite task's rewards, drawn once.
    TabularSeeds = 41,
    /// The noise that an agent's seed adds to what anybody sees of one parameter, which stands in the place of the round.
    TabularNoise = 42,
    /// The exponentials of an agent's seed for one outcome, which stands in the place of the round.
    TabularTransitions = 43,
    /// An MDP that an agent draws anew, before the action that stands in the place of the round.
    TabularResampling = 44,
    /// When agents of a finite task act.
    TabularClock = 45,
    /// What becomes of an agent's actions in a finite task.
    TabularOutcomes = 46,
    /// When agents of a finite task begin.
    TabularArrivals = 47,
}

/// The stream of one (run seed, purpose, agent, round).
///
/// The four numbers are the ChaCha key itself, little-endian, so distinct names give independent streams.
#[must_use]
pub fn stream(run_seed: u64, purpose: Purpose, agent: u32, round: u32) -> Stream {
    let mut key = [0_u8; 32];
    key[..8].copy_from_slice(&run_seed.to_le_bytes());
    key[8..16].copy_from_slice(&(purpose as u64).to_le_bytes());
    key[16..24].copy_from_slice(&u64::from(agent).to_le_bytes());
    key[24..].copy_from_slice(&u64::from(round).to_le_bytes());
    Stream::from_seed(key)
}

/// The stream of one transition, for one value model: of (run seed, purpose, model, source agent, episode, step).
///
/// The first four are the key of [`stream`], the episode is ChaCha's nonce, and every step has a block of its own.
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

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn every_part_of_the_name_matters() {
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
    fn every_part_of_a_transition_matters() {
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
