//! PDF files of figures, with embedded fonts and text that can be selected.

use krilla::Document;
use krilla::geom::Size;
use krilla::metadata::Metadata;
use krilla::page::PageSettings;
use krilla_svg::{SurfaceExt, SvgSettings};

use super::pixels::{RenderError, tree};

/// Typographic points per CSS pixel: 72 and 96 per inch.
const POINTS_PER_PIXEL: f64 = 0.75;

/// One page of the size of the SVG file, times `scale`. There is no date in it: the same figure gives the same bytes.
pub(super) fn pdf(svg: &str, title: &str, scale: f64) -> Result<Vec<u8>, RenderError> {
    let tree = tree(svg)?;
    let [width, height] = [tree.size().width(), tree.size().height()]
        .map(|side| (f64::from(side) * scale * POINTS_PER_PIXEL) as f32);
    let settings = PageSettings::from_wh(width, height);
    let (Some(settings), Some(size)) = (settings, Size::from_wh(width, height)) else {
        return Err(RenderError::Size(width as u32, height as u32));
    };
    let mut document = Document::new();
    let metadata = Metadata::new().title(title.to_owned());
    document.set_metadata(metadata.creator("seedbed".to_owned()));
    let mut page = document.start_page_with(settings);
    let mut surface = page.surface();
    surface.draw_svg(&tree, size, SvgSettings::default());
    surface.finish();
    page.finish();
    document
        .finish()
        .map_err(|error| RenderError::Drawing(format!("{error:?}")))
}
