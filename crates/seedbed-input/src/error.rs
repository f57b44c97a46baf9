//! Errors of input: the place, what was expected, and an excerpt of the file.

use std::fmt;

use super::former_names::FormerName;

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

/// The end of the origin of a text in which `--set` has replaced values, and which has all defaults.
pub const WITH_REPLACED_VALUES: &str = " with --set";

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

/// An error about the character of a text that begins at the byte `offset`.
#[must_use]
pub fn error_at(
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

impl InputError {
    /// An error about a whole file or option.
    #[must_use]
    pub fn about(origin: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            origin: origin.into(),
            position: None,
            field: String::new(),
            message: message.into(),
            help: None,
        }
    }

    /// The name that is no field, if this is what is wrong.
    #[must_use]
    pub fn unexpected_field(&self) -> Option<&str> {
        let rest = self.message.strip_prefix("unexpected field `")?;
        rest.split('`').next()
    }

    /// The error in a text that has former names of fields.
    pub(crate) fn with_former_names(mut self, text: &str, names: &[FormerName]) -> Self {
        let Some(place) = &mut self.position else {
            return self;
        };
        let line = text.lines().nth(place.line - 1);
        line.unwrap_or_default().clone_into(&mut place.text);
        for name in names.iter().filter(|name| name.line == place.line) {
            let [new, former] =
                [name.new, name.former].map(|name| format!("unexpected field `{name}`"));
            if self.message.starts_with(&new) {
                self.message = self.message.replacen(&new, &former, 1);
                if let Some(before) = self.field.strip_suffix(name.new) {
                    self.field = format!("{before}{}", name.former);
                }
            }
        }
        self
    }

    /// The name of the variant, if the error is that there is no such variant.
    #[must_use]
    pub fn unexpected_variant(&self) -> Option<&str> {
        let rest = self.message.strip_prefix("unexpected variant `")?;
        rest.split('`').next()
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}", self.origin)?;
        // Lines of the text with all defaults are not those of the file.
        let is_of_file = !self.origin.ends_with(WITH_REPLACED_VALUES);
        if let Some(position) = self.position.as_ref().filter(|_| is_of_file) {
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

impl Position {
    /// The place of a character within the string that begins here. In a string with escapes, whose
    /// characters are not those of the file, the place remains the beginning of the string.
    #[must_use]
    pub fn moved(self, (line, column): (usize, usize), text: &str) -> Self {
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

/// The place of the first character from `column` on that is not a space: the parser may stop
/// before a space.
pub(crate) fn position(text: &str, line: usize, column: usize) -> Position {
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
