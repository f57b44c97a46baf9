//! Finds why a text cannot be split into tokens, which the parser's error does not include.

use super::error::ExpressionError;

/// Opening brackets with their closing ones.
const BRACKET_PAIRS: [(char, char); 3] = [('(', ')'), ('{', '}'), ('[', ']')];

/// Characters of formulas besides letters, digits and brackets.
const OTHER_CHARACTERS: &str = "+-*/%<>=!&|^~,.;:_#?@$";

/// A character of a formula: its line, its column (both from 0), and the character itself.
type LocatedChar = (usize, usize, char);

/// The first bracket that does not match, or else the first character that formulas cannot contain.
pub(super) fn tokenization_error(text: &str) -> Option<ExpressionError> {
    unbalanced_bracket(text).or_else(|| {
        characters(text)
            .find(|&(_, _, found)| !is_allowed(found))
            .map(forbidden_character)
    })
}

fn unbalanced_bracket(text: &str) -> Option<ExpressionError> {
    let mut open: Vec<(LocatedChar, char)> = Vec::new();
    for located in characters(text) {
        if let Some((_, closer)) = BRACKET_PAIRS
            .iter()
            .find(|(opener, _)| *opener == located.2)
        {
            open.push((located, *closer));
        } else if BRACKET_PAIRS.iter().any(|(_, closer)| *closer == located.2) {
            match open.pop() {
                None => {
                    return Some(error(
                        located,
                        format!("this `{}` has no opening bracket", located.2),
                    ));
                }
                Some((_, closer)) if closer == located.2 => (),
                Some(((_, _, opener), closer)) => {
                    let message = format!(
                        "expected `{closer}` to close the last `{opener}`, found `{}`",
                        located.2
                    );
                    return Some(error(located, message));
                }
            }
        }
    }
    open.pop().map(|(located, closer)| {
        error(
            located,
            format!("this `{}` has no closing `{closer}`", located.2),
        )
    })
}

/// Whether a token of a formula can contain the character.
fn is_allowed(found: char) -> bool {
    found.is_alphabetic()
        || found.is_ascii_digit()
        || found.is_ascii_whitespace()
        || OTHER_CHARACTERS.contains(found)
        || is_bracket(found)
}

fn is_bracket(found: char) -> bool {
    BRACKET_PAIRS
        .iter()
        .any(|&(opener, closer)| found == opener || found == closer)
}

fn forbidden_character(located: LocatedChar) -> ExpressionError {
    let message = format!("`{}` is not allowed in a formula", located.2.escape_debug());
    ExpressionError {
        help: written_otherwise(located.2).map(str::to_owned),
        ..error(located, message)
    }
}

/// How to write what a mathematical sign means.
fn written_otherwise(sign: char) -> Option<&'static str> {
    match sign {
        '≤' => Some("write `<=`"),
        '≥' => Some("write `>=`"),
        '≠' => Some("write `!=`"),
        '·' | '×' | '∗' => Some("write `*`"),
        '÷' => Some("write `/`"),
        '−' | '–' => Some("write `-`"),
        '²' | '³' => Some("write a power as `pow(x, y)`"),
        '∧' => Some("write `&&`"),
        '∨' => Some("write `||`"),
        '¬' => Some("write `!`"),
        '√' => Some("write `sqrt(x)`"),
        _ => None,
    }
}

fn error((line, column, _): LocatedChar, message: String) -> ExpressionError {
    ExpressionError {
        message,
        help: None,
        line,
        column,
    }
}

fn characters(text: &str) -> impl Iterator<Item = LocatedChar> {
    let lines = text.split('\n').enumerate();
    lines.flat_map(|(line, text)| {
        text.chars()
            .enumerate()
            .map(move |(column, found)| (line, column, found))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_located() {
        for (text, line, column, part) in [
            ("(x", 0, 0, "this `(` has no closing `)`"),
            ("max(x, (1)", 0, 3, "has no closing"),
            ("x\n + y)", 1, 4, "this `)` has no opening bracket"),
            ("if x { (1 }", 0, 10, "expected `)` to close the last `(`"),
            ("θ + x²", 0, 5, "`²` is not allowed"),
            ("1 + `x`", 0, 4, "is not allowed"),
        ] {
            let error = tokenization_error(text).expect("the formula is invalid");
            assert_eq!(
                (error.line, error.column),
                (line, column),
                "{text}: {}",
                error.message
            );
            assert!(error.message.contains(part), "{text}: {}", error.message);
        }
        let error = tokenization_error("x ≤ 1").expect("the formula is invalid");
        assert_eq!(error.help.as_deref(), Some("write `<=`"));
        assert_eq!(tokenization_error("if x { (1) } else { y[0] }"), None);
    }
}
