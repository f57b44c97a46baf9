//! Reads recordings with the decoder of the Rerun SDK.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use rerun::external::arrow::array::{Array, StringArray};
use rerun::external::re_log_encoding::rrd::DecoderApp;
use rerun::log::{Chunk, LogMsg};
use rerun::{ComponentIdentifier, StoreKind, TimelineName};

/// The chunks of a recording by entity, in the order of the file.
pub(crate) struct RecordingContents(BTreeMap<String, Vec<Chunk>>);

impl RecordingContents {
    pub(crate) fn read(path: &Path) -> Self {
        let mut entities: BTreeMap<String, Vec<Chunk>> = BTreeMap::new();
        for message in messages(path) {
            if let LogMsg::ArrowMsg(store, arrow) = message
                && store.kind() == StoreKind::Recording
            {
                let chunk = Chunk::from_arrow_msg(&arrow).unwrap();
                entities
                    .entry(chunk.entity_path().to_string())
                    .or_default()
                    .push(chunk);
            }
        }
        Self(entities)
    }

    /// Whether an entity whose path begins like this has data.
    pub(crate) fn has_entity(&self, path: &str) -> bool {
        self.0.keys().any(|entity| entity.starts_with(path))
    }

    pub(super) fn chunks(&self, entity: &str) -> &[Chunk] {
        self.0.get(entity).map_or(&[], Vec::as_slice)
    }

    /// Times of all rows of an entity that are on the timeline.
    pub(super) fn times(&self, entity: &str, timeline: &'static str) -> Vec<i64> {
        let timeline = TimelineName::from(timeline);
        let columns = self
            .chunks(entity)
            .iter()
            .filter_map(|chunk| chunk.timelines().get(&timeline));
        columns
            .flat_map(|column| column.times_raw().to_vec())
            .collect()
    }

    pub(super) fn f32_values(&self, entity: &str, component: &str) -> Vec<f32> {
        let component = ComponentIdentifier::try_new(component).unwrap();
        self.chunks(entity)
            .iter()
            .flat_map(|chunk| chunk.iter_slices::<f32>(component).flatten().copied())
            .collect()
    }

    pub(super) fn f64_values(&self, entity: &str, component: &str) -> Vec<f64> {
        let component = ComponentIdentifier::try_new(component).unwrap();
        self.chunks(entity)
            .iter()
            .flat_map(|chunk| chunk.iter_slices::<f64>(component).flatten().copied())
            .collect()
    }

    pub(super) fn texts(&self, entity: &str, component: &str) -> Vec<String> {
        let component = ComponentIdentifier::try_new(component).unwrap();
        let mut texts = Vec::new();
        for list in self
            .chunks(entity)
            .iter()
            .filter_map(|chunk| chunk.components().get_array(component))
        {
            let values = list
                .values()
                .as_any()
                .downcast_ref::<StringArray>()
                .unwrap();
            texts.extend(values.iter().flatten().map(ToOwned::to_owned));
        }
        texts
    }

    pub(super) fn u32_values(&self, entity: &str, component: &str) -> Vec<u32> {
        let component = ComponentIdentifier::try_new(component).unwrap();
        self.chunks(entity)
            .iter()
            .flat_map(|chunk| chunk.iter_slices::<u32>(component).flatten().copied())
            .collect()
    }

    pub(super) fn points(&self, entity: &str) -> Vec<[f32; 2]> {
        let component = ComponentIdentifier::try_new("Points2D:positions").unwrap();
        self.chunks(entity)
            .iter()
            .flat_map(|chunk| chunk.iter_slices::<[f32; 2]>(component).flatten().copied())
            .collect()
    }

    pub(super) fn strips(&self, entity: &str) -> Vec<Vec<[f32; 2]>> {
        let component = ComponentIdentifier::try_new("LineStrips2D:strips").unwrap();
        let rows = |chunk: &Chunk| -> Vec<Vec<[f32; 2]>> {
            let rows = chunk.iter_slices::<&[[f32; 2]]>(component);
            rows.flatten().map(<[_]>::to_vec).collect()
        };
        self.chunks(entity).iter().flat_map(rows).collect()
    }

    /// The bytes of each image of an entity, for density images and color images.
    pub(super) fn image_bytes(&self, entity: &str) -> Vec<Vec<u8>> {
        let names = ["DepthImage:buffer", "Image:buffer"]
            .map(|name| ComponentIdentifier::try_new(name).unwrap());
        let bytes = |chunk: &Chunk| -> Vec<Vec<u8>> {
            let buffers = names.iter().flat_map(|name| {
                chunk
                    .iter_slices::<&[u8]>(*name)
                    .flatten()
                    .map(|bytes| bytes.to_vec())
                    .collect::<Vec<_>>()
            });
            buffers.collect()
        };
        self.chunks(entity).iter().flat_map(bytes).collect()
    }

    /// Indices of the rows that have the component, counted over all chunks.
    pub(super) fn rows_with(&self, entity: &str, component: &str) -> Vec<usize> {
        self.list_length_by_row(entity, component)
            .iter()
            .enumerate()
            .filter_map(|(row, length)| length.map(|_| row))
            .collect()
    }

    /// Number of values, such as lines or points, in each row that has the component.
    pub(super) fn list_lengths(&self, entity: &str, component: &str) -> Vec<usize> {
        self.list_length_by_row(entity, component)
            .into_iter()
            .flatten()
            .collect()
    }

    /// Number of values in each row, or `None` if the row does not have the component.
    pub(super) fn list_length_by_row(&self, entity: &str, component: &str) -> Vec<Option<usize>> {
        let component = ComponentIdentifier::try_new(component).unwrap();
        let lists = self
            .chunks(entity)
            .iter()
            .filter_map(|chunk| chunk.components().get_array(component));
        lists
            .flat_map(|list| {
                (0..list.len())
                    .map(|row| list.is_valid(row).then(|| list.value_length(row) as usize))
            })
            .collect()
    }

    /// Every column of every entity, as one text per row. Does not depend on how rows are divided
    /// into chunks.
    pub(super) fn columns(&self) -> BTreeMap<String, Vec<String>> {
        let mut columns: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for (entity, chunk) in self
            .0
            .iter()
            .flat_map(|(entity, chunks)| chunks.iter().map(move |chunk| (entity, chunk)))
        {
            for (name, column) in chunk.timelines() {
                columns
                    .entry(format!("{entity} {name}"))
                    .or_default()
                    .extend(column.times_raw().iter().map(ToString::to_string));
            }
            for column in chunk.components().values() {
                let rows = (0..column.list_array.len())
                    .map(|row| format!("{:?}", column.list_array.value(row)));
                columns
                    .entry(format!("{entity} {}", column.descriptor.component))
                    .or_default()
                    .extend(rows);
            }
        }
        columns
    }
}

/// All messages of a recording, in the order of the file.
pub(super) fn messages(path: &Path) -> Vec<LogMsg> {
    let decoder = DecoderApp::decode_lazy(BufReader::new(File::open(path).unwrap()));
    decoder.collect::<Result<_, _>>().unwrap()
}
