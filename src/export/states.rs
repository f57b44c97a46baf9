//! The visited states of a recording as a table: one row per state, the last one of each episode
//! included. Rows are sorted by agent, episode and step.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use super::ExportError;
use super::table::{Column, Table, Values};
use crate::record::{RecordedEpisode, RecordedStates};
use crate::run::facts::StateQuantity;

/// Number of rows after which a batch is written.
const BATCH_ROWS: usize = 100_000;

/// Maximum number of numbers of the agents that are sorted together: 256 MB.
const MAX_GROUP_NUMBERS: usize = 1 << 26;

/// Names of the columns before and after quantities of states.
const INDEX_NAMES: [&str; 4] = ["agent", "episode", "round", "step"];
const OUTCOME: &str = "outcome";

/// Rows that wait to be written.
struct Batch {
    indices: [Vec<i64>; 4],
    quantities: Vec<QuantityColumn>,
    /// How the episode of the state ended, as in `episodes.csv`.
    outcomes: Vec<String>,
}

/// The values of one quantity of states. The last state of an episode has no action and no reward.
struct QuantityColumn {
    source: StateQuantity,
    name: String,
    unit: String,
    values: Vec<Option<f32>>,
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
        if batch.outcomes.len() < BATCH_ROWS {
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
        let bonus = recording.bonus().exists();
        let of_steps = [StateQuantity::Reward]
            .into_iter()
            .chain(bonus.then_some(StateQuantity::IntrinsicReward));
        let mut used = INDEX_NAMES.map(str::to_owned).to_vec();
        let reserved = [StateQuantity::Reward, StateQuantity::IntrinsicReward];
        used.extend(reserved.map(|quantity| quantity.key().to_owned()));
        used.push(OUTCOME.to_owned());
        let of_task = recording.quantities_of_task();
        let of_task = of_task.map(|(source, quantity)| {
            let name = unused(&quantity.name, source.key(), &mut used);
            QuantityColumn::new(source, name, quantity.unit.clone())
        });
        let mut quantities: Vec<QuantityColumn> = of_task.collect();
        quantities.extend(
            of_steps
                .map(|source| QuantityColumn::new(source, source.key().to_owned(), String::new())),
        );
        Self {
            indices: Default::default(),
            quantities,
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
            for QuantityColumn { source, values, .. } in &mut self.quantities {
                values.push(episode.value(*source, step).map(|value| value as f32));
            }
        }
    }

    fn into_table(self) -> Table {
        let without_unit = |name: &str, values| Column {
            name: name.to_owned(),
            unit: String::new(),
            values,
        };
        let indices = INDEX_NAMES.into_iter().zip(self.indices);
        let indices = indices.map(|(name, values)| without_unit(name, Values::Integers(values)));
        let mut columns: Vec<Column> = indices.collect();
        columns.extend(self.quantities.into_iter().map(|column| Column {
            name: column.name,
            unit: column.unit,
            values: Values::Singles(column.values),
        }));
        columns.push(without_unit(OUTCOME, Values::Texts(self.outcomes)));
        Table { columns }
    }
}

impl QuantityColumn {
    fn new(source: StateQuantity, name: String, unit: String) -> Self {
        Self {
            source,
            name,
            unit,
            values: Vec::new(),
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
