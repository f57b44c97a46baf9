//! Reads RON texts: `value := scalar | text | name | name? '(' fields | items ')' | '[' items ']' | '{' entries '}'`.

use super::tree::{Field, Malformed, Node, Tree, Value};

/// Largest number of brackets within each other.
const MAX_DEPTH: usize = 256;

impl Tree {
    /// Reads a RON text.
    ///
    /// # Errors
    /// The text is no RON.
    pub fn parse(text: &str) -> Result<Self, Malformed> {
        parse(text).map(|root| Self { root })
    }
}

/// Reads a text that is one value.
fn parse(text: &str) -> Result<Node, Malformed> {
    let mut parser = Parser {
        text,
        at: 0,
        depth: 0,
    };
    parser.skip_byte_order_mark();
    parser.skip_extensions()?;
    let node = parser.node()?;
    parser.skip_space()?;
    if parser.at == text.len() {
        Ok(node)
    } else {
        Err(parser.error("the end of the text"))
    }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
}

impl<'a> Parser<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn error(&self, expected: &'static str) -> Malformed {
        Malformed {
            at: self.at,
            expected,
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

    fn expect(&mut self, token: &str, expected: &'static str) -> Result<(), Malformed> {
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

    fn skip_byte_order_mark(&mut self) {
        self.take("\u{feff}");
    }

    /// Passes `#![enable(…)]`.
    fn skip_extensions(&mut self) -> Result<(), Malformed> {
        self.skip_space()?;
        while self.take("#![") {
            let end = self.rest().find(']').ok_or(self.error("`]`"))?;
            self.at += end + 1;
            self.skip_space()?;
        }
        Ok(())
    }

    /// Passes spaces and comments; block comments can contain others.
    fn skip_space(&mut self) -> Result<(), Malformed> {
        loop {
            self.take_while(char::is_whitespace);
            if self.take("//") {
                self.take_while(|c| c != '\n');
            } else if self.take("/*") {
                self.skip_block_comment()?;
            } else {
                return Ok(());
            }
        }
    }

    fn skip_block_comment(&mut self) -> Result<(), Malformed> {
        let mut open = 1;
        while open > 0 {
            if self.take("/*") {
                open += 1;
            } else if self.take("*/") {
                open -= 1;
            } else {
                let next = self.next().ok_or(self.error("`*/`"))?;
                self.at += next.len_utf8();
            }
        }
        Ok(())
    }

    fn node(&mut self) -> Result<Node, Malformed> {
        self.skip_space()?;
        if self.depth == MAX_DEPTH {
            return Err(self.error("fewer brackets within each other"));
        }
        self.depth += 1;
        let start = self.at;
        let value = self.value()?;
        self.depth -= 1;
        Ok(Node {
            place: start..self.at,
            value,
        })
    }

    fn value(&mut self) -> Result<Value, Malformed> {
        match self.next().ok_or(self.error("a value"))? {
            '"' => self.text().map(Value::Text),
            '\'' => self.character(),
            '[' => self.list(),
            '{' => self.map(),
            '(' => self.parenthesis(None),
            'r' if self.is_raw_text() => self.raw_text().map(Value::Text),
            'b' if self.rest().starts_with("b\"") => {
                self.take("b");
                self.text().map(Value::Text)
            }
            c if c.is_ascii_digit() || "+-.".contains(c) => self.number(),
            _ => self.named(),
        }
    }

    fn is_raw_text(&self) -> bool {
        let hashes = self.rest()[1..].trim_start_matches('#');
        hashes.starts_with('"')
    }

    /// `r#"…"#` with any number of `#`.
    fn raw_text(&mut self) -> Result<String, Malformed> {
        self.take("r");
        let hashes = self.take_while(|c| c == '#');
        self.expect("\"", "`\"`")?;
        let end = format!("\"{hashes}");
        let rest = self.rest();
        let length = rest.find(&end).ok_or(self.error("the end of a text"))?;
        self.at += length + end.len();
        Ok(rest[..length].to_owned())
    }

    fn text(&mut self) -> Result<String, Malformed> {
        self.expect("\"", "`\"`")?;
        let mut content = String::new();
        loop {
            let next = self.next().ok_or(self.error("the end of a text"))?;
            self.at += next.len_utf8();
            match next {
                '"' => return Ok(content),
                '\\' => content.extend(self.escaped()?),
                _ => content.push(next),
            }
        }
    }

    /// What follows a backslash; none for a line that continues.
    fn escaped(&mut self) -> Result<Option<char>, Malformed> {
        let next = self.next().ok_or(self.error("an escape"))?;
        self.at += next.len_utf8();
        Ok(Some(match next {
            'n' => '\n',
            't' => '\t',
            'r' => '\r',
            '0' => '\0',
            'x' => {
                let digits = self.rest().get(..2).ok_or(self.error("two digits"))?;
                self.at += 2;
                self.code_point(digits)?
            }
            'u' => {
                self.expect("{", "`{`")?;
                let digits = self.take_while(|c| c.is_ascii_hexdigit());
                self.expect("}", "`}`")?;
                self.code_point(digits)?
            }
            '\n' | '\r' => {
                self.take_while(char::is_whitespace);
                return Ok(None);
            }
            other => other,
        }))
    }

    fn code_point(&self, digits: &str) -> Result<char, Malformed> {
        let code = u32::from_str_radix(digits, 16).ok();
        code.and_then(char::from_u32)
            .ok_or(self.error("the number of a character"))
    }

    fn character(&mut self) -> Result<Value, Malformed> {
        self.take("'");
        let next = self.next().ok_or(self.error("a character"))?;
        self.at += next.len_utf8();
        let character = if next == '\\' {
            self.escaped()?.unwrap_or('\n')
        } else {
            next
        };
        self.expect("'", "`'`")?;
        Ok(Value::Scalar(format!("{character:?}")))
    }

    fn number(&mut self) -> Result<Value, Malformed> {
        let start = self.at;
        let sign = self.take_while(|c| "+-".contains(c));
        let is_part = |c: char| c.is_ascii_alphanumeric() || "._".contains(c);
        let mut digits = self.take_while(is_part);
        // The sign of an exponent.
        if digits.ends_with(['e', 'E']) && !digits.starts_with("0x") {
            self.take_while(|c| "+-".contains(c));
            self.take_while(is_part);
            digits = &self.text[start + sign.len()..self.at];
        }
        match canonical_number(sign, digits) {
            Some(number) => Ok(Value::Scalar(number)),
            None => Err(Malformed {
                at: start,
                expected: "a number",
            }),
        }
    }

    /// `Name`, `Name(…)`, `true`, `inf`.
    fn named(&mut self) -> Result<Value, Malformed> {
        let name = self.name()?;
        if ["true", "false", "inf", "NaN"].contains(&name) {
            return Ok(Value::Scalar(name.to_owned()));
        }
        let end = self.at;
        self.skip_space()?;
        if self.next() == Some('(') {
            return self.parenthesis(Some(name.to_owned()));
        }
        self.at = end;
        Ok(Value::Tuple {
            name: Some(name.to_owned()),
            items: Vec::new(),
        })
    }

    fn name(&mut self) -> Result<&'a str, Malformed> {
        self.take("r#");
        let name = self.take_while(|c| c.is_alphanumeric() || "_.+-".contains(c));
        if name.is_empty() {
            return Err(self.error("a name"));
        }
        Ok(name)
    }

    fn list(&mut self) -> Result<Value, Malformed> {
        self.take("[");
        self.items("]").map(Value::List)
    }

    fn items(&mut self, end: &str) -> Result<Vec<Node>, Malformed> {
        let mut items = Vec::new();
        self.skip_space()?;
        while !self.take(end) {
            items.push(self.node()?);
            self.separator(end)?;
        }
        Ok(items)
    }

    /// The comma after an item, or what ends all items.
    fn separator(&mut self, end: &str) -> Result<(), Malformed> {
        self.skip_space()?;
        if !self.take(",") && !self.rest().starts_with(end) {
            return Err(self.error("a comma"));
        }
        self.skip_space()
    }

    fn map(&mut self) -> Result<Value, Malformed> {
        self.take("{");
        let mut entries = Vec::new();
        self.skip_space()?;
        while !self.take("}") {
            let key = self.node()?;
            self.skip_space()?;
            self.expect(":", "`:`")?;
            entries.push((key, self.node()?));
            self.separator("}")?;
        }
        Ok(Value::Map(entries))
    }

    fn parenthesis(&mut self, name: Option<String>) -> Result<Value, Malformed> {
        self.take("(");
        self.skip_space()?;
        if self.begins_with_field()? {
            let fields = self.fields()?;
            return Ok(Value::Record { name, fields });
        }
        let items = self.items(")")?;
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

    fn fields(&mut self) -> Result<Vec<Field>, Malformed> {
        let mut fields = Vec::new();
        while !self.take(")") {
            let start = self.at;
            let name = self.name()?.to_owned();
            self.skip_space()?;
            self.expect(":", "`:`")?;
            let value = self.node()?;
            self.skip_space()?;
            self.take(",");
            let place = start..self.at;
            fields.push(Field { name, place, value });
            self.skip_space()?;
        }
        Ok(fields)
    }
}

/// A number as it is written in identities: whole numbers in full, others with the fewest digits that read back the
/// same.
fn canonical_number(sign: &str, digits: &str) -> Option<String> {
    let digits = digits.replace('_', "");
    let sign = match sign {
        "" | "+" => "",
        "-" => "-",
        _ => return None,
    };
    if let Some(whole) = whole_number(&digits) {
        return Some(format!("{sign}{whole}"));
    }
    if ["inf", "NaN"].contains(&digits.as_str()) {
        return Some(format!("{sign}{digits}"));
    }
    let number: f64 = digits
        .trim_end_matches("f32")
        .trim_end_matches("f64")
        .parse()
        .ok()?;
    Some(format!("{sign}{number}"))
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
