//! CSV files with a row per episode, whose columns the study names.

use std::collections::HashMap;
use std::path::Path;

use super::data_file::{Column, DataFile, Rows, incomplete_line_warning};
use super::read_run::ReadRun;
use super::run_data::{self, AgentEpisodes};
use super::source::{Columns, Values};
use super::{Problem, Settings};
use crate::scenario::Rounding;
use seedbed_input::{InputError, Located};

/// Reads the runs in the file at `path`, in the order of their columns or first rows.
pub(super) fn read(
    folder: &Path,
    path: &Path,
    columns: &Columns,
    values: Values,
    settings: Settings,
) -> Result<Vec<ReadRun>, Problem> {
    let file = DataFile::read(folder, path)?;
    let (text, is_incomplete) = file.complete_lines();
    let tables = FoundColumns::find(columns, values, &Rows::new(&file, text, 0)?, &file)?;
    let mut read_runs = Vec::new();
    for columns in tables {
        for (label, agents) in read_runs_of(Rows::new(&file, text, 0)?, &columns, &file)? {
            let result =
                run_data::result(agents, settings.solved, settings.limits, Rounding::Double);
            let run = ReadRun::new(folder, path, vec![file.hash.clone()], result);
            read_runs.push(match &columns.runs {
                RunsOf::File => run,
                RunsOf::ColumnOfRuns { name, .. } => run.with_label(name, &label),
                RunsOf::ColumnPerRun { run: name } => run.with_label("run", name),
            });
        }
    }
    if let (true, Some(first)) = (is_incomplete, read_runs.first_mut()) {
        first.warnings.push(incomplete_line_warning(&file));
    }
    Ok(read_runs)
}

/// The columns of a file, or in a table with a column per run, those of one run.
struct FoundColumns {
    r#return: Column,
    env_steps: Option<Column>,
    length: Option<Column>,
    episode: Option<Column>,
    agent: Option<Column>,
    runs: RunsOf,
    /// Whether rows without a return are left out.
    may_be_empty: bool,
}

/// Which runs are in a table.
enum RunsOf {
    /// The file is one run.
    File,
    /// A column has the names of runs.
    ColumnOfRuns { column: Column, name: String },
    /// The returns are those of one run; other columns have those of others.
    ColumnPerRun { run: String },
}

impl FoundColumns {
    fn find(
        columns: &Columns,
        values: Values,
        rows: &Rows<'_>,
        file: &DataFile,
    ) -> Result<Vec<Self>, Problem> {
        let find = |name: &Located<String>| -> Result<Column, Problem> {
            let what = format!("column of {}", file.path.display());
            let column = rows.find(name)?;
            Ok(column.ok_or_else(|| name.unknown_name(&what, rows.header()))?)
        };
        let find_optional = |name: &Option<Located<String>>| name.as_ref().map(find).transpose();
        let with_returns = |r#return: Column, runs: RunsOf| -> Result<Self, Problem> {
            Ok(Self {
                r#return,
                env_steps: find_optional(&columns.env_steps)?,
                length: find_optional(&columns.length)?,
                episode: find_optional(&columns.episode)?,
                agent: find_optional(&columns.agent)?,
                may_be_empty: values == Values::Means
                    || matches!(runs, RunsOf::ColumnPerRun { .. }),
                runs,
            })
        };
        let Some((before, after)) = columns.r#return.split_once('*') else {
            let runs = match &columns.run {
                Some(name) => RunsOf::ColumnOfRuns {
                    column: find(name)?,
                    name: name.value().clone(),
                },
                None => RunsOf::File,
            };
            return Ok(vec![with_returns(find(&columns.r#return)?, runs)?]);
        };
        let mut tables = Vec::new();
        for name in rows.header() {
            let rest = name.strip_prefix(before);
            if let (Some(run), Some(column)) = (
                rest.and_then(|rest| rest.strip_suffix(after)),
                rows.find(name)?,
            ) {
                let run = run.to_owned();
                tables.push(with_returns(column, RunsOf::ColumnPerRun { run })?);
            }
        }
        if tables.is_empty() {
            let what = format!("column of {}", file.path.display());
            return Err(columns.r#return.unknown_name(&what, rows.header()).into());
        }
        Ok(tables)
    }

    /// The column with the names of runs.
    fn column_of_runs(&self) -> Option<Column> {
        match &self.runs {
            RunsOf::ColumnOfRuns { column, .. } => Some(*column),
            _ => None,
        }
    }
}

/// Name of each run, and the episodes of its agents.
type Runs = Vec<(String, Vec<AgentEpisodes>)>;

/// Where the episodes of an agent of a run are in [`Runs`], and its number of the next episode.
struct AgentPlace {
    run: usize,
    agent: usize,
    next_episode: Option<u64>,
}

/// Agents of all runs, found by the names of run and agent.
#[derive(Default)]
struct Places {
    agents: Vec<AgentPlace>,
    by_names: HashMap<[Vec<u8>; 2], usize>,
    runs_by_name: HashMap<Vec<u8>, usize>,
    /// The names of the newest row. Most rows have those of the row before.
    newest: Option<([Vec<u8>; 2], usize)>,
}

fn read_runs_of(
    mut rows: Rows<'_>,
    columns: &FoundColumns,
    file: &DataFile,
) -> Result<Runs, InputError> {
    let (mut runs, mut places) = (Runs::new(), Places::default());
    while rows.advance()? {
        if columns.may_be_empty && rows.bytes(columns.r#return).is_empty() {
            continue;
        }
        let place = places.of_row(&rows, columns, &mut runs)?;
        check_episode(&rows, columns, place)?;
        let agent = &mut runs[place.run].1[place.agent];
        add_episode(agent, &rows, columns)?;
    }
    if runs.is_empty() {
        return Err(file.error("expected at least one episode, found none"));
    }
    if columns.length.is_some() {
        for (_, agents) in &mut runs {
            run_data::team_steps(agents);
        }
    }
    Ok(runs)
}

impl Places {
    /// The agent of a row. Adds its run and the agent if they are new.
    fn of_row(
        &mut self,
        rows: &Rows<'_>,
        columns: &FoundColumns,
        runs: &mut Runs,
    ) -> Result<&mut AgentPlace, InputError> {
        let name = |column: Option<Column>| column.map_or(Ok(&b""[..]), |column| rows.name(column));
        let run = name(columns.column_of_runs())?;
        let agent = name(columns.agent)?;
        if let Some((names, index)) = &self.newest
            && names[0] == run
            && names[1] == agent
        {
            return Ok(&mut self.agents[*index]);
        }
        let names = [run.to_vec(), agent.to_vec()];
        let index = match self.by_names.get(&names) {
            Some(&index) => index,
            None => self.add(&names, runs),
        };
        self.newest = Some((names, index));
        Ok(&mut self.agents[index])
    }

    fn add(&mut self, names: &[Vec<u8>; 2], runs: &mut Runs) -> usize {
        let run = *self
            .runs_by_name
            .entry(names[0].clone())
            .or_insert_with(|| {
                runs.push((String::from_utf8_lossy(&names[0]).into_owned(), Vec::new()));
                runs.len() - 1
            });
        runs[run].1.push(AgentEpisodes::default());
        self.agents.push(AgentPlace {
            run,
            agent: runs[run].1.len() - 1,
            next_episode: None,
        });
        self.by_names.insert(names.clone(), self.agents.len() - 1);
        self.agents.len() - 1
    }
}

/// Checks that the number of the episode follows that of the agent's row before.
fn check_episode(
    rows: &Rows<'_>,
    columns: &FoundColumns,
    place: &mut AgentPlace,
) -> Result<(), InputError> {
    let Some(column) = columns.episode else {
        return Ok(());
    };
    let found = rows.count(column)?;
    let is_next = place.next_episode.map_or(found <= 1, |next| found == next);
    if !is_next {
        let expected = place
            .next_episode
            .map_or("0 or 1".to_owned(), |next| next.to_string());
        return Err(rows.error(
            column,
            format!("expected episode {expected} of this agent, found {found}: no episode may be missing"),
        ));
    }
    place.next_episode = Some(found + 1);
    Ok(())
}

fn add_episode(
    agent: &mut AgentEpisodes,
    rows: &Rows<'_>,
    columns: &FoundColumns,
) -> Result<(), InputError> {
    agent.returns.push(rows.number(columns.r#return)?);
    let earlier = agent.env_steps.last().copied().unwrap_or(0);
    if let Some(column) = columns.length {
        agent.env_steps.push(rows.sum(earlier, column)?);
    }
    if let Some(column) = columns.env_steps {
        let steps = rows.count(column)?;
        if steps < earlier {
            return Err(rows.error(
                column,
                format!("expected steps since the beginning of the run, which do not decrease; found {steps} after {earlier}"),
            ));
        }
        agent.env_steps.push(steps);
    }
    Ok(())
}
