//! Reads the moving bodies of a recording: the inverse of [`scene`](super::scene).

use std::collections::BTreeMap;

use rerun::log::Chunk;
use rerun::{ComponentIdentifier, EntityPath, TimelineName};

use super::read::{Chunks, Recording};
use super::rows::{ENV_STEP, EPISODE};
use super::scene::body_entity;
use super::shapes::pose_of;
use super::terrain::{self, terrain_entity};
use crate::record::{ReadError, RecordedScene};
use seedbed_env::{Pose, Scene};

/// Poses of one body in one episode, with their steps in ascending order. The step counts through
/// all episodes of the agent.
type Track = Vec<(i64, Pose)>;

impl Recording {
    /// The bodies of an agent in all episodes in which they were recorded, in ascending order.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn scenes(&self, agent: u32, scene: &Scene) -> Result<Vec<RecordedScene>, ReadError> {
        let bodies = scene.bodies.iter().map(|body| body_entity(agent, body));
        let bodies: Vec<EntityPath> = bodies.collect();
        let terrain_entity = terrain_entity(agent);
        let mut episodes: BTreeMap<u32, Vec<Track>> = BTreeMap::new();
        let mut terrains = BTreeMap::new();
        for chunk in Chunks::open(&self.path)? {
            let chunk = chunk?;
            if let Some(body) = bodies.iter().position(|path| path == chunk.entity_path()) {
                for (episode, step, pose) in poses(&chunk) {
                    let tracks = episodes.entry(episode);
                    let tracks = tracks.or_insert_with(|| vec![Track::new(); bodies.len()]);
                    tracks[body].push((step, pose));
                }
            } else if *chunk.entity_path() == terrain_entity {
                terrains.extend(terrain::read(&chunk));
            }
        }
        let scenes = episodes.into_iter();
        Ok(scenes
            .filter_map(|(episode, tracks)| {
                let terrain = terrains.remove(&episode).unwrap_or_default();
                recorded_scene(episode, &tracks, terrain)
            })
            .collect())
    }
}

/// Episode, step and pose of each row of a chunk.
fn poses(chunk: &Chunk) -> Vec<(u32, i64, Pose)> {
    let times = |name: &'static str| {
        let column = chunk.timelines().get(&TimelineName::from(name));
        column.map_or(&[][..], |column| column.times_raw())
    };
    let component =
        |field: &str| ComponentIdentifier::from_archetype_field("Transform3D".into(), field);
    let translations = chunk.iter_slices::<[f32; 3]>(component("translation"));
    let rotations = chunk.iter_slices::<[f32; 4]>(component("quaternion"));
    let poses = translations.flatten().zip(rotations.flatten());
    let poses = poses.map(|(translation, rotation)| pose_of(*translation, *rotation));
    let moments = times(EPISODE).iter().zip(times(ENV_STEP));
    moments
        .zip(poses)
        .map(|((&episode, &step), pose)| (episode as u32, step, pose))
        .collect()
}

/// The poses of all bodies in each state. Bodies that did not move in the episode have only one
/// pose. `None` if a body has none, in a file that ends within the episode.
fn recorded_scene(
    episode: u32,
    tracks: &[Track],
    terrain: Vec<Vec<[f32; 2]>>,
) -> Option<RecordedScene> {
    let length = tracks.iter().map(Vec::len).max()?;
    let mut poses = Vec::with_capacity(length * tracks.len());
    for state in 0..length {
        for track in tracks {
            poses.push(track.get(state).or(track.last())?.1);
        }
    }
    Some(RecordedScene {
        episode,
        poses,
        terrain,
    })
}
