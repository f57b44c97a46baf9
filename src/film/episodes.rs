//! Recorded episodes of the filmed agent.

use rand::RngExt;

use super::timeline::ShownEpisode;
use super::{FilmError, FilmSettings, SeedsOfEpisodes, evenly_spaced};
use crate::record::{RecordedEpisode, RecordedStates};
use seedbed_random::{Purpose, Stream, stream};

/// Why an episode cannot be shown.
pub(super) const OTHER_EPISODE: &str =
    "episodes that are played again are others than the recorded ones";

/// Recorded episodes of the filmed agent, evenly spaced.
pub(super) fn chosen_episodes(
    recording: &RecordedStates,
    settings: FilmSettings,
) -> Result<Vec<RecordedEpisode>, FilmError> {
    let mut numbers = Vec::new();
    for_each_of_agent(recording, settings.agent, |episode| {
        numbers.push(episode.episode);
    })?;
    let numbers = evenly_spaced(numbers, settings.scenes);
    episodes_with_numbers(recording, settings.agent, &numbers)
}

/// The recorded episodes of an agent with these numbers, as far as they are recorded.
pub(super) fn episodes_with_numbers(
    recording: &RecordedStates,
    agent: u32,
    numbers: &[u32],
) -> Result<Vec<RecordedEpisode>, FilmError> {
    let mut chosen = Vec::new();
    for_each_of_agent(recording, agent, |episode| {
        if numbers.contains(&episode.episode) {
            chosen.push(episode);
        }
    })?;
    Ok(chosen)
}

fn for_each_of_agent(
    recording: &RecordedStates,
    agent: u32,
    mut action: impl FnMut(RecordedEpisode),
) -> Result<(), FilmError> {
    for episode in recording.episodes()? {
        let episode = episode?;
        if episode.agent == agent {
            action(episode);
        }
    }
    Ok(())
}

impl From<&RecordedEpisode> for ShownEpisode {
    fn from(episode: &RecordedEpisode) -> Self {
        Self::with_rewards(episode.episode, &episode.rewards)
    }
}

/// The random streams from which an episode may have drawn its start, each with the number of resets before it: that of its
/// round or, where agents do not wait for each other, one of its own.
pub(super) fn reset_streams(
    episode: &RecordedEpisode,
    seeds: SeedsOfEpisodes,
) -> [(Stream, u32); 2] {
    let of_round = |round| stream(seeds.run_seed, Purpose::Reset, episode.agent, round);
    let in_round = episode.episode % seeds.episodes_per_round.max(1);
    [
        (of_round(episode.round), in_round),
        (of_round(episode.episode), 0),
    ]
}

/// The seed of an environment of Gymnasium after this number of resets.
pub(super) fn seed_after((mut resets, before): (Stream, u32)) -> u32 {
    (0..before).fold(resets.random(), |_, _| resets.random())
}

/// Whether an observation is another than the recorded one.
pub(super) fn differs(recorded: &[f32], observation: &[f32]) -> bool {
    let bits = |numbers: &[f32]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    bits(recorded) != bits(observation)
}
