//! Text that people read or copy: counted nouns and command lines.

use std::borrow::Cow;

/// Number and noun, such as `1 run` and `3 runs`.
#[must_use]
pub fn pluralize(count: usize, noun: &str) -> String {
    if count == 1 {
        format!("1 {noun}")
    } else {
        format!("{count} {noun}s")
    }
}

/// A word of a command line, quoted where a POSIX shell would otherwise change it.
#[must_use]
pub fn shell_word(word: &str) -> Cow<'_, str> {
    // Only a word with a zero byte cannot be quoted, and no argument of a process has one.
    shlex::try_quote(word).unwrap_or(Cow::Borrowed(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_has_no_plural() {
        assert_eq!(
            [0, 1, 2].map(|count| pluralize(count, "run")),
            ["0 runs", "1 run", "2 runs"]
        );
    }

    #[test]
    fn a_shell_takes_a_quoted_word_for_one() {
        for word in [
            "plain/path.ron",
            "agents.seeds=Normal(sigma: 9)",
            "it's",
            "$HOME; rm *",
            "a&b",
            "\"quoted\"",
            "σ 0.1",
            "",
        ] {
            let split = shlex::split(&shell_word(word));
            assert_eq!(split, Some(vec![word.to_owned()]), "{word}");
        }
        assert_eq!(shell_word("plain/path.ron"), "plain/path.ron");
    }
}
