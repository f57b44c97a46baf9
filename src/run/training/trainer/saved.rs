//! Saving and restoring the state of a trainer.

use serde::{Deserialize, Serialize};

use super::Trainer;
use crate::run::measures::SavedMeasures;
use crate::run::ranks::Ranks;
use crate::run::training::asynchronous::AsyncRollout;
use crate::run::training::rollout::CopyGroup;
use crate::scenario::Schedule;
use seedbed_learn::experience::SharedBuffer;
use seedbed_learn::team::SavedTeam;

/// The state of a trainer that [`Trainer::save`] writes. `B` and `R` are borrowed when it is written.
#[derive(Serialize, Deserialize)]
struct Saved<B, R> {
    round: u32,
    /// State of each copy.
    copies: Vec<Vec<u8>>,
    team: SavedTeam,
    buffer: B,
    recorded: u64,
    rollout: R,
    measures: SavedMeasures,
}

impl Trainer {
    /// Everything that cannot be derived from the scenario and that the next round needs, as bytes,
    /// without the [replay buffer](Self::replay).
    ///
    /// # Panics
    /// Never: plain data always serializes.
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        self.save_with(self.save_copies(), self.measures.save(Ranks::SINGLE))
    }

    /// Like [`save`](Self::save), with the states of the copies and the measures of all agents.
    pub(in crate::run::training) fn save_with(
        &self,
        copies: Vec<Vec<u8>>,
        measures: SavedMeasures,
    ) -> Vec<u8> {
        let (team, buffer, recorded) = self.learning.save(self.learned_by_all());
        let saved = Saved {
            round: self.round,
            copies,
            team,
            buffer,
            recorded,
            rollout: &self.rollout,
            measures,
        };
        let bytes = postcard::to_stdvec(&saved).expect("plain data always serializes");
        // Behind everything else: checkpoints of earlier versions end here.
        let to_extend = "plain data always serializes";
        if !self.spec.info.is_empty() {
            let info = self
                .rollout
                .as_ref()
                .map(AsyncRollout::info)
                .unwrap_or_default();
            return postcard::to_extend(&info, bytes).expect(to_extend);
        }
        self.physics_warning.iter().fold(bytes, |bytes, warning| {
            postcard::to_extend(warning, bytes).expect(to_extend)
        })
    }

    /// Restores the state that [`save`](Self::save) wrote. Results after that are bit-identical to
    /// those of an uninterrupted run, if the transitions of the [replay buffer](Self::replay) are
    /// restored as well.
    ///
    /// # Errors
    /// The bytes are damaged or belong to another scenario.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        type SavedTrainer = Saved<SharedBuffer, Option<AsyncRollout>>;
        let (saved, rest): (SavedTrainer, &[u8]) =
            postcard::take_from_bytes(bytes).map_err(|error| error.to_string())?;
        let message = |error: postcard::Error| error.to_string();
        let (mut info, mut rollout) = (Vec::new(), saved.rollout);
        self.physics_warning = None;
        // Environments of Gymnasium have no physics of ours, and only they have `info`.
        if !self.spec.info.is_empty() {
            info = postcard::from_bytes(rest).map_err(message)?;
        } else if !rest.is_empty() {
            self.physics_warning = Some(postcard::from_bytes(rest).map_err(message)?);
        }
        if let Some(rollout) = &mut rollout {
            rollout.set_info(info);
        }
        self.restore_copies(&saved.copies)?;
        let (buffer, recorded) = (saved.buffer, saved.recorded);
        self.learning.restore(&saved.team, buffer, recorded)?;
        self.rollout = rollout;
        self.measures.restore(saved.measures)?;
        self.round = saved.round;
        self.is_done = self.measures_say_done();
        Ok(())
    }

    /// States of the copies of the local agents.
    pub(in crate::run::training) fn save_copies(&self) -> Vec<Vec<u8>> {
        let mut saved = Vec::new();
        for CopyGroup { environment, .. } in &self.groups {
            saved.extend((0..environment.copies()).map(|copy| environment.save(copy)));
        }
        saved
    }

    fn restore_copies(&mut self, saved: &[Vec<u8>]) -> Result<(), String> {
        let count = self.agent_count();
        let is_elsewhere = saved.is_empty() || self.groups.is_empty();
        if is_elsewhere && !matches!(self.settings.schedule, Schedule::Asynchronous { .. }) {
            // A shared world owns the copies, and every round resets them.
            return Ok(());
        }
        if saved.len() != count {
            return Err(format!("it has {} copies; expected {count}", saved.len()));
        }
        for CopyGroup {
            first_agent,
            environment,
        } in &mut self.groups
        {
            for copy in 0..environment.copies() {
                environment.restore(copy, &saved[*first_agent as usize + copy])?;
            }
        }
        Ok(())
    }
}
