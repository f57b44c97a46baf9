//! Markers: what is drawn but is no body.

use serde::Deserialize;

use super::resolver::{Resolver, formula};
use super::surfaces::shape;
use super::{Geom, HexColor, Name, zero};
use crate::description;
use crate::expression::Type;
use seedbed_input::limits::short_list;
use seedbed_input::{Located, ValidationError};

/// Shapes that are drawn at a place that formulas give. Nothing touches them.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Marker {
    /// Name, unique among bodies and markers.
    pub name: Located<Name>,
    /// Shapes in the marker's frame.
    #[serde(deserialize_with = "short_list")]
    pub geoms: Vec<Geom>,
    /// Color; as of bodies.
    #[serde(default)]
    pub color: Option<HexColor>,
    /// Formula over sensors and drawn numbers of the position to the right, m.
    #[serde(default = "zero")]
    pub x: Located<String>,
    /// Formula over sensors and drawn numbers of the position upwards, m.
    #[serde(default = "zero")]
    pub y: Located<String>,
    /// Formula over sensors and drawn numbers of the angle, rad.
    #[serde(default = "zero")]
    pub angle: Located<String>,
}

impl Resolver<'_> {
    pub(super) fn markers(&self) -> Result<Vec<description::Marker>, ValidationError> {
        let sensors = self.state_variables();
        let compile = |text| formula(text, Type::Number, &sensors);
        let markers = self.file.markers.iter().map(|marker| {
            Ok(description::Marker {
                name: marker.name.value().as_ref().to_owned(),
                shapes: marker.geoms.iter().map(shape).collect(),
                pose: [
                    compile(&marker.x)?,
                    compile(&marker.y)?,
                    compile(&marker.angle)?,
                ],
            })
        });
        markers.collect()
    }
}
