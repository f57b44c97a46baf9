//! `/visitation/agent_K/lines` and `/pairs/agent_K/states`: a sample of the states of the latest
//! episodes, as lines in parallel coordinates and as points in plots of pairs. The entities of the
//! team have a smaller sample, of the states of all agents.

use std::sync::Arc;

use rerun::components::Radius;
use rerun::external::arrow::array::{ArrayRef, FixedSizeListArray, Float32Array, UInt32Array};
use rerun::external::arrow::datatypes::{DataType, Field};
use rerun::log::Chunk;
use rerun::{EntityPath, LineStrips2D, Points2D, SerializedComponentColumn};

use serde::{Deserialize, Serialize};

use super::error::RecordingError;
use super::rows::{Moment, Moments, grouped_column, rgb, static_chunk, strips};
use crate::record::visitation::{AgentVisits, Axes, Coloring, Pairs, VisitedState, sample_states};
use crate::run::recorder::RunInfo;
use crate::scenario::recording::RecordingSettings;
use seedbed_figure::color::dark::agent_color;
use seedbed_learn::experience::{Episode, StepData};
use seedbed_random::Stream;

/// Axes, panels and colors with which states are drawn.
pub(super) struct VisitationStyle {
    pub(super) axes: Axes,
    pub(super) pairs: Pairs,
    pub(super) coloring: Coloring,
}

/// The sampled states of one agent or of the team, as lines and as points.
#[derive(Clone)]
pub(super) struct SampleWriter {
    lines: MarkSeries,
    points: MarkSeries,
}

/// Lines and points that agents add to the sample of the team.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct SampleOfTeam([Marks; 2]);

/// The lines or points of one entity that are not written yet.
#[derive(Clone)]
struct MarkSeries {
    entity: EntityPath,
    marks: Marks,
}

/// Lines or points.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Marks {
    moments: Moments,
    coordinates: Vec<f32>,
    /// One color per line or point; empty if states have the color of their agent.
    colors: Vec<u32>,
    /// Number of states in each row.
    states_per_row: Vec<usize>,
}

/// Number of sampled states of an episode, for its agent and for the team.
#[derive(Clone, Copy)]
pub(super) struct DrawnStateCounts {
    pub(super) of_agent: usize,
    pub(super) of_team: usize,
}

impl VisitationStyle {
    /// The style chosen in a scenario. `color_range` is `None` before the first round.
    pub(super) fn of(
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
        color_range: Option<[f32; 2]>,
    ) -> Self {
        Self {
            axes: Axes::of(info.spec, &settings.axes, info.bonus),
            pairs: Pairs::of(info.spec, &settings.pairs),
            coloring: Coloring {
                color_by: *settings.color,
                range: color_range.unwrap_or([0.0, 1.0]),
            },
        }
    }

    /// Counts all states of an episode in `visits`, and adds samples of them to the writers of the
    /// agent and of the team, at the moment `end`. The sample of the team is a random subset of the
    /// agent's sample.
    pub(super) fn add(
        &self,
        (episode, step_data): (&Episode, Option<&StepData>),
        end: Moment,
        visits: &mut AgentVisits,
        [agent_writer, team_writer]: [&mut SampleWriter; 2],
        counts: DrawnStateCounts,
        random: &mut Stream,
    ) {
        let states = episode.length() + usize::from(!self.axes.need_actions());
        let sampled = sample_states(states, counts.of_agent, random);
        let sampled_for_team =
            sample_states(sampled.len(), counts.of_team.min(sampled.len()), random);
        let (mut axis_positions, mut remaining) =
            (Vec::new(), sampled.iter().enumerate().peekable());
        let (mut drawn_of_agent, mut drawn_of_team) = (0, 0);
        let visited = VisitedState::of_episode(episode, step_data).take(states);
        for (step, state) in visited.enumerate() {
            self.axes.project(&state, &mut axis_positions);
            visits.add(&axis_positions, &self.pairs, &state);
            if let Some((index, _)) = remaining.next_if(|(_, sampled)| **sampled == step) {
                if axis_positions.iter().any(|position| position.is_nan()) {
                    continue; // NaN has no place, and the viewer draws no line through it
                }
                drawn_of_agent += 1;
                let color = self.coloring.color(episode, &state);
                agent_writer.draw(self, &state, &axis_positions, color);
                if sampled_for_team.binary_search(&index).is_ok() {
                    drawn_of_team += 1;
                    team_writer.draw(
                        self,
                        &state,
                        &axis_positions,
                        Some(color.unwrap_or_else(|| agent_color(episode.agent))),
                    );
                }
            }
        }
        agent_writer.end_episode(drawn_of_agent, end);
        if drawn_of_team > 0 {
            team_writer.end_episode(drawn_of_team, end);
        }
    }
}

impl SampleWriter {
    pub(super) fn new(subject_name: &str) -> Self {
        Self {
            lines: MarkSeries::new(format!("visitation/{subject_name}/lines")),
            points: MarkSeries::new(format!("pairs/{subject_name}/states")),
        }
    }

    fn draw(
        &mut self,
        style: &VisitationStyle,
        state: &VisitedState<'_>,
        axis_positions: &[f32],
        color: Option<[u8; 3]>,
    ) {
        let [lines, points] = [&mut self.lines.marks, &mut self.points.marks];
        lines
            .coordinates
            .extend(style.axes.line(axis_positions).flatten());
        points
            .coordinates
            .extend(style.pairs.points(state).flatten());
        let color = color.map(|color| rgb(color).to_u32());
        lines.colors.extend(color);
        points.colors.extend(
            color
                .into_iter()
                .flat_map(|color| vec![color; style.pairs.panels().len()]),
        );
    }

    /// Moves the states to a sample that has those of earlier episodes or agents.
    pub(super) fn move_to(&mut self, sample: &mut SampleOfTeam) {
        let [lines, points] = &mut sample.0;
        lines.append(&mut self.lines.marks);
        points.append(&mut self.points.marks);
    }

    /// Adds the states of later episodes or agents.
    pub(super) fn append(&mut self, SampleOfTeam([mut lines, mut points]): SampleOfTeam) {
        self.lines.marks.append(&mut lines);
        self.points.marks.append(&mut points);
    }

    fn end_episode(&mut self, states: usize, end: Moment) {
        for series in [&mut self.lines, &mut self.points] {
            series.marks.moments.push(end);
            series.marks.states_per_row.push(states);
        }
    }

    /// Takes lines and points as chunks, if there are any.
    pub(super) fn take(&mut self, style: &VisitationStyle) -> Result<Vec<Chunk>, RecordingError> {
        let (axes, panels) = (style.axes.all().len(), style.pairs.panels().len());
        let lines_column = |coordinates, states| {
            (
                LineStrips2D::descriptor_strips(),
                strips(coordinates, vec![axes; states]),
            )
        };
        let points_column =
            |coordinates, _| (Points2D::descriptor_positions(), positions(coordinates));
        let lines = self
            .lines
            .take(1, LineStrips2D::descriptor_colors(), lines_column);
        let points = self
            .points
            .take(panels, Points2D::descriptor_colors(), points_column);
        lines.into_iter().chain(points).collect()
    }

    /// Static sizes of lines and points. If states have the color of `agent`, also static colors,
    /// from dark (start of an episode) to bright (its end).
    pub(super) fn styles(
        &self,
        agent: Option<u32>,
        states_per_row: u32,
        panels: usize,
    ) -> Result<[Chunk; 2], RecordingError> {
        let states = states_per_row.max(1);
        let brightness = |state: u32| 0.35 + 0.65 * (state + 1) as f32 / states as f32;
        let color_of_state = |agent: u32, state: u32| {
            agent_color(agent)
                .map(|channel| (f32::from(channel) * brightness(state)).min(255.0) as u8)
        };
        let colors: Vec<_> = agent
            .into_iter()
            .flat_map(|agent| (0..states).map(move |state| rgb(color_of_state(agent, state))))
            .collect();
        let lines = LineStrips2D::update_fields().with_radii([Radius::new_ui_points(0.35)]);
        let points = Points2D::update_fields().with_radii([Radius::new_ui_points(1.2)]);
        if colors.is_empty() {
            return Ok([
                static_chunk(self.lines.entity.clone(), &lines)?,
                static_chunk(self.points.entity.clone(), &points)?,
            ]);
        }
        let point_colors = colors
            .iter()
            .flat_map(|color| vec![*color; panels])
            .collect::<Vec<_>>();
        Ok([
            static_chunk(self.lines.entity.clone(), &lines.with_colors(colors))?,
            static_chunk(
                self.points.entity.clone(),
                &points.with_colors(point_colors),
            )?,
        ])
    }
}

impl MarkSeries {
    fn new(entity: String) -> Self {
        Self {
            entity: entity.into(),
            marks: Marks::default(),
        }
    }

    /// Takes the collected lines or points as a chunk. Each state has `marks_per_state` lines or
    /// points. `mark_column` makes their column from the coordinates and the number of states.
    fn take(
        &mut self,
        marks_per_state: usize,
        color_descriptor: rerun::ComponentDescriptor,
        mark_column: impl FnOnce(Vec<f32>, usize) -> (rerun::ComponentDescriptor, ArrayRef),
    ) -> Option<Result<Chunk, RecordingError>> {
        let Marks {
            moments,
            coordinates,
            colors,
            states_per_row,
        } = std::mem::take(&mut self.marks);
        let rows = states_per_row.into_iter();
        let marks_per_row: Vec<usize> = rows.map(|states| states * marks_per_state).collect();
        let states = marks_per_row.iter().sum::<usize>() / marks_per_state.max(1);
        if coordinates.is_empty() {
            return None;
        }
        let (mark_descriptor, marks) = mark_column(coordinates, states);
        let color_column = (!colors.is_empty()).then(|| {
            let colors = Arc::new(UInt32Array::from(colors));
            grouped_column(color_descriptor, colors, marks_per_row.clone())
        });
        let columns: Vec<SerializedComponentColumn> =
            [grouped_column(mark_descriptor, marks, marks_per_row)]
                .into_iter()
                .chain(color_column)
                .collect();
        Some(moments.into_chunk(&self.entity, columns))
    }
}

impl Marks {
    fn append(&mut self, other: &mut Self) {
        self.moments.append(&mut other.moments);
        self.coordinates.append(&mut other.coordinates);
        self.colors.append(&mut other.colors);
        self.states_per_row.append(&mut other.states_per_row);
    }
}

/// 2D points, in the layout of the components of points.
fn positions(coordinates: Vec<f32>) -> ArrayRef {
    let number = Field::new("item", DataType::Float32, false);
    Arc::new(FixedSizeListArray::new(
        number.into(),
        2,
        Arc::new(Float32Array::from(coordinates)),
        None,
    ))
}
