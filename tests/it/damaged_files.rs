//! One flipped bit in any stored file: every reader refuses it, with a message that names the file, or
//! gives the same output as with the intact file.
//!
//! The position of the bit follows from the offset of its byte. By default a sample of the bytes of
//! each file is changed, in a test that is ignored every byte.

use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use tempfile::TempDir;

use super::state_files::{small_file, write_file};
use super::util::{REPOSITORY, RESULT_FILES, command, seedbed, stderr, study_arguments};
use seedbed::explore::Explorer;
use seedbed::export::{self, Content, Format};
use seedbed::record::recording::RecordingFile;
use seedbed::record::table::TableFiles;
use seedbed::review::LoadedRun;
use seedbed::review::overview::RunOverview;
use seedbed::run::evaluate::{EvaluationSettings, evaluate};
use seedbed::run::folder::RunFolder;
use seedbed::run::measures::RoundRows;
use seedbed::run::ranks::Ranks;
use seedbed::run::recorder::{RecordError, Recorder, RecorderFactory, RoundRecord, RunInfo};
use seedbed::run::replay::{ReplaySettings, replay};
use seedbed::run::{self, Observer, Options, Plan, Progress};
use seedbed::scenario::recording::RecordingSettings;
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::evaluate::claims;
use seedbed::study::evaluate::results::Results;
use seedbed::study::store::StudyFolder;

/// What a reader gives: its output, or its error.
type Reading = Result<String, String>;

/// A reader of everything in a folder.
struct Reader {
    name: &'static str,
    read: fn(&Path) -> Reading,
}

/// Which bytes of a file are changed, one at a time.
#[derive(Clone, Copy)]
enum Bytes {
    Sample,
    Every,
}

impl Bytes {
    fn offsets(self, length: u64) -> Vec<u64> {
        const START: u64 = 48;
        const SPACED: u64 = 24;
        let sample = || {
            let spaced = (0..SPACED).map(|index| index * length / SPACED + index % 7);
            (0..START).chain(spaced).chain(length.checked_sub(1))
        };
        let mut offsets: Vec<u64> = match self {
            Self::Sample => sample().filter(|offset| *offset < length).collect(),
            Self::Every => (0..length).collect(),
        };
        offsets.sort_unstable();
        offsets.dedup();
        offsets
    }
}

/// Flips a bit of a byte. A second call restores it.
fn flip(path: &Path, offset: u64) {
    let mut file = File::options().read(true).write(true).open(path).unwrap();
    let mut byte = [0];
    file.seek(SeekFrom::Start(offset)).unwrap();
    file.read_exact(&mut byte).unwrap();
    byte[0] ^= 1 << (offset % 8);
    file.seek(SeekFrom::Start(offset)).unwrap();
    file.write_all(&byte).unwrap();
}

/// All files in a folder and its subfolders, sorted.
fn all_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(all_files(&path));
        } else {
            files.push(path);
        }
    }
    files.sort();
    files
}

fn copy_folder(from: &Path, to: &Path) {
    for file in all_files(from) {
        let copy = to.join(file.strip_prefix(from).unwrap());
        fs::create_dir_all(copy.parent().unwrap()).unwrap();
        fs::copy(file, copy).unwrap();
    }
}

/// Whether a reader uses a file: its output is another one if all bytes of the file are others.
fn uses(reader: &Reader, folder: &Path, file: &Path, intact: &str) -> bool {
    let bytes = fs::read(file).unwrap();
    let others: Vec<u8> = bytes.iter().map(|byte| !byte).collect();
    fs::write(file, others).unwrap();
    let reading = (reader.read)(folder);
    fs::write(file, bytes).unwrap();
    reading.as_deref() != Ok(intact)
}

/// Flips one bit of bytes of every file in a folder, and calls all readers that use the file. Returns
/// the names of the files that are used, relative to the folder.
fn flip_bits(folder: &Path, readers: &[Reader], bytes: Bytes) -> Vec<String> {
    let mut used = Vec::new();
    let intact: Vec<String> = readers
        .iter()
        .map(|reader| (reader.read)(folder).unwrap_or_else(|error| panic!("{error}")))
        .collect();
    for file in all_files(folder) {
        let of_file: Vec<(&Reader, &String)> = readers
            .iter()
            .zip(&intact)
            .filter(|(reader, intact)| uses(reader, folder, &file, intact))
            .collect();
        if of_file.is_empty() {
            continue;
        }
        let name = file.strip_prefix(folder).unwrap();
        used.push(name.to_string_lossy().into_owned());
        for offset in bytes.offsets(file.metadata().unwrap().len()) {
            flip(&file, offset);
            for (reader, intact) in &of_file {
                assert_refused_or_same(reader, folder, (&file, offset), intact);
            }
            flip(&file, offset);
        }
    }
    used
}

fn assert_refused_or_same(
    reader: &Reader,
    folder: &Path,
    (file, offset): (&Path, u64),
    intact: &str,
) {
    let place = format!("{} of {} at offset {offset}", reader.name, file.display());
    let reading = catch_unwind(AssertUnwindSafe(|| (reader.read)(folder)));
    match reading.unwrap_or_else(|_| panic!("{place}: a panic")) {
        Ok(output) => assert!(output == intact, "{place}: another output"),
        Err(error) => assert!(
            error.contains(&*file.to_string_lossy()),
            "{place}: {error} does not name the file"
        ),
    }
}

const RUN_SETTINGS: [&str; 4] = [
    "agents.count=2",
    "stop=Episodes(6)",
    "checkpoint_every=2",
    "checkpoint_share=1",
];

fn plan() -> Plan {
    let scenario = Path::new(REPOSITORY).join("scenarios/cartpole.ron");
    Plan::load(&scenario, &RUN_SETTINGS.map(str::to_owned)).unwrap()
}

/// Interrupts a run after a number of rounds.
struct InterruptAfter<'a> {
    rounds: usize,
    interrupted: &'a AtomicBool,
}

impl Observer for InterruptAfter<'_> {
    fn begun(&mut self, _: &Progress) {}

    fn round_finished(&mut self, progress: &Progress, _: &RoundRows) {
        let is_over = progress.episodes >= self.rounds;
        self.interrupted.store(is_over, Ordering::Relaxed);
    }
}

/// Runs the plan with tables and a recording, until it ends or has had a number of rounds.
fn execute(plan: &Plan, folder: &Path, resume: bool, rounds: usize) -> Result<(), String> {
    let options = Options {
        folder: RunFolder::new(folder),
        resume,
        threads: 1,
        save_initial: false,
        other_versions: false,
        ranks: Ranks::SINGLE,
    };
    fs::create_dir_all(folder).unwrap();
    let recording = RecordingFile {
        path: options.folder.recording_file(),
        live: None,
    };
    let tables = TableFiles {
        folder: folder.to_owned(),
    };
    let interrupted = AtomicBool::new(false);
    let mut observer = InterruptAfter {
        rounds,
        interrupted: &interrupted,
    };
    let factories: run::RecorderFactories = vec![Box::new(tables), Box::new(recording)];
    let outcome = run::execute(plan, &options, factories, &mut observer, &interrupted);
    outcome.map(drop).map_err(|error| error.to_string())
}

fn finished_run(folder: &Path) {
    execute(&plan(), folder, false, usize::MAX).unwrap();
}

fn interrupted_run(folder: &Path) {
    execute(&plan(), folder, false, 3).unwrap();
}

const EVALUATION: EvaluationSettings<'static> = EvaluationSettings {
    episodes: 2,
    action_selection: None,
    environment: None,
    seed: 0,
};

fn read_by_evaluate(folder: &Path) -> Reading {
    let played = evaluate(&RunFolder::new(folder), &EVALUATION);
    let (plan, episodes) = played.map_err(|error| error.to_string())?;
    Ok(format!("{} {episodes:?}", plan.name))
}

/// A recorder without a file.
struct NoFile;

impl RecorderFactory for NoFile {
    fn create(
        self: Box<Self>,
        _: &RunInfo<'_>,
        _: &RecordingSettings,
    ) -> Result<Box<dyn Recorder>, RecordError> {
        Ok(self)
    }

    fn resume(
        self: Box<Self>,
        _: &RunInfo<'_>,
        _: &RecordingSettings,
        _: &[u8],
    ) -> Result<Box<dyn Recorder>, RecordError> {
        Ok(self)
    }
}

impl Recorder for NoFile {
    fn record_round(&mut self, _: &RoundRecord<'_>) -> Result<(), RecordError> {
        Ok(())
    }

    fn checkpoint(&mut self) -> Result<Vec<u8>, RecordError> {
        Ok(Vec::new())
    }

    fn finish(&mut self) -> Result<(), RecordError> {
        Ok(())
    }
}

fn read_by_replay(folder: &Path) -> Reading {
    let settings = ReplaySettings {
        evaluation: EVALUATION,
        drawn_agents: None,
    };
    let replayed = replay(
        &RunFolder::new(folder),
        &settings,
        Box::new(NoFile),
        &mut |_| (),
    );
    let (plan, rows) = replayed.map_err(|error| error.to_string())?;
    Ok(format!("{} {rows:?}", plan.name))
}

/// What `inspect` and `plot` read.
fn read_by_review(folder: &Path) -> Reading {
    let run = LoadedRun::open(folder).map_err(|error| error.to_string())?;
    let name = run.name();
    Ok(format!(
        "{name} {:?} {:?} {:?} {:?}",
        run.is_finished, run.summary, run.episodes, run.rounds
    ))
}

fn read_by_explore(folder: &Path) -> Reading {
    let run = LoadedRun::open(folder).map_err(|error| error.to_string())?;
    let runs = [(folder.to_owned(), run)];
    let explorer = Explorer::read(&runs, u64::MAX, &mut || ());
    Ok(explorer.map_err(|error| error.to_string())?.page())
}

fn read_by_export(folder: &Path) -> Reading {
    let run = LoadedRun::open(folder).map_err(|error| error.to_string())?;
    let exported = tempfile::tempdir().unwrap();
    let mut texts = String::new();
    for content in [Content::States, Content::Episodes, Content::Rounds] {
        let path = exported.path().join("table.csv");
        export::export(&run, content, Format::Csv, &path, &mut || ())
            .map_err(|error| error.to_string())?;
        texts += &fs::read_to_string(path).unwrap();
    }
    Ok(texts)
}

/// A run that cannot be read has no numbers in the list, and its error below it.
fn read_by_runs(folder: &Path) -> Reading {
    let run = RunOverview::of(folder.to_owned());
    match run.error {
        Some(error) => {
            assert_eq!(run.results, seedbed::review::overview::Results::default());
            Err(error)
        }
        None => Ok(format!("{:?} {:?}", run.state, run.results)),
    }
}

/// Resumes a copy of a run. The output is its results and the states in its recording. The names of
/// files are those of the original.
fn read_by_resume(folder: &Path) -> Reading {
    let copy = tempfile::tempdir().unwrap();
    copy_folder(folder, copy.path());
    let name = |text: String| text.replace(copy.path().to_str().unwrap(), folder.to_str().unwrap());
    execute(&plan(), copy.path(), true, usize::MAX).map_err(name)?;
    let results = RESULT_FILES.map(|name| fs::read(copy.path().join(name)).unwrap());
    Ok(format!(
        "{results:?} {}",
        read_by_export(copy.path()).unwrap()
    ))
}

const READERS_OF_RUNS: [Reader; 6] = [
    Reader {
        name: "evaluate",
        read: read_by_evaluate,
    },
    Reader {
        name: "replay",
        read: read_by_replay,
    },
    Reader {
        name: "inspect and plot",
        read: read_by_review,
    },
    Reader {
        name: "explore",
        read: read_by_explore,
    },
    Reader {
        name: "export",
        read: read_by_export,
    },
    Reader {
        name: "runs",
        read: read_by_runs,
    },
];

fn check_finished_run(bytes: Bytes) {
    let folder = tempfile::tempdir().unwrap();
    finished_run(folder.path());
    let used = flip_bits(folder.path(), &READERS_OF_RUNS, bytes);
    let expected = [
        "SHA256SUMS",
        "checkpoint/state.bin",
        "envs/cartpole.ron",
        "episodes.csv",
        "rounds.csv",
        "run.rrd",
        "scenario.ron",
        "summary.json",
    ];
    assert_eq!(used, expected);
}

fn check_interrupted_run(bytes: Bytes) {
    let folder = tempfile::tempdir().unwrap();
    interrupted_run(folder.path());
    let resume = Reader {
        name: "run --resume",
        read: read_by_resume,
    };
    let readers: Vec<Reader> = READERS_OF_RUNS.into_iter().chain([resume]).collect();
    let used = flip_bits(folder.path(), &readers, bytes);
    let expected = [
        "SHA256SUMS",
        "checkpoint/state.bin",
        "envs/cartpole.ron",
        "episodes.csv",
        "rounds.csv",
        "run.rrd.part",
        "scenario.ron",
    ];
    assert_eq!(used, expected);
}

/// A folder such as the recorder of the Python package writes it.
fn check_state_files(bytes: Bytes) {
    let folder = tempfile::tempdir().unwrap();
    for agent in [0, 1] {
        write_file(folder.path(), agent, &small_file(agent));
    }
    let table = "agent,episode,round,env_steps,return,length,outcome\n0,0,0,2,0.1,2,terminated\n";
    fs::write(folder.path().join("episodes.csv"), table).unwrap();
    let summary = r#"{"scenario":"walk","environment":"Walk-v0","agents":2,"final_return":1.1}"#;
    fs::write(folder.path().join("summary.json"), summary).unwrap();
    let used = flip_bits(folder.path(), &READERS_OF_RUNS[2..], bytes);
    let expected = [
        "states/agent_0.states",
        "states/agent_1.states",
        // The number of episodes.
        "summary.json",
    ];
    assert_eq!(used, expected);
}

/// A small registered study with its results, in a folder.
fn registered_study() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let scenario = Path::new(REPOSITORY).join("scenarios/tabular/deep_sea.ron");
    fs::copy(scenario, folder.path().join("deep_sea.ron")).unwrap();
    let text = r#"Study(
        title: "Small",
        scenario: "deep_sea.ron",
        set: ["agents.count=3", "episodes=8"],
        cells: [
            (name: "seeds", set: ["algorithm=SeedSampling()"]),
            (name: "random", set: ["algorithm=Random"]),
        ],
        measures: [Regret],
        repeats: 2,
        claims: [(text: "less regret", compare: ("seeds", "random"), direction: Less, smallest: 5,
            confirmatory: true)],
    )"#;
    fs::write(folder.path().join("small.ron"), text).unwrap();
    for action in ["register", "confirm"] {
        let output = study(folder.path(), &[action]);
        assert!(output.status.success(), "{output:?}");
    }
    folder
}

fn study(folder: &Path, arguments: &[&str]) -> std::process::Output {
    let paths = ["small.ron", "out"].map(|name| folder.join(name));
    let [study, out] = paths.each_ref().map(|path| path.to_str().unwrap());
    seedbed(&study_arguments(study, out, arguments))
}

fn read_by_report(out: &Path) -> Reading {
    let results = Results::read(&StudyFolder::new(out));
    let results = results.map_err(|error| error.to_string())?;
    Ok(format!("{results:?} {:?}", claims::evaluate(&results)))
}

fn read_by_confirm(folder: &Path) -> Reading {
    let plan = StudyPlan::load_before_results(&folder.join("small.ron"), false);
    let registered = plan.map_err(|error| error.to_string())?.registered();
    let registered = registered.map_err(|error| error.to_string())?;
    Ok(format!("{:?}", registered.lock))
}

fn check_study(bytes: Bytes) {
    let folder = registered_study();
    let out = folder.path().join("out");
    let report = Reader {
        name: "report",
        read: read_by_report,
    };
    let used = flip_bits(&out, &[report], bytes);
    let [runs @ .., description] = &used[..] else {
        panic!("nothing is used");
    };
    assert!(
        runs.len() == 4 && runs.iter().all(|name| name.starts_with("runs/")),
        "{used:?}"
    );
    assert_eq!(description, "study.json");
    let confirm = Reader {
        name: "study confirm",
        read: read_by_confirm,
    };
    let lock = folder.path().join("small.ron.lock");
    let intact = read_by_confirm(folder.path()).unwrap();
    for offset in bytes.offsets(lock.metadata().unwrap().len()) {
        flip(&lock, offset);
        assert_refused_or_same(&confirm, folder.path(), (&lock, offset), &intact);
        flip(&lock, offset);
    }
}

#[test]
fn a_flipped_bit_in_a_finished_run_never_changes_a_number() {
    check_finished_run(Bytes::Sample);
}

#[test]
fn a_flipped_bit_in_an_interrupted_run_never_changes_a_number() {
    check_interrupted_run(Bytes::Sample);
}

#[test]
fn a_flipped_bit_in_files_of_states_never_changes_a_number() {
    check_state_files(Bytes::Every);
}

#[test]
fn a_flipped_bit_in_a_study_never_changes_a_number() {
    check_study(Bytes::Sample);
}

/// Takes hours: every byte of every file.
#[test]
#[ignore = "takes hours"]
fn a_flipped_bit_in_any_byte_never_changes_a_number() {
    std::thread::scope(|scope| {
        for check in [check_finished_run, check_interrupted_run, check_study] {
            scope.spawn(move || check(Bytes::Every));
        }
    });
}

/// What a command prints and writes to a file; `None` if the file has a random id.
struct CommandLine {
    arguments: Vec<String>,
    written: Option<PathBuf>,
}

impl CommandLine {
    /// Standard output, and the bytes of the written file.
    fn run(&self) -> (std::process::Output, Option<Vec<u8>>) {
        let arguments: Vec<&str> = self.arguments.iter().map(String::as_str).collect();
        let output = seedbed(&arguments);
        (
            output,
            self.written.as_ref().and_then(|path| fs::read(path).ok()),
        )
    }
}

/// All commands that read a run, with files in another folder.
fn commands_on(run: &Path, other: &Path) -> Vec<CommandLine> {
    let run = run.to_str().unwrap();
    let file = |name: &str| other.join(name).to_str().unwrap().to_owned();
    let command = |arguments: &[&str], written: Option<&str>| CommandLine {
        arguments: arguments.iter().map(|word| (*word).to_owned()).collect(),
        written: written.map(|name| other.join(name)),
    };
    vec![
        command(&["evaluate", run, "--episodes", "1"], None),
        command(
            &["replay", run, "--episodes", "1", "--out", &file("r.rrd")],
            None,
        ),
        command(&["inspect", run], None),
        command(&["plot", run, "--out", &file("p.svg")], Some("p.svg")),
        command(
            &["plot", run, "--what", "curves", "--out", &file("c.svg")],
            Some("c.svg"),
        ),
        command(&["export", run, "--to", &file("s.csv")], Some("s.csv")),
        command(&["explore", run, "--out", &file("e.html")], Some("e.html")),
    ]
}

/// On the command line, a refusal is exit status 2, or 1 for a checkpoint, with one error and nothing
/// else.
#[test]
fn commands_refuse_damaged_files() {
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let run = folders[0].path();
    finished_run(run);
    for command in commands_on(run, folders[1].path()) {
        let (intact, intact_file) = command.run();
        assert!(intact.status.success(), "{}", stderr(&intact));
        assert_eq!(stderr(&intact), "");
        let mut refusals = 0;
        for file in all_files(run) {
            let offset = file.metadata().unwrap().len() / 2;
            flip(&file, offset);
            let (output, written) = command.run();
            flip(&file, offset);
            let place = format!("{:?} with {}", command.arguments, file.display());
            if output.status.success() {
                assert!(
                    (output.stdout, written) == (intact.stdout.clone(), intact_file.clone()),
                    "{place}"
                );
                continue;
            }
            refusals += 1;
            let error = stderr(&output);
            assert_eq!(output.status.code(), Some(2), "{place}: {error}");
            assert!(
                error.starts_with("error: ") && error.contains(file.to_str().unwrap()),
                "{place}: {error}"
            );
            assert!(
                output.stdout.is_empty() && error.matches("error:").count() == 1,
                "{place}"
            );
        }
        assert!(refusals >= 3, "{:?}: {refusals}", command.arguments);
    }
}

#[test]
fn resuming_refuses_damaged_files() {
    let folder = tempfile::tempdir().unwrap();
    let [run, copy] = ["run", "copy"].map(|name| folder.path().join(name));
    interrupted_run(&run);
    let mut refusals = Vec::new();
    for file in all_files(&run) {
        copy_folder(&run, &copy);
        let name = file.strip_prefix(&run).unwrap().to_str().unwrap();
        flip(&copy.join(name), file.metadata().unwrap().len() / 2);
        let mut resume = command(&["run", "scenarios/cartpole.ron", "--resume", "--quiet"]);
        resume.args(RUN_SETTINGS.iter().flat_map(|setting| ["--set", setting]));
        let output = resume.arg("--out").arg(&copy).output().unwrap();
        if !output.status.success() {
            let error = stderr(&output);
            assert!(
                matches!(output.status.code(), Some(1 | 2)),
                "{name}: {error}"
            );
            assert!(
                error.contains(copy.join(name).to_str().unwrap()),
                "{name}: {error}"
            );
            refusals.push(name.to_owned());
        }
        fs::remove_dir_all(&copy).unwrap();
    }
    let expected = [
        "SHA256SUMS",
        "checkpoint/state.bin",
        "envs/cartpole.ron",
        "episodes.csv",
        "rounds.csv",
        "run.rrd.part",
        "scenario.ron",
    ];
    assert_eq!(refusals, expected);
}

/// A study repeats the run of a damaged file, and says so. The report and the verification refuse it.
#[test]
fn studies_repeat_damaged_runs() {
    let folder = registered_study();
    let out = folder.path().join("out");
    let report = || seedbed(&["report", out.to_str().unwrap()]);
    let verify = || study(folder.path(), &["verify", "--registered"]);
    let file = all_files(&out.join("runs")).pop().unwrap();
    let intact = fs::read(&file).unwrap();
    flip(&file, 100);
    for output in [report(), verify()] {
        let error = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(error.contains(file.to_str().unwrap()), "{error}");
        assert!(output.stdout.is_empty());
    }
    let repeated = study(folder.path(), &["confirm"]);
    assert!(repeated.status.success(), "{}", stderr(&repeated));
    let warning = format!("warning: {} is damaged", file.display());
    assert!(
        stderr(&repeated).starts_with(&warning),
        "{}",
        stderr(&repeated)
    );
    assert_eq!(fs::read(&file).unwrap(), intact);
    let description = out.join("study.json");
    flip(&description, 100);
    for output in [report(), verify(), study(folder.path(), &["confirm"])] {
        let error = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(error.contains(description.to_str().unwrap()), "{error}");
    }
}

/// Runs of earlier versions have no checksums: they are read, with a warning.
#[test]
fn runs_without_checksums_are_read_with_a_warning() {
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let run = folders[0].path();
    finished_run(run);
    let before: Vec<_> = commands_on(run, folders[1].path())
        .iter()
        .map(|command| command.run().0.stdout)
        .collect();
    fs::remove_file(run.join("SHA256SUMS")).unwrap();
    for (command, stdout) in commands_on(run, folders[1].path()).iter().zip(before) {
        let (output, _) = command.run();
        assert!(output.status.success() && output.stdout == stdout);
        let expected = format!("warning: {} has no SHA256SUMS", run.display());
        let warning = stderr(&output);
        assert!(
            warning.starts_with(&expected),
            "{:?}: {warning}",
            command.arguments
        );
    }
}

/// A recording that is deleted or copied elsewhere needs no checksum.
#[test]
fn single_files_can_be_deleted_and_copied() {
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let [run, elsewhere] = [&folders[0], &folders[1]].map(TempDir::path);
    finished_run(run);
    fs::rename(run.join("run.rrd"), elsewhere.join("copy.rrd")).unwrap();
    for path in [run.to_owned(), elsewhere.join("copy.rrd")] {
        let output = seedbed(&["inspect", path.to_str().unwrap()]);
        assert!(
            output.status.success() && output.stderr.is_empty(),
            "{}",
            stderr(&output)
        );
    }
}
