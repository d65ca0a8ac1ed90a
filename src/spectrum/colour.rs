//! Colour spaces: from CIE XYZ to the primaries of a file, and back.
//!
//! Matrices are derived in f64 from the primaries and the white point that each standard prints
//! (SMPTE RP 177-1993). XYZ inside the renderer is relative to D65, so a space with another white
//! (ACES) is reached by Bradford adaptation (Lam 1985), as ACES' own transforms are.

use crate::math::elementary::{exp_down, log};

/// Chromaticities (x, y).
type Xy = [f64; 2];
/// Rows of a matrix.
pub type Matrix = [[f64; 3]; 3];

/// D65 as Rec.709, Rec.2020 and P3-D65 print it.
const D65: Xy = [0.3127, 0.3290];
/// The white of ACES, TB-2018-001.
const ACES_WHITE: Xy = [0.32168, 0.33767];

/// The primaries of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColourSpace {
    /// Linear light in the primaries of ITU-R BT.709 and sRGB.
    Rec709,
    /// ACEScg: AP1 primaries, S-2014-004.
    AcesCg,
    /// ACES2065-1: AP0 primaries, SMPTE ST 2065-1.
    Aces2065_1,
    /// ITU-R BT.2020.
    Rec2020,
    /// SMPTE EG 432-1 primaries with the white D65.
    P3D65,
    /// CIE 1931 XYZ itself.
    Xyz,
}

impl ColourSpace {
    /// All spaces.
    pub const ALL: [ColourSpace; 6] = [
        ColourSpace::Rec709,
        ColourSpace::AcesCg,
        ColourSpace::Aces2065_1,
        ColourSpace::Rec2020,
        ColourSpace::P3D65,
        ColourSpace::Xyz,
    ];

    /// Chromaticities of red, green, blue and white, as the `chromaticities` attribute of an
    /// OpenEXR file has them.
    #[must_use]
    pub const fn chromaticities(self) -> [[f64; 2]; 4] {
        match self {
            ColourSpace::Rec709 => [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], D65],
            ColourSpace::AcesCg => [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], ACES_WHITE],
            ColourSpace::Aces2065_1 => [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.0770], ACES_WHITE],
            ColourSpace::Rec2020 => [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], D65],
            ColourSpace::P3D65 => [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], D65],
            ColourSpace::Xyz => [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0 / 3.0, 1.0 / 3.0]],
        }
    }

    /// The name of the space in the Color Interop Forum's list: the `colorInteropID` attribute.
    #[must_use]
    pub const fn interop_id(self) -> &'static str {
        match self {
            ColourSpace::Rec709 => "lin_rec709_scene",
            ColourSpace::AcesCg => "lin_ap1_scene",
            ColourSpace::Aces2065_1 => "lin_ap0_scene",
            ColourSpace::Rec2020 => "lin_rec2020_scene",
            ColourSpace::P3D65 => "lin_p3d65_scene",
            ColourSpace::Xyz => "lin_ciexyzd65_scene",
        }
    }

    /// The matrix from this space to D65-relative XYZ.
    #[must_use]
    pub const fn matrix_to_xyz(self) -> [[f64; 3]; 3] {
        TO_XYZ[self as usize]
    }

    /// The matrix from D65-relative XYZ to this space.
    #[must_use]
    pub const fn matrix_from_xyz(self) -> [[f64; 3]; 3] {
        FROM_XYZ[self as usize]
    }

    /// The matrix from this space to linear Rec.709.
    #[must_use]
    pub const fn to_rec709(self) -> [[f64; 3]; 3] {
        multiply(ColourSpace::Rec709.matrix_from_xyz(), self.matrix_to_xyz())
    }

    /// A D65-relative XYZ colour in this space. Channels may be negative: nothing is clamped.
    #[must_use]
    pub fn from_xyz(self, xyz: [f32; 3]) -> [f32; 3] {
        apply(&FROM_XYZ[self as usize], xyz)
    }

    /// D65-relative XYZ of a colour in this space.
    #[must_use]
    pub fn to_xyz(self, rgb: [f32; 3]) -> [f32; 3] {
        apply(&TO_XYZ[self as usize], rgb)
    }
}

static TO_XYZ: [Matrix; 6] = to_xyz_matrices();
static FROM_XYZ: [Matrix; 6] = from_xyz_matrices();

fn apply(m: &Matrix, v: [f32; 3]) -> [f32; 3] {
    let v = v.map(f64::from);
    std::array::from_fn(|i| (m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2]) as f32)
}

/// The matrix that does `b`, then `a`.
#[must_use]
pub const fn multiply(a: Matrix, b: Matrix) -> Matrix {
    let mut m = [[0.0; 3]; 3];
    let mut i = 0;
    while i < 3 {
        let mut j = 0;
        while j < 3 {
            m[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
            j += 1;
        }
        i += 1;
    }
    m
}

/// The vector `m` v.
#[must_use]
pub const fn times(m: Matrix, v: [f64; 3]) -> [f64; 3] {
    [
        m[0][0] * v[0] + m[0][1] * v[1] + m[0][2] * v[2],
        m[1][0] * v[0] + m[1][1] * v[1] + m[1][2] * v[2],
        m[2][0] * v[0] + m[2][1] * v[1] + m[2][2] * v[2],
    ]
}

/// The inverse by cofactors.
#[must_use]
pub const fn inverse(m: Matrix) -> Matrix {
    let [[a, b, c], [d, e, f], [g, h, i]] = m;
    let determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
    let r = 1.0 / determinant;
    [
        [(e * i - f * h) * r, (c * h - b * i) * r, (b * f - c * e) * r],
        [(f * g - d * i) * r, (a * i - c * g) * r, (c * d - a * f) * r],
        [(d * h - e * g) * r, (b * g - a * h) * r, (a * e - b * d) * r],
    ]
}

/// XYZ of the chromaticity at Y = 1.
const fn xyz_of([x, y]: Xy) -> [f64; 3] {
    [x / y, 1.0, (1.0 - x - y) / y]
}

/// SMPTE RP 177: columns are the primaries, scaled such that (1, 1, 1) is the white at Y = 1.
const fn primaries_matrix(p: [Xy; 4]) -> Matrix {
    // A column needs no scale of its own, so z = 1 − x − y will do: a primary may have y = 0.
    let [r, g, b, white] = p;
    let m = [[r[0], g[0], b[0]], [r[1], g[1], b[1]], [1.0 - r[0] - r[1], 1.0 - g[0] - g[1], 1.0 - b[0] - b[1]]];
    let s = times(inverse(m), xyz_of(white));
    multiply(m, [[s[0], 0.0, 0.0], [0.0, s[1], 0.0], [0.0, 0.0, s[2]]])
}

/// Bradford: cone responses, as Lam 1985 and ICC.1:2022 annex E print the matrix.
const BRADFORD: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

/// Adapts XYZ under the white `from` to the white `to`.
const fn adaptation(from: Xy, to: Xy) -> Matrix {
    let a = times(BRADFORD, xyz_of(from));
    let b = times(BRADFORD, xyz_of(to));
    let scale = [[b[0] / a[0], 0.0, 0.0], [0.0, b[1] / a[1], 0.0], [0.0, 0.0, b[2] / a[2]]];
    multiply(inverse(BRADFORD), multiply(scale, BRADFORD))
}

/// The matrix from XYZ under the light of chromaticity `white` to XYZ under D65, as Bradford has it: that light becomes
/// white. `None` where a cone's response to it is not above zero: of light that pure no white can be made.
#[must_use]
pub fn adapted_to_d65(white: [f64; 2]) -> Option<Matrix> {
    let [x, y] = white;
    let real = x > 0.0 && y > 0.0 && x + y < 1.0;
    (real && times(BRADFORD, xyz_of(white)).iter().all(|response| *response > 0.0)).then(|| adaptation(white, D65))
}

/// Whether two sets of primaries and whites are the same to the digits that standards print.
#[must_use]
pub fn are_same_primaries(a: [Xy; 4], b: [Xy; 4]) -> bool {
    const PRINTED: f64 = 1e-3;
    a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() <= PRINTED)
}

/// The matrix to linear Rec. 709 from RGB with these chromaticities of red, green, blue and white, which becomes D65 as Bradford
/// has it. `None` where they span no colours, or the white is none.
#[must_use]
pub fn rec709_from(primaries: [[f64; 2]; 4]) -> Option<Matrix> {
    let to_xyz = primaries_matrix(primaries);
    let m = multiply(ColourSpace::Rec709.matrix_from_xyz(), multiply(adapted_to_d65(primaries[3])?, to_xyz));
    m.iter().flatten().all(|x| x.is_finite()).then_some(m)
}

/// The matrix from XYZ under D65 to XYZ under D50, the white of ICC profiles.
#[must_use]
pub fn d50_from_d65() -> Matrix {
    // The D50 of profiles, ICC.1:2022 section 7.2.16: X 0.9642, Y 1, Z 0.8249.
    const SUM: f64 = 0.9642 + 1.0 + 0.8249;
    adaptation(D65, [0.9642 / SUM, 1.0 / SUM])
}

const fn to_xyz_matrices() -> [Matrix; 6] {
    let aces = adaptation(ACES_WHITE, D65);
    [
        primaries_matrix(ColourSpace::Rec709.chromaticities()),
        multiply(aces, primaries_matrix(ColourSpace::AcesCg.chromaticities())),
        multiply(aces, primaries_matrix(ColourSpace::Aces2065_1.chromaticities())),
        primaries_matrix(ColourSpace::Rec2020.chromaticities()),
        primaries_matrix(ColourSpace::P3D65.chromaticities()),
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    ]
}

const fn from_xyz_matrices() -> [Matrix; 6] {
    let mut all = to_xyz_matrices();
    let mut i = 0;
    while i < 6 {
        all[i] = inverse(all[i]);
        i += 1;
    }
    all
}

/// The sRGB transfer function: linear light to a coded value, both in [0, 1] (IEC 61966-2-1).
/// Odd about zero, and continued by the same power above one.
#[must_use]
pub fn srgb_encode(linear: f32) -> f32 {
    let x = f64::from(linear.abs());
    (srgb_curve(x) as f32).copysign(linear)
}

/// The curve of sRGB for `linear` ≥ 0, IEC 61966-2-1.
#[must_use]
pub fn srgb_curve(linear: f64) -> f64 {
    if linear <= 0.003_130_8 {
        12.92 * linear
    } else if linear <= 1.0 {
        // Within some ten ulp; previews have three such powers a pixel.
        1.055 * exp_down(log(linear) / 2.4) - 0.055
    } else {
        1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055
    }
}

/// The inverse of [`srgb_encode`]: a coded value to linear light.
#[must_use]
pub fn srgb_decode(coded: f32) -> f32 {
    let x = f64::from(coded.abs());
    let y = if x <= 0.040_45 { x / 12.92 } else { libm::pow((x + 0.055) / 1.055, 2.4) };
    (y as f32).copysign(coded)
}

/// [`srgb_decode`] of each 8-bit code.
#[must_use]
pub fn srgb8_table() -> [f32; 256] {
    std::array::from_fn(|code| srgb_decode((code as f64 / 255.0) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: Matrix, b: Matrix, tolerance: f64) -> bool {
        (0..9).all(|i| (a[i / 3][i % 3] - b[i / 3][i % 3]).abs() < tolerance)
    }

    /// IEC 61966-2-1 prints the inverse to four decimals; ITU-R BT.2087 prints Rec.2020's.
    #[test]
    fn matrices_are_the_printed_ones() {
        let rec709 = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        assert!(close(ColourSpace::Rec709.matrix_to_xyz(), rec709, 5e-5 + 1e-6));
        let rec2020 = [[0.6370, 0.1446, 0.1689], [0.2627, 0.6780, 0.0593], [0.0000, 0.0281, 1.0610]];
        assert!(close(ColourSpace::Rec2020.matrix_to_xyz(), rec2020, 5.1e-5));
        // S-2014-004: AP1 to XYZ under the ACES white; ours has that white adapted to D65.
        let ap1 = [
            [0.662_454_181_1, 0.134_004_206_5, 0.156_187_687_0],
            [0.272_228_716_8, 0.674_081_765_8, 0.053_689_517_4],
            [-0.005_574_649_5, 0.004_060_733_5, 1.010_339_100_3],
        ];
        let own = multiply(adaptation(D65, ACES_WHITE), ColourSpace::AcesCg.matrix_to_xyz());
        assert!(close(own, ap1, 1e-9), "{own:?}");
        // SMPTE ST 2065-1 prints AP0 to ten decimals.
        let ap0 = [
            [0.952_552_395_9, 0.0, 0.000_093_678_6],
            [0.343_966_449_8, 0.728_166_096_6, -0.072_132_546_4],
            [0.0, 0.0, 1.008_825_184_4],
        ];
        let own = multiply(adaptation(D65, ACES_WHITE), ColourSpace::Aces2065_1.matrix_to_xyz());
        assert!(close(own, ap0, 1e-9), "{own:?}");
    }

    /// Illuminant A becomes white, sodium light cannot: its response of the third cone is negative.
    #[test]
    fn a_lamp_is_made_white_unless_it_is_too_pure() {
        let a = [0.447_58, 0.407_45];
        let white = times(adapted_to_d65(a).unwrap(), xyz_of(a));
        for (found, expected) in white.iter().zip(xyz_of(D65)) {
            assert!((found - expected).abs() < 1e-14, "{white:?}");
        }
        assert_eq!(adapted_to_d65([0.569, 0.430]), None);
        assert_eq!(adapted_to_d65([0.0, 0.5]), None);
        assert_eq!(adapted_to_d65([f64::NAN, 0.5]), None);
    }

    /// (1, 1, 1) is D65 in every space, adapted or not, but in XYZ, where it is equal energy.
    #[test]
    fn white_is_white_in_every_space() {
        let white = xyz_of(D65).map(|v| v as f32);
        for space in ColourSpace::ALL.into_iter().filter(|s| *s != ColourSpace::Xyz) {
            for v in space.from_xyz(white) {
                assert!((v - 1.0).abs() < 4e-7, "{space:?} {v}");
            }
        }
    }

    #[test]
    fn to_and_from_are_inverse() {
        for space in ColourSpace::ALL {
            let product = multiply(space.matrix_to_xyz(), space.matrix_from_xyz());
            assert!(close(product, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 1e-14), "{space:?}");
            let rgb = space.from_xyz(space.to_xyz([0.2, 3.0, -0.5]));
            assert!((rgb[0] - 0.2).abs() < 2e-6 && (rgb[1] - 3.0).abs() < 2e-6 && (rgb[2] + 0.5).abs() < 2e-6);
        }
        assert_eq!(ColourSpace::AcesCg.interop_id(), "lin_ap1_scene");
    }

    /// IEC 61966-2-1: code 188 is linear 0.5029 (0.502886…), 0.0031308 meets the power within 1e-7, and every 8-bit
    /// code comes back.
    #[test]
    fn srgb_codes_come_back() {
        let table = srgb8_table();
        for (code, linear) in table.iter().enumerate() {
            assert_eq!((srgb_encode(*linear) * 255.0).round() as usize, code);
        }
        assert!((table[188] - 0.502_886_4).abs() < 1e-6, "{}", table[188]);
        assert_eq!((table[0], table[255]), (0.0, 1.0));
        assert!((srgb_encode(0.003_130_8) - srgb_encode(0.003_130_9)).abs() < 2e-6);
        assert_eq!(srgb_decode(-0.5), -srgb_decode(0.5));
    }
}
