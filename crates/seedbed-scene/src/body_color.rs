//! Which bodies of a scene have the same color.

use seedbed_env::Scene;

/// The color of a body, which each kind of picture has in its own palette.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyColor {
    /// Of bodies that do not move.
    Fixed,
    /// The color of the agent: of the first moving body, the third, ….
    Agent,
    /// Of the second moving body, the fourth, …: neighbors can be told apart.
    Alternate,
}

/// The color of each body: `[bodies]`.
#[must_use]
pub fn body_colors(scene: &Scene) -> Vec<BodyColor> {
    let mut moving = [BodyColor::Agent, BodyColor::Alternate].into_iter().cycle();
    let mut colors = Vec::new();
    for body in &scene.bodies {
        let next = (!body.is_fixed).then(|| moving.next()).flatten();
        colors.push(next.unwrap_or(BodyColor::Fixed));
    }
    colors
}
