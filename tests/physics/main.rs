//! Scenes whose answer is known: the derivation stands above the number.
//!
//! Where chance has no part, each sample is held to the answer within the rounding of f32; elsewhere
//! the mean is, within four standard errors from independent replicates.

#[path = "../common/mod.rs"]
mod common;

mod both_ways;
mod caustics;
mod channels;
mod dispersion;
mod ends;
mod equiangular;
mod films;
mod fog;
mod furnace;
mod glass;
mod glints;
mod indices;
mod lights;
mod media;
mod mirrored;
mod nested;
mod pictures;
mod reuse;
mod seen;
mod shadow_rays;
mod splatting;
mod techniques;
mod traced;
mod volumes;

use abbe::math::sampler::Sampler;
use common::{Bench, SPREAD_NM, bench_with, ray, v, wavelengths};
use glam::DVec3;

/// A lamp that reflects nothing, for shapes: fields of a flow map.
const LAMP: &str = "emission: 1, material: {diffuse: {reflectance: 0}}";

/// A shape of unit size, alone in light that comes from everywhere with radiance 1. A camera that
/// looks at its middle sees nothing else.
fn in_even_light(shapes: &str) -> Bench {
    bench_with(
        &format!(
            "camera: {{origin: [0.3, 0.5, 5], target: [0, 0, 0], fov_deg: 10}}\n\
         lights: [{{constant: {{radiance: 1}}}}]\nrender: {{samples: 16}}\nimage: {{width: 8, height: 8}}\nshapes: {shapes}\n"
        ),
        &[],
    )
}

/// Half the picture's rays in a plane of the eye, from grazing the unit sphere to its middle.
fn across_the_unit_sphere() -> impl Iterator<Item = (DVec3, DVec3)> {
    (0..64).map(|i| {
        let b = f64::from(i) / 64.0;
        (v(b, 0.0, 5.0), v(b, 0.0, 0.0))
    })
}

/// Of each ray across shapes of glass in even light of 1, every sample sums to 8 over its lanes, whichever parted.
fn assert_invisible_in_every_sample(shapes: &str) {
    let scene = in_even_light(shapes);
    for (from, to) in across_the_unit_sphere() {
        for index in 0..32 {
            let sampler = Sampler::new(3, [0, 0], 0, index);
            let light = scene.incoming(&ray(from, to), &wavelengths(SPREAD_NM), &sampler).radiance;
            let sum: f64 = light.to_array().iter().map(|x| f64::from(*x)).sum();
            assert!((sum / 8.0 - 1.0).abs() < 2e-5, "{shapes} at {to}, sample {index}: {sum}");
        }
    }
}
