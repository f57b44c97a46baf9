//! Names of other libraries, and the fields of scenarios that are meant.
//!
//! A name such as `lr` is answered with assignments that the scenario accepts: they depend on its
//! algorithm. `--set`, scenario files, studies and options of the command line use the same table.

mod ron_fields;
mod table;

use seedbed_input::{Document, InputError};

use self::table::{ALGORITHMS, FIELDS, Synonym};
use super::Scenario;
use super::resolve::{Resolve, apply_value, opening_of};
use crate::input_files::{self, Directory};

/// What a name of another library is here.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Suggestion {
    /// The name, as it was given.
    name: String,
    /// What it is here.
    meaning: &'static str,
    /// Assignments such as `agents.count=16`, which the scenario accepts; none if there is no such
    /// field.
    pub assignments: Vec<String>,
}

impl Suggestion {
    /// Help with assignments, for `--set` and `set` in studies.
    #[must_use]
    pub fn help(&self) -> String {
        self.help_with(self.assignments.iter().map(|set| format!("`{set}`")))
    }

    /// Help with options of the command line, in quotes if a shell needs them.
    #[must_use]
    pub fn help_with_options(&self) -> String {
        let options = self.assignments.iter().map(|set| {
            let needs_quotes = set.contains(['(', ' ', '[', '"']);
            let quote = if needs_quotes { "'" } else { "" };
            format!("--set {quote}{set}{quote}")
        });
        let options: Vec<String> = options.collect();
        let all = (!options.is_empty()).then(|| format!("`{}`", options.join(" ")));
        self.help_with(all.into_iter())
    }

    /// Help with the field `set` of a study.
    #[must_use]
    pub fn help_in_study(&self) -> String {
        let list = self.assignments.iter().map(|set| format!("{set:?}"));
        let list: Vec<String> = list.collect();
        let field = (!list.is_empty()).then(|| format!("`set: [{}]`", list.join(", ")));
        self.help_with(field.into_iter())
    }

    /// Help with the field of a file.
    fn help_with_fields<T: Resolve>(&self, document: &Document<T>) -> String {
        let fields = ron_fields::nested(&self.assignments, |path| opening_of(document, path));
        self.help_with(
            (!fields.is_empty())
                .then(|| format!("`{fields}`"))
                .into_iter(),
        )
    }

    /// Whether all assignments are about the field `path` or fields of its value, and have another
    /// value.
    fn is_about(&self, path: &str, value: &str) -> bool {
        let is_field = |name: &&str| !name.starts_with(char::is_uppercase);
        let path: Vec<&str> = path.split('.').filter(is_field).collect();
        let path = path.join(".");
        let is_about = |assignment: &String| {
            let rest = assignment.strip_prefix(&path);
            rest.is_some_and(|rest| rest.starts_with(['=', '.']) && rest != format!("={value}"))
        };
        !self.assignments.is_empty() && self.assignments.iter().all(is_about)
    }

    /// Whether it is what the algorithm is called here: something else is wrong.
    fn is_name_of_algorithm(&self) -> bool {
        let mut values = self
            .assignments
            .iter()
            .filter_map(|set| set.split_once('='));
        values.any(|(_, value)| first_word(value) == self.name)
    }

    fn help_with(&self, written: impl Iterator<Item = String>) -> String {
        let written: Vec<String> = written.collect();
        let meaning = format!("`{}`: {}", self.name, self.meaning);
        if written.is_empty() {
            return meaning;
        }
        format!("{meaning}; write {}", written.join(" and "))
    }
}

/// What `path` is here, if its last name, or the algorithm in `value`, is a name of other libraries.
/// `value` may be empty.
#[must_use]
pub fn suggest<T: Resolve>(document: &Document<T>, path: &str, value: &str) -> Option<Suggestion> {
    let name = path.rsplit('.').next().unwrap_or(path);
    if let Some(steps) = steps_to_stop_after(name, value) {
        return Some(accepted(document, find(FIELDS, STEPS)?, name, steps));
    }
    let synonym = find(FIELDS, name);
    let names_algorithm = simplified(name) == "algorithm"
        || synonym.is_some_and(|synonym| synonym.forms == table::ALGORITHM);
    let is_field = opening_of(document, path).is_some();
    if names_algorithm && let Some(algorithm) = find(ALGORITHMS, first_word(value)) {
        let suggestion = accepted(document, algorithm, first_word(value), "");
        return (!suggestion.is_name_of_algorithm()).then_some(suggestion);
    }
    if names_algorithm && is_field {
        return None;
    }
    let suggestion = accepted(document, synonym?, name, value);
    // A field may have the name that another one has elsewhere.
    (!is_field || suggestion.is_about(path, value)).then_some(suggestion)
}

/// The name in [`FIELDS`] of the number of steps after which a run ends.
const STEPS: &str = "total_timesteps";

/// The number in a value of `stop` such as `Steps(1000)`, `EnvSteps(1000)` or `Steps(team: 1000)`.
fn steps_to_stop_after<'a>(name: &str, value: &'a str) -> Option<&'a str> {
    let (variant, rest) = value.split_once('(')?;
    let is_steps = name == "stop" && simplified(variant).ends_with("steps");
    let number = rest.trim_end().strip_suffix(')')?.trim();
    let number = number.strip_prefix("team:").unwrap_or(number).trim();
    (is_steps && number.chars().all(|c| c.is_ascii_digit())).then_some(number)
}

/// The word after `algorithm:` in the text of a scenario; empty if there is none.
pub(super) fn algorithm_in(text: &str) -> &str {
    let value = text.split_once("algorithm:").map_or("", |(_, value)| value);
    let value = value.trim_start();
    let end = value.find(|c: char| !c.is_alphanumeric());
    &value[..end.unwrap_or(value.len())]
}

/// The error of reading a file of the kind `T`, with help if a name is one of other libraries.
#[must_use]
pub fn explain<T: Resolve>(text: &str, error: InputError) -> InputError {
    let Some(mistake) = Mistake::of(&error) else {
        return error;
    };
    let is_name = error.unexpected_field().is_some();
    let is_of_another_kind = VALUES_OF_ANOTHER_KIND
        .iter()
        .any(|message| error.message.starts_with(message));
    if !is_name && (error.help.is_some() || !is_of_another_kind) {
        return error;
    }
    let suggestion = T::like(text).and_then(|document| {
        let suggestion = suggest(&document, &mistake.path, &mistake.value)?;
        let says_enough = !suggestion.assignments.is_empty() || error.help.is_none();
        says_enough.then(|| suggestion.help_with_fields(&document))
    });
    with_help(error, suggestion)
}

/// Beginnings of messages about a value that is not of the field's kind.
const VALUES_OF_ANOTHER_KIND: [&str; 4] = [
    "expected fields in parentheses",
    "expected the name of a field or of a variant",
    "expected opening",
    "unexpected variant",
];

/// The error of reading a study or a search for parameters, with help if a name is a field of
/// scenarios in other libraries.
#[must_use]
pub fn explain_in_study(error: InputError) -> InputError {
    let mistake = Mistake::of(&error).filter(|_| error.unexpected_field().is_some());
    let suggestion = mistake.and_then(|mistake| {
        let name = mistake.path.rsplit('.').next()?;
        let suggestion = suggest(&Scenario::like("")?, name, &mistake.value)?;
        Some(suggestion.help_in_study())
    });
    with_help(error, suggestion)
}

fn with_help(error: InputError, suggestion: Option<String>) -> InputError {
    InputError {
        help: suggestion.or(error.help),
        ..error
    }
}

/// A name or a value that a file cannot have.
struct Mistake {
    path: String,
    /// The value on the same line; may be empty.
    value: String,
}

impl Mistake {
    fn of(error: &InputError) -> Option<Self> {
        let at = error.position.as_ref()?;
        let rest: String = at.text.chars().skip(at.column.saturating_sub(1)).collect();
        let value = match error.unexpected_field() {
            Some(name) => {
                let after = rest.split_once(name).map_or("", |(_, after)| after);
                after.trim_start().strip_prefix(':').unwrap_or_default()
            }
            None => &rest,
        };
        Some(Self {
            path: error.field.clone(),
            value: ron_fields::first_value(value).to_owned(),
        })
    }
}

fn find(synonyms: &'static [Synonym], name: &str) -> Option<&'static Synonym> {
    let name = simplified(name);
    synonyms
        .iter()
        .find(|synonym| synonym.names.contains(&name.as_str()))
}

/// The name in lower case, without `_`, `-` and quotes.
fn simplified(name: &str) -> String {
    let kept = name.chars().filter(|c| c.is_alphanumeric());
    kept.flat_map(char::to_lowercase).collect()
}

/// The name of a variant with fields, or a text without its quotes.
fn first_word(value: &str) -> &str {
    let word = value.split('(').next().unwrap_or_default();
    word.trim().trim_matches(['"', '\''])
}

/// The first form that the scenario accepts, with the given value if it fits.
fn accepted<T: Resolve>(
    document: &Document<T>,
    synonym: &'static Synonym,
    name: &str,
    value: &str,
) -> Suggestion {
    let given = (!value.is_empty()).then(|| meant_value(synonym, value));
    let values = given
        .into_iter()
        .flatten()
        .chain([synonym.example.to_owned()]);
    let candidates = values.flat_map(|value| {
        let forms = synonym.forms.iter();
        forms.map(move |form| form.iter().map(|set| set.replace("{}", &value)).collect())
    });
    let mut candidates = candidates;
    let assignments: Option<Vec<String>> =
        candidates.find(|assignments: &Vec<String>| are_accepted(document, assignments));
    Suggestion {
        name: name.to_owned(),
        meaning: synonym.meaning,
        assignments: assignments.unwrap_or_default(),
    }
}

/// The value in the words of this program; none if it means nothing here.
fn meant_value(synonym: &Synonym, value: &str) -> Option<String> {
    if synonym.forms != table::ENVIRONMENT {
        return Some(value.to_owned());
    }
    let name = value.trim_matches(['"', '\'']);
    if seedbed_input::without_version(name).is_some() && !name.contains('"') {
        return Some(format!("Gymnasium(id: \"{name}\")"));
    }
    match input_files::find(name, Directory::Environments, &[]) {
        Ok(_) => Some(name.to_owned()),
        Err(known) => {
            seedbed_input::nearest_name(name, known.iter().map(String::as_str)).map(str::to_owned)
        }
    }
}

fn are_accepted<T: Resolve>(document: &Document<T>, assignments: &[String]) -> bool {
    let mut changed = document.clone();
    for assignment in assignments {
        match apply_value(&changed, assignment) {
            Ok(applied) => changed = applied,
            Err(_) => return false,
        }
    }
    changed.value.check().is_ok()
}

#[cfg(test)]
mod tests;
