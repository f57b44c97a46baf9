//! The search: which runs a rung needs, and which configurations go on.

use std::cmp::Ordering;
use std::collections::{BTreeSet, HashSet};

use super::file::Goal;
use super::plan::{TunedMethod, TuningPlan};
use crate::experiment::measure::Measure;
use crate::experiment::run_result::RunResult;
use crate::provenance::BuildId;
use crate::study::design::cell::PlannedRun;
use crate::study::store::StudyFolder;
use seedbed_stats::aggregate::mean;

/// A search whose rungs are finished one after the other.
#[derive(Clone, Debug)]
pub struct Search<'p> {
    /// The plan.
    pub plan: &'p TuningPlan,
    /// What is known of each configuration, by the index of its cell.
    pub configurations: Vec<Tried>,
    /// Cells of each method that are in the next rung or, after the last rung, were in it; the best
    /// first.
    ranking: Vec<Vec<usize>>,
    finished_rungs: usize,
    /// Builds that made the runs; `None` is an unknown build.
    pub builds: BTreeSet<Option<BuildId>>,
}

/// What is known of a configuration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tried {
    /// Runs, in the order of their run seeds.
    pub runs: Vec<TuningRun>,
}

/// A run of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct TuningRun {
    /// Rung for which the run was made.
    pub rung: usize,
    /// Run seed.
    pub run_seed: u64,
    /// What the run counts as.
    pub score: Score,
}

/// What a run counts as.
#[derive(Clone, Debug, PartialEq)]
pub enum Score {
    /// The measure of the run.
    Value(f64),
    /// The horizon, because the run did not reach the time that is measured before it.
    NotReached(f64),
    /// The worst: the run failed, for this reason.
    Failed(String),
}

/// Error: a run of a rung has no result.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{cell}, run seed {run_seed}: no result is stored")]
pub struct MissingRun {
    /// Name of the cell.
    pub cell: String,
    /// Run seed.
    pub run_seed: u64,
}

impl<'p> Search<'p> {
    /// The search before its first rung.
    #[must_use]
    pub fn new(plan: &'p TuningPlan) -> Self {
        let methods = plan.methods.iter();
        Self {
            plan,
            configurations: vec![Tried::default(); plan.study.cells.len()],
            ranking: methods
                .map(|method| method.cells.clone().collect())
                .collect(),
            finished_rungs: 0,
            builds: BTreeSet::new(),
        }
    }

    /// Runs of the next rung, without those of earlier rungs. Methods whose last rung is finished have
    /// none.
    #[must_use]
    pub fn next_runs(&self) -> Vec<PlannedRun<'p>> {
        let mut runs = Vec::new();
        for (method, ranking) in self.plan.methods.iter().zip(&self.ranking) {
            if self.finished_rungs < method.schedule.rungs.len() {
                for (cell, repeats) in runs_of_rung(method, ranking, self.finished_rungs) {
                    runs.extend(repeats.map(|repeat| self.plan.run(cell, repeat)));
                }
            }
        }
        runs
    }

    /// The next runs without duplicates: equal configurations of several methods share their runs.
    #[must_use]
    pub fn next_distinct_runs(&self) -> Vec<PlannedRun<'p>> {
        let mut runs = self.next_runs();
        let mut seen = HashSet::new();
        runs.retain(|run| seen.insert((run.cell.digest(), run.run_seed)));
        runs
    }

    /// Reads the results of the next rung, and keeps the best configurations of each method.
    ///
    /// # Errors
    /// If a run has no result.
    pub fn finish_rung(&mut self, folder: &StudyFolder) -> Result<(), MissingRun> {
        let rung = self.finished_rungs;
        let horizon = self.plan.horizon();
        for run in self.next_runs() {
            let stored = folder.stored_run(&run).ok_or_else(|| MissingRun {
                cell: run.cell.name.clone(),
                run_seed: run.run_seed,
            })?;
            self.builds.insert(stored.build);
            let score = match stored.outcome {
                Ok(result) => Score::of(&result, *self.plan.tuning().measure, horizon),
                Err(reason) => Score::Failed(reason),
            };
            let cell = run.index / self.plan.study.repeats() as usize;
            self.configurations[cell].runs.push(TuningRun {
                rung,
                run_seed: run.run_seed,
                score,
            });
        }
        for method in 0..self.plan.methods.len() {
            self.rank(method, rung);
        }
        self.finished_rungs += 1;
        Ok(())
    }

    /// Sorts the configurations of a method that were in this rung, and keeps those of the next one.
    fn rank(&mut self, method: usize, rung: usize) {
        let goal = self.plan.tuning().goal;
        let rungs = &self.plan.methods[method].schedule.rungs;
        if rung >= rungs.len() {
            return;
        }
        let tried = &self.configurations;
        let ranking = &mut self.ranking[method];
        ranking.sort_by(|&a, &b| tried[a].compare(&tried[b], goal).then(a.cmp(&b)));
        if let Some(next) = rungs.get(rung + 1) {
            ranking.truncate(next.configurations);
        }
    }

    /// Cells of a method, from the best to the worst: first those of the last rung by rank, then those
    /// of the rung before it, and so on.
    #[must_use]
    pub fn ranked_cells(&self, method: usize) -> Vec<usize> {
        let goal = self.plan.tuning().goal;
        let mut cells: Vec<usize> = self.plan.methods[method].cells.clone().collect();
        let tried = &self.configurations;
        cells.sort_by(|&a, &b| {
            let by_rung = tried[b].rung().cmp(&tried[a].rung());
            let by_value = || tried[a].compare(&tried[b], goal);
            by_rung.then_with(by_value).then(a.cmp(&b))
        });
        cells
    }
}

/// Cells of a rung, and the numbers of the runs that it adds to each.
fn runs_of_rung(
    method: &TunedMethod,
    ranking: &[usize],
    rung: usize,
) -> impl Iterator<Item = (usize, std::ops::Range<u64>)> {
    let before = method.schedule.runs_before(rung);
    let ranks = ranking.iter().enumerate();
    ranks.map(move |(rank, &cell)| (cell, before..method.schedule.runs(rung, rank)))
}

impl Score {
    fn of(run: &RunResult, measure: Measure, horizon: f64) -> Self {
        let time = measure.is_time().then(|| measure.time_to_event(run));
        match (time.flatten(), measure.of(run)) {
            (Some(time), _) if time.observed && time.time <= horizon => Self::Value(time.time),
            (Some(_), _) => Self::NotReached(horizon),
            (None, Some(value)) if value.is_finite() => Self::Value(value),
            (None, Some(value)) => Self::Failed(format!("its measure is {value}")),
            (None, None) => Self::Failed(match measure.needed_moment() {
                Some(moment) => {
                    format!("it ended before {moment}; expected `held: true` in the measure")
                }
                None => "it does not have the measure".to_owned(),
            }),
        }
    }

    /// The number that enters the mean; `None` for a failed run.
    #[must_use]
    pub fn value(&self) -> Option<f64> {
        match self {
            Self::Value(value) | Self::NotReached(value) => Some(*value),
            Self::Failed(_) => None,
        }
    }
}

impl Tried {
    /// Values of the runs that did not fail.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        self.runs
            .iter()
            .filter_map(|run| run.score.value())
            .collect()
    }

    /// Number of failed runs.
    #[must_use]
    pub fn failures(&self) -> usize {
        self.runs.len() - self.values().len()
    }

    /// The last rung that the configuration was in; `None` before the first.
    #[must_use]
    pub fn rung(&self) -> Option<usize> {
        self.runs.last().map(|run| run.rung)
    }

    /// `Less` if this configuration is better: it has fewer failed runs or, if the numbers are equal,
    /// a better mean of the others.
    fn compare(&self, other: &Self, goal: Goal) -> Ordering {
        let by_failures = self.failures().cmp(&other.failures());
        let mean_of = |tried: &Self| {
            let values = tried.values();
            (!values.is_empty()).then(|| mean(&values))
        };
        by_failures.then_with(|| match (mean_of(self), mean_of(other)) {
            (Some(a), Some(b)) if goal == Goal::Minimize => a.total_cmp(&b),
            (Some(a), Some(b)) => b.total_cmp(&a),
            _ => Ordering::Equal,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::run_result::Milestone;

    fn tried(scores: &[Option<f64>]) -> Tried {
        let score = |score: &Option<f64>| {
            score.map_or_else(|| Score::Failed("reason".to_owned()), Score::Value)
        };
        let run = |(run_seed, value)| TuningRun {
            rung: 0,
            run_seed,
            score: score(value),
        };
        Tried {
            runs: (0..).zip(scores).map(run).collect(),
        }
    }

    /// Means 2 and 3: the goal decides. A failed run is worse than any value.
    #[test]
    fn a_failed_run_is_worse_than_any_value() {
        let (two, three) = (
            tried(&[Some(1.0), Some(3.0)]),
            tried(&[Some(3.0), Some(3.0)]),
        );
        assert_eq!(two.compare(&three, Goal::Minimize), Ordering::Less);
        assert_eq!(two.compare(&three, Goal::Maximize), Ordering::Greater);
        assert_eq!(two.compare(&two, Goal::Maximize), Ordering::Equal);
        let failed = tried(&[Some(1e9), None]);
        let all_failed = tried(&[None, None]);
        for goal in [Goal::Minimize, Goal::Maximize] {
            let best = tried(&[Some(-1e9), Some(1e9)]);
            assert_eq!(best.compare(&failed, goal), Ordering::Less);
            assert_eq!(failed.compare(&all_failed, goal), Ordering::Less);
            assert_eq!(all_failed.compare(&all_failed, goal), Ordering::Equal);
        }
    }

    /// A run of two episodes that is solved after one, with a horizon of 8, and one that is not solved.
    #[test]
    fn a_time_that_is_not_reached_counts_as_the_horizon() {
        let mut run = RunResult {
            threshold: Some((1.0, 1)),
            returns: vec![vec![0.0, 2.0]],
            ..RunResult::default()
        };
        let measure = Measure::EpisodesToSolve;
        assert_eq!(Score::of(&run, measure, 8.0), Score::NotReached(8.0));
        run.solved = Some(Milestone {
            episodes: 5,
            env_steps: 50,
        });
        assert_eq!(Score::of(&run, measure, 8.0), Score::Value(5.0));
        assert_eq!(Score::of(&run, measure, 4.0), Score::NotReached(4.0));
        run.threshold = None;
        assert!(matches!(Score::of(&run, measure, 8.0), Score::Failed(_)));
    }
}
