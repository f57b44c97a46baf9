//! Images of visited states, a new one every few rounds: line densities at
//! `/visitation/agent_K/density` (all states so far) and `/visitation/agent_K/latest` (the latest
//! rounds), and the same images of the team at `/visitation/team/…`; the difference between two
//! agents at `/visitation/difference`; mean bonuses at `/pairs/agent_K/bonus` and
//! `/pairs/team/bonus`. The images of all agents share one scale; its ends are recorded with the
//! images.

use std::ops::RangeInclusive;
use std::sync::Arc;

use rerun::components::{Colormap, ImageBuffer, ImageFormat, MagnificationFilter};
use rerun::datatypes::{ChannelDatatype, ColorModel};
use rerun::external::arrow::array::StringArray;
use rerun::log::Chunk;
use rerun::{DepthImage, EntityPath, Image, Points2D};

use super::annotations::{Label, format_number, show_labels_only};
use super::error::RecordingError;
use super::rows::{Moment, Moments, grouped_column, rgb, static_chunk};
use super::samples::VisitationStyle;
use crate::record::visitation::{
    AXIS_HEIGHT, AgentVisits, Axes, BonusMap, CELLS_PER_SIDE, MIN_BRIGHTNESS, Pairs,
    brightness_of_pixels, line_count, most_different, share_difference,
};
use crate::scenario::recording::Difference;
use seedbed_figure::color::dark::{diverging_color, sequential_color};
use seedbed_learn::team::Workers;

/// Number of images in one chunk, in teams of up to 128 agents. In larger teams it is smaller,
/// because the images of all agents wait in memory at the same time.
const IMAGES_PER_CHUNK: usize = 16;
const MAX_WAITING_IMAGES: usize = 1024;

/// Number of colors in an image, apart from the color of pixels without lines. Neighboring pixels
/// often have the same color, so that an image compresses to a third of its size with 255 colors.
const COLOR_STEPS: u8 = 16;

/// The color of cells without states.
const EMPTY_COLOR: [u8; 3] = [0, 0, 4];

/// The images of one entity that are not written yet.
#[derive(Clone)]
pub(super) struct ImageSeries {
    entity: EntityPath,
    kind: ImageKind,
    moments: Moments,
    images: Vec<ImageBuffer>,
    images_per_chunk: usize,
}

/// What the bytes of an image are.
#[derive(Clone, Copy, PartialEq)]
enum ImageKind {
    /// One number per pixel, which the viewer maps to a color.
    Density,
    /// Red, green and blue of each pixel.
    Colored,
}

/// Labels that are recorded with each image and are not written yet.
#[derive(Clone)]
pub(super) struct LabelSeries {
    entity: EntityPath,
    moments: Moments,
    texts: Vec<String>,
    labels_per_row: usize,
}

/// The images of each agent and of the team, with the ends of their scales.
#[derive(Clone)]
pub(super) struct ImageGroup {
    agents: Vec<ImageSeries>,
    team: ImageSeries,
    agents_scale: LabelSeries,
    team_scale: LabelSeries,
}

/// All images of a recording.
#[derive(Clone)]
pub(super) struct ImageWriter {
    pub(super) latest: ImageGroup,
    pub(super) density: ImageGroup,
    pub(super) bonus: Option<ImageGroup>,
    difference: ImageSeries,
    difference_scale: LabelSeries,
    compared_agents: Difference,
}

impl ImageWriter {
    pub(super) fn new(agents: usize, has_bonus: bool, compared_agents: &Difference) -> Self {
        let density =
            |name, labels| ImageGroup::new(agents, "visitation", name, ImageKind::Density, labels);
        let bonus = || ImageGroup::new(agents, "pairs", "bonus", ImageKind::Colored, 2);
        Self {
            latest: density("latest", 2),
            density: density("density", 1),
            bonus: has_bonus.then(bonus),
            difference: ImageSeries::new(
                "visitation/difference".into(),
                ImageKind::Colored,
                IMAGES_PER_CHUNK,
            ),
            difference_scale: LabelSeries::new("visitation/team/scale/difference/ends", 4),
            compared_agents: compared_agents.clone(),
        }
    }

    /// Adds images of all states visited so far, and of those in the latest `rounds`.
    pub(super) fn push(
        &mut self,
        visits: &[AgentVisits],
        VisitationStyle { axes, pairs, .. }: &VisitationStyle,
        rounds: RangeInclusive<u32>,
        moment: Moment,
        workers: Workers<'_>,
    ) {
        let are_all_latest = *rounds.start() == 0;
        let rounds = format!("rounds {} to {}", rounds.start(), rounds.end());
        let note = Some(&*rounds);
        let agents = || visits.iter().collect::<Vec<_>>();
        if !are_all_latest {
            let latest = workers.map(agents(), AgentVisits::latest_density);
            self.latest.push_densities(&latest, note, moment, workers);
        }
        let densities = workers.map(agents(), |agent| agent.density.pixels());
        if are_all_latest {
            self.latest
                .push_densities(&densities, note, moment, workers);
        }
        self.density
            .push_densities(&densities, None, moment, workers);
        self.push_difference(&densities, axes.width(), moment);
        if let Some(group) = &mut self.bonus {
            let bonuses: Vec<BonusMap> = visits
                .iter()
                .filter_map(|agent| agent.latest_bonuses(pairs))
                .collect();
            group.push_bonuses(&bonuses, pairs, &rounds, moment);
        }
    }

    fn push_difference(&mut self, densities: &[Vec<u32>], width: usize, moment: Moment) {
        let agents = match &self.compared_agents {
            Difference::Off => None,
            Difference::Between(one, other) => Some((**one as usize, **other as usize)),
            Difference::MostDifferent => most_different(densities, width),
        };
        let Some((one, other)) = agents else { return };
        let (differences, max) = share_difference(
            (&densities[one], line_count(&densities[one], width)),
            (&densities[other], line_count(&densities[other], width)),
        );
        self.difference
            .push(difference_pixels(&differences), moment);
        let end = format!("+{:.2} %", 100.0 * max);
        let [one, other] = [one, other].map(|agent| format!("agent {agent}"));
        self.difference_scale
            .push([one, end.clone(), end, other], moment);
    }

    /// Takes the images of entities that have enough images for a chunk or, if `all` is set, all
    /// images.
    pub(super) fn take(
        &mut self,
        all: bool,
    ) -> impl Iterator<Item = Result<Chunk, RecordingError>> {
        let groups = [&mut self.latest, &mut self.density]
            .into_iter()
            .chain(&mut self.bonus);
        let of_groups = groups.flat_map(move |group| {
            let images = group.agents.iter_mut().chain([&mut group.team]);
            let labels = [&mut group.agents_scale, &mut group.team_scale];
            images.filter_map(move |series| series.take(all)).chain(
                labels
                    .into_iter()
                    .filter_map(move |series| series.take(all)),
            )
        });
        let difference = self.difference.take(all);
        of_groups
            .chain(difference)
            .chain(self.difference_scale.take(all))
    }

    /// Static formats of all images.
    pub(super) fn styles(&self, axes: &Axes, pairs: &Pairs) -> Result<Vec<Chunk>, RecordingError> {
        let density_size = [axes.width() as u32, AXIS_HEIGHT as u32];
        let bonus_size = [pairs.width() as u32, CELLS_PER_SIDE as u32];
        let densities = [&self.latest, &self.density]
            .into_iter()
            .flat_map(ImageGroup::image_series)
            .chain([&self.difference])
            .map(|series| series.style(density_size));
        let bonuses = self
            .bonus
            .iter()
            .flat_map(ImageGroup::image_series)
            .map(|series| series.style(bonus_size));
        densities.chain(bonuses).collect()
    }

    /// Static positions of the labels of the scale of differences.
    pub(super) fn difference_label_style(&self, labels: &[Label]) -> Result<Chunk, RecordingError> {
        self.difference_scale.style(labels)
    }
}

impl ImageGroup {
    fn new(agents: usize, root: &str, name: &str, kind: ImageKind, labels: usize) -> Self {
        let images_per_chunk = (MAX_WAITING_IMAGES / agents.max(1)).clamp(1, IMAGES_PER_CHUNK);
        let series = |subject_name: &str| {
            let entity = format!("{root}/{subject_name}/{name}");
            ImageSeries::new(entity.into(), kind, images_per_chunk)
        };
        Self {
            agents: (0..agents)
                .map(|agent| series(&format!("agent_{agent}")))
                .collect(),
            team: series("team"),
            agents_scale: LabelSeries::new(&format!("{root}/scale/{name}/ends"), labels),
            team_scale: LabelSeries::new(&format!("{root}/team/scale/{name}/ends"), labels),
        }
    }

    /// Static positions of the labels of the agents' scale and of the team's scale.
    pub(super) fn label_styles(
        &self,
        [agents, team]: &[Vec<Label>; 2],
    ) -> Result<[Chunk; 2], RecordingError> {
        Ok([
            self.agents_scale.style(agents)?,
            self.team_scale.style(team)?,
        ])
    }

    fn image_series(&self) -> impl Iterator<Item = &ImageSeries> {
        self.agents.iter().chain([&self.team])
    }

    /// Adds images of the number of lines per pixel. The labels of both scales are the number of
    /// lines on the brightest pixel, and `note`.
    fn push_densities(
        &mut self,
        agents: &[Vec<u32>],
        note: Option<&str>,
        moment: Moment,
        workers: Workers<'_>,
    ) {
        let max = agents
            .iter()
            .flat_map(|pixels| pixels.iter())
            .copied()
            .max()
            .unwrap_or(0);
        let images = workers.map(agents.iter().collect(), |pixels| {
            density_pixels(pixels, max)
        });
        for (series, image) in self.agents.iter_mut().zip(images) {
            series.push(image, moment);
        }
        let team = sum_of_densities(agents);
        let max_of_team = team.iter().copied().max().unwrap_or(0);
        self.team.push(density_pixels(&team, max_of_team), moment);
        let ends = [max, max_of_team].map(|lines| with_thousands_separators(u64::from(lines)));
        self.push_scale_labels(ends, note, moment);
    }

    /// Adds images of mean bonuses. The labels of both scales are the largest mean bonus of a cell,
    /// and `note`.
    fn push_bonuses(&mut self, agents: &[BonusMap], pairs: &Pairs, note: &str, moment: Moment) {
        let mut team = BonusMap::new(pairs);
        for map in agents {
            team.add_all(map);
        }
        let max = agents.iter().map(BonusMap::max_mean).fold(0.0, f64::max);
        for (series, map) in self.agents.iter_mut().zip(agents) {
            series.push(bonus_pixels(map, max, pairs), moment);
        }
        let max_of_team = team.max_mean();
        self.team
            .push(bonus_pixels(&team, max_of_team, pairs), moment);
        let ends = [max, max_of_team].map(|mean| format_number(mean as f32));
        self.push_scale_labels(ends, Some(note), moment);
    }

    fn push_scale_labels(
        &mut self,
        [agents_end, team_end]: [String; 2],
        note: Option<&str>,
        moment: Moment,
    ) {
        let texts = |end: String| [end].into_iter().chain(note.map(ToOwned::to_owned));
        self.agents_scale.push(texts(agents_end), moment);
        self.team_scale.push(texts(team_end), moment);
    }
}

fn sum_of_densities(densities: &[Vec<u32>]) -> Vec<u32> {
    let mut sum = vec![0_u32; densities.first().map_or(0, Vec::len)];
    for pixels in densities {
        for (sum, lines) in sum.iter_mut().zip(pixels) {
            *sum = sum.saturating_add(*lines);
        }
    }
    sum
}

/// Brightness of each pixel, as [`brightness_of_pixels`], rounded to one of 16 steps.
fn density_pixels(lines: &[u32], max_lines: u32) -> Vec<u8> {
    let steps: [u8; 256] = std::array::from_fn(|brightness| rounded_brightness(brightness as u8));
    let mut pixels = brightness_of_pixels(lines, max_lines);
    for pixel in &mut pixels {
        *pixel = steps[usize::from(*pixel)];
    }
    pixels
}

/// The nearest of 16 steps from [`MIN_BRIGHTNESS`] to 255; 0 for 0.
fn rounded_brightness(brightness: u8) -> u8 {
    if brightness < MIN_BRIGHTNESS {
        return 0;
    }
    let (range, steps) = (u16::from(255 - MIN_BRIGHTNESS), u16::from(COLOR_STEPS - 1));
    let step = (u16::from(brightness - MIN_BRIGHTNESS) * steps + range / 2) / range;
    MIN_BRIGHTNESS + ((step * range + steps / 2) / steps) as u8
}

/// A share from 0 to 1, rounded to one of 16 steps.
fn rounded_share(share: f32) -> f32 {
    let steps = f32::from(COLOR_STEPS - 1);
    (share * steps).round() / steps
}

/// Colors of differences from −1 to 1, rounded to 16 steps in each direction.
fn difference_pixels(differences: &[f32]) -> Vec<u8> {
    let steps = f32::from(COLOR_STEPS);
    let colors: Vec<[u8; 3]> = (-i16::from(COLOR_STEPS)..=i16::from(COLOR_STEPS))
        .map(|step| diverging_color(f32::from(step) / steps))
        .collect();
    let color = |difference: &f32| colors[(difference * steps + steps + 0.5) as usize];
    differences.iter().flat_map(color).collect()
}

/// Colors of mean bonuses from 0 (dark) to `max` (bright), with panels side by side.
fn bonus_pixels(map: &BonusMap, max: f64, pairs: &Pairs) -> Vec<u8> {
    let (width, scale) = (pairs.width(), if max > 0.0 { max } else { 1.0 });
    let mut pixels = EMPTY_COLOR.repeat(width * CELLS_PER_SIDE);
    for (cell, mean) in map.means().enumerate() {
        let (panel, row, column) = (
            cell / (CELLS_PER_SIDE * CELLS_PER_SIDE),
            cell / CELLS_PER_SIDE % CELLS_PER_SIDE,
            cell % CELLS_PER_SIDE,
        );
        let pixel = 3 * (row * width + pairs.x(panel) + column);
        let color = mean.map_or(EMPTY_COLOR, |mean| {
            sequential_color(rounded_share((mean / scale) as f32))
        });
        pixels[pixel..pixel + 3].copy_from_slice(&color);
    }
    pixels
}

/// A number with commas as thousands separators, such as `1,234,567`.
fn with_thousands_separators(number: u64) -> String {
    let digits = number.to_string();
    let groups: Vec<&str> = digits
        .as_bytes()
        .rchunks(3)
        .rev()
        .filter_map(|group| std::str::from_utf8(group).ok())
        .collect();
    groups.join(",")
}

impl ImageSeries {
    fn new(entity: EntityPath, kind: ImageKind, images_per_chunk: usize) -> Self {
        Self {
            entity,
            kind,
            moments: Moments::default(),
            images: Vec::new(),
            images_per_chunk,
        }
    }

    fn push(&mut self, pixels: Vec<u8>, moment: Moment) {
        self.moments.push(moment);
        self.images.push(pixels.into());
    }

    fn take(&mut self, all: bool) -> Option<Result<Chunk, RecordingError>> {
        let min_images = if all { 1 } else { self.images_per_chunk };
        (self.images.len() >= min_images).then(|| self.take_chunk())
    }

    fn take_chunk(&mut self) -> Result<Chunk, RecordingError> {
        let moments = std::mem::take(&mut self.moments);
        let images = std::mem::take(&mut self.images);
        let columns = match self.kind {
            ImageKind::Density => DepthImage::update_fields()
                .with_many_buffer(images)
                .columns_of_unit_batches()
                .map(Vec::from_iter),
            ImageKind::Colored => Image::update_fields()
                .with_many_buffer(images)
                .columns_of_unit_batches()
                .map(Vec::from_iter),
        };
        moments.into_chunk(&self.entity, columns?)
    }

    fn style(&self, size: [u32; 2]) -> Result<Chunk, RecordingError> {
        if self.kind == ImageKind::Colored {
            let format = ImageFormat::from_color_model(size, ColorModel::RGB, ChannelDatatype::U8);
            let style = Image::update_fields()
                .with_format(format)
                .with_magnification_filter(MagnificationFilter::Nearest);
            return static_chunk(self.entity.clone(), &style);
        }
        let style = DepthImage::update_fields()
            .with_format(ImageFormat::depth(size, ChannelDatatype::U8))
            .with_colormap(Colormap::Inferno)
            .with_depth_range([0.0, 255.0])
            .with_magnification_filter(MagnificationFilter::Linear);
        static_chunk(self.entity.clone(), &style)
    }
}

impl LabelSeries {
    fn new(entity: &str, labels_per_row: usize) -> Self {
        Self {
            entity: entity.into(),
            moments: Moments::default(),
            texts: Vec::new(),
            labels_per_row,
        }
    }

    fn push(&mut self, texts: impl IntoIterator<Item = String>, moment: Moment) {
        self.moments.push(moment);
        self.texts.extend(texts);
    }

    fn take(&mut self, all: bool) -> Option<Result<Chunk, RecordingError>> {
        let min_rows = if all { 1 } else { IMAGES_PER_CHUNK };
        (self.moments.len() >= min_rows).then(|| self.take_chunk())
    }

    fn take_chunk(&mut self) -> Result<Chunk, RecordingError> {
        let moments = std::mem::take(&mut self.moments);
        let texts = StringArray::from(std::mem::take(&mut self.texts));
        let labels_in_rows = vec![self.labels_per_row; moments.len()];
        let column = grouped_column(
            Points2D::descriptor_labels(),
            Arc::new(texts),
            labels_in_rows,
        );
        moments.into_chunk(&self.entity, [column])
    }

    /// Static positions and colors of the labels.
    fn style(&self, labels: &[Label]) -> Result<Chunk, RecordingError> {
        let points = Points2D::new(labels.iter().map(|(_, position, _)| *position));
        let colored = points.with_colors(labels.iter().map(|(_, _, color)| rgb(*color)));
        static_chunk(self.entity.clone(), &show_labels_only(colored))
    }
}
