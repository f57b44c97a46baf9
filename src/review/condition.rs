//! Conditions on visited states: ranges of observations, actions, rewards and other quantities.

use std::ops::RangeInclusive;

use crate::record::{RecordedEpisode, RecordedStates};
use crate::run::facts::StateQuantity;

/// A range of values of one quantity, such as `theta=-0.1..0.2`.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    quantity: StateQuantity,
    range: RangeInclusive<f64>,
}

impl Condition {
    /// Reads `NAME=LOW..HIGH`, in which one of both ends may be left out. If several quantities have a
    /// name, it is that of an observation or else of an action; `KIND:NAME` names the others.
    ///
    /// # Errors
    /// What is wrong and what was expected.
    pub fn parse(text: &str, recording: &RecordedStates) -> Result<Self, String> {
        let form = "expected NAME=LOW..HIGH, such as theta=-0.1..0.2 or theta=0.1..";
        // A name may have an equals sign, a range has none.
        let (name, range) = text.rsplit_once('=').ok_or(form)?;
        let (low, high) = range.split_once("..").ok_or(form)?;
        let end = |text: &str, default: f64| match text.trim() {
            "" => Ok(default),
            number => number
                .parse::<f64>()
                .ok()
                .filter(|end| !end.is_nan())
                .ok_or(form),
        };
        let range = end(low, f64::NEG_INFINITY)?..=end(high, f64::INFINITY)?;
        if range.is_empty() {
            return Err("the range is empty; expected LOW below HIGH".to_owned());
        }
        let quantities = quantities(recording);
        let quantity = find(&quantities, name.trim()).ok_or_else(|| {
            let names: Vec<&str> = quantities.iter().map(|(name, _)| name.as_str()).collect();
            let name = name.trim();
            format!("no quantity `{name}`; expected one of {}", names.join(", "))
        })?;
        Ok(Self { quantity, range })
    }

    /// Whether the state at a step of an episode, 0 to T, meets the condition. A state without the
    /// quantity, such as the action of the last state, does not.
    #[must_use]
    pub fn is_met(&self, episode: &RecordedEpisode, step: usize) -> bool {
        let value = episode.value(self.quantity, step);
        value.is_some_and(|value| self.range.contains(&value))
    }
}

/// All quantities of a recording by name. A name of an observation comes before that of an action.
fn quantities(recording: &RecordedStates) -> Vec<(String, StateQuantity)> {
    let of_task = recording.quantities_of_task();
    let of_task = of_task.map(|(quantity, named)| (named.name.clone(), quantity));
    of_task.chain(of_all_tasks()).collect()
}

fn of_all_tasks() -> impl Iterator<Item = (String, StateQuantity)> {
    let quantities = StateQuantity::OF_ALL_TASKS.into_iter();
    quantities.map(|quantity| (quantity.title().to_owned(), quantity))
}

/// The quantity with a name or, if several have it, with its kind before the name, such as `action:x`.
fn find(quantities: &[(String, StateQuantity)], name: &str) -> Option<StateQuantity> {
    let named = |(known, _): &&(String, StateQuantity)| known == name;
    let has_kind = |(known, quantity): &&(String, StateQuantity)| {
        name.strip_prefix(quantity.key()) == Some(&format!(":{known}"))
    };
    let mut all = quantities.iter();
    let found = all.find(named).or_else(|| quantities.iter().find(has_kind));
    found.map(|(_, quantity)| *quantity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::Status;

    /// Two steps with two observations, one action and two entries of `info`.
    fn episode() -> RecordedEpisode {
        RecordedEpisode {
            agent: 0,
            episode: 3,
            round: 3,
            observations: vec![0.0, 10.0, 1.0, 11.0, 2.0, 12.0],
            actions: vec![-1.0, 1.0],
            info: vec![f32::NAN, 5.0, 0.1, 6.0, 0.2, 7.0],
            rewards: vec![1.0, 0.5],
            intrinsic_rewards: Vec::new(),
            advantages: Vec::new(),
            outcome: Status::Terminated,
        }
    }

    fn steps_that_meet(quantity: StateQuantity, range: RangeInclusive<f64>) -> Vec<usize> {
        let condition = Condition { quantity, range };
        let episode = episode();
        (0..3)
            .filter(|&step| condition.is_met(&episode, step))
            .collect()
    }

    #[test]
    fn states_are_compared_by_their_own_values() {
        assert_eq!(
            steps_that_meet(StateQuantity::Observation(1), 10.5..=12.0),
            [1, 2]
        );
        assert_eq!(steps_that_meet(StateQuantity::Info(0), 0.0..=9.0), [1, 2]);
        assert_eq!(steps_that_meet(StateQuantity::Info(1), 5.0..=6.5), [0, 1]);
        assert_eq!(steps_that_meet(StateQuantity::Return, 1.5..=1.5), [0, 1, 2]);
        assert_eq!(
            steps_that_meet(StateQuantity::Episode, 4.0..=9.0),
            [0_usize; 0]
        );
    }

    /// An observation and an action `x`, and an observation `return`: each has its own name.
    #[test]
    fn equal_names_are_told_apart_by_their_kinds() {
        let (observed, acted) = (StateQuantity::Observation, StateQuantity::Action);
        let mut quantities = vec![
            ("x".to_owned(), observed(0)),
            ("return".to_owned(), observed(1)),
            ("x".to_owned(), acted(0)),
        ];
        quantities.extend(of_all_tasks());
        for (name, expected) in [
            ("x", Some(observed(0))),
            ("observation:x", Some(observed(0))),
            ("action:x", Some(acted(0))),
            ("return", Some(observed(1))),
            ("return:return", Some(StateQuantity::Return)),
            (
                "intrinsic_reward:intrinsic reward",
                Some(StateQuantity::IntrinsicReward),
            ),
            ("reward", Some(StateQuantity::Reward)),
            ("action:return", None),
            ("action", None),
        ] {
            assert_eq!(find(&quantities, name), expected, "{name}");
        }
    }

    /// The last state has no action and no reward.
    #[test]
    fn missing_values_meet_no_condition() {
        let everything = f64::NEG_INFINITY..=f64::INFINITY;
        assert_eq!(
            steps_that_meet(StateQuantity::Action(0), everything.clone()),
            [0, 1]
        );
        assert_eq!(steps_that_meet(StateQuantity::Reward, 0.5..=2.0), [0, 1]);
        assert_eq!(
            steps_that_meet(StateQuantity::Advantage, everything),
            [0_usize; 0]
        );
    }
}
