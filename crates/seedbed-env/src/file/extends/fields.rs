//! Splits the text of a RON file into its top-level fields, without parsing their values.

use std::ops::Range;

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

/// The part of a field that has been read so far.
#[derive(Default)]
struct PartialField {
    name: Option<Range<usize>>,
    value_start: Option<usize>,
    /// End of the last token that is neither a space nor a comment.
    end: usize,
}

impl FileParts {
    /// Splits a text. `None` if it does not have this form, as far as can be seen without parsing
    /// values.
    pub(super) fn split(text: &str) -> Option<Self> {
        let open = after_opening_parenthesis(text)?;
        let (mut fields, mut depth) = (Vec::new(), 0_usize);
        let (mut field_start, mut field) = (open, PartialField::default());
        let mut offset = open;
        loop {
            let start = skip_blank(text, offset)?;
            let end = token_end(text, start)?;
            match &text[start..end] {
                "(" | "[" | "{" => depth += 1,
                ")" if depth == 0 => {
                    fields.extend(field.finish(text, field_start..start, true));
                    return Some(Self {
                        open,
                        close: start,
                        fields,
                    });
                }
                ")" | "]" | "}" => depth = depth.checked_sub(1)?,
                "," if depth == 0 => {
                    offset = end_with_comment(text, end);
                    fields.push(field.finish(text, field_start..offset, false)?);
                    (field_start, field) = (offset, PartialField::default());
                    continue;
                }
                ":" if depth == 0 && field.value_start.is_none() => {
                    field.value_start = Some(skip_blank(text, end)?);
                }
                _ => {}
            }
            field.name.get_or_insert(start..end);
            field.end = end;
            offset = end;
        }
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

impl PartialField {
    fn finish(self, text: &str, whole: Range<usize>, is_last: bool) -> Option<Field> {
        let name = text[self.name?].to_owned();
        let blank_lines = text[whole.clone()]
            .find(|c: char| !c.is_whitespace())
            .and_then(|first| text[whole.start..whole.start + first].rfind('\n'));
        Some(Field {
            name,
            text: whole.start + blank_lines.map_or(0, |newline| newline + 1)..whole.end,
            value: self.value_start?..self.end,
            missing_comma: is_last.then_some(self.end),
        })
    }
}

/// Byte offset just after the opening parenthesis of the file; `None` if there is none.
fn after_opening_parenthesis(text: &str) -> Option<usize> {
    let start = skip_blank(text, seedbed_input::after_first_word(text))?;
    text[start..].starts_with('(').then_some(start + 1)
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

/// End of the token that begins at `start`: a word, a string, a character in quotes, or any other
/// single character. `None` at the end of the text.
fn token_end(text: &str, start: usize) -> Option<usize> {
    let rest = &text[start..];
    let first = rest.chars().next()?;
    let length = match first {
        '"' => quoted_length(rest, '"')?,
        '\'' => quoted_length(rest, '\'')?,
        'r' | 'b' => match raw_string_length(rest)? {
            0 => word_length(rest),
            length => length,
        },
        _ if first.is_alphanumeric() || first == '_' => word_length(rest),
        _ => first.len_utf8(),
    };
    Some(start + length)
}

fn word_length(text: &str) -> usize {
    text.find(|c: char| !c.is_alphanumeric() && c != '_')
        .unwrap_or(text.len())
}

/// Length of the string or character with which `text` begins, quotes included.
fn quoted_length(text: &str, quote: char) -> Option<usize> {
    let mut escaped = false;
    for (at, found) in text.char_indices().skip(1) {
        match found {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            _ if found == quote => return Some(at + 1),
            _ => {}
        }
    }
    None
}

/// Length of a raw string such as `r#"…"#` at the start of `text`; 0 if there is none, `None` if it
/// does not end.
fn raw_string_length(text: &str) -> Option<usize> {
    let Some(after) = text.strip_prefix("br").or_else(|| text.strip_prefix('r')) else {
        return Some(0);
    };
    let body = after.trim_start_matches('#');
    let hashes = after.len() - body.len();
    let Some(body) = body.strip_prefix('"') else {
        return Some(0);
    };
    let end = format!("\"{}", "#".repeat(hashes));
    let found = body.find(&end)?;
    Some(text.len() - body.len() + found + end.len())
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
        ] {
            assert!(FileParts::split(text).is_none(), "{text}");
        }
    }
}
