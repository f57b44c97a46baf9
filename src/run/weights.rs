//! Writes the weights of a team's networks as safetensors, with names such as
//! `agent_3.policy.layer_0.weight`.

use std::path::Path;

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensorError};

use super::files;
use seedbed_learn::agent::Tensor;

/// Writes tensors to a safetensors file. Weights are `[in × out]`, biases `[out]`, little-endian
/// f32.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, tensors: &[Tensor<'_>]) -> std::io::Result<()> {
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
        .map_err(std::io::Error::other)?;
    files::replace(path, &file_bytes)
}
