//! Inputs that can be read only once: the standard input, pipes, and process substitutions such as
//! `<(command)`. Their text is kept until the process ends, because a command reads some files
//! several times.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use seedbed_env::input::{self, InputError};

/// The path by which the standard input is named in messages, on all platforms.
pub(super) const STANDARD_INPUT: &str = "/dev/stdin";

static TEXTS: Mutex<BTreeMap<PathBuf, String>> = Mutex::new(BTreeMap::new());

/// Whether the input at `path` may give its text only once.
pub(super) fn is_stream(path: &Path) -> bool {
    let is_special = || {
        path.metadata()
            .is_ok_and(|found| !found.is_file() && !found.is_dir())
    };
    path == Path::new(STANDARD_INPUT) || is_special()
}

/// The text of a stream, which is read at the first call.
pub(super) fn read(path: &Path) -> Result<String, InputError> {
    let mut texts = TEXTS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(text) = texts.get(path) {
        return Ok(text.clone());
    }
    let text = if path == Path::new(STANDARD_INPUT) {
        input::read_text_from(path, std::io::stdin().by_ref())?
    } else {
        input::read_text(path)?
    };
    texts.insert(path.to_owned(), text.clone());
    Ok(text)
}
