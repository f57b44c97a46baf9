//! Pictures of the bodies of a task: what a camera shows of an episode ([`camera`]), the lines of
//! bodies, ropes and ground ([`outline`]), which bodies have the same color ([`body_color`]), and all
//! of them as shapes on a page ([`drawing`]).
//!
//! Recordings, films, the explorer's page and pictures in Python show scenes by these functions. Scenes
//! are planes today. The y axis of a picture points down, as in Rerun and in images.

pub mod body_color;
pub mod camera;
pub mod drawing;
pub mod outline;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
