//! Which bodies of a scene have the same color.

use seedbed_env::Scene;

/// The color of a body, which each kind of picture has in its own palette.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyColor {
    /// Red, green and blue as the task gives them.
    OfTask([u8; 3]),
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
        let of_task = body.color.map(BodyColor::OfTask);
        let next = || if body.is_fixed { None } else { moving.next() };
        colors.push(of_task.or_else(next).unwrap_or(BodyColor::Fixed));
    }
    colors
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::SceneBody;

    /// Of five bodies the first is fixed and the third has a color of its own: the others alternate.
    #[test]
    fn bodies_without_a_color_of_their_own_alternate() {
        let body = |is_fixed, color| SceneBody {
            name: String::new(),
            is_fixed,
            color,
            shapes: Vec::new(),
            hinge: None,
        };
        let red = Some([255, 0, 0]);
        let scene = Scene {
            bodies: vec![
                body(true, None),
                body(false, None),
                body(false, red),
                body(false, None),
                body(false, None),
            ],
            tracked: None,
            ropes: Vec::new(),
        };
        let expected = [
            BodyColor::Fixed,
            BodyColor::Agent,
            BodyColor::OfTask([255, 0, 0]),
            BodyColor::Alternate,
            BodyColor::Agent,
        ];
        assert_eq!(body_colors(&scene), expected);
    }
}
