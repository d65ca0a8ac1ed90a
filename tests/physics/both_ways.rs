//! Near grazing angles a path goes both ways at glass: it is reflected, and goes in.

use super::common::{Bench, SPREAD_NM, assert_close, bench_with, ray, v, wavelengths};
use abbe::math::sampler::Sampler;
use abbe::optics::fresnel::{self, Model};

/// Glass with a lamp of radiance 5 in it, under a sky of radiance 1.
fn lamp_in(ior: &str, packets: &str) -> Bench {
    bench_with(
        &format!(
            "camera: {{origin: [0, 1, 3], target: [0, 0, 0], fov_deg: 5}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             render: {{techniques: {{light_tracing: off, packets: {packets}}}}}\nshapes:\n\
             - cube: {{center: [0, -1, 0], size: [20, 2, 20], material: {{dielectric: {{ior: {ior}}}}}}}\n\
             - cube: {{center: [0, -1, 0], size: [18, 1.9, 18], emission: 5, material: {{diffuse: {{reflectance: 0}}}}}}\n"
        ),
        &[],
    )
}

/// Each sample is F + 5 T / η², within the roundings of a few factors in f32, at 80°, 78° and 76° to the normal, where F is more than 0.3
/// for an index of 1.8 on. Wavelengths that part bring that in packets; of heroes the first of the eight, which leads, is eight times as
/// bright by what goes in, and the others have F alone.
#[test]
fn what_is_mirrored_and_what_is_within_are_in_every_sample() {
    // The index at 360 nm, and what it loses to 830 nm.
    for (ior, packets, [most, loses], together) in [
        ("1.8", "off", [1.8, 0.0], None),
        ("2.4", "on", [2.4, 0.0], None),
        ("{table: [[360, 2], [830, 1.8]]}", "on", [2.0, 0.2], Some(true)),
        ("{table: [[360, 2], [830, 1.8]]}", "off", [2.0, 0.2], Some(false)),
    ] {
        let bench = lamp_in(ior, packets);
        for degrees in [76.0_f64, 78.0, 80.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let toward = ray(v(-4.0 * sin, 4.0 * cos, 0.0), v(0.0, 0.0, 0.0));
            for index in 0..32 {
                let light =
                    bench.incoming(&toward, &wavelengths(SPREAD_NM), &Sampler::new(3, [0, 0], 0, index)).radiance;
                for (lane, (found, nm)) in light.to_array().into_iter().zip(SPREAD_NM).enumerate() {
                    let eta = most - loses * (nm - 360.0) / 470.0;
                    let reflected = fresnel::dielectric(Model::Exact, cos, eta).reflected;
                    assert!(reflected > 0.3, "{reflected}");
                    let times = match together {
                        Some(false) if lane == 0 => 8.0,
                        Some(false) => 0.0,
                        _ => 1.0,
                    };
                    let expected = reflected + times * 5.0 * (1.0 - reflected) / (eta * eta);
                    assert_close(f64::from(found), expected, 8.0 * f64::from(f32::EPSILON) * expected);
                }
            }
        }
    }
}

/// Of forty panes of glass in a row, all at 80°, a path goes both ways at one: with each it would be 2⁴⁰ paths before roulette ends them.
#[test]
fn a_path_goes_both_ways_once() {
    let panes: String = (0..40)
        .map(|i| {
            format!(
                "- cube: {{center: [0, {}, 0], size: [1000, 0.1, 1000], material: {{dielectric: {{ior: 1.9}}}}}}\n",
                -i
            )
        })
        .collect();
    let bench = bench_with(
        &format!(
            "camera: {{origin: [0, 1, 3], target: [0, 0, 0], fov_deg: 5}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             integrator: {{path: {{roulette_depth: 1000, max_depth: 200}}}}\nrender: {{techniques: {{light_tracing: off}}}}\nshapes:\n{panes}"
        ),
        &[],
    );
    let (sin, cos) = 80f64.to_radians().sin_cos();
    let toward = ray(v(-4.0 * sin, 1.0 + 4.0 * cos, 0.0), v(0.0, 1.0, 0.0));
    let events = (0..64).map(|index| {
        let found = bench.incoming(&toward, &wavelengths(SPREAD_NM), &Sampler::new(3, [0, 0], 0, index));
        // Nothing is lost of even light but what goes on after 200 segments.
        assert!(found.radiance.to_array().into_iter().all(|light| (0.0..=1.0 + 1e-5).contains(&light)));
        found.events
    });
    let most = events.max().unwrap();
    assert!(most > 2 && most <= 400, "{most}");
}
