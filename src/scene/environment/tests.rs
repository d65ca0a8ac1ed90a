use super::*;
use crate::film::Window;
use crate::film::exr::ExrPart;
use crate::math::warp;
use crate::spectrum::LANES;
use std::path::Path;

fn bright_spot(mapping: Mapping) -> Environment {
    let (w, h) = (16, 8);
    let pixels: Vec<[f32; 3]> =
        (0..w * h).map(|i| if i == 3 * w + 11 { [50.0; 3] } else { [0.1 + 0.01 * (i % 7) as f32; 3] }).collect();
    Environment::new(&pixels, [w, h], 1.0, mapping, DMat3::from_rotation_y(0.7), Carried::Spectra)
}

fn ways() -> impl Iterator<Item = (Mapping, Drawn)> {
    let drawn = [Drawn::All, Drawn::Brighter];
    [Mapping::Texels, Mapping::Poles].into_iter().flat_map(move |mapping| drawn.map(|drawn| (mapping, drawn)))
}

fn green(map: &Environment, direction: DVec3) -> f64 {
    f64::from(map.radiance(direction.normalize(), Lanes::splat(550.0)).to_array()[0])
}

#[test]
fn density_of_sampled_directions_is_the_stated_one() {
    for (mapping, drawn) in ways() {
        let map = bright_spot(mapping);
        for u in warp::midpoints(64) {
            let s = map.sample(u, drawn).unwrap();
            assert!((s.direction.length() - 1.0).abs() < 1e-14);
            let pdf = map.pdf(s.direction, drawn);
            // On the border of a cell rounding may pick the neighbour.
            let border = mapping == Mapping::Texels && u.x * 64.0 % 4.0 < 1.0;
            assert!((pdf / s.pdf_solid_angle - 1.0).abs() < 1e-9 || border, "{mapping:?} {u} {pdf} {s:?}");
        }
    }
}

/// ∫ pdf dω = 1, over 512² midpoints of a function that is smooth in each of 128 cells: each
/// cell border is off by at most half a step of 1/512 in one dimension.
#[test]
fn density_integrates_to_one() {
    for (mapping, drawn) in ways() {
        let map = bright_spot(mapping);
        let mean = warp::midpoints(512).map(|u| map.pdf(warp::uniform_sphere(u), drawn)).sum::<f64>() / 262_144.0;
        assert!((mean * 4.0 * PI - 1.0).abs() < 5e-3, "{}", mean * 4.0 * PI);
    }
}

/// What is found by sampling the map is what an even sweep over directions finds. The samples are a
/// Kronecker sequence (a lattice would beat with the cells): its error falls as 1/N, 65 536 leave 1e-3.
#[test]
fn sampled_and_uniform_directions_find_the_same_light() {
    for mapping in [Mapping::Texels, Mapping::Poles] {
        let map = bright_spot(mapping);
        let at = |u| map.sample(u, Drawn::All).map_or(0.0, |s| green(&map, s.direction) / s.pdf_solid_angle);
        let irrational = |i: u32| (DVec2::new(0.754_877_666, 0.569_840_291) * f64::from(i)).fract();
        let sampled = (0..65536).map(|i| at(irrational(i))).sum::<f64>() / 65536.0;
        let swept = warp::midpoints(512).map(|u| green(&map, warp::uniform_sphere(u))).sum::<f64>() / 262_144.0;
        assert!((sampled / (4.0 * PI * swept) - 1.0).abs() < 2e-3, "{mapping:?} {sampled} {}", 4.0 * PI * swept);
    }
}

#[test]
fn the_middle_column_looks_along_minus_z_and_the_top_row_up() {
    let (w, h) = (8, 4);
    let mut pixels = vec![[0.0; 3]; w * h];
    pixels[..w].fill([1.0; 3]);
    pixels[2 * w + 4] = [4.0; 3];
    let map = Environment::new(&pixels, [w, h], 1.0, Mapping::Texels, DMat3::IDENTITY, Carried::Spectra);
    assert!(green(&map, DVec3::Y) > 0.5 && green(&map, -DVec3::Y) < 1e-6);
    // The centre of column 4 of 8 lies half a column (22.5°) to the right of −z.
    let (s, c) = (PI / 8.0).sin_cos();
    let down = -PI / 8.0;
    let d = DVec3::new(s * down.cos(), down.sin(), -c * down.cos());
    assert!(green(&map, d) > 3.0 && green(&map, d * DVec3::new(-1.0, 1.0, 1.0)) < 0.5);
}

/// Rows 0 and h − 1 are the poles themselves; the left edge is −z, so that column 0 of 4 lies 45°
/// to the right of it (toward +x), and halfway across the seam the first and the last column share.
#[test]
fn rows_reach_the_poles_and_columns_go_around_where_mitsuba_has_them() {
    let (w, h) = (4, 3);
    let mut grey = [1.0f32; 12];
    grey[..4].fill(3.0);
    grey[8..].fill(5.0);
    (grey[4], grey[7]) = (2.0, 4.0);
    let map = Environment::new(&grey.map(|g| [g; 3]), [w, h], 1.0, Mapping::Poles, DMat3::IDENTITY, Carried::Spectra);
    let unit = map.illuminant.at(550.0);
    let find = |d: DVec3| green(&map, d) / unit;
    let cases = [
        (DVec3::Y, 3.0),
        (-DVec3::Y, 5.0),
        (DVec3::new(1.0, 0.0, -1.0), 2.0),
        (DVec3::new(-1.0, 0.0, -1.0), 4.0),
        (DVec3::new(0.0, 0.0, -1.0), 3.0),
        // Halfway from the equator to the pole.
        (DVec3::new(1.0, 2f64.sqrt(), -1.0), 2.5),
    ];
    for (direction, expected) in cases {
        // Greys are flat spectra: f32 sigmoids and D65's f32 table.
        assert!((find(direction) / expected - 1.0).abs() < 1e-5, "{direction} {} {expected}", find(direction));
    }
}

/// A map that is black but for a pole of three rows, whose light falls to nothing at the equator: of an even one it has
/// ∫₀^{π/2} (1 − 2θ/π) sin θ dθ / 2 = (1 − 2/π) / 2.
#[test]
fn a_map_whose_poles_alone_shine_is_no_dark_one() {
    let mean = |rows: [f32; 3]| {
        let pixels: Vec<_> = rows.iter().flat_map(|g| [[*g; 3]; 4]).collect();
        Environment::new(&pixels, [4, 3], 1.0, Mapping::Poles, DMat3::IDENTITY, Carried::Spectra).mean_luminance()
    };
    for rows in [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]] {
        let (share, expected) = (mean(rows) / mean([1.0; 3]), 0.5 * (1.0 - 2.0 / PI));
        // Greys are sigmoids in f32.
        assert!((share / expected - 1.0).abs() < 1e-5, "{rows:?}: {share} {expected}");
    }
}

/// One row and two: the last one again. Halfway from the first to the second the equator is not yet.
#[test]
fn the_last_row_is_repeated_until_there_are_three() {
    let at = |rows: &[f32], angle: f64| {
        let pixels: Vec<_> = rows.iter().flat_map(|g| [[*g; 3]; 2]).collect();
        let size = [2, rows.len()];
        let map = Environment::new(&pixels, size, 1.0, Mapping::Poles, DMat3::IDENTITY, Carried::Spectra);
        let (sin, cos) = angle.to_radians().sin_cos();
        green(&map, DVec3::new(0.0, cos, -sin)) / map.illuminant.at(550.0)
    };
    for (rows, angle, expected) in
        [(&[1.0, 2.0][..], 0.0, 1.0), (&[1.0, 2.0], 45.0, 1.5), (&[1.0, 2.0], 91.0, 2.0), (&[3.0], 60.0, 3.0)]
    {
        assert!((at(rows, angle) / expected - 1.0).abs() < 1e-5, "{rows:?} {angle}: {}", at(rows, angle));
    }
}

/// Between a black and a white texel the colour and the factor are each half: a quarter of the white.
#[test]
fn colour_and_brightness_are_mixed_apart_where_mitsuba_does() {
    let mut pixels = [[0.0; 3]; 6];
    (pixels[0], pixels[2], pixels[4]) = ([1.0; 3], [1.0; 3], [1.0; 3]);
    let at =
        |mapping| green(&Environment::new(&pixels, [2, 3], 1.0, mapping, DMat3::IDENTITY, Carried::Spectra), -DVec3::Z);
    let unit = illuminant::d65().at(550.0);
    assert!((at(Mapping::Poles) / unit - 0.25).abs() < 1e-5);
    assert!((at(Mapping::Texels) / unit - 0.5).abs() < 1e-5);
}

/// Four texels of 1 at 400 nm and 3 at 500 nm: 2 at 450 nm, times the scale, with no illuminant. All are whole numbers.
#[test]
fn a_spectral_sky_shines_as_much_as_its_scale_says() {
    let plane = |name: &str, value| (name.to_owned(), vec![value; 4]);
    let part = ExrPart {
        name: None,
        window: Window::full(2, 2),
        channels: vec![plane("S0.400nm", 1.0), plane("S0.500nm", 3.0)],
        integers: Vec::new(),
        texts: Vec::new(),
    };
    for (scale, expected) in [(1.0, 2.0), (2.0, 4.0)] {
        for mapping in [Mapping::Texels, Mapping::Poles] {
            let bands = Bands::of(Path::new("sky.exr"), &part).unwrap().unwrap();
            let map = Environment::of_bands(bands, [2, 2], scale, mapping, DMat3::IDENTITY).unwrap();
            assert_eq!(map.radiance(DVec3::X, Lanes::splat(450.0)).to_array(), [expected; LANES], "{mapping:?}");
        }
    }
}

/// Light between the centres of texels spreads half a texel beyond a bright one, over its eight neighbours, around the
/// seam and at the poles: directions are drawn there, too. The 128² directions lie 16 to a texel's side or closer.
#[test]
fn every_direction_that_shines_may_be_drawn() {
    let (w, h) = (16, 8);
    for mapping in [Mapping::Texels, Mapping::Poles] {
        for bright in [3 * w + 11, 4 * w, 5 * w + w - 1, 2, 7 * w + 9] {
            let pixels: Vec<[f32; 3]> = (0..w * h).map(|i| [if i == bright { 50.0 } else { 0.0 }; 3]).collect();
            let map = Environment::new(&pixels, [w, h], 1.0, mapping, DMat3::IDENTITY, Carried::Spectra);
            let shining = warp::midpoints(128).map(warp::uniform_sphere).filter(|d| green(&map, *d) > 0.0);
            let densities: Vec<f64> = shining.map(|d| map.pdf(d, Drawn::All)).collect();
            assert!(densities.len() > 16 && densities.iter().all(|pdf| *pdf > 0.0), "{mapping:?} {bright}");
        }
    }
}

#[test]
fn an_even_map_is_drawn_as_a_whole() {
    for mapping in [Mapping::Texels, Mapping::Poles] {
        let map = Environment::new(&[[0.3; 3]; 128], [16, 8], 1.0, mapping, DMat3::IDENTITY, Carried::Spectra);
        assert_eq!(map.brighter_luminance(), map.mean_luminance());
        let direction = DVec3::new(0.3, 0.4, 0.5).normalize();
        assert_eq!(map.pdf(direction, Drawn::Brighter), map.pdf(direction, Drawn::All));
        assert!(map.sample(DVec2::splat(0.3), Drawn::Brighter).is_some());
    }
}

#[test]
fn a_black_map_is_never_sampled() {
    for mapping in [Mapping::Texels, Mapping::Poles] {
        let map = Environment::new(&[[0.0; 3]; 8], [4, 2], 1.0, mapping, DMat3::IDENTITY, Carried::Spectra);
        assert!(
            map.sample(DVec2::splat(0.5), Drawn::All).is_none()
                && map.sample(DVec2::splat(0.5), Drawn::Brighter).is_none()
        );
    }
}
