//! A recording, `run.rrd`, of visited states that another program recorded, with the same views as
//! the recordings of `seedbed run`.

use std::path::Path;

use super::{ExportError, rounds};
use crate::record::recording::RecordingFile;
use crate::record::state_files::StateFiles;
use crate::run::ranks::Ranks;
use crate::run::recorder::{BonusRange, Focus, RecorderFactory, RoundRecord, RunInfo};
use crate::scenario::recording::RecordingSettings;
use seedbed_learn::team::Workers;

/// Writes the recording, round by round, and returns the number of states. Calls `on_episode` for
/// each episode.
pub(super) fn write(
    name: &str,
    files: &StateFiles,
    path: &Path,
    on_episode: &mut dyn FnMut(),
) -> Result<u64, ExportError> {
    let spec = rounds::task_spec(files);
    let settings = RecordingSettings {
        scene: None,
        ..RecordingSettings::default()
    };
    let episode_numbers = files.episode_rows().iter().map(|row| row.episode);
    let info = RunInfo {
        name,
        focus: Focus::Learning,
        spec: &spec,
        scene: None,
        agents: files.agent_count(),
        ranks: Ranks::SINGLE,
        bonus: BonusRange::None,
        max_episodes: episode_numbers.max().map_or(1, |last| last + 1),
        run_seed: 0,
        scenario: "// There is no scenario: another program trained the agents.",
        properties: &[],
    };
    let file = RecordingFile {
        path: path.to_owned(),
        live: None,
    };
    let mut recorder = Box::new(file).create(&info, &settings)?;
    let mut states = 0;
    rounds::for_each(files, &spec, |round, episodes, rows| {
        recorder.record_round(&RoundRecord {
            round,
            episodes,
            episode_rows: &rows.episodes,
            round_rows: &rows.updates,
            step_data: &[],
            details: &[],
            workers: Workers::CURRENT_THREAD,
        })?;
        for episode in episodes {
            states += episode.length() as u64 + 1;
            on_episode();
        }
        Ok(())
    })?;
    recorder.finish()?;
    Ok(states)
}
