//! Reads RON texts: `value := scalar | text | name | name? '(' fields | items ')' | '[' items ']' | '{' entries '}'`.
//!
//! What comes before an error is in the tree, so that types can say first what is wrong with it.

use std::borrow::Cow;
use std::ops::Range;

use super::tree::{Expected, Field, Malformed, Node, Tree, Value};

/// Largest number of values within each other, each of which takes stack where it is read.
pub const MAX_NESTING: usize = 64;

impl<'a> Tree<'a> {
    /// Reads a RON text.
    ///
    /// # Errors
    /// The text is no RON.
    pub fn parse(text: &'a str) -> Result<Self, Malformed> {
        let tree = Self::parse_partly(text);
        tree.error.map_or(Ok(tree), Err)
    }

    /// Reads a RON text as far as it is one.
    #[must_use]
    pub fn parse_partly(text: &'a str) -> Self {
        let mut parser = Parser {
            text,
            at: 0,
            depth: 0,
            error: None,
        };
        let root = match parser.skip_attributes() {
            Ok(()) => parser.node(),
            Err(malformed) => parser.end_with(malformed),
        };
        let error = parser.error.or_else(|| parser.expect_end().err());
        Self { text, root, error }
    }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    /// Number of values around the next one.
    depth: usize,
    /// Where reading ends.
    error: Option<Malformed>,
}

impl<'a> Parser<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn error(&self, expected: Expected) -> Malformed {
        Malformed {
            at: self.at,
            expected,
        }
    }

    /// The node at which reading ends.
    fn end_with(&mut self, malformed: Malformed) -> Node<'a> {
        self.error = Some(malformed);
        Node {
            place: malformed.at..malformed.at,
            value: Value::Malformed(malformed),
        }
    }

    fn next(&self) -> Option<char> {
        self.rest().chars().next()
    }

    /// Whether `token` follows, which is then passed.
    fn take(&mut self, token: &str) -> bool {
        let follows = self.rest().starts_with(token);
        if follows {
            self.at += token.len();
        }
        follows
    }

    fn expect(&mut self, token: &str, expected: Expected) -> Result<(), Malformed> {
        if self.take(token) {
            Ok(())
        } else {
            Err(self.error(expected))
        }
    }

    /// Passes characters as long as they are of a kind, and returns them.
    fn take_while(&mut self, is_part: impl Fn(char) -> bool) -> &'a str {
        let rest = self.rest();
        let end = rest.find(|c| !is_part(c)).unwrap_or(rest.len());
        self.at += end;
        &rest[..end]
    }

    fn expect_end(&mut self) -> Result<(), Malformed> {
        self.skip_space()?;
        if self.rest().is_empty() {
            Ok(())
        } else {
            Err(self.error(Expected::EndOfText))
        }
    }

    /// Passes `#![enable(…)]`: what can be enabled always is.
    fn skip_attributes(&mut self) -> Result<(), Malformed> {
        self.skip_space()?;
        while self.rest().starts_with('#') {
            let attribute = self.rest().split_inclusive(']').next().unwrap_or_default();
            if !is_attribute(attribute) {
                return Err(self.error(Expected::Attribute));
            }
            self.at += attribute.len();
            self.skip_space()?;
        }
        Ok(())
    }

    /// Passes spaces and comments; block comments can contain others.
    fn skip_space(&mut self) -> Result<(), Malformed> {
        loop {
            self.take_while(is_space);
            if self.take("//") {
                self.take_while(|c| c != '\n');
            } else if self.rest().starts_with("/*") {
                self.skip_block_comment()?;
            } else {
                return Ok(());
            }
        }
    }

    fn skip_block_comment(&mut self) -> Result<(), Malformed> {
        let unclosed = self.error(Expected::EndOfComment);
        let mut open = 0;
        loop {
            if self.take("/*") {
                open += 1;
            } else if self.take("*/") {
                open -= 1;
            } else {
                let next = self.next().ok_or(unclosed)?;
                self.at += next.len_utf8();
            }
            if open == 0 {
                return Ok(());
            }
        }
    }

    fn node(&mut self) -> Node<'a> {
        let start = match self.skip_space() {
            Ok(()) => self.at,
            Err(malformed) => return self.end_with(malformed),
        };
        if self.depth == MAX_NESTING {
            return self.end_with(self.error(Expected::FewerBrackets));
        }
        self.depth += 1;
        let value = self.value();
        self.depth -= 1;
        match value {
            Ok(value) => Node {
                place: start..self.at,
                value,
            },
            Err(malformed) => self.end_with(malformed),
        }
    }

    fn value(&mut self) -> Result<Value<'a>, Malformed> {
        match self.next().ok_or(self.error(Expected::Value))? {
            '"' => self.text().map(Value::Text),
            '\'' => self.character().map(Value::Character),
            '[' => Ok(Value::List(self.items("[", "]"))),
            '{' => Ok(Value::Map(self.entries())),
            '(' => self.parenthesis(None),
            'r' if self.is_raw_text() => self.raw_text().map(Value::Text),
            c if c.is_ascii_digit() || "+-.".contains(c) => Ok(Value::Number(self.number())),
            c if is_first_of_name(c) => self.named(),
            _ => Err(self.error(Expected::Value)),
        }
    }

    fn is_raw_text(&self) -> bool {
        let hashes = self.rest()[1..].trim_start_matches('#');
        hashes.starts_with('"')
    }

    /// `r#"…"#` with any number of `#`.
    fn raw_text(&mut self) -> Result<Cow<'a, str>, Malformed> {
        let unclosed = self.error(Expected::EndOfQuotes);
        self.take("r");
        let hashes = self.take_while(|c| c == '#');
        self.take("\"");
        let end = format!("\"{hashes}");
        let rest = self.rest();
        let length = rest.find(&end).ok_or(unclosed)?;
        self.at += length + end.len();
        Ok(rest[..length].into())
    }

    fn text(&mut self) -> Result<Cow<'a, str>, Malformed> {
        let unclosed = self.error(Expected::EndOfQuotes);
        self.take("\"");
        let mut content = Cow::Borrowed(self.take_while(|c| c != '"' && c != '\\'));
        while self.take("\\") {
            let escaped = self.escaped(unclosed)?;
            let following = self.take_while(|c| c != '"' && c != '\\');
            content.to_mut().extend(escaped);
            content.to_mut().push_str(following);
        }
        if self.take("\"") {
            Ok(content)
        } else {
            Err(unclosed)
        }
    }

    /// What follows a backslash; none for a line that continues.
    fn escaped(&mut self, unclosed: Malformed) -> Result<Option<char>, Malformed> {
        if self.take("\n") || self.take("\r\n") {
            self.take_while(|c| " \t\n\r".contains(c));
            return Ok(None);
        }
        let invalid = self.error(Expected::Escape);
        let next = self.next().ok_or(unclosed)?;
        self.at += next.len_utf8();
        let code = match next {
            'n' => '\n'.into(),
            't' => '\t'.into(),
            'r' => '\r'.into(),
            '0' => 0,
            'x' => {
                let digits = self.rest().get(..2).ok_or(invalid)?;
                self.at += 2;
                let code = u32::from_str_radix(digits, 16).ok();
                code.filter(|code| *code < 128).ok_or(invalid)?
            }
            'u' => {
                self.expect("{", invalid.expected)?;
                let digits = self.take_while(|c| c.is_ascii_hexdigit());
                self.expect("}", invalid.expected)?;
                u32::from_str_radix(digits, 16).map_err(|_| invalid)?
            }
            '\'' | '"' | '\\' => next.into(),
            _ => return Err(invalid),
        };
        char::from_u32(code).map(Some).ok_or(invalid)
    }

    fn character(&mut self) -> Result<char, Malformed> {
        let invalid = self.error(Expected::Character);
        self.take("'");
        let character = if self.take("\\") {
            self.escaped(invalid)?.unwrap_or('\n')
        } else {
            let next = self.next().ok_or(invalid)?;
            self.at += next.len_utf8();
            next
        };
        if self.take("'") {
            Ok(character)
        } else {
            Err(invalid)
        }
    }

    fn number(&mut self) -> &'a str {
        let start = self.at;
        self.take_while(|c| "+-".contains(c));
        let is_part = |c: char| c.is_ascii_alphanumeric() || "._".contains(c);
        let digits = self.take_while(is_part);
        // The sign of an exponent.
        if digits.ends_with(['e', 'E']) && !digits.starts_with("0x") {
            self.take_while(|c| "+-".contains(c));
            self.take_while(is_part);
        }
        &self.text[start..self.at]
    }

    /// `Name` or `Name(…)`.
    fn named(&mut self) -> Result<Value<'a>, Malformed> {
        let name = self.name().map_err(|_| self.error(Expected::Value))?;
        let end = self.at;
        self.skip_space()?;
        if self.rest().starts_with('(') {
            return self.parenthesis(Some(name));
        }
        self.at = end;
        Ok(Value::Name(name))
    }

    /// A name; characters such as `-` are only in names after `r#`.
    fn name(&mut self) -> Result<&'a str, Malformed> {
        let start = self.at;
        let is_raw = self.take("r#");
        let is_first = self.next().is_some_and(|c| is_raw || is_first_of_name(c));
        let name = self.take_while(|c| is_of_name(c) || ".+-".contains(c));
        if name.is_empty() || !is_first || (!is_raw && name.contains(['.', '+', '-'])) {
            self.at = start;
            return Err(self.error(Expected::Name));
        }
        Ok(name)
    }

    fn items(&mut self, start: &str, end: &str) -> Vec<Node<'a>> {
        self.take(start);
        let mut items = Vec::new();
        loop {
            match self.is_at_end(end, items.is_empty()) {
                Ok(true) => return items,
                Ok(false) => items.push(self.node()),
                Err(malformed) => items.push(self.end_with(malformed)),
            }
            if self.error.is_some() {
                return items;
            }
        }
    }

    /// Passes the comma before an item unless it is the first one, or what ends all items. Whether they end.
    fn is_at_end(&mut self, end: &str, is_first: bool) -> Result<bool, Malformed> {
        self.skip_space()?;
        if self.take(end) {
            return Ok(true);
        }
        if !is_first {
            self.expect(",", Expected::Comma)?;
            self.skip_space()?;
        }
        Ok(self.take(end))
    }

    fn entries(&mut self) -> Vec<(Node<'a>, Node<'a>)> {
        self.take("{");
        let mut entries = Vec::new();
        loop {
            let key = match self.is_at_end("}", entries.is_empty()) {
                Ok(true) => return entries,
                Ok(false) => self.node(),
                Err(malformed) => self.end_with(malformed),
            };
            let value = match (key.malformed(), self.error) {
                (None, None) => self.after_colon(),
                (_, Some(malformed)) | (Some(malformed), None) => self.end_with(malformed),
            };
            entries.push((key, value));
            if self.error.is_some() {
                return entries;
            }
        }
    }

    fn after_colon(&mut self) -> Node<'a> {
        let colon = self.skip_space();
        match colon.and_then(|()| self.expect(":", Expected::Colon)) {
            Ok(()) => self.node(),
            Err(malformed) => self.end_with(malformed),
        }
    }

    fn parenthesis(&mut self, name: Option<&'a str>) -> Result<Value<'a>, Malformed> {
        self.take("(");
        self.skip_space()?;
        if self.begins_with_field()? {
            let fields = self.fields();
            return Ok(Value::Record { name, fields });
        }
        let items = self.items("", ")");
        Ok(Value::Tuple { name, items })
    }

    /// Whether the name of a field follows, and not a value.
    fn begins_with_field(&mut self) -> Result<bool, Malformed> {
        let start = self.at;
        let is_field = self.name().is_ok() && {
            self.skip_space()?;
            self.take(":")
        };
        self.at = start;
        Ok(is_field)
    }

    fn fields(&mut self) -> Vec<Field<'a>> {
        let mut fields = Vec::new();
        loop {
            match self.is_at_end(")", fields.is_empty()) {
                Ok(true) => return fields,
                Ok(false) => fields.push(self.field()),
                Err(malformed) => fields.push(self.field_at_end(malformed)),
            }
            if self.error.is_some() {
                return fields;
            }
        }
    }

    fn field(&mut self) -> Field<'a> {
        let start = self.at;
        match self.name() {
            Ok(name) => Field {
                name,
                place: start..self.at,
                value: self.after_colon(),
            },
            Err(malformed) => self.field_at_end(malformed),
        }
    }

    /// What stands for a field without a name, at which reading ends.
    fn field_at_end(&mut self, malformed: Malformed) -> Field<'a> {
        let value = self.end_with(malformed);
        let place: Range<usize> = value.place.clone();
        Field {
            name: "",
            place,
            value,
        }
    }
}

/// Whether a text is `#![enable(…)]` with names that RON has.
fn is_attribute(text: &str) -> bool {
    const NAMES: [&str; 4] = [
        "explicit_struct_names",
        "implicit_some",
        "unwrap_newtypes",
        "unwrap_variant_newtypes",
    ];
    let dense: String = text.chars().filter(|c| !is_space(*c)).collect();
    let names = dense.strip_prefix("#![enable(");
    let names = names.and_then(|names| names.strip_suffix(")]"));
    let is_known = |name: &str| name.is_empty() || NAMES.contains(&name);
    names.is_some_and(|names| names.split(',').all(is_known))
}

/// As RON's reference implementation has it.
fn is_space(c: char) -> bool {
    matches!(
        c,
        ' ' | '\t'..='\r' | '\u{85}' | '\u{200e}' | '\u{200f}' | '\u{2028}' | '\u{2029}'
    )
}

fn is_first_of_name(c: char) -> bool {
    c.is_alphabetic() || c == '_'
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}
