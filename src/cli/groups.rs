//! The commands in groups, as `seedbed --help` lists them.

use clap::{Command, CommandFactory};

use super::Cli;

/// What people want to do, and the commands for it in the order in which they are needed.
const GROUPS: [(&str, &[&str]); 5] = [
    ("Begin", &["init", "new", "list", "doctor", "completions"]),
    ("Tasks", &["check", "preview", "floor"]),
    ("Train", &["run", "bench", "tune"]),
    (
        "Look at what agents did",
        &[
            "runs", "inspect", "plot", "explore", "film", "evaluate", "replay", "export", "salvage",
        ],
    ),
    ("Compare", &["study", "report", "submit"]),
];

/// The command line with its commands in groups.
pub(super) fn command() -> Command {
    let command = Cli::command();
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{}{{options}}{{after-help}}",
        listed(&command)
    );
    let template = template.replace("{options}", "Options:\n{options}");
    command.help_template(template)
}

/// The groups, with the first sentence about each command.
fn listed(command: &Command) -> String {
    let mut text = String::new();
    for (title, names) in GROUPS {
        text += &format!("{title}:\n");
        for name in names {
            let about = command.find_subcommand(name).and_then(Command::get_about);
            let about = about.map_or(String::new(), ToString::to_string);
            text += &format!("  {name:<12} {about}\n");
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_command_is_in_one_group() {
        let mut listed: Vec<&str> = GROUPS
            .iter()
            .flat_map(|(_, names)| *names)
            .copied()
            .collect();
        listed.sort_unstable();
        let command = Cli::command();
        let shown = command
            .get_subcommands()
            .filter(|command| !command.is_hide_set());
        let mut shown: Vec<&str> = shown.map(Command::get_name).collect();
        shown.sort_unstable();
        assert_eq!(listed, shown);
    }
}
