//! How the workbench frames and outlines bodies.

#[path = "../../src/record/framing.rs"]
pub(crate) mod framing;
#[path = "../../src/record/outline.rs"]
pub(crate) mod outline;
