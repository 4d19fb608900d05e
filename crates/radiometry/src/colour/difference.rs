//! ΔE₀₀, the CIEDE2000 colour difference (CIE 142:2001; G. Sharma, W. Wu, E. N. Dalal, "The CIEDE2000 Color-Difference
//! Formula: Implementation Notes, Supplementary Test Data, and Mathematical Observations", 2005), with k_L = k_C = k_H = 1.

use super::space::Lab;

/// ΔE₀₀ between two colours.
pub fn delta_e_2000(a: Lab, b: Lab) -> f64 {
    components(a, b).iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// Three numbers whose squares add up to ΔE₀₀²: smooth where ΔE₀₀ is 0, so that a fit can follow them.
///
/// The rotation term R_T · x · y is completed to squares: x² + y² + R_T x y = (x + R_T y / 2)² + (1 − R_T² / 4) y².
pub(super) fn components(a: Lab, b: Lab) -> [f64; 3] {
    let mean_chroma = 0.5 * (a[1].hypot(a[2]) + b[1].hypot(b[2]));
    let g = 0.5 * (1.0 - chroma_weight(mean_chroma));
    let ([l1, c1, h1], [l2, c2, h2]) = (polar(a, g), polar(b, g));
    let both_coloured = c1 * c2 > 0.0;
    let turn = if !both_coloured { 0.0 } else { wrapped(h2 - h1) };
    let hue_difference = 2.0 * (c1 * c2).sqrt() * (0.5 * turn).to_radians().sin();
    let (l, c) = (0.5 * (l1 + l2), 0.5 * (c1 + c2));
    let h = if !both_coloured {
        h1 + h2
    } else if (h1 - h2).abs() <= 180.0 {
        0.5 * (h1 + h2)
    } else if h1 + h2 < 360.0 {
        0.5 * (h1 + h2 + 360.0)
    } else {
        0.5 * (h1 + h2 - 360.0)
    };
    let cosine = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cosine(h - 30.0) + 0.24 * cosine(2.0 * h) + 0.32 * cosine(3.0 * h + 6.0)
        - 0.20 * cosine(4.0 * h - 63.0);
    let rotation = -(60.0 * (-((h - 275.0) / 25.0).powi(2)).exp()).to_radians().sin() * 2.0 * chroma_weight(c);
    let s_l = 1.0 + 0.015 * (l - 50.0).powi(2) / (20.0 + (l - 50.0).powi(2)).sqrt();
    let (x, y) = ((c2 - c1) / (1.0 + 0.045 * c), hue_difference / (1.0 + 0.015 * c * t));
    // |R_T| is below √3, so that the root is real.
    [(l2 - l1) / s_l, x + 0.5 * rotation * y, (1.0 - 0.25 * rotation * rotation).sqrt() * y]
}

/// √(C⁷ / (C⁷ + 25⁷)).
fn chroma_weight(chroma: f64) -> f64 {
    let power = chroma.powi(7);
    (power / (power + 25.0f64.powi(7))).sqrt()
}

/// L', C' and h' in degrees, 0 … 360.
fn polar([lightness, a, b]: Lab, g: f64) -> [f64; 3] {
    let a = (1.0 + g) * a;
    [lightness, a.hypot(b), if a == 0.0 && b == 0.0 { 0.0 } else { b.atan2(a).to_degrees().rem_euclid(360.0) }]
}

/// An angle between −180 and 180 degrees.
fn wrapped(degrees: f64) -> f64 {
    if degrees > 180.0 {
        degrees - 360.0
    } else if degrees < -180.0 {
        degrees + 360.0
    } else {
        degrees
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table 1 of Sharma, Wu and Dalal (2005): all 34 pairs.
    #[rustfmt::skip]
    const PAIRS: [([f64; 3], [f64; 3], f64); 34] = [
        ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
        ([50.0, 3.1571, -77.2803], [50.0, 0.0, -82.7485], 2.8615),
        ([50.0, 2.8361, -74.0200], [50.0, 0.0, -82.7485], 3.4412),
        ([50.0, -1.3802, -84.2814], [50.0, 0.0, -82.7485], 1.0000),
        ([50.0, -1.1848, -84.8006], [50.0, 0.0, -82.7485], 1.0000),
        ([50.0, -0.9009, -85.5211], [50.0, 0.0, -82.7485], 1.0000),
        ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
        ([50.0, -1.0, 2.0], [50.0, 0.0, 0.0], 2.3669),
        ([50.0, 2.4900, -0.0010], [50.0, -2.4900, 0.0009], 7.1792),
        ([50.0, 2.4900, -0.0010], [50.0, -2.4900, 0.0010], 7.1792),
        ([50.0, 2.4900, -0.0010], [50.0, -2.4900, 0.0011], 7.2195),
        ([50.0, 2.4900, -0.0010], [50.0, -2.4900, 0.0012], 7.2195),
        ([50.0, -0.0010, 2.4900], [50.0, 0.0009, -2.4900], 4.8045),
        ([50.0, -0.0010, 2.4900], [50.0, 0.0010, -2.4900], 4.8045),
        ([50.0, -0.0010, 2.4900], [50.0, 0.0011, -2.4900], 4.7461),
        ([50.0, 2.5, 0.0], [50.0, 0.0, -2.5], 4.3065),
        ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
        ([50.0, 2.5, 0.0], [61.0, -5.0, 29.0], 22.8977),
        ([50.0, 2.5, 0.0], [56.0, -27.0, -3.0], 31.9030),
        ([50.0, 2.5, 0.0], [58.0, 24.0, 15.0], 19.4535),
        ([50.0, 2.5, 0.0], [50.0, 3.1736, 0.5854], 1.0000),
        ([50.0, 2.5, 0.0], [50.0, 3.2972, 0.0], 1.0000),
        ([50.0, 2.5, 0.0], [50.0, 1.8634, 0.5757], 1.0000),
        ([50.0, 2.5, 0.0], [50.0, 3.2592, 0.3350], 1.0000),
        ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
        ([63.0109, -31.0961, -5.8663], [62.8187, -29.7946, -4.0864], 1.2630),
        ([61.2901, 3.7196, -5.3901], [61.4292, 2.2480, -4.9620], 1.8731),
        ([35.0831, -44.1164, 3.7933], [35.0232, -40.0716, 1.5901], 1.8645),
        ([22.7233, 20.0904, -46.6940], [23.0331, 14.9730, -42.5619], 2.0373),
        ([36.4612, 47.8580, 18.3852], [36.2715, 50.5065, 21.2231], 1.4146),
        ([90.8027, -2.0831, 1.4410], [91.1528, -1.6435, 0.0447], 1.4441),
        ([90.9257, -0.5406, -0.9208], [88.6381, -0.8985, -0.7239], 1.5381),
        ([6.7747, -0.2908, -2.4247], [5.8714, -0.0985, -2.2286], 0.6377),
        ([2.0776, 0.0795, -1.1350], [0.9033, -0.0636, -0.5514], 0.9082),
    ];

    #[test]
    fn the_published_pairs_come_out_to_four_digits() {
        for (a, b, published) in PAIRS {
            let ours = delta_e_2000(a, b);
            assert!((ours - published).abs() < 5.1e-5, "{a:?} {b:?}: {ours}, published {published}");
        }
    }

    #[test]
    fn a_colour_is_no_distance_from_itself_and_order_does_not_matter() {
        for (a, b, _) in PAIRS {
            assert_eq!(delta_e_2000(a, a), 0.0);
            assert!((delta_e_2000(a, b) - delta_e_2000(b, a)).abs() < 1e-9);
        }
    }
}
