//! `/scene/agent_K/forces/…`: the forces on the bodies of an agent's environment, as arrows.
//!
//! `action` has the forces of the agent's action. A torque is shown as the force at the center of
//! mass that has the same torque. `contacts` has the contact forces, with points where bodies
//! touch. Each row has the forces during the step before its state, and their magnitudes in the
//! column `Force:newtons`. Arrows of one kind have one scale within an episode: the arrow for the
//! 95th percentile of magnitudes is an eighth of the view long, and no arrow is longer than a
//! quarter of the view. Otherwise a single impact would make all other arrows invisible.

use std::sync::Arc;

use rerun::components::Radius;
use rerun::external::arrow::array::{ArrayRef, Float32Array};
use rerun::log::Chunk;
use rerun::{
    ArchetypeName, Arrows2D, ComponentDescriptor, ComponentIdentifier, EntityPath, Points2D,
};

use super::error::RecordingError;
use super::rows::{Moment, Moments, grouped_column, rgb, static_chunk};
use crate::run::facts::EpisodeDetails;
use seedbed_env::{Force, ForceSource};
use seedbed_scene::camera::{Bounds, extent};

/// Length of the arrow for the 95th percentile of magnitudes, as a share of the view.
const ARROW_LENGTH: f32 = 0.125;

/// Arrows are drawn in front of all bodies.
const DRAW_ORDER: f32 = 100.0;

/// Forces in the scene of one agent that are not written yet.
#[derive(Clone)]
pub(super) struct ForceWriter {
    /// The forces of the action and the contact forces.
    kinds: [ForceArrows; 2],
}

/// The forces of one kind.
#[derive(Clone)]
struct ForceArrows {
    entity: EntityPath,
    source: ForceSource,
    color: [u8; 3],
    moments: Moments,
    arrows_per_row: Vec<usize>,
    origins: Vec<[f32; 2]>,
    vectors: Vec<[f32; 2]>,
    newtons: Vec<f32>,
}

impl ForceWriter {
    pub(super) fn new(scene: &EntityPath) -> Self {
        let arrows = |name: &str, source, color| ForceArrows {
            entity: scene
                .join(&EntityPath::from_single_string("forces"))
                .join(&EntityPath::from_single_string(name)),
            source,
            color,
            moments: Moments::default(),
            arrows_per_row: Vec::new(),
            origins: Vec::new(),
            vectors: Vec::new(),
            newtons: Vec::new(),
        };
        let action = arrows("action", ForceSource::Action, [80, 220, 140]);
        Self {
            kinds: [
                action,
                arrows("contacts", ForceSource::Contact, [255, 110, 90]),
            ],
        }
    }

    /// Adds the forces of an episode whose first row is at `first`. `view` has the bounds of the
    /// view of this episode.
    pub(super) fn add(&mut self, trajectory: &EpisodeDetails, view: Option<Bounds>, first: Moment) {
        let view_size = view.map_or(1.0, extent);
        self.kinds
            .iter_mut()
            .for_each(|arrows| arrows.add(trajectory, view_size, first));
    }

    /// Static colors and sizes of arrows.
    pub(super) fn styles(&self) -> Result<Vec<Chunk>, RecordingError> {
        self.kinds.iter().flat_map(ForceArrows::style).collect()
    }

    /// The chunks of all forces.
    pub(super) fn take(&mut self) -> impl Iterator<Item = Result<Chunk, RecordingError>> {
        self.kinds.iter_mut().filter_map(ForceArrows::take)
    }
}

impl ForceArrows {
    fn add(&mut self, trajectory: &EpisodeDetails, view_size: f32, first: Moment) {
        let source = self.source;
        let Some(meters_per_newton) = meters_per_newton(
            trajectory
                .forces
                .iter()
                .filter(|force| force.source == source),
            view_size,
        ) else {
            self.arrows_per_row.push(0);
            return self.moments.push(first);
        };
        let mut forces = trajectory.forces.iter();
        for &count in &trajectory.forces_per_row {
            let first_of_row = self.newtons.len();
            for force in forces
                .by_ref()
                .take(count)
                .filter(|force| force.source == source)
            {
                let [right, up] = force.newtons;
                let newtons = right.hypot(up);
                let meters_per_newton =
                    meters_per_newton.min(2.0 * ARROW_LENGTH * view_size / newtons);
                self.origins.push([force.at[0], -force.at[1]]);
                self.vectors
                    .push([right * meters_per_newton, -up * meters_per_newton]);
                self.newtons.push(newtons);
            }
            self.arrows_per_row.push(self.newtons.len() - first_of_row);
        }
        self.moments
            .push_steps(first, trajectory.forces_per_row.len());
    }

    fn style(&self) -> Vec<Result<Chunk, RecordingError>> {
        let arrows = Arrows2D::update_fields()
            .with_colors([rgb(self.color)])
            .with_draw_order(DRAW_ORDER);
        let arrows = arrows.with_radii([Radius::new_ui_points(1.5)]);
        let points = Points2D::update_fields()
            .with_colors([rgb(self.color)])
            .with_draw_order(DRAW_ORDER);
        let points = points.with_radii([Radius::new_ui_points(3.0)]);
        vec![
            static_chunk(self.entity.clone(), &arrows),
            static_chunk(self.entity.clone(), &points),
        ]
    }

    fn take(&mut self) -> Option<Result<Chunk, RecordingError>> {
        let (moments, arrows_per_row) = (
            std::mem::take(&mut self.moments),
            std::mem::take(&mut self.arrows_per_row),
        );
        if arrows_per_row.is_empty() {
            return None;
        }
        let origins = std::mem::take(&mut self.origins);
        let points = Points2D::new(origins.iter().copied()).columns(arrows_per_row.clone());
        let vectors = Arrows2D::from_vectors(std::mem::take(&mut self.vectors));
        let arrows = vectors
            .with_origins(origins)
            .columns(arrows_per_row.clone());
        let newtons: ArrayRef = Arc::new(Float32Array::from(std::mem::take(&mut self.newtons)));
        let newtons = grouped_column(newtons_column(), newtons, arrows_per_row);
        let columns = points
            .and_then(|points| Ok(points.chain(arrows?).chain([newtons]).collect::<Vec<_>>()));
        Some(
            columns
                .map_err(RecordingError::from)
                .and_then(|columns| moments.into_chunk(&self.entity, columns)),
        )
    }
}

/// Length of arrows in meters per newton; `None` without forces.
fn meters_per_newton<'a>(forces: impl Iterator<Item = &'a Force>, view_size: f32) -> Option<f32> {
    let mut newtons: Vec<f32> = forces
        .map(|force| force.newtons[0].hypot(force.newtons[1]))
        .collect();
    newtons.sort_by(f32::total_cmp);
    let percentile_95 = newtons.get(newtons.len() * 19 / 20)?;
    Some(ARROW_LENGTH * view_size / percentile_95.max(f32::MIN_POSITIVE))
}

fn newtons_column() -> ComponentDescriptor {
    let archetype = ArchetypeName::from("Force");
    let component = ComponentIdentifier::from_archetype_field(archetype, "newtons");
    ComponentDescriptor {
        archetype: Some(archetype),
        component,
        component_type: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn force(newtons: f32) -> Force {
        Force {
            source: ForceSource::Contact,
            at: [1.0, 2.0],
            newtons: [0.0, newtons],
        }
    }

    /// Three rows have zero, one and two forces. In a view of 8 m, the arrow of the largest contact
    /// force, 20 N, is 1 m long. The y axis points down.
    #[test]
    fn arrows_have_a_common_scale_and_start_at_the_points_of_action() {
        let mut writer = ForceWriter::new(&"scene".into());
        let trajectory = EpisodeDetails {
            forces: vec![
                force(10.0),
                force(20.0),
                Force {
                    source: ForceSource::Action,
                    ..force(5.0)
                },
            ],
            forces_per_row: vec![0, 1, 2],
            ..EpisodeDetails::default()
        };
        writer.add(
            &trajectory,
            Some([0.0, 8.0, 0.0, 4.0]),
            Moment {
                env_step: 7,
                episode: 0,
                round: 0,
            },
        );
        let [action, contacts] = &writer.kinds;
        assert_eq!(
            (&contacts.arrows_per_row, &contacts.newtons),
            (&vec![0, 1, 1], &vec![10.0, 20.0])
        );
        assert_eq!(
            (&contacts.vectors, contacts.origins[0]),
            (&vec![[0.0, -0.5], [0.0, -1.0]], [1.0, -2.0])
        );
        assert_eq!(
            (&action.arrows_per_row, &action.vectors),
            (&vec![0, 0, 1], &vec![[0.0, -1.0]])
        );
    }

    /// With 39 forces of 1 N and one of 1000 N, the arrow of the large force is twice as long as
    /// the others.
    #[test]
    fn a_large_force_does_not_shrink_all_other_arrows() {
        let mut writer = ForceWriter::new(&"scene".into());
        let forces: Vec<Force> = [vec![force(1.0); 39], vec![force(1000.0)]].concat();
        let trajectory = EpisodeDetails {
            forces,
            forces_per_row: vec![40],
            ..EpisodeDetails::default()
        };
        writer.add(
            &trajectory,
            Some([0.0, 8.0, 0.0, 4.0]),
            Moment {
                env_step: 0,
                episode: 0,
                round: 0,
            },
        );
        let lengths: Vec<f32> = writer.kinds[1]
            .vectors
            .iter()
            .map(|vector| -vector[1])
            .collect();
        assert_eq!((lengths[0], lengths[39]), (1.0, 2.0));
    }

    /// The empty row makes the viewer remove the arrows of the previous episode.
    #[test]
    fn an_episode_without_forces_has_one_empty_row() {
        let mut writer = ForceWriter::new(&"scene".into());
        writer.add(
            &EpisodeDetails {
                forces_per_row: vec![0; 9],
                ..EpisodeDetails::default()
            },
            None,
            Moment {
                env_step: 0,
                episode: 0,
                round: 0,
            },
        );
        assert_eq!(writer.kinds[0].arrows_per_row, [0]);
        assert_eq!(writer.take().count(), 2);
        assert_eq!(writer.take().count(), 0);
    }
}
