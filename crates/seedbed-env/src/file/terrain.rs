//! Ground that is drawn at the start of each episode: its schema, and what it means.

use serde::Deserialize;

use super::resolver::{Resolver, check_unique, formula, resolved};
use super::surfaces::FARTHEST;
use super::{DrawnNumber, Name};
use crate::description;
use crate::expression::{Previous, Type, Variable};
use seedbed_input::limits::short_list;
use seedbed_input::numbers::{Count, FiniteNumber, Length};
use seedbed_input::{Located, ValidationError};

/// A line of points at equal distances along x, whose heights are drawn at the start of each episode.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Terrain {
    /// x of the first point, m.
    pub from: FiniteNumber,
    /// Distance of neighboring points along x, m.
    pub spacing: Length,
    /// Number of points, at least 2.
    pub points: Located<Count<1000>>,
    /// Numbers that are drawn for each point.
    #[serde(default, deserialize_with = "short_list")]
    pub drawn: Vec<DrawnNumber>,
    /// Values that go from point to point.
    #[serde(default, deserialize_with = "short_list")]
    pub values: Vec<TerrainValue>,
    /// Formula of the height of a point, m.
    pub height: Located<String>,
}

/// A value that a point takes over from the point before it and changes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "Value", deny_unknown_fields)]
pub struct TerrainValue {
    /// Name by which formulas of the terrain read it.
    pub name: Located<Name>,
    /// Formula of its value at the first point.
    pub start: Located<String>,
    /// Formula of its value at each further point.
    pub next: Located<String>,
}

impl Terrain {
    /// Checks that neighboring points differ in single precision.
    fn check_extent(&self) -> Result<(), ValidationError> {
        let (from, spacing) = (self.from.get(), self.spacing.get());
        let end = from + spacing * f64::from(self.points.get() - 1);
        let farthest = from.abs().max(end.abs());
        if farthest <= FARTHEST && spacing >= 8.0 * f64::from(f32::EPSILON) * farthest {
            return Ok(());
        }
        Err(self.points.error(format!(
            "points at a distance of {spacing:?} m from {from:?} m to {end:?} m cannot be told apart in single \
             precision: expected x within {FARTHEST:?} m of 0, and a larger spacing"
        )))
    }
}

/// Name of the number of the point, from 0, in the formulas of a terrain.
const INDEX: &str = "index";

impl Resolver<'_> {
    pub(super) fn terrain(
        &self,
        terrain: &Terrain,
    ) -> Result<description::Terrain, ValidationError> {
        if terrain.points.get() < 2 {
            return Err(terrain.points.error("expected at least 2 points, found 1"));
        }
        terrain.check_extent()?;
        let mut variables = self.drawn_variables();
        let index_column = variables.len();
        let drawn = terrain.drawn.iter().map(|number| &number.name);
        let names = drawn.chain(terrain.values.iter().map(|value| &value.name));
        check_unique("number of this terrain", names.clone())?;
        add_variable(INDEX, &mut variables);
        for name in names {
            if variables.iter().any(|known| known.name == name.as_ref()) {
                return Err(name.error(format!(
                    "`{}` is already the name of another number that the terrain reads: choose another name",
                    name.as_ref()
                )));
            }
            add_variable(name.as_ref(), &mut variables);
        }
        let compile = |text| formula(text, Type::Number, &variables);
        let first_value = index_column + 1 + terrain.drawn.len();
        let values = terrain.values.iter().enumerate().map(|(place, value)| {
            // At the first point, values that are listed later do not exist yet.
            let known = &variables[..first_value + place];
            Ok(description::TerrainValue {
                start: formula(&value.start, Type::Number, known)?,
                next: compile(&value.next)?,
            })
        });
        Ok(description::Terrain {
            from: terrain.from.get(),
            spacing: terrain.spacing.get(),
            points: terrain.points.get() as usize,
            drawn: resolved(&terrain.drawn),
            values: values.collect::<Result<_, _>>()?,
            height: compile(&terrain.height)?,
            index_column,
        })
    }
}

fn add_variable(name: &str, variables: &mut Vec<Variable>) {
    variables.push(Variable {
        name: name.to_owned(),
        column: variables.len(),
        previous: Previous::Nowhere,
    });
}
