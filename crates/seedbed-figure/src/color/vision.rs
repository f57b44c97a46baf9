//! How different colors are to people with and without color blindness, for tests.

use super::{Color, linear};

/// A kind of color vision. The last three lack one kind of cone.
#[derive(Clone, Copy, Debug)]
pub(super) enum Vision {
    Normal,
    Protan,
    Deutan,
    Tritan,
}

pub(super) const VISIONS: [Vision; 4] = [
    Vision::Normal,
    Vision::Protan,
    Vision::Deutan,
    Vision::Tritan,
];

type Matrix = [[f64; 3]; 3];

impl Vision {
    /// Simulation of the vision in linear RGB: Machado, Oliveira and Fernandes, "A Physiologically-based
    /// Model for Simulation of Color Vision Deficiency" (2009), severity 1.
    fn simulation(self) -> Matrix {
        match self {
            Self::Normal => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            Self::Protan => [
                [0.152_286, 1.052_583, -0.204_868],
                [0.114_503, 0.786_281, 0.099_216],
                [-0.003_882, -0.048_116, 1.051_998],
            ],
            Self::Deutan => [
                [0.367_322, 0.860_646, -0.227_968],
                [0.280_085, 0.672_501, 0.047_413],
                [-0.011_820, 0.042_940, 0.968_881],
            ],
            Self::Tritan => [
                [1.255_528, -0.076_749, -0.178_779],
                [-0.078_411, 0.930_809, 0.147_602],
                [0.004_733, 0.691_367, 0.303_900],
            ],
        }
    }

    /// CIE L*a*b* (D65) of an sRGB color as it is seen.
    pub(super) fn lab(self, color: Color) -> [f64; 3] {
        const TO_XYZ: Matrix = [
            [0.412_456_4, 0.357_576_1, 0.180_437_5],
            [0.212_672_9, 0.715_152_2, 0.072_175_0],
            [0.019_333_9, 0.119_192_0, 0.950_304_1],
        ];
        let seen =
            multiply(self.simulation(), color.map(linear)).map(|channel| channel.clamp(0.0, 1.0));
        let [x, y, z] = multiply(TO_XYZ, seen);
        let root = |ratio: f64| {
            if ratio > 216.0 / 24_389.0 {
                ratio.cbrt()
            } else {
                (24_389.0 / 27.0 * ratio + 16.0) / 116.0
            }
        };
        let [x, y, z] = [root(x / 0.950_47), root(y), root(z / 1.088_83)];
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }
}

fn multiply(matrix: Matrix, vector: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| {
        row.iter()
            .zip(vector)
            .map(|(factor, value)| factor * value)
            .sum()
    })
}

/// The color difference CIEDE2000, with all parametric factors 1. In the notation of Sharma, Wu and
/// Dalal, "The CIEDE2000 Color-Difference Formula" (2005).
pub(super) fn ciede2000([l1, a1, b1]: [f64; 3], [l2, a2, b2]: [f64; 3]) -> f64 {
    let seventh_power_share = |chroma: f64| {
        let power = chroma.powi(7);
        (power / (power + 25_f64.powi(7))).sqrt()
    };
    let g = 0.5 * (1.0 - seventh_power_share(f64::midpoint(a1.hypot(b1), a2.hypot(b2))));
    let polar = |a: f64, b: f64| {
        let a = (1.0 + g) * a;
        (a.hypot(b), b.atan2(a).to_degrees().rem_euclid(360.0))
    };
    let ((c1, h1), (c2, h2)) = (polar(a1, b1), polar(a2, b2));
    let is_gray = c1 * c2 == 0.0;
    let hue_difference = match h2 - h1 {
        _ if is_gray => 0.0,
        difference if difference > 180.0 => difference - 360.0,
        difference if difference < -180.0 => difference + 360.0,
        difference => difference,
    };
    let mean_hue = match h1 + h2 {
        sum if is_gray => sum,
        sum if (h1 - h2).abs() <= 180.0 => sum / 2.0,
        sum if sum < 360.0 => sum / 2.0 + 180.0,
        sum => sum / 2.0 - 180.0,
    };
    let delta_h = 2.0 * (c1 * c2).sqrt() * (hue_difference / 2.0).to_radians().sin();
    let (mean_l, mean_c) = (f64::midpoint(l1, l2), f64::midpoint(c1, c2));
    let cos = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cos(mean_hue - 30.0)
        + 0.24 * cos(2.0 * mean_hue)
        + 0.32 * cos(3.0 * mean_hue + 6.0)
        - 0.20 * cos(4.0 * mean_hue - 63.0);
    let from_middle = (mean_l - 50.0).powi(2);
    let lightness = (l2 - l1) / (1.0 + 0.015 * from_middle / (20.0 + from_middle).sqrt());
    let chroma = (c2 - c1) / (1.0 + 0.045 * mean_c);
    let hue = delta_h / (1.0 + 0.015 * mean_c * t);
    let rotation = 30.0 * (-((mean_hue - 275.0) / 25.0).powi(2)).exp();
    let interaction = -(2.0 * rotation).to_radians().sin() * 2.0 * seventh_power_share(mean_c);
    (lightness.powi(2) + chroma.powi(2) + hue.powi(2) + interaction * chroma * hue).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs 1, 4, 7, 13, 17, 22 and 34 of table 1 of Sharma, Wu and Dalal (2005).
    #[test]
    fn differences_are_those_of_the_published_table() {
        let table = [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, -1.3802, -84.2814], [50.0, 0.0, -82.7485], 1.0000),
            ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
            ([50.0, -0.001, 2.49], [50.0, 0.0011, -2.49], 4.7461),
            ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
            ([50.0, 2.5, 0.0], [50.0, 1.8634, 0.5757], 1.0000),
            (
                [2.0776, 0.0795, -1.1350],
                [0.9033, -0.0636, -0.5514],
                0.9082,
            ),
        ];
        for (one, other, expected) in table {
            let difference = ciede2000(one, other);
            assert!(
                (difference - expected).abs() < 1e-4,
                "{one:?}: {difference}"
            );
        }
    }

    /// White has L* = 100, black 0; the published conversion of pure red is (53.24, 80.09, 67.20).
    #[test]
    fn lab_values_are_those_of_srgb() {
        let near = |color, expected: [f64; 3]| {
            let lab = Vision::Normal.lab(color);
            assert!(
                lab.iter()
                    .zip(expected)
                    .all(|(one, other)| (one - other).abs() < 0.02),
                "{lab:?}"
            );
        };
        near([255; 3], [100.0, 0.0, 0.0]);
        near([0; 3], [0.0; 3]);
        near([255, 0, 0], [53.24, 80.09, 67.20]);
    }
}
