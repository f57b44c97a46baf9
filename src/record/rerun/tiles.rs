//! Where pictures and words stand in a view. Words have a fixed size on the screen, whereas pictures grow with the view; so how much room
//! words take, in pixels of a picture, depends on how many pictures share a view.

use crate::record::visitation::BINS;

/// Height of a line of words, in points of the screen.
const LINE: f32 = 19.0;

/// Width of a letter, in points of the screen.
pub(super) const LETTER: f32 = 6.7;

/// Width of the bar of colours, in points of the screen.
const BAR: f32 = 14.0;

/// Height below which the bar of colours has too few steps to be read, in points of the screen.
const LEAST_BAR: f32 = 120.0;

/// Pictures smaller than the largest possible ones by at most this share are as good, where more of the places are filled.
const NEARLY: f32 = 0.125;

/// A place on the screen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    /// Width and height, in points of the screen.
    pub(super) size: [f32; 2],
    /// Of which to the right, for a scale of colours.
    pub(super) scale: f32,
    /// Of which to the left of the scale, for words that are wider than what they belong to.
    pub(super) overhang: f32,
}

/// What words around each picture take.
#[derive(Clone, Copy, Debug)]
pub(super) struct Words {
    /// Lines above a picture.
    pub(super) above: f32,
    /// Lines below a picture.
    pub(super) below: f32,
    /// Points of the screen on either side of a picture.
    pub(super) beside: f32,
    /// Lines below the scale of colours.
    pub(super) key: f32,
}

/// Equally large pictures in columns and rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tiles {
    /// How many.
    pub(super) count: u32,
    /// Of one picture, in pixels.
    pub(super) size: [f32; 2],
    /// Points of the screen that a pixel gets.
    pub(super) zoom: f32,
    columns: u32,
    /// From one picture to the next, in pixels.
    step: [f32; 2],
    /// Before the first picture, in pixels.
    before: [f32; 2],
    /// For the scale of colours and what hangs over, in pixels.
    right: f32,
    /// From the middle of the scale to the right end, in pixels.
    half_scale: f32,
}

/// An upright bar of colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bar {
    /// Its left and right side, in pixels.
    pub(super) x: [f32; 2],
    /// Its upper and lower end, in pixels.
    pub(super) y: [f32; 2],
    /// Height of a line of words, in pixels.
    pub(super) line: f32,
}

impl Tiles {
    /// As large as `room` allows, or nearly so where that leaves fewer places empty.
    pub(super) fn new(count: u32, size: [f32; 2], room: Room, words: Words) -> Self {
        let right = room.scale + room.overhang;
        let rows = |columns: u32| count.div_ceil(columns);
        // The scale stands beside the uppermost row: a single one has its words below as well.
        let lines = |columns: u32| {
            words.above
                + if rows(columns) == 1 {
                    words.below.max(words.key)
                } else {
                    words.below
                }
        };
        let zoom = |columns: u32| {
            let across = ((room.size[0] - right) / columns as f32 - 2.0 * words.beside) / size[0];
            let down = (room.size[1] / rows(columns) as f32 - lines(columns) * LINE) / size[1];
            across.min(down).max(0.1)
        };
        let largest = (1..=count.max(1)).map(zoom).fold(0.0, f32::max);
        let good = (1..=count.max(1)).filter(|columns| zoom(*columns) >= (1.0 - NEARLY) * largest);
        let empty = |columns: u32| rows(columns) * columns - count;
        let better = |one: &u32, other: &u32| {
            empty(*other)
                .cmp(&empty(*one))
                .then(zoom(*one).total_cmp(&zoom(*other)))
        };
        let columns = good.max_by(better).unwrap_or(1);
        let zoom = zoom(columns);
        let step = [
            size[0] + 2.0 * words.beside / zoom,
            size[1] + lines(columns) * LINE / zoom,
        ];
        let before = [words.beside / zoom, words.above * LINE / zoom];
        Self {
            count,
            size,
            zoom,
            columns,
            step,
            before,
            right: right / zoom,
            half_scale: 0.5 * room.scale / zoom,
        }
    }

    /// The upper left corner of each picture.
    pub(super) fn corners(&self) -> impl Iterator<Item = [f32; 2]> {
        let place = |tile: u32| {
            [
                (tile % self.columns) as f32 * self.step[0],
                (tile / self.columns) as f32 * self.step[1],
            ]
        };
        (0..self.count).map(place)
    }

    /// Height of a line of words, in pixels.
    pub(super) fn line(&self) -> f32 {
        LINE / self.zoom
    }

    /// From left to right and from above to below, all pictures and words.
    pub(super) fn bounds(&self) -> [[f32; 2]; 2] {
        let rows = self.count.div_ceil(self.columns) as f32;
        let [left, top] = self.before.map(|before| -before);
        [
            [left, left + self.columns as f32 * self.step[0] + self.right],
            [top, top + rows * self.step[1]],
        ]
    }

    /// Beside the uppermost row, with room for two lines above.
    pub(super) fn bar(&self) -> Bar {
        let middle = self.bounds()[0][1] - self.half_scale;
        let half = 0.5 * BAR / self.zoom;
        let top = (2.3 * self.line() - self.before[1]).max(0.0);
        let height = if self.count > self.columns {
            self.size[1].max(LEAST_BAR / self.zoom)
        } else {
            self.size[1]
        };
        Bar {
            x: [middle - half, middle + half],
            y: [top, top + height],
            line: self.line(),
        }
    }
}

impl Bar {
    /// Steps of colour, one for each level of the density's axes.
    pub(super) const STEPS: usize = BINS;

    /// The height of each step, from the lowest up, and its share of the scale.
    pub(super) fn steps(&self) -> impl Iterator<Item = (f32, f32)> {
        let share = |step: usize| (step as f32 + 0.5) / Self::STEPS as f32;
        (0..Self::STEPS).map(move |step| {
            (
                self.y[1] - share(step) * (self.y[1] - self.y[0]),
                step as f32 / (Self::STEPS - 1) as f32,
            )
        })
    }

    /// Half the height of a step and a little more, so that none shows between two, in pixels.
    pub(super) fn half_step(&self) -> f32 {
        0.55 * (self.y[1] - self.y[0]) / Self::STEPS as f32
    }

    /// Where words stand: `lines` above the bar's upper end, or below its lower one if negative.
    pub(super) fn words(&self, lines: f32) -> [f32; 2] {
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

    const WORDS: Words = Words {
        above: 3.0,
        below: 1.0,
        beside: 20.0,
        key: 3.0,
    };

    fn room(size: [f32; 2], scale: f32) -> Room {
        Room {
            size,
            scale,
            overhang: 0.0,
        }
    }

    /// 193 × 64 pixels in 960 × 600 points, of which 60 for the scale: sixteen pictures fit best as 4 × 4, where each has 225 × 150 points,
    /// less 40 beside and 76 for four lines; 185 / 193 and 74 / 64 make a zoom of 0.9585.
    #[test]
    fn pictures_are_as_large_as_the_room_allows() {
        let tiles = Tiles::new(16, [193.0, 64.0], room([960.0, 600.0], 60.0), WORDS);
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

    /// 193 × 64 pixels in 858 × 608 points: sixteen pictures would have a zoom of (858 / 3 − 40) / 193 = 1.275 across and of
    /// (608 / 6 − 38) / 64 = 0.990 down as 3 × 6, of (858 / 4 − 40) / 193 = 0.904 as 4 × 4, which is 8.7 % less but leaves no place empty.
    #[test]
    fn no_picture_is_left_alone_for_a_little_size() {
        let words = Words {
            above: 1.5,
            below: 0.5,
            ..WORDS
        };
        let tiles = |count| Tiles::new(count, [193.0, 64.0], room([858.0, 608.0], 0.0), words);
        assert_eq!((tiles(16).columns, tiles(64).columns), (4, 8));
        approx::assert_relative_eq!(tiles(16).zoom, (858.0 / 4.0 - 40.0) / 193.0, epsilon = 1e-6);
    }

    /// Of one row, the words of the scale reach further down than those of the picture: 3 lines of 19 points below a bar as high as it.
    #[test]
    fn the_words_of_the_scale_are_in_view() {
        let tiles = Tiles::new(1, [193.0, 64.0], room([480.0, 244.0], 100.0), WORDS);
        let (bar, [_, [_, bottom]]) = (tiles.bar(), tiles.bounds());
        assert!(
            bar.words(-3.0)[1] <= bottom + 1e-4,
            "{bottom} pixels, {:?}",
            bar.words(-3.0)
        );
        assert!((bar.y[1] + 3.0 * 19.0 / tiles.zoom - bottom).abs() < 1e-3);
    }

    /// What hangs over the pictures' right end has a room of its own; the scale stays in the middle of what is left.
    #[test]
    fn words_that_hang_over_do_not_reach_the_scale() {
        let wide = Tiles::new(
            2,
            [193.0, 64.0],
            Room {
                overhang: 30.0,
                ..room([480.0, 880.0], 100.0)
            },
            WORDS,
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
    fn the_scale_stands_beside_the_pictures() {
        let tiles = Tiles::new(3, [100.0, 40.0], room([480.0, 480.0], 80.0), WORDS);
        let (bar, [[_, right], _]) = (tiles.bar(), tiles.bounds());
        let last = tiles.corners().map(|corner| corner[0]).fold(0.0, f32::max) + 100.0;
        assert!(last < bar.x[0] && bar.x[1] < right);
        let bar = Bar {
            y: [0.0, 40.0],
            ..bar
        };
        let steps: Vec<(f32, f32)> = bar.steps().collect();
        assert_eq!((steps[0], steps[63]), ((40.0 - 0.3125, 0.0), (0.3125, 1.0)));
    }
}
