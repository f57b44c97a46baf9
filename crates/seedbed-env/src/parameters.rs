//! Numbers of a task with which its physics is inaccurate, as far as they say so without a trial.

use std::f64::consts::TAU;

use super::description::{BodyTask, Collider, Joint, JointKind};
use super::inertia::{distance, moved_inertia, moving_parts};
use super::physics::depth;
use seedbed_input::numbers::readable;

/// What is inaccurate, where, and what to do.
pub(super) fn warnings(task: &BodyTask) -> Vec<String> {
    let joints = task.joints.iter();
    let mut warnings: Vec<_> = joints
        .clone()
        .filter_map(|joint| mass_ratio(joint, task))
        .collect();
    let servos = task.servos();
    warnings.extend(servos.filter_map(|(name, joint)| servo_on_chain(name, joint, task)));
    warnings.extend(joints.clone().filter_map(|joint| swing(joint, task)));
    warnings.extend(
        joints
            .clone()
            .filter_map(|joint| small_inertia(joint, task)),
    );
    warnings.extend(joints.filter_map(|joint| spring(joint, task)));
    warnings.extend(heavy_on_light(task));
    warnings
}

/// Maximum of angular frequency times substep: implicit integration damps faster oscillations away.
const MAX_PHASE: f64 = 0.5;

/// A hinge about which gravity lets bodies swing faster than substeps can follow.
fn swing(joint: &Joint, task: &BodyTask) -> Option<String> {
    let JointKind::Hinge { .. } = joint.kind else {
        return None;
    };
    let (moving, anchor) = moving_parts(joint, task);
    let arm = distance(moving.com, anchor);
    let gravity = task.gravity[0].hypot(task.gravity[1]);
    let inertia = moving.inertia + moving.mass * arm * arm + joint.passive_forces.armature;
    let frequency = (moving.mass * gravity * arm / inertia).sqrt();
    too_fast(
        &format!("what swings about joint `{}`", joint.name),
        frequency,
        task,
    )
}

/// A spring that is stiffer than substeps can follow, if its damper does not hide it.
fn spring(joint: &Joint, task: &BodyTask) -> Option<String> {
    let passive = joint.passive_forces;
    if joint.kind == JointKind::Weld {
        return None;
    }
    let inertia = moved_inertia(joint, task);
    let is_overdamped = passive.damping.powi(2) >= 4.0 * passive.stiffness * inertia;
    let frequency = (passive.stiffness / inertia).sqrt();
    let what = format!("the spring of joint `{}`", joint.name);
    too_fast(&what, frequency, task).filter(|_| !is_overdamped)
}

fn too_fast(what: &str, frequency: f64, task: &BodyTask) -> Option<String> {
    let (substep, phase) = (task.substep(), frequency * task.substep());
    (phase > MAX_PHASE).then(|| {
        let period = TAU / frequency;
        let times = (phase / MAX_PHASE).ceil();
        format!(
            "{what} has a period of {period:.2e} s, too fast for substeps of {substep:.2e} s, which damp it away: \
             expected {} times as many `solver.iterations`, or a shorter `control_step`",
            readable(times)
        )
    })
}

/// Substeps with which the joints of bodies of a ratio of 10 are as accurate as those of equal bodies.
const USUAL_SUBSTEPS: f64 = 4.0;

/// The ratio that goes with [`USUAL_SUBSTEPS`] and one pass.
const USUAL_RATIO: f64 = 10.0;

/// Ratio of masses above which the joints of tasks without contacts yield noticeably. It is measured in a
/// double pendulum of rods of 1 m (`tests/it/limits.rs`): with `iterations: 4, passes: 1` the error of its
/// angles after 1 s is 0.005 rad up to a ratio of 10, 0.06 rad at 30, and 0.24 rad at 100. Four times as
/// many substeps allow eight times the ratio, four times as many passes twice the ratio.
fn max_mass_ratio(task: &BodyTask) -> f64 {
    let [substeps, passes] = [task.solver.substeps, task.solver.solver_iterations].map(f64::from);
    USUAL_RATIO * (substeps / USUAL_SUBSTEPS).powf(1.5) * passes.sqrt()
}

/// A joint that holds much heavier bodies than its parent. With contacts, joints are exact.
fn mass_ratio(joint: &Joint, task: &BodyTask) -> Option<String> {
    let parent = &task.bodies[joint.parent?];
    let (moving, _) = moving_parts(joint, task);
    let (ratio, max) = (moving.mass / parent.inertial.mass, max_mass_ratio(task));
    if task.needs_own_worlds() {
        return (ratio > MAX_RATIO_OF_SINGLES).then(|| {
            format!(
                "joint `{}` holds {ratio:.0e} times the mass of body `{}`: single precision has 7 digits",
                joint.name, parent.name
            )
        });
    }
    (ratio > max).then(|| {
        let needed = (f64::from(task.solver.substeps) * (ratio / max).powf(2.0 / 3.0)).ceil();
        let help = if needed <= 1000.0 {
            format!("expected `solver: (iterations: {needed}, …)`, or more `passes`")
        } else {
            "make both one body, or their masses more alike".to_owned()
        };
        format!(
            "joint `{}` holds {ratio:.0} times the mass of body `{}`: with this solver joints yield from a ratio of \
             {max:.0} on (a double pendulum is off by 0.06 rad after 1 s at 3 times that); {help}",
            joint.name, parent.name
        )
    })
}

/// Passes with four substeps that a servo on a joint between two bodies needs, however light the body is that it
/// moves. It is measured in a load on a winch that hangs on a light arm (`tests/it/limits.rs`): with `passes: 1`
/// it falls 3.7 to 14 times too fast; with `passes: 4` at most 5 % too fast up to half the mass of the arm,
/// with `passes: 16` 8 % at five times its mass. Sixteen times as many substeps count like 2.5 times as many passes.
const SERVO_PASSES: f64 = 4.0;

/// Further passes for each multiple of the parent's mass that hangs on the servo.
const SERVO_PASSES_PER_RATIO: f64 = 3.2;

/// Passes with which all servos hold: 1 where none acts between two bodies, or joints are exact.
pub(super) fn passes_for_servos(task: &BodyTask) -> u32 {
    let of_servos = task
        .servos()
        .filter_map(|(_, joint)| passes_for_servo(&task.joints[joint], task));
    of_servos.max().unwrap_or(1)
}

/// `None` for a joint that is exact, or held by the world.
fn passes_for_servo(joint: &Joint, task: &BodyTask) -> Option<u32> {
    let parent = &task.bodies[joint.parent?];
    if task.needs_own_worlds() {
        return None;
    }
    let (moving, _) = moving_parts(joint, task);
    let ratio = moving.mass / parent.inertial.mass;
    let with_usual_substeps = SERVO_PASSES.max(SERVO_PASSES_PER_RATIO * ratio);
    let substeps = f64::from(task.solver.substeps) / USUAL_SUBSTEPS;
    Some(
        (with_usual_substeps / substeps.cbrt())
            .ceil()
            .clamp(1.0, 1000.0) as u32,
    )
}

/// A servo on a joint between two bodies that hardly holds, in a task without contacts.
fn servo_on_chain(name: &str, joint: usize, task: &BodyTask) -> Option<String> {
    let joint = &task.joints[joint];
    let needed = passes_for_servo(joint, task)?;
    (task.solver.solver_iterations < needed).then(|| {
        format!(
            "servo `{name}` hardly holds joint `{}` between two bodies: a load on it falls several times too fast, and \
             passes the ends of its range; expected `solver: (passes: {needed}, …)` or more, or a collider in the task, with \
             which joints are exact",
            joint.name
        )
    })
}

/// Maximum share of its thickness by which a body sinks into a lighter one.
const MAX_SINK: f64 = 0.2;

/// Maximum frequency of contacts times the time between two searches, above which heavy bodies shake on light
/// ones.
const MAX_PERIODS_PER_SEARCH: f64 = 1.5;

/// Two free bodies of which the heavier sinks into the lighter one that is between it and something
/// fixed. A contact is as stiff as the lighter body needs: under a body of r times its mass a box yields by 2 r g
/// / (2 π f)² on each side (`tests/it/limits.rs`).
fn heavy_on_light(task: &BodyTask) -> Option<String> {
    let gravity = task.gravity[0].hypot(task.gravity[1]);
    let frequencies = task
        .contact_softness
        .map_or([30.0, 60.0], |softness| [softness.natural_frequency; 2]);
    let sink =
        |[one, other]: [f64; 2]| 2.0 * gravity * ((TAU * one).powi(-2) + (TAU * other).powi(-2));
    let pairs = task.colliders.iter().filter_map(|light| {
        let heaviest = task
            .colliders
            .iter()
            .filter_map(|heavy| Some((ratio_of_masses(light, heavy, task)?, heavy.body?)));
        let (ratio, heavy) = heaviest.max_by(|one, other| one.0.total_cmp(&other.0))?;
        let thickness = 2.0 * f64::from(depth(&light.surface));
        Some((
            ratio * sink(frequencies),
            thickness,
            ratio,
            light.body?,
            heavy,
        ))
    });
    let worst = pairs.max_by(|one, other| (one.0 / one.1).total_cmp(&(other.0 / other.1)));
    let (depth, thickness, ratio, light, heavy) =
        worst.filter(|(depth, thickness, ..)| *depth > MAX_SINK * thickness)?;
    let needed = (ratio * sink([1.0; 2]) / (MAX_SINK * thickness))
        .sqrt()
        .ceil();
    let searches = (needed * task.spec.control_step / MAX_PERIODS_PER_SEARCH).ceil();
    let [light, heavy] = [light, heavy].map(|body| &task.bodies[body].name);
    Some(format!(
        "body `{heavy}` has {ratio:.0} times the mass of body `{light}`: where it lies on it, contacts yield by \
         {depth:.1e} m; expected masses more alike, or `contact_softness: (natural_frequency: {needed}, damping_ratio: 10)` \
         with at least {searches} `solver.searches`"
    ))
}

/// The ratio of the masses of two free bodies that can touch, of which the first is the lighter one.
fn ratio_of_masses(light: &Collider, heavy: &Collider, task: &BodyTask) -> Option<f64> {
    let (light_body, heavy_body) = (light.body?, heavy.body?);
    let is_free = |body: usize| {
        let mut joints = task.joints.iter();
        task.free_bodies.contains(&body) && joints.all(|joint| joint.parent != Some(body))
    };
    let touches = light.contype & heavy.conaffinity != 0 || heavy.contype & light.conaffinity != 0;
    let mass = |body: usize| task.bodies[body].inertial.mass;
    let ratio = mass(heavy_body) / mass(light_body);
    (is_free(light_body) && is_free(heavy_body) && touches && ratio > 1.0).then_some(ratio)
}

/// Minimum of a moment of inertia as a share of mass times squared distance of a joint, in tasks without
/// contacts. It is measured in a double pendulum (`tests/it/limits.rs`): at 1e-9 its angles are off by
/// 0.004 rad after 1 s, at 1e-12 by more than a turn.
const MIN_INERTIA: f64 = 1e-8;

/// A body whose moment of inertia is lost beside its mass.
fn small_inertia(joint: &Joint, task: &BodyTask) -> Option<String> {
    let (body, JointKind::Hinge { .. }) = (&task.bodies[joint.child], joint.kind) else {
        return None;
    };
    let needed =
        MIN_INERTIA * body.inertial.mass * distance(body.inertial.com, joint.anchor).powi(2);
    let inertia = body.inertial.inertia + joint.passive_forces.armature;
    (inertia < needed && !task.needs_own_worlds()).then(|| {
        format!(
            "the inertia of body `{}`, {inertia:.1e} kg m², is lost in single precision beside its mass at that \
             distance from joint `{}`: expected at least {needed:.1e} kg m²",
            body.name, joint.name
        )
    })
}

/// Ratio of masses that an `f32` can add.
const MAX_RATIO_OF_SINGLES: f64 = 1e6;
