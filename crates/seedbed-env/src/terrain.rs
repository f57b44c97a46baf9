//! Draws the heights of a terrain.

use super::description::{Collider, Surface, Terrain};
use super::expression::{Evaluator, ValueTable};
use seedbed_random::Stream;

/// Draws the heights of one terrain.
pub(super) struct TerrainGenerator {
    /// Index of the collider.
    pub(super) collider: usize,
    pub(super) terrain: Terrain,
    /// What the formulas read: see [`Terrain`].
    table: ValueTable,
    start: Vec<Evaluator>,
    next: Vec<Evaluator>,
    height: Evaluator,
}

impl TerrainGenerator {
    /// One per terrain among the colliders.
    pub(super) fn all(colliders: &[Collider]) -> Vec<Self> {
        let colliders = colliders.iter().enumerate();
        let terrains = colliders.filter_map(|(index, collider)| match &collider.surface {
            Surface::Terrain(terrain) => Some(Self::new(index, terrain)),
            _ => None,
        });
        terrains.collect()
    }

    fn new(collider: usize, terrain: &Terrain) -> Self {
        let values = terrain.values.iter();
        Self {
            collider,
            table: ValueTable::new(terrain.first_value() + terrain.values.len(), 1),
            start: values
                .clone()
                .map(|value| Evaluator::new(&value.start, 1))
                .collect(),
            next: values.map(|value| Evaluator::new(&value.next, 1)).collect(),
            height: Evaluator::new(&terrain.height, 1),
            terrain: terrain.clone(),
        }
    }

    /// Draws the heights of all points, m. `numbers`: the constants of the run and the numbers of the
    /// episode.
    pub(super) fn draw(&mut self, numbers: &[f32], random: &mut Stream) -> Vec<f32> {
        for (column, &number) in numbers.iter().enumerate() {
            self.table.column_mut(column)[0] = number;
        }
        (0..self.terrain.points)
            .map(|index| self.draw_point(index, random))
            .collect()
    }

    fn draw_point(&mut self, index: usize, random: &mut Stream) -> f32 {
        self.table.column_mut(self.terrain.index_column)[0] = index as f32;
        let first_drawn = self.terrain.first_drawn();
        for (place, number) in self.terrain.drawn.iter().enumerate() {
            self.table.column_mut(first_drawn + place)[0] = number.distribution.draw_f32(random);
        }
        let first_value = self.terrain.first_value();
        let formulas = if index == 0 {
            &mut self.start
        } else {
            &mut self.next
        };
        for (place, formula) in formulas.iter_mut().enumerate() {
            let value = formula.evaluate(self.table.view(), 0..1)[0];
            self.table.column_mut(first_value + place)[0] = value;
        }
        self.height.evaluate(self.table.view(), 0..1)[0]
    }
}
