//! The visited states of a recording as a table: one row per state, the last one of each episode
//! included. Rows are sorted by agent, episode and step.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use super::ExportError;
use super::table::{Column, Table, Values};
use crate::record::{RecordedEpisode, RecordedStates};
use seedbed_env::Quantity;

/// Number of rows after which a batch is written.
const BATCH_ROWS: usize = 100_000;

/// Maximum number of numbers of the agents that are sorted together: 256 MB.
const MAX_GROUP_NUMBERS: usize = 1 << 26;

/// Names of the columns before and after observations and actions.
const INDEX_NAMES: [&str; 4] = ["agent", "episode", "round", "step"];
const REWARD: &str = "reward";
const INTRINSIC_REWARD: &str = "intrinsic_reward";
const OUTCOME: &str = "outcome";

/// Rows that wait to be written.
struct Batch {
    indices: [Vec<i64>; 4],
    /// Name, unit and values.
    observations: Vec<(String, String, Vec<Option<f32>>)>,
    actions: Vec<(String, String, Vec<Option<f32>>)>,
    rewards: Vec<Option<f32>>,
    /// `None` for agents without a bonus.
    intrinsic_rewards: Option<Vec<Option<f32>>>,
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
    for_each_in_order(recording, |episode| {
        batch.add(episode);
        on_episode();
        if batch.rewards.len() < BATCH_ROWS {
            return Ok(());
        }
        write(std::mem::replace(&mut batch, Batch::new(recording)).into_table())
    })?;
    write(batch.into_table())
}

/// Calls `action` for each episode, sorted by agent and number. A recording has the episodes of all agents
/// in the order in which they were written. If they do not fit into memory together, it is read once for each group
/// of agents whose states do.
fn for_each_in_order(
    recording: &RecordedStates,
    mut action: impl FnMut(&RecordedEpisode) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    if recording.state_files().is_none()
        && let Some(mut episodes) = all_episodes(recording)?
    {
        episodes.sort_by_key(|episode| (episode.agent, episode.episode));
        return episodes.iter().try_for_each(action);
    }
    for agents in groups_of_agents(recording)? {
        let mut waiting = Vec::new();
        for episode in recording.episodes()? {
            let episode = episode?;
            if !agents.contains(&episode.agent) {
                continue;
            }
            if agents.start() == agents.end() || recording.state_files().is_some() {
                action(&episode)?; // these are sorted
            } else {
                waiting.push(episode);
            }
        }
        waiting.sort_by_key(|episode| (episode.agent, episode.episode));
        for episode in &waiting {
            action(episode)?;
        }
    }
    Ok(())
}

/// All episodes, if together they have at most [`MAX_GROUP_NUMBERS`] numbers.
fn all_episodes(recording: &RecordedStates) -> Result<Option<Vec<RecordedEpisode>>, ExportError> {
    let (mut episodes, mut numbers) = (Vec::new(), 0);
    for episode in recording.episodes()? {
        let episode = episode?;
        numbers += episode.numbers();
        if numbers > MAX_GROUP_NUMBERS {
            return Ok(None);
        }
        episodes.push(episode);
    }
    Ok(Some(episodes))
}

/// Consecutive agents that together have at most [`MAX_GROUP_NUMBERS`] numbers, or a single agent with more.
fn groups_of_agents(recording: &RecordedStates) -> Result<Vec<RangeInclusive<u32>>, ExportError> {
    if recording.state_files().is_some() {
        return Ok(vec![0..=u32::MAX]);
    }
    let mut numbers_of_agents: BTreeMap<u32, usize> = BTreeMap::new();
    for episode in recording.episodes()? {
        let episode = episode?;
        *numbers_of_agents.entry(episode.agent).or_default() += episode.numbers();
    }
    let mut groups: Vec<RangeInclusive<u32>> = Vec::new();
    let mut in_group = usize::MAX;
    for (agent, numbers) in numbers_of_agents {
        in_group = in_group.saturating_add(numbers);
        match groups.last_mut() {
            Some(group) if in_group <= MAX_GROUP_NUMBERS => *group = *group.start()..=agent,
            _ => {
                groups.push(agent..=agent);
                in_group = numbers;
            }
        }
    }
    Ok(groups)
}

impl Batch {
    fn new(recording: &RecordedStates) -> Self {
        let mut used = INDEX_NAMES.map(str::to_owned).to_vec();
        used.extend([REWARD, INTRINSIC_REWARD, OUTCOME].map(str::to_owned));
        let mut columns = |quantities: &[Quantity], kind: &str| {
            let column = |quantity: &Quantity| {
                let name = unused(&quantity.name, kind, &mut used);
                (name, quantity.unit.clone(), Vec::new())
            };
            quantities.iter().map(column).collect()
        };
        let observations = columns(recording.observations(), "observation");
        let actions = columns(recording.actions(), "action");
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
        for (_, _, column) in &mut self.actions {
            column.push(None);
        }
        self.rewards
            .extend(episode.rewards.iter().copied().map(Some));
        self.rewards.push(None);
        if let Some(column) = &mut self.intrinsic_rewards {
            column.extend(episode.intrinsic_rewards.iter().copied().map(Some));
            column.resize(self.rewards.len(), None);
        }
    }

    fn into_table(self) -> Table {
        let indices = INDEX_NAMES.into_iter().zip(self.indices);
        let without_unit = |name: &str, values| Column {
            name: name.to_owned(),
            unit: String::new(),
            values,
        };
        let indices = indices.map(|(name, values)| without_unit(name, Values::Integers(values)));
        let quantities = self.observations.into_iter().chain(self.actions);
        let quantities = quantities.map(|(name, unit, values)| Column {
            name,
            unit,
            values: Values::Singles(values),
        });
        let rewards = [without_unit(REWARD, Values::Singles(self.rewards))];
        let bonus = self.intrinsic_rewards.into_iter();
        let bonus = bonus.map(|values| without_unit(INTRINSIC_REWARD, Values::Singles(values)));
        let outcomes = [without_unit(OUTCOME, Values::Texts(self.outcomes))];
        let columns = indices
            .chain(quantities)
            .chain(rewards)
            .chain(bonus)
            .chain(outcomes);
        Table {
            columns: columns.collect(),
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
fn add_rows(columns: &mut [(String, String, Vec<Option<f32>>)], rows: &[f32]) {
    for row in rows.chunks_exact(columns.len().max(1)) {
        for ((_, _, column), value) in columns.iter_mut().zip(row) {
            column.push(Some(*value));
        }
    }
}
