//! Text that people read or copy: counted nouns, numbers, names of files and command lines.

use std::borrow::Cow;
use std::path::Path;

/// Number and noun, such as `1 run` and `3 runs`.
#[must_use]
pub fn pluralize(count: usize, noun: &str) -> String {
    if count == 1 {
        format!("1 {noun}")
    } else {
        format!("{count} {noun}s")
    }
}

/// A decimal number as text without trailing zeros, such as `1.5` for `1.500`; `0` for `-0.0`.
#[must_use]
pub fn without_trailing_zeros(number: &str) -> &str {
    let short = if number.contains('.') {
        number.trim_end_matches('0').trim_end_matches('.')
    } else {
        number
    };
    if short == "-0" { "0" } else { short }
}

/// Name of a file without its extension; `fallback` for a path without a file name, such as `..`.
#[must_use]
pub fn file_stem(path: &Path, fallback: &str) -> String {
    path.file_stem().map_or_else(
        || fallback.to_owned(),
        |stem| stem.to_string_lossy().into_owned(),
    )
}

/// A word of a command line, in quotes if a POSIX shell would change it without them.
#[must_use]
pub fn shell_word(word: &str) -> Cow<'_, str> {
    // Only a word with a zero byte cannot be quoted, and no argument of a process has one.
    shlex::try_quote(word).unwrap_or(Cow::Borrowed(word))
}

/// Whether a character is for the control of devices, or changes the direction of text: names have no
/// need of it, and it can hide or change what is around it.
fn is_invisible_control(character: char) -> bool {
    let changes_direction = matches!(character, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    character.is_control() || changes_direction
}

/// Text for a terminal: invisible controls other than the end of a line and tabs are escape sequences as in
/// JSON, such as `\u001b`, so that names in files do not control the terminal, and JSON stays JSON.
#[must_use]
pub fn terminal(text: &str) -> Cow<'_, str> {
    let is_escaped = |character| is_invisible_control(character) && !"\n\t".contains(character);
    if !text.contains(is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::new();
    for character in text.chars() {
        if is_escaped(character) {
            shown += &escape_sequence(character);
        } else {
            shown.push(character);
        }
    }
    Cow::Owned(shown)
}

/// Text for a part of a line on a terminal: like [`terminal`], and without further lines and tabs, so that
/// a name cannot look like a row of a table.
#[must_use]
pub fn terminal_line(text: &str) -> String {
    let escaped = |character: char| {
        if is_invisible_control(character) {
            escape_sequence(character)
        } else {
            character.to_string()
        }
    };
    text.chars().map(escaped).collect()
}

fn escape_sequence(character: char) -> String {
    format!("\\u{:04x}", u32::from(character))
}

/// A finished HTML page, in which invisible controls of names are replaced by `�`; other markup of names was
/// escaped when they were put into the page.
#[must_use]
pub fn html_page(page: maud::Markup) -> String {
    let is_replaced = |character| is_invisible_control(character) && !"\n\t".contains(character);
    page.into_string().replace(is_replaced, "\u{fffd}")
}

/// JSON as the content of a script element: no text in it can end the element or begin a comment, and it
/// has no invisible controls, which [`html_page`] would replace.
#[must_use]
pub fn json_in_script(json: &str) -> String {
    terminal(json).replace('<', "\\u003c")
}

/// Text as a cell of a Markdown table: like [`markdown_line`], and without the marks between cells.
#[must_use]
pub fn markdown_cell(text: &str) -> String {
    markdown_line(text).replace('|', "\\|")
}

/// Text as a line of Markdown outside tables: without further lines, HTML elements, links and images.
#[must_use]
pub fn markdown_line(text: &str) -> String {
    let mut cell = String::new();
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        let next = characters.peek();
        let begins_element = |next: &char| next.is_ascii_alphabetic() || "/!?".contains(*next);
        match character {
            '[' | ']' | '\\' => {
                cell.push('\\');
                cell.push(character);
            }
            '<' if next.is_some_and(begins_element) => cell += "&lt;",
            other if is_invisible_control(other) => cell.push(' '),
            other => cell.push(other),
        }
    }
    cell
}

/// What the text of a cell begins with that spreadsheets take for a formula, and the mark for text.
const NOT_PLAIN_TEXT: [char; 7] = ['=', '+', '-', '@', '\t', '\r', '\''];

/// Text as a cell of a CSV table that a spreadsheet shows as text and never takes for a formula: an
/// apostrophe is put before it if needed, and invisible controls are as in [`terminal`].
/// [`from_spreadsheet_cell`] is the inverse.
#[must_use]
pub fn spreadsheet_cell(text: &str) -> Cow<'_, str> {
    let shown = terminal(text);
    if text.starts_with(NOT_PLAIN_TEXT) {
        Cow::Owned(format!("'{shown}"))
    } else {
        shown
    }
}

/// The text of a [`spreadsheet_cell`].
#[must_use]
pub fn from_spreadsheet_cell(cell: &str) -> Cow<'_, str> {
    let text = cell.strip_prefix('\'');
    let shown = text.unwrap_or(cell);
    let mut text = String::new();
    let mut rest = shown;
    while let Some(start) = rest.find("\\u") {
        let digits = rest.get(start + 2..start + 6).unwrap_or_default();
        let character = u32::from_str_radix(digits, 16)
            .ok()
            .and_then(char::from_u32);
        if let Some(character) = character.filter(|character| is_invisible_control(*character)) {
            text += &rest[..start];
            text.push(character);
            rest = &rest[start + 6..];
        } else {
            text += &rest[..start + 2];
            rest = &rest[start + 2..];
        }
    }
    text += rest;
    // An apostrophe before plain text is part of it.
    if cell.len() > shown.len() && !text.starts_with(NOT_PLAIN_TEXT) {
        text.insert(0, '\'');
    }
    Cow::Owned(text)
}

/// The lines of a table, with two spaces between columns. The first column is aligned to the left,
/// the others to the right. All rows have as many cells as the first one. Each cell is a
/// [`terminal_line`].
#[must_use]
pub fn align_columns(rows: &[Vec<String>]) -> Vec<String> {
    let shown = |row: &Vec<String>| row.iter().map(|cell| terminal_line(cell)).collect();
    let rows: Vec<Vec<String>> = rows.iter().map(shown).collect();
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells.max().unwrap_or(0)
    };
    let columns = rows.first().map_or(0, Vec::len);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let padding = |cell: &String, width: usize| " ".repeat(width - cell.chars().count());
        let mut line = row[0].clone() + &padding(&row[0], widths[0]);
        for (cell, width) in row.iter().zip(&widths).skip(1) {
            line += &format!("  {}{cell}", padding(cell, *width));
        }
        line.trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}

/// Numbers with a smaller magnitude are rounding errors and are shown as 0.
const MIN_SHOWN_MAGNITUDE: f64 = 1e-9;

/// A number with three or four significant digits, no trailing zeros, and the minus sign `−`
/// instead of a hyphen.
#[must_use]
pub fn short_number(value: f64) -> String {
    if value.is_nan() {
        return "unknown".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 {
            "∞".to_owned()
        } else {
            "−∞".to_owned()
        };
    }
    let decimals = match value.abs() {
        1000.0.. => 0,
        100.0.. => 1,
        10.0.. => 2,
        0.1.. => 3,
        MIN_SHOWN_MAGNITUDE.. => (2.0 - value.abs().log10().floor()) as usize,
        _ => 0,
    };
    let text = format!("{value:.decimals$}");
    without_trailing_zeros(&text).replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_longest_cell() {
        let rows = [["run", "σ"], ["a", "0.5"]].map(|row| row.map(str::to_owned).to_vec());
        assert_eq!(align_columns(&rows), ["run    σ", "a    0.5"]);
        assert!(align_columns(&[]).is_empty());
        let forged = ["a\nb  1\t\u{1b}[1m".to_owned()].to_vec();
        assert_eq!(align_columns(&[forged]), ["a\\u000ab  1\\u0009\\u001b[1m"]);
        // The width in a format has 16 bits.
        let long = [
            ["x".repeat(70_000), "1".to_owned()].to_vec(),
            rows[1].clone(),
        ];
        assert_eq!(align_columns(&long)[1].chars().count(), 70_000 + 2 + 3);
    }

    #[test]
    fn markdown_cells_have_no_lines_and_no_elements() {
        assert_eq!(
            markdown_cell("a|b\nc <script>x</script> p < 0.01 <3"),
            "a\\|b c &lt;script>x&lt;/script> p < 0.01 <3"
        );
        assert_eq!(
            markdown_cell("![x](http://x) [y]\\|\u{1b}\u{202e}"),
            r"!\[x\](http://x) \[y\]\\\|  "
        );
    }

    /// Sequences as in JSON, which a parser of JSON reads back.
    #[test]
    fn controls_are_shown_on_a_terminal() {
        let text = "a\u{1b}[31m\u{7f}\u{9b}\u{202e}\tb\nσ 🙂";
        let shown = "a\\u001b[31m\\u007f\\u009b\\u202e\tb\nσ 🙂";
        assert_eq!(terminal(text), shown);
        let json = serde_json::to_string(text).unwrap();
        let read: String = serde_json::from_str(&terminal(&json)).unwrap();
        assert_eq!(read, text);
    }

    #[test]
    fn json_cannot_leave_its_script() {
        let json = serde_json::to_string("<!--<script></script>").unwrap();
        let inner = json_in_script(&json);
        assert!(!inner.contains('<'));
        let read: String = serde_json::from_str(&inner).unwrap();
        assert_eq!(read, "<!--<script></script>");
    }

    #[test]
    fn pages_have_no_controls() {
        let page = html_page(maud::html! { p { "a\u{1b}b\u{9b}\u{202e}<" } "\n\t" });
        assert_eq!(page, "<p>a�b��&lt;</p>\n\t");
    }

    #[test]
    fn spreadsheet_cells_are_no_formulas_and_can_be_read_back() {
        for text in [
            "=1+1",
            "+x",
            "-x",
            "@x",
            "\tx",
            "\rx",
            "'x",
            "''",
            "'=1",
            "plain",
            "σ = 1",
            "",
            "a\u{1b}b",
            "\\u",
            "\\u00",
            "C:\\users",
            "\\u0041",
        ] {
            let cell = spreadsheet_cell(text);
            assert!(
                !cell.starts_with(['=', '+', '-', '@', '\t', '\r']),
                "{cell}"
            );
            assert_eq!(from_spreadsheet_cell(&cell), text);
        }
        assert_eq!(spreadsheet_cell("=1+1"), "'=1+1");
        assert_eq!(spreadsheet_cell("plain"), "plain");
        assert_eq!(spreadsheet_cell("a\u{1b}b"), "a\\u001bb");
    }

    #[test]
    fn only_one_has_no_plural_s() {
        assert_eq!(
            [0, 1, 2].map(|count| pluralize(count, "run")),
            ["0 runs", "1 run", "2 runs"]
        );
    }

    #[test]
    fn only_zeros_after_the_decimal_point_are_removed() {
        let texts = ["1.500", "20.0", "100", "-0.00", "-0", "0.05"];
        assert_eq!(
            texts.map(without_trailing_zeros),
            ["1.5", "20", "100", "0", "0", "0.05"]
        );
    }

    #[test]
    fn a_path_without_a_file_name_gives_the_fallback() {
        assert_eq!(file_stem(Path::new("a/cartpole.ron"), "run"), "cartpole");
        assert_eq!(file_stem(Path::new(".."), "run"), "run");
    }

    #[test]
    fn a_shell_reads_a_quoted_word_as_one_word() {
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

    #[test]
    fn numbers_have_three_or_four_significant_digits() {
        let formatted = [
            0.0,
            -1e-10,
            -0.00001,
            0.09345,
            1.0 / 3.0,
            -12.345,
            127.5,
            195.0,
            1234.5,
        ]
        .map(short_number);
        assert_eq!(
            formatted,
            [
                "0",
                "0",
                "−0.00001",
                "0.0935",
                "0.333",
                "−12.35",
                "127.5",
                "195",
                "1234"
            ]
        );
        assert_eq!(
            [f64::NEG_INFINITY, f64::NAN].map(short_number),
            ["−∞", "unknown"]
        );
    }
}
