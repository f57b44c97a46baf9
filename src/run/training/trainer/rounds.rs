//! A round of a trainer: playing, learning and measuring.

use super::round_failure::{RoundFailure, check_episode};
use super::{Round, Trainer, TrainingSettings, division, newest_episodes_of};
use crate::run::facts::EpisodeDetails;
use crate::run::ranks::Ranks;
use crate::run::training::asynchronous::{AsyncConfig, AsyncRollout};
use crate::run::training::episode_warning::EpisodeWarning;
use crate::run::training::remote_steps::RemoteRounds;
use crate::run::training::rollout::{self, GroupRound, PlayedEpisodes, RoundPlan, located};
use crate::run::training::shared_episodes::SharedEpisodes;
use crate::scenario::Schedule;
use seedbed_env::Environment;
use seedbed_env::gymnasium::catch_failure;
use seedbed_learn::agent::UpdateReport;
use seedbed_learn::team::{AgentUpdate, Workers};

/// What agents play in a round of training. All rounds have as many episodes.
fn plan_of_round(settings: &TrainingSettings, round: u32) -> RoundPlan<'_> {
    let episodes = settings.schedule.episodes_per_round();
    RoundPlan {
        run_seed: settings.run_seed,
        round,
        first_episode: round.wrapping_mul(episodes),
        episodes,
        scene: settings.scene.as_ref(),
    }
}

impl Trainer {
    /// Plays a round of concurrent episodes, lets every agent learn from all of them, and measures
    /// the result.
    ///
    /// An asynchronous round ends when as many episodes have ended as there are agents.
    ///
    /// # Errors
    /// An observation, a reward or a network's parameters are not finite, or an environment cannot go on.
    pub fn advance(&mut self) -> Result<Round, RoundFailure> {
        self.forget_old_episodes();
        let (updates, details) = match self.settings.schedule {
            Schedule::Synchronous { .. } | Schedule::Lockstep { .. } => {
                let played = self.play_together(RemoteRounds::new(Ranks::SINGLE))?;
                self.note_warnings(played.warnings);
                let updates = self.learn_from(played.episodes.into())?;
                (updates, played.details)
            }
            Schedule::Asynchronous { training } => {
                self.advance_asynchronously(training.env_steps)?
            }
        };
        Ok(self.finish_measured(updates, details))
    }

    /// Begins a round of concurrent episodes in the copies of a shared world from `first_copy` on.
    pub(in crate::run::training) fn begin_round_in(
        &mut self,
        environment: &mut dyn Environment,
        first_copy: usize,
    ) -> GroupRound<'static> {
        self.forget_old_episodes();
        self.learning.team_mut().begin_round(self.round);
        let agents = 0..self.agent_count() as u32;
        let plan = RoundPlan {
            scene: None,
            ..plan_of_round(&self.settings, self.round)
        };
        GroupRound::begin(environment, agents, first_copy, plan)
    }

    /// Adds the result of the latest step to a round that began in a shared world. A team that
    /// learns from transitions gets those that are due.
    pub(in crate::run::training) fn observe_in(
        &mut self,
        environment: &mut dyn Environment,
        round: &mut GroupRound<'_>,
    ) {
        let interval = self.team().transition_interval();
        round.observe(environment, interval.is_some());
        let is_due = |interval| round.unreported_steps() >= interval || round.is_over();
        if interval.is_some_and(is_due) {
            let workers = Workers::new(self.pool.as_ref());
            let team = self.learning.team_mut();
            let mut remote = RemoteRounds::new(Ranks::SINGLE);
            rollout::report_transitions(&mut [round], &mut remote, team, workers);
        }
    }

    /// Lets every agent learn from a round that was played in a shared world, and measures it.
    ///
    /// # Errors
    /// An observation, a reward or a network's parameters are not finite, or an environment cannot go on.
    pub(in crate::run::training) fn finish_round(
        &mut self,
        round: GroupRound<'_>,
    ) -> Result<Round, RoundFailure> {
        let played = rollout::collect_episodes([round]);
        self.note_warnings(played.warnings);
        let updates = self.learn_from(played.episodes.into())?;
        Ok(self.finish_measured(updates, played.details))
    }

    /// Removes the episodes that are not needed any more, before a round.
    pub(in crate::run::training) fn forget_old_episodes(&mut self) {
        self.learning.forget_old_episodes(self.learned_by_all());
    }

    /// Measures and ends a round of all agents.
    fn finish_measured(
        &mut self,
        updates: Vec<AgentUpdate>,
        details: Vec<EpisodeDetails>,
    ) -> Round {
        let agreement = self.bonus_agreement();
        let round = self.measure_round(updates, details, agreement);
        self.end_round(self.measures_say_done());
        round
    }

    /// Measures a round, given the updates of the local agents. Only rank 0 has the rows. `bonus_agreement`: see
    /// [`bonus_agreement`](Self::bonus_agreement)
    pub(in crate::run::training) fn measure_round(
        &mut self,
        updates: Vec<AgentUpdate>,
        details: Vec<EpisodeDetails>,
        bonus_agreement: Option<f64>,
    ) -> Round {
        let (mut reports, mut step_data) = (Vec::new(), Vec::new());
        for AgentUpdate { agent, update, .. } in updates {
            let report = UpdateReport {
                bonus_agreement: bonus_agreement.map(|agreement| agreement as f32),
                ..update.report
            };
            reports.push((agent, report));
            step_data.extend(update.step_data);
        }
        step_data.sort_by_key(|data| (data.agent, data.episode));
        let episodes = newest_episodes_of(&self.learning, self.local_agents());
        let division = division(self.pool.as_ref(), &self.settings);
        let rows = self
            .measures
            .add_round(&self.spec, self.round, &episodes, &reports, division);
        Round {
            rows,
            step_data,
            details,
        }
    }

    /// Counts a round. `is_done`: whether it was the last one
    pub(in crate::run::training) fn end_round(&mut self, is_done: bool) {
        self.round += 1;
        self.is_done = is_done;
    }

    /// Number of the team's first episodes that all agents have learned from.
    pub(super) fn learned_by_all(&self) -> u64 {
        let rollout = self.rollout.as_ref();
        rollout.map_or(u64::MAX, AsyncRollout::learned_by_all)
    }

    /// Every local agent plays its episodes of the round. A team that learns from transitions gets those of
    /// all agents, in which case all episodes are returned.
    ///
    /// # Errors
    /// An environment cannot go on.
    pub(in crate::run::training) fn play_together(
        &mut self,
        remote: RemoteRounds,
    ) -> Result<PlayedEpisodes, RoundFailure> {
        let plan = plan_of_round(&self.settings, self.round);
        let workers = Workers::new(self.pool.as_ref());
        let (groups, team) = (&mut self.groups, self.learning.team_mut());
        let played = catch_failure(|| {
            if team.transition_interval().is_some() {
                rollout::play_and_report(groups, team, &plan, workers, remote)
            } else {
                rollout::play(groups, team, &plan, workers)
            }
        });
        Ok(played?)
    }

    /// Keeps the first physics warning of the run.
    pub(in crate::run::training) fn note_warnings(&mut self, warnings: Vec<EpisodeWarning>) {
        if self.physics_warning.is_none() {
            self.physics_warning = warnings.into_iter().min();
        }
    }

    /// All agents learn from the episodes of a round.
    fn learn_from(&mut self, episodes: SharedEpisodes) -> Result<Vec<AgentUpdate>, RoundFailure> {
        let learned_before = self.episodes_added();
        self.add_to_buffer(episodes)?;
        let updates = self.learn_together(learned_before);
        self.check_updates(&updates)?;
        Ok(updates)
    }

    /// All local agents learn from the team's episodes after the first `learned_before`.
    pub(in crate::run::training) fn learn_together(
        &mut self,
        learned_before: u64,
    ) -> Vec<AgentUpdate> {
        let agents = self.local_agents();
        let workers = Workers::new(self.pool.as_ref());
        self.learning
            .learn_together(agents, learned_before, self.round, workers)
    }

    /// Number of the team's episodes so far.
    pub(in crate::run::training) fn episodes_added(&self) -> u64 {
        self.learning.episodes_added()
    }

    /// Whether the agents have intrinsic rewards whose agreement is measured.
    pub(in crate::run::training) fn compares_bonuses(&self) -> bool {
        self.settings.compares_bonuses
    }

    /// Agents whose episodes have ended learn while the others continue to play.
    fn advance_asynchronously(
        &mut self,
        steps_per_update: u32,
    ) -> Result<UpdatesAndDetails, RoundFailure> {
        let scene = self.settings.scene.clone();
        let config = AsyncConfig {
            run_seed: self.settings.run_seed,
            episodes: self.settings.stop.max_episodes(),
            steps_per_update,
            scene: scene.as_ref(),
        };
        let count = self.agent_count();
        let rollout = self.rollout.take();
        let mut rollout = rollout.unwrap_or_else(|| AsyncRollout::new(config.run_seed, count));
        let (mut updates, mut details) = (Vec::new(), Vec::new());
        let episodes_at_end = self.learning.episodes_before_round() + count as u64;
        while self.episodes_added() < episodes_at_end {
            let environment = &mut *self.groups[0].environment;
            let team = self.learning.team();
            let played = catch_failure(|| rollout.play(environment, team, &config));
            let ended =
                played.map_err(|failure| located(failure, |copy| rollout.place_of(copy)))?;
            if ended.episodes.is_empty() {
                break;
            }
            self.note_warnings(ended.warnings);
            let agents: Vec<u32> = ended.episodes.iter().map(|episode| episode.agent).collect();
            self.add_to_buffer(ended.episodes.into())?;
            details.extend(ended.details);
            let mut learners = Vec::new();
            for agent in agents {
                let total = self.episodes_added();
                let (learned_before, earlier_updates) = rollout.begin_update(agent, total, &config);
                learners.push((agent, learned_before, earlier_updates));
            }
            let workers = Workers::new(self.pool.as_ref());
            let newest = self.learning.learn(&learners, workers);
            self.check_updates(&newest)?;
            updates.extend(newest);
        }
        self.rollout = Some(rollout);
        // Episodes end in any order.
        details.sort_by_key(|details| (details.agent, details.episode));
        Ok((updates, details))
    }

    /// Checks episodes that ended in the same step, and adds them to the shared buffer.
    pub(in crate::run::training) fn add_to_buffer(
        &mut self,
        shared: SharedEpisodes,
    ) -> Result<(), RoundFailure> {
        let SharedEpisodes { episodes, lengths } = shared;
        let mut to_check = episodes.iter();
        to_check.try_for_each(|episode| check_episode(&self.spec, episode))?;
        self.learning.add_episodes(episodes, lengths, self.round);
        Ok(())
    }

    /// Checks that all agents have learned finite parameters.
    pub(in crate::run::training) fn check_updates(
        &self,
        updates: &[AgentUpdate],
    ) -> Result<(), RoundFailure> {
        let diverged = updates.iter().find(|update| !update.is_finite);
        diverged.map_or(Ok(()), |diverged| {
            let (agent, round) = (diverged.agent, self.round);
            Err(RoundFailure::Learning { agent, round })
        })
    }

    /// Plays a round without learning and without measuring it. Episodes are in (agent, episode)
    /// order.
    ///
    /// # Errors
    /// An environment cannot go on.
    pub fn play_without_learning(
        &mut self,
        plan: &RoundPlan<'_>,
    ) -> Result<PlayedEpisodes, RoundFailure> {
        let workers = Workers::new(self.pool.as_ref());
        let (groups, team) = (&mut self.groups, self.learning.team_mut());
        Ok(catch_failure(|| {
            rollout::play(groups, team, plan, workers)
        })?)
    }

    /// Agreement of the agents' intrinsic rewards; see [`LearningTeam::bonus_agreement`].
    ///
    /// [`LearningTeam::bonus_agreement`]: seedbed_learn::team::LearningTeam::bonus_agreement
    pub(in crate::run::training) fn bonus_agreement(&mut self) -> Option<f64> {
        if !self.settings.compares_bonuses {
            return None;
        }
        self.learning.bonus_agreement(self.round)
    }
}

/// The updates of a round in the order in which agents learned, and what is recorded beside its episodes.
type UpdatesAndDetails = (Vec<AgentUpdate>, Vec<EpisodeDetails>);
