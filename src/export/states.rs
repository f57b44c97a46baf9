//! The visited states of a recording as a table: one row per state, the last one of each episode
//! included.

use super::ExportError;
use super::table::{Column, Table, Values};
use crate::record::{RecordedEpisode, RecordedStates};

/// Number of rows after which a batch is written.
const BATCH_ROWS: usize = 100_000;

/// Names of the columns before and after observations and actions.
const INDEX_NAMES: [&str; 4] = ["agent", "episode", "round", "step"];
const REWARD: &str = "reward";
const INTRINSIC_REWARD: &str = "intrinsic_reward";
const OUTCOME: &str = "outcome";

/// Rows that wait to be written.
struct Batch {
    indices: [Vec<i64>; 4],
    observations: Vec<(String, Vec<f32>)>,
    actions: Vec<(String, Vec<f32>)>,
    rewards: Vec<f32>,
    /// `None` for agents without a bonus.
    intrinsic_rewards: Option<Vec<f32>>,
    /// How the episode of the state ended, as in `episodes.csv`.
    outcomes: Vec<String>,
}

/// Reads all episodes of a recording and writes their states.
pub(super) fn write(
    recording: &RecordedStates,
    write: &mut dyn FnMut(Table) -> Result<(), ExportError>,
    on_episode: &mut dyn FnMut(),
) -> Result<(), ExportError> {
    let mut batch = Batch::new(recording);
    for episode in recording.episodes()? {
        batch.add(&episode?);
        on_episode();
        if batch.rewards.len() >= BATCH_ROWS {
            write(std::mem::replace(&mut batch, Batch::new(recording)).into_table())?;
        }
    }
    write(batch.into_table())
}

impl Batch {
    fn new(recording: &RecordedStates) -> Self {
        let mut used = INDEX_NAMES.map(str::to_owned).to_vec();
        used.extend([REWARD, INTRINSIC_REWARD, OUTCOME].map(str::to_owned));
        let observations = recording.observations().iter();
        let observations = observations
            .map(|quantity| (unused(&quantity.name, "observation", &mut used), Vec::new()))
            .collect();
        let actions = recording.actions().iter();
        let actions = actions
            .map(|quantity| (unused(&quantity.name, "action", &mut used), Vec::new()))
            .collect();
        Self {
            indices: Default::default(),
            observations,
            actions,
            rewards: Vec::new(),
            intrinsic_rewards: recording.bonus().max().map(|_| Vec::new()),
            outcomes: Vec::new(),
        }
    }

    fn add(&mut self, episode: &RecordedEpisode) {
        let numbers = [episode.agent, episode.episode, episode.round].map(i64::from);
        for step in 0..=episode.length() {
            self.outcomes.push(episode.outcome.name().to_owned());
            for (column, number) in self.indices.iter_mut().zip(numbers) {
                column.push(number);
            }
            self.indices[3].push(step as i64);
        }
        add_rows(&mut self.observations, &episode.observations);
        add_rows(&mut self.actions, &episode.actions);
        // The last state has no action and no reward.
        for (_, column) in &mut self.actions {
            column.push(f32::NAN);
        }
        self.rewards.extend(&episode.rewards);
        self.rewards.push(f32::NAN);
        if let Some(column) = &mut self.intrinsic_rewards {
            column.extend(&episode.intrinsic_rewards);
            let missing = self.rewards.len() - column.len();
            column.extend(std::iter::repeat_n(f32::NAN, missing));
        }
    }

    fn into_table(self) -> Table {
        let indices = INDEX_NAMES.into_iter().zip(self.indices);
        let indices = indices.map(|(name, values)| (name.to_owned(), Values::Integers(values)));
        let quantities = self.observations.into_iter().chain(self.actions);
        let quantities = quantities.map(|(name, values)| (name, Values::Singles(values)));
        let rewards = [(REWARD.to_owned(), Values::Singles(self.rewards))];
        let bonus = self.intrinsic_rewards.into_iter();
        let bonus = bonus.map(|values| (INTRINSIC_REWARD.to_owned(), Values::Singles(values)));
        let outcomes = [(OUTCOME.to_owned(), Values::Texts(self.outcomes))];
        let columns = indices
            .chain(quantities)
            .chain(rewards)
            .chain(bonus)
            .chain(outcomes);
        Table {
            columns: columns
                .map(|(name, values)| Column { name, values })
                .collect(),
        }
    }
}

/// `name`, or `kind_name` if there is a column `name` already.
fn unused(name: &str, kind: &str, used: &mut Vec<String>) -> String {
    let mut chosen = name.to_owned();
    while used.contains(&chosen) {
        chosen = format!("{kind}_{chosen}");
    }
    used.push(chosen.clone());
    chosen
}

/// Adds rows of as many values as there are columns.
fn add_rows(columns: &mut [(String, Vec<f32>)], rows: &[f32]) {
    for row in rows.chunks_exact(columns.len().max(1)) {
        for ((_, column), value) in columns.iter_mut().zip(row) {
            column.push(*value);
        }
    }
}
