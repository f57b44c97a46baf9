//! Inputs that can be read only once: the standard input, pipes, and process substitutions such as
//! `<(command)`. Their text is kept until the process ends, because a command reads some files
//! several times.
//!
//! Only arguments can be streams. A pipe or a device that a file names, or that lies in a folder, is
//! refused, because reading it may never end.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use seedbed_input::InputError;

/// The path by which the standard input is named in messages, on all platforms.
pub(super) const STANDARD_INPUT: &str = "/dev/stdin";

/// The streams that arguments name, with their texts once they are read.
static STREAMS: Mutex<BTreeMap<PathBuf, Option<String>>> = Mutex::new(BTreeMap::new());

fn streams() -> MutexGuard<'static, BTreeMap<PathBuf, Option<String>>> {
    STREAMS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Allows to read the input that an argument names, if it is a stream.
pub(super) fn accept(path: &Path) {
    let is_special = |path: &Path| {
        let found = path.metadata();
        found.is_ok_and(|found| !found.is_file() && !found.is_dir())
    };
    if is_special(path) {
        streams().entry(path.to_owned()).or_insert(None);
    }
}

/// Whether the input at `path` may give its text only once.
pub(super) fn is_stream(path: &Path) -> bool {
    path == Path::new(STANDARD_INPUT) || streams().contains_key(path)
}

/// The text of a stream, which is read at the first call.
pub(super) fn read(path: &Path) -> Result<String, InputError> {
    let mut streams = streams();
    if let Some(Some(text)) = streams.get(path) {
        return Ok(text.clone());
    }
    let text = if path == Path::new(STANDARD_INPUT) {
        seedbed_input::read_text_from(path, std::io::stdin().by_ref())?
    } else {
        let stream = File::open(path).map_err(|error| seedbed_input::unreadable(path, &error))?;
        seedbed_input::read_text_from(path, stream)?
    };
    streams.insert(path.to_owned(), Some(text.clone()));
    Ok(text)
}
