//! The positions of images and labels in a view. Labels have a fixed size on the screen, whereas
//! images are scaled to the view. So the space that labels need, in pixels of an image, depends on
//! the number of images in a view.

use crate::record::visitation::BINS;

/// Height of a line of text, in points of the screen.
const LINE_HEIGHT: f32 = 19.0;

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

/// The space for labels around each image.
#[derive(Clone, Copy, Debug)]
pub(super) struct LabelSpace {
    /// Number of lines of text above an image.
    pub(super) lines_above: f32,
    /// Number of lines of text below an image.
    pub(super) lines_below: f32,
    /// Width on either side of an image, in points.
    pub(super) side_margin: f32,
    /// Number of lines of text below the color scale.
    pub(super) scale_lines: f32,
}

/// Images of equal size in columns and rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tiles {
    /// Number of images.
    pub(super) count: u32,
    /// Width and height of an image, in pixels.
    pub(super) size: [f32; 2],
    /// Points per pixel.
    pub(super) zoom: f32,
    columns: u32,
    /// Distance from one image to the next, in pixels.
    step: [f32; 2],
    /// Space left of and above the first image, in pixels.
    margin: [f32; 2],
    /// Width at the right for the color scale and the overhang, in pixels.
    right_width: f32,
    /// Distance from the middle of the scale to the right edge, in pixels.
    half_scale_width: f32,
}

/// A vertical color bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ColorBar {
    /// Left and right edge, in pixels.
    pub(super) x: [f32; 2],
    /// Upper and lower edge, in pixels.
    pub(super) y: [f32; 2],
    /// Height of a line of text, in pixels.
    pub(super) line_height: f32,
}

impl Tiles {
    /// Arranges `count` images of `size` pixels in tiles that are as large as `viewport` allows, or
    /// slightly smaller if this reduces the number of empty tiles.
    pub(super) fn new(count: u32, size: [f32; 2], viewport: Viewport, labels: LabelSpace) -> Self {
        let right_width = viewport.scale_width + viewport.overhang;
        let rows = |columns: u32| count.div_ceil(columns);
        // The scale is beside the top row. If this is the only row, there must be space for the
        // labels below the scale.
        let lines_per_tile = |columns: u32| {
            labels.lines_above
                + if rows(columns) == 1 {
                    labels.lines_below.max(labels.scale_lines)
                } else {
                    labels.lines_below
                }
        };
        let zoom = |columns: u32| {
            let horizontal_zoom = ((viewport.size[0] - right_width) / columns as f32
                - 2.0 * labels.side_margin)
                / size[0];
            let vertical_zoom = (viewport.size[1] / rows(columns) as f32
                - lines_per_tile(columns) * LINE_HEIGHT)
                / size[1];
            horizontal_zoom.min(vertical_zoom).max(0.1)
        };
        let columns = best_column_count(count, zoom);
        let zoom = zoom(columns);
        let step = [
            size[0] + 2.0 * labels.side_margin / zoom,
            size[1] + lines_per_tile(columns) * LINE_HEIGHT / zoom,
        ];
        let margin = [
            labels.side_margin / zoom,
            labels.lines_above * LINE_HEIGHT / zoom,
        ];
        Self {
            count,
            size,
            zoom,
            columns,
            step,
            margin,
            right_width: right_width / zoom,
            half_scale_width: 0.5 * viewport.scale_width / zoom,
        }
    }

    /// The upper left corner of each image, in pixels.
    pub(super) fn corners(&self) -> impl Iterator<Item = [f32; 2]> {
        let corner = |tile: u32| {
            [
                (tile % self.columns) as f32 * self.step[0],
                (tile / self.columns) as f32 * self.step[1],
            ]
        };
        (0..self.count).map(corner)
    }

    /// Height of a line of text, in pixels.
    pub(super) fn line_height(&self) -> f32 {
        LINE_HEIGHT / self.zoom
    }

    /// Left and right, and upper and lower edge of all images and labels, in pixels.
    pub(super) fn bounds(&self) -> [[f32; 2]; 2] {
        let rows = self.count.div_ceil(self.columns) as f32;
        let [left, top] = self.margin.map(|margin| -margin);
        [
            [
                left,
                left + self.columns as f32 * self.step[0] + self.right_width,
            ],
            [top, top + rows * self.step[1]],
        ]
    }

    /// The color bar beside the top row, with space for two lines above.
    pub(super) fn color_bar(&self) -> ColorBar {
        let middle = self.bounds()[0][1] - self.half_scale_width;
        let half_width = 0.5 * COLOR_BAR_WIDTH / self.zoom;
        let top = (2.3 * self.line_height() - self.margin[1]).max(0.0);
        let height = if self.count > self.columns {
            self.size[1].max(MIN_COLOR_BAR_HEIGHT / self.zoom)
        } else {
            self.size[1]
        };
        ColorBar {
            x: [middle - half_width, middle + half_width],
            y: [top, top + height],
            line_height: self.line_height(),
        }
    }
}

/// Number of columns with the largest zoom, or with a slightly smaller zoom and fewer empty tiles.
/// `zoom(columns)` is the zoom of an arrangement of `count` images in this number of columns.
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
            self.y[0] - lines * self.line_height
        } else {
            self.y[1] - lines * self.line_height
        };
        [0.5 * (self.x[0] + self.x[1]), y]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LABELS: LabelSpace = LabelSpace {
        lines_above: 3.0,
        lines_below: 1.0,
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

    /// There are sixteen images of 193 × 64 pixels in 960 × 600 points. The scale takes 60 points
    /// of the width. The best arrangement is 4 × 4: each tile has 225 × 150 points, of which 40
    /// points at the sides and 76 points for four lines are for labels. The zoom is min(185 / 193,
    /// 74 / 64) = 0.9585.
    #[test]
    fn images_have_the_largest_size_that_fits() {
        let tiles = Tiles::new(16, [193.0, 64.0], viewport([960.0, 600.0], 60.0), LABELS);
        assert_eq!(tiles.columns, 4);
        approx::assert_relative_eq!(tiles.zoom, 185.0 / 193.0);
        let [[left, right], [top, bottom]] =
            tiles.bounds().map(|ends| ends.map(|end| end * tiles.zoom));
        approx::assert_relative_eq!(right - left, 960.0, epsilon = 0.01);
        assert!(bottom - top <= 600.0);
        let corners: Vec<[f32; 2]> = tiles.corners().collect();
        assert_eq!(corners[5], [corners[1][0], corners[4][1]]);
        assert_eq!(corners[0], [0.0, 0.0]);
    }

    /// There are sixteen images of 193 × 64 pixels in 858 × 608 points. With three columns and six
    /// rows, the zoom is 0.990: the smaller of (858 / 3 − 40) / 193 = 1.275 and (608 / 6 − 38) / 64
    /// = 0.990. With four columns and four rows it is (858 / 4 − 40) / 193 = 0.904, which is 8.7 %
    /// less, but no tile is empty.
    #[test]
    fn a_slightly_smaller_size_is_chosen_to_avoid_empty_tiles() {
        let labels = LabelSpace {
            lines_above: 1.5,
            lines_below: 0.5,
            ..LABELS
        };
        let tiles = |count| Tiles::new(count, [193.0, 64.0], viewport([858.0, 608.0], 0.0), labels);
        assert_eq!((tiles(16).columns, tiles(64).columns), (4, 8));
        approx::assert_relative_eq!(tiles(16).zoom, (858.0 / 4.0 - 40.0) / 193.0, epsilon = 1e-6);
    }

    /// There is one row of images. Below the color bar, which is as high as the image, the labels
    /// of the scale need three lines of 19 points.
    #[test]
    fn labels_of_the_scale_are_within_the_view() {
        let tiles = Tiles::new(1, [193.0, 64.0], viewport([480.0, 244.0], 100.0), LABELS);
        let (bar, [_, [_, bottom]]) = (tiles.color_bar(), tiles.bounds());
        assert!(
            bar.label_position(-3.0)[1] <= bottom + 1e-4,
            "{bottom} pixels, {:?}",
            bar.label_position(-3.0)
        );
        assert!((bar.y[1] + 3.0 * 19.0 / tiles.zoom - bottom).abs() < 1e-3);
    }

    /// The overhang is at the right of the images, and the scale is in the middle of the remaining
    /// width.
    #[test]
    fn wide_labels_do_not_overlap_the_scale() {
        let wide = Tiles::new(
            2,
            [193.0, 64.0],
            Viewport {
                overhang: 30.0,
                ..viewport([480.0, 880.0], 100.0)
            },
            LABELS,
        );
        let right = wide.bounds()[0][1];
        let middle = 0.5 * (wide.color_bar().x[0] + wide.color_bar().x[1]);
        approx::assert_relative_eq!((right - middle) * wide.zoom, 50.0, epsilon = 1e-3);
        approx::assert_relative_eq!(
            (right - 193.0) * wide.zoom,
            20.0 + 30.0 + 100.0,
            epsilon = 1e-3
        );
    }

    #[test]
    fn the_scale_is_at_the_right_of_the_images() {
        let tiles = Tiles::new(3, [100.0, 40.0], viewport([480.0, 480.0], 80.0), LABELS);
        let (bar, [[_, right], _]) = (tiles.color_bar(), tiles.bounds());
        let last = tiles.corners().map(|corner| corner[0]).fold(0.0, f32::max) + 100.0;
        assert!(last < bar.x[0] && bar.x[1] < right);
        let bar = ColorBar {
            y: [0.0, 40.0],
            ..bar
        };
        let steps: Vec<(f32, f32)> = bar.steps().collect();
        assert_eq!((steps[0], steps[63]), ((40.0 - 0.3125, 0.0), (0.3125, 1.0)));
    }
}
