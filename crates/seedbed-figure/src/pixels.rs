//! PNG files of figures, and images within figures.

use std::sync::{Arc, LazyLock};

use resvg::tiny_skia::{Color as Paint, Pixmap, Transform};
use resvg::usvg::fontdb::{Database, Source};
use resvg::usvg::{Options, Tree};

use super::color::Color;
use super::font::{MEDIUM, REGULAR};

/// The figure could not be drawn as PNG or PDF.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The page is empty, or has more pixels than memory can hold.
    #[error("cannot draw an image of {0} × {1} pixels: sides must be between 1 and 20000 pixels")]
    Size(u32, u32),
    /// The renderer failed.
    #[error("cannot draw the figure: {0}")]
    Drawing(String),
}

/// CSS pixels per inch.
pub(super) const PIXELS_PER_INCH: f64 = 96.0;

/// Maximum width and height in pixels. A larger image would take gigabytes of memory.
pub(super) const MAX_SIDE: f64 = 20_000.0;

static FONTS: LazyLock<Arc<Database>> = LazyLock::new(|| {
    let mut fonts = Database::new();
    for data in [REGULAR, MEDIUM] {
        fonts.load_font_source(Source::Binary(Arc::new(data)));
    }
    fonts.set_sans_serif_family("Roboto");
    Arc::new(fonts)
});

/// An image without transparency.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Red, green and blue of each pixel, row by row from the top: `[height × width × 3]`
    pub rgb: Vec<u8>,
}

impl Pixels {
    /// The picture with about `height` rows, if it has more than one and a half times as many: each pixel is the mean of a
    /// square.
    #[must_use]
    pub fn reduced_to(&self, height: u32) -> Self {
        let side = (f64::from(self.height) / f64::from(height))
            .round()
            .max(1.0) as u32;
        let (columns, rows) = (self.width / side, self.height / side);
        let mean = |row: u32, column: u32, color: u32| {
            let pixels =
                (0..side * side).map(|i| (row * side + i / side, column * side + i % side));
            let values = pixels
                .map(|(y, x)| u32::from(self.rgb[(3 * (y * self.width + x) + color) as usize]));
            (values.sum::<u32>() / (side * side)) as u8
        };
        let places = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        Self {
            width: columns,
            height: rows,
            rgb: places
                .flat_map(|(row, column)| [0, 1, 2].map(|color| mean(row, column, color)))
                .collect(),
        }
    }

    pub(super) fn into_png(self, pixels_per_inch: f64) -> Result<Vec<u8>, RenderError> {
        encode_png(&self.rgb, [self.width, self.height], pixels_per_inch)
            .map_err(|error| RenderError::Drawing(error.to_string()))
    }
}

/// The elements of an SVG file, with the fonts of this crate.
pub(super) fn tree(svg: &str) -> Result<Tree, RenderError> {
    let options = Options {
        fontdb: Arc::clone(&FONTS),
        font_family: "Roboto".to_owned(),
        ..Options::default()
    };
    Tree::from_str(svg, &options).map_err(|error| RenderError::Drawing(error.to_string()))
}

/// Renders an SVG file with `scale` pixels per CSS pixel.
pub(super) fn draw(svg: &str, scale: f64) -> Result<Pixels, RenderError> {
    let tree = tree(svg)?;
    let [width, height] =
        [tree.size().width(), tree.size().height()].map(|side| (f64::from(side) * scale).round());
    let size_error = || RenderError::Size(width as u32, height as u32);
    let fits_into_memory = width.max(height) <= MAX_SIDE;
    let mut pixels = fits_into_memory
        .then(|| Pixmap::new(width as u32, height as u32))
        .flatten()
        .ok_or_else(size_error)?;
    pixels.fill(Paint::WHITE);
    resvg::render(
        &tree,
        Transform::from_scale(scale as f32, scale as f32),
        &mut pixels.as_mut(),
    );
    let rgb: Vec<u8> = pixels
        .pixels()
        .iter()
        .flat_map(|pixel| [pixel.red(), pixel.green(), pixel.blue()])
        .collect();
    Ok(Pixels {
        width: width as u32,
        height: height as u32,
        rgb,
    })
}

/// The bytes of a PNG file without transparency, with the best compression.
/// `rgb: [height × width × 3]`
fn encode_png(
    rgb: &[u8],
    [width, height]: [u32; 2],
    pixels_per_inch: f64,
) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::High);
    encoder.set_pixel_dims(Some(pixel_dimensions(pixels_per_inch)));
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb)?;
    writer.finish()?;
    Ok(bytes)
}

/// Resolution stored in a PNG file, so that programs print the figure at its original size.
fn pixel_dimensions(pixels_per_inch: f64) -> png::PixelDimensions {
    let pixels_per_meter = (pixels_per_inch / 0.0254).round() as u32;
    png::PixelDimensions {
        xppu: pixels_per_meter,
        yppu: pixels_per_meter,
        unit: png::Unit::Meter,
    }
}

/// The bytes of a PNG file of colors, row by row from the top. `colors: [height × width]`
pub(super) fn png_of_colors(colors: &[Color], width: usize) -> Vec<u8> {
    let height = colors.len() / width.max(1);
    encode_png(
        &colors[..width * height].concat(),
        [width as u32, height as u32],
        PIXELS_PER_INCH,
    )
    .expect("pixels in memory can be encoded as PNG")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two squares of four pixels, and a third column that does not fill a square.
    #[test]
    fn reduced_pictures_have_means_of_squares() {
        let gray = |values: &[u8]| values.iter().flat_map(|&value| [value, 0, 9]).collect();
        let picture = Pixels {
            width: 5,
            height: 2,
            rgb: gray(&[0, 4, 100, 100, 7, 8, 8, 100, 104, 7]),
        };
        let reduced = Pixels {
            width: 2,
            height: 1,
            rgb: gray(&[5, 101]),
        };
        assert_eq!(picture.reduced_to(1), reduced);
        assert_eq!(picture.reduced_to(2), picture);
    }
}
