//! Pictures of visited states, a new one every few rounds: densities of lines at `/visitation/agent_K/density` (all states so far) and
//! `/visitation/agent_K/latest`, the team's likewise; how two agents differ at `/visitation/difference`; and where bonuses come from at
//! `/pairs/agent_K/bonus` and `/pairs/team/bonus`. All agents share a scale, whose ends are beside the pictures.

use std::sync::Arc;

use rerun::components::{Colormap, ImageBuffer, ImageFormat, MagnificationFilter};
use rerun::datatypes::{ChannelDatatype, ColorModel};
use rerun::external::arrow::array::StringArray;
use rerun::log::Chunk;
use rerun::{DepthImage, EntityPath, Image, Points2D};

use super::furniture::{Label, lettered, number};
use super::rows::{Moment, Moments, grouped_column, rgb, timeless};
use super::sink::Fault;
use super::visitation::Drawing;
use crate::record::Difference;
use crate::record::palette::{diverging, sequential};
use crate::record::visitation::{
    Axes, CELLS, HEIGHT, Novelty, Pairs, Visited, differing, first_of, most_different, shade,
};

/// Pictures written as one piece.
const PICTURES_PER_CHUNK: usize = 8;

/// Where nobody was.
const EMPTY: [u8; 3] = [0, 0, 4];

/// Pictures of one entity that are still to be written.
pub(super) struct Gallery {
    entity: EntityPath,
    kind: Kind,
    moments: Moments,
    pictures: Vec<ImageBuffer>,
}

/// How the numbers of a picture become colours.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// One number a pixel, which the viewer colours.
    Density,
    /// Three a pixel, which are the colour.
    Colored,
}

/// Words that change with the pictures and are still to be written.
pub(super) struct Notes {
    entity: EntityPath,
    moments: Moments,
    words: Vec<String>,
    per_row: usize,
}

/// Pictures of each agent and of the team on scales that are stated.
pub(super) struct Hall {
    agents: Vec<Gallery>,
    team: Gallery,
    agents_scale: Notes,
    team_scale: Notes,
}

/// All pictures of a recording.
pub(super) struct Pictures {
    pub(super) latest: Hall,
    pub(super) density: Hall,
    pub(super) bonus: Option<Hall>,
    difference: Gallery,
    difference_scale: Notes,
    between: Difference,
}

impl Pictures {
    pub(super) fn new(agents: usize, curious: bool, between: &Difference) -> Self {
        let hall = |root, name, kind, lines| Hall::new(agents, root, name, kind, lines);
        Self {
            latest: hall("visitation", "latest", Kind::Density, 2),
            density: hall("visitation", "density", Kind::Density, 1),
            bonus: curious.then(|| hall("pairs", "bonus", Kind::Colored, 2)),
            difference: Gallery::new("visitation/difference".into(), Kind::Colored),
            difference_scale: Notes::new("visitation/difference/scale/ends", 4),
            between: between.clone(),
        }
    }

    /// Adds pictures of what was visited up to the end of a round, and in the latest `window` rounds.
    pub(super) fn hang(
        &mut self,
        visited: &[Visited],
        Drawing { axes, pairs, .. }: &Drawing,
        window: u32,
        at: Moment,
    ) {
        let round = at.round as u32;
        let rounds = format!("rounds {} to {round}", first_of(round, window));
        let latest: Vec<Vec<u32>> = visited.iter().map(Visited::latest).collect();
        self.latest.hang_densities(
            &latest.iter().map(Vec::as_slice).collect::<Vec<_>>(),
            Some(&rounds),
            at,
        );
        let so_far: Vec<&[u32]> = visited
            .iter()
            .map(|visited| visited.density.pixels())
            .collect();
        self.density.hang_densities(&so_far, None, at);
        self.compare(&so_far, axes.width(), at);
        if let Some(hall) = &mut self.bonus {
            let bonuses: Vec<Novelty> = visited
                .iter()
                .filter_map(|visited| visited.latest_bonuses(pairs))
                .collect();
            hall.hang_bonuses(&bonuses, pairs, &rounds, at);
        }
    }

    fn compare(&mut self, densities: &[&[u32]], width: usize, at: Moment) {
        let agents = match &self.between {
            Difference::Off => None,
            Difference::Between(one, other) => Some((**one as usize, **other as usize)),
            Difference::MostDifferent => most_different(densities, width),
        };
        let Some((one, other)) = agents else { return };
        let (differences, largest) = differing(densities[one], densities[other], width);
        self.difference.hang(
            differences
                .into_iter()
                .flat_map(diverging)
                .collect::<Vec<u8>>(),
            at,
        );
        let end = format!("{:.2} %", 100.0 * largest);
        self.difference_scale.add(
            [
                format!("agent {one}"),
                format!("+{end}"),
                format!("+{end}"),
                format!("agent {other}"),
            ],
            at,
        );
    }

    /// Those with enough pictures for a piece, or all that have any.
    pub(super) fn take(&mut self, all: bool) -> Result<Vec<Chunk>, Fault> {
        let halls = [&mut self.latest, &mut self.density]
            .into_iter()
            .chain(&mut self.bonus);
        let mut chunks = Vec::new();
        for Hall {
            agents,
            team,
            agents_scale,
            team_scale,
        } in halls
        {
            chunks.extend(
                agents
                    .iter_mut()
                    .chain([team])
                    .filter_map(|gallery| gallery.take(all)),
            );
            chunks.extend(
                [agents_scale, team_scale]
                    .into_iter()
                    .filter_map(|notes| notes.take(all)),
            );
        }
        chunks.extend(self.difference.take(all));
        chunks.extend(self.difference_scale.take(all));
        chunks.into_iter().collect()
    }

    /// What is true throughout.
    pub(super) fn styles(&self, axes: &Axes, pairs: &Pairs) -> Result<Vec<Chunk>, Fault> {
        let (lines, cells) = (
            [axes.width() as u32, HEIGHT as u32],
            [pairs.width() as u32, CELLS as u32],
        );
        let densities = [&self.latest, &self.density]
            .into_iter()
            .flat_map(Hall::galleries)
            .map(|gallery| gallery.style(lines));
        let bonuses = self
            .bonus
            .iter()
            .flat_map(Hall::galleries)
            .map(|gallery| gallery.style(cells));
        densities
            .chain([self.difference.style(lines)])
            .chain(bonuses)
            .collect()
    }

    /// Where the words of the difference's scale stand.
    pub(super) fn difference_words(&self, labels: &[Label]) -> Result<Chunk, Fault> {
        self.difference_scale.style(labels)
    }
}

impl Hall {
    fn new(agents: usize, root: &str, name: &str, kind: Kind, words: usize) -> Self {
        let gallery = |who: &str| Gallery::new(format!("{root}/{who}/{name}").into(), kind);
        Self {
            agents: (0..agents)
                .map(|agent| gallery(&format!("agent_{agent}")))
                .collect(),
            team: gallery("team"),
            agents_scale: Notes::new(&format!("{root}/scale/{name}/ends"), words),
            team_scale: Notes::new(&format!("{root}/team/scale/{name}/ends"), words),
        }
    }

    /// Where the words of the agents' and of the team's scale stand.
    pub(super) fn words(&self, agents: &[Label], team: &[Label]) -> Result<[Chunk; 2], Fault> {
        Ok([
            self.agents_scale.style(agents)?,
            self.team_scale.style(team)?,
        ])
    }

    fn galleries(&self) -> impl Iterator<Item = &Gallery> {
        self.agents.iter().chain([&self.team])
    }

    /// Pixels count lines. Adds to both scales how many are on the brightest pixel, and the note.
    fn hang_densities(&mut self, agents: &[&[u32]], note: Option<&str>, at: Moment) {
        let most = agents
            .iter()
            .flat_map(|pixels| pixels.iter())
            .copied()
            .max()
            .unwrap_or(0);
        for (gallery, pixels) in self.agents.iter_mut().zip(agents) {
            gallery.hang(shade(pixels, most), at);
        }
        let team = sum(agents);
        let most_of_team = team.iter().copied().max().unwrap_or(0);
        self.team.hang(shade(&team, most_of_team), at);
        self.note(
            [most, most_of_team].map(|most| grouped(u64::from(most))),
            note,
            at,
        );
    }

    /// Adds to both scales the largest mean bonus of a cell, and the note.
    fn hang_bonuses(&mut self, agents: &[Novelty], pairs: &Pairs, note: &str, at: Moment) {
        let mut team = Novelty::new(pairs);
        for novelty in agents {
            team.add_all(novelty);
        }
        let largest = agents.iter().map(Novelty::largest).fold(0.0, f64::max);
        for (gallery, novelty) in self.agents.iter_mut().zip(agents) {
            gallery.hang(panels(novelty, largest, pairs), at);
        }
        self.team.hang(panels(&team, team.largest(), pairs), at);
        self.note(
            [largest, team.largest()].map(|largest| number(largest as f32)),
            Some(note),
            at,
        );
    }

    fn note(&mut self, [of_agents, of_team]: [String; 2], note: Option<&str>, at: Moment) {
        let words = |end: String| [end].into_iter().chain(note.map(ToOwned::to_owned));
        self.agents_scale.add(words(of_agents), at);
        self.team_scale.add(words(of_team), at);
    }
}

fn sum(pictures: &[&[u32]]) -> Vec<u32> {
    let mut sum = vec![0_u32; pictures.first().map_or(0, |pixels| pixels.len())];
    for pixels in pictures {
        sum.iter_mut()
            .zip(*pixels)
            .for_each(|(sum, lines)| *sum = sum.saturating_add(*lines));
    }
    sum
}

/// Mean bonuses from 0, dark, to `largest`, bright, panel beside panel.
fn panels(novelty: &Novelty, largest: f64, pairs: &Pairs) -> Vec<u8> {
    let (width, scale) = (pairs.width(), if largest > 0.0 { largest } else { 1.0 });
    let mut picture = EMPTY.repeat(width * CELLS);
    for (cell, mean) in novelty.means().enumerate() {
        let (panel, row, column) = (cell / (CELLS * CELLS), cell / CELLS % CELLS, cell % CELLS);
        let pixel = 3 * (row * width + pairs.x(panel) + column);
        let color = mean.map_or(EMPTY, |mean| sequential((mean / scale) as f32));
        picture[pixel..pixel + 3].copy_from_slice(&color);
    }
    picture
}

/// Thousands apart: 1,234,567.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let groups: Vec<&str> = digits
        .as_bytes()
        .rchunks(3)
        .rev()
        .filter_map(|group| std::str::from_utf8(group).ok())
        .collect();
    groups.join(",")
}

impl Gallery {
    fn new(entity: EntityPath, kind: Kind) -> Self {
        Self {
            entity,
            kind,
            moments: Moments::default(),
            pictures: Vec::new(),
        }
    }

    fn hang(&mut self, picture: Vec<u8>, at: Moment) {
        self.moments.push(at);
        self.pictures.push(picture.into());
    }

    fn take(&mut self, all: bool) -> Option<Result<Chunk, Fault>> {
        let least = if all { 1 } else { PICTURES_PER_CHUNK };
        if self.pictures.len() < least {
            return None;
        }
        let (moments, pictures) = (
            std::mem::take(&mut self.moments),
            std::mem::take(&mut self.pictures),
        );
        let columns = match self.kind {
            Kind::Density => DepthImage::update_fields()
                .with_many_buffer(pictures)
                .columns_of_unit_batches()
                .map(Vec::from_iter),
            Kind::Colored => Image::update_fields()
                .with_many_buffer(pictures)
                .columns_of_unit_batches()
                .map(Vec::from_iter),
        };
        let columns = columns.map_err(|error| error.to_string());
        Some(columns.and_then(|columns| moments.into_chunk(&self.entity, columns)))
    }

    fn style(&self, size: [u32; 2]) -> Result<Chunk, Fault> {
        if self.kind == Kind::Colored {
            let format = ImageFormat::from_color_model(size, ColorModel::RGB, ChannelDatatype::U8);
            let style = Image::update_fields()
                .with_format(format)
                .with_magnification_filter(MagnificationFilter::Nearest);
            return timeless(self.entity.clone(), &style);
        }
        let style = DepthImage::update_fields()
            .with_format(ImageFormat::depth(size, ChannelDatatype::U8))
            .with_colormap(Colormap::Inferno)
            .with_depth_range([0.0, 255.0])
            .with_magnification_filter(MagnificationFilter::Linear);
        timeless(self.entity.clone(), &style)
    }
}

impl Notes {
    fn new(entity: &str, per_row: usize) -> Self {
        Self {
            entity: entity.into(),
            moments: Moments::default(),
            words: Vec::new(),
            per_row,
        }
    }

    fn add(&mut self, words: impl IntoIterator<Item = String>, at: Moment) {
        self.moments.push(at);
        self.words.extend(words);
    }

    fn take(&mut self, all: bool) -> Option<Result<Chunk, Fault>> {
        let least = if all { 1 } else { PICTURES_PER_CHUNK };
        if self.moments.len() < least {
            return None;
        }
        let (moments, words) = (
            std::mem::take(&mut self.moments),
            std::mem::take(&mut self.words),
        );
        let rows = vec![self.per_row; moments.len()];
        let column = grouped_column(
            Points2D::descriptor_labels(),
            Arc::new(StringArray::from(words)),
            rows,
        );
        Some(moments.into_chunk(&self.entity, [column]))
    }

    /// Where the words stand, and their colours; not what they say.
    fn style(&self, labels: &[Label]) -> Result<Chunk, Fault> {
        let places = Points2D::new(labels.iter().map(|(_, place, _)| *place));
        timeless(
            self.entity.clone(),
            &lettered(places.with_colors(labels.iter().map(|(_, _, color)| rgb(*color)))),
        )
    }
}
