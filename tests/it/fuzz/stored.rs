//! Targets that the program or its recorders write: checkpoints, results of studies, files of
//! visited states, and recordings. Contents are changed below their checksums, so that the decoders
//! behind these are reached.

use std::fs;
use std::path::{Path, PathBuf};

use rand::RngExt;
use xxhash_rust::xxh64::{Xxh64, xxh64};

use seedbed::record::RecordedStates;
use seedbed::record::state_files::StateFiles;
use seedbed::review::overview::RunOverview;
use seedbed::run::Plan;
use seedbed::run::folder::checkpoint::Checkpoint;
use seedbed::run::training::Trainer;
use seedbed::study::evaluate::claims;
use seedbed::study::evaluate::results::Results;
use seedbed::study::report;
use seedbed::study::store::StudyFolder;
use seedbed::text::align_columns;
use seedbed_random::Stream;

use super::driver::Target;
use super::mutate::{any, change_bytes};
use crate::state_files::{frame, small_file};
use crate::util::{files_below, run_successful};

/// Algorithms of the runs whose checkpoints are changed, with their schedules.
const ALGORITHMS: [(&str, &str); 12] = [
    (
        "seed_pg",
        "algorithm: SeedPg(hidden: [4], bonus: Vime(model: Independent, hidden: [4])), schedule: Asynchronous()",
    ),
    (
        "rnd",
        "algorithm: SeedPg(hidden: [4], bonus: Rnd(hidden: [4])), schedule: Synchronous(episodes: 2)",
    ),
    (
        "team_entropy",
        "algorithm: SeedPg(hidden: [4], bonus: TeamEntropy(references: 20)), schedule: Synchronous()",
    ),
    (
        "discriminator",
        "algorithm: SeedPg(hidden: [4], bonus: Discriminator(hidden: [4])), schedule: Synchronous()",
    ),
    (
        "regions",
        "algorithm: SeedPg(hidden: [4], bonus: Regions(regions: 9)), schedule: Synchronous()",
    ),
    (
        "leader",
        "algorithm: LeaderFollowers(hidden: [4]), schedule: Synchronous()",
    ),
    (
        "q_learning",
        "algorithm: QLearning(learning: (hidden: [4])), schedule: Lockstep()",
    ),
    (
        "seed_td",
        "algorithm: SeedTd(learning: (hidden: [4])), schedule: Lockstep()",
    ),
    (
        "bootstrapped",
        "algorithm: BootstrappedDqn(models: 2, learning: (hidden: [4])), schedule: Lockstep()",
    ),
    (
        "hyper_agent",
        "algorithm: HyperAgent(dimension: 2, draw: EveryRound, learning: (hidden: [4])), schedule: Lockstep()",
    ),
    (
        "seed_psrl",
        "algorithm: SeedPsrl(hidden: [4], horizon: 3, candidates: 8, minibatches: 5)",
    ),
    ("cross_entropy", "algorithm: CrossEntropy()"),
];

/// Length of the header of a checkpoint; see `src/storage/sealed.rs`.
const SEAL: usize = 32;

/// Runs each algorithm for a few episodes.
pub(super) fn set_up_checkpoints(folder: &Path) {
    for (name, fields) in ALGORITHMS {
        let scenario = folder.join(name).with_extension("ron");
        let text = format!(
            r#"Scenario(environment: "cartpole", agents: (count: 2), {fields}, stop: Episodes(2))"#
        );
        fs::write(&scenario, text).unwrap();
        let out = folder.join(name);
        let [scenario, out] = [&scenario, &out].map(|path| path.to_str().unwrap());
        run_successful(&["run", scenario, "--out", out, "--no-recording", "--quiet"]);
    }
}

struct Checkpoints {
    folder: PathBuf,
    runs: Vec<(PathBuf, Plan, Vec<u8>)>,
}

/// Checkpoints: what is restored can be saved, and the run can continue for a round.
pub(super) fn checkpoints(folder: &Path) -> Box<dyn Target> {
    let runs = ALGORITHMS.iter().map(|(name, _)| {
        let run = folder.join(name);
        let plan = Plan::load(
            &run.with_extension("ron"),
            &["stop=Episodes(1000)".to_owned()],
        );
        let contents = fs::read(run.join("checkpoint/state.bin")).unwrap();
        (run, plan.unwrap(), contents[SEAL..].to_vec())
    });
    Box::new(Checkpoints {
        folder: folder.to_owned(),
        runs: runs.collect(),
    })
}

/// The contents of a checkpoint with their header.
fn seal(contents: &[u8], header_of: &[u8]) -> Vec<u8> {
    let mut file = header_of[..16].to_vec();
    file.extend((contents.len() as u64).to_le_bytes());
    let mut hash = Xxh64::new(0);
    hash.update(&file[8..]);
    hash.update(contents);
    file.extend(hash.digest().to_le_bytes());
    file.extend(contents);
    file
}

impl Target for Checkpoints {
    fn path(&self) -> PathBuf {
        self.folder.join("checkpoint")
    }

    /// The number of the run, then the contents of its checkpoint.
    fn generate(&mut self, random: &mut Stream) -> Vec<u8> {
        let index = random.random_range(0..self.runs.len());
        let mut contents = self.runs[index].2.clone();
        change_bytes(&mut contents, &[], random);
        [vec![index as u8], contents].concat()
    }

    fn read(&mut self, input: &[u8]) -> bool {
        let (run, plan, _) = &self.runs[usize::from(input[0])];
        let path = run.join("checkpoint/state.bin");
        let header = fs::read(&path).unwrap();
        fs::remove_file(&path).unwrap();
        fs::write(&path, seal(&input[1..], &header)).unwrap();
        let mut trainer = Trainer::from_scenario(&plan.scenario, &plan.description, 1).unwrap();
        let Ok(checkpoint) = Checkpoint::read(run) else {
            return false;
        };
        let is_restored = checkpoint.restore(run, &mut trainer).is_ok();
        if is_restored {
            assert!(!trainer.save().is_empty());
        }
        is_restored
    }
}

/// Runs a study of few short runs.
pub(super) fn set_up_study_results(folder: &Path) {
    let study = folder.join("study.ron");
    let text = r#"Study(
        title: "Small",
        scenario: "cartpole",
        set: ["agents.count=2", "stop=Episodes(4)"],
        grid: [(name: "K", set: ["agents.seeds={}"], values: ["Normal(sigma: 0)", "Normal(sigma: 9)"], labels: ["0", "9"])],
        repeats: 2,
        measures: [FinalReturn(window: 2), EpisodesToSolve, Coverage],
        claims: [(text: "x", compare: ("K 0", "K 9"), measure: FinalReturn(window: 2), direction: Less, smallest: 10)],
        figures: [Curves(window: 3), Visitation(cells: ["K 9"], episodes: [First(2), All])],
    )"#;
    fs::write(&study, text).unwrap();
    let out = folder.join("out");
    let [study, out] = [&study, &out].map(|path| path.to_str().unwrap());
    run_successful(&["study", study, "--out", out]);
}

struct StudyResults {
    folder: PathBuf,
    /// The file that is changed.
    path: PathBuf,
    /// Contents of all files, without their checksums.
    contents: Vec<Vec<u8>>,
}

/// Results of studies: claims are evaluated, and the tables of the report are written.
pub(super) fn study_results(folder: &Path) -> Box<dyn Target> {
    let paths = files_below(&folder.join("out/runs"), "run");
    let contents = paths.iter().map(|path| {
        let bytes = fs::read(path).unwrap();
        bytes[..bytes.len() - 8].to_vec()
    });
    Box::new(StudyResults {
        folder: folder.join("out"),
        path: paths[0].clone(),
        contents: contents.collect(),
    })
}

impl Target for StudyResults {
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    fn generate(&mut self, random: &mut Stream) -> Vec<u8> {
        let mut contents = self.contents[0].clone();
        change_bytes(&mut contents, &self.contents, random);
        let checksum = xxh64(&contents, 0);
        contents.extend(checksum.to_le_bytes());
        contents
    }

    fn read(&mut self, _: &[u8]) -> bool {
        let results = match Results::read(&StudyFolder::new(&self.folder)) {
            Ok(results) => results,
            Err(error) => {
                let file = self.path.display().to_string();
                assert!(error.to_string().contains(&file), "{error}");
                return false;
            }
        };
        let claims = claims::evaluate(&results);
        report::write_texts(&results, &claims, &self.folder).unwrap();
        results.cells.iter().all(|cell| cell.missing == 0)
    }
}

struct States {
    path: PathBuf,
}

/// Files of visited states, whose checksums are right for most inputs.
pub(super) fn state_files(folder: &Path) -> Box<dyn Target> {
    Box::new(States {
        path: folder.join("agent_0.states"),
    })
}

/// The kinds and payloads of the frames of a file.
fn frames_of(file: &[u8]) -> Vec<([u8; 4], Vec<u8>)> {
    let mut frames = Vec::new();
    let mut rest = &file[16..];
    while let Some((start, after)) = rest.split_first_chunk::<16>() {
        let (kind, size) = (&start[..4], &start[4..8]);
        let size = u32::from_le_bytes(size.try_into().unwrap()) as usize;
        frames.push((kind.try_into().unwrap(), after[..size].to_vec()));
        rest = &after[size..];
    }
    frames
}

/// Makes a text in the header longer than widths in formats can be.
fn lengthen_a_text(header: &mut Vec<u8>, random: &mut Stream) {
    let Ok(mut json) = serde_json::from_slice::<serde_json::Value>(header) else {
        return;
    };
    let length = [1_000, 1_001, 70_000][random.random_range(0..3)];
    let text = serde_json::Value::from("é".repeat(length / 2));
    match random.random_range(0..3) {
        0 => json["environment"] = text,
        1 => json["observations"][0]["name"] = text,
        _ => json["actions"][0]["unit"] = text,
    }
    *header = json.to_string().into_bytes();
}

impl Target for States {
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    fn generate(&mut self, random: &mut Stream) -> Vec<u8> {
        let valid = small_file(0);
        let mut frames = frames_of(&valid);
        let index = random.random_range(0..frames.len());
        if random.random_ratio(1, 4) {
            let other = any(&frames, random).clone();
            frames.insert(index, other);
        }
        if random.random_ratio(1, 8) {
            lengthen_a_text(&mut frames[0].1, random);
        } else {
            change_bytes(&mut frames[index].1, &[], random);
        }
        let frames = frames
            .iter()
            .flat_map(|(kind, payload)| frame(*kind, payload));
        let mut file: Vec<u8> = valid[..16].iter().copied().chain(frames).collect();
        if random.random_ratio(1, 8) {
            change_bytes(&mut file, &[], random);
        }
        file
    }

    fn read(&mut self, _: &[u8]) -> bool {
        let Ok(files) = StateFiles::open_file(&self.path) else {
            return false;
        };
        let _ = (files.axes(), files.episode_rows());
        let listed = RunOverview::of(self.path.parent().unwrap().to_owned());
        let _ = align_columns(&[vec![listed.results.environment.unwrap_or_default()]]);
        files.episodes().all(|episode| episode.is_ok())
    }
}

/// Records a short run.
#[cfg(feature = "rerun")]
pub(super) fn set_up_recordings(folder: &Path) {
    let out = folder.join("run");
    let out = out.to_str().unwrap();
    let stop = ["--set", "agents.count=2", "--set", "stop=Episodes(2)"];
    run_successful(&[&["run", "cartpole", "--out", out, "--quiet"][..], &stop].concat());
}

#[cfg(feature = "rerun")]
struct Recordings {
    path: PathBuf,
    valid: Vec<u8>,
}

/// Recordings of Rerun.
#[cfg(feature = "rerun")]
pub(super) fn recordings(folder: &Path) -> Box<dyn Target> {
    Box::new(Recordings {
        path: folder.join("input.rrd"),
        valid: fs::read(folder.join("run/run.rrd")).unwrap(),
    })
}

#[cfg(feature = "rerun")]
impl Target for Recordings {
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    fn generate(&mut self, random: &mut Stream) -> Vec<u8> {
        let mut bytes = self.valid.clone();
        change_bytes(&mut bytes, &[], random);
        bytes
    }

    fn read(&mut self, _: &[u8]) -> bool {
        let Ok(recording) = RecordedStates::open(&self.path) else {
            return false;
        };
        let _ = (recording.axes(), recording.bonus());
        let episodes = recording.episodes();
        episodes.is_ok_and(|mut episodes| episodes.all(|episode| episode.is_ok()))
    }
}
