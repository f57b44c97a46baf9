//! Why a text falls into no words at all: the parser only says that it does not.

use super::compile::Mistake;

/// Openers with their closers.
const PAIRS: [(char, char); 3] = [('(', ')'), ('{', '}'), ('[', ']')];

/// Characters beside letters, digits and brackets of which formulas consist.
const SIGNS: &str = "+-*/%<>=!&|^~,.;:_#?@$";

/// A character of a formula: line, character within the line, both from 0, and the character itself.
type Placed = (usize, usize, char);

/// The first bracket that is closed wrongly or never, or else the first character that no formula has.
pub(super) fn broken_word(text: &str) -> Option<Mistake> {
    unbalanced(text).or_else(|| {
        characters(text)
            .find(|&(_, _, found)| is_foreign(found))
            .map(foreign)
    })
}

fn unbalanced(text: &str) -> Option<Mistake> {
    let mut open: Vec<(Placed, char)> = Vec::new();
    for placed in characters(text) {
        if let Some((_, closer)) = PAIRS.iter().find(|(opener, _)| *opener == placed.2) {
            open.push((placed, *closer));
        } else if PAIRS.iter().any(|(_, closer)| *closer == placed.2) {
            match open.pop() {
                None => return Some(mistake(placed, format!("`{}` closes nothing", placed.2))),
                Some((_, closer)) if closer == placed.2 => (),
                Some(((_, _, opener), closer)) => {
                    let message = format!(
                        "expected `{closer}`, which closes the last `{opener}`, found `{}`",
                        placed.2
                    );
                    return Some(mistake(placed, message));
                }
            }
        }
    }
    open.pop().map(|(placed, closer)| {
        mistake(
            placed,
            format!("this `{}` is never closed by `{closer}`", placed.2),
        )
    })
}

fn is_foreign(found: char) -> bool {
    !(found.is_alphabetic()
        || found.is_ascii_digit()
        || found.is_ascii_whitespace()
        || SIGNS.contains(found)
        || is_bracket(found))
}

fn is_bracket(found: char) -> bool {
    PAIRS
        .iter()
        .any(|&(opener, closer)| found == opener || found == closer)
}

fn foreign(placed: Placed) -> Mistake {
    mistake(
        placed,
        format!("`{}` is not part of a formula", placed.2.escape_debug()),
    )
}

fn mistake((line, column, _): Placed, message: String) -> Mistake {
    Mistake {
        message,
        help: None,
        line,
        column,
    }
}

fn characters(text: &str) -> impl Iterator<Item = Placed> {
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
    fn each_break_is_found_where_it_is() {
        for (text, line, column, part) in [
            ("(x", 0, 0, "this `(` is never closed by `)`"),
            ("max(x, (1)", 0, 3, "never closed"),
            ("x\n + y)", 1, 4, "`)` closes nothing"),
            (
                "if x { (1 }",
                0,
                10,
                "expected `)`, which closes the last `(`",
            ),
            ("θ + x²", 0, 5, "`²` is not part"),
            ("1 + `x`", 0, 4, "is not part"),
        ] {
            let mistake = broken_word(text).expect("it is broken");
            assert_eq!(
                (mistake.line, mistake.column),
                (line, column),
                "{text}: {}",
                mistake.message
            );
            assert!(
                mistake.message.contains(part),
                "{text}: {}",
                mistake.message
            );
        }
        assert_eq!(broken_word("if x { (1) } else { y[0] }"), None);
    }
}
