//! Rounds of a team that acts by shared models: all copies in lockstep, every transition shared as it happens, and learning after every
//! few steps or at the end of the round.

use rayon::ThreadPool;
use rayon::prelude::*;

use super::rollout::{self, Played, Players, RoundPlan, Seat};
use crate::agent::UpdateReport;
use crate::agent::q_learning::model::{Lesson, ValueModel};
use crate::agent::q_learning::{DecisionRoom, ValueTeam};
use crate::env::Environment;
use crate::experience::{Episode, Experience};

/// When a team learns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Learning {
    /// Not at all; nor does it remember.
    Never,
    /// When the round has been played.
    AfterRound,
    /// After so many steps of each agent, and again, while the round is played.
    Every(u32),
}

/// Plays a round. Models learn on the threads of `pool`; the bits do not depend on it.
pub(super) fn play(
    environment: &mut dyn Environment,
    team: &mut ValueTeam,
    plan: &RoundPlan<'_>,
    learning: Learning,
    pool: Option<&ThreadPool>,
) -> Played {
    team.begin_round(plan.round);
    let count = environment.copies();
    let mut sharers = Sharers {
        team,
        learning,
        pool,
        steps: 0,
        playing: vec![false; count],
        actions: vec![0.0; count],
        room: DecisionRoom::default(),
    };
    rollout::play_by(environment, &mut sharers, count, plan)
}

/// The round has been played: models learn now if they have not done so meanwhile, and curiosity judges and learns.
///
/// Returns what learning was like for each agent.
pub(super) fn end_round(
    team: &mut ValueTeam,
    experience: &Experience<'_>,
    learning: Learning,
    pool: Option<&ThreadPool>,
) -> Vec<(u32, UpdateReport)> {
    if learning == Learning::AfterRound {
        learn(team, pool);
    }
    let bonuses = if team.is_curious() {
        reflect(team, experience, pool)
    } else {
        Vec::new()
    };
    team.end_round(experience, &bonuses);
    team.reports()
}

/// For each model, the bonuses of the steps of each fresh episode of its followers.
fn reflect(
    team: &mut ValueTeam,
    experience: &Experience<'_>,
    pool: Option<&ThreadPool>,
) -> Vec<Vec<Vec<f32>>> {
    let places = |model: usize| -> Vec<usize> {
        let followers = team.followers(model);
        (0..experience.fresh.len())
            .filter(|&place| followers.contains(&(experience.fresh[place].agent as usize)))
            .collect()
    };
    let places: Vec<Vec<usize>> = (0..team.model_count()).map(places).collect();
    let judge = |(model, own): (&mut ValueModel, &Vec<usize>)| {
        let mut bonuses = Vec::new();
        model.reflect(experience, own, &mut bonuses);
        bonuses
    };
    let (models, _) = team.lesson();
    match pool {
        Some(pool) => pool.install(|| models.par_iter_mut().zip(&places).map(judge).collect()),
        None => models.iter_mut().zip(&places).map(judge).collect(),
    }
}

/// Every model learns, all at once.
fn learn(team: &mut ValueTeam, pool: Option<&ThreadPool>) {
    let (models, lesson): (&mut [ValueModel], Lesson<'_>) = team.lesson();
    match pool {
        Some(pool) if models.len() > 1 => {
            pool.install(|| models.par_iter_mut().for_each(|model| model.learn(&lesson)))
        }
        _ => models.iter_mut().for_each(|model| model.learn(&lesson)),
    }
}

/// A team that acts by shared models, in the middle of a round.
struct Sharers<'a> {
    team: &'a mut ValueTeam,
    learning: Learning,
    pool: Option<&'a ThreadPool>,
    /// Steps of this round so far.
    steps: u32,
    playing: Vec<bool>,
    actions: Vec<f32>,
    room: DecisionRoom,
}

impl Players for Sharers<'_> {
    fn step(&mut self, environment: &mut dyn Environment, seats: &mut [Seat]) {
        let Self {
            team,
            playing,
            actions,
            room,
            ..
        } = self;
        playing
            .iter_mut()
            .zip(&*seats)
            .for_each(|(playing, seat)| *playing = seat.is_playing());
        team.evaluate(environment.observations(), playing, room);
        for (agent, (seat, slot)) in seats.iter_mut().zip(&mut *actions).enumerate() {
            if let Some(action) = seat.act(|random| team.choose(agent, random, room)) {
                *slot = action;
            }
        }
        environment.step(actions);
    }

    fn experience(&mut self, episode: &Episode) {
        if self.learning != Learning::Never {
            self.team.take_in(episode);
        }
    }

    fn step_ended(&mut self) {
        if self.learning == Learning::Never {
            return;
        }
        self.steps += 1;
        self.team.count_step();
        if let Learning::Every(count) = self.learning
            && self.steps.is_multiple_of(count)
        {
            learn(self.team, self.pool);
        }
    }
}
