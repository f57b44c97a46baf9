//! Targets that other programs write: CSV tables, monitor files of Stable-Baselines3, and event
//! files of TensorBoard, read as results of studies.

use std::fs;
use std::path::{Path, PathBuf};

use seedbed::study::design::plan::StudyPlan;
use seedbed_random::Stream;

use super::driver::Target;
use super::mutate::{Texts, any, change_bytes};
use crate::util::REPOSITORY;

/// Studies that read the file `input.csv` in several ways.
const STUDIES_OF_TABLES: [(&str, &str); 3] = [
    (
        "columns",
        r#"Csv(files: "input.csv", columns: (return: "reward", env_steps: "frames", episode: "ep", agent: "worker", run: "seed"))"#,
    ),
    (
        "lengths",
        r#"Csv(files: "input.csv", columns: (length: "length"))"#,
    ),
    ("monitor", r#"Monitor("input.csv")"#),
];

/// Writes the studies, each with one cell.
pub(super) fn set_up(folder: &Path) {
    let events = (
        "events",
        r#"TensorBoard(runs: "input.tfevents", tag: "charts/episodic_return")"#,
    );
    for (name, results) in STUDIES_OF_TABLES.into_iter().chain([events]) {
        let study = format!(
            r#"Study(title: "x", solved: (return: 3, window: 2), max_episodes: 100, cells: [(name: "a", results: {results})], measures: [FinalReturn(window: 2)])"#
        );
        fs::write(folder.join(name).with_extension("ron"), study).unwrap();
    }
}

/// Whether the results are accepted. If not, the error names the study or the file.
fn load(study: &Path) -> bool {
    match StudyPlan::load(study, false) {
        Ok(_) => true,
        Err(error) => {
            assert!(
                error.origin.contains("input.") || error.message.contains("input."),
                "{error:?}"
            );
            false
        }
    }
}

fn sample(name: &str) -> Vec<u8> {
    fs::read(Path::new(REPOSITORY).join("tests/external").join(name)).unwrap()
}

struct Tables {
    folder: PathBuf,
    texts: Texts,
}

/// Tables in text files.
pub(super) fn tables(folder: &Path) -> Box<dyn Target> {
    let files = [
        "csv/runs.csv",
        "csv/lengths.csv",
        "sb3/ppo-0/monitor.csv",
        "broken/ragged.csv",
        "broken/nan.csv",
    ];
    let texts = files.map(|name| String::from_utf8(sample(name)).unwrap());
    Box::new(Tables {
        folder: folder.to_owned(),
        texts: Texts::new(texts),
    })
}

impl Target for Tables {
    fn path(&self) -> PathBuf {
        self.folder.join("input.csv")
    }

    fn generate(&mut self, random: &mut Stream) -> Vec<u8> {
        self.texts.mutated(random)
    }

    fn read(&mut self, _: &[u8]) -> bool {
        let studies = STUDIES_OF_TABLES.iter();
        let accepted = studies.map(|(name, _)| load(&self.folder.join(name).with_extension("ron")));
        accepted.fold(false, |any, accepted| any | accepted)
    }
}

struct EventFiles {
    folder: PathBuf,
    /// Contents of the records of a valid file.
    records: Vec<Vec<u8>>,
}

/// Event files of TensorBoard, whose checksums are right for most inputs.
pub(super) fn event_files(folder: &Path) -> Box<dyn Target> {
    let file = sample("cleanrl/run-0/events.out.tfevents.1700000000.host.1.0");
    let mut records = Vec::new();
    let mut rest = &file[..];
    while let Some((length, after)) = rest.split_first_chunk::<8>() {
        let length = u64::from_le_bytes(*length) as usize;
        records.push(after[4..][..length].to_vec());
        rest = &after[4 + length + 4..];
    }
    Box::new(EventFiles {
        folder: folder.to_owned(),
        records,
    })
}

/// The record with right checksums, as <https://www.tensorflow.org/tutorials/load_data/tfrecord>
/// describes them.
fn sealed_record(contents: &[u8]) -> Vec<u8> {
    let masked = |bytes: &[u8]| {
        let checksum = crc32c::crc32c(bytes);
        checksum
            .rotate_right(15)
            .wrapping_add(0xa282_ead8)
            .to_le_bytes()
    };
    let length = (contents.len() as u64).to_le_bytes();
    [&length[..], &masked(&length), contents, &masked(contents)].concat()
}

impl Target for EventFiles {
    fn path(&self) -> PathBuf {
        self.folder.join("input.tfevents")
    }

    fn generate(&mut self, random: &mut Stream) -> Vec<u8> {
        let mut records = self.records.clone();
        let index = rand::RngExt::random_range(random, 0..records.len());
        if rand::RngExt::random_ratio(random, 1, 8) {
            records[index].clone_from(any(&self.records, random));
        }
        change_bytes(&mut records[index], &self.records, random);
        let mut file = records
            .iter()
            .flat_map(|record| sealed_record(record))
            .collect();
        if rand::RngExt::random_ratio(random, 1, 8) {
            change_bytes(&mut file, &self.records, random);
        }
        file
    }

    fn read(&mut self, _: &[u8]) -> bool {
        load(&self.folder.join("events.ron"))
    }
}
