//! Splits the text of a RON file into its top-level fields.

use std::ops::Range;

use seedbed_settings::{Expected, Tree, Value};

/// The parts of a file of the form `Kind(name: value, …)`. All positions are byte offsets.
pub(super) struct FileParts {
    /// Just after the opening parenthesis.
    pub(super) open: usize,
    /// At the closing parenthesis.
    pub(super) close: usize,
    pub(super) fields: Vec<Field>,
}

/// A top-level field.
pub(super) struct Field {
    pub(super) name: String,
    /// The whole field, with the comments before it, its comma, and a comment behind the comma on
    /// the same line.
    pub(super) text: Range<usize>,
    pub(super) value: Range<usize>,
    /// Where a comma belongs, if the field is the last one and has none.
    pub(super) missing_comma: Option<usize>,
}

impl FileParts {
    /// Splits a text. `None` if it does not have this form; what follows its last parenthesis does not matter.
    pub(super) fn split(text: &str) -> Option<Self> {
        let Tree { root, error, .. } = Tree::parse_partly(text);
        if error.is_some_and(|error| error.expected != Expected::EndOfText) {
            return None;
        }
        let found = match &root.value {
            Value::Record { fields, .. } => &fields[..],
            Value::Tuple { items, .. } if items.is_empty() => &[],
            _ => return None,
        };
        let open = after_opening_parenthesis(text, root.place.start + root.name()?.len())?;
        let close = root.place.end - 1;
        let (mut fields, mut start) = (Vec::new(), open);
        for field in found {
            let value = field.value.place.clone();
            let after = skip_blank(text, value.end)?;
            let has_comma = text[after..].starts_with(',');
            let end = if has_comma {
                end_with_comment(text, after + 1)
            } else {
                close
            };
            fields.push(Field {
                name: field.name.to_owned(),
                text: after_blank_lines(text, start)..end,
                missing_comma: (!has_comma).then_some(value.end),
                value,
            });
            start = end;
        }
        Some(Self {
            open,
            close,
            fields,
        })
    }

    /// Index of the field `extends`.
    pub(super) fn extends_index(&self) -> Option<usize> {
        self.fields.iter().position(|field| field.name == "extends")
    }

    /// Removes the field `extends` and returns it.
    pub(super) fn take_extends(&mut self) -> Option<Field> {
        self.extends_index().map(|index| self.fields.remove(index))
    }
}

/// Byte offset just after the opening parenthesis that follows the name which ends at `at`; `None` if there is none.
fn after_opening_parenthesis(text: &str, at: usize) -> Option<usize> {
    let start = skip_blank(text, at)?;
    text[start..].starts_with('(').then_some(start + 1)
}

/// The beginning of the first line from `at` on that is not blank, or `at` itself if it is in this line.
fn after_blank_lines(text: &str, at: usize) -> usize {
    let rest = &text[at..];
    let blank = &rest[..rest.len() - rest.trim_start().len()];
    blank.rfind('\n').map_or(at, |newline| at + newline + 1)
}

/// The end of the line of `at` if only a comment follows on it, else `at` itself.
fn end_with_comment(text: &str, at: usize) -> usize {
    let line = text[at..].split('\n').next().unwrap_or_default();
    if line.trim_start().starts_with("//") {
        at + line.len()
    } else {
        at
    }
}

/// Where the first token from `at` on begins; `None` if a comment does not end.
fn skip_blank(text: &str, mut at: usize) -> Option<usize> {
    loop {
        let rest = &text[at..];
        let trimmed = rest.trim_start();
        at += rest.len() - trimmed.len();
        if trimmed.starts_with("//") {
            at += trimmed.find('\n').unwrap_or(trimmed.len());
        } else if trimmed.starts_with("/*") {
            at += seedbed_input::block_comment_length(trimmed)?;
        } else {
            return Some(at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_and_values(text: &str) -> Vec<(String, String)> {
        let parts = FileParts::split(text).unwrap();
        let fields = parts.fields.into_iter();
        fields
            .map(|field| (field.name, text[field.value].to_owned()))
            .collect()
    }

    #[test]
    fn fields_are_split_at_top_level_only() {
        let text = r##"// (a comment
#![enable(implicit_some)]
Kind( /* a: /* nested */ 1, */
    first: (x: [1, 2], y: "a, \" (b"), // second: 3,
    name: r#"raw ", "# , r: 'r', c: ',', q: '\'',
    last: Some({ "k": (1, 2) })
) // end)"##;
        let pairs = [
            ("first", r#"(x: [1, 2], y: "a, \" (b")"#),
            ("name", r##"r#"raw ", "#"##),
            ("r", "'r'"),
            ("c", "','"),
            ("q", r"'\''"),
            ("last", r#"Some({ "k": (1, 2) })"#),
        ];
        let expected = pairs.map(|(name, value)| (name.to_owned(), value.to_owned()));
        assert_eq!(names_and_values(text), expected);
    }

    #[test]
    fn a_text_of_another_form_has_no_parts() {
        for text in [
            "",
            "Kind",
            "Kind[a: 1]",
            "Kind(a: 1",
            "Kind(a: \"1)",
            "Kind(a: 1]) /*",
            "Kind(a: , b: 1)",
            "Kind(a: )",
        ] {
            assert!(FileParts::split(text).is_none(), "{text}");
        }
    }
}
