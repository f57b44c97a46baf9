//! Warnings of fields that have their former names.

use std::path::Path;

use seedbed::input_files;
use seedbed_input::{FormerName, former_names_in, path_with_new_names};

/// Prints which fields of a file, and which paths of overrides, have former names.
pub(super) fn warn(path: &Path, overrides: &[String]) {
    if !input_files::is_stream(path)
        && let Ok(text) = input_files::read_text(path)
    {
        for sentence in sentences(&text) {
            note!("warning: {}: {sentence}", path.display());
        }
    }
    for assignment in overrides {
        let path = assignment.split('=').next().unwrap_or_default().trim();
        let new = path_with_new_names(path);
        if new != path {
            note!(
                "warning: --set {path}: its name is now `{new}`; the former one is read for one more version"
            );
        }
    }
}

/// One sentence for each field of a text that has its former name.
pub(super) fn sentences(text: &str) -> Vec<String> {
    let names = former_names_in(text).into_iter();
    let sentence = |FormerName { former, new, line }: FormerName| {
        format!(
            "line {line}: `{former}` is now called `{new}`; the former name is read for one more version"
        )
    };
    names.map(sentence).collect()
}
