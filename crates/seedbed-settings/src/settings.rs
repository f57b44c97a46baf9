//! Settings without those that have their defaults: what identifies a run.

use std::collections::BTreeMap;
use std::ops::Range;

use sha2::{Digest, Sha256};

use super::tree::{Malformed, Node, Tree, Value};

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

    /// The values of a RON text without fields that have their defaults. `is_same` says whether a text, in which
    /// fields are replaced by spaces, is read as the same value as the whole text.
    ///
    /// # Errors
    /// The text is no RON.
    pub fn without_defaults(
        text: &str,
        is_same: impl FnMut(&str) -> bool,
    ) -> Result<Self, Malformed> {
        let mut root = Tree::parse(text)?.root;
        let mut shortened = Shortened {
            text: text.to_owned(),
            is_same,
        };
        shortened.remove_defaults(&mut root);
        Ok(Self::of_node(&root))
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

    fn of_node(root: &Node) -> Self {
        let mut settings = Self::default();
        settings.add(root, "");
        settings
    }

    fn add(&mut self, node: &Node, path: &str) {
        match &node.value {
            Value::Scalar(value) => self.insert(path, value.clone()),
            Value::Text(text) => self.insert(path, format!("{text:?}")),
            Value::List(items) => self.add_items(items, path, "[]"),
            Value::Map(entries) => {
                for (key, value) in entries {
                    let key = Self::of_node(key).line_of_key();
                    self.add(value, &format!("{path}{{{key}}}"));
                }
            }
            Value::Record { name, fields } => {
                self.insert_name(path, name.as_deref());
                for field in fields {
                    let dot = if path.is_empty() { "" } else { "." };
                    self.add(&field.value, &format!("{path}{dot}{}", field.name));
                }
            }
            // Whether `Some` is written does not matter.
            Value::Tuple { name, items } if name.as_deref() == Some("Some") && items.len() == 1 => {
                self.add(&items[0], path);
            }
            Value::Tuple { name, items } => {
                self.insert_name(path, name.as_deref());
                self.add_items(items, path, "");
            }
        }
    }

    /// Adds items as `path[0]`, `path[1]`…, and `empty` if there are none.
    fn add_items(&mut self, items: &[Node], path: &str, empty: &str) {
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

/// A text in which fields are replaced by spaces.
struct Shortened<F> {
    text: String,
    is_same: F,
}

impl<F: FnMut(&str) -> bool> Shortened<F> {
    /// Removes all fields below `node` that have their defaults.
    fn remove_defaults(&mut self, node: &mut Node) {
        match &mut node.value {
            Value::Scalar(_) | Value::Text(_) => {}
            Value::List(items) | Value::Tuple { items, .. } => {
                for item in items {
                    self.remove_defaults(item);
                }
            }
            Value::Map(entries) => {
                for (_, value) in entries {
                    self.remove_defaults(value);
                }
            }
            Value::Record { fields, .. } => {
                fields.retain_mut(|field| {
                    let is_default = self.remove(field.place.clone());
                    if !is_default {
                        self.remove_defaults(&mut field.value);
                    }
                    !is_default
                });
            }
        }
    }

    /// Replaces a part by spaces, if the text is still read as the same value.
    fn remove(&mut self, place: Range<usize>) -> bool {
        let spaces = " ".repeat(place.len());
        let removed = self.text[place.clone()].to_owned();
        self.text.replace_range(place.clone(), &spaces);
        let is_same = (self.is_same)(&self.text);
        if !is_same {
            self.text.replace_range(place, &removed);
        }
        is_same
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Deserialize, PartialEq)]
    struct Team {
        task: String,
        #[serde(default)]
        count: u32,
        #[serde(default)]
        learner: Learner,
        #[serde(default)]
        sizes: Vec<Size>,
    }

    #[derive(Deserialize, PartialEq)]
    enum Learner {
        Gradient {
            #[serde(default, alias = "standardize")]
            standardize: bool,
            #[serde(default)]
            rate: f32,
        },
    }

    impl Default for Learner {
        fn default() -> Self {
            Self::Gradient {
                standardize: false,
                rate: 0.0,
            }
        }
    }

    #[derive(Deserialize, PartialEq)]
    struct Size {
        width: u32,
        #[serde(default)]
        height: u32,
    }

    fn settings(text: &str) -> Settings {
        let team: Team = ron::from_str(text).unwrap();
        let is_same = |text: &str| ron::from_str::<Team>(text).is_ok_and(|other| other == team);
        Settings::without_defaults(text, is_same).unwrap()
    }

    #[test]
    fn defaults_comments_spaces_and_order_do_not_matter() {
        let short =
            settings(r#"(task: "pole", learner: Gradient(rate: 0.5), sizes: [(width: 1)])"#);
        assert_eq!(
            short.text(&[]),
            "learner = Gradient\nlearner.rate = 0.5\nsizes[0].width = 1\ntask = \"pole\""
        );
        let long = "(count: 0, // none\n sizes: [(height: 0, width: 0x1)], task: r\"pole\", \
                    learner: Gradient(standardize: false, rate: 5e-1,),)";
        assert_eq!(settings(long), short);
        assert_eq!(settings(long).digest(&[]), short.digest(&[]));
    }

    #[test]
    fn each_value_that_is_no_default_matters() {
        let digest = |text| settings(text).digest(&[]);
        let mut digests = vec![
            digest(r#"(task: "pole")"#),
            digest(r#"(task: "Pole")"#),
            digest(r#"(task: "pole", count: 1)"#),
            digest(r#"(task: "pole", learner: Gradient(rate: 1))"#),
            digest(r#"(task: "pole", sizes: [(width: 0)])"#),
            digest(r#"(task: "pole", sizes: [(width: 0), (width: 0)])"#),
        ];
        digests.sort();
        digests.dedup();
        assert_eq!(digests.len(), 6);
    }

    #[test]
    fn a_renamed_field_keeps_the_digest() {
        let of = |text| Settings::of(text).unwrap();
        let former = of(r#"(task: "pole", learner: Gradient(whiten: true))"#);
        let renamed = of(r#"(task: "pole", learner: Gradient(standardize: true))"#);
        assert_ne!(former, renamed);
        let names = [("standardize", "whiten")];
        assert_eq!(former.digest(&names), renamed.digest(&names));
    }

    /// SHA-256 of `settings 1\ntask = "pole"`, computed with `sha256sum`.
    #[test]
    fn the_digest_is_that_of_the_lines() {
        assert_eq!(
            settings(r#"(task: "pole", count: 0)"#).digest(&[]),
            "074b320dc9b1ca0c55dfb2e8ec3d577deefe456015feab5a90862c770ae695d6"
        );
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
