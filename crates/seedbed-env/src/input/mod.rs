//! Reading RON files with located errors: file, line, column, field, and what was expected.
//!
//! Syntax, types and ranges are checked while serde reads a file. What can only be checked
//! afterwards (a name that refers to nothing) is a [`ValidationError`] about a [`Located`] value,
//! which [`Document::locate`] turns into an error of the same form. This module must not depend on
//! what the files mean.
//!
//! # How a value remembers its place
//!
//! RON's deserializer does not pass positions on to values. But it reads the values of a text in
//! the same order each time, so that a value is identified by its *ordinal*: the number of
//! [`Located`] values that were read before it. `Located::deserialize` counts them in a
//! thread-local counter, because serde passes it only the deserializer. To locate a validation
//! error, the text is deserialized again; the value with the error's ordinal then fails with the
//! error's message, and the deserializer reports that failure with position and field path like any
//! other. Unless there is an error, the only cost is the ordinal that each value stores.

pub mod edit;
mod explanation;
pub mod numbers;

use std::borrow::Cow;
use std::cell::RefCell;
use std::fmt;
use std::ops::Deref;
use std::path::{Path, PathBuf};

use explanation::{explain, suggestion};
use ron::extensions::Extensions;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{DeserializeOwned, Error as _, IgnoredAny};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// An error in a file that the user wrote. It is displayed as `file:line:column: in `field`:
/// message`, followed by the line itself and a caret.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct InputError {
    /// The file, or another name for the origin of the text.
    pub origin: String,
    /// Place of the error; `None` if it concerns the whole file.
    pub position: Option<Position>,
    /// Path of the field, for example `bodies[0].mass`; empty for the whole file.
    pub field: String,
    /// What is wrong and what was expected.
    pub message: String,
    /// What to do, or what the user may have meant.
    pub help: Option<String>,
}

/// A place in a text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Position {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// Text of the line.
    pub text: String,
}

/// The text of a file together with the value that was read from it.
#[derive(Debug, Clone)]
pub struct Document<T> {
    /// The file, or another name for the origin of the text.
    pub origin: String,
    /// Text of the file.
    pub text: String,
    /// The value.
    pub value: T,
}

/// A value that remembers its place in its file.
#[derive(Clone, Copy, Default)]
pub struct Located<T> {
    value: T,
    ordinal: Option<u32>,
}

impl<T: JsonSchema> JsonSchema for Located<T> {
    fn inline_schema() -> bool {
        T::inline_schema()
    }

    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::json_schema(generator)
    }
}

/// An error about a [`Located`] value that is found after reading.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ValidationError {
    ordinal: Option<u32>,
    message: String,
    help: Option<String>,
    /// Line and column within the value, both from 0.
    within: (usize, usize),
}

/// The kind of a file, which its first word names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
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

impl FileKind {
    /// All kinds.
    const ALL: [Self; 5] = [
        Self::Environment,
        Self::TabularEnvironment,
        Self::Scenario,
        Self::TabularScenario,
        Self::Study,
    ];

    /// The word with which files of this kind begin.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Environment => "Environment",
            Self::TabularEnvironment => "TabularEnvironment",
            Self::Scenario => "Scenario",
            Self::TabularScenario => "TabularScenario",
            Self::Study => "Study",
        }
    }
}

/// Reads the RON file at `path`.
///
/// # Errors
/// The file cannot be read, or is not a `T`.
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
            std::io::ErrorKind::IsADirectory => "expected a file, found a folder".to_owned(),
            std::io::ErrorKind::InvalidData => {
                "expected a text file, found invalid UTF-8".to_owned()
            }
            _ => error.to_string(),
        },
        help: None,
    })
}

/// Parses RON `text`; errors show `origin` in place of a file name.
///
/// # Errors
/// The text is not a `T`.
pub fn parse<T: DeserializeOwned>(origin: &str, text: String) -> Result<Document<T>, InputError> {
    let value = deserialize(origin, &text, None)?;
    Ok(Document {
        origin: origin.to_owned(),
        text,
        value,
    })
}

/// Checks that `text` is a single RON value, of any type.
///
/// # Errors
/// The message of the syntax error.
pub fn check_ron_value(text: &str) -> Result<(), String> {
    deserialize::<IgnoredAny>("", text, None)
        .map(|IgnoredAny| ())
        .map_err(|error| error.message)
}

/// The kind of a file, which the first word of its text names.
///
/// # Errors
/// The text begins with something else.
pub fn file_kind(origin: &str, text: &str) -> Result<FileKind, InputError> {
    let word = first_word(text);
    if let Some(kind) = FileKind::ALL.into_iter().find(|kind| kind.name() == word) {
        return Ok(kind);
    }
    let offset = offset_of(word, text);
    let begins_with = text[offset..].split_whitespace().next();
    let found = match begins_with {
        None => "it is empty".to_owned(),
        Some(opening) => {
            let shown: String = opening
                .chars()
                .take(40)
                .flat_map(char::escape_debug)
                .collect();
            format!("it begins with `{shown}`")
        }
    };
    let kinds = FileKind::ALL.map(|kind| format!("`{}(`", kind.name()));
    let message = format!(
        "expected a file that begins with {}, but {found}",
        one_of(&kinds)
    );
    let help = suggestion(word, FileKind::ALL.map(FileKind::name));
    let mut error = error_at(origin, text, offset, "", message, help);
    if begins_with.is_none() {
        error.position = None;
    }
    Err(error)
}

/// An error about the character of a text that begins at the byte `offset`.
pub(crate) fn error_at(
    origin: &str,
    text: &str,
    offset: usize,
    field: &str,
    message: String,
    help: Option<String>,
) -> InputError {
    let before = &text[..offset];
    let line = before.matches('\n').count() + 1;
    let column = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
    InputError {
        origin: origin.to_owned(),
        position: Some(position(text, line, column)),
        field: field.to_owned(),
        message,
        help,
    }
}

/// The names as a list in words, `a, b or c`, without adding quotes.
fn one_of(names: &[String]) -> String {
    match names {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        _ => names.concat(),
    }
}

/// The byte offset of `part`, which is a slice of `text`.
fn offset_of(part: &str, text: &str) -> usize {
    part.as_ptr() as usize - text.as_ptr() as usize
}

/// The byte offset behind the word that names the kind of a file.
pub(crate) fn after_first_word(text: &str) -> usize {
    let word = first_word(text);
    offset_of(word, text) + word.len()
}

/// The name among `valid` that is most similar to `found`, if one is similar enough to be meant.
#[must_use]
pub fn nearest_name<'a>(found: &str, valid: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
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

/// The names in backquotes, separated by commas.
#[must_use]
pub fn quoted_list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    names
        .into_iter()
        .map(|name| format!("`{name}`"))
        .collect::<Vec<_>>()
        .join(", ")
}

impl<T> Document<T> {
    /// Turns an error about a value of this document into one with its position and field.
    #[must_use]
    pub fn locate(&self, error: ValidationError) -> InputError
    where
        T: DeserializeOwned,
    {
        let help = error.help.clone();
        let message = error.message.clone();
        let within = error.within;
        match deserialize::<T>(&self.origin, &self.text, Some(error)) {
            Err(error) => InputError {
                help,
                position: error.position.map(|place| place.moved(within, &self.text)),
                ..error
            },
            // A default value has no place in the text.
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
    /// An error about this value.
    #[must_use]
    pub fn error(&self, message: impl Into<String>) -> ValidationError {
        ValidationError {
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
    /// The error that this value names no `what`. It lists the `valid` names and
    /// suggests the most similar one.
    #[must_use]
    pub fn unknown_name<'a>(
        &self,
        what: &str,
        valid: impl IntoIterator<Item = &'a str> + Clone,
    ) -> ValidationError {
        let found = self.value.as_ref();
        let names = quoted_list(valid.clone());
        let expected = if names.is_empty() {
            "there are none".to_owned()
        } else {
            format!("expected one of {names}")
        };
        ValidationError {
            ordinal: self.ordinal,
            message: format!("no {what} is named `{found}`, {expected}"),
            help: suggestion(found, valid),
            within: (0, 0),
        }
    }
}

impl ValidationError {
    /// The same error about one character of the value, which is a string: `line` and `column`
    /// within it count from 0.
    #[must_use]
    pub fn at(mut self, line: usize, column: usize) -> Self {
        self.within = (line, column);
        self
    }

    /// The same error with a hint.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl Position {
    /// The place of a character within the string that begins here. In a string with escapes, whose
    /// characters are not those of the file, the place remains the beginning of the string.
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
        let ordinal = COUNTER.with_borrow_mut(|counter| {
            // The value is not read by this module, but for example from a checkpoint.
            let Some(counter) = counter else {
                return Ok(None);
            };
            let ordinal = counter.next;
            counter.next += 1;
            match counter
                .error
                .take_if(|error| error.ordinal == Some(ordinal))
            {
                Some(error) => Err(error.message),
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
    static COUNTER: RefCell<Option<OrdinalCounter>> = const { RefCell::new(None) };
}

/// Counts the located values of the text that is being read, and fails at the one with an error.
struct OrdinalCounter {
    next: u32,
    error: Option<ValidationError>,
}

fn deserialize<T: DeserializeOwned>(
    origin: &str,
    text: &str,
    error: Option<ValidationError>,
) -> Result<T, InputError> {
    // A type's `Deserialize` may read another text, so that the outer counter is put back.
    let outer = COUNTER.replace(Some(OrdinalCounter { next: 0, error }));
    let result = deserialize_tracked(origin, text);
    COUNTER.set(outer);
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

/// For example `bodies[0].mass`.
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

/// The place of the first character from `column` on that is not a space: the parser may stop
/// before a space.
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

/// The column of the caret, and the line, shortened around it if it is long.
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

/// The first word behind comments and attributes. It is a slice of `text`, even if it is empty.
fn first_word(text: &str) -> &str {
    let mut rest = text.trim_start();
    loop {
        let skipped = if let Some(comment) = rest.strip_prefix("//") {
            &comment[comment.find('\n').unwrap_or(comment.len())..]
        } else if let Some(comment) = rest.strip_prefix("/*") {
            &comment[comment.find("*/").map_or(comment.len(), |end| end + 2)..]
        } else if let Some(attribute) = rest.strip_prefix("#!") {
            &attribute[attribute.find(']').map_or(attribute.len(), |end| end + 1)..]
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

/// The folders named `folder` in `start` and its ancestors, nearest first.
#[must_use]
pub fn folders_upwards(start: &Path, folder: &str) -> Vec<PathBuf> {
    start
        .ancestors()
        .map(|ancestor| ancestor.join(folder))
        .filter(|path| path.is_dir())
        .collect()
}

/// The path of the nearest file `folder/name` in `start` or one of its ancestors.
#[must_use]
pub fn find_upwards(start: &Path, folder: &str, name: &str) -> Option<PathBuf> {
    start
        .ancestors()
        .map(|ancestor| ancestor.join(folder).join(name))
        .find(|path| path.is_file())
}

#[cfg(test)]
mod tests {
    use super::numbers::{Count, Fraction};
    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Team {
        name: Located<String>,
        members: Vec<Member>,
        #[serde(default)]
        captain: Located<String>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code, reason = "read from a file only to fail there")]
    struct Member {
        name: Located<String>,
        #[serde(default)]
        role: Role,
    }

    #[derive(Debug, Default, Deserialize)]
    #[allow(dead_code, reason = "read from a file only to fail there")]
    enum Role {
        #[default]
        Player,
        Coach {
            share: Fraction,
        },
        Reserve(Count<10>),
    }

    const TEXT: &str = r#"// A team.
Team(
    name: "reds",
    members: [
        (name: "ann"),
        (name: "bob", role: Coach(share: 0.5)), (name: "cat", role: Reserve(3)),
    ],
    captain: "bop",
)"#;

    fn team() -> Document<Team> {
        parse("team.ron", TEXT.to_owned()).unwrap()
    }

    /// Line, column, field and message of the error of a text that is not a team.
    fn error(text: &str) -> (usize, usize, String, String) {
        let error = parse::<Team>("team.ron", text.to_owned()).unwrap_err();
        let position = error.position.expect("it has a place");
        (position.line, position.column, error.field, error.message)
    }

    #[test]
    fn a_validation_error_has_the_place_and_the_field_of_its_value() {
        let team = team();
        let member = &team.value.members[2].name;
        let error = team.locate(member.error("is a cat"));
        let position = error.position.as_ref().unwrap();
        assert_eq!((position.line, position.column), (6, 57));
        assert_eq!(error.field, "members[2].name");
        let line =
            "        (name: \"bob\", role: Coach(share: 0.5)), (name: \"cat\", role: Reserve(3)),";
        assert_eq!(position.text, line);
        assert_eq!(
            error.to_string().lines().next(),
            Some("team.ron:6:57: in `members[2].name`: is a cat")
        );
    }

    /// Errors with the same message about different values point at different lines.
    #[test]
    fn each_located_value_has_an_ordinal_of_its_own() {
        let team = team();
        let lines = [
            &team.value.name,
            &team.value.members[0].name,
            &team.value.members[1].name,
            &team.value.captain,
        ]
        .map(|value| team.locate(value.error("")).position.unwrap().line);
        assert_eq!(lines, [3, 5, 6, 8]);
    }

    #[test]
    fn a_default_value_has_no_place() {
        let text = "(name: \"reds\", members: [])".to_owned();
        let team = parse::<Team>("team.ron", text).unwrap();
        let error = team.locate(team.value.captain.error("is missing"));
        assert_eq!(error.position, None);
        assert_eq!(error.to_string(), "team.ron: is missing");
    }

    #[test]
    fn an_unknown_name_lists_the_known_ones_and_suggests_the_nearest() {
        let team = team();
        let names = team.value.members.iter();
        let names: Vec<_> = names.map(|member| member.name.as_str()).collect();
        let error = team.locate(team.value.captain.unknown_name("member", names));
        assert_eq!(error.field, "captain");
        assert_eq!(
            error.message,
            "no member is named `bop`, expected one of `ann`, `bob`, `cat`"
        );
        assert_eq!(error.help.as_deref(), Some("did you mean `bob`?"));
        let none = team.value.captain.unknown_name("trainer", []);
        assert_eq!(none.message, "no trainer is named `bop`, there are none");
        assert_eq!(none.help, None);
    }

    #[test]
    fn a_name_that_is_too_different_is_not_suggested() {
        assert_eq!(nearest_name("tehta", ["x", "theta"]), Some("theta"));
        assert_eq!(nearest_name("Slide", ["slide"]), Some("slide"));
        assert_eq!(nearest_name("push", ["torque", "x"]), None);
    }

    #[test]
    fn errors_within_a_string_point_at_the_character() {
        let text = "(name: \"one\n  two\", members: [])".to_owned();
        let team = parse::<Team>("team.ron", text).unwrap();
        let place = |line, column| {
            let error = team.value.name.error("here").at(line, column);
            let position = team.locate(error).position.unwrap();
            (position.line, position.column)
        };
        assert_eq!(place(0, 2), (1, 11));
        assert_eq!(place(1, 2), (2, 3));
    }

    #[test]
    fn nested_fields_and_ranges_are_in_the_path_of_an_error() {
        let wrong_share = TEXT.replace("0.5", "1.5");
        assert_eq!(
            error(&wrong_share),
            (
                6,
                42,
                "members[1].role.Coach.share".to_owned(),
                "expected a number from 0 to 1, found 1.5".to_owned()
            )
        );
        let wrong_count = TEXT.replace("Reserve(3)", "Reserve(11)");
        let (line, _, field, message) = error(&wrong_count);
        assert_eq!((line, field.as_str()), (6, "members[2].role.Reserve"));
        assert_eq!(message, "expected a whole number from 1 to 10, found 11");
        let unknown_field = TEXT.replace("captain", "capitan");
        let (line, _, field, message) = error(&unknown_field);
        assert_eq!((line, field.as_str()), (8, "capitan"));
        assert_eq!(
            message,
            "unexpected field `capitan`, expected one of `name`, `members`, `captain`"
        );
    }

    /// A type may read a text of its own while it is read.
    #[test]
    fn reading_a_text_within_another_keeps_the_ordinals() {
        #[derive(Deserialize)]
        #[serde(try_from = "String")]
        struct Inner;
        impl TryFrom<String> for Inner {
            type Error = String;
            fn try_from(text: String) -> Result<Self, String> {
                let team = parse::<Team>("inner", text).map_err(|error| error.message)?;
                assert_eq!(team.value.members.len(), 0);
                Ok(Self)
            }
        }
        #[derive(Deserialize)]
        struct Outer {
            _inner: Inner,
            last: Located<u32>,
        }
        let text = "(_inner: \"(name: \\\"a\\\", members: [])\",\nlast: 3)".to_owned();
        let outer = parse::<Outer>("outer", text).unwrap();
        let error = outer.locate(outer.value.last.error("here"));
        assert_eq!(
            (error.field.as_str(), error.position.unwrap().line),
            ("last", 2)
        );
    }

    #[test]
    fn the_kind_of_a_file_is_its_first_word() {
        let kind = |text: &str| file_kind("file", text);
        assert_eq!(kind("Study()"), Ok(FileKind::Study));
        let commented = "// one\n/* two */ #![enable(implicit_some)]\nScenario (";
        assert_eq!(kind(commented), Ok(FileKind::Scenario));
        for text in ["", "  \n", "// a comment", "/* never ends"] {
            let error = kind(text).unwrap_err();
            assert_eq!(error.position, None, "{text}");
            assert!(error.message.ends_with("but it is empty"), "{error}");
        }
        let error = kind("\n  Scenaria(a: 1)").unwrap_err();
        assert!(
            error.message.ends_with("but it begins with `Scenaria(a:`"),
            "{error}"
        );
        assert_eq!(error.help.as_deref(), Some("did you mean `Scenario`?"));
        let position = error.position.unwrap();
        assert_eq!((position.line, position.column), (2, 3));
    }

    #[test]
    fn ranged_numbers_say_what_they_expect() {
        use super::numbers::{FiniteNumber, FractionBelowOne, NonNegative, Positive};
        let message = |result: Result<f64, String>| result.unwrap_err();
        assert_eq!(Positive::try_from(0.5).map(Positive::get), Ok(0.5));
        assert_eq!(
            message(Positive::try_from(0.0).map(Positive::get)),
            "expected a number above 0, found 0.0"
        );
        assert_eq!(NonNegative::try_from(0.0).map(NonNegative::get), Ok(0.0));
        assert!(
            FractionBelowOne::try_from(1.0).is_err() && FractionBelowOne::try_from(0.0).is_ok()
        );
        assert_eq!(
            message(FiniteNumber::try_from(f64::NAN).map(FiniteNumber::get)),
            "expected a finite number, found NaN"
        );
        assert_eq!(
            message(FiniteNumber::try_from(1e300).map(FiniteNumber::get)),
            "1e300 does not fit into a number of single precision"
        );
        assert!(Count::<5, 2>::try_from(2).is_ok() && Count::<5, 2>::try_from(1).is_err());
    }

    #[test]
    fn a_long_line_is_shortened_around_the_caret() {
        let text = format!(
            "(name: \"reds\", members: [{}], captian: \"\")",
            " ".repeat(200)
        );
        let shown = parse::<Team>("team.ron", text).unwrap_err().to_string();
        let lines: Vec<_> = shown.lines().collect();
        let caret = lines[2].find('^').unwrap();
        assert!(lines[1].len() <= 104, "{shown}");
        assert!(lines[1][..=caret].ends_with('c'), "{shown}");
    }
}
