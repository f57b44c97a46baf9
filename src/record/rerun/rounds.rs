//! Adds rounds to a recording. Rows are collected, and written after every 4,096 states per agent, or
//! more often while viewers show the recording.

use rerun::StoreId;
use rerun::log::Chunk;
use serde::{Deserialize, Serialize};

use super::error::RecordingError;
use super::images::{DrawnAgent, ImageSettings, add_images};
use super::rows::Moment;
use super::run_constants::RunConstants;
use super::samples::{DrawnStateCounts, SampleOfTeam, VisitationStyle};
use super::sink::{EncodedChunks, MessageBytes};
use super::writers::{Due, LocalAgent, states_per_write};
use super::{RerunRecorder, Team};
use crate::record::visitation::{Coloring, first_round};
use crate::run::facts::{EpisodeDetails, EpisodeRow};
use crate::run::recorder::{Focus, RoundRecord};
use seedbed_learn::experience::Episode;
use seedbed_learn::team::Workers;
use seedbed_random::{Purpose, stream};

/// Minimum number of states per agent between two images, for each round of the initial interval.
/// An image takes as many bytes as about a hundred states, and there are two of each agent. So images
/// of short episodes, which would differ little from each other, do not make up most of the file.
const STATES_PER_IMAGE_ROUND: u64 = 300;

/// Number of states per agent after which rows of all entities are written while viewers show the
/// recording, so that they see the newest rounds soon, in larger files.
const STATES_PER_WRITE_TO_VIEWERS: usize = 128;

/// Number of states in a round from which threads share the work. To pass less to other threads would
/// take as long as to do it.
const MIN_SHARED_STATES: usize = 2048;

/// Number of images at the initial interval, before it doubles.
const IMAGES_BEFORE_DOUBLING: u32 = 200;

/// Whether a round gets images in any case, if the initial interval is `every` rounds: 0, 1, 2, 3, 5, 7,
/// 10, 15, 20, 30, 50 and so on, up to twice the interval. Early exploration changes most.
fn is_early(round: u32, every: u32) -> bool {
    let power = round
        .checked_ilog10()
        .map_or(1, |exponent| 10_u32.pow(exponent));
    let is_listed = match round / power {
        0..=3 | 5 | 7 => round.is_multiple_of(power),
        _ => false,
    };
    u64::from(round) < 2 * u64::from(every)
        && (is_listed || 2 * u64::from(round) == 3 * u64::from(power))
}

/// Whether a later round gets images, if the initial interval is `every` rounds.
///
/// The interval is constant for the first 200 images and then doubles with each octave, that is,
/// each time the run has doubled in length. So each octave adds the same number of images (100),
/// and a run of n rounds has O(log n) of them: the images late in a run differ little from each
/// other, and would otherwise make up most of the file. The first octave begins after round 200 ·
/// `every`, where the quotient below is 1 and its logarithm 0; in the rounds before, the quotient
/// is 0 and has no logarithm, so that nothing is doubled.
fn has_images(round: u32, every: u32) -> bool {
    let doublings = (round / IMAGES_BEFORE_DOUBLING.saturating_mul(every))
        .checked_ilog2()
        .map_or(0, |octave| octave + 1);
    u64::from(round).is_multiple_of(u64::from(every) << doublings)
}

/// Number of lines of the team that an episode gets, out of `lines` for one episode of each of
/// `agents` agents. The lines of the team are divided evenly; if there are fewer lines than agents,
/// other agents have one in the next round. `position` is the number of the agent plus the number of
/// the round.
fn share_of_team(lines: usize, position: u64, agents: usize) -> usize {
    let position = (position % agents as u64) as usize;
    (position + 1) * lines / agents - position * lines / agents
}

/// What an agent adds to a recording in a round.
struct PartOfAgent<'a> {
    agent: &'a mut LocalAgent,
    /// In the order of their numbers; none if the agent finished none.
    episodes: &'a [&'a Episode],
}

impl PartOfAgent<'_> {
    /// Adds the episodes. The random stream that samples states depends only on the run seed, the
    /// agent and the round. So the sample does not depend on other agents or interruptions.
    fn add(&mut self, round: &RoundRecord<'_>, constants: &RunConstants, style: &VisitationStyle) {
        let LocalAgent {
            number,
            writers,
            visits,
            next_step,
        } = &mut *self.agent;
        let mut random = stream(constants.run_seed, Purpose::Recording, *number, round.round);
        for (index, episode) in self.episodes.iter().enumerate() {
            let quota = constants.line_quota;
            let of_agent = quota.lines_of_episode(index, self.episodes.len(), episode.length());
            let position = u64::from(*number) + u64::from(round.round);
            let drawn = DrawnStateCounts {
                of_agent,
                of_team: share_of_team(of_agent, position, constants.agents as usize),
            };
            let [first, end] = reserve_moments(next_step, EpisodeLength::from(*episode));
            let step_data = round.step_data_of(episode);
            if episode.episode.is_multiple_of(constants.raw_every) {
                let details = round.details_of(*number, episode.episode);
                let info = details.map_or(&[][..], |details| &details.info);
                writers.raw.add(episode, info, step_data, first);
            }
            style.add(
                (episode, step_data),
                end,
                visits,
                [&mut writers.sample, &mut writers.for_team],
                drawn,
                &mut random,
            );
        }
        visits.end_round(round.round, constants.window);
    }
}

/// An episode on the timelines.
#[derive(Clone, Copy)]
struct EpisodeLength {
    episode: u32,
    round: u32,
    steps: u32,
}

impl From<&Episode> for EpisodeLength {
    fn from(episode: &Episode) -> Self {
        Self {
            episode: episode.episode,
            round: episode.round,
            steps: episode.length() as u32,
        }
    }
}

impl From<&EpisodeRow> for EpisodeLength {
    fn from(row: &EpisodeRow) -> Self {
        Self {
            episode: row.episode,
            round: row.round,
            steps: row.length,
        }
    }
}

/// Reserves positions for an episode on the timeline of steps of its agent, and returns its first and
/// its last moment.
fn reserve_moments(next_step: &mut i64, episode: EpisodeLength) -> [Moment; 2] {
    let first = Moment {
        env_step: *next_step,
        episode: episode.episode.into(),
        round: episode.round.into(),
    };
    let end = Moment {
        env_step: *next_step + i64::from(episode.steps),
        ..first
    };
    *next_step = end.env_step + 1;
    [first, end]
}

/// What is done after a round, which rank 0 decides.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct AfterRound {
    /// The end of the round, at the largest step number of any agent.
    pub(super) end: Moment,
    /// Whether images are added.
    pub(super) has_images: bool,
    /// The rows that are written.
    pub(super) due: Due,
}

impl RerunRecorder {
    /// Adds a round, and writes the chunks that are full.
    pub(super) fn add_round(&mut self, round: &RoundRecord<'_>) -> Result<(), RecordingError> {
        if !self.has_begun {
            self.set_color_range(round.episode_rows);
            if let Some(team) = &mut self.team {
                team.write_blueprint(&self.constants, &self.style, round.details)?;
            }
            self.has_begun = true;
        }
        self.add_episodes(round);
        self.add_shared(round);
        let after = self
            .team
            .as_mut()
            .map(|team| team.after(round, &self.constants));
        let after = self.ranks.broadcast(after.unwrap_or_default());
        if after.has_images {
            self.add_images(after.end, round.workers);
        }
        self.write_chunks(after.due, round.workers)
    }

    /// Adds the episodes of each local agent.
    fn add_episodes(&mut self, round: &RoundRecord<'_>) {
        let (constants, style) = (&self.constants, &self.style);
        let episodes = round.episodes.chunk_by(|one, next| one.agent == next.agent);
        let mut episodes = episodes.peekable();
        let mut parts = Vec::new();
        for agent in &mut self.agents {
            let own = episodes.next_if(|episodes| episodes[0].agent == agent.number);
            let episodes = own.unwrap_or_default();
            parts.push(PartOfAgent { agent, episodes });
        }
        let lengths = round.episodes.iter().map(|episode| episode.length() + 1);
        let workers = if lengths.sum::<usize>() < MIN_SHARED_STATES {
            Workers::CURRENT_THREAD
        } else {
            round.workers
        };
        workers.for_each(&mut parts, |part| part.add(round, constants, style));
    }

    /// Adds the sample of the team, in the order of agents, and on rank 0 the returns and the bodies of all episodes.
    fn add_shared(&mut self, round: &RoundRecord<'_>) {
        let mut sample = SampleOfTeam::default();
        for agent in &mut self.agents {
            agent.writers.for_team.move_to(&mut sample);
        }
        let samples = self.ranks.gather(sample);
        if let Some(team) = &mut self.team {
            for sample in samples {
                team.writers.sample.append(sample);
            }
            team.add_episodes(round);
        }
    }

    /// Writes collected rows.
    pub(super) fn write_chunks(
        &mut self,
        due: Due,
        workers: Workers<'_>,
    ) -> Result<(), RecordingError> {
        self.write_of_agents(workers, |agent, style| agent.writers.take(style, due))?;
        let (style, Some(team)) = (&self.style, &mut self.team) else {
            return Ok(());
        };
        let Team { writers, sink, .. } = team;
        writers.write(style, due, &mut |chunk| sink.send_chunk(&chunk))
    }

    /// Writes `chunks` of each local agent. If the file has an index, rank 0 encodes them, otherwise all ranks and threads.
    pub(super) fn write_of_agents(
        &mut self,
        workers: Workers<'_>,
        chunks: impl Fn(&mut LocalAgent, &VisitationStyle) -> Result<Vec<Chunk>, RecordingError>
        + Send
        + Sync,
    ) -> Result<(), RecordingError> {
        let (style, store_id) = (&self.style, &self.store_id);
        if let Some(team) = &mut self.team
            && !team.sink.has_no_index()
        {
            let mut agents = self.agents.iter_mut();
            return agents.try_for_each(|agent| team.sink.send_chunks(&chunks(agent, style)?));
        }
        let agents = self.agents.iter_mut().collect();
        let encoded = workers.map(agents, |agent: &mut LocalAgent| {
            encode(&chunks(agent, style)?, store_id)
        });
        let encoded: Vec<Vec<u8>> = encoded.into_iter().collect::<Result<_, _>>()?;
        let all = self.ranks.gather_bytes(EncodedChunks::join(&encoded));
        match &mut self.team {
            Some(Team { sink, .. }) => all
                .iter()
                .try_for_each(|bytes| sink.append(&EncodedChunks::read(bytes))),
            None => Ok(()),
        }
    }

    /// Adds images of the states visited so far and in the latest rounds, after the round that ends at `end`. A recording of
    /// motion, which is played from its beginning, has them once, at its beginning.
    pub(super) fn add_images(&mut self, end: Moment, workers: Workers<'_>) {
        let moment = match self.constants.focus {
            Focus::Motion => Moment::default(),
            Focus::Learning => end,
        };
        let last_round = end.round as u32;
        let settings = ImageSettings {
            style: &self.style,
            difference: &self.constants.difference,
            rounds: first_round(last_round, self.constants.window)..=last_round,
            moment,
            ranks: self.ranks,
            workers,
        };
        let team = self.team.as_mut().map(|team| &mut team.writers.images);
        let agents = self.agents.iter_mut().map(|agent| DrawnAgent {
            number: agent.number,
            visits: &agent.visits,
            images: &mut agent.writers.images,
        });
        add_images(&mut agents.collect::<Vec<_>>(), team, &settings);
    }

    /// Sets the color scale of states for the whole run, using the returns of the first round, which rank 0 knows.
    fn set_color_range(&mut self, first_round: &[EpisodeRow]) {
        let constants = &self.constants;
        let range = Coloring::range_for_run(
            self.style.coloring.color_by,
            &constants.spec,
            constants.max_episodes,
            constants.bonus,
            first_round,
        );
        let range = self.ranks.broadcast(range);
        self.style.coloring.range = range;
        if let Some(team) = &mut self.team {
            team.state.color_range = Some(range);
        }
    }
}

/// The messages of chunks.
fn encode(chunks: &[Chunk], store_id: &StoreId) -> Result<Vec<u8>, RecordingError> {
    if chunks.is_empty() {
        return Ok(Vec::new());
    }
    let mut encoded = MessageBytes::new(store_id)?;
    chunks.iter().try_for_each(|chunk| encoded.add(chunk))?;
    encoded.into_chunks()
}

impl Team {
    /// Adds the returns and the bodies of all episodes.
    fn add_episodes(&mut self, round: &RoundRecord<'_>) {
        for row in round.episode_rows {
            let next_step = &mut self.state.next_steps[row.agent as usize];
            let [first, end] = reserve_moments(next_step, EpisodeLength::from(row));
            self.writers.curves.add_episode(row, end);
            if let Some(details) = round.details_of(row.agent, row.episode) {
                self.add_scene(details, first);
            }
        }
    }

    /// Adds the bodies of an episode if its agent has a scene.
    fn add_scene(&mut self, details: &EpisodeDetails, first_moment: Moment) {
        let mut scenes = self.writers.scenes.iter_mut();
        if let Some(scene) = scenes.find(|scene| scene.agent() == details.agent) {
            scene.add_episode(details, first_moment);
        }
    }

    /// Adds what is known at the end of a round, and decides what is done then.
    fn after(&mut self, round: &RoundRecord<'_>, constants: &RunConstants) -> AfterRound {
        let rows = round.episode_rows;
        let latest_episode = rows.iter().map(|row| row.episode).max();
        let latest_episode = latest_episode.map_or(0, i64::from);
        self.state.latest = Some((round.round.into(), latest_episode));
        let end = self.end_of_latest_round();
        let latest_returns = &mut self.state.latest_returns;
        self.writers
            .curves
            .add_round(rows, round.round_rows, end, latest_returns);
        let states: u64 = rows.iter().map(|row| u64::from(row.length) + 1).sum();
        self.state.states_since_write += states;
        self.state.states_since_images += states;
        let has_images = self.are_images_due(round.round, constants);
        self.state.has_latest_images = has_images;
        if has_images {
            self.state.states_since_images = 0;
        }
        AfterRound {
            end,
            has_images,
            due: self.due_rows(constants),
        }
    }

    /// Whether a round gets images: early rounds, and rounds of the interval between images if the
    /// agents have visited enough states since the latest images.
    fn are_images_due(&self, round: u32, constants: &RunConstants) -> bool {
        if constants.focus == Focus::Motion {
            return false;
        }
        let every = constants.density_every;
        let min_states = u64::from(every) * STATES_PER_IMAGE_ROUND * u64::from(constants.agents);
        let has_enough_states = self.state.states_since_images >= min_states;
        is_early(round, every) || (has_images(round, every) && has_enough_states)
    }

    /// The rows that are written after the latest round. Depends on numbers of states only, not on
    /// clocks, so that repeated runs write the same chunks.
    fn due_rows(&mut self, constants: &RunConstants) -> Due {
        let states_per_agent = if self.sink.has_viewers() {
            STATES_PER_WRITE_TO_VIEWERS
        } else {
            states_per_write(constants.agents)
        };
        let states = u64::from(constants.agents) * states_per_agent as u64;
        if self.state.states_since_write < states {
            return Due::FullChunks;
        }
        self.state.states_since_write = 0;
        Due::Shown
    }

    /// The end of the latest round, at the largest step number of any agent.
    pub(super) fn end_of_latest_round(&self) -> Moment {
        let (round, episode) = self.state.latest.unwrap_or_default();
        let next_step = self.state.next_steps.iter().max();
        Moment {
            env_step: next_step.map_or(0, |next| (next - 1).max(0)),
            episode,
            round,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of three lines, four agents get 0, 1, 1 and 1; in the next round another agent gets none. Of
    /// twenty lines, each of two agents gets ten.
    #[test]
    fn the_lines_of_the_team_are_divided_evenly() {
        let shares = |lines, round, agents: u64| -> Vec<usize> {
            (0..agents)
                .map(|agent| share_of_team(lines, agent + round, agents as usize))
                .collect()
        };
        assert_eq!(shares(3, 0, 4), [0, 1, 1, 1]);
        assert_eq!(shares(3, 1, 4), [1, 1, 1, 0]);
        assert_eq!(shares(20, 7, 2), [10, 10]);
    }

    /// With an interval of 1 every round has images anyway; with an interval of 10 the rounds of the first
    /// two intervals are chosen; an interval of 1000 has early rounds in each power of ten.
    #[test]
    fn early_rounds_have_images() {
        let early =
            |every| -> Vec<u32> { (0..3000).filter(|round| is_early(*round, every)).collect() };
        assert_eq!(early(1), [0, 1]);
        assert_eq!(early(10), [0, 1, 2, 3, 5, 7, 10, 15]);
        assert_eq!(
            early(1000),
            [
                0, 1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 150, 200, 300, 500, 700, 1000, 1500
            ]
        );
        assert!(!is_early(u32::MAX, u32::MAX) && is_early(3_000_000_000, u32::MAX));
    }

    /// There are 200 images before round 2000, 100 images from there to round 4000, and 100 images
    /// from there to round 8000.
    #[test]
    fn the_interval_between_images_doubles_with_the_length_of_a_run() {
        let rounds_with_images = |first: u32, end: u32| {
            (first..end)
                .filter(|round| has_images(*round, 10))
                .collect::<Vec<u32>>()
        };
        assert_eq!(rounds_with_images(0, 31), [0, 10, 20, 30]);
        assert_eq!(
            [
                rounds_with_images(0, 2000).len(),
                rounds_with_images(2000, 4000).len(),
                rounds_with_images(4000, 8000).len()
            ],
            [200, 100, 100]
        );
        assert_eq!(rounds_with_images(3970, 4090), [3980, 4000, 4040, 4080]);
        assert!(has_images(0, 1_000_000_000) && !has_images(u32::MAX, 1_000_000_000));
    }
}
