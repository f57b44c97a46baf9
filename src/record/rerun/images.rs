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
use crate::run::ranks::Ranks;
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

/// The images of one agent that are not written yet.
#[derive(Clone)]
pub(super) struct AgentImages {
    latest: ImageSeries,
    density: ImageSeries,
    /// `None` for agents without a bonus.
    bonus: Option<ImageSeries>,
}

/// The images of the team, and the ends of its scale and of that of the agents.
#[derive(Clone)]
pub(super) struct ImageGroup {
    team: ImageSeries,
    agents_scale: LabelSeries,
    team_scale: LabelSeries,
}

/// All images of a recording but those of single agents.
#[derive(Clone)]
pub(super) struct TeamImages {
    pub(super) latest: ImageGroup,
    pub(super) density: ImageGroup,
    pub(super) bonus: Option<ImageGroup>,
    difference: ImageSeries,
    difference_scale: LabelSeries,
}

/// A local agent, of which images are added.
pub(super) struct DrawnAgent<'a> {
    pub(super) number: u32,
    pub(super) visits: &'a AgentVisits,
    pub(super) images: &'a mut AgentImages,
}

/// What images show, and how.
pub(super) struct ImageSettings<'a> {
    pub(super) style: &'a VisitationStyle,
    /// The agents of which the difference is drawn.
    pub(super) difference: &'a Difference,
    /// The latest rounds.
    pub(super) rounds: RangeInclusive<u32>,
    pub(super) moment: Moment,
    pub(super) ranks: Ranks,
    pub(super) workers: Workers<'a>,
}

/// The images that are added at a moment.
struct DrawnImages {
    density: Drawn,
    /// `None` if it is `density`.
    latest: Option<Drawn>,
    /// `None` for agents without a bonus.
    bonus: Option<Drawn>,
    /// Numbers and densities of the two agents of which the difference is drawn; `None` on ranks other than 0.
    compared: Option<[(u32, Vec<u32>); 2]>,
}

/// Images of one kind, with one scale for all agents.
#[derive(Clone)]
struct Drawn {
    /// `[local agents]`
    agents: Vec<Vec<u8>>,
    team: Vec<u8>,
    /// The upper ends of the scale of agents and of that of the team.
    ends: [String; 2],
}

/// Adds images of all states visited so far, and of those in the latest rounds: those of the local agents, and on rank 0, which
/// has a `team`, those of all agents together.
pub(super) fn add_images(
    agents: &mut [DrawnAgent<'_>],
    team: Option<&mut TeamImages>,
    settings: &ImageSettings<'_>,
) {
    let visits = || agents.iter().map(|agent| agent.visits).collect::<Vec<_>>();
    let densities = settings
        .workers
        .map(visits(), |visits| visits.density.pixels());
    let mut drawn = DrawnImages {
        density: Drawn::densities(&densities, settings),
        latest: settings.latest_densities(&visits()),
        bonus: settings.bonuses(&visits()),
        compared: compared_densities(agents, densities, settings),
    };
    for (index, agent) in agents.iter_mut().enumerate() {
        agent.images.push(&mut drawn, index, settings.moment);
    }
    if let Some(team) = team {
        team.push(drawn, settings);
    }
}

impl ImageSettings<'_> {
    /// The densities of the latest rounds; `None` if these are all rounds.
    fn latest_densities(&self, agents: &[&AgentVisits]) -> Option<Drawn> {
        if *self.rounds.start() == 0 {
            return None;
        }
        let latest = self
            .workers
            .map(agents.to_vec(), AgentVisits::latest_density);
        Some(Drawn::densities(&latest, self))
    }

    /// The bonuses of the latest rounds; `None` if agents have none.
    fn bonuses(&self, agents: &[&AgentVisits]) -> Option<Drawn> {
        let pairs = &self.style.pairs;
        let maps = agents.iter().map(|visits| visits.latest_bonuses(pairs));
        let maps: Vec<BonusMap> = maps.collect::<Option<_>>()?;
        Some(Drawn::bonuses(&maps, pairs, self.ranks))
    }
}

/// Numbers and densities of the two agents that are compared, on rank 0.
fn compared_densities(
    agents: &[DrawnAgent<'_>],
    densities: Vec<Vec<u32>>,
    settings: &ImageSettings<'_>,
) -> Option<[(u32, Vec<u32>); 2]> {
    let ranks = settings.ranks;
    let (one, other) = match settings.difference {
        Difference::Off => None,
        Difference::Between(one, other) => Some((**one, **other)),
        Difference::MostDifferent => {
            let first_agent = agents.first().map_or(0, |agent| agent.number);
            most_different(&densities, first_agent, settings.style.axes.width(), ranks)
        }
    }?;
    let numbers = agents.iter().map(|agent| agent.number);
    let compared = numbers.zip(densities);
    let compared = compared.filter(|(agent, _)| [one, other].contains(agent));
    let all = ranks.gather_lists(compared.collect::<Vec<_>>());
    let of = |agent: u32| all.iter().find(|(number, _)| *number == agent).cloned();
    Some([of(one)?, of(other)?])
}

impl Drawn {
    /// The number of lines per pixel. The ends are the numbers of lines on the brightest pixels.
    fn densities(agents: &[Vec<u32>], settings: &ImageSettings<'_>) -> Self {
        let ranks = settings.ranks;
        let max = agents.iter().flatten().copied().max().unwrap_or(0);
        let max = ranks.all_gather(max).into_iter().max().unwrap_or(0);
        let images = settings.workers.map(agents.iter().collect(), |pixels| {
            density_pixels(pixels, max)
        });
        let team = sum_of_densities(agents, ranks);
        let max_of_team = team.iter().copied().max().unwrap_or(0);
        let ends = [max, max_of_team].map(|lines| with_thousands_separators(u64::from(lines)));
        Self {
            agents: images,
            team: density_pixels(&team, max_of_team),
            ends,
        }
    }

    /// Mean bonuses. The ends are the largest mean bonuses of a cell.
    fn bonuses(agents: &[BonusMap], pairs: &Pairs, ranks: Ranks) -> Self {
        let max = agents.iter().map(BonusMap::max_mean).fold(0.0, f64::max);
        let max = ranks.all_gather(max).into_iter().fold(0.0, f64::max);
        let team = BonusMap::of_all(agents, pairs, ranks);
        let max_of_team = team.max_mean();
        let images = agents.iter().map(|map| bonus_pixels(map, max, pairs));
        Self {
            agents: images.collect(),
            team: bonus_pixels(&team, max_of_team, pairs),
            ends: [max, max_of_team].map(|mean| format_number(mean as f32)),
        }
    }
}

impl AgentImages {
    /// No images of an agent of a team of `team_size` agents.
    pub(super) fn new(agent: u32, team_size: usize, has_bonus: bool) -> Self {
        let series = |root: &str, name: &str, kind| {
            let entity = format!("{root}/agent_{agent}/{name}");
            ImageSeries::new(entity.into(), kind, images_per_chunk(team_size))
        };
        Self {
            latest: series("visitation", "latest", ImageKind::Density),
            density: series("visitation", "density", ImageKind::Density),
            bonus: has_bonus.then(|| series("pairs", "bonus", ImageKind::Colored)),
        }
    }

    /// Adds the images of the local agent with this index.
    fn push(&mut self, drawn: &mut DrawnImages, index: usize, moment: Moment) {
        let density = std::mem::take(&mut drawn.density.agents[index]);
        let latest = drawn.latest.as_mut();
        let latest = latest.map(|drawn| std::mem::take(&mut drawn.agents[index]));
        self.latest
            .push(latest.unwrap_or_else(|| density.clone()), moment);
        self.density.push(density, moment);
        if let (Some(series), Some(drawn)) = (&mut self.bonus, &mut drawn.bonus) {
            series.push(std::mem::take(&mut drawn.agents[index]), moment);
        }
    }

    /// Takes the images of entities that have enough images for a chunk or, if `all` is set, all
    /// images.
    pub(super) fn take(
        &mut self,
        all: bool,
    ) -> impl Iterator<Item = Result<Chunk, RecordingError>> {
        let densities = [&mut self.latest, &mut self.density].into_iter();
        let series = densities.chain(&mut self.bonus);
        series.filter_map(move |series| series.take(all))
    }

    /// Static formats of the images.
    pub(super) fn styles(&self, axes: &Axes, pairs: &Pairs) -> Result<Vec<Chunk>, RecordingError> {
        let densities = [&self.latest, &self.density].into_iter();
        let densities = densities.map(|series| series.style(density_size(axes)));
        let bonuses = self.bonus.iter();
        let bonuses = bonuses.map(|series| series.style(bonus_size(pairs)));
        densities.chain(bonuses).collect()
    }
}

impl TeamImages {
    /// No images of a team of `agents` agents.
    pub(super) fn new(agents: usize, has_bonus: bool) -> Self {
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
        }
    }

    fn push(&mut self, drawn: DrawnImages, settings: &ImageSettings<'_>) {
        let ImageSettings { rounds, moment, .. } = settings;
        let note = format!("rounds {} to {}", rounds.start(), rounds.end());
        let latest = drawn.latest.unwrap_or_else(|| drawn.density.clone());
        self.latest.push(latest, Some(&note), *moment);
        self.density.push(drawn.density, None, *moment);
        if let Some(compared) = drawn.compared {
            self.push_difference(&compared, settings.style.axes.width(), *moment);
        }
        if let (Some(group), Some(bonus)) = (&mut self.bonus, drawn.bonus) {
            group.push(bonus, Some(&note), *moment);
        }
    }

    fn push_difference(
        &mut self,
        [(one, densities_of_one), (other, densities_of_other)]: &[(u32, Vec<u32>); 2],
        width: usize,
        moment: Moment,
    ) {
        let (differences, max) = share_difference(
            (densities_of_one, line_count(densities_of_one, width)),
            (densities_of_other, line_count(densities_of_other, width)),
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
        let groups = [&mut self.latest, &mut self.density].into_iter();
        let of_groups = groups
            .chain(&mut self.bonus)
            .flat_map(move |group| group.take(all));
        let difference = self.difference.take(all);
        of_groups
            .chain(difference)
            .chain(self.difference_scale.take(all))
    }

    /// Static formats of all images.
    pub(super) fn styles(&self, axes: &Axes, pairs: &Pairs) -> Result<Vec<Chunk>, RecordingError> {
        let densities = [&self.latest.team, &self.density.team, &self.difference].into_iter();
        let densities = densities.map(|series| series.style(density_size(axes)));
        let bonuses = self.bonus.iter();
        let bonuses = bonuses.map(|group| group.team.style(bonus_size(pairs)));
        densities.chain(bonuses).collect()
    }

    /// Static positions of the labels of the scale of differences.
    pub(super) fn difference_label_style(&self, labels: &[Label]) -> Result<Chunk, RecordingError> {
        self.difference_scale.style(labels)
    }
}

fn density_size(axes: &Axes) -> [u32; 2] {
    [axes.width() as u32, AXIS_HEIGHT as u32]
}

fn bonus_size(pairs: &Pairs) -> [u32; 2] {
    [pairs.width() as u32, CELLS_PER_SIDE as u32]
}

fn images_per_chunk(agents: usize) -> usize {
    (MAX_WAITING_IMAGES / agents.max(1)).clamp(1, IMAGES_PER_CHUNK)
}

impl ImageGroup {
    fn new(agents: usize, root: &str, name: &str, kind: ImageKind, labels: usize) -> Self {
        let entity = format!("{root}/team/{name}");
        Self {
            team: ImageSeries::new(entity.into(), kind, images_per_chunk(agents)),
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

    /// Adds the image of the team. The labels of both scales are their ends, and `note`.
    fn push(&mut self, drawn: Drawn, note: Option<&str>, moment: Moment) {
        self.team.push(drawn.team, moment);
        let [agents_end, team_end] = drawn.ends;
        let texts = |end: String| [end].into_iter().chain(note.map(ToOwned::to_owned));
        self.agents_scale.push(texts(agents_end), moment);
        self.team_scale.push(texts(team_end), moment);
    }

    fn take(&mut self, all: bool) -> impl Iterator<Item = Result<Chunk, RecordingError>> {
        let labels = [&mut self.agents_scale, &mut self.team_scale].into_iter();
        let labels = labels.filter_map(move |series| series.take(all));
        self.team.take(all).into_iter().chain(labels)
    }
}

/// The lines of all agents over each pixel.
fn sum_of_densities(agents: &[Vec<u32>], ranks: Ranks) -> Vec<u32> {
    let mut sums = vec![0_u64; agents.first().map_or(0, Vec::len)];
    for pixels in agents {
        for (sum, lines) in sums.iter_mut().zip(pixels) {
            *sum += u64::from(*lines);
        }
    }
    let sums = ranks.sum(sums).into_iter();
    sums.map(|sum| u32::try_from(sum).unwrap_or(u32::MAX))
        .collect()
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
