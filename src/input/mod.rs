//! Reading RON files: whatever is wrong with one is said with file, line, column, field, and what was expected.
//!
//! Syntax, types and ranges are checked while serde reads the file. What can only be checked afterwards (a name that no body
//! bears) is a [`Complaint`] about a [`Located`] value: the file is then read once more, up to that value, so that such an error
//! carries the same position and field path as any other. What the files mean may not enter.

mod explanation;
pub mod numbers;

use std::cell::RefCell;
use std::fmt;
use std::ops::Deref;
use std::path::{Path, PathBuf};

use explanation::{explain, suggestion};
use ron::extensions::Extensions;
use serde::de::{DeserializeOwned, Error as _, IgnoredAny};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// An error in what the user wrote. Displays as `file:line:column: in `field`: message`, the line itself, and a caret.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct InputError {
    /// The file, or another name for the origin of the text.
    pub origin: String,
    /// Line and column, both from 1, and the text of that line.
    pub position: Option<Position>,
    /// Path of the field, such as `bodies[0].mass`; empty for the whole file.
    pub field: String,
    /// What is wrong and what was expected.
    pub message: String,
    /// What the user may have meant.
    pub help: Option<String>,
}

/// A place in a text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Position {
    /// Counts from 1.
    pub line: usize,
    /// Counts characters from 1.
    pub column: usize,
    /// The whole line.
    pub text: String,
}

/// The text of a file together with what it says.
#[derive(Debug, Clone)]
pub struct Document<T> {
    /// The file, or another name for the origin of the text.
    pub origin: String,
    /// The text.
    pub text: String,
    /// What the text says.
    pub value: T,
}

/// A value that remembers where in its file it stands.
#[derive(Clone, Copy, Default)]
pub struct Located<T> {
    value: T,
    ordinal: Option<u32>,
}

/// Something wrong with a [`Located`] value, found after reading.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Complaint {
    ordinal: Option<u32>,
    message: String,
    help: Option<String>,
    /// Line and character within the value, both from 0.
    within: (usize, usize),
}

/// What the first word of a file says that it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// `Environment(…)`
    Environment,
    /// `TabularEnvironment(…)`
    TabularEnvironment,
    /// `Scenario(…)`
    Scenario,
    /// `TabularScenario(…)`
    TabularScenario,
    /// `Study(…)`
    Study,
}

/// Reads the RON file at `path`.
///
/// # Errors
/// The file cannot be read, or what it says is not a `T`.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<Document<T>, InputError> {
    parse(&path.display().to_string(), read_text(path)?)
}

/// Reads the text of the file at `path`.
///
/// # Errors
/// The file cannot be read.
pub fn read_text(path: &Path) -> Result<String, InputError> {
    let text =
        std::fs::read_to_string(path).map(|text| text.trim_start_matches('\u{feff}').to_owned());
    text.map_err(|error| InputError {
        origin: path.display().to_string(),
        position: None,
        field: String::new(),
        message: match error.kind() {
            std::io::ErrorKind::NotFound => "no such file".to_owned(),
            std::io::ErrorKind::IsADirectory => "this is a folder; expected a file".to_owned(),
            std::io::ErrorKind::InvalidData => "not a text file (invalid UTF-8)".to_owned(),
            _ => error.to_string(),
        },
        help: None,
    })
}

/// Parses RON `text`; `origin` stands in the place of the file's name in errors.
///
/// # Errors
/// What the text says is not a `T`.
pub fn parse<T: DeserializeOwned>(origin: &str, text: String) -> Result<Document<T>, InputError> {
    match deserialize(origin, &text, None) {
        Ok(value) => Ok(Document {
            origin: origin.to_owned(),
            text,
            value,
        }),
        Err(error) => Err(error),
    }
}

/// Whether `text` is one value in RON, of whatever type, and nothing more.
///
/// # Errors
/// Such as a bracket that is not closed.
pub fn is_a_value(text: &str) -> Result<(), String> {
    deserialize::<IgnoredAny>("", text, None)
        .map(|IgnoredAny| ())
        .map_err(|error| error.message)
}

/// Says what kind of file a text is by its first word.
///
/// # Errors
/// The text opens with something else.
pub fn kind(origin: &str, text: &str) -> Result<Kind, InputError> {
    let opening = first_word(text);
    match opening {
        "Environment" => Ok(Kind::Environment),
        "TabularEnvironment" => Ok(Kind::TabularEnvironment),
        "Scenario" => Ok(Kind::Scenario),
        "TabularScenario" => Ok(Kind::TabularScenario),
        "Study" => Ok(Kind::Study),
        word => {
            let offset = word.as_ptr() as usize - text.as_ptr() as usize;
            let before = &text[..offset];
            let line = before.matches('\n').count() + 1;
            let column = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
            let opening = text[offset..].split_whitespace().next().unwrap_or_default();
            let shown: String = opening
                .chars()
                .take(40)
                .flat_map(char::escape_debug)
                .collect();
            let found = if opening.is_empty() {
                "is empty".to_owned()
            } else {
                format!("opens with `{shown}`")
            };
            Err(InputError {
                origin: origin.to_owned(),
                position: (!opening.is_empty()).then(|| position(text, line, column)),
                field: String::new(),
                message: format!(
                    "a file opens with its kind, `Environment(`, `TabularEnvironment(`, `Scenario(`, `TabularScenario(` or `Study(`, but this one {found}"
                ),
                help: suggestion(
                    word,
                    [
                        "Environment",
                        "TabularEnvironment",
                        "Scenario",
                        "TabularScenario",
                        "Study",
                    ],
                ),
            })
        }
    }
}

/// The name among `valid` that is nearest to `found`, if one is near enough to be meant.
#[must_use]
pub fn nearest<'a>(found: &str, valid: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    valid
        .into_iter()
        .map(|name| {
            (
                strsim::damerau_levenshtein(&found.to_lowercase(), &name.to_lowercase()),
                name,
            )
        })
        .filter(|&(distance, name)| {
            distance <= 1 + name.chars().count().min(found.chars().count()) / 4
        })
        .min_by_key(|&(distance, _)| distance)
        .map(|(_, name)| name)
}

/// `` `a`, `b`, `c` ``
#[must_use]
pub fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    names
        .into_iter()
        .map(|name| format!("`{name}`"))
        .collect::<Vec<_>>()
        .join(", ")
}

impl<T> Document<T> {
    /// Turns a complaint about a value of this document into an error with its position.
    #[must_use]
    pub fn locate(&self, complaint: Complaint) -> InputError
    where
        T: DeserializeOwned,
    {
        let help = complaint.help.clone();
        let message = complaint.message.clone();
        let within = complaint.within;
        match deserialize::<T>(&self.origin, &self.text, Some(complaint)) {
            Err(error) => InputError {
                help,
                position: error.position.map(|place| place.moved(within, &self.text)),
                ..error
            },
            // A value that was filled in by a default stands nowhere in the text.
            Ok(_) => InputError {
                origin: self.origin.clone(),
                position: None,
                field: String::new(),
                message,
                help,
            },
        }
    }
}

impl<T> Located<T> {
    /// Complains about this value.
    #[must_use]
    pub fn complain(&self, message: impl Into<String>) -> Complaint {
        Complaint {
            ordinal: self.ordinal,
            message: message.into(),
            help: None,
            within: (0, 0),
        }
    }

    /// The value itself.
    #[must_use]
    pub fn value(&self) -> &T {
        &self.value
    }
}

impl<T: AsRef<str>> Located<T> {
    /// Complains that this value names no `what`; lists the `valid` names and suggests the nearest.
    #[must_use]
    pub fn complain_unknown<'a>(
        &self,
        what: &str,
        valid: impl IntoIterator<Item = &'a str> + Clone,
    ) -> Complaint {
        let found = self.value.as_ref();
        let names = listed(valid.clone());
        let expected = if names.is_empty() {
            "there is none".to_owned()
        } else {
            format!("expected one of {names}")
        };
        Complaint {
            ordinal: self.ordinal,
            message: format!("no {what} is named `{found}`, {expected}"),
            help: suggestion(found, valid),
            within: (0, 0),
        }
    }
}

impl Complaint {
    /// The same complaint about one character of a text: `line` and `column` within it count from 0.
    #[must_use]
    pub fn at(mut self, line: usize, column: usize) -> Self {
        self.within = (line, column);
        self
    }

    /// The same complaint with a hint.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl Position {
    /// The place of a character within the string whose text begins here. In a string with escapes it cannot be told.
    fn moved(self, (line, column): (usize, usize), text: &str) -> Self {
        let before: String = self.text.chars().take(self.column - 1).collect();
        let raw = before.ends_with("r\"") || before.ends_with("#\"");
        if !before.ends_with('"') || (!raw && self.text.contains('\\')) {
            return self;
        }
        match line {
            0 => Self {
                column: self.column + column,
                ..self
            },
            _ => position(text, self.line + line, column + 1),
        }
    }
}

impl<T> Deref for Located<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> From<T> for Located<T> {
    fn from(value: T) -> Self {
        Self {
            value,
            ordinal: None,
        }
    }
}

impl<T: fmt::Debug> fmt::Debug for Located<T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.value.fmt(formatter)
    }
}

impl<T: PartialEq> PartialEq for Located<T> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<T: Serialize> Serialize for Located<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.value.serialize(serializer)
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Located<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = T::deserialize(deserializer)?;
        let ordinal = READING.with_borrow_mut(|reading| {
            let Some(reading) = reading else {
                return Ok(None);
            };
            let ordinal = reading.next;
            reading.next += 1;
            match reading
                .complaint
                .take_if(|complaint| complaint.ordinal == Some(ordinal))
            {
                Some(complaint) => Err(complaint.message),
                None => Ok(Some(ordinal)),
            }
        });
        Ok(Self {
            value,
            ordinal: ordinal.map_err(D::Error::custom)?,
        })
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}", self.origin)?;
        if let Some(position) = &self.position {
            write!(formatter, ":{}:{}", position.line, position.column)?;
        }
        if !self.field.is_empty() {
            write!(formatter, ": in `{}`", self.field)?;
        }
        write!(formatter, ": {}", self.message)?;
        if let Some(position) = &self.position {
            let (lead, shown) = excerpt(position);
            write!(
                formatter,
                "\n  | {}\n  | {}^",
                shown.trim_end(),
                " ".repeat(lead)
            )?;
        }
        if let Some(help) = &self.help {
            write!(formatter, "\n  = help: {help}")?;
        }
        Ok(())
    }
}

thread_local! {
    static READING: RefCell<Option<Reading>> = const { RefCell::new(None) };
}

/// Numbers the located values of the text that is being read, and stops at the one that is complained about.
struct Reading {
    next: u32,
    complaint: Option<Complaint>,
}

fn deserialize<T: DeserializeOwned>(
    origin: &str,
    text: &str,
    complaint: Option<Complaint>,
) -> Result<T, InputError> {
    let outer = READING.replace(Some(Reading { next: 0, complaint }));
    let result = deserialize_tracked(origin, text);
    READING.set(outer);
    result
}

fn deserialize_tracked<T: DeserializeOwned>(origin: &str, text: &str) -> Result<T, InputError> {
    let options = ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES);
    let located = |spanned: &ron::error::SpannedError, field: String| {
        located_error(origin, text, spanned, field)
    };
    let mut deserializer = ron::Deserializer::from_str_with_options(text, &options)
        .map_err(|spanned| located(&spanned, String::new()))?;
    let value = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let field = field_path(error.path());
        located(&deserializer.span_error(error.into_inner()), field)
    })?;
    deserializer
        .end()
        .map_err(|error| located(&deserializer.span_error(error), String::new()))?;
    Ok(value)
}

/// Such as `bodies[0].mass`.
fn field_path(path: &serde_path_to_error::Path) -> String {
    use serde_path_to_error::Segment;
    let segments = path.iter().filter_map(|segment| match segment {
        Segment::Seq { index } => Some(format!("[{index}]")),
        Segment::Map { key } | Segment::Enum { variant: key } => Some(format!(".{key}")),
        Segment::Unknown => None,
    });
    segments
        .collect::<String>()
        .trim_start_matches('.')
        .to_owned()
}

fn located_error(
    origin: &str,
    text: &str,
    spanned: &ron::error::SpannedError,
    field: String,
) -> InputError {
    let position = position(text, spanned.span.start.line, spanned.span.start.col);
    let (message, help) = explain(&spanned.code, &position);
    InputError {
        origin: origin.to_owned(),
        position: Some(position),
        field,
        message,
        help,
    }
}

/// Points at the first character from `column` on that is not a space: the parser may stop before one.
fn position(text: &str, line: usize, column: usize) -> Position {
    let text = text.lines().nth(line.saturating_sub(1)).unwrap_or_default();
    let spaces = text
        .chars()
        .skip(column.saturating_sub(1))
        .take_while(|c| c.is_whitespace())
        .count();
    let column = if column - 1 + spaces < text.chars().count() {
        column + spaces
    } else {
        column
    };
    Position {
        line,
        column,
        text: text.to_owned(),
    }
}

/// Where the caret goes, and the line, shortened around it where it is long.
fn excerpt(position: &Position) -> (usize, String) {
    const WIDTH: usize = 100;
    let lead = position.column.saturating_sub(1);
    let start = lead.saturating_sub(WIDTH / 2);
    let shown = position
        .text
        .chars()
        .skip(start)
        .take(WIDTH)
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    (lead - start, shown)
}

fn first_word(text: &str) -> &str {
    let mut rest = text.trim_start();
    loop {
        let skipped = if let Some(comment) = rest.strip_prefix("//") {
            comment.find('\n').map_or("", |end| &comment[end..])
        } else if let Some(comment) = rest.strip_prefix("/*") {
            comment.find("*/").map_or("", |end| &comment[end + 2..])
        } else if let Some(attribute) = rest.strip_prefix("#!") {
            attribute.find(']').map_or("", |end| &attribute[end + 1..])
        } else {
            break;
        };
        rest = skipped.trim_start();
    }
    let end = rest
        .find(|c: char| !c.is_alphanumeric() && c != '_')
        .unwrap_or(rest.len());
    &rest[..end]
}

/// The folders named `folder` under `start` and its ancestors, nearest first.
#[must_use]
pub fn folders_upwards(start: &Path, folder: &str) -> Vec<PathBuf> {
    start
        .ancestors()
        .map(|ancestor| ancestor.join(folder))
        .filter(|path| path.is_dir())
        .collect()
}

/// The path of the nearest existing file named `name` under a folder `folder` of `start` or of one of its ancestors.
#[must_use]
pub fn find_upwards(start: &Path, folder: &str, name: &str) -> Option<PathBuf> {
    start
        .ancestors()
        .map(|ancestor| ancestor.join(folder).join(name))
        .find(|path| path.is_file())
}
