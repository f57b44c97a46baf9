//! Adds rounds to a recording. Rows are collected, and written after every 4,096 states per agent, or
//! more often while viewers show the recording.

use super::RerunRecorder;
use super::error::RecordingError;
use super::rows::Moment;
use super::run_constants::RunConstants;
use super::samples::{DrawnStateCounts, VisitationStyle};
use super::writers::{AgentWriters, Due, states_per_write};
use crate::record::visitation::{AgentVisits, Coloring, first_round};
use crate::run::facts::EpisodeDetails;
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
    writers: &'a mut AgentWriters,
    visits: &'a mut AgentVisits,
    /// The next free position on the agent's timeline of steps.
    next_step: &'a mut i64,
    /// In the order of their numbers; none if the agent finished none.
    episodes: &'a [&'a Episode],
    /// First and last moment of each episode.
    moments: Vec<[Moment; 2]>,
}

impl PartOfAgent<'_> {
    /// Adds the episodes. The random stream that samples states depends only on the run seed, the
    /// agent and the round. So the sample does not depend on other agents or interruptions.
    fn add(
        &mut self,
        round: &RoundRecord<'_>,
        constants: &RunConstants,
        style: &VisitationStyle,
        team_size: usize,
    ) {
        let agent = self.episodes.first().map_or(0, |episode| episode.agent);
        let mut random = stream(constants.run_seed, Purpose::Recording, agent, round.round);
        for (index, episode) in self.episodes.iter().enumerate() {
            let quota = constants.line_quota;
            let of_agent = quota.lines_of_episode(index, self.episodes.len(), episode.length());
            let position = u64::from(agent) + u64::from(round.round);
            let drawn = DrawnStateCounts {
                of_agent,
                of_team: share_of_team(of_agent, position, team_size),
            };
            let [first, end] = reserve_moments(self.next_step, episode);
            self.moments.push([first, end]);
            let step_data = round.step_data_of(episode);
            if episode.episode.is_multiple_of(constants.raw_every) {
                let details = round.details_of(episode);
                let info = details.map_or(&[][..], |details| &details.info);
                self.writers.raw.add(episode, info, step_data, first);
            }
            style.add(
                (episode, step_data),
                end,
                self.visits,
                [&mut self.writers.sample, &mut self.writers.for_team],
                drawn,
                &mut random,
            );
        }
        self.visits.end_round(round.round, constants.window);
    }
}

/// Reserves positions for an episode on the timeline of steps of its agent, and returns its first and
/// its last moment.
fn reserve_moments(next_step: &mut i64, episode: &Episode) -> [Moment; 2] {
    let first = Moment {
        env_step: *next_step,
        episode: episode.episode.into(),
        round: episode.round.into(),
    };
    let end = Moment {
        env_step: *next_step + episode.length() as i64,
        ..first
    };
    *next_step = end.env_step + 1;
    [first, end]
}

impl RerunRecorder {
    /// Adds a round, and writes the chunks that are full.
    pub(super) fn add_round(&mut self, round: &RoundRecord<'_>) -> Result<(), RecordingError> {
        if self.state.latest.is_none() {
            self.set_color_range(round.episodes);
            self.write_blueprint(round.details)?;
        }
        self.add_episodes(round);
        let latest_episode = round.episodes.iter().map(|episode| episode.episode).max();
        let latest_episode = latest_episode.map_or(0, i64::from);
        self.state.latest = Some((round.round.into(), latest_episode));
        self.state.has_latest_images = false;
        let end = self.end_of_latest_round();
        self.writers.curves.add_round(
            round.episode_rows,
            round.round_rows,
            end,
            &mut self.state.latest_returns,
        );
        self.count_states(round.episodes);
        if self.are_images_due(round.round) {
            self.add_images(round.workers);
        }
        let due = self.due_rows();
        self.write_chunks(due)
    }

    fn count_states(&mut self, episodes: &[&Episode]) {
        let states = |episode: &&Episode| episode.length() as u64 + 1;
        let states: u64 = episodes.iter().map(states).sum();
        self.state.states_since_write += states;
        self.state.states_since_images += states;
    }

    /// Whether a round gets images: early rounds, and rounds of the interval between images if the
    /// agents have visited enough states since the latest images.
    fn are_images_due(&self, round: u32) -> bool {
        if self.constants.focus == Focus::Motion {
            return false;
        }
        let every = self.constants.density_every;
        let agents = self.writers.agents.len() as u64;
        let min_states = u64::from(every) * STATES_PER_IMAGE_ROUND * agents;
        let has_enough_states = self.state.states_since_images >= min_states;
        is_early(round, every) || (has_images(round, every) && has_enough_states)
    }

    /// The rows that are written after the latest round. Depends on numbers of states only, not on
    /// clocks, so that repeated runs write the same chunks.
    fn due_rows(&mut self) -> Due {
        let agents = self.writers.agents.len();
        let states_per_agent = if self.sink.has_viewers() {
            STATES_PER_WRITE_TO_VIEWERS
        } else {
            states_per_write(agents as u32)
        };
        if self.state.states_since_write < (agents * states_per_agent) as u64 {
            return Due::FullChunks;
        }
        self.state.states_since_write = 0;
        Due::Shown
    }

    /// Adds the episodes of a round: those of each agent by themselves, then, in the order of agents,
    /// what all agents share.
    fn add_episodes(&mut self, round: &RoundRecord<'_>) {
        let (constants, style) = (&self.constants, &self.style);
        let episodes = round.episodes.chunk_by(|one, next| one.agent == next.agent);
        let mut episodes = episodes.peekable();
        let agents = self.writers.agents.iter_mut().zip(&mut self.state.visits);
        let agents = agents.zip(&mut self.state.next_steps);
        let mut parts = Vec::new();
        for (agent, ((writers, visits), next_step)) in (0..).zip(agents) {
            let own = episodes.next_if(|episodes| episodes[0].agent == agent);
            parts.push(PartOfAgent {
                writers,
                visits,
                next_step,
                episodes: own.unwrap_or_default(),
                moments: Vec::new(),
            });
        }
        let team_size = parts.len();
        let states: usize = round
            .episodes
            .iter()
            .map(|episode| episode.length() + 1)
            .sum();
        let workers = if states < MIN_SHARED_STATES {
            Workers::CURRENT_THREAD
        } else {
            round.workers
        };
        workers.for_each(&mut parts, |part| {
            part.add(round, constants, style, team_size);
        });
        let moments: Vec<_> = parts.into_iter().flat_map(|part| part.moments).collect();
        self.add_shared(round, &moments);
    }

    /// Adds the sample of the team, the returns and the bodies of all episodes. `moments`: the first and
    /// the last one of each episode
    fn add_shared(&mut self, round: &RoundRecord<'_>, moments: &[[Moment; 2]]) {
        for agent in &mut self.writers.agents {
            self.writers.team.append(&mut agent.for_team);
        }
        for (row, [_, end]) in round.episode_rows.iter().zip(moments) {
            self.writers.curves.add_episode(row, *end);
        }
        for (episode, [first, _]) in round.episodes.iter().zip(moments) {
            if let Some(details) = round.details_of(episode) {
                self.add_scene(details, *first);
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

    /// The end of the latest round, at the largest step number of any agent.
    fn end_of_latest_round(&self) -> Moment {
        let (round, episode) = self.state.latest.unwrap_or_default();
        let next_step = self.state.next_steps.iter().max();
        Moment {
            env_step: next_step.map_or(0, |next| (next - 1).max(0)),
            episode,
            round,
        }
    }

    /// Writes collected rows.
    pub(super) fn write_chunks(&mut self, due: Due) -> Result<(), RecordingError> {
        let Self {
            writers,
            style,
            sink,
            ..
        } = self;
        writers.write(style, due, &mut |chunk| sink.send_chunk(&chunk))
    }

    /// Adds images of the states visited so far and in the latest rounds. A recording of motion, which
    /// is played from its beginning, has them once, at its beginning.
    pub(super) fn add_images(&mut self, workers: Workers<'_>) {
        let end_of_latest_round = self.end_of_latest_round();
        let moment = match self.constants.focus {
            Focus::Motion => Moment::default(),
            Focus::Learning => end_of_latest_round,
        };
        let last_round = end_of_latest_round.round as u32;
        let rounds = first_round(last_round, self.constants.window)..=last_round;
        let Self {
            writers,
            state,
            style,
            ..
        } = self;
        writers
            .images
            .push(&state.visits, style, rounds, moment, workers);
        self.state.has_latest_images = true;
        self.state.states_since_images = 0;
    }

    /// Sets the color scale of states for the whole run, using the returns of the first round.
    fn set_color_range(&mut self, first_round_episodes: &[&Episode]) {
        let Self {
            constants, style, ..
        } = self;
        let range = Coloring::range_for_run(
            style.coloring.color_by,
            &constants.spec,
            constants.max_episodes,
            constants.bonus,
            first_round_episodes,
        );
        style.coloring.range = range;
        self.state.color_range = Some(range);
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
