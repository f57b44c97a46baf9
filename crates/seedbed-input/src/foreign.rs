//! Syntax of other languages in RON files: what to write instead.
//!
//! The parser says what it expected. This module looks at the tokens around the place where it
//! stopped, and recognizes what people write who are used to Python, JSON, YAML or Rust.

use seedbed_settings::Expected;

use super::deserializer::{Problem, Type};
use super::kind::block_comment_length;
use super::names::shown;

/// What is added to an error, or replaces parts of it.
#[derive(Default)]
pub(crate) struct Correction {
    pub(crate) place_and_message: Option<(usize, String)>,
    pub(crate) help: Option<String>,
}

/// A token of a RON file: a text in quotes, a word or number, or a single character.
#[derive(Clone, Copy)]
struct Token<'a> {
    start: usize,
    text: &'a str,
}

/// Quotes that word processors write, and single quotes.
const OTHER_QUOTES: [char; 9] = ['\'', '`', '“', '”', '„', '‘', '’', '«', '»'];

/// Explains foreign syntax at the byte where reading has stopped, if there is any.
pub(crate) fn correct(text: &str, stopped: usize, problem: &Problem) -> Correction {
    if is_about_a_value(problem) {
        return Correction::default();
    }
    let tokens = tokens(text);
    let index = tokens.partition_point(|token| token.end() <= stopped);
    let reach = tokens.len().min(index + 1);
    let never_valid = (0..reach).find_map(|found| {
        let (message, help) = never_valid(text, &tokens, found)?;
        Some(Correction {
            place_and_message: Some((tokens[found].start, message)),
            help: Some(help),
        })
    });
    let place = Place {
        text,
        tokens: &tokens,
        index,
    };
    never_valid.unwrap_or_else(|| place.correct(problem))
}

/// Whether the syntax is right, and a name or a value is wrong.
fn is_about_a_value(problem: &Problem) -> bool {
    use Problem::{Syntax, TooMany, WrongLength, WrongType};
    let is_number = matches!(problem, WrongType(Type::WholeNumber(_), Some(_)));
    let is_about_syntax = matches!(
        problem,
        Syntax(_) | WrongType(..) | WrongLength { .. } | TooMany | Problem::OtherName { .. }
    );
    is_number || !is_about_syntax
}

impl<'a> Token<'a> {
    fn end(&self) -> usize {
        self.start + self.text.len()
    }

    /// Content of a text in quotes.
    fn quoted(&self) -> Option<&'a str> {
        self.text.strip_prefix('"')?.strip_suffix('"')
    }

    fn is_number(&self) -> bool {
        let digits = self.text.trim_start_matches(['-', '+', '.']);
        digits.starts_with(|c: char| c.is_ascii_digit())
    }

    fn is_word(&self) -> bool {
        self.text
            .starts_with(|c: char| c.is_alphabetic() || c == '_')
    }
}

/// The message and the help for a token that is in no RON file of this program.
fn never_valid(text: &str, tokens: &[Token<'_>], index: usize) -> Option<(String, String)> {
    let token = tokens[index];
    let next = tokens.get(index + 1);
    match token.text.chars().next()? {
        '#' if next.is_none_or(|next| next.text != "!") => Some((
            "`#` does not begin a comment".to_owned(),
            "write `// …`".to_owned(),
        )),
        quote if OTHER_QUOTES.contains(&quote) => {
            let line = text[token.end()..].lines().next().unwrap_or_default();
            let content = line.split(OTHER_QUOTES).next().unwrap_or_default();
            let is_closed = content.len() < line.len();
            let content = if is_closed { content } else { "…" };
            Some((
                format!("expected text in double quotes, found `{quote}`"),
                format!("write `\"{content}\"`"),
            ))
        }
        ';' => {
            let help = match next {
                Some(_) => "write `,`",
                None => "remove it: nothing follows the last parenthesis",
            };
            Some(("`;` ends nothing".to_owned(), help.to_owned()))
        }
        '=' if index > 0 => Some((
            "expected `:` between the name of a field and its value, found `=`".to_owned(),
            format!("write `{}: …`", name(tokens[index - 1])),
        )),
        _ => None,
    }
}

/// The name of a field, which may be in quotes.
fn name(token: Token<'_>) -> &str {
    token.quoted().unwrap_or(token.text)
}

/// The token where the parser has stopped.
struct Place<'a> {
    text: &'a str,
    tokens: &'a [Token<'a>],
    index: usize,
}

impl<'a> Place<'a> {
    fn correct(&self, problem: &Problem) -> Correction {
        if let Some(name) = self.name_without_parentheses(problem) {
            let values = "with its values in the parentheses, or none for its defaults";
            return help(Some(format!("write `{name}()`, {values}")));
        }
        let Some(token) = self.token(0) else {
            return help(self.unclosed_bracket());
        };
        match problem {
            Problem::WrongType(Type::Boolean, _) => boolean(token),
            Problem::WrongType(Type::WholeNumber(_) | Type::Number, _) => help(number(token)),
            Problem::WrongType(Type::List, _) => help(self.list(token)),
            Problem::Syntax(Expected::EndOfQuotes) => Correction::default(),
            _ => help(self.other(token, problem)),
        }
    }

    /// The name of a variant with values that none follow.
    fn name_without_parentheses(&self, problem: &Problem) -> Option<&'a str> {
        let expects_parenthesis = matches!(problem, Problem::WrongType(Type::Struct(""), _));
        let opens = self.token(0).is_some_and(|next| "([{".contains(next.text));
        let name = self.token(-1).filter(Token::is_word)?;
        (expects_parenthesis && !opens).then_some(name.text)
    }

    /// Token number `offset` from the place.
    fn token(&self, offset: isize) -> Option<Token<'a>> {
        let index = self.index.checked_add_signed(offset)?;
        self.tokens.get(index).copied()
    }

    /// Whether a comma was written for a decimal point, as in `0,99`.
    fn is_decimal_comma(&self, token: Token<'_>) -> bool {
        let before = self.token(-1).zip(self.token(-2));
        before.is_some_and(|(comma, whole)| {
            comma.text == ","
                && whole.is_number()
                && whole.end() == comma.start
                && comma.end() == token.start
                && token.is_number()
        })
    }

    /// Whether a value follows.
    fn is_key(&self) -> bool {
        self.token(1).is_some_and(|next| next.text == ":")
    }

    fn list(&self, token: Token<'_>) -> Option<String> {
        if token.text == "(" || token.text == "{" {
            let line = self.text[token.end()..].lines().next().unwrap_or_default();
            let inner = line.split([')', '}']).next().filter(|inner| *inner != line);
            return Some(format!(
                "write a list in brackets: `[{}]`",
                inner.unwrap_or("…")
            ));
        }
        let is_value = token.is_number() || token.quoted().is_some();
        is_value.then(|| format!("write a list in brackets: `[{}]`", token.text))
    }

    fn other(&self, token: Token<'a>, problem: &Problem) -> Option<String> {
        let next = self.token(1);
        let before = self.token(-1);
        if self.is_decimal_comma(token) {
            let whole = self.token(-2)?;
            return Some(format!(
                "write `{}.{}`, with a decimal point",
                whole.text, token.text
            ));
        }
        match token.text {
            "{" => return fields_in_braces(next),
            ")" | "]" | "}" => return self.unmatched_bracket(token),
            "+" | "*" | "/" | "^" | "%" => return Some(NO_ARITHMETIC.to_owned()),
            _ => {}
        }
        if before.is_some_and(|before| "+*/^%".contains(before.text)) {
            return Some(NO_ARITHMETIC.to_owned());
        }
        if let Some(name) = token.quoted().filter(|_| self.is_key()) {
            return Some(format!(
                "write the name of a field without quotes: `{name}: …`"
            ));
        }
        match problem {
            Problem::Syntax(Expected::Comma) | Problem::TooMany => {
                missing_comma(self.text, before?, token)
            }
            _ => number(token),
        }
    }

    /// The brackets that are open before the place.
    fn open_brackets(&self) -> Vec<Token<'a>> {
        let mut open = Vec::new();
        for token in &self.tokens[..self.index] {
            match token.text {
                "(" | "[" | "{" => open.push(*token),
                ")" | "]" | "}" => {
                    open.pop();
                }
                _ => {}
            }
        }
        open
    }

    fn unclosed_bracket(&self) -> Option<String> {
        let open = self.open_brackets().pop()?;
        let line = line(self.text, open.start);
        Some(format!("the `{}` in line {line} is not closed", open.text))
    }

    fn unmatched_bracket(&self, found: Token<'_>) -> Option<String> {
        let open = self.open_brackets().pop()?;
        let expected = match open.text {
            "(" => ")",
            "[" => "]",
            _ => "}",
        };
        let line = line(self.text, open.start);
        (found.text != expected).then(|| {
            format!(
                "write `{expected}`, which closes the `{}` in line {line}",
                open.text
            )
        })
    }
}

const NO_ARITHMETIC: &str = "nothing is computed here: write the result";

fn help(help: Option<String>) -> Correction {
    Correction {
        place_and_message: None,
        help,
    }
}

/// Something that is not written as `true` or `false`.
fn boolean(token: Token<'_>) -> Correction {
    let meant = match token.text.trim_matches('"').to_lowercase().as_str() {
        "true" | "yes" | "on" | "1" => Some("true"),
        "false" | "no" | "off" | "0" => Some("false"),
        _ => None,
    };
    let message = format!("expected `true` or `false`, found `{}`", shown(token.text));
    Correction {
        place_and_message: Some((token.start, message)),
        help: meant.map(|meant| format!("write `{meant}`")),
    }
}

/// Something that is no number where one is expected, or no value.
fn number(token: Token<'_>) -> Option<String> {
    if let Some(number) = token.quoted().filter(|text| text.parse::<f64>().is_ok()) {
        return Some(format!("write `{number}` without quotes"));
    }
    let is_nothing = ["null", "nil", "none"].contains(&token.text.to_lowercase().as_str());
    let is_written_otherwise = is_nothing && token.text != "None";
    is_written_otherwise.then(|| "write `None`".to_owned())
}

/// The place where a comma is missing, if a field or value follows.
fn missing_comma(text: &str, before: Token<'_>, found: Token<'_>) -> Option<String> {
    let follows = found.is_word() || found.is_number() || found.text.starts_with(['(', '[', '"']);
    if [",", ":", "(", "[", "{"].contains(&before.text) || before.text.contains('\n') {
        return None;
    }
    let line = line(text, before.start);
    follows.then(|| {
        format!(
            "write a comma after `{}` in line {}",
            shown(before.text),
            line
        )
    })
}

/// The line of a byte, counted from 1.
fn line(text: &str, offset: usize) -> usize {
    text[..offset].matches('\n').count() + 1
}

/// The tokens of a text, without spaces and comments.
fn tokens(text: &str) -> Vec<Token<'_>> {
    let mut tokens = Vec::new();
    let mut start = 0;
    while let Some(first) = text[start..].chars().next() {
        let rest = &text[start..];
        if first.is_whitespace() {
            start += first.len_utf8();
        } else if rest.starts_with("//") {
            start += rest.find('\n').unwrap_or(rest.len());
        } else if rest.starts_with("/*") {
            start += block_comment_length(rest).unwrap_or(rest.len());
        } else {
            let length = token_length(rest, first);
            tokens.push(Token {
                start,
                text: &rest[..length],
            });
            start += length;
        }
    }
    tokens
}

fn token_length(text: &str, first: char) -> usize {
    if first == '"' {
        return string_length(text);
    }
    if let Some(length) = raw_string_length(text) {
        return length;
    }
    let is_number = text
        .trim_start_matches(['-', '+'])
        .trim_start_matches('.')
        .starts_with(|c: char| c.is_ascii_digit());
    let mut previous = first;
    let mut is_part = |c: char| {
        let is_exponent_sign = is_number && matches!(previous, 'e' | 'E') && matches!(c, '-' | '+');
        let is_in_number = is_number && c == '.';
        previous = c;
        c.is_alphanumeric() || c == '_' || is_in_number || is_exponent_sign
    };
    if let Some(name) = text.strip_prefix("r#") {
        let is_part = |c: char| c.is_alphanumeric() || c == '_';
        return 2 + name.find(|c| !is_part(c)).unwrap_or(name.len());
    }
    if !first.is_alphanumeric() && first != '_' && !is_number {
        return first.len_utf8();
    }
    let rest = &text[first.len_utf8()..];
    first.len_utf8() + rest.find(|c: char| !is_part(c)).unwrap_or(rest.len())
}

/// Length of a text in quotes, to the end of the file if there is no closing quote.
fn string_length(text: &str) -> usize {
    let mut is_escaped = false;
    for (index, character) in text.char_indices().skip(1) {
        match character {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' => return index + 1,
            _ => {}
        }
    }
    text.len()
}

/// Length of a text such as `r"…"` or `r#"…"#`.
fn raw_string_length(text: &str) -> Option<usize> {
    let rest = text.strip_prefix('r')?;
    let hashes = rest.len() - rest.trim_start_matches('#').len();
    let content = rest[hashes..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(hashes));
    let begin = text.len() - content.len();
    Some(
        content
            .find(&end)
            .map_or(text.len(), |found| begin + found + end.len()),
    )
}

/// What to write instead of fields or values in braces.
fn fields_in_braces(first: Option<Token<'_>>) -> Option<String> {
    let name = first.map(name).filter(|name| *name != "}")?;
    if name.starts_with(|start: char| start.is_ascii_digit() || start == '-') {
        return Some(format!("write values in parentheses: `({})`", shown(name)));
    }
    Some(format!(
        "write fields in parentheses: `({}: …)`",
        shown(name)
    ))
}
