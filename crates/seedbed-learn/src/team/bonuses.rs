//! The bonus models of teams in which several agents may act by one model.

use super::Workers;
use crate::agent::bonus::BonusModel;
use crate::experience::{Experience, StepData};

/// A model that agents act by, which may have a bonus model.
pub(crate) trait HasBonusModel: Send + Sync {
    fn bonus_model(&self) -> Option<&BonusModel>;

    fn bonus_model_mut(&mut self) -> Option<&mut BonusModel>;
}

/// What an update of the bonus models gives.
pub(crate) struct BonusUpdate {
    /// Bonuses of each agent's own new steps, by episode: `[K]`.
    pub(crate) own_bonuses: Vec<Vec<StepData>>,
    /// The error of each model's bonus model before it learned: `[models]`.
    pub(crate) prediction_errors: Vec<Option<f32>>,
}

/// Every model computes the bonuses of the new episodes of its agents; then its bonus model learns from
/// all new episodes, unless it is a copy of the first model's.   `model_of_agent: [K]`
pub(crate) fn update_bonus_models<M: HasBonusModel>(
    models: &mut [M],
    model_of_agent: &[usize],
    experience: &Experience<'_>,
    workers: Workers<'_>,
) -> BonusUpdate {
    let mut own_episodes: Vec<Vec<usize>> = vec![Vec::new(); models.len()];
    for (index, episode) in experience.new_episodes.iter().enumerate() {
        own_episodes[model_of_agent[episode.agent as usize]].push(index);
    }
    let models_and_episodes: Vec<(&mut M, Vec<usize>)> =
        models.iter_mut().zip(own_episodes).collect();
    let updates = workers.map(models_and_episodes, |(model, own_episodes)| {
        let (mut bonuses, mut error) = (Vec::new(), None);
        if let Some(bonus_model) = model.bonus_model_mut() {
            bonus_model.compute_own_bonuses(experience, &own_episodes, &mut bonuses);
            error = bonus_model.learn(experience);
        }
        (bonuses, error)
    });
    let (bonuses, mut prediction_errors): (Vec<_>, Vec<_>) = updates.into_iter().unzip();
    if copy_shared_bonus_model(models, workers) {
        let error = prediction_errors[0];
        prediction_errors.fill(error);
    }
    let mut own_bonuses = vec![Vec::new(); model_of_agent.len()];
    for (index, episode) in experience.new_episodes.iter().enumerate() {
        let agent = episode.agent as usize;
        let bonuses_of_model: &Vec<Vec<f32>> = &bonuses[model_of_agent[agent]];
        own_bonuses[agent].push(StepData {
            intrinsic_rewards: bonuses_of_model.get(index).cloned().unwrap_or_default(),
            ..StepData::empty_for(episode)
        });
    }
    BonusUpdate {
        own_bonuses,
        prediction_errors,
    }
}

/// Copies the bonus model of the first model to the others, if the team shares it; returns whether it
/// does.
pub(crate) fn copy_shared_bonus_model<M: HasBonusModel>(
    models: &mut [M],
    workers: Workers<'_>,
) -> bool {
    let Some((first, others)) = models.split_first_mut() else {
        return false;
    };
    let Some(trained) = first.bonus_model().filter(|model| model.is_shared()) else {
        return false;
    };
    workers.for_each(others, |model| {
        if let Some(bonus_model) = model.bonus_model_mut() {
            bonus_model.copy_learned(trained);
        }
    });
    true
}

/// Mean bonus of an agent's own steps; none without steps.
pub(crate) fn mean_bonus(step_data: &[StepData]) -> Option<f32> {
    let bonuses = || step_data.iter().flat_map(|data| &data.intrinsic_rewards);
    let count = bonuses().count();
    (count > 0).then(|| bonuses().sum::<f32>() / count as f32)
}
