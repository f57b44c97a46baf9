//! `seedbed completions` and the manual pages.

use crate::util::{names_in, run_successful};

#[test]
fn completions_know_all_commands() {
    for (shell, start) in [
        ("bash", "_seedbed()"),
        ("zsh", "#compdef seedbed"),
        ("fish", "#"),
    ] {
        let script = run_successful(&["completions", shell]);
        assert!(script.starts_with(start), "{script}");
        for word in ["film", "export", "no-recording"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
}

/// One page for the program and one for each command, with the options of the command.
#[test]
fn each_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    run_successful(&["manual", folder.path().to_str().unwrap()]);
    let pages = names_in(folder.path());
    for page in ["seedbed.1", "seedbed-run.1", "seedbed-film.1"] {
        assert!(pages.iter().any(|name| name == page), "{pages:?}");
    }
    let text = std::fs::read_to_string(folder.path().join("seedbed-run.1")).unwrap();
    assert!(text.contains("no\\-recording"), "{text}");
}
