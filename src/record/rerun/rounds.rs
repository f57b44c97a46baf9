//! What happens to a round: its rows are collected, and written when they make a good piece.

use std::slice::Iter;

use super::rows::Moment;
use super::sink::Fault;
use super::{AgentTrack, RerunRecorder};
use crate::experience::Episode;
use crate::random::{Purpose, stream};
use crate::record::{EpisodeRow, Footage, RoundRecord};

impl RerunRecorder {
    /// Takes in a round, and writes what makes good pieces by now.
    pub(super) fn take_in(&mut self, round: &RoundRecord<'_>) -> Result<(), Fault> {
        if self.progress.latest.is_none() {
            self.lay_out(round.footage)?;
        }
        let mut rows = round.episode_rows.iter();
        for episodes in round.episodes.chunk_by(|one, next| one.agent == next.agent) {
            self.take_in_episodes(round, episodes, &mut rows);
        }
        let latest_episode = round.episodes.iter().map(|episode| episode.episode.into()).max();
        (self.progress.latest, self.progress.pictured) = (Some((round.round.into(), latest_episode.unwrap_or(0))), false);
        let end = self.now();
        self.curves.add_round(round.episode_rows, round.round_rows, end, &mut self.progress.latest_returns);
        if round.round.is_multiple_of(self.density_every) {
            self.picture();
        }
        self.write(false)
    }

    /// Takes in one agent's episodes of a round.
    fn take_in_episodes(&mut self, round: &RoundRecord<'_>, episodes: &[&Episode], rows: &mut Iter<'_, EpisodeRow>) {
        let mut random = stream(self.run_seed, Purpose::Recording, episodes[0].agent, round.round);
        for (index, episode) in episodes.iter().enumerate() {
            let lines = self.quota.of_episode(index, episodes.len());
            let (first, end) = self.moments(episode);
            let track = &mut self.agents[episode.agent as usize];
            if episode.episode.is_multiple_of(self.raw_every) {
                track.raw.add(episode, first);
            }
            track.visits.add(&self.axes, episode, end, lines, &mut random);
            if let Some(row) = rows.next() {
                self.curves.add_episode(row, end);
            }
            self.film_episode(round, episode, first);
        }
    }

    /// The first and the last row of an episode on the timelines; the agent's next episode begins after them.
    fn moments(&mut self, episode: &Episode) -> (Moment, Moment) {
        let next_step = &mut self.progress.next_steps[episode.agent as usize];
        let first = Moment { env_step: *next_step, episode: episode.episode.into(), round: episode.round.into() };
        let end = Moment { env_step: *next_step + episode.length() as i64, ..first };
        *next_step = end.env_step + 1;
        (first, end)
    }

    fn film_episode(&mut self, round: &RoundRecord<'_>, episode: &Episode, first: Moment) {
        let is_of_episode = |footage: &&Footage| (footage.agent, footage.episode) == (episode.agent, episode.episode);
        let film = self.films.iter_mut().find(|film| film.agent() == episode.agent);
        if let (Some(film), Some(footage)) = (film, round.footage.iter().find(is_of_episode)) {
            film.develop(footage, first);
        }
    }

    /// The end of the latest round, at the step of the agent that has gone furthest.
    fn now(&self) -> Moment {
        let (round, episode) = self.progress.latest.unwrap_or_default();
        let env_step = self.progress.next_steps.iter().max().map_or(0, |next| (next - 1).max(0));
        Moment { env_step, episode, round }
    }

    /// Writes those collected rows that make a good piece, or all.
    pub(super) fn write(&mut self, all: bool) -> Result<(), Fault> {
        for AgentTrack { raw, visits } in &mut self.agents {
            let chunks = [raw.take(all), visits.lines.take(&self.axes, all), visits.pictures.take(all)];
            chunks.into_iter().flatten().try_for_each(|chunk| self.sink.send_chunk(&chunk?))?;
        }
        for film in &mut self.films {
            film.take(all)?.iter().try_for_each(|chunk| self.sink.send_chunk(chunk))?;
        }
        let mut team = self.team_pictures.take(all).into_iter().chain(self.curves.take(all));
        team.try_for_each(|chunk| self.sink.send_chunk(&chunk?))
    }

    /// Pictures all states visited so far.
    pub(super) fn picture(&mut self) {
        let now = self.now();
        self.agents.iter_mut().for_each(|track| track.visits.picture(now));
        self.team_pictures.hang_sum(&self.axes, self.agents.iter_mut().map(|track| &mut track.visits), now);
        self.progress.pictured = true;
    }
}
