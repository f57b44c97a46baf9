//! The positions of images and labels in a view, in points of the screen. Images are stretched to the
//! space that labels, which have a fixed size, leave them.

use crate::record::visitation::BINS;

/// Height of a line of text, in points of the screen.
pub(super) const LINE_HEIGHT: f32 = 19.0;

/// Average width of a character, in points.
pub(super) const CHAR_WIDTH: f32 = 6.7;

/// Width of a color bar, in points.
const COLOR_BAR_WIDTH: f32 = 14.0;

/// Minimum height of a legible color bar, in points.
const MIN_COLOR_BAR_HEIGHT: f32 = 120.0;

/// Images may be smaller by this share than the largest size that fits, if this reduces the number
/// of empty tiles.
const ZOOM_TOLERANCE: f32 = 0.125;

/// Size of a view on the screen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Viewport {
    /// Width and height, in points.
    pub(super) size: [f32; 2],
    /// Width at the right for a color scale, in points.
    pub(super) scale_width: f32,
    /// Width between images and color scale, in points, for labels that extend beyond their image.
    pub(super) overhang: f32,
}

/// The space for labels around all images and around each image.
#[derive(Clone, Copy, Debug)]
pub(super) struct LabelSpace {
    /// Number of lines of text above the first row of images.
    pub(super) lines_above_all: f32,
    /// Number of lines of text below the last row of images.
    pub(super) lines_below_all: f32,
    /// Number of lines of text above each image.
    pub(super) lines_above: f32,
    /// Number of lines of text below each image.
    pub(super) lines_below: f32,
    /// Width on either side of an image, in points.
    pub(super) side_margin: f32,
    /// Number of lines of text below the color scale.
    pub(super) scale_lines: f32,
}

/// The size of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct ImageSize {
    /// Width and height, in pixels.
    pub(super) pixels: [f32; 2],
    /// Maximum ratio between the horizontal and the vertical zoom, and its inverse.
    pub(super) max_stretch: f32,
}

/// Images of equal size in columns and rows. All positions are in points of the screen, for which the
/// view is laid out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tiles {
    /// Number of images.
    pub(super) count: u32,
    /// Width and height of an image.
    pub(super) size: [f32; 2],
    /// Points per pixel of an image, horizontally and vertically.
    pub(super) zoom: [f32; 2],
    columns: u32,
    /// Distance from one image to the next.
    step: [f32; 2],
    /// Space left of and above the first image.
    margin: [f32; 2],
    /// Height of the labels above each image.
    height_above: f32,
    /// Height of the labels below the last row.
    bottom_margin: f32,
    /// Width at the right for the color scale and the overhang.
    right_width: f32,
    /// Distance from the middle of the scale to the right edge.
    half_scale_width: f32,
}

/// A vertical color bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ColorBar {
    /// Left and right edge, in points.
    pub(super) x: [f32; 2],
    /// Upper and lower edge, in points.
    pub(super) y: [f32; 2],
}

impl Tiles {
    /// Arranges `count` images in tiles that are as large as `viewport` allows, or slightly smaller if
    /// this reduces the number of empty tiles.
    pub(super) fn new(
        count: u32,
        image: ImageSize,
        viewport: Viewport,
        labels: LabelSpace,
    ) -> Self {
        let right_width = viewport.scale_width + viewport.overhang;
        let rows = |columns: u32| count.div_ceil(columns);
        // The scale is beside the top row. If this is the only row, there must be space for the
        // labels below the scale.
        let lines_below_all = |columns: u32| {
            if rows(columns) == 1 {
                labels.lines_below_all.max(labels.scale_lines)
            } else {
                labels.lines_below_all
            }
        };
        let zoom = |columns: u32| {
            let width = (viewport.size[0] - right_width) / columns as f32;
            let lines = labels.lines_above_all + lines_below_all(columns);
            let height = (viewport.size[1] - lines * LINE_HEIGHT) / rows(columns) as f32;
            let lines_of_tile = labels.lines_above + labels.lines_below;
            let largest = [
                (width - 2.0 * labels.side_margin) / image.pixels[0],
                (height - lines_of_tile * LINE_HEIGHT) / image.pixels[1],
            ];
            let limit = image.max_stretch * largest[0].min(largest[1]);
            largest.map(|zoom| zoom.min(limit).max(0.1))
        };
        let columns = best_column_count(count, |columns| {
            (zoom(columns)[0] * zoom(columns)[1]).sqrt()
        });
        let zoom = zoom(columns);
        let size = [zoom[0] * image.pixels[0], zoom[1] * image.pixels[1]];
        let lines_of_tile = labels.lines_above + labels.lines_below;
        Self {
            count,
            size,
            zoom,
            columns,
            step: [
                size[0] + 2.0 * labels.side_margin,
                size[1] + lines_of_tile * LINE_HEIGHT,
            ],
            margin: [
                labels.side_margin,
                (labels.lines_above_all + labels.lines_above) * LINE_HEIGHT,
            ],
            height_above: labels.lines_above * LINE_HEIGHT,
            bottom_margin: lines_below_all(columns) * LINE_HEIGHT,
            right_width,
            half_scale_width: 0.5 * viewport.scale_width,
        }
    }

    /// The upper left corner of each image.
    pub(super) fn corners(&self) -> impl Iterator<Item = [f32; 2]> {
        let corner = |tile: u32| {
            [
                (tile % self.columns) as f32 * self.step[0],
                (tile / self.columns) as f32 * self.step[1],
            ]
        };
        (0..self.count).map(corner)
    }

    /// The upper left corners of the images at the upper ends of the columns.
    pub(super) fn top_corners(&self) -> impl Iterator<Item = [f32; 2]> {
        self.corners().take(self.columns as usize)
    }

    /// The upper left corners of the images at the lower ends of the columns.
    pub(super) fn bottom_corners(&self) -> impl Iterator<Item = [f32; 2]> {
        let first = self.count.saturating_sub(self.columns);
        self.corners().skip(first as usize)
    }

    /// Left and right, and upper and lower edge of all images and labels.
    pub(super) fn bounds(&self) -> [[f32; 2]; 2] {
        let rows = self.count.div_ceil(self.columns) as f32;
        let [left, top] = self.margin.map(|margin| -margin);
        let right = self.columns as f32 * self.step[0] + self.right_width;
        let bottom = rows * self.step[1] - self.height_above + self.bottom_margin;
        [[left, left + right], [top, bottom]]
    }

    /// The color bar, beside the top row.
    pub(super) fn color_bar(&self) -> ColorBar {
        let [_, right] = self.bounds()[0];
        let middle = right - self.half_scale_width;
        let half_width = 0.5 * COLOR_BAR_WIDTH;
        let top = (2.3 * LINE_HEIGHT - self.margin[1]).max(0.0);
        let height = if self.count > self.columns {
            self.size[1].max(MIN_COLOR_BAR_HEIGHT)
        } else {
            self.size[1]
        };
        ColorBar {
            x: [middle - half_width, middle + half_width],
            y: [top, top + height],
        }
    }
}

/// Number of columns with the largest zoom, or with a slightly smaller zoom and fewer empty tiles.
/// `zoom(columns)` is the mean zoom of an arrangement of `count` images in this number of columns.
fn best_column_count(count: u32, zoom: impl Fn(u32) -> f32) -> u32 {
    let largest_zoom = (1..=count.max(1)).map(&zoom).fold(0.0, f32::max);
    let candidates = (1..=count.max(1))
        .filter(|columns| zoom(*columns) >= (1.0 - ZOOM_TOLERANCE) * largest_zoom);
    let empty_tiles = |columns: u32| count.div_ceil(columns) * columns - count;
    let compare_layouts = |one: &u32, other: &u32| {
        empty_tiles(*other)
            .cmp(&empty_tiles(*one))
            .then(zoom(*one).total_cmp(&zoom(*other)))
    };
    candidates.max_by(compare_layouts).unwrap_or(1)
}

impl ColorBar {
    /// Number of color steps, one per bin of the density's axes.
    pub(super) const STEPS: usize = BINS;

    /// Vertical position of each step, from the lowest up, and its position on the scale, 0 to 1.
    pub(super) fn steps(&self) -> impl Iterator<Item = (f32, f32)> {
        let share = |step: usize| (step as f32 + 0.5) / Self::STEPS as f32;
        (0..Self::STEPS).map(move |step| {
            (
                self.y[1] - share(step) * (self.y[1] - self.y[0]),
                step as f32 / (Self::STEPS - 1) as f32,
            )
        })
    }

    /// Half the height of a step in pixels, plus 10 % so that no gap is visible between steps.
    pub(super) fn half_step(&self) -> f32 {
        0.55 * (self.y[1] - self.y[0]) / Self::STEPS as f32
    }

    /// Position of a label: `lines` lines above the upper end of the bar or, if negative, below its
    /// lower end.
    pub(super) fn label_position(&self, lines: f32) -> [f32; 2] {
        let y = if lines > 0.0 {
            self.y[0] - lines * LINE_HEIGHT
        } else {
            self.y[1] - lines * LINE_HEIGHT
        };
        [0.5 * (self.x[0] + self.x[1]), y]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LABELS: LabelSpace = LabelSpace {
        lines_above_all: 2.0,
        lines_below_all: 1.0,
        lines_above: 1.0,
        lines_below: 0.5,
        side_margin: 20.0,
        scale_lines: 3.0,
    };

    fn viewport(size: [f32; 2], scale_width: f32) -> Viewport {
        Viewport {
            size,
            scale_width,
            overhang: 0.0,
        }
    }

    fn image(max_stretch: f32) -> ImageSize {
        ImageSize {
            pixels: [193.0, 64.0],
            max_stretch,
        }
    }

    /// There are sixteen images of 193 × 64 pixels in 960 × 600 points. The scale takes 60 points
    /// of the width. The best arrangement is 4 × 4: each tile has 225 points of width, of which 40 are
    /// margins, and a quarter of 600 − 3 · 19 = 543 points of height, of which 1.5 lines are for labels.
    #[test]
    fn images_fill_the_view() {
        let tiles = Tiles::new(16, image(3.0), viewport([960.0, 600.0], 60.0), LABELS);
        assert_eq!(tiles.columns, 4);
        approx::assert_relative_eq!(tiles.size[0], 185.0, epsilon = 1e-3);
        approx::assert_relative_eq!(tiles.size[1], 543.0 / 4.0 - 28.5, epsilon = 1e-3);
        let [[left, right], [top, bottom]] = tiles.bounds();
        approx::assert_relative_eq!(right - left, 960.0, epsilon = 0.01);
        approx::assert_relative_eq!(bottom - top, 600.0, epsilon = 0.01);
        let corners: Vec<[f32; 2]> = tiles.corners().collect();
        assert_eq!(corners[5], [corners[1][0], corners[4][1]]);
        assert_eq!(corners[0], [0.0, 0.0]);
    }

    /// The zoom of the width would be 7.2, that of the height is (300 − 5 · 19 − 28.5) / 64 = 2.76.
    #[test]
    fn images_are_not_stretched_too_much() {
        let view = viewport([1440.0, 300.0], 0.0);
        let free = Tiles::new(1, image(9.0), view, LABELS);
        approx::assert_relative_eq!(free.zoom[0], 1400.0 / 193.0, epsilon = 1e-5);
        approx::assert_relative_eq!(free.zoom[1], 176.5 / 64.0, epsilon = 1e-5);
        let limited = Tiles::new(1, image(1.25), view, LABELS);
        approx::assert_relative_eq!(limited.zoom[1], 176.5 / 64.0, epsilon = 1e-5);
        approx::assert_relative_eq!(limited.zoom[0], 1.25 * 176.5 / 64.0, epsilon = 1e-5);
    }

    /// With these zooms, five columns are best for sixteen images, but the last row would have four empty
    /// tiles. The zoom of four columns is 10 % less, that of three columns 20 %.
    #[test]
    fn a_slightly_smaller_size_is_chosen_to_avoid_empty_tiles() {
        let zoom = |columns: u32| match columns {
            3 => 0.8,
            4 => 0.9,
            5 => 1.0,
            _ => 0.5,
        };
        assert_eq!(best_column_count(16, zoom), 4);
        assert_eq!(best_column_count(15, zoom), 5);
    }

    /// Five images in two columns: names are above the first two, ranges below the last two.
    #[test]
    fn each_column_has_a_top_and_a_bottom() {
        let tiles = Tiles::new(5, image(1.0), viewport([500.0, 480.0], 0.0), LABELS);
        assert_eq!(tiles.columns, 2);
        let corners: Vec<[f32; 2]> = tiles.corners().collect();
        assert_eq!(tiles.top_corners().collect::<Vec<_>>(), corners[..2]);
        assert_eq!(tiles.bottom_corners().collect::<Vec<_>>(), corners[3..]);
    }

    /// There is one row of images. Below the color bar, which is as high as the image, the labels
    /// of the scale need three lines of 19 points.
    #[test]
    fn labels_of_the_scale_are_within_the_view() {
        let tiles = Tiles::new(1, image(3.0), viewport([480.0, 244.0], 100.0), LABELS);
        let (bar, [_, [_, bottom]]) = (tiles.color_bar(), tiles.bounds());
        assert!(
            bar.label_position(-3.0)[1] <= bottom + 1e-3,
            "{bottom} points, {:?}",
            bar.label_position(-3.0)
        );
        assert!((bar.y[1] + 3.5 * LINE_HEIGHT - bottom).abs() < 1e-3);
    }

    /// The overhang is at the right of the images, and the scale is in the middle of the remaining
    /// width.
    #[test]
    fn wide_labels_do_not_overlap_the_scale() {
        let view = Viewport {
            overhang: 30.0,
            ..viewport([480.0, 880.0], 100.0)
        };
        let tiles = Tiles::new(2, image(3.0), view, LABELS);
        let [_, right] = tiles.bounds()[0];
        let bar = tiles.color_bar();
        let middle = f32::midpoint(bar.x[0], bar.x[1]);
        approx::assert_relative_eq!(right - middle, 50.0, epsilon = 1e-3);
        approx::assert_relative_eq!(right - tiles.size[0], 20.0 + 30.0 + 100.0, epsilon = 1e-3);
    }

    #[test]
    fn the_scale_is_at_the_right_of_the_images() {
        let tiles = Tiles::new(3, image(3.0), viewport([480.0, 480.0], 80.0), LABELS);
        let (bar, [[_, right], _]) = (tiles.color_bar(), tiles.bounds());
        let last = tiles.corners().map(|corner| corner[0]).fold(0.0, f32::max) + tiles.size[0];
        assert!(last < bar.x[0] && bar.x[1] < right);
        let bar = ColorBar {
            y: [0.0, 40.0],
            ..bar
        };
        let steps: Vec<(f32, f32)> = bar.steps().collect();
        assert_eq!((steps[0], steps[63]), ((40.0 - 0.3125, 0.0), (0.3125, 1.0)));
    }
}
