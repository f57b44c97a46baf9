//! What acts on bodies besides joints, actuators and contacts: ropes and a fluid; and how soft
//! contacts and the ends of ranges are.

/// A maximum distance between two points. It pulls when it is taut and never pushes.
#[derive(Clone, Debug, PartialEq)]
pub struct Rope {
    /// Name, unique among ropes.
    pub name: String,
    /// The two points.
    pub ends: [RopeEnd; 2],
    /// Maximum distance of the points, m.
    pub length: f64,
}

/// A point that a rope is tied to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RopeEnd {
    /// Index of the body; `None` is the world.
    pub body: Option<usize>,
    /// The point in the body's frame, m.
    pub at: [f64; 2],
}

/// A fluid at rest that fills the world. It resists the motion of bodies that have a
/// [`fluid_box`](super::Body::fluid_box).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fluid {
    /// Density, kg/m³.
    pub density: f64,
    /// Dynamic viscosity, Pa s.
    pub viscosity: f64,
}

/// How far overlaps of contacts, or the overshoot of ranges, yield: like a damped spring that a
/// lasting load presses in by its acceleration over (2 π natural frequency)².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Softness {
    /// Natural frequency of the spring, Hz.
    pub natural_frequency: f64,
    /// Damping ratio: 1 is critical damping.
    pub damping_ratio: f64,
}
