//! Builds chunks. A chunk is a number of rows of one entity, which are written together because
//! each chunk has a header.

use std::sync::Arc;

use rerun::external::arrow::array::{Array, ArrayRef, FixedSizeListArray, Float32Array, ListArray};
use rerun::external::arrow::buffer::{NullBuffer, OffsetBuffer, ScalarBuffer};
use rerun::external::arrow::datatypes::{DataType, Field};
use rerun::external::nohash_hasher::IntMap;
use rerun::log::{Chunk, ChunkComponents, ChunkId, RowId};
use rerun::{
    AsComponents, Color, ComponentDescriptor, EntityPath, SerializedComponentColumn, TimeColumn,
    TimePoint, Timeline, TimelineName,
};

use serde::{Deserialize, Serialize};

use super::error::RecordingError;

/// The timeline of steps. An episode of T steps occupies T + 1 positions on it; the last position
/// is for the last observation.
pub(super) const ENV_STEP: &str = "env_step";
/// The timeline of episode numbers, which are counted per agent.
pub(super) const EPISODE: &str = "episode";
/// The timeline of rounds.
pub(super) const ROUND: &str = "round";

/// A position on all three timelines.
#[derive(Default, Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Moment {
    pub(super) env_step: i64,
    pub(super) episode: i64,
    pub(super) round: i64,
}

/// The moments of collected rows.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct Moments {
    env_steps: Vec<i64>,
    episodes: Vec<i64>,
    rounds: Vec<i64>,
}

impl Moments {
    pub(super) fn with_capacity(rows: usize) -> Self {
        Self {
            env_steps: Vec::with_capacity(rows),
            episodes: Vec::with_capacity(rows),
            rounds: Vec::with_capacity(rows),
        }
    }

    pub(super) fn push(&mut self, moment: Moment) {
        self.env_steps.push(moment.env_step);
        self.episodes.push(moment.episode);
        self.rounds.push(moment.round);
    }

    pub(super) fn append(&mut self, other: &mut Self) {
        self.env_steps.append(&mut other.env_steps);
        self.episodes.append(&mut other.episodes);
        self.rounds.append(&mut other.rounds);
    }

    /// Adds the moments of `rows` consecutive steps, beginning at `first`.
    pub(super) fn push_steps(&mut self, first: Moment, rows: usize) {
        let rows_after = |count: usize| self.env_steps.len() + count;
        self.episodes.resize(rows_after(rows), first.episode);
        self.rounds.resize(rows_after(rows), first.round);
        self.env_steps
            .extend(first.env_step..first.env_step + rows as i64);
    }

    pub(super) fn len(&self) -> usize {
        self.env_steps.len()
    }

    /// A chunk of rows at these moments, on all timelines.
    pub(super) fn into_chunk(
        self,
        entity: &EntityPath,
        columns: impl IntoIterator<Item = SerializedComponentColumn>,
    ) -> Result<Chunk, RecordingError> {
        self.into_chunk_on(&[ENV_STEP, EPISODE, ROUND], entity, columns)
    }

    /// A chunk of rows at these moments, on the given timelines.
    pub(super) fn into_chunk_on(
        self,
        timelines: &[&'static str],
        entity: &EntityPath,
        columns: impl IntoIterator<Item = SerializedComponentColumn>,
    ) -> Result<Chunk, RecordingError> {
        let row_ids: Vec<RowId> = std::iter::successors(Some(RowId::new()), |id| Some(id.next()))
            .take(self.len())
            .collect();
        let times = [
            (ENV_STEP, self.env_steps),
            (EPISODE, self.episodes),
            (ROUND, self.rounds),
        ];
        let times = times
            .into_iter()
            .filter(|(name, _)| timelines.contains(name))
            .map(|(name, times)| time_column(name, times));
        let components: ChunkComponents = columns
            .into_iter()
            .map(|column| (column.descriptor, column.list_array))
            .collect();
        let times: IntMap<TimelineName, TimeColumn> = times.collect();
        let chunk = Chunk::from_native_row_ids(
            ChunkId::new(),
            entity.clone(),
            Some(true),
            &row_ids,
            times,
            components,
        );
        Ok(chunk?)
    }
}

fn time_column(name: &'static str, times: Vec<i64>) -> (TimelineName, TimeColumn) {
    let timeline = Timeline::new_sequence(name);
    (
        *timeline.name(),
        TimeColumn::new(None, timeline, ScalarBuffer::from(times)),
    )
}

/// A chunk with a static row, which is valid at all times.
pub(super) fn static_chunk(
    entity: impl Into<EntityPath>,
    content: &dyn AsComponents,
) -> Result<Chunk, RecordingError> {
    single_row_chunk(entity, TimePoint::default(), content)
}

/// A chunk with a single row.
pub(super) fn single_row_chunk(
    entity: impl Into<EntityPath>,
    time_point: impl Into<TimePoint>,
    content: &dyn AsComponents,
) -> Result<Chunk, RecordingError> {
    let batches = content.as_serialized_batches();
    let chunk = Chunk::builder(entity)
        .with_serialized_batches(RowId::new(), time_point, batches)
        .build();
    Ok(chunk?)
}

/// A column with one value per row, except in rows that are not `present`.
pub(super) fn unit_column(
    descriptor: ComponentDescriptor,
    values: ArrayRef,
    present: Option<Vec<bool>>,
) -> SerializedComponentColumn {
    let per_row = match &present {
        None => vec![1; values.len()],
        Some(present) => present
            .iter()
            .map(|&present| usize::from(present))
            .collect(),
    };
    SerializedComponentColumn::new(
        list(values, per_row, present.map(NullBuffer::from)),
        descriptor,
    )
}

/// A column with `per_row[i]` values in row i.
pub(super) fn grouped_column(
    descriptor: ComponentDescriptor,
    values: ArrayRef,
    per_row: Vec<usize>,
) -> SerializedComponentColumn {
    SerializedComponentColumn::new(list(values, per_row, None), descriptor)
}

fn list(values: ArrayRef, lengths: Vec<usize>, present: Option<NullBuffer>) -> ListArray {
    let field = Field::new_list_field(values.data_type().clone(), true);
    ListArray::new(
        field.into(),
        OffsetBuffer::from_lengths(lengths),
        values,
        present,
    )
}

/// Polylines of 2D points, in the layout of the components of lines.
pub(super) fn strips(points: Vec<f32>, points_per_strip: Vec<usize>) -> ArrayRef {
    let number = Field::new("item", DataType::Float32, false);
    let points =
        FixedSizeListArray::new(number.into(), 2, Arc::new(Float32Array::from(points)), None);
    let point = Field::new("item", points.data_type().clone(), false);
    Arc::new(ListArray::new(
        point.into(),
        OffsetBuffer::from_lengths(points_per_strip),
        Arc::new(points),
        None,
    ))
}

/// An opaque color of Rerun.
pub(super) fn rgb([red, green, blue]: [u8; 3]) -> Color {
    Color::from_rgb(red, green, blue)
}
