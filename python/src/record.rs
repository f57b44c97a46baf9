//! How the workbench frames and outlines bodies.

#[path = "../../src/record/framing.rs"]
pub(crate) mod framing;
#[path = "../../src/outline.rs"]
pub(crate) mod outline;
