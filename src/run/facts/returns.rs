//! Returns of agents and of the team, and the return at the end of a run.

use super::EpisodeRow;

/// Number of episodes per agent over which the final return is averaged.
pub const FINAL_WINDOW: usize = 25;

/// Mean return over agents and over the last [`FINAL_WINDOW`] episodes of each agent of a run of
/// seedbed. `None` before every agent has finished an episode.
///
/// `counts`: number of episodes of each agent. `team_returns`: means over agents of the episodes that all
/// have finished. `returns`: at least the last returns of each agent, `[K][≤ FINAL_WINDOW]`.
#[must_use]
pub fn final_return(
    counts: impl IntoIterator<Item = usize>,
    team_returns: &[f64],
    returns: impl IntoIterator<Item: AsRef<[f64]>>,
) -> Option<f64> {
    let mut counts = counts.into_iter();
    if counts.all(|count| count == team_returns.len()) {
        // The same mean with the bits of stored summaries.
        return final_mean(team_returns);
    }
    final_mean_of_learners(returns)
}

/// Mean over learners of the return of their n-th episode, for each n that all have finished.
#[must_use]
pub fn means_of_learners(returns: &[Vec<f64>]) -> Vec<f64> {
    let episodes = returns.iter().map(Vec::len).min().unwrap_or(0);
    let mean_of = |episode: usize| {
        let sum: f64 = returns.iter().map(|learner| learner[episode]).sum();
        sum / returns.len() as f64
    };
    (0..episodes).map(mean_of).collect()
}

/// Mean over learners of the mean of their own last [`FINAL_WINDOW`] episodes, of which they may have
/// finished different numbers; `None` if one has none.
#[must_use]
pub fn final_mean_of_learners(returns: impl IntoIterator<Item: AsRef<[f64]>>) -> Option<f64> {
    let means = returns.into_iter();
    let means = means.map(|learner| final_mean(learner.as_ref()));
    let means: Option<Vec<f64>> = means.collect();
    let means = means.filter(|means| !means.is_empty())?;
    Some(means.iter().sum::<f64>() / means.len() as f64)
}

/// Mean of the last [`FINAL_WINDOW`] values, or of all values if there are fewer.
#[must_use]
pub fn final_mean(values: &[f64]) -> Option<f64> {
    let last = &values[values.len().saturating_sub(FINAL_WINDOW)..];
    (!last.is_empty()).then(|| last.iter().sum::<f64>() / last.len() as f64)
}

/// Mean over agents of the return of their n-th episode, for each n that all agents have finished.
#[must_use]
pub fn team_returns(episodes: &[EpisodeRow], agent_count: usize) -> Vec<f64> {
    let mut sums: Vec<(f64, usize)> = Vec::new();
    for row in episodes {
        let index = row.episode as usize;
        if sums.len() <= index {
            sums.resize(index + 1, (0.0, 0));
        }
        sums[index] = (sums[index].0 + row.r#return, sums[index].1 + 1);
    }
    sums.into_iter()
        .take_while(|(_, count)| *count == agent_count)
        .map(|(sum, count)| sum / count as f64)
        .collect()
}

/// Returns of each agent, in the order of its episodes: `[K][episodes]`.
#[must_use]
pub fn returns_of_agents(episodes: &[EpisodeRow], agent_count: usize) -> Vec<Vec<f64>> {
    let mut returns = vec![Vec::new(); agent_count];
    for row in episodes {
        if let Some(returns) = returns.get_mut(row.agent as usize) {
            returns.push(row.r#return);
        }
    }
    returns
}
