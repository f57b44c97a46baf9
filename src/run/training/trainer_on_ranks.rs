//! A trainer that is divided over ranks: rank 0 gives orders, and the others carry them out.

use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::remote_steps::RemoteRounds;
use super::shared_episodes;
use super::trainer::{Round, RoundFailure, Trainer};
use crate::run::facts::EpisodeDetails;
use crate::run::measures::VisitStatistics;
use crate::run::ranks::Ranks;
use seedbed_learn::nn::Tensor;

/// The part of a run's trainer that is on this rank, with the environments of its local agents. Rank 0
/// gets the rows and the saved state of the whole team. A run in one process is on rank 0.
///
/// What needs all ranks is a function of this type, which lets the others do the same.
pub struct TrainerOnRanks<'a> {
    local: Trainer,
    ranks: Ranks,
    interrupted: &'a AtomicBool,
    /// Whether any rank was asked to stop before the end of the latest round.
    is_any_interrupted: bool,
}

/// What recorders on all ranks do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RecordingOrder {
    /// Save their states; `at_end`: after they have written everything.
    Checkpoint {
        /// Whether the run ends, for now or for good.
        at_end: bool,
    },
    /// Complete their files.
    Finish,
}

/// The recorders of a rank other than 0.
pub trait FollowingRecorders {
    /// Why they cannot go on.
    type Error: From<RoundFailure>;

    /// Records what the local agents of a trainer did in a round.
    ///
    /// # Errors
    /// It cannot be recorded.
    fn record(&mut self, trainer: &Trainer, round: Round) -> Result<(), Self::Error>;

    /// Carries out an order of rank 0.
    ///
    /// # Errors
    /// It cannot be carried out.
    fn obey(&mut self, order: RecordingOrder) -> Result<(), Self::Error>;
}

/// What all ranks do next.
#[derive(Clone, Copy, Serialize, Deserialize)]
enum Order {
    Advance,
    Record(RecordingOrder),
    Save,
    VisitStatistics,
    Tensors { with_initial: bool },
    End,
}

impl<'a> TrainerOnRanks<'a> {
    /// Agrees with the other ranks that all of them can begin; returns the trainer and what else this one
    /// has begun. `interrupted` is set when this rank is asked to stop.
    ///
    /// # Errors
    /// The error of this rank, if no rank before it has one.
    pub fn begin<T, E>(
        begun: Result<(Trainer, T), E>,
        ranks: Ranks,
        interrupted: &'a AtomicBool,
    ) -> Result<(Self, T), E> {
        let (local, other) = ranks.agree(begun)?;
        let trainer = Self {
            local,
            ranks,
            interrupted,
            is_any_interrupted: false,
        };
        Ok((trainer, other))
    }

    /// The trainer on this rank.
    #[must_use]
    pub fn local(&self) -> &Trainer {
        &self.local
    }

    /// Whether the run can go back to an earlier state: a rank that did so by itself would let the others
    /// wait.
    #[must_use]
    pub fn can_go_back(&self) -> bool {
        self.ranks.is_single()
    }

    /// Continues from the state of another trainer of the same run, if the run [can go back](Self::can_go_back).
    pub fn go_back_to(&mut self, earlier: Trainer) {
        self.local = earlier;
    }

    /// Whether any rank was asked to stop.
    #[must_use]
    pub fn is_interrupted(&self) -> bool {
        self.is_any_interrupted || self.interrupted.load(Ordering::Relaxed)
    }

    /// Carries out the orders of rank 0 until the run ends.
    ///
    /// # Errors
    /// A number is not finite, an environment cannot go on, or something cannot be recorded.
    pub fn follow<R: FollowingRecorders>(mut self, recorders: &mut R) -> Result<(), R::Error> {
        loop {
            match self.ranks.broadcast(Order::End) {
                Order::Advance => {
                    let round = self.advance_here()?;
                    recorders.record(&self.local, round)?;
                }
                Order::Record(order) => recorders.obey(order)?,
                Order::Save => drop(self.save_here()),
                Order::VisitStatistics => drop(self.local.visit_statistics()),
                Order::Tensors { with_initial } => drop(self.tensors_here(with_initial)),
                Order::End => return Ok(()),
            }
        }
    }

    /// Lets the other ranks end.
    pub fn end(&self) {
        self.order(Order::End);
    }

    /// Lets the recorders on other ranks do what that of this one does next.
    pub fn order_recorders(&self, order: RecordingOrder) {
        self.order(Order::Record(order));
    }

    /// Plays and learns for one round; see [`Trainer::advance`]. The recorder of this rank must record it next.
    ///
    /// # Errors
    /// A number is not finite, or an environment cannot go on.
    pub fn advance(&mut self) -> Result<Round, RoundFailure> {
        if self.ranks.is_single() {
            return self.local.advance();
        }
        self.order(Order::Advance);
        self.advance_here()
    }

    /// The state of the whole team; see [`Trainer::save`].
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        self.order(Order::Save);
        self.save_here()
    }

    /// Statistics of the states that the team has visited so far.
    #[must_use]
    pub fn visit_statistics(&self) -> VisitStatistics {
        self.order(Order::VisitStatistics);
        self.local.visit_statistics()
    }

    /// The tensors of the whole team, optionally with the agent seeds; see [`Trainer::tensors`].
    #[must_use]
    pub fn tensors(&self, with_initial: bool) -> Vec<Tensor<'_>> {
        self.order(Order::Tensors { with_initial });
        self.tensors_here(with_initial)
    }

    fn order(&self, order: Order) {
        let _own = self.ranks.broadcast(order);
    }

    fn advance_here(&mut self) -> Result<Round, RoundFailure> {
        let (ranks, trainer) = (self.ranks, &mut self.local);
        trainer.forget_old_episodes();
        let reports_steps = trainer.team().transition_interval().is_some();
        let played = trainer.play_together(RemoteRounds::new(ranks));
        // Ranks that report steps wait for each other within the round: one that cannot go on ends all.
        let played = if reports_steps {
            played
        } else {
            ranks.agree(played)
        }?;
        let episodes = if reports_steps {
            played.episodes.into() // the steps of all agents are here already
        } else {
            let needs_first = trainer.compares_bonuses();
            let (team, round) = (trainer.team(), trainer.rounds());
            shared_episodes::share(played.episodes, team, round, needs_first, ranks)
        };
        trainer.note_warnings(ranks.gather_lists(played.warnings));
        let learned_before = trainer.episodes_added();
        let added = trainer.add_to_buffer(episodes);
        ranks.agree(added)?;
        let updates = trainer.learn_together(learned_before);
        ranks.agree(trainer.check_updates(&updates))?;
        let details = with_bodies_of_all(played.details, ranks);
        // Only rank 0 knows the bonuses of all agents.
        let agreement = ranks.broadcast(trainer.bonus_agreement());
        let round = trainer.measure_round(updates, details, agreement);
        let is_done = ranks.broadcast(trainer.measures_say_done());
        trainer.end_round(is_done);
        let interrupted = self.interrupted.load(Ordering::Relaxed);
        self.is_any_interrupted = ranks.all_gather(interrupted).contains(&true);
        Ok(round)
    }

    fn save_here(&self) -> Vec<u8> {
        let copies = self.ranks.gather_lists(self.local.save_copies());
        let measures = self.local.measures().save(self.ranks);
        self.local.save_with(copies, measures)
    }

    fn tensors_here(&self, with_initial: bool) -> Vec<Tensor<'_>> {
        let mut tensors = self.local.tensors();
        if with_initial {
            tensors.extend(self.local.initial_tensors());
        }
        tensors
    }
}

/// What is recorded of the local agents, on rank 0 with the bodies of all agents.
fn with_bodies_of_all(mut local: Vec<EpisodeDetails>, ranks: Ranks) -> Vec<EpisodeDetails> {
    let bodies = local.iter().filter(|details| !details.poses.is_empty());
    let sent = bodies.filter(|_| !ranks.is_first()).cloned().collect();
    let of_others = ranks.gather_lists(sent);
    if ranks.is_first() {
        local.extend(of_others);
    }
    local
}
