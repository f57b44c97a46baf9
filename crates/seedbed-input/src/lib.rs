//! Reading RON files with located errors: file, line, column, field, and what was expected.
//!
//! Syntax, types and ranges are checked while serde reads a file. What can only be checked
//! afterwards (a name that refers to nothing) is a [`ValidationError`] about a [`Located`] value,
//! which [`Document::locate`] turns into an error of the same form. This crate does not depend on
//! what the files mean.

mod builtin;
mod deserializer;
pub mod edit;
mod error;
mod explanation;
mod files;
mod foreign;
mod former_names;
mod kind;
pub mod limits;
mod located;
mod names;
pub mod numbers;

use std::path::Path;

use seedbed_settings::{Node, Settings, Tree};
use serde::de::{DeserializeOwned, IgnoredAny};

pub use builtin::{BuiltinFile, DiskAndBuiltin, is_builtin};
pub use error::{InputError, Position, WITH_REPLACED_VALUES, error_at};
pub use explanation::NAME_IN_QUOTES;
pub use files::{
    Disk, FileSource, find_upwards, folders_upwards, is_ron, read_text, read_text_from, unreadable,
};
pub use former_names::{FORMER_NAMES, FormerName, former_names_in, path_with_new_names};
use former_names::{former_names_of, with_new_names};
pub use kind::{FileKind, block_comment_length, file_kind};
pub use located::{Document, Located, ValidationError, short_located_list};
pub use names::{nearest_name, quoted_list, shown, without_version};

/// Reads the RON file at `path`.
///
/// # Errors
/// The file cannot be read, or is not a `T`.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<Document<T>, InputError> {
    parse(&path.display().to_string(), read_text(path)?)
}

/// Parses RON `text`, whose fields may have [former names](FORMER_NAMES); errors show `origin` in place of a file name.
///
/// # Errors
/// The text is not a `T`.
pub fn parse<T: DeserializeOwned>(origin: &str, text: String) -> Result<Document<T>, InputError> {
    let tree = Tree::parse_partly(&text);
    let former_names = former_names_of(&tree);
    if !former_names.is_empty() {
        let renamed = with_new_names(&text, &former_names);
        let document = parse(origin, renamed)
            .map_err(|error| error.with_former_names(&text, &former_names))?;
        return Ok(Document {
            former_names,
            ..document
        });
    }
    let value = deserializer::read(&tree, None)
        .map_err(|failure| explanation::explained(origin, &text, &failure))?;
    Ok(Document {
        origin: origin.to_owned(),
        text,
        value,
        former_names,
    })
}

/// The values of a text that is a `T`, without those that have their defaults.
///
/// # Panics
/// If the text is not a `T`.
#[must_use]
pub fn settings_of<T: DeserializeOwned + PartialEq>(text: &str) -> Settings {
    let text = &*with_new_names(text, &former_names_in(text));
    let root = Tree::parse(text).expect("a text that was read before").root;
    let read = |node: &Node<'_>| deserializer::read_node::<T>(text, node, None).ok();
    let value = read(&root).expect("a text that was read before");
    Settings::without_defaults(root, |root| read(root).is_some_and(|other| other == value))
}

/// Checks that `text` is a single RON value, of any type.
///
/// # Errors
/// The message of the syntax error.
pub fn check_ron_value(text: &str) -> Result<(), String> {
    let read = deserializer::read::<IgnoredAny>(&Tree::parse_partly(text), None);
    let checked = read.map(|IgnoredAny| ());
    checked.map_err(|failure| explanation::explained("", text, &failure).message)
}

#[cfg(test)]
mod tests;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
