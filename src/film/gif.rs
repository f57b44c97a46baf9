//! Animated GIF. Of each picture only the pixels that differ from the one before are stored.

use std::collections::BTreeMap;
use std::io::{self, Write};

use ::gif::{DisposalMethod, Encoder, EncodingError, Frame, Repeat};
use color_quant::NeuQuant;
use seedbed_figure::{Color, Pixels};

/// Number of colors of a part of the film; one more index is transparent.
const MAX_COLORS: usize = 255;

/// Number of frequent colors that are kept exactly if there are more than [`MAX_COLORS`].
const EXACT_COLORS: usize = 31;

/// Quality of the other colors, from 1 (best) to 30 (fastest).
const QUANTIZATION_SPEED: i32 = 10;

/// Time for which the last picture stays, in hundredths of a second.
const LAST_DELAY: u16 = 200;

impl Region {
    /// The whole picture if there is no latest one.
    pub(super) fn of_change(latest: Option<&Pixels>, picture: &Pixels) -> Self {
        changed_region(picture, &|pixel| is_changed(latest, picture, pixel))
    }

    /// Left, top, width and height.
    pub(super) fn sides(self) -> [u32; 4] {
        [self.left, self.top, self.width, self.height].map(|side| side as u32)
    }
}

/// Writes pictures of equal size, one after the other. The film starts again at its end.
pub struct GifWriter<W: Write> {
    encoder: Encoder<W>,
    /// Time for which a picture stays, in hundredths of a second.
    delay: u16,
    latest: Option<Pixels>,
    /// The picture that is written when it is known whether it is the last one.
    waiting: Option<Frame<'static>>,
}

/// The smallest rectangle with all pixels that changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Region {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl<W: Write> GifWriter<W> {
    /// Starts a film of pictures with `width` × `height` pixels.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn new(file: W, width: u16, height: u16, frames_per_second: u32) -> io::Result<Self> {
        let mut encoder = Encoder::new(file, width, height, &[]).map_err(into_io)?;
        encoder.set_repeat(Repeat::Infinite).map_err(into_io)?;
        Ok(Self {
            encoder,
            delay: (100.0 / f64::from(frames_per_second)).round() as u16,
            latest: None,
            waiting: None,
        })
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn add(&mut self, picture: Pixels) -> io::Result<()> {
        let mut frame = difference(self.latest.as_ref(), &picture);
        frame.delay = self.delay;
        frame.dispose = DisposalMethod::Keep;
        self.latest = Some(picture);
        match self.waiting.replace(frame) {
            Some(frame) => self.encoder.write_frame(&frame).map_err(into_io),
            None => Ok(()),
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> io::Result<()> {
        if let Some(mut frame) = self.waiting.take() {
            frame.delay = LAST_DELAY;
            self.encoder.write_frame(&frame).map_err(into_io)?;
        }
        self.encoder.into_inner().map_err(into_io)?.flush()
    }
}

fn into_io(error: EncodingError) -> io::Error {
    match error {
        EncodingError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// The part of a picture that differs from the latest one; unchanged pixels are transparent.
fn difference(latest: Option<&Pixels>, picture: &Pixels) -> Frame<'static> {
    let region = Region::of_change(latest, picture);
    let mut colors = Vec::with_capacity(region.width * region.height);
    for row in region.top..region.top + region.height {
        for column in region.left..region.left + region.width {
            let pixel = row * picture.width as usize + column;
            colors.push(is_changed(latest, picture, pixel).then(|| color(picture, pixel)));
        }
    }
    let palette = palette(&colors);
    let [width, height] = [region.width, region.height].map(|side| side as u16);
    let transparent = palette.len() as u8;
    let pixels = nearest_indices(&colors, &palette, transparent);
    // The last color of the palette stands for transparent pixels and is never shown.
    let palette_bytes = [palette.concat(), vec![0; 3]].concat();
    let mut frame =
        Frame::from_palette_pixels(width, height, pixels, palette_bytes, Some(transparent));
    (frame.left, frame.top) = (region.left as u16, region.top as u16);
    frame
}

fn is_changed(latest: Option<&Pixels>, picture: &Pixels, pixel: usize) -> bool {
    let bytes = 3 * pixel..3 * pixel + 3;
    latest.is_none_or(|latest| latest.rgb[bytes.clone()] != picture.rgb[bytes])
}

fn color(picture: &Pixels, pixel: usize) -> Color {
    [0, 1, 2].map(|channel| picture.rgb[3 * pixel + channel])
}

/// All colors if there are few. Otherwise the most frequent ones, because figures consist of few colors,
/// which must not be changed, and colors that represent their mixtures at edges. Equally frequent
/// colors are in the order of their channels.
fn palette(colors: &[Option<Color>]) -> Vec<Color> {
    let mut counts: BTreeMap<Color, usize> = BTreeMap::new();
    for &color in colors.iter().flatten() {
        *counts.entry(color).or_default() += 1;
    }
    let mut by_count: Vec<(Color, usize)> = counts.into_iter().collect();
    by_count.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    let mut palette: Vec<Color> = by_count.into_iter().map(|(color, _)| color).collect();
    if palette.len() > MAX_COLORS {
        palette.truncate(EXACT_COLORS);
        palette.extend(representatives(colors, MAX_COLORS - EXACT_COLORS));
    }
    palette
}

/// Colors that represent all colors (Dekker, "Kohonen neural networks for optimal colour quantization",
/// 1994).
fn representatives(colors: &[Option<Color>], count: usize) -> Vec<Color> {
    let present = colors.iter().flatten();
    let rgba: Vec<u8> = present
        .flat_map(|&[red, green, blue]| [red, green, blue, 255])
        .collect();
    let network = NeuQuant::new(QUANTIZATION_SPEED, count, &rgba);
    let rgb = network.color_map_rgb();
    rgb.chunks_exact(3)
        .map(|color| [color[0], color[1], color[2]])
        .collect()
}

/// Index of the most similar color of the palette for each pixel.
fn nearest_indices(colors: &[Option<Color>], palette: &[Color], transparent: u8) -> Vec<u8> {
    let mut known: BTreeMap<Color, u8> = BTreeMap::new();
    let mut index_of = |color: Color| {
        *known.entry(color).or_insert_with(|| {
            let nearest = (0..palette.len()).min_by_key(|&index| distance(palette[index], color));
            nearest.expect("the palette has the most frequent color") as u8
        })
    };
    let indices = colors.iter();
    indices
        .map(|color| color.map_or(transparent, &mut index_of))
        .collect()
}

fn distance(one: Color, other: Color) -> u32 {
    let difference = |channel: usize| u32::from(one[channel].abs_diff(other[channel]));
    (0..3).map(|channel| difference(channel).pow(2)).sum()
}

/// One pixel if nothing changed.
fn changed_region(picture: &Pixels, is_changed: &dyn Fn(usize) -> bool) -> Region {
    let width = picture.width as usize;
    let pixels = 0..width * picture.height as usize;
    let (mut left, mut right, mut top, mut bottom) = (usize::MAX, 0, usize::MAX, 0);
    for pixel in pixels.filter(|&pixel| is_changed(pixel)) {
        let (row, column) = (pixel / width, pixel % width);
        (left, right) = (left.min(column), right.max(column));
        (top, bottom) = (top.min(row), bottom.max(row));
    }
    if left > right {
        (left, right, top, bottom) = (0, 0, 0, 0);
    }
    Region {
        left,
        top,
        width: right - left + 1,
        height: bottom - top + 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(colored: &[usize]) -> Pixels {
        let mut rgb = vec![255; 3 * 12];
        for &pixel in colored {
            rgb[3 * pixel] = 0;
        }
        Pixels {
            width: 4,
            height: 3,
            rgb,
        }
    }

    /// Pixels 5 and 10 of a picture of 4 × 3 are in rows 1 and 2, columns 1 and 2.
    #[test]
    fn only_the_changed_region_is_stored() {
        let frame = difference(Some(&picture(&[])), &picture(&[5, 10]));
        assert_eq!(
            (frame.left, frame.top, frame.width, frame.height),
            (1, 1, 2, 2)
        );
        let same = difference(Some(&picture(&[5])), &picture(&[5]));
        assert_eq!((same.width, same.height), (1, 1));
    }

    /// With more colors than a palette has, frequent ones stay exact and rare ones become similar ones.
    #[test]
    fn rare_colors_become_similar_ones() {
        let frequent = [Some([255, 255, 255]); 500]
            .into_iter()
            .chain([Some([230, 160, 0]); 300]);
        let mixtures =
            (0..2000).map(|number| Some([255, 255 - number as u8 / 2, (number % 200) as u8]));
        let colors: Vec<Option<Color>> = frequent.chain(mixtures).chain([None]).collect();
        let palette = palette(&colors);
        assert!(palette.len() <= MAX_COLORS);
        let indices = nearest_indices(&colors, &palette, 255);
        for (color, index) in colors.iter().zip(&indices) {
            match color {
                None => assert_eq!(*index, 255),
                Some(color) => {
                    let found = palette[usize::from(*index)];
                    let allowed = if *color == [255; 3] || *color == [230, 160, 0] {
                        0
                    } else {
                        3600
                    };
                    assert!(
                        distance(found, *color) <= allowed,
                        "{found:?} for {color:?}"
                    );
                }
            }
        }
    }

    /// A decoder that draws each part over the earlier ones shows the pictures again.
    #[test]
    fn a_decoder_shows_the_pictures() {
        let pictures = [picture(&[]), picture(&[0, 1]), picture(&[1, 11])];
        let mut bytes = Vec::new();
        let mut writer = GifWriter::new(&mut bytes, 4, 3, 20).unwrap();
        for picture in &pictures {
            writer.add(picture.clone()).unwrap();
        }
        writer.finish().unwrap();
        let mut options = ::gif::DecodeOptions::new();
        options.set_color_output(::gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(bytes.as_slice()).unwrap();
        let mut shown = vec![0; 3 * 12];
        let mut delays = Vec::new();
        for picture in &pictures {
            let frame = decoder.read_next_frame().unwrap().unwrap();
            for (index, rgba) in frame.buffer.chunks_exact(4).enumerate() {
                let [row, column] = [index / frame.width as usize, index % frame.width as usize];
                let pixel = 4 * (row + frame.top as usize) + column + frame.left as usize;
                if rgba[3] > 0 {
                    shown[3 * pixel..3 * pixel + 3].copy_from_slice(&rgba[..3]);
                }
            }
            assert_eq!(shown, picture.rgb);
            delays.push(frame.delay);
        }
        assert_eq!(delays, [5, 5, LAST_DELAY]);
        assert!(decoder.read_next_frame().unwrap().is_none());
    }
}
