//! Replaces values in RON texts by their paths, as `--set` does.

use super::tree::{Malformed, Node, Tree};

/// A path that names no field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownField {
    /// First name of the path that is not a field at its level.
    pub name: String,
    /// The fields at that level.
    pub known_fields: Vec<String>,
}

/// The name or value with which the field at `path` begins in a text, such as `SeedPg`; none if there is no such
/// field.
#[must_use]
pub fn opening<'a>(text: &'a str, path: &str) -> Option<&'a str> {
    let tree = Tree::parse(text).ok()?;
    let value = &text[find(&tree.root, path).ok()?.place.clone()];
    let end = value.find('(').unwrap_or(value.len());
    Some(value[..end].trim_end())
}

/// Replaces the value of the field at `path`, such as `agents.count`, in a text; the rest stays. Names of variants may
/// be part of the path or left out.
///
/// # Errors
/// There is no such field.
///
/// # Panics
/// If the text is no RON.
pub fn replace(text: &str, path: &str, value: &str) -> Result<String, UnknownField> {
    let tree = Tree::parse(text).unwrap_or_else(|error: Malformed| panic!("{error} of {text}"));
    let place = find(&tree.root, path)?.place.clone();
    let mut replaced = text.to_owned();
    replaced.replace_range(place, value);
    Ok(replaced)
}

/// The value of the field at `path`.
fn find<'n, 'a>(root: &'n Node<'a>, path: &str) -> Result<&'n Node<'a>, UnknownField> {
    let mut node = root;
    for name in path.split('.') {
        if let Some(field) = node.fields().iter().find(|field| field.name == name) {
            node = &field.value;
        } else if node.name() != Some(name) {
            return Err(UnknownField {
                name: name.to_owned(),
                known_fields: node
                    .fields()
                    .iter()
                    .map(|field| field.name.to_owned())
                    .collect(),
            });
        }
    }
    Ok(node)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "Outer(\n    inner: (count: 1, list: [2, 3]), // as before\n    count: 5,\n    shape: Circle(radius: 4),\n)";

    #[test]
    fn one_value_is_replaced_and_the_rest_stays() {
        for (path, before, after) in [
            ("count", "count: 5,", "count: 9,"),
            ("inner.count", "count: 1,", "count: 9,"),
            ("inner.list", "[2, 3]", "9"),
            ("shape.radius", "radius: 4", "radius: 9"),
            ("shape.Circle.radius", "radius: 4", "radius: 9"),
            ("shape", "Circle(radius: 4)", "9"),
        ] {
            let expected = TEXT.replacen(before, after, 1);
            assert_eq!(replace(TEXT, path, "9").unwrap(), expected, "{path}");
        }
    }

    #[test]
    fn unknown_fields_are_reported_with_those_of_their_level() {
        for (path, name, known) in [
            ("inner.cout", "cout", vec!["count", "list"]),
            ("shape.Square.radius", "Square", vec!["radius"]),
            ("count.x", "x", vec![]),
        ] {
            let unknown = replace(TEXT, path, "9").unwrap_err();
            assert_eq!(
                (unknown.name.as_str(), unknown.known_fields),
                (name, known.iter().map(ToString::to_string).collect())
            );
        }
    }

    #[test]
    fn the_opening_is_a_name_or_a_value() {
        assert_eq!(opening(TEXT, "shape"), Some("Circle"));
        assert_eq!(opening(TEXT, "count"), Some("5"));
        assert_eq!(opening(TEXT, "nothing"), None);
    }
}
