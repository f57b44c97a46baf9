//! What happens to a round: its rows are collected, and written when they make a good piece.

use std::slice::Iter;

use super::rows::Moment;
use super::sink::Fault;
use super::visitation::Wanted;
use super::{AgentTrack, RerunRecorder};
use crate::experience::Episode;
use crate::random::{Purpose, stream};
use crate::record::visitation::Colouring;
use crate::record::{EpisodeRow, Footage, RoundRecord};

/// Pictures in a row that have the wanted distance from each other, before it doubles.
const SAME_DISTANCE: u32 = 200;

/// Every so many rounds; twice as many from the 200th picture on, and twice again whenever the run has become twice as long, so that a
/// file does not grow with pictures that hardly differ.
fn is_pictured(round: u32, every: u32) -> bool {
    let doubled = (round / SAME_DISTANCE.saturating_mul(every))
        .checked_ilog2()
        .map_or(0, |octave| octave + 1);
    u64::from(round).is_multiple_of(u64::from(every) << doubled)
}

impl RerunRecorder {
    /// Takes in a round, and writes what makes good pieces by now.
    pub(super) fn take_in(&mut self, round: &RoundRecord<'_>) -> Result<(), Fault> {
        if self.progress.latest.is_none() {
            self.settle_colours(round.episodes);
            self.lay_out(round.footage)?;
        }
        let mut rows = round.episode_rows.iter();
        for episodes in round.episodes.chunk_by(|one, next| one.agent == next.agent) {
            self.take_in_episodes(round, episodes, &mut rows);
        }
        self.visited
            .iter_mut()
            .for_each(|visited| visited.end_round(round.round, self.window));
        let latest_episode = round
            .episodes
            .iter()
            .map(|episode| episode.episode.into())
            .max();
        (self.progress.latest, self.progress.pictured) = (
            Some((round.round.into(), latest_episode.unwrap_or(0))),
            false,
        );
        let end = self.now();
        self.curves.add_round(
            round.episode_rows,
            round.round_rows,
            end,
            &mut self.progress.latest_returns,
        );
        if is_pictured(round.round, self.density_every) {
            self.picture();
        }
        self.write(false)
    }

    /// Takes in one agent's episodes of a round.
    fn take_in_episodes(
        &mut self,
        round: &RoundRecord<'_>,
        episodes: &[&Episode],
        rows: &mut Iter<'_, EpisodeRow>,
    ) {
        let mut random = stream(
            self.run_seed,
            Purpose::Recording,
            episodes[0].agent,
            round.round,
        );
        for (index, episode) in episodes.iter().enumerate() {
            let of_agent = self.quota.of_episode(index, episodes.len());
            let wanted = Wanted {
                of_agent,
                of_team: of_agent.div_ceil(self.agents.len()),
            };
            let (first, end) = self.moments(episode);
            let agent = episode.agent as usize;
            if episode.episode.is_multiple_of(self.raw_every) {
                self.agents[agent].raw.add(episode, first);
            }
            let samples = [&mut self.agents[agent].sample, &mut self.team];
            self.drawing.add(
                episode,
                end,
                &mut self.visited[agent],
                samples,
                wanted,
                &mut random,
            );
            if let Some(row) = rows.next() {
                self.curves.add_episode(row, end);
            }
            self.film_episode(round, episode, first);
        }
    }

    /// The first and the last row of an episode on the timelines; the agent's next episode begins after them.
    fn moments(&mut self, episode: &Episode) -> (Moment, Moment) {
        let next_step = &mut self.progress.next_steps[episode.agent as usize];
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
        (first, end)
    }

    fn film_episode(&mut self, round: &RoundRecord<'_>, episode: &Episode, first: Moment) {
        let is_of_episode = |footage: &&Footage| {
            (footage.agent, footage.episode) == (episode.agent, episode.episode)
        };
        let film = self
            .films
            .iter_mut()
            .find(|film| film.agent() == episode.agent);
        if let (Some(film), Some(footage)) = (film, round.footage.iter().find(is_of_episode)) {
            film.develop(footage, first);
        }
    }

    /// The end of the latest round, at the step of the agent that has gone furthest.
    fn now(&self) -> Moment {
        let (round, episode) = self.progress.latest.unwrap_or_default();
        let env_step = self
            .progress
            .next_steps
            .iter()
            .max()
            .map_or(0, |next| (next - 1).max(0));
        Moment {
            env_step,
            episode,
            round,
        }
    }

    /// Writes those collected rows that make a good piece, or all.
    pub(super) fn write(&mut self, all: bool) -> Result<(), Fault> {
        for AgentTrack { raw, sample } in &mut self.agents {
            raw.take(all)
                .into_iter()
                .try_for_each(|chunk| self.sink.send_chunk(&chunk?))?;
            sample
                .take(&self.drawing, all)?
                .iter()
                .try_for_each(|chunk| self.sink.send_chunk(chunk))?;
        }
        for film in &mut self.films {
            film.take(all)?
                .iter()
                .try_for_each(|chunk| self.sink.send_chunk(chunk))?;
        }
        let mut chunks = self.team.take(&self.drawing, all)?;
        chunks.extend(self.pictures.take(all)?);
        chunks
            .iter()
            .try_for_each(|chunk| self.sink.send_chunk(chunk))?;
        self.curves
            .take(all)
            .try_for_each(|chunk| self.sink.send_chunk(&chunk?))
    }

    /// Pictures what was visited so far and lately.
    pub(super) fn picture(&mut self) {
        let now = self.now();
        self.pictures
            .hang(&self.visited, &self.drawing, self.window, now);
        self.progress.pictured = true;
    }

    /// Fixes the scale of lines and points for the whole run, which the first round's episodes help to tell.
    fn settle_colours(&mut self, first: &[&Episode]) {
        let by = self.drawing.colouring.by;
        let range = Colouring::range(by, &self.spec, self.episodes, self.largest_bonus, first);
        self.drawing.colouring.range = range;
        self.progress.colour_range = Some(range);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 200 pictures up to round 2000, then 100 up to 4000, and 100 up to 8000, where rounds 4000 and 8000 begin the next distance.
    #[test]
    fn pictures_become_rarer_as_a_run_grows() {
        let between = |first: u32, end: u32| {
            (first..end)
                .filter(|round| is_pictured(*round, 10))
                .collect::<Vec<u32>>()
        };
        assert_eq!(between(0, 31), [0, 10, 20, 30]);
        assert_eq!(
            [
                between(0, 2000).len(),
                between(2000, 4000).len(),
                between(4000, 8000).len()
            ],
            [200, 100, 100]
        );
        assert_eq!(between(3970, 4090), [3980, 4000, 4040, 4080]);
        assert!(is_pictured(0, 1_000_000_000) && !is_pictured(u32::MAX, 1_000_000_000));
    }
}
