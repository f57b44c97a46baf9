//! Writes the tensors of a team as safetensors, with metadata that say how they are used. Names of
//! tensors and keys of the metadata are listed in `docs/network_tensors.md`; a test compares them.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensorError};
use serde_json::{Map, Value};

use super::plan::Plan;
use crate::storage::files;
use seedbed_env::TaskSpec;
use seedbed_learn::nn::Tensor;

/// The metadata of a file: texts by key. Lists and records are JSON.
pub type Metadata = BTreeMap<&'static str, String>;

/// Writes tensors to a safetensors file. Weights are `[inputs × outputs]`, biases `[outputs]`,
/// little-endian f32. The same tensors and metadata give the same bytes.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, tensors: &[Tensor<'_>], metadata: &Metadata) -> io::Result<()> {
    let to_bytes = |tensor: &Tensor<'_>| {
        tensor
            .values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect()
    };
    let tensor_bytes: Vec<(&Tensor<'_>, Vec<u8>)> = tensors
        .iter()
        .map(|tensor| (tensor, to_bytes(tensor)))
        .collect();
    let views: Result<Vec<(&str, TensorView<'_>)>, SafeTensorError> = tensor_bytes
        .iter()
        .map(|(tensor, bytes)| {
            Ok((
                tensor.name.as_str(),
                TensorView::new(Dtype::F32, tensor.shape.clone(), bytes)?,
            ))
        })
        .collect();
    let file_bytes = views
        .and_then(|views| safetensors::serialize(views, None))
        .map_err(io::Error::other)?;
    files::replace(path, &with_metadata(&file_bytes, metadata)?)
}

/// The bytes of a safetensors file, with metadata in its header. The crate `safetensors` writes
/// metadata in random order, so that equal runs would have different files.
fn with_metadata(file_bytes: &[u8], metadata: &Metadata) -> io::Result<Vec<u8>> {
    let (length, rest) = file_bytes
        .split_first_chunk()
        .ok_or(io::ErrorKind::UnexpectedEof)?;
    let (header, data) = rest.split_at(u64::from_le_bytes(*length) as usize);
    let tensors: Map<String, Value> = serde_json::from_slice(header)?;
    let mut entries = Map::new();
    entries.insert("__metadata__".to_owned(), serde_json::to_value(metadata)?);
    entries.extend(tensors);
    let mut header = serde_json::to_vec(&entries)?;
    header.resize(header.len().next_multiple_of(ALIGNMENT), b' ');
    Ok([&(header.len() as u64).to_le_bytes(), &header[..], data].concat())
}

/// The header of a safetensors file is filled up with spaces to a multiple of this number of bytes.
const ALIGNMENT: usize = 8;

/// What readers of the tensors of a run need to know. It does not depend on what was learned.
#[must_use]
pub fn metadata(plan: &Plan, spec: &TaskSpec) -> Metadata {
    let scenario = &plan.scenario;
    let agents = scenario.agents.count.get();
    let mut metadata = scenario
        .algorithm
        .tensor_metadata(spec, agents, scenario.seed);
    metadata.insert("scenario", plan.name.clone());
    metadata
}

#[cfg(test)]
mod tests {
    use super::*;
    use safetensors::SafeTensors;

    fn tensor(name: &str, shape: &[usize], values: &[f32]) -> Tensor<'static> {
        Tensor {
            name: name.to_owned(),
            shape: shape.to_vec(),
            values: values.to_vec().into(),
        }
    }

    /// Tensors and metadata are read back, and the file has the layout of the format: 8 bytes with the
    /// length of the header, the header, and 4 bytes per number.
    #[test]
    fn tensors_and_metadata_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("policies.safetensors");
        let tensors = [
            tensor("weight", &[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
            tensor("bias", &[1], &[-0.5]),
        ];
        let metadata = Metadata::from([
            ("task", "a \"task\" — ü".to_owned()),
            ("format_version", "1".to_owned()),
        ]);
        write(&path, &tensors, &metadata).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let (header_length, header) = SafeTensors::read_metadata(&bytes).unwrap();
        assert_eq!(
            (header_length % 8, bytes.len()),
            (0, 8 + header_length + 4 * 7)
        );
        let texts = header.metadata().as_ref().unwrap();
        assert_eq!(texts.len(), 2);
        assert!(metadata.iter().all(|(key, text)| &texts[*key] == text));
        let read = SafeTensors::deserialize(&bytes).unwrap();
        let weight = read.tensor("weight").unwrap();
        assert_eq!(weight.shape(), [2, 3]);
        assert_eq!(weight.data()[20..], 6.0_f32.to_le_bytes());
        assert_eq!(
            read.tensor("bias").unwrap().data(),
            (-0.5_f32).to_le_bytes()
        );
    }

    #[test]
    fn a_file_without_tensors_has_metadata() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("policies.safetensors");
        write(
            &path,
            &[],
            &Metadata::from([("task", "cartpole".to_owned())]),
        )
        .unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
        assert_eq!(header.metadata().as_ref().unwrap()["task"], "cartpole");
        assert!(SafeTensors::deserialize(&bytes).unwrap().is_empty());
    }
}
