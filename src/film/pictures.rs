//! Pictures that an environment of Gymnasium draws: recorded episodes are played again, from their seed
//! and their actions.

use std::collections::BTreeMap;

use super::episodes::{OTHER_EPISODE, chosen_episodes, differs, reset_streams, seed_after};
use super::timeline::{Shown, Timeline};
use super::{FilmError, FilmSettings, SeedsOfEpisodes};
use crate::record::{RecordedEpisode, RecordedStates};
use seedbed_env::gymnasium::{EnvironmentFailure, GymnasiumTask, PictureSource};
use seedbed_figure::{Picture, Pixels};

/// The pictures of a film.
#[derive(Debug)]
pub(super) struct Pictures(BTreeMap<Shown, Pixels>);

/// Height of a stored picture in pixels: that of its panel.
const HEIGHT: u32 = 206;

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
    Ok(of_episodes(&episodes, task, seeds, settings))
}

/// Plays episodes again, and takes the pictures that a film shows.
pub(super) fn of_episodes(
    episodes: &[RecordedEpisode],
    task: &GymnasiumTask,
    seeds: SeedsOfEpisodes,
    settings: FilmSettings,
) -> Result<(Timeline, Pictures), String> {
    let timeline = settings.timeline(episodes.iter().map(Into::into).collect(), &task.spec);
    let mut source = PictureSource::new(task);
    take(&mut source, episodes, &timeline, seeds)
        .map(|pictures| (timeline, pictures))
        .map_err(|reason| format!("the film shows no pictures of the environment: {reason}"))
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

/// Begins a recorded episode again.
fn begin(
    source: &mut PictureSource,
    episode: &RecordedEpisode,
    seeds: SeedsOfEpisodes,
) -> Result<(), String> {
    let first_state = episode.states().next().unwrap_or_default();
    for seed in reset_streams(episode, seeds).map(seed_after) {
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

fn reduced(source: &mut PictureSource) -> Result<Pixels, EnvironmentFailure> {
    let taken = source.picture()?;
    let pixels = Pixels {
        width: taken.width,
        height: taken.height,
        rgb: taken.rgb,
    };
    Ok(pixels.reduced_to(HEIGHT))
}
