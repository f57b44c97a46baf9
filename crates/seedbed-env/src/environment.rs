//! A task of rigid bodies as an [`Environment`]: sensors, observations, rewards and ends of
//! episodes, on top of any [`Dynamics`].
//!
//! Everything that a task computes is in one table of columns, one value per copy, which its
//! formulas read: see [`ColumnLayout`]. Stepping allocates nothing. This module must not depend on
//! what moves the bodies.

use std::ops::Range;

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::description::{BodyTask, ColumnLayout, TaskDescription};
use super::dynamics::{Dynamics, from_bytes, to_bytes};
use super::expression::{Evaluator, Program, ValueTable, copy_values};
use super::gymnasium::GymnasiumEnvironment;
use super::sensing::SensorReader;
use super::tabular::TabularEnvironment;
use super::terrain::TerrainGenerator;
use super::watch::Watch;
use super::{
    Choice, Environment, Force, GivenStart, Physics, PhysicsWarning, Pose, Scene, StartNames,
    Status, TaskSpec, analytic, forces, physics,
};
use seedbed_input::InputError;
use seedbed_random::{Purpose, Stream, stream};

/// Builds `copies` copies of a task. None has started: reset each before its first step.
///
/// # Errors
/// `physics` is [`Physics::Analytic`], but the task has no analytic model.
pub fn build(
    description: &TaskDescription,
    physics: Physics,
    copies: usize,
) -> Result<Box<dyn Environment>, InputError> {
    let workers = description.worker_count(copies, 1);
    build_with_workers(description, physics, copies, workers)
}

/// Like [`build`], with this number of worker processes for an environment of Gymnasium. Results do not
/// depend on it.
///
/// # Errors
/// See [`build`].
pub fn build_with_workers(
    description: &TaskDescription,
    physics: Physics,
    copies: usize,
    workers: usize,
) -> Result<Box<dyn Environment>, InputError> {
    match description {
        TaskDescription::Bodies(task) => {
            let dynamics = build_dynamics(task, physics, copies)?;
            Ok(Box::new(BodyEnvironment::new(task, dynamics, copies)))
        }
        TaskDescription::Tabular(task) if physics == Physics::Rapier => {
            Ok(Box::new(TabularEnvironment::new(task, copies)))
        }
        TaskDescription::Gymnasium(task) if physics == Physics::Rapier => {
            Ok(Box::new(GymnasiumEnvironment::new(task, copies, workers)))
        }
        TaskDescription::Tabular(_) | TaskDescription::Gymnasium(_) => {
            Err(no_analytic_model(description.origin()))
        }
    }
}

/// Builds only the moving bodies of a task, without observations, rewards and episodes.
///
/// # Errors
/// `physics` is [`Physics::Analytic`], but the task has no analytic model.
pub fn build_dynamics(
    task: &BodyTask,
    physics: Physics,
    copies: usize,
) -> Result<Box<dyn Dynamics>, InputError> {
    match physics {
        Physics::Rapier if task.needs_own_worlds() => {
            Ok(Box::new(physics::ContactWorlds::new(task, copies)))
        }
        Physics::Rapier => Ok(Box::new(physics::RigidBodies::new(task, copies))),
        Physics::Analytic => {
            analytic::build(task, copies).ok_or_else(|| no_analytic_model(&task.origin))
        }
    }
}

fn no_analytic_model(origin: &str) -> InputError {
    InputError {
        origin: origin.to_owned(),
        position: None,
        field: "analytic".to_owned(),
        message: "`physics: Analytic` needs an analytic model, but this task has none".to_owned(),
        help: Some("use `physics: Rapier`".to_owned()),
    }
}

/// How often a start state is drawn again at most.
const MAX_REDRAWS: u32 = 1000;

/// M copies of a task of rigid bodies.
struct BodyEnvironment {
    task: BodyTask,
    columns: ColumnLayout,
    dynamics: Box<dyn Dynamics>,
    sensors: SensorReader,
    terrains: Vec<TerrainGenerator>,
    /// What the formulas read, in the order of [`ColumnLayout`].
    table: ValueTable,
    observation_formulas: Vec<Evaluator>,
    formula_forces: Vec<Evaluator>,
    reward: Evaluator,
    /// The reward, if it is the same in every step: it is then not computed.
    constant_reward: Option<f32>,
    terminated: Evaluator,
    /// Formula that is true for start states that are drawn again; `None` if it never is.
    redrawn_while: Option<Evaluator>,
    /// Whether the reward or the termination reads values before the step.
    reads_previous: bool,
    episodes: EpisodeStates,
    watch: Watch,
    /// Start coordinates and velocities of the copy that is being reset: `[coordinates]`.
    start: [Vec<f64>; 2],
}

/// The state of each copy's episode, besides the table.
#[derive(Clone, Debug, PartialEq)]
struct EpisodeStates {
    /// `[copies × observations]`
    observations: Vec<f32>,
    rewards: Vec<f32>,
    statuses: Vec<Status>,
    /// Steps since the reset.
    steps: Vec<u32>,
    /// What the numbers of each step follow from.
    step_seeds: Vec<u64>,
}

/// The state of one copy, which a checkpoint stores.
#[derive(Serialize, Deserialize)]
struct SavedCopy {
    task: String,
    /// The copy's row of the table.
    values: Vec<f32>,
    observation: Vec<f32>,
    reward: f32,
    status: Status,
    steps: u32,
    step_seed: u64,
    dynamics: Vec<u8>,
}

impl BodyEnvironment {
    fn new(task: &BodyTask, dynamics: Box<dyn Dynamics>, copies: usize) -> Self {
        let columns = task.column_layout();
        let formulas = &task.formulas;
        let mut table = ValueTable::new(columns.count(), copies);
        for (column, constant) in task.run_constants.iter().enumerate() {
            table.column_mut(column).fill(constant.value);
        }
        let previous_columns = columns.first_previous_value()..columns.count();
        Self {
            columns,
            dynamics,
            table,
            observation_formulas: formulas
                .observations
                .iter()
                .map(|program| Evaluator::new(program, copies))
                .collect(),
            formula_forces: task
                .formula_forces
                .iter()
                .map(|force| Evaluator::new(&force.formula, copies))
                .collect(),
            reward: Evaluator::new(&formulas.reward, copies),
            constant_reward: formulas.reward.constant(),
            terminated: Evaluator::new(&formulas.terminated, copies),
            redrawn_while: (task.redrawn_while.constant() != Some(0.0))
                .then(|| Evaluator::new(&task.redrawn_while, copies)),
            reads_previous: formulas.reward.reads(&previous_columns)
                || formulas.terminated.reads(&previous_columns),
            episodes: EpisodeStates::new(copies, columns.observation_count),
            watch: Watch::new(task, copies),
            sensors: SensorReader::new(task, copies),
            terrains: TerrainGenerator::all(&task.colliders),
            start: [
                task.reference_coordinates(),
                vec![0.0; task.coordinate_count()],
            ],
            task: task.clone(),
        }
    }
}

impl Environment for BodyEnvironment {
    fn spec(&self) -> &TaskSpec {
        &self.task.spec
    }

    fn copies(&self) -> usize {
        self.episodes.statuses.len()
    }

    fn reset(&mut self, copy: usize, random: &mut Stream) {
        self.draw_start(copy, random);
        if self.redrawn_while.is_some() {
            let mut redraws = 0;
            while redraws < MAX_REDRAWS && self.is_redrawn(copy) {
                self.draw_start(copy, random);
                redraws += 1;
            }
        }
    }

    fn start_names(&self) -> StartNames {
        let numbers = self.task.episode_numbers.iter();
        StartNames {
            coordinates: self.task.coordinate_names(),
            episode_numbers: numbers.map(|number| number.name.clone()).collect(),
        }
    }

    fn reset_at(&mut self, copy: usize, random: &mut Stream, start: &GivenStart) {
        self.draw_episode_numbers(copy, random);
        for &(index, number) in &start.episode_numbers {
            let column = self.columns.first_episode_number() + index;
            self.table.column_mut(column)[copy] = number as f32;
        }
        self.draw_terrains(copy, random);
        let mut positions = self.task.reference_coordinates();
        let mut velocities = vec![0.0; positions.len()];
        for &(coordinate, position) in &start.positions {
            positions[coordinate] = position;
        }
        for &(coordinate, velocity) in &start.velocities {
            velocities[coordinate] = velocity;
        }
        self.dynamics.start(copy, &positions, &velocities);
        self.start_episode(copy);
    }

    fn coordinates(&self, copy: usize) -> GivenStart {
        let coordinates = self.dynamics.coordinates();
        let indices = 0..self.task.coordinate_count();
        let numbers = 0..self.columns.episode_number_count;
        let number = |index| {
            self.table
                .column(self.columns.first_episode_number() + index)[copy]
        };
        GivenStart {
            positions: indices
                .clone()
                .map(|index| (index, coordinates.get(index, copy).0.into()))
                .collect(),
            velocities: indices
                .map(|index| (index, coordinates.get(index, copy).1.into()))
                .collect(),
            episode_numbers: numbers.map(|index| (index, number(index).into())).collect(),
        }
    }

    fn set_run(&mut self, copies: Range<usize>, run_seed: u64) {
        for (index, constant) in self.task.run_constants.iter().enumerate() {
            let value = constant.draw(index, run_seed);
            self.table.column_mut(index)[copies.clone()].fill(value);
        }
    }

    fn step(&mut self, actions: &[f32]) {
        assert_eq!(
            actions.len(),
            self.copies() * self.columns.action_count,
            "one row of actions per copy"
        );
        self.write_controls(actions);
        if self.reads_previous {
            self.table.copy_columns(
                self.columns.first_sensor()..self.columns.first_action(),
                self.columns.first_previous_value(),
            );
        }
        self.draw_numbers_of_step();
        self.compute_formula_forces();
        self.dynamics.step(
            self.table
                .columns(self.columns.first_action()..self.columns.first_previous_value()),
        );
        self.observe(0..self.copies());
        let observations = self.columns.first_observation();
        let observations = observations..observations + self.columns.observation_count;
        self.watch.look(
            &*self.dynamics,
            self.table.columns(observations),
            &self.episodes.statuses,
            &self.episodes.steps,
        );
        self.compute_rewards_and_statuses();
    }

    fn physics_warning(&self, copy: usize) -> Option<PhysicsWarning> {
        self.watch.warning(copy, &self.task)
    }

    fn observations(&self) -> &[f32] {
        &self.episodes.observations
    }

    fn rewards(&self) -> &[f32] {
        &self.episodes.rewards
    }

    fn statuses(&self) -> &[Status] {
        &self.episodes.statuses
    }

    fn save(&self, copy: usize) -> Vec<u8> {
        let width = self.columns.observation_count;
        to_bytes(&SavedCopy {
            task: self.task.spec.name.clone(),
            values: self.table.row(copy),
            observation: self.episodes.observations[copy * width..][..width].to_vec(),
            reward: self.episodes.rewards[copy],
            status: self.episodes.statuses[copy],
            steps: self.episodes.steps[copy],
            step_seed: self.episodes.step_seeds[copy],
            dynamics: self.dynamics.save(copy),
        })
    }

    fn restore(&mut self, copy: usize, bytes: &[u8]) -> Result<(), String> {
        let saved: SavedCopy = from_bytes(bytes)
            .map_err(|error| format!("not a saved state of an environment: {error}"))?;
        let name = &self.task.spec.name;
        if saved.task != *name {
            return Err(format!(
                "the saved state is of task `{}`, expected `{name}`",
                saved.task
            ));
        }
        let width = self.columns.observation_count;
        if saved.values.len() != self.columns.count() || saved.observation.len() != width {
            return Err("the saved state has other observations or sensors".to_owned());
        }
        self.check_run_constants(copy, &saved.values)?;
        self.dynamics.restore(copy, &saved.dynamics)?;
        self.table.set_row(copy, &saved.values);
        self.place_terrains(copy);
        self.episodes.observations[copy * width..][..width].copy_from_slice(&saved.observation);
        self.episodes.rewards[copy] = saved.reward;
        self.episodes.statuses[copy] = saved.status;
        self.episodes.steps[copy] = saved.steps;
        self.episodes.step_seeds[copy] = saved.step_seed;
        self.watch.begin(copy);
        Ok(())
    }

    fn scene(&self) -> Option<&Scene> {
        self.task.scene.as_ref()
    }

    fn poses(&self, copy: usize, poses: &mut [Pose]) {
        let (fixed, bodies, markers) = self.split_scene(poses.len());
        poses[fixed].fill(Pose::default());
        self.dynamics.poses(copy, &mut poses[bodies.clone()]);
        self.add_display_offsets(copy, &mut poses[bodies]);
        self.place_markers(copy, &mut poses[markers]);
    }

    fn terrain(&self, copy: usize) -> Vec<Vec<[f32; 2]>> {
        let mut column = self.columns.first_terrain_height();
        let line = |generator: &TerrainGenerator| {
            let columns = column..column + generator.terrain.points;
            column = columns.end;
            let heights = columns.map(|column| self.table.column(column)[copy]);
            generator.terrain.line(heights)
        };
        self.terrains.iter().map(line).collect()
    }

    fn forces(&self, copy: usize, poses: &[Pose], forces: &mut Vec<Force>) {
        if self.episodes.steps[copy] > 0 {
            let (_, bodies, _) = self.split_scene(poses.len());
            let bodies = &poses[bodies];
            let control = |index| self.table.column(self.columns.first_action() + index)[copy];
            let coordinate = |index| self.dynamics.coordinates().get(index, copy);
            forces::add_action_forces(&self.task, bodies, control, coordinate, forces);
            self.dynamics.contact_forces(copy, forces);
        }
    }
}

impl BodyEnvironment {
    /// A saved state continues in a copy of the same run only: other constants of the run would be
    /// another task.
    fn check_run_constants(&self, copy: usize, row: &[f32]) -> Result<(), String> {
        for (index, constant) in self.task.run_constants.iter().enumerate() {
            let (saved, own) = (row[index], self.table.column(index)[copy]);
            if saved != own {
                return Err(format!(
                    "the saved state is of a run in which `{}` is {saved}, but it is {own} in this \
                     run: expected a state of a run with the same run seed",
                    constant.name
                ));
            }
        }
        Ok(())
    }

    /// Begins an episode in a start state that is drawn from `random`.
    fn draw_start(&mut self, copy: usize, random: &mut Stream) {
        let [positions, velocities] = &mut self.start;
        for start in &self.task.reset {
            positions[start.coordinate] = start.position.draw(random);
            velocities[start.coordinate] = start.velocity.draw(random);
        }
        self.draw_episode_numbers(copy, random);
        self.draw_terrains(copy, random);
        let [positions, velocities] = &self.start;
        self.dynamics.start(copy, positions, velocities);
        self.start_episode(copy);
    }

    /// Whether the start state of a copy has to be drawn again.
    fn is_redrawn(&mut self, copy: usize) -> bool {
        let Some(formula) = &mut self.redrawn_while else {
            return false;
        };
        formula.evaluate(self.table.view(), copy..copy + 1)[0] != 0.0
    }

    /// Draws the numbers of the episode that begins, in their order in the file.
    fn draw_episode_numbers(&mut self, copy: usize, random: &mut Stream) {
        for (index, number) in self.task.episode_numbers.iter().enumerate() {
            let column = self.columns.first_episode_number() + index;
            self.table.column_mut(column)[copy] = number.distribution.draw_f32(random);
        }
        if !self.task.step_numbers.is_empty() {
            self.episodes.step_seeds[copy] = random.random();
            self.episodes.steps[copy] = 0;
            self.draw_step_numbers(copy);
        }
    }

    /// Draws the numbers of the next step. They follow from a number that was drawn at the start of the
    /// episode, so that a step needs no random stream.
    fn draw_step_numbers(&mut self, copy: usize) {
        let (seed, step) = (self.episodes.step_seeds[copy], self.episodes.steps[copy]);
        let mut random = stream(seed, Purpose::StepNumbers, step, 0);
        for (index, number) in self.task.step_numbers.iter().enumerate() {
            let column = self.columns.first_step_number() + index;
            self.table.column_mut(column)[copy] = number.distribution.draw_f32(&mut random);
        }
    }

    /// Draws the numbers of the step that begins in all running copies.
    fn draw_numbers_of_step(&mut self) {
        if self.task.step_numbers.is_empty() {
            return;
        }
        for copy in 0..self.copies() {
            if self.episodes.statuses[copy] == Status::Running {
                self.draw_step_numbers(copy);
            }
        }
    }

    /// Draws the ground of the episode that begins.
    fn draw_terrains(&mut self, copy: usize, random: &mut Stream) {
        if self.terrains.is_empty() {
            return;
        }
        let numbers = 0..self.columns.first_sensor();
        let numbers: Vec<_> = numbers
            .map(|column| self.table.column(column)[copy])
            .collect();
        let mut column = self.columns.first_terrain_height();
        for generator in &mut self.terrains {
            for height in generator.draw(&numbers, random) {
                self.table.column_mut(column)[copy] = height;
                column += 1;
            }
        }
        self.place_terrains(copy);
    }

    /// Puts the ground of an episode where bodies and sensors find it.
    fn place_terrains(&mut self, copy: usize) {
        for (generator, line) in self.terrains.iter().zip(self.terrain(copy)) {
            self.dynamics.set_terrain(copy, generator.collider, &line);
            self.sensors.set_terrain(copy, generator.collider, &line);
        }
    }

    /// Begins the episode of a copy whose bodies and numbers are at their start.
    fn start_episode(&mut self, copy: usize) {
        self.episodes.rewards[copy] = 0.0;
        self.episodes.statuses[copy] = Status::Running;
        self.episodes.steps[copy] = 0;
        self.watch.begin(copy);
        self.observe(copy..copy + 1);
    }

    /// Translates actions into controls, in the table's action columns.
    fn write_controls(&mut self, actions: &[f32]) {
        let width = self.columns.action_count;
        for (index, actuator) in self.task.actuators.iter().enumerate() {
            let controls = self.table.column_mut(self.columns.first_action() + index);
            let copies = controls.iter_mut().zip(&self.episodes.statuses).enumerate();
            let running = copies
                .filter(|(_, (_, status))| **status == Status::Running)
                .map(|(copy, (control, _))| (control, actions[copy * width + index]));
            match &actuator.choice {
                Choice::Discrete(values) => {
                    running.for_each(|(control, action)| *control = values[action as usize]);
                }
                Choice::Continuous => {
                    let [low, high] = actuator.range;
                    running.for_each(|(control, action)| *control = action.clamp(low, high));
                }
            }
        }
    }

    /// Computes the forces that depend on the state before the step.
    fn compute_formula_forces(&mut self) {
        let copies = 0..self.copies();
        for (index, force) in self.formula_forces.iter_mut().enumerate() {
            let column = self.columns.first_formula_force() + index;
            let (before, column) = self.table.split_at(column);
            copy_values(force.evaluate(before, copies.clone()), column);
        }
    }

    /// Where the world, the bodies and the markers are in a scene of `count` bodies.
    fn split_scene(&self, count: usize) -> (Range<usize>, Range<usize>, Range<usize>) {
        let first_marker = count - self.task.markers.len();
        let first_body = first_marker - self.task.bodies.len();
        (0..first_body, first_body..first_marker, first_marker..count)
    }

    /// Adds the display offsets of one copy to the poses of its bodies.
    fn add_display_offsets(&self, copy: usize, poses: &mut [Pose]) {
        for offset in &self.task.display_offsets {
            poses[offset.body].y += self.value_of(&offset.y, copy);
            poses[offset.body].angle += self.value_of(&offset.angle, copy);
        }
    }

    fn place_markers(&self, copy: usize, poses: &mut [Pose]) {
        for (marker, pose) in self.task.markers.iter().zip(poses) {
            let [x, y, angle] = marker
                .pose
                .each_ref()
                .map(|formula| self.value_of(formula, copy));
            *pose = Pose { x, y, angle };
        }
    }

    /// The value of a formula in one copy. This is called only to draw: it allocates.
    fn value_of(&self, formula: &Program, copy: usize) -> f32 {
        Evaluator::new(formula, self.copies()).evaluate(self.table.view(), copy..copy + 1)[0]
    }

    /// Reads the sensors of some copies and computes their observations.
    fn observe(&mut self, copies: Range<usize>) {
        self.sensors
            .read(&*self.dynamics, copies.clone(), &mut self.table);
        let width = self.columns.observation_count;
        for (index, formula) in self.observation_formulas.iter_mut().enumerate() {
            let column = self.columns.first_observation() + index;
            let (before, column) = self.table.split_at(column);
            let values = formula.evaluate(before, copies.clone());
            copy_values(values, &mut column[copies.clone()]);
            // Chunks of a width that is not known at compile time would take a division.
            let mut at = copies.start * width + index;
            for value in values {
                self.episodes.observations[at] = *value;
                at += width;
            }
        }
    }

    /// Computes the rewards of the copies that have moved, and ends episodes.
    fn compute_rewards_and_statuses(&mut self) {
        let copies = 0..self.copies();
        let terminated = self.terminated.evaluate(self.table.view(), copies.clone());
        let episodes = &mut self.episodes;
        match self.constant_reward {
            Some(reward) => episodes.set_rewards(std::iter::repeat(reward)),
            None => episodes.set_rewards(
                self.reward
                    .evaluate(self.table.view(), copies)
                    .iter()
                    .copied(),
            ),
        }
        if episodes.end_step(terminated, self.task.spec.time_limit) {
            for (copy, status) in self.episodes.statuses.iter().enumerate() {
                // Stopping a copy again changes nothing.
                if *status != Status::Running {
                    self.dynamics.stop(copy);
                }
            }
        }
    }
}

impl EpisodeStates {
    fn new(copies: usize, observations: usize) -> Self {
        Self {
            observations: vec![0.0; copies * observations],
            rewards: vec![0.0; copies],
            statuses: vec![Status::Idle; copies],
            steps: vec![0; copies],
            step_seeds: vec![0; copies],
        }
    }

    /// Sets the rewards of the running copies.   `rewards: [copies]`
    fn set_rewards(&mut self, rewards: impl Iterator<Item = f32>) {
        let copies = self.rewards.iter_mut().zip(&self.statuses).zip(rewards);
        for ((reward, status), new) in copies {
            // Choosing a number and storing it always has no branch.
            *reward = if *status == Status::Running {
                new
            } else {
                *reward
            };
        }
    }

    /// Counts a step of the running copies and ends their episodes; returns whether any ended.
    /// Termination takes precedence over the time limit.   `terminated: [copies]`, 0 or 1
    fn end_step(&mut self, terminated: &[f32], time_limit: u32) -> bool {
        let mut any_ended = false;
        let copies = self.statuses.iter_mut().zip(&mut self.steps);
        for ((status, steps), terminated) in copies.zip(terminated) {
            let running = *status == Status::Running;
            *steps += u32::from(running);
            let terminates = running && *terminated != 0.0;
            let is_truncated = running && *steps >= time_limit;
            any_ended |= terminates | is_truncated;
            if terminates {
                *status = Status::Terminated;
            } else if is_truncated {
                *status = Status::Truncated;
            }
        }
        any_ended
    }
}
