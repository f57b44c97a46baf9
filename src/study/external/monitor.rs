//! Stable-Baselines3's `monitor.csv`: a line `#{json}`, then the columns `r` (return), `l` (length of
//! the episode) and `t` (seconds), and others.

use std::path::{Path, PathBuf};

use super::data_file::{DataFile, Rows, file_error, incomplete_line_warning};
use super::read_run::ReadRun;
use super::run_data::{self, AgentEpisodes};
use super::{Problem, Settings};
use crate::scenario::Rounding;
use seedbed_input::{InputError, Position};

/// Reads the run at `path`: a directory with one file per agent, or per copy of the environment in which its only agent acts,
/// or the file of its only agent.
pub(super) fn read(folder: &Path, path: &Path, settings: Settings) -> Result<ReadRun, Problem> {
    let (mut files, mut agents, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    for path in monitor_files(path)? {
        let file = DataFile::read(folder, &path)?;
        agents.push(read_agent(&file)?);
        if file.complete_lines().1 {
            warnings.push(incomplete_line_warning(&file));
        }
        files.push(file.hash);
    }
    run_data::team_steps(&mut agents);
    if agents.len() > 1 && settings.has_one_learner {
        agents = vec![AgentEpisodes::of_copies(&agents)];
    } else if agents.len() > 1 {
        warnings.push(format!(
            "{}: its {} files count as as many agents; if they are of the copies of one learner, as of `make_vec_env`, write \
             `agents: 1` in the cell",
            super::data_file::name_of(folder, path),
            agents.len()
        ));
    }
    let result = run_data::result(agents, settings.solved, settings.limits, Rounding::Double);
    Ok(ReadRun::new(folder, path, files, result).with_warnings(warnings))
}

/// The files of all agents, in the order of their numbers.
fn monitor_files(path: &Path) -> Result<Vec<PathBuf>, InputError> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let entries = std::fs::read_dir(path).map_err(|error| file_error(path, error.to_string()))?;
    let mut files: Vec<(u64, String)> = Vec::new();
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let agent = name.strip_suffix(".monitor.csv");
        if agent.is_some() || name == "monitor.csv" {
            let number = agent.and_then(|agent| agent.parse().ok());
            files.push((number.unwrap_or(u64::MAX), name));
        }
    }
    if files.is_empty() {
        return Err(file_error(
            path,
            "expected `monitor.csv` or `*.monitor.csv` in this directory, found neither",
        ));
    }
    files.sort();
    Ok(files.into_iter().map(|(_, name)| path.join(name)).collect())
}

fn read_agent(file: &DataFile) -> Result<AgentEpisodes, InputError> {
    let (text, _) = file.complete_lines();
    let end = text.iter().position(|&byte| byte == b'\n');
    let (first_line, table) = text.split_at(end.map_or(0, |end| end + 1));
    check_first_line(file, first_line)?;
    let mut rows = Rows::new(file, table, 1)?;
    let (r#return, length) = (rows.column("r")?, rows.column("l")?);
    let (mut agent, mut steps) = (AgentEpisodes::default(), 0);
    while rows.advance()? {
        agent.returns.push(rows.number(r#return)?);
        steps = rows.sum(steps, length)?;
        agent.env_steps.push(steps);
    }
    if agent.returns.is_empty() {
        return Err(file.error("expected at least one finished episode, found none"));
    }
    Ok(agent)
}

fn check_first_line(file: &DataFile, line: &[u8]) -> Result<(), InputError> {
    let json = line.strip_prefix(b"#");
    let is_json = |json: &[u8]| serde_json::from_slice::<serde_json::Value>(json).is_ok();
    if json.is_some_and(is_json) {
        return Ok(());
    }
    Err(InputError {
        position: Some(Position {
            line: 1,
            column: 1,
            text: String::from_utf8_lossy(line).trim_end().to_owned(),
        }),
        ..file.error("expected a first line such as `#{\"t_start\": 1.5, \"env_id\": \"CartPole-v1\"}`, which Stable-Baselines3's `Monitor` writes")
    })
}
