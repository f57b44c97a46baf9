//! Pictures that an environment of Gymnasium draws: recorded episodes are played again, from their seed
//! and their actions.

use std::collections::BTreeMap;

use rand::RngExt;

use super::timeline::{Shown, Timeline};
use super::{FilmError, FilmSettings, SeedsOfEpisodes, evenly_spaced};
use crate::record::{RecordedEpisode, RecordedStates};
use seedbed_env::gymnasium::{EnvironmentFailure, GymnasiumTask, PictureSource};
use seedbed_figure::{Picture, Pixels};
use seedbed_random::{Purpose, stream};

/// The pictures of a film.
#[derive(Debug)]
pub(super) struct Pictures(BTreeMap<Shown, Pixels>);

/// Height of a stored picture in pixels: that of its panel.
const HEIGHT: u32 = 206;

/// Why an episode cannot be shown.
const OTHER_EPISODE: &str = "episodes that are played again are others than the recorded ones";

impl Pictures {
    pub(super) fn picture(&self, shown: Shown, title: String) -> Picture {
        let pixels = self.0[&shown].clone();
        Picture { title, pixels }
    }
}

/// Plays recorded episodes of an agent again, and takes the pictures that a film shows. The inner error says why
/// there are none.
pub(super) fn play_again(
    recording: &RecordedStates,
    task: &GymnasiumTask,
    seeds: SeedsOfEpisodes,
    settings: FilmSettings,
) -> Result<Result<(Timeline, Pictures), String>, FilmError> {
    let episodes = chosen_episodes(recording, settings)?;
    if episodes.is_empty() {
        return Ok(Err(format!(
            "no episode of agent {} is recorded",
            settings.agent
        )));
    }
    let timeline = Timeline {
        episodes: episodes
            .iter()
            .map(|episode| (episode.episode, episode.length() + 1))
            .collect(),
        steps_per_frame: settings.steps_per_frame(&task.spec),
        frames: settings.frame_count(),
    };
    let mut source = PictureSource::new(task);
    let taken = take(&mut source, &episodes, &timeline, seeds);
    Ok(taken
        .map(|pictures| (timeline, pictures))
        .map_err(|reason| format!("the film shows no pictures of the environment: {reason}")))
}

/// Recorded episodes of the filmed agent, evenly spaced.
fn chosen_episodes(
    recording: &RecordedStates,
    settings: FilmSettings,
) -> Result<Vec<RecordedEpisode>, FilmError> {
    let mut numbers = Vec::new();
    for_each_of_agent(recording, settings.agent, |episode| {
        numbers.push(episode.episode);
    })?;
    let numbers = evenly_spaced(numbers, settings.scenes);
    let mut chosen = Vec::new();
    for_each_of_agent(recording, settings.agent, |episode| {
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

fn take(
    source: &mut PictureSource,
    episodes: &[RecordedEpisode],
    timeline: &Timeline,
    seeds: SeedsOfEpisodes,
) -> Result<Pictures, String> {
    let mut wanted: BTreeMap<usize, Vec<Shown>> = BTreeMap::new();
    for frame in 0..timeline.frames {
        let shown = timeline.shown_at(frame);
        wanted.entry(shown.index).or_default().push(shown);
    }
    let mut pictures = BTreeMap::new();
    for (index, mut shown) in wanted {
        shown.dedup();
        take_of_episode(source, &episodes[index], seeds, &shown, &mut pictures)?;
    }
    Ok(Pictures(pictures))
}

/// Takes pictures of an episode. `shown`: states in ascending order
fn take_of_episode(
    source: &mut PictureSource,
    episode: &RecordedEpisode,
    seeds: SeedsOfEpisodes,
    shown: &[Shown],
    pictures: &mut BTreeMap<Shown, Pixels>,
) -> Result<(), String> {
    begin(source, episode, seeds)?;
    let width = episode.actions.len() / episode.length().max(1);
    let mut states = episode.states();
    states.next();
    let mut played = 0;
    for &shown in shown {
        while played < shown.state {
            let action = &episode.actions[played * width..][..width];
            let observation = source.step(action).map_err(|failure| reason(&failure))?;
            if states
                .next()
                .is_none_or(|recorded| differs(recorded, observation))
            {
                return Err(OTHER_EPISODE.to_owned());
            }
            played += 1;
        }
        pictures.insert(shown, reduced(source).map_err(|failure| reason(&failure))?);
    }
    Ok(())
}

/// Begins a recorded episode again. Its seed has the episode's number within its round or, where agents do not wait
/// for each other, within the run.
fn begin(
    source: &mut PictureSource,
    episode: &RecordedEpisode,
    seeds: SeedsOfEpisodes,
) -> Result<(), String> {
    let SeedsOfEpisodes {
        run_seed,
        episodes_per_round,
    } = seeds;
    let seed = |round: u32, number: u32| -> u32 {
        let mut resets = stream(run_seed, Purpose::Reset, episode.agent, round);
        (0..number).fold(resets.random(), |_, _| resets.random())
    };
    let first_state = episode.states().next().unwrap_or_default();
    let in_round = episode.episode % episodes_per_round.max(1);
    for seed in [seed(episode.round, in_round), seed(0, episode.episode)] {
        let observation = source.reset(seed).map_err(|failure| reason(&failure))?;
        if !differs(first_state, observation) {
            return Ok(());
        }
    }
    Err(OTHER_EPISODE.to_owned())
}

/// What went wrong, without Python's traceback.
fn reason(failure: &EnvironmentFailure) -> String {
    let lines = failure
        .message
        .lines()
        .filter(|line| !line.starts_with("    "));
    lines.collect::<Vec<_>>().join("\n")
}

fn differs(recorded: &[f32], observation: &[f32]) -> bool {
    let bits = |numbers: &[f32]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    bits(recorded) != bits(observation)
}

fn reduced(source: &mut PictureSource) -> Result<Pixels, EnvironmentFailure> {
    let taken = source.picture()?;
    let pixels = Pixels {
        width: taken.width,
        height: taken.height,
        rgb: taken.rgb,
    };
    Ok(pixels.reduced_to(HEIGHT))
}
