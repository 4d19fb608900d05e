//! Colour spaces: linear Rec. 709, CIE XYZ, CIE L*a*b*, and the Bradford transform between whites.
//!
//! Tristimulus values are relative: Y = 1 is the perfect diffuser (or the white of the display). Nothing is cut off:
//! values outside of a gamut stay negative.

/// CIE 1931 XYZ, Y = 1 for the perfect diffuser.
pub type Xyz = [f64; 3];

/// CIE 1976 L*, a*, b*.
pub type Lab = [f64; 3];

/// White of the illuminant D50 as ICC profiles have it (ICC.1:2022, 7.2.16).
pub const D50: Xyz = [0.9642, 1.0, 0.8249];

/// White of the illuminant D65, x = 0.3127, y = 0.3290 (ITU-R BT.709-6).
pub const D65: Xyz = [0.3127 / 0.3290, 1.0, (1.0 - 0.3127 - 0.3290) / 0.3290];

/// White of the illuminant C, x = 0.31006, y = 0.31616 (CIE 15:2004).
pub const C: Xyz = [0.310_06 / 0.316_16, 1.0, (1.0 - 0.310_06 - 0.316_16) / 0.316_16];

/// White of the illuminant A, x = 0.44757, y = 0.40745 (CIE 15:2004).
pub const A: Xyz = [0.447_57 / 0.407_45, 1.0, (1.0 - 0.447_57 - 0.407_45) / 0.407_45];

/// A 3 × 3 matrix, row by row.
pub type Matrix3 = [[f64; 3]; 3];

/// M v.
pub fn transform(matrix: &Matrix3, vector: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2])
}

/// A B.
pub fn product(a: &Matrix3, b: &Matrix3) -> Matrix3 {
    a.map(|row| [0, 1, 2].map(|column| (0..3).map(|k| row[k] * b[k][column]).sum()))
}

/// M⁻¹ by cofactors; `None` where the determinant is below 10⁻¹² of the product of the rows' lengths.
pub fn inverse(matrix: &Matrix3) -> Option<Matrix3> {
    let m = matrix;
    let minor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant = (0..3).map(|c| m[0][c] * minor(0, c)).sum::<f64>();
    let lengths: f64 = m.iter().map(|row| row.iter().map(|value| value * value).sum::<f64>().sqrt()).product();
    // Written so that NaN has no inverse.
    let regular = determinant.abs() > 1e-12 * lengths && determinant.is_finite();
    regular.then(|| [0, 1, 2].map(|r| [0, 1, 2].map(|c| minor(c, r) / determinant)))
}

/// XYZ (D65) of linear Rec. 709: primaries and white of ITU-R BT.709-6.
const XYZ_FROM_REC709: Matrix3 = [
    [0.412_390_799_265_959_5, 0.357_584_339_383_877_96, 0.180_480_788_401_834_3],
    [0.212_639_005_871_510_36, 0.715_168_678_767_755_9, 0.072_192_315_360_733_71],
    [0.019_330_818_715_591_85, 0.119_194_779_794_625_99, 0.950_532_152_249_660_6],
];

/// XYZ under D65 of linear Rec. 709.
pub fn xyz_from_rec709(rgb: [f64; 3]) -> Xyz {
    transform(&XYZ_FROM_REC709, rgb)
}

/// Linear Rec. 709 of XYZ under D65; colours outside of the gamut have negative channels.
pub fn rec709_from_xyz(xyz: Xyz) -> [f64; 3] {
    const REC709_FROM_XYZ: Matrix3 = [
        [3.240_969_941_904_522_6, -1.537_383_177_570_094, -0.498_610_760_293_003_4],
        [-0.969_243_636_280_879_6, 1.875_967_501_507_720_2, 0.041_555_057_407_175_59],
        [0.055_630_079_696_993_66, -0.203_976_958_888_976_52, 1.056_971_514_242_878_6],
    ];
    transform(&REC709_FROM_XYZ, xyz)
}

/// Luminance Y of linear Rec. 709.
pub fn luminance(rgb: [f64; 3]) -> f64 {
    XYZ_FROM_REC709[1][0] * rgb[0] + XYZ_FROM_REC709[1][1] * rgb[1] + XYZ_FROM_REC709[1][2] * rgb[2]
}

/// The linear Bradford transform (Lam 1985; ICC.1:2022, annex E): XYZ under the white `from` → the colour of the same look
/// under the white `to`.
pub fn adaptation(from: Xyz, to: Xyz) -> Matrix3 {
    const CONES: Matrix3 = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
    const FROM_CONES: Matrix3 = [
        [0.986_992_905_466_712_1, -0.147_054_256_420_990_13, 0.159_962_651_663_731_25],
        [0.432_305_269_723_394_5, 0.518_360_271_536_777_4, 0.049_291_228_212_855_6],
        [-0.008_528_664_575_177_33, 0.040_042_821_654_085_1, 0.968_486_695_787_55],
    ];
    let (from, to) = (transform(&CONES, from), transform(&CONES, to));
    let scaled: Matrix3 = [0, 1, 2].map(|row| CONES[row].map(|value| value * to[row] / from[row]));
    product(&FROM_CONES, &scaled)
}

/// L*a*b* of XYZ against `white` (CIE 15:2004, 8.2.1); below black the linear part goes on.
pub fn lab_from_xyz(xyz: Xyz, white: Xyz) -> Lab {
    const DELTA: f64 = 6.0 / 29.0;
    let f = |ratio: f64| {
        if ratio > DELTA * DELTA * DELTA { ratio.cbrt() } else { ratio / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let [x, y, z] = [0, 1, 2].map(|index| f(xyz[index] / white[index]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// XYZ of L*a*b* against `white`.
pub fn xyz_from_lab([lightness, a, b]: Lab, white: Xyz) -> Xyz {
    const DELTA: f64 = 6.0 / 29.0;
    let y = (lightness + 16.0) / 116.0;
    let inverse = |f: f64| if f > DELTA { f * f * f } else { 3.0 * DELTA * DELTA * (f - 4.0 / 29.0) };
    let ratios = [inverse(y + a / 500.0), inverse(y), inverse(y - b / 200.0)];
    [0, 1, 2].map(|index| ratios[index] * white[index])
}

/// C*, the distance from grey.
pub fn chroma([_, a, b]: Lab) -> f64 {
    a.hypot(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: [f64; 3], b: [f64; 3], tolerance: f64) -> bool {
        a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= tolerance)
    }

    #[test]
    fn every_transform_has_its_way_back() {
        for rgb in [[0.2, 0.4, 0.9], [1.0, 1.0, 1.0], [-0.1, 0.5, 0.02], [0.001, 0.0002, 0.0]] {
            let xyz = xyz_from_rec709(rgb);
            assert!(near(rec709_from_xyz(xyz), rgb, 1e-12), "{rgb:?}");
            assert!(near(xyz_from_lab(lab_from_xyz(xyz, D50), D50), xyz, 1e-12), "{rgb:?}");
            let there = transform(&adaptation(D65, D50), xyz);
            assert!(near(transform(&adaptation(D50, D65), there), xyz, 1e-9), "{rgb:?}");
        }
        let inverse = inverse(&XYZ_FROM_REC709).unwrap();
        assert!(near(transform(&inverse, transform(&XYZ_FROM_REC709, [0.3, 0.2, 0.1])), [0.3, 0.2, 0.1], 1e-12));
    }

    #[test]
    fn white_is_white_in_every_space() {
        assert!(near(xyz_from_rec709([1.0; 3]), D65, 1e-4));
        assert!(near(transform(&adaptation(D65, D50), D65), D50, 1e-9));
        assert!(near(lab_from_xyz(D65, D65), [100.0, 0.0, 0.0], 1e-9));
        assert!((luminance([1.0; 3]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_bradford_matrix_is_the_published_one() {
        // D65 → D50 as B. Lindbloom lists it ("Chromatic Adaptation", 2017), for whites of four digits.
        let published = [
            [1.047_811_2, 0.022_886_6, -0.050_127_0],
            [0.029_542_4, 0.990_484_4, -0.017_049_1],
            [-0.009_234_5, 0.015_043_6, 0.752_131_6],
        ];
        let ours = adaptation([0.950_47, 1.0, 1.088_83], [0.964_22, 1.0, 0.825_21]);
        assert!((0..3).all(|row| near(ours[row], published[row], 1e-6)), "{ours:?}");
    }

    #[test]
    fn a_singular_matrix_has_no_inverse() {
        assert_eq!(inverse(&[[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 1.0, 0.0]]), None);
        assert_eq!(inverse(&[[f64::NAN; 3]; 3]), None);
    }
}
