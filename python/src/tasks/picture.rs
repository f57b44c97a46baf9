//! Pictures of the bodies of a task.

use rand::RngExt;
use seedbed_env::{Choice, Environment, Pose, Scene, Status, TaskSpec};
use seedbed_figure::{Drawing, Figure, Panel, Pixels, RenderError, Row};
use seedbed_random::{Purpose, Stream, stream};
use seedbed_scene::camera::{Bounds, episode_bounds, union};
use seedbed_scene::drawing;
use seedbed_scene::outline::terrain_lines;

/// Copies and steps of the random episodes that show where the bodies of a task usually are.
const SAMPLED_COPIES: usize = 4;
const SAMPLED_STEPS: usize = 200;

/// Margins above and below the only row of a figure, in pixels.
const MARGINS: u32 = 16;

/// Number of copies that [`usual_bounds`] plays.
pub(super) fn sampled_copies() -> usize {
    SAMPLED_COPIES
}

/// The bounds of the bodies during some episodes of random actions. `environment` has
/// [`sampled_copies`] copies.
pub(super) fn usual_bounds(environment: &mut dyn Environment) -> Option<Bounds> {
    let scene = environment.scene()?.clone();
    let spec = environment.spec().clone();
    let mut random = stream(0, Purpose::Preview, 0, 0);
    (0..SAMPLED_COPIES).for_each(|copy| environment.reset(copy, &mut random));
    let lines = (0..SAMPLED_COPIES).map(|copy| terrain_lines(environment, copy));
    let terrain: Vec<_> = lines.flatten().collect();
    let mut poses = Vec::new();
    append_poses(environment, &scene, &mut poses);
    for _ in 0..SAMPLED_STEPS {
        if !environment.statuses().contains(&Status::Running) {
            break;
        }
        environment.step(&random_actions(&spec, &mut random));
        append_poses(environment, &scene, &mut poses);
    }
    episode_bounds(&scene, &poses, &terrain)
}

fn append_poses(environment: &dyn Environment, scene: &Scene, poses: &mut Vec<Pose>) {
    for copy in 0..SAMPLED_COPIES {
        let first = poses.len();
        poses.resize(first + scene.bodies.len(), Pose::default());
        environment.poses(copy, &mut poses[first..]);
    }
}

fn random_actions(spec: &TaskSpec, random: &mut Stream) -> Vec<f32> {
    let mut actions = Vec::new();
    for _ in 0..SAMPLED_COPIES {
        actions.extend(spec.actions.iter().map(|action| match &action.choice {
            Choice::Discrete(values) => random.random_range(0..values.len()) as f32,
            Choice::Continuous => {
                let [low, high] = action.quantity.range;
                low + (high - low) * random.random::<f32>()
            }
        }));
    }
    actions
}

/// Draws the bodies at `poses` (`[bodies]`) and the ground `terrain` (`[lines]` of `[points]`) within
/// `bounds`, which are extended if a body is outside. `size`: width and height in pixels.
pub(super) fn draw(
    scene: &Scene,
    poses: &[Pose],
    terrain: &[Vec<[f32; 2]>],
    bounds: Bounds,
    [width, height]: [u32; 2],
) -> Result<Pixels, RenderError> {
    let now = episode_bounds(scene, poses, terrain);
    let is_finite = |bounds: &Bounds| bounds.iter().all(|number| number.is_finite());
    let drawing = Drawing {
        title: String::new(),
        shapes: drawing::shapes(scene, poses, terrain, 0),
        bounds: now
            .filter(is_finite)
            .map_or(bounds, |now| union(bounds, now)),
    };
    let figure = Figure {
        title: String::new(),
        description: String::new(),
        width: f64::from(width),
        rows: vec![Row {
            height: f64::from(height - MARGINS),
            panels: vec![Panel::Drawing(drawing)],
            key: None,
        }],
    };
    figure.pixels(1.0)
}
