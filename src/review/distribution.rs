//! Distribution of the values of a quantity, whose median is exact.
//!
//! Values are read twice. The first time they are counted by the upper half of their bits, in the order of
//! numbers; the second time those in the part where the median is, by the lower half. So memory does not
//! grow with the number of values, and the median is that of the values themselves.

use seedbed_env::Quantity;

/// Number of different halves of the bits of a value.
const HALVES: usize = 1 << 16;

/// Number of counts of a page, which is allocated when one of them is needed.
const PAGE: usize = 256;

/// Distribution of the values of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueDistribution {
    /// Name, unit and display range of the quantity.
    pub quantity: Quantity,
    /// Smallest value other than NaN; infinite without values.
    pub min: f32,
    /// Largest value other than NaN; −∞ without values.
    pub max: f32,
    /// Number of values, with NaN.
    pub count: u64,
    /// Number of values that are NaN. Minimum, median, maximum and mean leave them out.
    pub nan: u64,
    /// Number of values that are infinite.
    pub infinite: u64,
    /// Number of values outside the range.
    pub outside: u64,
    sum: f64,
    upper_halves: Counts,
    /// The two values in the middle, which may be the same; `None` before values are read the second time.
    middle: Option<[Middle; 2]>,
}

/// The part of the values in which one of the two in the middle is.
#[derive(Clone, Debug, PartialEq)]
struct Middle {
    upper_half: u16,
    /// Number of values in this part that are not above it but come before it.
    before: u64,
    lower_halves: Counts,
}

/// Numbers of values per half of their bits.
#[derive(Clone, Debug, Default, PartialEq)]
struct Counts {
    /// `[HALVES / PAGE]` of `[PAGE]`; empty without values.
    pages: Vec<Vec<u64>>,
}

impl ValueDistribution {
    pub(super) fn new(quantity: &Quantity) -> Self {
        Self {
            quantity: quantity.clone(),
            min: f32::INFINITY,
            max: f32::NEG_INFINITY,
            count: 0,
            nan: 0,
            infinite: 0,
            outside: 0,
            sum: 0.0,
            upper_halves: Counts::default(),
            middle: None,
        }
    }

    /// Adds a value, the first time.
    pub(super) fn add(&mut self, value: f32) {
        self.count += 1;
        if value.is_nan() {
            self.nan += 1;
            return;
        }
        let [low, high] = self.quantity.range;
        self.min = self.min.min(value);
        self.max = self.max.max(value);
        self.infinite += u64::from(value.is_infinite());
        self.sum += f64::from(value);
        self.outside += u64::from(value < low || value > high);
        self.upper_halves.add(halves(value)[0]);
    }

    /// Number of values other than NaN.
    #[must_use]
    pub fn number_count(&self) -> u64 {
        self.count - self.nan
    }

    /// Begins the second time, when all values were added.
    pub(super) fn find_middle(&mut self) {
        let Some(last) = self.number_count().checked_sub(1) else {
            return;
        };
        self.middle = Some([last / 2, last.div_ceil(2)].map(|rank| {
            let (upper_half, before) = self.upper_halves.of_rank(rank);
            Middle {
                upper_half,
                before,
                lower_halves: Counts::default(),
            }
        }));
    }

    /// Adds a value, the second time.
    pub(super) fn add_again(&mut self, value: f32) {
        if value.is_nan() {
            return;
        }
        let [upper_half, lower_half] = halves(value);
        for middle in self.middle.iter_mut().flatten() {
            if middle.upper_half == upper_half {
                middle.lower_halves.add(lower_half);
            }
        }
    }

    /// Mean; `None` without values.
    #[must_use]
    pub fn mean(&self) -> Option<f64> {
        (self.number_count() > 0).then(|| self.sum / self.number_count() as f64)
    }

    /// Median: the value in the middle or, of an even number of values, the mean of both. `None` without
    /// values.
    #[must_use]
    pub fn median(&self) -> Option<f64> {
        let values = self.middle.as_ref()?.each_ref().map(Middle::value);
        let [one, other] = values.map(f64::from);
        // The mean of two infinite values would be NaN if they had other signs.
        Some(if one == other {
            one
        } else {
            f64::midpoint(one, other)
        })
    }
}

impl Middle {
    fn value(&self) -> f32 {
        let (lower_half, _) = self.lower_halves.of_rank(self.before);
        from_halves([self.upper_half, lower_half])
    }
}

impl Counts {
    fn add(&mut self, half: u16) {
        self.pages.resize(HALVES / PAGE, Vec::new());
        let page = &mut self.pages[usize::from(half) / PAGE];
        page.resize(PAGE, 0);
        page[usize::from(half) % PAGE] += 1;
    }

    /// The half that the value with this number, from 0, has in their order, and the number of the value
    /// among those with the same half.
    fn of_rank(&self, rank: u64) -> (u16, u64) {
        let mut before = 0;
        for (page, counts) in self.pages.iter().enumerate() {
            for (index, count) in counts.iter().enumerate() {
                if rank < before + count {
                    return ((page * PAGE + index) as u16, rank - before);
                }
                before += count;
            }
        }
        (u16::MAX, 0)
    }
}

/// Upper and lower half of the bits of a value, changed so that they are in the order of numbers.
fn halves(value: f32) -> [u16; 2] {
    let bits = value.to_bits();
    let ordered = if bits >> 31 == 1 {
        !bits
    } else {
        bits | 1 << 31
    };
    [(ordered >> 16) as u16, ordered as u16]
}

fn from_halves([upper, lower]: [u16; 2]) -> f32 {
    let ordered = u32::from(upper) << 16 | u32::from(lower);
    f32::from_bits(if ordered >> 31 == 1 {
        ordered ^ 1 << 31
    } else {
        !ordered
    })
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_distr::StandardNormal;
    use seedbed_random::{Purpose, stream};

    use super::*;

    fn distribution(values: &[f32]) -> ValueDistribution {
        let mut distribution = ValueDistribution::new(&Quantity {
            name: "x".to_owned(),
            unit: String::new(),
            range: [0.0, 1000.0],
        });
        for value in values {
            distribution.add(*value);
        }
        distribution.find_middle();
        for value in values {
            distribution.add_again(*value);
        }
        distribution
    }

    #[test]
    fn min_max_mean_and_median_are_those_of_the_values() {
        let empty = distribution(&[]);
        assert_eq!((empty.mean(), empty.median()), (None, None));
        let distribution = distribution(&[-5.0, 10.2, 20.2, 30.2, 1200.0]);
        assert_eq!(
            (
                distribution.min,
                distribution.max,
                distribution.count,
                distribution.outside
            ),
            (-5.0, 1200.0, 5, 2)
        );
        assert_eq!(distribution.median(), Some(f64::from(20.2_f32)));
        assert!((distribution.mean().unwrap() - 1255.6 / 5.0).abs() < 1e-4);
    }

    /// numpy.nanmedian([nan, 4, inf, -inf, nan, -2]) is 1, the mean of −2 and 4.
    #[test]
    fn nan_is_left_out_and_counted() {
        let [nan, inf] = [f32::NAN, f32::INFINITY];
        let distribution = distribution(&[nan, 4.0, inf, -inf, nan, -2.0]);
        assert_eq!(distribution.median(), Some(1.0));
        assert_eq!(
            [distribution.count, distribution.nan, distribution.infinite],
            [6, 2, 2]
        );
        assert_eq!((distribution.min, distribution.max), (-inf, inf));
        assert_eq!(self::distribution(&[nan]).median(), None);
        assert_eq!(
            self::distribution(&[inf, inf]).median(),
            Some(f64::INFINITY)
        );
    }

    /// Against sorted values of both signs and all magnitudes, in an even and an odd number.
    #[test]
    fn medians_are_those_of_sorted_values() {
        let random = &mut stream(3, Purpose::ExamplePoints, 0, 0);
        for count in [1, 2, 3, 10, 999, 1000] {
            for scale in [1e-30_f32, 1.0, 1e30] {
                let mut values: Vec<f32> = (0..count)
                    .map(|_| scale * random.sample::<f32, _>(StandardNormal))
                    .collect();
                let median = distribution(&values).median().unwrap();
                values.sort_unstable_by(f32::total_cmp);
                let middle = [values[(count - 1) / 2], values[count / 2]].map(f64::from);
                assert_eq!(
                    median,
                    f64::midpoint(middle[0], middle[1]),
                    "{count} × {scale}"
                );
            }
        }
    }
}
