//! Films of runs: the motion of one agent, the states that all agents have visited so far, and their
//! returns, from the first episode to the last.
//!
//! Motion is either bodies or, in environments of Gymnasium, pictures that the environment draws while
//! episodes are played again. [`Film::of_run`] and [`Film::of_policy`] choose the episodes,
//! [`Film::pixels`] draws one frame, [`encoder`] encodes frames.

mod bodies;
pub mod encoder;
mod episodes;
mod gif;
mod pictures;
mod policy;
mod simulation;
mod timeline;
mod visits;

use std::path::PathBuf;

use self::bodies::Bodies;
use self::pictures::Pictures;
use self::timeline::{ShownEpisode, Timeline};
use self::visits::Visits;
use crate::plotting;
use crate::record::visitation::Unplaced;
use crate::record::{ReadError, RecordedStates};
use crate::review::selection::{
    EpisodeSelection, GRID_CELLS, SelectedState, SelectedStates, StateSelection,
};
use crate::review::{LoadRunError, LoadedRun};
use crate::run::facts::EpisodeRow;
use crate::run::facts::returns::team_returns;
use crate::run::training::RoundFailure;
use crate::run::{Plan, RunError};
use seedbed_env::{Physics, TaskDescription, TaskSpec};
use seedbed_figure::color::{TEAM_COLOR, agent_color};
use seedbed_figure::{
    Axis, Cells, Curves, Figure, HeatMap, Key, Panel, ParallelCoordinates, Pixels, RenderError,
    Row, Series, StateLine, States,
};
use seedbed_input::InputError;

/// What is filmed: a recording and the task in which it was made.
#[derive(Debug)]
pub struct Filmed<'a> {
    /// Title of all frames.
    pub title: String,
    /// The visited states.
    pub recording: &'a RecordedStates,
    /// The task, whose motion is shown. `None` if another program recorded the run; then there is no
    /// motion.
    pub task: Option<FilmedTask<'a>>,
    /// Number of agents K.
    pub agent_count: usize,
    /// One row per episode, in (round, agent) order.
    pub episodes: &'a [EpisodeRow],
}

/// The task of a run.
#[derive(Clone, Copy, Debug)]
pub struct FilmedTask<'a> {
    /// The task.
    pub description: &'a TaskDescription,
    /// Its simulation.
    pub physics: Physics,
    /// What the start states of episodes follow from.
    pub seeds: SeedsOfEpisodes,
}

/// What the start states of episodes follow from, together with agent, round and episode.
#[derive(Clone, Copy, Debug)]
pub struct SeedsOfEpisodes {
    /// Seed of the run.
    pub run_seed: u64,
    /// Number of episodes of each agent in a round.
    pub episodes_per_round: u32,
}

/// How it is filmed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmSettings {
    /// Agent whose motion is shown.
    pub agent: u32,
    /// Duration, s. Of a training by default 12 s; of a trained policy whole episodes.
    pub seconds: Option<f64>,
    /// Number of frames per second.
    pub frames_per_second: u32,
    /// Width of a frame in pixels.
    pub width: u32,
    /// Maximum number of episodes whose motion is shown, one after the other.
    pub scenes: usize,
}

/// Why there is no film.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// The run has no recording, or is only a recording.
    #[error("{0} has no recording with its scenario beside it, from which a film is made")]
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
    /// The policies of the run cannot be played.
    #[error(transparent)]
    Policy(#[from] RunError),
}

impl From<RoundFailure> for FilmError {
    fn from(failure: RoundFailure) -> Self {
        Self::Policy(failure.into())
    }
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
    motion: Motion,
    /// What all agents did; `None` in films of a trained policy.
    training: Option<Training>,
}

/// Visited states and returns of all agents.
#[derive(Debug)]
struct Training {
    axes: Vec<Axis>,
    /// A sample of visited states of all agents, in the order of episodes.
    sample: Vec<(u32, SelectedState)>,
    /// Numbers of all visited states: of each agent in a group of its own, or of all agents together.
    visits: Visits,
    /// Returns of each agent.
    returns: Vec<Vec<f64>>,
    team_returns: Vec<f64>,
}

/// What is shown of one agent's motion.
#[derive(Debug)]
enum Motion {
    /// Nothing, and why.
    None(Option<String>),
    Bodies(Timeline, Bodies),
    Pictures(Timeline, Pictures),
}

/// Duration of the film of a training, s.
const DEFAULT_SECONDS: f64 = 12.0;

/// Time for which the last state of an episode is shown, s.
const SECONDS_AT_END: f64 = 0.5;

/// Width of a frame in its own unit of length: a CSS pixel, if frames have as many pixels.
const FRAME_WIDTH: f64 = 760.0;

/// Number of states that are drawn at the end of the film.
const MAX_LINES: usize = 600;

/// Maximum number of observations with an axis. More would be narrower than a pixel.
const MAX_AXES: usize = 100;

/// Maximum number of agents with a map of their own.
const MAX_AGENT_MAPS: usize = 4;

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
            task: plan.as_ref().map(|plan| FilmedTask {
                description: &plan.description,
                physics: plan.scenario.physics,
                seeds: SeedsOfEpisodes {
                    run_seed: plan.scenario.seed,
                    episodes_per_round: plan.scenario.schedule.episodes_per_round(),
                },
            }),
            agent_count,
            episodes: &run.episodes,
        };
        Self::new(filmed, settings, on_episode)
    }

    /// A film. Without motion, it shows states and returns only. Calls `on_episode` for each episode that
    /// is read.
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
        let motion = Motion::of(&filmed, settings)?;
        let returns = |agent: u32| {
            let rows = filmed.episodes.iter().filter(move |row| row.agent == agent);
            rows.map(|row| row.r#return).collect()
        };
        let returns: Vec<Vec<f64>> = (0..agent_count as u32).map(returns).collect();
        let frames = 0..settings.frame_count();
        let shown = frames.map(|frame| motion.episode_at(frame, settings, last_episode(&returns)));
        let has_maps_of_agents =
            axes.all().len() == 2 && motion.timeline().is_none() && agent_count <= MAX_AGENT_MAPS;
        let groups = if has_maps_of_agents { agent_count } else { 1 };
        let mut visits = Visits::new(shown.collect(), groups, &axes);
        let selection = StateSelection {
            episodes: EpisodeSelection::all(),
            conditions: Vec::new(),
            sample_size: MAX_LINES / agent_count.clamp(1, MAX_LINES),
            axes: (0..axes.all().len().min(MAX_AXES)).collect(),
            pairs: Vec::new(),
            all_axes: axes,
        };
        let selected = selection.select(recording, |episode| {
            visits.add(episode);
            on_episode();
        })?;
        Ok(Self {
            settings,
            motion,
            training: Some(Training {
                axes: axes_of_film(&selection, &selected),
                sample: in_order_of_episodes(selected),
                visits: visits.sum_up(),
                returns,
                team_returns: team_returns(filmed.episodes, agent_count),
            }),
            title: filmed.title,
        })
    }

    /// Why the film shows no motion, if it shows none and somebody can do something about it.
    #[must_use]
    pub fn warning(&self) -> Option<&str> {
        match &self.motion {
            Motion::None(reason) => reason.as_deref(),
            Motion::Bodies(..) | Motion::Pictures(..) => None,
        }
    }

    /// Number of frames.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.settings.frame_count()
    }

    /// Width and height of all frames in pixels.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        let height = self.frame(0).height() * self.scale();
        [self.settings.width, height.round() as u32]
    }

    /// The pixels of frame `number`, which is below [`frame_count`](Self::frame_count).
    ///
    /// # Errors
    /// The page is too large for memory.
    pub fn pixels(&self, number: usize) -> Result<Pixels, RenderError> {
        self.frame(number).pixels(self.scale())
    }

    /// Pixels per unit of length: letters grow with the frame.
    fn scale(&self) -> f64 {
        f64::from(self.settings.width) / FRAME_WIDTH
    }

    fn frame(&self, number: usize) -> Figure {
        // In a training, the states and returns beside it go on to the next episode that is shown.
        let words = if self.training.is_some() {
            "replay of "
        } else {
            ""
        };
        let motion = self.motion.panel(number, self.settings.agent, words);
        let rows = match &self.training {
            None => vec![row(self.motion.height(), motion.into_iter().collect())],
            Some(training) => {
                let last = last_episode(&training.returns);
                let episode = self.motion.episode_at(number, self.settings, last);
                let curves = Panel::Curves(training.curves(episode));
                let states = training.visited_states(episode);
                let mut rows = rows_of_two(motion.into_iter().chain(states));
                rows.push(row(120.0, vec![curves]));
                rows.extend(training.key());
                rows
            }
        };
        Figure {
            title: self.title.clone(),
            description: String::new(),
            width: FRAME_WIDTH,
            rows,
        }
    }
}

/// Rows of two panels; a single panel has a row to itself.
fn rows_of_two(panels: impl Iterator<Item = Panel>) -> Vec<Row> {
    let mut panels: Vec<Panel> = panels.collect();
    if panels.len() > 2 && panels.len() % 2 == 1 {
        panels.push(Panel::Blank);
    }
    let rows = panels.chunks(2);
    rows.map(|panels| row(230.0, panels.to_vec())).collect()
}

fn row(height: f64, panels: Vec<Panel>) -> Row {
    Row {
        height,
        panels,
        key: None,
    }
}

/// Number of the last episode of any agent.
fn last_episode(returns: &[Vec<f64>]) -> u32 {
    let episodes = returns.iter().map(Vec::len).max().unwrap_or(0);
    episodes.max(1) as u32 - 1
}

impl Training {
    /// The colors of agents and of the mean; `None` for a single agent.
    fn key(&self) -> Option<Row> {
        let agents = self.returns.len() as u32;
        let mut names = plotting::names_of_agents(0..agents);
        names.push(("mean of all".to_owned(), TEAM_COLOR));
        (agents > 1).then(|| Row::of_key(Key::Categories(names), FRAME_WIDTH))
    }

    /// A map of each group of agents if there are two axes; otherwise one panel with lines.
    fn visited_states(&self, episode: u32) -> Vec<Panel> {
        let position = self.visits.position(episode);
        let [x, y] = &self.axes[..] else {
            return vec![self.lines(position)];
        };
        let groups = self.visits.groups();
        let map = |group| self.visits.map(position, group).to_vec();
        let maps: Vec<Vec<u32>> = (0..groups).map(map).collect();
        let max_count = maps.iter().flatten().copied().max().unwrap_or(0);
        let panel = |(group, counts)| {
            Panel::HeatMap(HeatMap {
                title: self.title(position, group, u64::MAX),
                x: x.clone(),
                y: y.clone(),
                cells: Cells::Counts { counts, max_count },
                columns: GRID_CELLS,
                lines: Vec::new(),
            })
        };
        (0..).zip(maps).map(panel).collect()
    }

    /// Such as `agent 2, episodes 0 to 30: 1,234 states`. `drawn`: number of states that are drawn at most
    fn title(&self, position: usize, group: usize, drawn: u64) -> String {
        let agents = if self.returns.len() == self.visits.groups() {
            format!("agent {group}")
        } else {
            "visited states of all agents".to_owned()
        };
        let last = self.visits.episode(position);
        let states = plotting::number_of_states(drawn, self.visits.states(position, group));
        format!("{agents}, episodes 0 to {last}: {states}")
    }

    /// Parallel coordinates of the sampled states up to the episode at this position.
    fn lines(&self, position: usize) -> Panel {
        let last = self.visits.episode(position);
        let visited = self
            .sample
            .iter()
            .take_while(|(_, state)| state.episode <= last);
        let line = |(agent, state): &(u32, SelectedState)| StateLine {
            axis_positions: state.selected_axis_positions.clone(),
            color: agent_color(*agent),
        };
        let lines: Vec<StateLine> = visited.map(line).collect();
        Panel::ParallelCoordinates(ParallelCoordinates {
            title: self.title(position, 0, lines.len() as u64),
            axes: self.axes.clone(),
            states: States::Lines(lines),
        })
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
        Curves {
            x_label: "episode".to_owned(),
            y_label: self.label_of_returns(),
            series,
            x_range: Some([0.0, f64::from(last_episode(&self.returns).max(1))]),
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

impl FilmSettings {
    /// Number of environment steps per frame: motion is in real time.
    fn steps_per_frame(self, spec: &TaskSpec) -> f64 {
        1.0 / (f64::from(self.frames_per_second) * spec.control_step)
    }

    /// The timeline of a film with this many frames.
    fn timeline(self, episodes: Vec<ShownEpisode>, spec: &TaskSpec) -> Timeline {
        Timeline {
            episodes,
            steps_per_frame: self.steps_per_frame(spec),
            frames: self.frame_count(),
            control_step: spec.control_step,
            frames_at_end: (SECONDS_AT_END * f64::from(self.frames_per_second)) as usize,
        }
    }

    /// Time in which a film shows a whole episode of this duration, s.
    #[must_use]
    pub fn seconds_of_episode(self, duration: f64) -> f64 {
        duration + SECONDS_AT_END + 1.0 / f64::from(self.frames_per_second)
    }

    fn frame_count(self) -> usize {
        let seconds = self.seconds.unwrap_or(DEFAULT_SECONDS);
        (seconds * f64::from(self.frames_per_second)).round() as usize
    }
}

impl Motion {
    fn of(filmed: &Filmed<'_>, settings: FilmSettings) -> Result<Self, FilmError> {
        let Some(task) = filmed.task else {
            return Ok(Self::None(None));
        };
        match task.description {
            TaskDescription::Bodies(_) => Self::of_bodies(filmed.recording, task, settings),
            TaskDescription::Tabular(_) => Ok(Self::None(None)),
            TaskDescription::Gymnasium(environment) => {
                let played =
                    pictures::play_again(filmed.recording, environment, task.seeds, settings)?;
                Ok(match played {
                    Ok((timeline, pictures)) => Self::Pictures(timeline, pictures),
                    Err(reason) => Self::None(Some(reason)),
                })
            }
        }
    }

    fn of_bodies(
        recording: &RecordedStates,
        task: FilmedTask<'_>,
        settings: FilmSettings,
    ) -> Result<Self, FilmError> {
        Ok(match Bodies::of_recording(recording, task, settings)? {
            Ok((timeline, bodies)) => Self::Bodies(timeline, bodies),
            Err(reason) => Self::None(reason),
        })
    }

    /// The newest episode of which a frame shows states and returns. It grows evenly between the episodes whose motion is shown.
    /// `last`: the last episode of the run
    fn episode_at(&self, frame: usize, settings: FilmSettings, last: u32) -> u32 {
        if let Some(timeline) = self.timeline() {
            return timeline.episode_at(frame, last);
        }
        let position = (frame + 1) as f64 / settings.frame_count().max(1) as f64;
        (position * f64::from(last)) as u32
    }

    fn timeline(&self) -> Option<&Timeline> {
        match self {
            Self::None(_) => None,
            Self::Bodies(timeline, _) | Self::Pictures(timeline, _) => Some(timeline),
        }
    }

    /// Height of a panel of the width of a frame.
    fn height(&self) -> f64 {
        let aspect = match self {
            Self::Bodies(_, bodies) => bodies.aspect(),
            Self::None(_) | Self::Pictures(..) => 16.0 / 9.0,
        };
        (FRAME_WIDTH / aspect + 24.0).clamp(200.0, 560.0)
    }

    /// What a frame shows of the motion. `words`: what precedes the number of its episode
    fn panel(&self, frame: usize, agent: u32, words: &str) -> Option<Panel> {
        let timeline = self.timeline()?;
        let shown = timeline.shown_at(frame);
        let title = format!("agent {agent}, {words}{}", timeline.caption(shown));
        Some(match self {
            Self::None(_) => return None,
            Self::Bodies(_, bodies) => Panel::Drawing(bodies.drawing(shown, title, agent)),
            Self::Pictures(_, pictures) => Panel::Picture(pictures.picture(shown, title)),
        })
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
