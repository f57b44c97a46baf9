//! The value of a measure for a run.

use crate::experiment::measure::{Measure, Moment};
use crate::experiment::run_result::RunResult;
use crate::run::facts::metrics::Curve;
use crate::scenario::Rounding;
use seedbed_input::numbers::Count;
use seedbed_stats::aggregate::{mean, median, quantile};
use seedbed_stats::survival::TimeToEvent;

impl Measure {
    /// Value of this measure for a run: infinite for a time that was not reached, `None` if the run
    /// does not have this measure.
    #[must_use]
    pub fn of(self, run: &RunResult) -> Option<f64> {
        let time_or_infinity =
            |time: Option<f64>| run.threshold.map(|_| time.unwrap_or(f64::INFINITY));
        match self {
            Self::EpisodesToSolve => {
                time_or_infinity(run.solved.map(|solved| f64::from(solved.episodes)))
            }
            Self::EnvStepsToSolve => {
                time_or_infinity(run.solved.map(|solved| solved.env_steps as f64))
            }
            Self::Solved => run
                .threshold
                .map(|_| f64::from(u8::from(run.solved.is_some()))),
            Self::Reach => run.has_goal().then(|| share_of_agents_with_goal(run)),
            Self::FirstGoal => run.has_goal().then(|| median(&first_goals(run))),
            Self::Found => run
                .has_goal()
                .then(|| f64::from(u8::from(first_find(run).is_finite()))),
            Self::EpisodesToFind => run.has_goal().then(|| first_find(run)),
            Self::EnvStepsToFind => run.has_goal().then(|| env_steps_to_find(run))?,
            Self::EpisodesToSpread => {
                let found = Some(first_find(run)).filter(|found| found.is_finite())?;
                Some(1.0 + median(&first_goals(run)) - found)
            }
            Self::Regret => {
                (!run.regrets.is_empty()).then(|| run.curve(Curve::Regret).iter().sum())
            }
            Self::FinalReturn { window, .. } if self.is_known_of(run) => match self.moment() {
                Some(Moment::EnvSteps(steps)) => {
                    window_return(&run.until(steps.into())?, usize::MAX, window.get() as usize)
                }
                _ => window_return(run, usize::MAX, window.get() as usize),
            },
            Self::ReturnAt {
                episode, window, ..
            } if self.is_known_of(run) => {
                window_return(run, episode.get() as usize, window.get() as usize)
            }
            Self::SpreadOfAgents { window } => {
                mean_over_agents_statistic(run, window, standard_deviation)
            }
            Self::PercentileOfAgents { percent, window } => {
                let share = f64::from(percent.get()) / 100.0;
                mean_over_agents_statistic(run, window, |returns| quantile(returns, share))
            }
            Self::RegretAbove { regret } => Self::Regret
                .of(run)
                .map(|value| f64::from(u8::from(is_above(value, regret.get().into())))),
            Self::Coverage => Self::Last {
                of: Curve::TeamCoverage,
            }
            .of(run),
            Self::Mean { of: Curve::Return } => window_return(run, usize::MAX, usize::MAX),
            Self::Mean { of } => (!run.curve(of).is_empty()).then(|| mean(&run.curve(of))),
            Self::At { of, .. } if self.is_known_of(run) => match self.moment()? {
                Moment::Episode(episode) => run.curve_at(of, episode),
                Moment::EnvSteps(steps) => run.curve_at(of, run.episodes_at(steps.into())?),
            },
            Self::FinalReturn { .. } | Self::ReturnAt { .. } | Self::At { .. } => None,
            Self::Last { of: Curve::Return } => window_return(run, usize::MAX, 1),
            Self::Last { of } => run.curve(of).last().copied(),
        }
    }

    /// Magnitude of what was added up for the value of a run, to which its rounding error is
    /// proportional.
    #[must_use]
    pub fn magnitude(self, run: &RunResult, value: f64) -> f64 {
        let largest = |values: &[f64]| values.iter().fold(0.0, |one: f64, v| one.max(v.abs()));
        match self {
            Self::Mean { of } if of != Curve::Return => largest(&run.curve(of)),
            Self::FinalReturn { .. }
            | Self::ReturnAt { .. }
            | Self::SpreadOfAgents { .. }
            | Self::PercentileOfAgents { .. }
            | Self::Mean { .. }
            | Self::At {
                of: Curve::Return, ..
            }
            | Self::Last { of: Curve::Return } => {
                let agents = run.returns.iter();
                agents.map(|returns| largest(returns)).fold(0.0, f64::max)
            }
            _ => value.abs(),
        }
    }

    /// Whether this measure of a given moment is known: the run has reached the moment, or the value at the end
    /// of the run is held.
    fn is_known_of(self, run: &RunResult) -> bool {
        self.needed_moment().is_none_or(|moment| match moment {
            Moment::Episode(episode) => run.episodes_per_agent() >= episode as usize,
            Moment::EnvSteps(steps) => run.reaches_step(steps.into()),
        })
    }

    /// Time of a run for survival analysis, censored if it was not reached.
    #[must_use]
    pub fn time_to_event(self, run: &RunResult) -> Option<TimeToEvent> {
        let value = self.of(run)?;
        let episodes = run.episodes_per_agent() as f64;
        let observed_until = match self {
            _ if self.is_time_in_env_steps() => run.env_steps as f64,
            _ if self.is_since_first_find() => 1.0 + episodes - first_find(run),
            _ => episodes,
        };
        Some(if value.is_finite() {
            TimeToEvent::observed(value)
        } else {
            TimeToEvent::censored(observed_until)
        })
    }
}

/// Mean return of the team over the last `window` of the first `end` episodes. Agents of runs of
/// others each count with their own episodes, of which there may be different numbers.
fn window_return(run: &RunResult, end: usize, window: usize) -> Option<f64> {
    if !run.has_different_lengths() {
        return window_mean(&run.team_returns(), end, window);
    }
    let agents = run.returns.iter();
    let means: Option<Vec<f64>> = agents
        .map(|returns| window_mean(returns, end, window))
        .collect();
    means.map(|means| mean(&means))
}

/// First episode in which each agent reached the goal, counted from 1; infinite for agents that
/// never did. → `[K]`
fn first_goals(run: &RunResult) -> Vec<f64> {
    run.first_goals()
        .into_iter()
        .map(|episode| episode.map_or(f64::INFINITY, f64::from))
        .collect()
}

/// First episode in which any agent reached the goal, counted from 1; infinite if none did.
fn first_find(run: &RunResult) -> f64 {
    first_goals(run).into_iter().fold(f64::INFINITY, f64::min)
}

/// Number of steps of the team at the end of the first episode in which an agent reached the goal; infinite if none did, and
/// `None` if steps are unknown.
fn env_steps_to_find(run: &RunResult) -> Option<f64> {
    let mut steps = f64::INFINITY;
    for (agent, goal) in run.first_goals().into_iter().enumerate() {
        let Some(episode) = goal else { continue };
        let ends = run.episode_ends.get(agent)?;
        steps = steps.min(*ends.get(episode as usize - 1)? as f64);
    }
    Some(steps)
}

fn share_of_agents_with_goal(run: &RunResult) -> f64 {
    let goals = first_goals(run);
    goals.iter().filter(|episode| episode.is_finite()).count() as f64 / goals.len() as f64
}

/// Mean of the last `window` of the first `end` values, or of fewer values if there are fewer.
/// `None` without values.
fn window_mean(values: &[f64], end: usize, window: usize) -> Option<f64> {
    let end = end.min(values.len());
    let start = end.saturating_sub(window);
    (start < end).then(|| mean(&values[start..end]))
}

/// Moving averages over windows of `window` values.   `values: [n]` → `[n + 1 − window]`, or empty
#[must_use]
fn moving_average(values: &[f64], window: usize) -> Vec<f64> {
    values.windows(window.max(1)).map(mean).collect()
}

/// Mean over episodes of a statistic over agents of the moving averages of their returns.
fn mean_over_agents_statistic(
    run: &RunResult,
    window: Count,
    statistic: impl Fn(&[f64]) -> f64,
) -> Option<f64> {
    let window = window.get() as usize;
    let mut moving_averages: Vec<Vec<f64>> = Vec::with_capacity(run.returns.len());
    for returns in &run.returns {
        moving_averages.push(moving_average(returns, window));
    }
    let episodes = moving_averages.iter().map(Vec::len).min().unwrap_or(0);
    let mut statistics = Vec::with_capacity(episodes);
    for episode in 0..episodes {
        let returns_at_episode: Vec<f64> =
            moving_averages.iter().map(|agent| agent[episode]).collect();
        statistics.push(statistic(&returns_at_episode));
    }
    (episodes > 0).then(|| mean(&statistics))
}

fn standard_deviation(values: &[f64]) -> f64 {
    let average = mean(values);
    let squared_deviations: Vec<f64> = values
        .iter()
        .map(|value| (value - average).powi(2))
        .collect();
    mean(&squared_deviations).sqrt()
}

/// Whether a value is a number above `limit`, by more than the rounding of sums.
fn is_above(value: f64, limit: f64) -> bool {
    value - limit > Rounding::Double.error(value.abs().max(limit.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_input::numbers::ranged_count;

    /// Five episodes with returns 1 to 5: their mean is 3, that of the last two 4.5.
    #[test]
    fn episodes_after_the_end_are_unknown_unless_held() {
        let run = RunResult {
            returns: vec![(1..=5).map(f64::from).collect()],
            ..RunResult::default()
        };
        let return_at = |episode, window, held| {
            let measure = Measure::ReturnAt {
                episode: ranged_count(episode),
                window: ranged_count(window),
                held,
            };
            measure.of(&run)
        };
        assert_eq!(return_at(5, 25, false), Some(3.0));
        assert_eq!(return_at(8, 25, false), None);
        assert_eq!(return_at(8, 2, true), Some(4.5));
        let at = |episode, held| {
            let measure = Measure::At {
                of: Curve::Return,
                episode: Some(ranged_count(episode)),
                steps: None,
                held,
            };
            measure.of(&run)
        };
        assert_eq!(at(4, false), Some(4.0));
        assert_eq!(at(6, false), None);
        assert_eq!(at(6, true), Some(5.0));
    }

    /// Two agents whose episodes end at steps 10, 30, 50 and 20, 40: at step 45 both have finished two, with mean
    /// returns 2 and 5. The longest episode took 20 steps, so that step 65 may be one of a run of 50 steps whose
    /// last episodes are not finished.
    #[test]
    fn measures_at_equal_steps_need_the_ends_of_episodes() {
        let run = RunResult {
            returns: vec![vec![1.0, 4.0, 9.0], vec![3.0, 6.0]],
            episode_ends: vec![vec![10, 30, 50], vec![20, 40]],
            env_steps: 50,
            rounding: Rounding::Double,
            ..RunResult::default()
        };
        let value = |measure: &str| ron::from_str::<Measure>(measure).unwrap().of(&run);
        for (measure, expected) in [
            ("At(of: Return, steps: 45)", Some(5.0)),
            ("At(of: Return, steps: 39)", Some(2.0)),
            ("At(of: Return, steps: 19)", None),
            ("At(of: Return, steps: 65)", Some(5.0)),
            ("At(of: Return, steps: 71)", None),
            ("At(of: Return, steps: 71, held: true)", Some(5.0)),
            ("FinalReturn(window: 2, steps: 45)", Some(3.5)),
            ("FinalReturn(window: 1, steps: 50)", Some(7.5)),
            ("FinalReturn(window: 1, steps: 71)", None),
            ("FinalReturn(window: 1, steps: 71, held: true)", Some(7.5)),
        ] {
            assert_eq!(value(measure), expected, "{measure}");
        }
        let unknown = RunResult {
            episode_ends: Vec::new(),
            ..run
        };
        let measure: Measure = ron::from_str("FinalReturn(steps: 40)").unwrap();
        assert_eq!(measure.of(&unknown), None);
    }

    /// Agents with 30, 40 and 27 episodes, whose last 25 have the means 173, 183 and 143: 166⅓. Cut to
    /// 27 episodes, the first two would count with their returns of 0.
    #[test]
    fn agents_count_with_their_own_last_episodes() {
        let agent = |zeros: usize, value: f64| [vec![0.0; zeros], vec![value; 25]].concat();
        let mut run = RunResult {
            returns: vec![agent(5, 173.0), agent(15, 183.0), agent(2, 143.0)],
            rounding: crate::scenario::Rounding::Double,
            ..RunResult::default()
        };
        let last: Measure = ron::from_str("FinalReturn()").unwrap();
        assert_eq!(last.of(&run), Some(499.0 / 3.0));
        assert_eq!(
            Measure::Last { of: Curve::Return }.of(&run),
            Some(499.0 / 3.0)
        );
        let mean_of_all = [
            173.0 * 25.0 / 30.0,
            183.0 * 25.0 / 40.0,
            143.0 * 25.0 / 27.0,
        ];
        assert_eq!(
            Measure::Mean { of: Curve::Return }.of(&run),
            Some(mean(&mean_of_all))
        );
        run.rounding = crate::scenario::Rounding::SingleRewards;
        assert_eq!(last.of(&run), Some(499.0 / 3.0));
    }

    /// Three agents, of which the second reaches the goal of 1 first, in its second episode, after 7 steps of the team. With the
    /// first, in the fourth one, two of three have reached it: three episodes later, counting both. The fourth episode ends
    /// after 14 steps.
    #[test]
    fn finding_and_spreading_are_told_apart() {
        let value = |measure: Measure, run: &RunResult| measure.of(run);
        let mut run = RunResult {
            returns: vec![
                vec![0.0, 0.0, 0.0, 1.0],
                vec![0.0, 1.0, 0.0, 0.0],
                vec![0.0; 4],
            ],
            episode_ends: vec![vec![3, 6, 9, 14], vec![3, 7, 10, 14], vec![3, 8, 10, 14]],
            threshold: Some((1.0, 25)),
            env_steps: 14,
            ..RunResult::default()
        };
        assert_eq!(value(Measure::Found, &run), Some(1.0));
        assert_eq!(value(Measure::EpisodesToFind, &run), Some(2.0));
        assert_eq!(value(Measure::EnvStepsToFind, &run), Some(7.0));
        assert_eq!(value(Measure::EpisodesToSpread, &run), Some(3.0));
        run.returns[0] = vec![0.0; 4];
        assert_eq!(value(Measure::EpisodesToSpread, &run), Some(f64::INFINITY));
        let censored = Measure::EpisodesToSpread.time_to_event(&run);
        assert_eq!(censored, Some(TimeToEvent::censored(3.0)));
        run.returns[1] = vec![0.0; 4];
        assert_eq!(value(Measure::Found, &run), Some(0.0));
        assert_eq!(value(Measure::EpisodesToFind, &run), Some(f64::INFINITY));
        assert_eq!(value(Measure::EnvStepsToFind, &run), Some(f64::INFINITY));
        assert_eq!(value(Measure::EpisodesToSpread, &run), None);
    }

    #[test]
    fn statistics_over_agents_are_averaged_over_episodes() {
        let run = RunResult {
            returns: (0..5_u8)
                .map(|agent| vec![f64::from(agent), 2.0 * f64::from(agent)])
                .collect(),
            ..RunResult::default()
        };
        let window = ranged_count(1);
        let percentile = Measure::PercentileOfAgents {
            percent: ranged_count(75),
            window,
        };
        assert_eq!(percentile.of(&run), Some(4.5));
        let spread = Measure::SpreadOfAgents { window }.of(&run).unwrap();
        assert!((spread - 1.5 * 2.0_f64.sqrt()).abs() < 1e-12);
    }

    /// Two agents with regrets of 3 + 4 and 5 + 6: 9 on average.
    #[test]
    fn a_regret_is_above_smaller_numbers_only() {
        let run = RunResult {
            regrets: vec![vec![3.0, 4.0], vec![5.0, 6.0]],
            curves: vec![Vec::new(); Curve::WITH_ROUND_VALUES.len()],
            ..RunResult::default()
        };
        let above = |regret| {
            Measure::RegretAbove {
                regret: ranged_count(regret),
            }
            .of(&run)
        };
        assert_eq!((above(8), above(9)), (Some(1.0), Some(0.0)));
    }

    #[test]
    fn a_sum_that_is_rounded_up_is_not_above() {
        assert!(0.1 + 0.2 > 0.3 && !is_above(0.1 + 0.2, 0.3));
        assert!(is_above(0.3001, 0.3) && !is_above(f64::NAN, 0.3));
        assert!(is_above(f64::INFINITY, 3.0));
    }
}
