//! Former names of fields, which are read for one more version.

use seedbed_settings::{Node, Tree, Value};

/// Names of fields that were renamed, each with the former one. Digests of settings have the former names, so that
/// they are those of published results.
pub const FORMER_NAMES: [(&str, &str); 7] = [
    ("color", "colour"),
    ("optimizer", "optimiser"),
    ("policy_optimizer", "policy_optimiser"),
    ("randomized", "randomised"),
    ("regularization", "regularisation"),
    ("standardize", "standardise"),
    ("value_optimizer", "value_optimiser"),
];

/// A field of a text that has its former name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FormerName {
    /// The name in the text.
    pub former: &'static str,
    /// The name of today.
    pub new: &'static str,
    /// Line, counted from 1.
    pub line: usize,
    /// Where the former name begins, in bytes.
    start: usize,
}

/// The fields of a RON text that have former names, in their order.
#[must_use]
pub fn former_names_in(text: &str) -> Vec<FormerName> {
    former_names_of(&Tree::parse_partly(text))
}

pub(crate) fn former_names_of(tree: &Tree<'_>) -> Vec<FormerName> {
    let mut found = Vec::new();
    add_names(&tree.root, tree.text, &mut found);
    found
}

fn add_names(node: &Node<'_>, text: &str, found: &mut Vec<FormerName>) {
    match &node.value {
        Value::Record { fields, .. } => {
            for field in fields {
                found.extend(former_name(field.name, field.place.end, text));
                add_names(&field.value, text, found);
            }
        }
        Value::List(items) | Value::Tuple { items, .. } => {
            for item in items {
                add_names(item, text, found);
            }
        }
        Value::Map(entries) => {
            for (key, value) in entries {
                if let Value::Name(name) = key.value {
                    found.extend(former_name(name, key.place.end, text));
                }
                add_names(value, text, found);
            }
        }
        _ => {}
    }
}

/// What is to be known of the field whose name ends at a byte, if it is a former one.
fn former_name(name: &str, end: usize, text: &str) -> Option<FormerName> {
    let (new, former) = renamed(name)?;
    let start = end - name.len();
    let line = text[..start].matches('\n').count() + 1;
    Some(FormerName {
        former,
        new,
        line,
        start,
    })
}

/// A RON text with the names of today. All places in it are the same: a name that is shorter than the former one is
/// followed by spaces.
#[must_use]
pub(crate) fn with_new_names(text: &str, former_names: &[FormerName]) -> String {
    let mut renamed = text.to_owned();
    for name in former_names {
        let padded = format!("{:width$}", name.new, width = name.former.len());
        renamed.replace_range(name.start..name.start + name.former.len(), &padded);
    }
    renamed
}

/// A path such as `algorithm.policy_optimiser.step_size` with the names of today.
#[must_use]
pub fn path_with_new_names(path: &str) -> String {
    let names = path.split('.');
    let new: Vec<&str> = names
        .map(|name| renamed(name).map_or(name, |(new, _)| new))
        .collect();
    new.join(".")
}

fn renamed(name: &str) -> Option<(&'static str, &'static str)> {
    let mut names = FORMER_NAMES.into_iter();
    names.find(|(_, former)| *former == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn former_names_of_fields_are_replaced_in_place() {
        let text = "(colour: 1, // colour: no\n a: \"optimiser: \\\" no\", b: r#\"standardise: \"no\"#, /* optimiser: no */ \
                    value_optimiser : (x: randomised), Colour: 2)";
        let expected = "(color : 1, // colour: no\n a: \"optimiser: \\\" no\", b: r#\"standardise: \"no\"#, /* optimiser: no */ \
                        value_optimizer : (x: randomised), Colour: 2)";
        let names = former_names_in(text);
        let found: Vec<(&str, usize)> = names.iter().map(|name| (name.new, name.line)).collect();
        assert_eq!(found, [("color", 1), ("value_optimizer", 2)]);
        assert_eq!(with_new_names(text, &names), expected);
    }

    #[test]
    fn broken_texts_are_read_to_their_end() {
        for text in ["\"", "r#\"", "/*", "//", "é:", "(a: \"\\"] {
            assert_eq!(former_names_in(text), []);
        }
    }

    #[test]
    fn paths_are_renamed() {
        let path = path_with_new_names("algorithm.policy_optimiser.step_size");
        assert_eq!(path, "algorithm.policy_optimizer.step_size");
    }

    /// Otherwise the places in a text would change.
    #[test]
    fn no_name_is_longer_than_the_former_one() {
        for (new, former) in FORMER_NAMES {
            assert!(new.len() <= former.len(), "{new}");
        }
    }
}
