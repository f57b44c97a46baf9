//! Networks over flat parameter vectors: the layers and their gradients, the optimizer, the
//! normalisers of inputs and targets.
//!
//! Everything here computes on slices and returns no `Result`: shapes are asserted. It must not
//! depend on reinforcement learning.

pub mod adam;
pub mod bayesian;
mod kernels;
pub mod median_scale;
pub mod mlp;
pub mod pop_art;
pub mod standardizer;

pub use adam::{Adam, AdamSettings};
pub use bayesian::{
    BayesianLoss, BayesianNetwork, BayesianSettings, BayesianState, DiagonalGaussian, Likelihood,
};
pub use median_scale::MedianScale;
pub use mlp::{Activations, Initial, Mlp};
pub use pop_art::PopArt;
pub use standardizer::Standardizer;
