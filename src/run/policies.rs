//! Policies of a run that may not have ended, in the form of `policies.safetensors`.

use std::path::Path;

use super::error::RunError;
use super::evaluate::load_trained;
use super::folder::RunFolder;
use super::weights;

/// Writes all networks of the newest checkpoint of the run in `folder` to the file at `path`. Those of a finished run are
/// those of its `policies.safetensors`. Returns the number of episodes per agent after which they acted.
///
/// # Errors
/// The folder has no checkpoint, the checkpoint has another version, or the file cannot be written.
pub fn write(folder: &RunFolder, path: &Path) -> Result<usize, RunError> {
    let (plan, trainer) = load_trained(folder, None)?;
    let metadata = weights::metadata(&plan, trainer.spec());
    let written = weights::write(path, &trainer.tensors(), &metadata);
    written.map_err(|error| RunError::File {
        path: path.to_owned(),
        error,
    })?;
    Ok(trainer.measures().episodes_per_agent())
}
