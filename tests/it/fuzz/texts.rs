//! Targets that users write: tasks, scenarios, studies, formulas and overrides.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use seedbed::input_files;
use seedbed::run::Plan;
use seedbed::scenario::Scenario;
use seedbed::scenario::overrides;
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::tuning::plan::{TuningError, TuningFile};
use seedbed::tabular::scenario::TabularScenario;
use seedbed_env::expression::{Evaluator, Previous, Program, Type, ValueTable, Variable, compile};
use seedbed_golden::cases;
use seedbed_input::{Document, FileKind, InputError};
use seedbed_random::Stream;

use super::driver::Target;
use super::mutate::Texts;
use crate::generated::task::play_if_affordable;
use crate::util::{REPOSITORY, files_below};

/// A file of one kind.
struct TextFile {
    path: PathBuf,
    texts: Texts,
    read: fn(&Path) -> Result<(), InputError>,
}

impl TextFile {
    /// Inputs are changed copies of all RON files of a kind in these folders of the repository.
    fn boxed(
        path: PathBuf,
        folders: &[&str],
        is_kind: fn(FileKind) -> bool,
        read: fn(&Path) -> Result<(), InputError>,
    ) -> Box<dyn Target> {
        let files = folders
            .iter()
            .flat_map(|folder| files_below(&Path::new(REPOSITORY).join(folder), "ron"));
        let texts = files
            .filter_map(|file| fs::read_to_string(file).ok())
            .chain(invalid_texts())
            .filter(|text| seedbed_input::file_kind("", text).is_ok_and(is_kind));
        let texts = Texts::new(texts);
        Box::new(Self { path, texts, read })
    }
}

/// The inputs of all cases in `tests/errors/`.
fn invalid_texts() -> impl Iterator<Item = String> {
    let files = files_below(&Path::new(REPOSITORY).join("tests/errors"), "md");
    let texts = files
        .into_iter()
        .map(|file| fs::read_to_string(file).unwrap());
    texts.flat_map(|text| cases(&text)).map(|case| case.input)
}

impl Target for TextFile {
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    fn generate(&mut self, random: &mut Stream) -> Vec<u8> {
        self.texts.mutated(random)
    }

    fn read(&mut self, input: &[u8]) -> bool {
        let result = (self.read)(&self.path);
        if let Err(error) = &result {
            assert_is_located(error, input);
        }
        result.is_ok()
    }
}

/// An error names a file, and the place if the file is a text.
fn assert_is_located(error: &InputError, input: &[u8]) {
    assert!(
        !error.origin.is_empty() && !error.message.is_empty(),
        "{error:?}"
    );
    if let Ok(text) = std::str::from_utf8(input) {
        let Some(position) = &error.position else {
            assert!(may_lack_place(text), "an error without a place: {error}");
            return;
        };
        let lines = text.split('\n').count();
        assert!(
            position.line >= 1 && position.column >= 1 && position.line <= lines.max(1000),
            "{error}"
        );
    }
}

/// What a text leaves out has no place in it: a default that does not fit to the rest. Other errors
/// are those of a text that is not even RON.
fn may_lack_place(text: &str) -> bool {
    text.trim().is_empty() || seedbed_input::check_ron_value(text).is_ok() || only_comments(text)
}

fn only_comments(text: &str) -> bool {
    seedbed_input::file_kind("", text).is_err_and(|error| error.message.contains("but it is empty"))
}

/// Copies the files of the repository to which inputs may refer.
pub(super) fn set_up(folder: &Path) {
    for name in ["envs", "scenarios", "tests/external"] {
        let copied = Command::new("cp")
            .arg("-r")
            .args([Path::new(REPOSITORY).join(name), folder.to_owned()])
            .status();
        assert!(copied.unwrap().success());
    }
}

/// Tasks: those that are valid are played for a few steps.
pub(super) fn tasks(folder: &Path) -> Box<dyn Target> {
    TextFile::boxed(
        folder.join("envs/input.ron"),
        &["envs", "crates/seedbed-env/tests"],
        |kind| matches!(kind, FileKind::Environment | FileKind::TabularEnvironment),
        |path| {
            let (task, _) = input_files::read_task(path)?;
            play_if_affordable(&task, 3);
            Ok(())
        },
    )
}

/// Scenarios of both kinds, checked together with their tasks.
pub(super) fn scenarios(folder: &Path) -> Box<dyn Target> {
    TextFile::boxed(
        folder.join("scenarios/tabular/input.ron"),
        &["scenarios"],
        |kind| matches!(kind, FileKind::Scenario | FileKind::TabularScenario),
        |path| {
            let text = input_files::read_text(path)?;
            match seedbed_input::file_kind(&path.display().to_string(), &text)? {
                FileKind::TabularScenario => {
                    seedbed::tabular::scenario::load(path, &[]).map(|_| ())
                }
                _ => Plan::load(path, &[]).map(|_| ()),
            }
        },
    )
}

/// Studies, checked together with their scenarios and results of others.
pub(super) fn studies(folder: &Path) -> Box<dyn Target> {
    TextFile::boxed(
        folder.join("scenarios/thesis/input.ron"),
        &["scenarios"],
        |kind| kind == FileKind::Study,
        |path| {
            StudyPlan::load(path, false)?;
            StudyPlan::load_before_results(path, true).map(|_| ())
        },
    )
}

/// Tuning files, of which a small search is planned.
pub(super) fn tunings(folder: &Path) -> Box<dyn Target> {
    TextFile::boxed(
        folder.join("scenarios/tuning/input.ron"),
        &["scenarios"],
        |kind| kind == FileKind::Tuning,
        |path| match TuningFile::load(path)?.plan(12, 0) {
            Err(TuningError::Input(error)) => Err(error),
            _ => Ok(()),
        },
    )
}

/// Formulas over three variables.
struct Formulas {
    path: PathBuf,
    texts: Texts,
    variables: Vec<Variable>,
    table: ValueTable,
}

/// Number of copies for which a formula is evaluated.
const COPIES: usize = 5;

/// Formulas: those that are valid are evaluated.
pub(super) fn formulas(folder: &Path) -> Box<dyn Target> {
    let names = ["x", "y", "theta"];
    let variable = |(column, name): (usize, &&str)| Variable {
        name: (*name).to_owned(),
        column,
        previous: if column < 2 {
            Previous::Column(names.len() + column)
        } else {
            Previous::Nowhere
        },
    };
    let mut table = ValueTable::new(names.len() + 2, COPIES);
    let values = [0.0, -1.5, 1e30, f32::INFINITY, f32::NAN, 1e-45, f32::MAX];
    for (index, value) in table.values_mut().iter_mut().enumerate() {
        *value = values[index % values.len()];
    }
    let texts = [
        "-(theta * theta + 0.1 * y * y + 0.001 * x * x)",
        "if x > 0.8 && !(y <= 2 || theta == 3) { 1 } else { 0 } - 0.1 * previous(x)",
        "clamp(max(abs(x), y), -1e3, 1.5) / pow(0.1 + x * x, 1.5) % 3",
        "atan2(sin(theta), cos(theta)) + tanh(log(exp(sqrt(y)))) - floor(sign(x)) * tan(y)",
        "abs(x) > 2.4 || abs(theta) > 12 * degree",
        "if min(x, y) != pi { if x < y { previous(y) } else { -x } } else { theta }",
        "x and y ? `z` : θ² ^ 2",
    ];
    Box::new(Formulas {
        path: folder.join("formula"),
        texts: Texts::new(texts.map(str::to_owned)),
        variables: names.iter().enumerate().map(variable).collect(),
        table,
    })
}

impl Target for Formulas {
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    fn generate(&mut self, random: &mut Stream) -> Vec<u8> {
        self.texts.mutated(random)
    }

    fn read(&mut self, input: &[u8]) -> bool {
        let text = String::from_utf8_lossy(input);
        let accepted = [Type::Number, Type::Boolean].map(|expected| self.compile(&text, expected));
        accepted.contains(&true)
    }
}

impl Formulas {
    fn compile(&self, text: &str, expected: Type) -> bool {
        match compile(text, expected, &self.variables) {
            Ok(program) => {
                self.assert_copies_are_independent(&program);
                true
            }
            Err(error) => {
                let line = text.split('\n').nth(error.line);
                let length = line.map(|line| line.chars().count());
                assert!(
                    length.is_some_and(|length| error.column <= length),
                    "{error:?}"
                );
                false
            }
        }
    }

    /// The values of a copy are the same alone and beside others.
    fn assert_copies_are_independent(&self, program: &Program) {
        let mut evaluator = Evaluator::new(program, COPIES);
        let together = evaluator.evaluate(self.table.view(), 0..COPIES).to_vec();
        for (copy, value) in together.iter().enumerate() {
            let alone = evaluator.evaluate(self.table.view(), copy..copy + 1)[0];
            let is_same = alone.to_bits() == value.to_bits() || alone.is_nan() && value.is_nan();
            assert!(is_same, "copy {copy}: {alone} alone, {value} beside others");
        }
    }
}

/// Overrides of a scenario of each kind.
struct Overrides {
    path: PathBuf,
    texts: Texts,
    training: Document<Scenario>,
    tabular: Document<TabularScenario>,
}

/// Overrides, such as `agents.count=16`.
pub(super) fn overrides(folder: &Path) -> Box<dyn Target> {
    let texts = [
        "agents.count=16",
        "agents.seeds=Normal(sigma: 0.1)",
        "algorithm.SeedPg.discount=0.5",
        "algorithm.policy_loss=Ppo(clip: 0.2, clipping: Joint)",
        "algorithm=QLearning(learning: (hidden: [8, 8], minibatch: 4))",
        "stop=Solved(return: 195, at_most: 500)",
        "stop.window=10",
        "recording.scene=None",
        "recording.axes=[Observations, Actions]",
        "schedule=Lockstep(learn_every: 5, steps_of: Team)",
        "environment=mistakes/parking_naive",
        "task=DeepSea(size: 5, move_cost: 0.1)",
        "task.BipolarChain.vertices=8",
        "agents.starts=OneByOne(mean_gap: 2)",
        "seed=18446744073709551615",
    ];
    Box::new(Overrides {
        path: folder.join("override"),
        texts: Texts::new(texts.map(str::to_owned)),
        training: document(r#"Scenario(environment: "cartpole")"#),
        tabular: document("TabularScenario(task: BipolarChain())"),
    })
}

fn document<T: serde::de::DeserializeOwned>(text: &str) -> Document<T> {
    seedbed_input::parse("scenario.ron", text.to_owned()).unwrap()
}

impl Target for Overrides {
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    fn generate(&mut self, random: &mut Stream) -> Vec<u8> {
        self.texts.mutated(random)
    }

    fn read(&mut self, input: &[u8]) -> bool {
        let text = String::from_utf8_lossy(input);
        let errors = [
            overrides::apply(&self.training, &text).err(),
            overrides::apply(&self.tabular, &text).err(),
        ];
        for error in errors.iter().flatten() {
            assert!(error.origin.starts_with("--set "), "{error}");
        }
        errors.iter().any(Option::is_none)
    }
}
