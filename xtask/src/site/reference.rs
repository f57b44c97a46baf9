//! Pages that the program writes about itself.

use std::path::Path;

use crate::seedbed_output;

pub(super) fn write_pages(pages: &Path) -> Result<(), String> {
    super::write(&pages.join("reference/commands.md"), &commands()?)?;
    super::write(&pages.join("reference/errors.md"), ERRORS)
}

/// The help of every command.
fn commands() -> Result<String, String> {
    let help = seedbed_output("--help")?;
    let mut page = format!(
        "# Commands\n\nThis page has the help of every command, as `seedbed COMMAND --help` prints it.\n\n```text\n{}\n```\n",
        help.trim_end()
    );
    for command in command_names(&help) {
        let help = seedbed_output(&format!("{command} --help"))?;
        page += &format!(
            "\n## seedbed {command}\n\n```text\n{}\n```\n",
            help.trim_end()
        );
    }
    Ok(page)
}

/// Names in the section `Commands:` of the help, each on a line with two spaces before it.
fn command_names(help: &str) -> Vec<&str> {
    let section = help
        .split_once("Commands:\n")
        .map_or("", |(_, after)| after);
    let lines = section.lines().take_while(|line| !line.is_empty());
    let names = lines.filter_map(|line| line.strip_prefix("  ")?.split(' ').next());
    names
        .filter(|name| !name.is_empty() && *name != "help")
        .collect()
}

const ERRORS: &str = "# Errors

This page tells what the exit status of a command means, and where the messages are listed.

| Exit status | Meaning | What to do |
|---|---|---|
| 0 | success | |
| 1 | failure: a file could not be written, a claim is not confirmed, a run cannot go on | read the message: it names the file or the run |
| 2 | invalid input: a file, an argument or a value is not as expected | the message names file, line, column, field and what was expected; nothing was changed |
| 130 | interrupted by Ctrl-C | `seedbed run --resume DIR`, or the same `study` command again, goes on with the same bits |
| 143, 128 + n | ended by TERM, or by signal n | the same |

Messages about [scenarios](../tests/errors/scenarios.md), [studies](../tests/errors/studies.md) and [tunings](../tests/errors/tunings.md) are listed with the input that causes them. These pages are tests: the program prints exactly this.
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_those_of_the_help() {
        let help = "Usage\n\nCommands:\n  run     Train\n          more\n  check   Look\n  help    Print\n\nOptions:\n  -h";
        assert_eq!(command_names(help), ["run", "check"]);
    }
}
