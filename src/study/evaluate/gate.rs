//! Whether a task is one of exploration: what the best undirected baseline and the best method of a
//! study solve.
//!
//! Undirected baselines explore by random actions only (ε, entropy, noise, also correlated noise). A task that they
//! solve says nothing about exploration, and neither does a task that no method solves. A baseline counts only if it had as much
//! experience as the method, and if it is shown to learn where nothing must be found. Where failures end episodes, any bonus
//! pays for not failing: a bonus that learns what is new is compared with one that does not.

use super::comparison::summarize_scores;
use super::results::{CellResults, Results};
use crate::experiment::measure::Measure;
use crate::study::design::file::Exploration;
use crate::text::short_number as number;
use seedbed_learn::agent::bonus::PaidFor;
use seedbed_stats::Estimate;
use seedbed_stats::aggregate::mean;

/// The upper end of the interval of the best undirected baseline must be below this share.
const MAX_OF_BASELINES: f64 = 0.2;

/// The mean of some method, and of each baseline in the easy variant of the task, must be above this share.
const MIN_OF_METHODS: f64 = 0.8;

/// The lower end of this method's interval must be above this share.
const MIN_OF_INTERVAL: f64 = 0.5;

/// Share of the method's environment steps that a baseline must have made: episodes of those that reach the goal are shorter.
const MIN_STEPS: f64 = 0.9;

/// Settings of noise that is correlated over the steps of an episode.
const CORRELATED: [&str; 3] = ["Correlated(", "OpenLoopNoise(", "EpsilonZGreedy("];

/// Settings of cells that do not learn.
const OPEN_LOOP: [&str; 2] = ["algorithm=OpenLoopNoise", "algorithm=Random"];

/// What the teams of one size reach in one task.
#[derive(Clone, Debug, PartialEq)]
pub struct Gate {
    /// Name of the task.
    pub task: String,
    /// Number of agents K.
    pub agents: u32,
    /// The undirected baseline with the largest mean, and this mean.
    pub baseline: (String, Estimate),
    /// The other cell with the largest mean, and this mean.
    pub method: (String, Estimate),
    /// What keeps the comparison from being fair, as sentences without a full stop.
    pub faults: Vec<String>,
}

impl Gate {
    /// Why the task is not one of exploration, as sentences without a full stop; none if it is.
    #[must_use]
    pub fn reasons(&self) -> Vec<String> {
        let mut reasons = Vec::new();
        let [baseline, method] = [&self.baseline.1, &self.method.1];
        match baseline.interval.ends() {
            None => reasons.push("the runs of the baseline are too few".to_owned()),
            Some([_, high]) if high >= MAX_OF_BASELINES => {
                reasons.push(format!(
                    "that of the baseline is not below {MAX_OF_BASELINES} with its interval"
                ));
            }
            Some(_) => {}
        }
        if method.value <= MIN_OF_METHODS {
            reasons.push(format!("that of the method is not above {MIN_OF_METHODS}"));
        } else if method
            .interval
            .ends()
            .is_none_or(|[low, _]| low <= MIN_OF_INTERVAL)
        {
            reasons.push(format!(
                "the interval of the method is not above {MIN_OF_INTERVAL}"
            ));
        }
        reasons.extend(self.faults.iter().cloned());
        reasons
    }

    /// What the gate found, as a sentence.
    #[must_use]
    pub fn sentence(&self, measure: Measure) -> String {
        let shown = |(name, share): &(String, Estimate)| -> [String; 2] {
            let interval = match share.interval.ends() {
                Some([low, high]) => format!(" ({} to {})", number(low), number(high)),
                None => String::new(),
            };
            [name.clone(), number(share.value) + &interval]
        };
        let ([baseline, share], [method, most]) = (shown(&self.baseline), shown(&self.method));
        let reasons = self.reasons();
        let (verdict, because) = if reasons.is_empty() {
            ("a task", String::new())
        } else {
            (
                "no task",
                format!(" It is none because {}.", reasons.join("; ")),
            )
        };
        format!(
            "`{}` with K = {} is {verdict} of exploration: the {} is {share} for the best undirected baseline \
             ({baseline}), and {most} for the best method ({method}).{because}",
            self.task,
            self.agents,
            measure.title(),
        )
    }
}

/// The gates of a study that names undirected baselines: one per task and size of teams, in the order
/// of its cells. Teams without a baseline or without another method are left out.
#[must_use]
pub fn gates(results: &Results) -> Vec<Gate> {
    let Some(exploration) = &results.study.exploration else {
        return Vec::new();
    };
    let mut teams: Vec<(&str, u32)> = Vec::new();
    for cell in &results.cells {
        let team = (cell.description.task.as_str(), cell.description.agents);
        if !teams.contains(&team) {
            teams.push(team);
        }
    }
    let gates = teams
        .into_iter()
        .map(|team| gate(results, exploration, team));
    gates.flatten().collect()
}

fn gate(results: &Results, exploration: &Exploration, (task, agents): (&str, u32)) -> Option<Gate> {
    let is_undirected = |cell: &&CellResults| {
        let mut names = exploration.undirected.iter();
        names.any(|name| **name == cell.description.name)
    };
    let is_of_team = |cell: &&CellResults| {
        (cell.description.task.as_str(), cell.description.agents) == (task, agents)
    };
    let (baselines, methods): (Vec<&CellResults>, Vec<&CellResults>) = results
        .cells
        .iter()
        .filter(is_of_team)
        .partition(is_undirected);
    let [baseline, method] = [&baselines, &methods].map(|cells| best(cells, *exploration.measure));
    let ((_, baseline), (best_method, method)) = (baseline?, method?);
    let mut faults = Vec::new();
    let has_correlated = baselines.iter().any(|cell| is_correlated(cell));
    if has_networks(best_method) && !has_correlated {
        faults.push("no baseline has noise that is correlated over steps".to_owned());
    }
    faults.extend(without_blind_bonus(&baselines, best_method));
    for cell in &baselines {
        faults.extend(shortage(cell, best_method));
    }
    faults.extend(without_easy_variant(results, exploration, &baselines));
    Some(Gate {
        task: task.to_owned(),
        agents,
        baseline,
        method,
        faults,
    })
}

/// The cell with the largest mean, its name and this mean.
fn best<'a>(
    cells: &[&'a CellResults],
    measure: Measure,
) -> Option<(&'a CellResults, (String, Estimate))> {
    let summaries = cells.iter().filter_map(|cell| {
        let summary = summarize_scores(cell.scores(measure), measure)?;
        Some((*cell, (cell.description.name.clone(), summary.center)))
    });
    summaries.reduce(|best, other| {
        if other.1.1.value > best.1.1.value {
            other
        } else {
            best
        }
    })
}

/// Whether a cell is of a task in which agents have networks, not of a tabular one, for which there is no correlated noise.
fn has_networks(cell: &CellResults) -> bool {
    let mut costs = cell.costs.iter();
    costs.any(|(_, cost)| cost.gradient_steps.is_none_or(|steps| steps > 0.0))
}

fn is_correlated(cell: &CellResults) -> bool {
    let of_algorithm = cell.description.random_actions;
    of_algorithm.map_or_else(
        || is_set(cell, &CORRELATED),
        |actions| actions.are_correlated,
    )
}

fn is_open_loop(cell: &CellResults) -> bool {
    let of_algorithm = cell.description.random_actions;
    of_algorithm.map_or_else(|| is_set(cell, &OPEN_LOOP), |actions| actions.are_open_loop)
}

/// Whether a cell replaces a value by one of these texts. Results of earlier versions say no more.
fn is_set(cell: &CellResults, texts: &[&str]) -> bool {
    let mut overrides = cell.description.overrides.iter();
    overrides.any(|given| texts.iter().any(|text| given.contains(text)))
}

/// That no baseline has a bonus which is blind to what is new, if the method has one that is not, as a sentence without a full stop.
fn without_blind_bonus(baselines: &[&CellResults], method: &CellResults) -> Option<String> {
    let is_blind = |cell: &&CellResults| cell.description.paid_for == Some(PaidFor::Any);
    let needs_control = method.description.paid_for == Some(PaidFor::New);
    (needs_control && !baselines.iter().any(is_blind)).then(|| {
        "no baseline has a bonus whose model is frozen, which pays for acting on, not for what is new".to_owned()
    })
}

/// What a baseline has less of than the method, as a sentence without a full stop.
fn shortage(baseline: &CellResults, method: &CellResults) -> Option<String> {
    let steps = |cell: &CellResults| {
        let steps: Option<Vec<f64>> = cell.costs.iter().map(|(_, cost)| cost.env_steps).collect();
        steps
            .filter(|steps| !steps.is_empty())
            .map(|steps| mean(&steps))
    };
    let name = &baseline.description.name;
    if baseline.description.max_episodes < method.description.max_episodes {
        return Some(format!("`{name}` has fewer episodes than the method"));
    }
    let [made, needed] = [steps(baseline)?, steps(method)?];
    (made < MIN_STEPS * needed)
        .then(|| format!("`{name}` made fewer environment steps than the method"))
}

/// That some baselines which learn are not shown to learn an easy variant of the task, as a sentence without a full stop.
fn without_easy_variant(
    results: &Results,
    exploration: &Exploration,
    baselines: &[&CellResults],
) -> Option<String> {
    let learns_easily = |cell: &&&CellResults| {
        let mut pairs = exploration.easy.iter();
        let pair = pairs.find(|(name, _)| **name == cell.description.name)?;
        let easy = results
            .cells
            .iter()
            .find(|easy| easy.description.name == **pair.1)?;
        let summary = summarize_scores(easy.scores(*exploration.measure), *exploration.measure)?;
        (summary.center.value > MIN_OF_METHODS).then_some(())
    };
    let unproven: Vec<String> = baselines
        .iter()
        .filter(|cell| !is_open_loop(cell) && learns_easily(cell).is_none())
        .map(|cell| format!("`{}`", cell.description.name))
        .collect();
    (!unproven.is_empty()).then(|| {
        format!(
            "it is not shown that an easy variant of the task is learned by {}",
            unproven.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::design::cell::CellDescription;
    use seedbed_learn::algorithms::RandomActions;
    use seedbed_stats::Interval;

    fn share(value: f64, low: f64, high: f64) -> Estimate {
        Estimate {
            value,
            interval: Interval::Known { low, high },
        }
    }

    fn gate(baseline: Estimate, method: Estimate) -> Gate {
        Gate {
            task: "sea".to_owned(),
            agents: 4,
            baseline: ("ε".to_owned(), baseline),
            method: ("ensemble".to_owned(), method),
            faults: Vec::new(),
        }
    }

    #[test]
    fn a_task_that_random_actions_solve_or_nothing_solves_is_none_of_exploration() {
        let (few, many) = (share(0.1, 0.05, 0.19), share(0.9, 0.6, 0.99));
        assert_eq!(gate(few, many).reasons(), [""; 0]);
        for (baseline, method, expected) in [
            (
                share(0.1, 0.05, 0.2),
                many,
                "that of the baseline is not below 0.2 with its interval",
            ),
            (
                few,
                share(0.8, 0.6, 0.99),
                "that of the method is not above 0.8",
            ),
            (
                few,
                share(0.9, 0.5, 0.99),
                "the interval of the method is not above 0.5",
            ),
        ] {
            assert_eq!(gate(baseline, method).reasons(), [expected]);
        }
        let faulty = Gate {
            faults: vec!["`ε` has fewer episodes than the method".to_owned()],
            ..gate(few, many)
        };
        assert_eq!(
            faulty.sentence(Measure::Solved),
            "`sea` with K = 4 is no task of exploration: the share solved is 0.1 (0.05 to 0.19) for the best undirected \
             baseline (ε), and 0.9 (0.6 to 0.99) for the best method (ensemble). It is none because `ε` has fewer episodes than \
             the method."
        );
    }

    /// What the algorithm says counts, wherever its file is; results of earlier versions have only what their cells replace.
    #[test]
    fn noise_is_known_by_the_algorithm_or_by_what_a_cell_replaces() {
        let cell = |random_actions, overrides: &[&str]| {
            CellResults::without_runs(CellDescription {
                random_actions,
                overrides: overrides.iter().map(|&given| given.to_owned()).collect(),
                ..CellDescription::for_test("noise", 1, Vec::new())
            })
        };
        let slow = RandomActions {
            are_correlated: true,
            are_open_loop: false,
        };
        let kinds = |cell: &CellResults| [is_correlated(cell), is_open_loop(cell)];
        assert_eq!(kinds(&cell(Some(slow), &[])), [true, false]);
        let replaced = "algorithm=OpenLoopNoise(noise: White)";
        assert_eq!(
            kinds(&cell(Some(RandomActions::default()), &[replaced])),
            [false, false]
        );
        assert_eq!(kinds(&cell(None, &[replaced])), [true, true]);
        assert_eq!(kinds(&cell(None, &[])), [false, false]);
    }

    #[test]
    fn a_bonus_needs_a_control_that_is_blind_to_what_is_new() {
        let cell = |paid_for| {
            CellResults::without_runs(CellDescription {
                paid_for,
                ..CellDescription::for_test("bonus", 1, Vec::new())
            })
        };
        let [unknown, nothing, new, any] = [
            None,
            Some(PaidFor::Nothing),
            Some(PaidFor::New),
            Some(PaidFor::Any),
        ]
        .map(cell);
        assert!(without_blind_bonus(&[&nothing, &unknown], &new).is_some());
        assert!(without_blind_bonus(&[&nothing, &any], &new).is_none());
        for method in [&unknown, &nothing, &any] {
            assert!(without_blind_bonus(&[&nothing], method).is_none());
        }
    }
}
