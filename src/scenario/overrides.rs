//! Overrides such as `agents.count=16`: one value of the resolved scenario replaced by another
//! text.
//!
//! The resolved text comes from our own printer: one field a line, four spaces a level. So a field
//! is found by its level.

use ron::extensions::Extensions;
use ron::ser::PrettyConfig;
use serde::Serialize;
use serde::de::DeserializeOwned;

use seedbed_env::input::{self, Document, InputError, nearest_name, quoted_list};

/// A file that can be written with every default spelled out.
pub trait Resolve: DeserializeOwned {
    /// The file's text with every default spelled out.
    fn resolved(&self) -> String;
}

/// `value` in RON, one field a line, as a file that opens with `kind`.
///
/// # Panics
/// If it does not serialise.
#[must_use]
pub fn spelled_out(kind: &str, value: &impl Serialize) -> String {
    let config = PrettyConfig::new()
        .compact_arrays(true)
        .extensions(Extensions::UNWRAP_VARIANT_NEWTYPES);
    let text = ron::ser::to_string_pretty(value, config).expect("a file always serialises");
    let body = text
        .split_once("\n(")
        .map_or(text.as_str(), |(_, body)| body);
    format!("{kind}({body}\n")
}

/// The file with values replaced, each by `path.to.field=value`.
///
/// # Errors
/// An assignment is wrong.
pub fn apply_all<T: Resolve>(
    mut document: Document<T>,
    assignments: &[String],
) -> Result<Document<T>, InputError> {
    for assignment in assignments {
        document = apply(&document, assignment)?;
    }
    Ok(document)
}

/// The file with one value replaced.
///
/// # Errors
/// The assignment is wrong.
pub fn apply<T: Resolve>(
    document: &Document<T>,
    assignment: &str,
) -> Result<Document<T>, InputError> {
    let fault = |field: &str, message: String, help: Option<String>| InputError {
        origin: format!("--set {assignment}"),
        position: None,
        field: field.to_owned(),
        message,
        help,
    };
    let (path, value) = assignment.split_once('=').ok_or_else(|| {
        fault(
            "",
            "expected PATH=VALUE, such as agents.count=16".to_owned(),
            None,
        )
    })?;
    let (path, value) = (path.trim(), value.trim());
    input::is_ron_value(value).map_err(|reason| {
        fault(
            path,
            format!("expected one value, such as 16 or Normal(sigma: 0.1): {reason}"),
            None,
        )
    })?;
    let text = replace(&document.value.resolved(), path, value).map_err(|unknown| {
        let names = unknown.valid.iter().map(String::as_str);
        let help = nearest_name(&unknown.name, names.clone())
            .map(|name| format!("did you mean `{name}`?"));
        fault(
            path,
            format!(
                "there is no field `{}` here, expected one of {}",
                unknown.name,
                quoted_list(names)
            ),
            help,
        )
    })?;
    let read = input::parse::<T>(&document.origin, text);
    let scenario = read
        .map_err(|error| fault(path, error.message, error.help))?
        .value;
    let origin = format!(
        "{} with --set",
        document.origin.trim_end_matches(" with --set")
    );
    input::parse(&origin, scenario.resolved())
}

/// A name that is no field at its level, and those that are.
#[derive(Debug, PartialEq)]
struct UnknownField {
    name: String,
    valid: Vec<String>,
}

/// Replaces the value at `path` in a resolved text. The names of enum variants may be part of the
/// path or left out.
fn replace(text: &str, path: &str, value: &str) -> Result<String, UnknownField> {
    let lines: Vec<&str> = text.lines().collect();
    let mut block = 0..lines.len();
    for (depth, segment) in segments(path, &lines).iter().enumerate() {
        let indent = " ".repeat(4 * (depth + 1));
        let fields = block
            .clone()
            .filter_map(|index| Some((index, field_name(lines[index].strip_prefix(&indent)?)?)));
        let fields: Vec<(usize, &str)> = fields.collect();
        let Some(&(start, _)) = fields.iter().find(|(_, name)| name == segment) else {
            let valid = fields.iter().map(|(_, name)| (*name).to_owned()).collect();
            return Err(UnknownField {
                name: (*segment).to_owned(),
                valid,
            });
        };
        block = start..end_of_block(&lines, start, &indent);
    }
    let (key, _) = lines[block.start]
        .split_once(':')
        .unwrap_or((lines[block.start], ""));
    let replaced = format!("{key}: {value},");
    let (before, after) = (&lines[..block.start], &lines[block.end..]);
    Ok(before
        .iter()
        .copied()
        .chain([replaced.as_str()])
        .chain(after.iter().copied())
        .collect::<Vec<_>>()
        .join("\n"))
}

/// The path's names without those of enum variants, which stand behind a field's name on its line.
fn segments<'a>(path: &'a str, lines: &[&str]) -> Vec<&'a str> {
    let is_variant = |parent: &str, name: &str| {
        lines
            .iter()
            .any(|line| line.trim() == format!("{parent}: {name}("))
    };
    let names: Vec<&str> = path.split('.').collect();
    let kept = names
        .iter()
        .enumerate()
        .filter(|&(index, name)| index == 0 || !is_variant(names[index - 1], name));
    kept.map(|(_, name)| *name).collect()
}

fn field_name(line: &str) -> Option<&str> {
    let (name, _) = line.split_once(':')?;
    let is_name = !name.is_empty()
        && name
            .chars()
            .all(|c| c.is_alphanumeric() || c == '_' || c == '#');
    is_name.then(|| name.trim_start_matches("r#"))
}

/// The line after the value that starts on line `start`.
fn end_of_block(lines: &[&str], start: usize, indent: &str) -> usize {
    if !lines[start].ends_with(['(', '[', '{']) {
        return start + 1;
    }
    let closes = |line: &&str| {
        line.strip_prefix(indent)
            .is_some_and(|rest| rest.starts_with([')', ']', '}']))
    };
    let rest = lines[start + 1..].iter().position(closes);
    rest.map_or(lines.len(), |offset| start + offset + 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    fn document() -> Document<Scenario> {
        input::parse(
            "short.ron",
            r#"Scenario(environment: "cartpole")"#.to_owned(),
        )
        .unwrap()
    }

    fn message(assignment: &str) -> String {
        apply(&document(), assignment).unwrap_err().to_string()
    }

    #[test]
    fn values_of_any_shape_are_replaced() {
        let mut changed = document();
        for assignment in [
            "agents.count=16",
            "agents.seeds=Normal(sigma: 0)",
            "algorithm.SeedPg.discount=0.5",
            "algorithm.policy_loss=SimplePg",
            "algorithm.value_target.ratio_product_cap=None",
            "stop=Solved(return: 195, at_most: 500)",
            "stop.window=10",
            "recording.scene=None",
        ] {
            changed = apply(&changed, assignment).unwrap_or_else(|error| panic!("{error}"));
        }
        let text = changed.value.resolved();
        for expected in [
            "count: 16,",
            "sigma: 0.0,",
            "discount: 0.5,",
            "policy_loss: SimplePg,",
            "ratio_product_cap: None,",
        ] {
            assert!(text.contains(expected), "{expected} in {text}");
        }
        assert!(
            text.contains("window: 10,") && text.contains("scene: None,"),
            "{text}"
        );
    }

    #[test]
    fn mistakes_name_the_override() {
        assert_eq!(
            message("agents.cout=3"),
            "--set agents.cout=3: in `agents.cout`: there is no field `cout` here, expected one of `count`, `seeds`, `initial`\n  \
             = help: did you mean `count`?"
        );
        assert_eq!(
            message("agents.count=0"),
            "--set agents.count=0: in `agents.count`: expected a whole number from 1 to 10000, found 0"
        );
        for (broken, reason) in [
            (
                "Normal(sigma: 0",
                "expected a comma or the end of the list of fields",
            ),
            (
                "Normal(sigma: 0))",
                "unexpected text after the end of the value",
            ),
            ("", "unexpected end of RON"),
        ] {
            let expected =
                format!("expected one value, such as 16 or Normal(sigma: 0.1): {reason}");
            assert_eq!(
                message(&format!("agents.seeds={broken}")),
                format!("--set agents.seeds={broken}: in `agents.seeds`: {expected}")
            );
        }
        assert_eq!(
            message("agents"),
            "--set agents: expected PATH=VALUE, such as agents.count=16"
        );
    }
}
