//! Settings without those that have their defaults: what identifies a run.

use std::collections::BTreeMap;

use sha2::{Digest, Sha256};

use super::tree::{Field, Malformed, Node, Tree, Value};

/// Version of [`Settings::digest`]. It grows when a default changes, because a field that is left out means another
/// value then; a new field with a default changes no digest.
pub const SCHEMA_VERSION: u32 = 1;

/// Paths and values of a text, in the order of paths: `agents.count` is `4`, `algorithm` is `SeedPg`,
/// `observations[0].name` is `"x"`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    values: BTreeMap<String, String>,
}

/// A path at which two settings differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Path of the value.
    pub path: String,
    /// Value of the first settings; `None` if it has its default or does not exist.
    pub first: Option<String>,
    /// Value of the second settings.
    pub second: Option<String>,
}

/// SHA-256 in hexadecimal digits, as `sha256sum` prints it.
#[must_use]
pub fn sha256(bytes: impl AsRef<[u8]>) -> String {
    format!("{:x}", Sha256::digest(bytes))
}

impl Settings {
    /// All values of a RON text.
    ///
    /// # Errors
    /// The text is no RON.
    pub fn of(text: &str) -> Result<Self, Malformed> {
        Ok(Self::of_node(&Tree::parse(text)?.root))
    }

    /// The values of a tree without fields that have their defaults. `is_same` says whether a tree, in which fields
    /// are left out, is read as the same value as the whole tree.
    #[must_use]
    pub fn without_defaults(
        mut root: Node<'_>,
        mut is_same: impl FnMut(&Node<'_>) -> bool,
    ) -> Self {
        remove_defaults(&mut root, &mut Vec::new(), &mut is_same);
        Self::of_node(&root)
    }

    /// The settings without the value at `path` and all values below it.
    #[must_use]
    pub fn without(mut self, path: &str) -> Self {
        let is_below = |other: &str| {
            let rest = other.strip_prefix(path);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[', '{']))
        };
        self.values.retain(|other, _| !is_below(other));
        self
    }

    /// These settings with others, whose paths begin with `name`.
    #[must_use]
    pub fn with(mut self, name: &str, others: Self) -> Self {
        for (path, value) in others.values {
            let dot = if path.is_empty() { "" } else { "." };
            self.values.insert(format!("{name}{dot}{path}"), value);
        }
        self
    }

    fn of_node(root: &Node<'_>) -> Self {
        let mut settings = Self::default();
        settings.add(root, "");
        settings
    }

    fn add(&mut self, node: &Node<'_>, path: &str) {
        match &node.value {
            Value::Number(number) => self.insert(path, canonical_number(number)),
            Value::Character(character) => self.insert(path, format!("{character:?}")),
            Value::Text(text) => self.insert(path, format!("{text:?}")),
            Value::Name(name) => self.insert(path, (*name).to_owned()),
            Value::List(items) => self.add_items(items, path, "[]"),
            Value::Map(entries) => {
                for (key, value) in entries {
                    let key = Self::of_node(key).line_of_key();
                    self.add(value, &format!("{path}{{{key}}}"));
                }
            }
            Value::Record { name, fields } => {
                // `()` is a value: it differs from a field that is left out where the default of the field is not that
                // of its type.
                self.insert_name(path, name.or(fields.is_empty().then_some("()")));
                for field in fields {
                    let dot = if path.is_empty() { "" } else { "." };
                    self.add(&field.value, &format!("{path}{dot}{}", field.name));
                }
            }
            // Whether `Some` is written does not matter.
            Value::Tuple { name, items } if *name == Some("Some") && items.len() == 1 => {
                self.add(&items[0], path);
            }
            Value::Tuple { name, items } => {
                self.insert_name(path, *name);
                self.add_items(items, path, "");
            }
            Value::Malformed(_) => {}
        }
    }

    /// Adds items as `path[0]`, `path[1]`…, and `empty` if there are none.
    fn add_items(&mut self, items: &[Node<'_>], path: &str, empty: &str) {
        if items.is_empty() && !empty.is_empty() {
            self.insert(path, empty.to_owned());
        }
        for (index, item) in items.iter().enumerate() {
            self.add(item, &format!("{path}[{index}]"));
        }
    }

    fn insert_name(&mut self, path: &str, name: Option<&str>) {
        if let Some(name) = name {
            self.insert(path, name.to_owned());
        }
    }

    fn insert(&mut self, path: &str, value: String) {
        self.values.insert(path.to_owned(), value);
    }

    /// The key of a map as part of a path.
    fn line_of_key(&self) -> String {
        let values: Vec<&str> = self.values.values().map(String::as_str).collect();
        values.join(" ")
    }

    /// Paths and values, one per line. `former_names` are names of fields and variants that were renamed, and what
    /// they are called here.
    #[must_use]
    pub fn text(&self, former_names: &[(&str, &str)]) -> String {
        let former = |name: &str| {
            let renamed = former_names.iter().find(|(new, _)| *new == name);
            renamed.map_or(name, |(_, former)| *former).to_owned()
        };
        let mut lines: Vec<String> = Vec::new();
        for (path, value) in &self.values {
            let names: Vec<String> = path
                .split('.')
                .map(|part| with_name(part, former))
                .collect();
            lines.push(format!("{} = {}", names.join("."), former(value)));
        }
        lines.sort();
        lines.join("\n")
    }

    /// SHA-256 of [`text`](Self::text) and the version of the schema, in hexadecimal digits.
    #[must_use]
    pub fn digest(&self, former_names: &[(&str, &str)]) -> String {
        let text = format!("settings {SCHEMA_VERSION}\n{}", self.text(former_names));
        sha256(text)
    }

    /// What differs from other settings, in the order of paths.
    #[must_use]
    pub fn differences(&self, other: &Self) -> Vec<Difference> {
        let mut paths: Vec<&String> = self.values.keys().chain(other.values.keys()).collect();
        paths.sort();
        paths.dedup();
        let mut differences = Vec::new();
        for path in paths {
            let (first, second) = (self.values.get(path), other.values.get(path));
            if first != second {
                differences.push(Difference {
                    path: path.clone(),
                    first: first.cloned(),
                    second: second.cloned(),
                });
            }
        }
        differences
    }
}

/// `part` of a path, such as `sensors[3]`, with another name.
fn with_name(part: &str, name: impl Fn(&str) -> String) -> String {
    let end = part.find(['[', '{']).unwrap_or(part.len());
    format!("{}{}", name(&part[..end]), &part[end..])
}

/// Removes all fields below the node at `path` that have their defaults. A path has the number of the child at each
/// level.
fn remove_defaults<'a>(
    root: &mut Node<'a>,
    path: &mut Vec<usize>,
    is_same: &mut impl FnMut(&Node<'a>) -> bool,
) {
    let mut index = 0;
    while index < node_at(root, path).children().count() {
        if let Some(field) = remove_field(root, path, index) {
            if is_same(root) {
                continue;
            }
            if let Value::Record { fields, .. } = &mut node_at(root, path).value {
                fields.insert(index, field);
            }
        }
        path.push(index);
        remove_defaults(root, path, is_same);
        path.pop();
        index += 1;
    }
}

/// Removes a field of the node at `path`, if it is a record.
fn remove_field<'a>(root: &mut Node<'a>, path: &[usize], index: usize) -> Option<Field<'a>> {
    match &mut node_at(root, path).value {
        Value::Record { fields, .. } => Some(fields.remove(index)),
        _ => None,
    }
}

fn node_at<'n, 'a>(root: &'n mut Node<'a>, path: &[usize]) -> &'n mut Node<'a> {
    let child = |node: &'n mut Node<'a>, index: &usize| node.children().nth(*index);
    let found = path.iter().try_fold(root, child);
    found.expect("a path to a node of the tree")
}

impl Node<'_> {
    /// The values directly in it, but not the keys of a map.
    fn children(&mut self) -> Box<dyn Iterator<Item = &mut Self> + '_> {
        match &mut self.value {
            Value::List(items) | Value::Tuple { items, .. } => Box::new(items.iter_mut()),
            Value::Map(entries) => Box::new(entries.iter_mut().map(|(_, value)| value)),
            Value::Record { fields, .. } => {
                Box::new(fields.iter_mut().map(|field| &mut field.value))
            }
            _ => Box::new([].into_iter()),
        }
    }
}

/// A number as it is written in identities: whole numbers in full, others with the fewest digits that read back the
/// same.
fn canonical_number(number: &str) -> String {
    let digits = number.trim_start_matches(['+', '-']).replace('_', "");
    let sign = if number.starts_with('-') { "-" } else { "" };
    if let Some(whole) = whole_number(&digits) {
        return format!("{sign}{whole}");
    }
    match digits.parse::<f64>() {
        Ok(number) => format!("{sign}{number}"),
        Err(_) => format!("{sign}{digits}"),
    }
}

fn whole_number(digits: &str) -> Option<u128> {
    let with_base = [("0x", 16), ("0o", 8), ("0b", 2)];
    for (prefix, base) in with_base {
        if let Some(rest) = digits.strip_prefix(prefix) {
            return u128::from_str_radix(rest, base).ok();
        }
    }
    digits.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(text: &str) -> Settings {
        Settings::of(text).unwrap()
    }

    /// As if 0 were the default everywhere.
    #[test]
    fn fields_with_defaults_are_left_out() {
        let without_zeros = |node: &Node<'_>| {
            let mut settings = Settings::of_node(node);
            settings
                .values
                .retain(|_, value| value != "0" && value != "()");
            settings
        };
        let tree = Tree::parse("A(x: 0, b: [(x: 1), (x: 0, y: 0)], c: {1: B(x: 0)})").unwrap();
        let expected = without_zeros(&tree.root);
        let is_same = |shorter: &Node<'_>| without_zeros(shorter) == expected;
        let settings = Settings::without_defaults(tree.root, is_same);
        assert_eq!(settings.text(&[]), " = A\nb[0].x = 1\nb[1] = ()\nc{1} = B");
    }

    /// The default of `rate` is `(step: 3)`, that of `step` alone 1.
    #[test]
    fn a_record_of_defaults_differs_from_a_default_that_is_another_record() {
        let step = |node: &Node<'_>| {
            let values = Settings::of_node(node).values;
            let step = values.get("rate.step").map(String::as_str);
            let whole = values.get("rate").map(|_| "1");
            step.or(whole).unwrap_or("3").to_owned()
        };
        let identity = |text: &str| {
            let tree = Tree::parse(text).unwrap();
            let expected = step(&tree.root);
            Settings::without_defaults(tree.root, |shorter| step(shorter) == expected).text(&[])
        };
        assert_eq!(identity("A(rate: (step: 3))"), " = A");
        assert_eq!(identity("A(rate: (step: 1))"), " = A\nrate = ()");
        assert_eq!(identity("A(rate: (step: 2))"), " = A\nrate.step = 2");
    }

    #[test]
    fn a_renamed_field_keeps_the_digest() {
        let former = settings(r#"(task: "pole", learner: Gradient(whiten: true))"#);
        let renamed = settings(r#"(task: "pole", learner: Gradient(standardize: true))"#);
        assert_ne!(former, renamed);
        let names = [("standardize", "whiten")];
        assert_eq!(former.digest(&names), renamed.digest(&names));
    }

    #[test]
    fn settings_are_put_together_and_taken_out() {
        let team = settings(r#"(task: "pole", sizes: [(width: 1)])"#);
        let both = team.clone().without("sizes").with("more", team);
        assert_eq!(
            both.text(&[]),
            "more.sizes[0].width = 1\nmore.task = \"pole\"\ntask = \"pole\""
        );
    }

    #[test]
    fn differences_name_paths_and_values() {
        let first = settings(r#"(task: "pole", count: 4)"#);
        let second = settings(r#"(task: "pole", learner: Gradient(rate: 1))"#);
        let difference = |path: &str, first: Option<&str>, second: Option<&str>| Difference {
            path: path.to_owned(),
            first: first.map(str::to_owned),
            second: second.map(str::to_owned),
        };
        assert_eq!(
            first.differences(&second),
            [
                difference("count", Some("4"), None),
                difference("learner", None, Some("Gradient")),
                difference("learner.rate", None, Some("1")),
            ]
        );
        assert_eq!(first.differences(&first), []);
    }
}
