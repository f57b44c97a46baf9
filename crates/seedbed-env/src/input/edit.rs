//! Prints values as RON files, and replaces values in such files.
//!
//! A printed file has one field per line and four spaces of indentation per level. A field can
//! therefore be found by its level, without a parser that keeps positions.

use std::ops::Range;

use ron::extensions::Extensions;
use ron::ser::PrettyConfig;
use serde::Serialize;

/// Indentation per level, in spaces.
const INDENT: usize = 4;

/// A value as a RON file that begins with the word `kind`: all fields, one per line.
///
/// # Panics
/// If the value cannot be serialized.
#[must_use]
pub fn to_ron_string(kind: &str, value: &impl Serialize) -> String {
    let config = PrettyConfig::new()
        .compact_arrays(true)
        .extensions(Extensions::UNWRAP_VARIANT_NEWTYPES);
    let text = ron::ser::to_string_pretty(value, config).expect("the value can be serialized");
    let body = text
        .split_once("\n(")
        .map_or(text.as_str(), |(_, body)| body);
    format!("{kind}({body}\n")
}

/// A path that names no field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownField {
    /// First name of the path that is not a field at its level.
    pub name: String,
    /// The fields at that level.
    pub known_fields: Vec<String>,
}

/// What the value of the field at `path` begins with in a text that [`to_ron_string`] has printed, such
/// as `SeedPg(` or `16,`; none if there is no such field.
#[must_use]
pub fn opening(text: &str, path: &str) -> Option<String> {
    let lines: Vec<&str> = text.lines().collect();
    let block = find_path(&lines, path).ok()?;
    let (_, value) = lines[block.start].split_once(':')?;
    Some(value.trim().to_owned())
}

/// Replaces the value of the field at `path`, e.g. `agents.count`, in a text that [`to_ron_string`]
/// has printed. Names of enum variants may be part of the path or left out.
///
/// # Errors
/// If there is no such field.
pub fn replace_value(text: &str, path: &str, value: &str) -> Result<String, UnknownField> {
    let lines: Vec<&str> = text.lines().collect();
    let block = find_path(&lines, path)?;
    let first = lines[block.start];
    let key = first.split_once(':').map_or(first, |(key, _)| key);
    let replaced = format!("{key}: {value},");
    let mut edited = lines[..block.start].to_vec();
    edited.push(&replaced);
    edited.extend(&lines[block.end..]);
    Ok(edited.join("\n"))
}

/// The lines of the field at `path`.
fn find_path(lines: &[&str], path: &str) -> Result<Range<usize>, UnknownField> {
    let mut block = 0..lines.len();
    for (depth, name) in field_path(path, lines).into_iter().enumerate() {
        let indent = " ".repeat(INDENT * (depth + 1));
        block = find_field(lines, block, &indent, name)?;
    }
    Ok(block)
}

/// The names of a path without those of enum variants, which have no line of their own.
fn field_path<'a>(path: &'a str, lines: &[&str]) -> Vec<&'a str> {
    let mut fields = Vec::new();
    let mut previous = "";
    for name in path.split('.') {
        let variant = format!("{previous}: {name}(");
        if previous.is_empty() || !lines.iter().any(|line| line.trim() == variant) {
            fields.push(name);
        }
        previous = name;
    }
    fields
}

/// The lines within `block` of the field `name` with this indentation.
fn find_field(
    lines: &[&str],
    block: Range<usize>,
    indent: &str,
    name: &str,
) -> Result<Range<usize>, UnknownField> {
    let mut known_fields = Vec::new();
    for start in block {
        match lines[start].strip_prefix(indent).and_then(field_name) {
            Some(found) if found == name => return Ok(start..end_of_value(lines, start, indent)),
            Some(found) => known_fields.push(found.to_owned()),
            None => {}
        }
    }
    Err(UnknownField {
        name: name.to_owned(),
        known_fields,
    })
}

/// Name of the field on a line without its indentation.
fn field_name(line: &str) -> Option<&str> {
    let (name, _) = line.split_once(':')?;
    let is_name_character = |c: char| c.is_alphanumeric() || c == '_' || c == '#';
    let is_name = !name.is_empty() && name.chars().all(is_name_character);
    is_name.then(|| name.trim_start_matches("r#"))
}

/// Index of the line after the value that begins on line `start`.
fn end_of_value(lines: &[&str], start: usize, indent: &str) -> usize {
    if !lines[start].ends_with(['(', '[', '{']) {
        return start + 1;
    }
    let closes_value = |line: &&str| {
        line.strip_prefix(indent)
            .is_some_and(|rest| rest.starts_with([')', ']', '}']))
    };
    let rest = lines[start + 1..].iter().position(closes_value);
    rest.map_or(lines.len(), |offset| start + offset + 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Outer {
        inner: Inner,
        count: u32,
        shape: Shape,
    }

    #[derive(Serialize)]
    struct Inner {
        count: u32,
        list: Vec<u32>,
    }

    #[derive(Serialize)]
    enum Shape {
        Circle { radius: u32 },
    }

    fn text() -> String {
        let inner = Inner {
            count: 1,
            list: vec![2, 3],
        };
        let shape = Shape::Circle { radius: 4 };
        to_ron_string(
            "Outer",
            &Outer {
                inner,
                count: 5,
                shape,
            },
        )
    }

    #[test]
    fn values_are_printed_one_field_per_line() {
        assert_eq!(
            text(),
            "Outer(\n    inner: (\n        count: 1,\n        list: [2, 3],\n    ),\n    count: 5,\n    \
             shape: Circle(\n        radius: 4,\n    ),\n)\n"
        );
    }

    #[test]
    fn fields_are_found_by_their_level() {
        for (path, before, after) in [
            ("count", "    count: 5,", "    count: 9,"),
            ("inner.count", "        count: 1,", "        count: 9,"),
            ("shape.radius", "        radius: 4,", "        radius: 9,"),
            (
                "shape.Circle.radius",
                "        radius: 4,",
                "        radius: 9,",
            ),
        ] {
            let expected = text().replacen(before, after, 1);
            assert_eq!(
                replace_value(&text(), path, "9").unwrap(),
                expected.trim_end(),
                "{path}"
            );
        }
        let whole = replace_value(&text(), "shape", "Square").unwrap();
        assert!(
            whole.ends_with("    count: 5,\n    shape: Square,\n)"),
            "{whole}"
        );
    }

    #[test]
    fn unknown_fields_are_reported_with_those_of_their_level() {
        let unknown = replace_value(&text(), "inner.cout", "9").unwrap_err();
        assert_eq!(unknown.name, "cout");
        assert_eq!(unknown.known_fields, ["count", "list"]);
    }
}
