//! Warnings of fields that have their former names.

use std::path::Path;

use seedbed_input::{FormerName, path_with_new_names};

/// Prints which fields of the file at `path`, and which paths of overrides, have former names.
pub(super) fn warn(path: &Path, names: &[FormerName], overrides: &[String]) {
    for name in names {
        note!("warning: {}: {}", path.display(), sentence(*name));
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

/// What to know of a field that has its former name.
pub(super) fn sentence(
    FormerName {
        former, new, line, ..
    }: FormerName,
) -> String {
    format!(
        "line {line}: `{former}` is now called `{new}`; the former name is read for one more version"
    )
}
