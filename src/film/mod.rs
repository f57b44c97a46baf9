//! Films of runs: the bodies of one agent, the states that all agents have visited so far, and their
//! returns, from the first episode to the last.
//!
//! [`Film::new`] chooses the scenes, [`Film::frame`] arranges one picture, [`gif`] encodes pictures.

pub mod gif;

use std::path::PathBuf;

use crate::plotting;
use crate::record::visitation::Unplaced;
use crate::record::{ReadError, RecordedScene, RecordedStates};
use crate::review::selection::{EpisodeSelection, SelectedState, SelectedStates, StateSelection};
use crate::review::{LoadRunError, LoadedRun};
use crate::run::Plan;
use crate::run::facts::EpisodeRow;
use crate::run::facts::returns::team_returns;
use seedbed_env::{Physics, Scene, TaskDescription};
use seedbed_figure::color::{TEAM_COLOR, agent_color};
use seedbed_figure::{
    Axis, Curves, Drawing, Figure, Panel, ParallelCoordinates, Row, Series, StateLine, States,
};
use seedbed_input::InputError;
use seedbed_scene::{camera, drawing};

/// What is filmed: a recording and the task in which it was made.
#[derive(Debug)]
pub struct Filmed<'a> {
    /// Title of all frames.
    pub title: String,
    /// The visited states.
    pub recording: &'a RecordedStates,
    /// The task, whose bodies are drawn, and its simulation. `None` if another program recorded the
    /// run; then there are no bodies.
    pub task: Option<(&'a TaskDescription, Physics)>,
    /// Number of agents K.
    pub agent_count: usize,
    /// One row per episode, in (round, agent) order.
    pub episodes: &'a [EpisodeRow],
}

/// How it is filmed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmSettings {
    /// Agent whose bodies are drawn.
    pub agent: u32,
    /// Duration, s.
    pub seconds: f64,
    /// Number of frames per second.
    pub frames_per_second: u32,
    /// Width of a frame in pixels.
    pub width: u32,
    /// Maximum number of episodes whose bodies are shown, one after the other.
    pub scenes: usize,
}

/// Why there is no film.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// The run has no recording, or is only a recording.
    #[error("{0} has no recording and scenario, from which a film is made")]
    NotRecorded(PathBuf),
    /// The run has no such agent.
    #[error("{run} has no agent {agent}: it has agents 0 to {last}", last = agent_count - 1)]
    NoAgent {
        /// The run.
        run: PathBuf,
        /// The agent.
        agent: u32,
        /// Number of agents.
        agent_count: usize,
    },
    /// The scenario of the run or its task cannot be read.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The run cannot be read.
    #[error(transparent)]
    Run(#[from] LoadRunError),
}

impl From<ReadError> for FilmError {
    fn from(error: ReadError) -> Self {
        Self::Run(error.into())
    }
}

/// A film before it is drawn.
#[derive(Debug)]
pub struct Film {
    settings: FilmSettings,
    title: String,
    bodies: Option<Bodies>,
    axes: Vec<Axis>,
    /// A sample of visited states of all agents, in the order of episodes.
    states: Vec<(u32, SelectedState)>,
    /// Returns of each agent.
    returns: Vec<Vec<f64>>,
    team_returns: Vec<f64>,
}

/// The episodes in which bodies are drawn.
#[derive(Debug)]
struct Bodies {
    scene: Scene,
    episodes: Vec<RecordedScene>,
    bounds: [f32; 4],
    /// Number of environment steps per frame: bodies move in real time.
    steps_per_frame: f64,
}

/// Number of states that are drawn at the end of the film.
const MAX_LINES: usize = 600;

/// Maximum number of observations with an axis. More would be narrower than a pixel.
const MAX_AXES: usize = 100;

/// Maximum number of agents with a curve of their own.
const MAX_AGENT_CURVES: usize = 16;

impl Film {
    /// The film of a run. See [`new`](Self::new).
    ///
    /// # Errors
    /// The run has no recording, no scenario or no such agent, or a file cannot be read.
    pub fn of_run(
        run: &LoadedRun,
        settings: FilmSettings,
        on_episode: &mut dyn FnMut(),
    ) -> Result<Self, FilmError> {
        let not_recorded = || FilmError::NotRecorded(run.path.clone());
        let recording = run.recording.as_ref().ok_or_else(not_recorded)?;
        let folder = run.folder.as_ref().ok_or_else(not_recorded)?;
        let agent_count = run.agent_count();
        if settings.agent as usize >= agent_count {
            return Err(FilmError::NoAgent {
                run: run.path.clone(),
                agent: settings.agent,
                agent_count,
            });
        }
        let has_scenario = recording.state_files().is_none();
        let plan = has_scenario.then(|| Plan::of_run(folder)).transpose()?;
        let filmed = Filmed {
            title: run.name(),
            recording,
            task: plan
                .as_ref()
                .map(|plan| (&plan.description, plan.scenario.physics)),
            agent_count,
            episodes: &run.episodes,
        };
        Self::new(filmed, settings, on_episode)
    }

    /// A film. Without recorded bodies, it shows states and returns only. Calls `on_episode` for each
    /// episode that is read.
    ///
    /// # Errors
    /// The recording cannot be read, or the task cannot be built.
    pub fn new(
        filmed: Filmed<'_>,
        settings: FilmSettings,
        on_episode: &mut dyn FnMut(),
    ) -> Result<Self, FilmError> {
        let (recording, agent_count) = (filmed.recording, filmed.agent_count);
        let axes = recording.axes();
        let selection = StateSelection {
            episodes: EpisodeSelection::all(),
            conditions: Vec::new(),
            sample_size: MAX_LINES / agent_count.clamp(1, MAX_LINES),
            axes: (0..axes.all().len().min(MAX_AXES)).collect(),
            pairs: Vec::new(),
            all_axes: axes,
        };
        let selected = selection.select(recording, |_| on_episode())?;
        let returns = |agent: u32| {
            let rows = filmed.episodes.iter().filter(move |row| row.agent == agent);
            rows.map(|row| row.r#return).collect()
        };
        Ok(Self {
            settings,
            bodies: Bodies::read(&filmed, settings)?,
            axes: axes_of_film(&selection, &selected),
            states: in_order_of_episodes(selected),
            returns: (0..agent_count as u32).map(returns).collect(),
            team_returns: team_returns(filmed.episodes, agent_count),
            title: filmed.title,
        })
    }

    /// Whether the film shows bodies.
    #[must_use]
    pub fn has_bodies(&self) -> bool {
        self.bodies.is_some()
    }

    /// Number of frames.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        let settings = self.settings;
        (settings.seconds * f64::from(settings.frames_per_second)).round() as usize
    }

    /// Frame `number`, which is below [`frame_count`](Self::frame_count).
    #[must_use]
    pub fn frame(&self, number: usize) -> Figure {
        let episode = self.episode_at(number);
        let mut panels = Vec::new();
        if let Some(bodies) = &self.bodies {
            panels.push(Panel::Drawing(bodies.drawing(
                self.settings,
                number,
                self.frame_count(),
            )));
        }
        panels.push(Panel::ParallelCoordinates(self.visited_states(episode)));
        Figure {
            title: self.title.clone(),
            description: String::new(),
            width: f64::from(self.settings.width),
            rows: vec![
                Row {
                    height: 230.0,
                    panels,
                    key: None,
                },
                Row {
                    height: 120.0,
                    panels: vec![Panel::Curves(self.curves(episode))],
                    key: None,
                },
            ],
        }
    }

    /// The newest episode of which a frame shows states and returns. It grows evenly between the
    /// episodes whose bodies are shown.
    fn episode_at(&self, frame: usize) -> u32 {
        let last = self.returns.iter().map(Vec::len).max().unwrap_or(0).max(1) - 1;
        let position = (frame + 1) as f64 / self.frame_count().max(1) as f64;
        let Some(bodies) = &self.bodies else {
            return (position * last as f64) as u32;
        };
        let shown = bodies.shown_at(frame, self.frame_count());
        let start = bodies.episodes[shown].episode;
        let next = bodies.episodes.get(shown + 1);
        let end = next.map_or(last as u32, |scene| scene.episode);
        let within = position * bodies.episodes.len() as f64 - shown as f64;
        start + (within.clamp(0.0, 1.0) * f64::from(end.saturating_sub(start))) as u32
    }

    fn visited_states(&self, episode: u32) -> ParallelCoordinates {
        let visited = self.states.iter();
        let visited = visited.take_while(|(_, state)| state.episode <= episode);
        let lines = visited.map(|(agent, state)| StateLine {
            axis_positions: state.selected_axis_positions.clone(),
            color: agent_color(*agent),
        });
        ParallelCoordinates {
            title: format!("visited states of all agents, episodes 0 to {episode}"),
            axes: self.axes.clone(),
            states: States::Lines(lines.collect()),
        }
    }

    /// Name of the axis of returns, with the share of NaN, where curves have gaps.
    fn label_of_returns(&self) -> String {
        let all = || self.returns.iter().flatten();
        let nan = all().filter(|value| value.is_nan()).count();
        if nan == 0 {
            return "return".to_owned();
        }
        format!(
            "return (NaN {:.1} %)",
            100.0 * nan as f64 / all().count() as f64
        )
    }

    fn curves(&self, episode: u32) -> Curves {
        let points = |returns: &[f64]| -> Vec<[f64; 2]> {
            let numbered = returns.iter().enumerate().take(episode as usize + 1);
            numbered
                .map(|(number, value)| [number as f64, *value])
                .collect()
        };
        let agents = (0..).zip(&self.returns).take(MAX_AGENT_CURVES);
        let mut series: Vec<Series> = agents
            .map(|(agent, returns)| Series {
                color: agent_color(agent),
                points: points(returns),
                is_faint: true,
                ..Series::default()
            })
            .collect();
        series.push(Series {
            color: TEAM_COLOR,
            points: points(&self.team_returns),
            ..Series::default()
        });
        let all = self.returns.iter().flatten();
        let [low, high] = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| {
            [low.min(value), high.max(value)]
        });
        let last = self.returns.iter().map(Vec::len).max().unwrap_or(0);
        Curves {
            x_label: "episode".to_owned(),
            y_label: self.label_of_returns(),
            series,
            x_range: Some([0.0, (last.max(2) - 1) as f64]),
            y_range: (low < high).then_some([low, high]),
            ..Curves::default()
        }
    }
}

/// All axes, with the shares of states of all agents that have no place on them.
fn axes_of_film(selection: &StateSelection, selected: &[SelectedStates]) -> Vec<Axis> {
    let states = selected.iter().map(|agent| agent.count).sum();
    let axes = selection.all_axes.all().iter().enumerate().take(MAX_AXES);
    axes.map(|(index, axis)| {
        let mut unplaced = Unplaced::default();
        for agent in selected {
            unplaced += agent.unplaced[index];
        }
        plotting::axis_with_shares(&axis.quantity, unplaced.shares(states).to_array())
    })
    .collect()
}

/// The sampled states of all agents, in the order of episodes.
fn in_order_of_episodes(selected: Vec<SelectedStates>) -> Vec<(u32, SelectedState)> {
    let mut states: Vec<(u32, SelectedState)> = Vec::new();
    for agent in selected {
        states.extend(agent.sample.into_iter().map(|state| (agent.agent, state)));
    }
    states.sort_by_key(|(_, state)| state.episode);
    states
}

impl Bodies {
    /// `None` if the task has no bodies, or none were recorded.
    fn read(filmed: &Filmed<'_>, settings: FilmSettings) -> Result<Option<Self>, FilmError> {
        let Some((description, physics)) = filmed.task else {
            return Ok(None);
        };
        let environment = seedbed_env::build(description, physics, 1)?;
        let Some(scene) = environment.scene() else {
            return Ok(None);
        };
        let recorded = filmed.recording.scenes(settings.agent, scene)?;
        let episodes = evenly_spaced(recorded, settings.scenes);
        let motions = episodes.iter().map(RecordedScene::motion);
        let Some(bounds) = camera::bounds_of_episodes(scene, motions) else {
            return Ok(None);
        };
        let frame_time = 1.0 / f64::from(settings.frames_per_second);
        let control_step = description.spec().control_step;
        Ok(Some(Self {
            scene: scene.clone(),
            episodes,
            bounds,
            steps_per_frame: frame_time / control_step,
        }))
    }

    /// Index of the episode that a frame shows. All episodes are shown for the same time.
    fn shown_at(&self, frame: usize, frames: usize) -> usize {
        (frame * self.episodes.len() / frames.max(1)).min(self.episodes.len() - 1)
    }

    fn drawing(&self, settings: FilmSettings, frame: usize, frames: usize) -> Drawing {
        let shown = self.shown_at(frame, frames);
        let first_frame = |number: usize| (number * frames).div_ceil(self.episodes.len());
        let steps = |frames: usize| (frames as f64 * self.steps_per_frame) as usize;
        let episode = &self.episodes[shown];
        let states = episode.poses.chunks_exact(self.scene.bodies.len());
        // The last seconds of a longer episode: they show how it ends.
        let last = states.len() - 1;
        let start = last.saturating_sub(steps(first_frame(shown + 1) - first_frame(shown)));
        let state = (start + steps(frame - first_frame(shown))).min(last);
        let poses = states
            .clone()
            .nth(state)
            .expect("the state is in the episode");
        Drawing {
            title: format!(
                "agent {}, recorded episode {}",
                settings.agent, episode.episode
            ),
            shapes: drawing::shapes(&self.scene, poses, &episode.terrain, settings.agent),
            bounds: self.bounds,
        }
    }
}

/// At most `count` items, with the first and the last one.
pub(crate) fn evenly_spaced<T>(items: Vec<T>, count: usize) -> Vec<T> {
    let last = items.len().saturating_sub(1);
    let gaps = count.min(items.len()).saturating_sub(1).max(1);
    let chosen: Vec<usize> = (0..=gaps).map(|number| number * last / gaps).collect();
    let numbered = items.into_iter().enumerate();
    numbered
        .filter(|(index, _)| chosen.contains(index))
        .map(|(_, item)| item)
        .take(count)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evenly_spaced_items_include_both_ends() {
        let chosen = |length: usize, count| evenly_spaced((0..length).collect(), count);
        assert_eq!(chosen(11, 6), [0, 2, 4, 6, 8, 10]);
        assert_eq!(chosen(3, 6), [0, 1, 2]);
        assert_eq!(chosen(1, 6), [0]);
        assert!(chosen(0, 6).is_empty());
    }
}
