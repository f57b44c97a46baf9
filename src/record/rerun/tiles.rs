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
    pub(super) scale: f32,
    /// Width between images and scale for labels that extend beyond their image, in points.
    pub(super) overhang: f32,
}

/// The space for labels around each image.
#[derive(Clone, Copy, Debug)]
pub(super) struct LabelSpace {
    /// Lines above an image.
    pub(super) above: f32,
    /// Lines below an image.
    pub(super) below: f32,
    /// Points on either side of an image.
    pub(super) side_margin: f32,
    /// Lines below the color scale.
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
    right: f32,
    /// Distance from the middle of the scale to the right edge, in pixels.
    half_scale: f32,
}

/// A vertical color bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ColorBar {
    /// Left and right edge, in pixels.
    pub(super) x: [f32; 2],
    /// Upper and lower edge, in pixels.
    pub(super) y: [f32; 2],
    /// Height of a line of text, in pixels.
    pub(super) line: f32,
}

impl Tiles {
    /// Arranges images in tiles that are as large as `viewport` allows, or slightly smaller if this
    /// reduces the number of empty tiles.
    pub(super) fn new(count: u32, size: [f32; 2], viewport: Viewport, labels: LabelSpace) -> Self {
        let right = viewport.scale + viewport.overhang;
        let rows = |columns: u32| count.div_ceil(columns);
        // The scale is beside the top row. If this is the only row, there must be space for the
        // labels below the scale.
        let lines = |columns: u32| {
            labels.above
                + if rows(columns) == 1 {
                    labels.below.max(labels.scale_lines)
                } else {
                    labels.below
                }
        };
        let zoom = |columns: u32| {
            let horizontal_zoom =
                ((viewport.size[0] - right) / columns as f32 - 2.0 * labels.side_margin) / size[0];
            let vertical_zoom =
                (viewport.size[1] / rows(columns) as f32 - lines(columns) * LINE_HEIGHT) / size[1];
            horizontal_zoom.min(vertical_zoom).max(0.1)
        };
        let largest = (1..=count.max(1)).map(zoom).fold(0.0, f32::max);
        let candidates =
            (1..=count.max(1)).filter(|columns| zoom(*columns) >= (1.0 - ZOOM_TOLERANCE) * largest);
        let empty_tiles = |columns: u32| rows(columns) * columns - count;
        let compare_layouts = |one: &u32, other: &u32| {
            empty_tiles(*other)
                .cmp(&empty_tiles(*one))
                .then(zoom(*one).total_cmp(&zoom(*other)))
        };
        let columns = candidates.max_by(compare_layouts).unwrap_or(1);
        let zoom = zoom(columns);
        let step = [
            size[0] + 2.0 * labels.side_margin / zoom,
            size[1] + lines(columns) * LINE_HEIGHT / zoom,
        ];
        let margin = [labels.side_margin / zoom, labels.above * LINE_HEIGHT / zoom];
        Self {
            count,
            size,
            zoom,
            columns,
            step,
            margin,
            right: right / zoom,
            half_scale: 0.5 * viewport.scale / zoom,
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
    pub(super) fn line(&self) -> f32 {
        LINE_HEIGHT / self.zoom
    }

    /// Left and right, and upper and lower edge of all images and labels, in pixels.
    pub(super) fn bounds(&self) -> [[f32; 2]; 2] {
        let rows = self.count.div_ceil(self.columns) as f32;
        let [left, top] = self.margin.map(|margin| -margin);
        [
            [left, left + self.columns as f32 * self.step[0] + self.right],
            [top, top + rows * self.step[1]],
        ]
    }

    /// The color bar beside the top row, with space for two lines above.
    pub(super) fn bar(&self) -> ColorBar {
        let middle = self.bounds()[0][1] - self.half_scale;
        let half_width = 0.5 * COLOR_BAR_WIDTH / self.zoom;
        let top = (2.3 * self.line() - self.margin[1]).max(0.0);
        let height = if self.count > self.columns {
            self.size[1].max(MIN_COLOR_BAR_HEIGHT / self.zoom)
        } else {
            self.size[1]
        };
        ColorBar {
            x: [middle - half_width, middle + half_width],
            y: [top, top + height],
            line: self.line(),
        }
    }
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
            self.y[0] - lines * self.line
        } else {
            self.y[1] - lines * self.line
        };
        [0.5 * (self.x[0] + self.x[1]), y]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LABELS: LabelSpace = LabelSpace {
        above: 3.0,
        below: 1.0,
        side_margin: 20.0,
        scale_lines: 3.0,
    };

    fn viewport(size: [f32; 2], scale: f32) -> Viewport {
        Viewport {
            size,
            scale,
            overhang: 0.0,
        }
    }

    /// Sixteen images of 193 × 64 pixels in 960 × 600 points, of which the scale takes 60. The best
    /// arrangement is 4 × 4: each tile has 225 × 150 points, minus 40 at the sides and 76 for four
    /// lines. The zoom is min(185 / 193, 74 / 64) = 0.9585.
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

    /// 193 × 64 pixels in 858 × 608 points: sixteen images would have a zoom of (858 / 3 − 40) /
    /// 193 = 1.275 across and of (608 / 6 − 38) / 64 = 0.990 down as 3 × 6, of (858 / 4 − 40) / 193
    /// = 0.904 as 4 × 4, which is 8.7 % less but leaves no tile empty.
    #[test]
    fn a_slightly_smaller_size_is_chosen_to_avoid_empty_tiles() {
        let labels = LabelSpace {
            above: 1.5,
            below: 0.5,
            ..LABELS
        };
        let tiles = |count| Tiles::new(count, [193.0, 64.0], viewport([858.0, 608.0], 0.0), labels);
        assert_eq!((tiles(16).columns, tiles(64).columns), (4, 8));
        approx::assert_relative_eq!(tiles(16).zoom, (858.0 / 4.0 - 40.0) / 193.0, epsilon = 1e-6);
    }

    /// With one row of images, the labels of the scale need three lines of 19 points below a bar as
    /// high as the image.
    #[test]
    fn labels_of_the_scale_are_within_the_view() {
        let tiles = Tiles::new(1, [193.0, 64.0], viewport([480.0, 244.0], 100.0), LABELS);
        let (bar, [_, [_, bottom]]) = (tiles.bar(), tiles.bounds());
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
        let middle = 0.5 * (wide.bar().x[0] + wide.bar().x[1]);
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
        let (bar, [[_, right], _]) = (tiles.bar(), tiles.bounds());
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
