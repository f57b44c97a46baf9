//! Which Python runs environments of Gymnasium.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// What the command line asks for.
static GIVEN: OnceLock<PathBuf> = OnceLock::new();

/// Makes all workers of this process run this interpreter, whatever the environment variables say.
/// Only the first call counts.
pub fn set_python(interpreter: &Path) {
    let _ = GIVEN.set(interpreter.to_owned());
}

/// The interpreter that somebody named, by [`set_python`] or else by `SEEDBED_PYTHON`.
#[must_use]
pub fn named_python() -> Option<PathBuf> {
    let given = GIVEN.get().cloned();
    given.or_else(|| named(variable_of_process))
}

/// The interpreter of workers: the [named one](named_python), that of the active virtual
/// environment (`VIRTUAL_ENV` or `CONDA_PREFIX`), or `python3`.
#[must_use]
pub fn python() -> PathBuf {
    let given = GIVEN.get().cloned();
    given.unwrap_or_else(|| choose(variable_of_process))
}

fn variable_of_process(name: &str) -> Option<OsString> {
    std::env::var_os(name).filter(|value| !value.is_empty())
}

fn named(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    variable("SEEDBED_PYTHON").map(PathBuf::from)
}

fn choose(variable: impl Fn(&str) -> Option<OsString>) -> PathBuf {
    if let Some(interpreter) = named(&variable) {
        return interpreter;
    }
    for name in ["VIRTUAL_ENV", "CONDA_PREFIX"] {
        let interpreter = variable(name).map(|folder| Path::new(&folder).join("bin/python"));
        if let Some(interpreter) = interpreter.filter(|path| path.is_file()) {
            return interpreter;
        }
    }
    "python3".into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_virtual_environment_counts_unless_an_interpreter_is_named() {
        let folder = std::env::temp_dir().join(format!("seedbed-python-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("bin")).unwrap();
        std::fs::write(folder.join("bin/python"), "").unwrap();
        let in_environment = |name: &str| (name == "VIRTUAL_ENV").then(|| folder.clone().into());
        assert_eq!(choose(in_environment), folder.join("bin/python"));
        let named = |name: &str| match name {
            "SEEDBED_PYTHON" => Some("/opt/python".into()),
            _ => in_environment(name),
        };
        assert_eq!(choose(named), Path::new("/opt/python"));
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(choose(in_environment), Path::new("python3"));
    }
}
