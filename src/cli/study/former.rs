//! Former spellings of `seedbed study`: `seedbed study STUDY --verify` is `seedbed study verify STUDY`.

use std::ffi::OsString;

/// Former options that say what is done, with the action and the option for their value. The first that is given
/// counts.
const ACTIONS: [(&str, &str, &str); 7] = [
    ("--list", "list", ""),
    ("--power", "power", ""),
    ("--register", "register", ""),
    ("--script", "script", "--scheduler"),
    ("--merge", "merge", "--from"),
    ("--verify", "verify", "--runs"),
    ("--confirm", "confirm", ""),
];

/// The arguments of today for former ones, without the name of the program; `None` if they are none of those.
pub(in crate::cli) fn translated(arguments: &[OsString]) -> Option<Vec<OsString>> {
    let (command, rest) = arguments.split_first()?;
    let split: Vec<(String, Option<String>)> = rest.iter().map(split).collect();
    let is_of_today = rest.first().is_some_and(is_action);
    let asks_for_help = split
        .iter()
        .any(|(name, _)| name == "--help" || name == "-h");
    if command != "study" || is_of_today || asks_for_help {
        return None;
    }
    let given = |option: &str| split.iter().any(|(name, _)| name == option);
    let (option, action, value_option) = ACTIONS.into_iter().find(|(option, ..)| given(option))?;
    let mut new: Vec<OsString> = vec!["study".into(), action.into()];
    for (index, (word, (name, value))) in rest.iter().zip(&split).enumerate() {
        if name == option {
            let next = split.get(index + 1).map(|(word, _)| word.as_str());
            new.extend(option_with_value(value_option, value.as_deref(), next));
        } else if name == "--confirm" {
            new.push("--registered".into());
        } else {
            new.push(word.clone());
        }
    }
    Some(new)
}

fn is_action(word: &OsString) -> bool {
    actions().any(|action| word == action)
}

/// What can be done with studies.
pub(super) fn actions() -> impl Iterator<Item = &'static str> {
    let former = ACTIONS.into_iter().map(|(_, action, _)| action);
    former.chain(["run", "submit"])
}

/// `--option=value` as its two parts.
fn split(word: &OsString) -> (String, Option<String>) {
    let text = word.to_string_lossy();
    match text.split_once('=') {
        Some((name, value)) if name.starts_with("--") => (name.to_owned(), Some(value.to_owned())),
        _ => (text.into_owned(), None),
    }
}

/// The option of today for the value of a former one, which may be the `next` word.
fn option_with_value(option: &str, value: Option<&str>, next: Option<&str>) -> Vec<OsString> {
    let has_value = next.is_some_and(|next| option != "--runs" || is_amount(next));
    match value {
        Some(value) => vec![format!("{option}={value}").into()],
        None if option.is_empty() || !has_value => Vec::new(),
        None => vec![option.into()],
    }
}

/// Whether a word is a number of runs, or a share.
fn is_amount(word: &str) -> bool {
    let number = word.strip_suffix('%').unwrap_or(word);
    !number.is_empty()
        && number
            .bytes()
            .all(|byte| byte.is_ascii_digit() || byte == b'.')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn former_spellings_have_a_new_one() {
        for (former, new) in [
            ("study a.ron --list", Some("study list a.ron")),
            (
                "study a.ron b.ron --confirm --verify=2% --draw 3",
                Some("study verify a.ron b.ron --registered --runs=2% --draw 3"),
            ),
            ("study a.ron --verify", Some("study verify a.ron")),
            (
                "study a.ron --verify 3",
                Some("study verify a.ron --runs 3"),
            ),
            ("study --verify a.ron", Some("study verify a.ron")),
            (
                "study a.ron --merge one two --out o",
                Some("study merge a.ron --from one two --out o"),
            ),
            (
                "study --confirm a.ron --shard 1/2",
                Some("study confirm a.ron --shard 1/2"),
            ),
            (
                "study a.ron --script slurm --confirm",
                Some("study script a.ron --scheduler slurm --registered"),
            ),
            (
                "study a.ron --script=slurm",
                Some("study script a.ron --scheduler=slurm"),
            ),
            ("study a.ron --quick", None),
            ("study verify a.ron", None),
            ("study run a.ron --list", None),
            ("study --verify --help", None),
            ("tune a.ron --list", None),
        ] {
            let words: Vec<OsString> = former.split(' ').map(OsString::from).collect();
            let expected = new.map(|new| {
                new.split(' ')
                    .map(OsString::from)
                    .collect::<Vec<OsString>>()
            });
            assert_eq!(translated(&words), expected, "{former}");
        }
    }
}
