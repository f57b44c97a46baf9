//! Successive halving (Jamieson and Talwalkar 2016): how many configurations get how many runs.
//!
//! In rung k the best ⌊n/ηᵏ⌋ of n configurations have r·ηᵏ runs each. Runs of earlier rungs count, so
//! that rung k costs ⌊n/ηᵏ⌋·(r·ηᵏ − r·ηᵏ⁻¹). Every budget is spent to the last run.

/// What limits a schedule, apart from its budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rule {
    /// Minimum number of runs r of each configuration in rung 0.
    pub runs: u64,
    /// Factor η of the numbers of configurations and runs of successive rungs.
    pub eta: u64,
    /// Maximum number of runs of a configuration: the number of run seeds.
    pub max_runs: u64,
}

/// A rung: some configurations have the same number of runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rung {
    /// Number of configurations.
    pub configurations: usize,
    /// Number of runs of each configuration, with those of earlier rungs.
    pub runs: u64,
    /// Number of configurations, from the best on, that have one run more.
    pub with_one_more: usize,
}

/// The rungs of a method, which together cost exactly its budget.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Rungs, the first with all configurations.
    pub rungs: Vec<Rung>,
}

/// Minimum number of configurations: the default, and another one.
pub const MIN_CONFIGURATIONS: usize = 2;

/// Error: the configurations need more run seeds than there are to spend a budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooFewSeeds {
    /// Number of run seeds that would be needed.
    pub needed: u64,
}

impl Rule {
    /// Maximum number of configurations that a budget can pay for with `runs` runs each in rung 0.
    #[must_use]
    pub fn max_configurations(self, budget: u64) -> usize {
        let (mut low, mut high) = (0, budget / self.runs);
        while low < high {
            let middle = low + (high - low).div_ceil(2);
            if self.cost_per_run(middle) * self.runs <= budget {
                low = middle;
            } else {
                high = middle - 1;
            }
        }
        low as usize
    }

    /// Number of runs that the smallest search needs.
    #[must_use]
    pub fn min_budget(self) -> u64 {
        let smallest = MIN_CONFIGURATIONS as u64;
        self.cost_per_run(smallest) * self.runs
    }

    /// The factors ηᵏ of the rungs of `configurations` configurations: as long as one configuration
    /// is left, and there are run seeds.
    fn factors(self, configurations: u64) -> Vec<u64> {
        let mut factors: Vec<u64> = vec![1];
        while let Some(next) = factors[factors.len() - 1].checked_mul(self.eta)
            && next <= configurations
            && next.saturating_mul(self.runs) <= self.max_runs
        {
            factors.push(next);
        }
        factors
    }

    /// Cost of all rungs per run of a configuration in rung 0.
    fn cost_per_run(self, configurations: u64) -> u64 {
        let mut previous = 0;
        let mut cost = 0;
        for factor in self.factors(configurations) {
            cost += configurations / factor * (factor - previous);
            previous = factor;
        }
        cost
    }

    /// The schedule that spends `budget` on this number of configurations, which is at least 1 and at
    /// most [`max_configurations`](Self::max_configurations).
    ///
    /// With fewer configurations than that, each has as many more runs in rung 0 as the budget allows.
    /// What is left is divided among the configurations of the last rung; the best get what cannot be
    /// divided.
    ///
    /// # Errors
    /// If there are too few run seeds.
    pub fn schedule(self, budget: u64, configurations: usize) -> Result<Schedule, TooFewSeeds> {
        let count = configurations as u64;
        let factors = self.factors(count);
        let last_factor = factors[factors.len() - 1];
        let cost = self.cost_per_run(count);
        let runs = (budget / cost).min(self.max_runs / last_factor);
        let rung = |factor: &u64| Rung {
            configurations: (count / factor) as usize,
            runs: runs * factor,
            with_one_more: 0,
        };
        let mut rungs: Vec<Rung> = factors.iter().map(rung).collect();
        let (left, in_last) = (budget - cost * runs, count / last_factor);
        if let Some(last) = rungs.last_mut() {
            last.runs += left / in_last;
            last.with_one_more = (left % in_last) as usize;
            let needed = last.runs + u64::from(last.with_one_more > 0);
            if needed > self.max_runs {
                return Err(TooFewSeeds { needed });
            }
        }
        Ok(Schedule { rungs })
    }
}

impl Schedule {
    /// Number of runs of the configuration with this rank, counted from 0, at the end of a rung.
    #[must_use]
    pub fn runs(&self, rung: usize, rank: usize) -> u64 {
        let rung = self.rungs[rung];
        rung.runs + u64::from(rank < rung.with_one_more)
    }

    /// Number of runs of a configuration of this rung before the rung.
    #[must_use]
    pub fn runs_before(&self, rung: usize) -> u64 {
        rung.checked_sub(1).map_or(0, |rung| self.rungs[rung].runs)
    }

    /// Maximum number of runs of a configuration.
    #[must_use]
    pub fn max_runs(&self) -> u64 {
        self.rungs
            .len()
            .checked_sub(1)
            .map_or(0, |last| self.runs(last, 0))
    }

    /// Number of runs of a rung, without those of earlier rungs.
    #[must_use]
    pub fn cost(&self, rung: usize) -> u64 {
        let before = self.runs_before(rung);
        let ranks = 0..self.rungs[rung].configurations;
        ranks.map(|rank| self.runs(rung, rank) - before).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(runs: u64, eta: u64) -> Rule {
        Rule {
            runs,
            eta,
            max_runs: 1000,
        }
    }

    fn rungs(schedule: &Schedule) -> Vec<(usize, u64, usize)> {
        let rungs = schedule.rungs.iter();
        rungs
            .map(|rung| (rung.configurations, rung.runs, rung.with_one_more))
            .collect()
    }

    /// By hand, with r = 2 and η = 3: nine configurations cost 9·2 + 3·4 + 1·12 = 42 runs, and eight
    /// cost 8·2 + 2·4 = 24.
    #[test]
    fn nine_configurations_cost_forty_two_runs() {
        let rule = rule(2, 3);
        assert_eq!(
            [41, 42].map(|budget| rule.max_configurations(budget)),
            [8, 9]
        );
        let schedule = rule.schedule(42, 9).unwrap();
        assert_eq!(rungs(&schedule), [(9, 2, 0), (3, 6, 0), (1, 18, 0)]);
        assert_eq!([0, 1, 2].map(|rung| schedule.cost(rung)), [18, 12, 12]);
    }

    /// Eight configurations with 41 runs: three runs in rung 0 cost 36, and the five runs that are left
    /// go to the two of rung 1: two each, and one more for the better one.
    #[test]
    fn what_is_left_goes_to_the_last_rung() {
        let schedule = rule(2, 3).schedule(41, 8).unwrap();
        assert_eq!(rungs(&schedule), [(8, 3, 0), (2, 11, 1)]);
        assert_eq!([schedule.runs(1, 0), schedule.runs(1, 1)], [12, 11]);
        assert_eq!(schedule.max_runs(), 12);
    }

    #[test]
    fn every_budget_is_spent_to_the_last_run() {
        for (runs, eta) in [(1, 2), (1, 3), (2, 3), (3, 4), (5, 10)] {
            let rule = rule(runs, eta);
            for budget in rule.min_budget()..500 {
                let max = rule.max_configurations(budget);
                assert!(max >= MIN_CONFIGURATIONS, "{budget}");
                for configurations in [MIN_CONFIGURATIONS.min(max), max.div_ceil(2).max(2), max] {
                    let schedule = rule.schedule(budget, configurations).unwrap();
                    let spent: u64 = (0..schedule.rungs.len())
                        .map(|rung| schedule.cost(rung))
                        .sum();
                    assert_eq!(spent, budget, "{rule:?}, {configurations}: {schedule:?}");
                    assert!(schedule.rungs[0].runs >= runs && schedule.max_runs() <= 1000);
                }
            }
        }
    }

    #[test]
    fn no_configuration_gets_more_runs_than_there_are_run_seeds() {
        let rule = Rule {
            max_runs: 10,
            ..rule(2, 3)
        };
        let schedule = rule.schedule(rule.min_budget() * 5, 2).unwrap();
        assert_eq!(schedule.max_runs(), 10);
        assert_eq!(rule.schedule(21, 2), Err(TooFewSeeds { needed: 11 }));
        let schedule = rule.schedule(42, rule.max_configurations(42)).unwrap();
        assert!(schedule.max_runs() <= 10, "{schedule:?}");
    }
}
