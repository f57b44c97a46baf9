//! Replaces values in RON texts by their paths, as `--set` does.

use super::tree::{Malformed, Node, Tree, Value};

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
/// be part of the path or left out. Keys of maps are names, too; a new one is added.
///
/// # Errors
/// There is no such field.
///
/// # Panics
/// If the text is no RON.
pub fn replace(text: &str, path: &str, value: &str) -> Result<String, UnknownField> {
    let tree = Tree::parse(text).unwrap_or_else(|error: Malformed| panic!("{error} of {text}"));
    let mut replaced = text.to_owned();
    match find(&tree.root, path) {
        Ok(node) => replaced.replace_range(node.place.clone(), value),
        Err(unknown) => add_key(&tree.root, path, value, &mut replaced).ok_or(unknown)?,
    }
    Ok(replaced)
}

/// Adds the last name of `path` as a key to a map with a value; `None` if what is before it is no map.
fn add_key(root: &Node<'_>, path: &str, value: &str, text: &mut String) -> Option<()> {
    let (parent, key) = path.rsplit_once('.')?;
    let map = find(root, parent).ok()?;
    let Value::Map(entries) = &map.value else {
        return None;
    };
    match entries.last() {
        Some((_, last)) => text.insert_str(last.place.end, &format!(", {key:?}: {value}")),
        None => text.replace_range(map.place.clone(), &format!("{{{key:?}: {value}}}")),
    }
    Some(())
}

/// The value of the field at `path`.
fn find<'n, 'a>(root: &'n Node<'a>, path: &str) -> Result<&'n Node<'a>, UnknownField> {
    let mut node = root;
    for name in path.split('.') {
        if let Some(field) = node.fields().iter().find(|field| field.name == name) {
            node = &field.value;
        } else if let Some(value) = value_of_key(node, name) {
            node = value;
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

/// The value of a key, if a node is a map with keys that are texts.
fn value_of_key<'n, 'a>(node: &'n Node<'a>, key: &str) -> Option<&'n Node<'a>> {
    let Value::Map(entries) = &node.value else {
        return None;
    };
    let mut entries = entries.iter();
    let found = entries.find(|(other, _)| matches!(&other.value, Value::Text(text) if text == key));
    found.map(|(_, value)| value)
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

    /// Keys of maps are parts of paths, too; others are added.
    #[test]
    fn one_key_of_a_map_is_replaced() {
        let text = "Task(kwargs: {\"noise\": 0.1, \"size\": (a: 1)}, more: {})";
        for (path, expected) in [
            (
                "kwargs.noise",
                "Task(kwargs: {\"noise\": 9, \"size\": (a: 1)}, more: {})",
            ),
            (
                "kwargs.size.a",
                "Task(kwargs: {\"noise\": 0.1, \"size\": (a: 9)}, more: {})",
            ),
            (
                "kwargs.speed",
                "Task(kwargs: {\"noise\": 0.1, \"size\": (a: 1), \"speed\": 9}, more: {})",
            ),
            (
                "more.speed",
                "Task(kwargs: {\"noise\": 0.1, \"size\": (a: 1)}, more: {\"speed\": 9})",
            ),
        ] {
            assert_eq!(replace(text, path, "9").unwrap(), expected, "{path}");
        }
        assert_eq!(replace(text, "kwargs.noise.x", "9").unwrap_err().name, "x");
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
