//! Matrices of turns that were written with few digits.

use glam::{DMat3, DMat4};

use super::Import;
use super::object::Bag;
use super::parse::ABOUT_ONE;

impl Import<'_> {
    /// The matrix nearest to `to_world` that moves, mirrors, turns and scales by `scale`, which is told; `None` where `to_world` is
    /// another but for its digits.
    pub(super) fn turned(&mut self, bag: &Bag<'_>, to_world: DMat4, scale: f64) -> Option<DMat4> {
        let unit = DMat3::from_mat4(to_world) * scale.recip();
        let turn = nearest_turn(unit)?;
        let off = farthest(unit, turn);
        let message =
            format!("to_world: it is a turn but for its digits; the nearest is taken, whose axes are {off:.1e} off");
        self.notes.push((bag.place("to_world"), message));
        let [x, y, z] = [turn.x_axis, turn.y_axis, turn.z_axis].map(|axis| (axis * scale).extend(0.0));
        Some(DMat4::from_cols(x, y, z, to_world.w_axis))
    }
}

/// The turn, or turn in a mirror, nearest to `linear`, the factor U of its polar decomposition U S; `None` where an axis is farther
/// from it than [`ABOUT_ONE`]: half a unit of the third decimal in each of three numbers is 8.7·10⁻⁴.
fn nearest_turn(linear: DMat3) -> Option<DMat3> {
    // So near to one, products of axes are off by twice as much and the square, and what is that can be inverted.
    let off = linear.transpose() * linear - DMat3::IDENTITY;
    if !off.to_cols_array().into_iter().all(|x| x.abs() <= 3.0 * ABOUT_ONE) {
        return None;
    }
    // Newton's iteration X ← (X + X⁻ᵀ) / 2 leaves half the square of what is off at each step: of 10⁻³ some 10⁻²⁶ after three.
    let step = |x: DMat3| (x + x.inverse().transpose()) * 0.5;
    let turn = step(step(step(linear)));
    (farthest(linear, turn) <= ABOUT_ONE).then_some(turn)
}

/// How far an axis is from the same of another map, at the most.
fn farthest(a: DMat3, b: DMat3) -> f64 {
    let off = a - b;
    [off.x_axis, off.y_axis, off.z_axis].into_iter().fold(0.0, |most: f64, axis| most.max(axis.length()))
}

#[cfg(test)]
mod tests {
    use super::super::super::{EnvironmentLight, Light, TransformStep};
    use super::super::tests::{fault, good};
    use super::*;
    use glam::DVec3;

    /// Turns by 25, 40 and 10 degrees about x, y and z in turn, as C's `%.3f` to `%.5f` print them.
    const PRINTED: [&str; 3] = [
        "0.754 0.110 0.647 -3.235 0.133 0.940 -0.315 1.575 -0.643 0.324 0.694 -3.471 0.000 0.000 0.000 1.000",
        "0.7544 0.1101 0.6471 -3.2355 0.1330 0.9397 -0.3150 1.5752 -0.6428 0.3237 0.6943 -3.4714 0.0000 0.0000 0.0000 1.0000",
        "0.75441 0.11015 0.64710 -3.23550 0.13302 0.93971 -0.31504 1.57518 -0.64279 0.32374 0.69427 -3.47136 0 0 0 1",
    ];

    fn transform(steps: &str) -> String {
        format!("<transform name=\"to_world\">{steps}</transform>")
    }

    /// Mitsuba 3.9.1 reads all, and shows the picture of six digits.
    #[test]
    fn turns_of_three_digits_are_the_nearest_turns() {
        let z = DVec3::new(0.6471, -0.315037, 0.694272);
        for (printed, off) in PRINTED.into_iter().zip([1e-3, 1e-4, 1e-5]) {
            let place = transform(&format!("<matrix value=\"{printed}\"/>"));
            let doubled = transform(&format!("<scale value=\"2\"/><matrix value=\"{printed}\"/>"));
            let emitter = |plugin: &str, inside: &str| format!("<emitter type=\"{plugin}\">{inside}</emitter>");
            let map = format!("<string name=\"filename\" value=\"a.exr\"/>{place}");
            let lights = emitter("spot", &doubled) + &emitter("projector", &place) + &emitter("envmap", &map);
            let scene = good(&lights);
            let [Light::Spot(spot), Light::Projector(slide), Light::Environment(sky)] = &scene.lights[..] else {
                panic!("{:?}", scene.lights)
            };
            assert!((spot.axis() - 2.0 * z).length() <= 2.0 * off && (spot.axis().length() - 2.0).abs() <= 2.0 * off);
            let along = DVec3::from(slide.target) - DVec3::from(slide.origin);
            assert!((along - z).length() <= off && (along.length() - 1.0).abs() < 1e-14, "{along}");
            assert!(is_turn(map_of(sky)), "{printed}");
            let told = scene.locator.notes();
            let told: Vec<_> =
                told.iter().filter(|note| note.contains("to_world: it is a turn but for its digits")).collect();
            assert_eq!(told.len(), 3, "{told:?}");
            let sky = good(&emitter("sunsky", &place));
            let Light::Sky(sky) = &sky.lights[0] else { panic!("a sky") };
            assert!(is_turn(sky.world_from_sky()), "{printed}");
        }
    }

    /// Cameras of four digits keep the matrix that they have.
    #[test]
    fn a_camera_of_three_digits_is_the_nearest_turn() {
        for (printed, is_told) in PRINTED.into_iter().zip([true, false, false]) {
            let place = transform(&format!("<matrix value=\"{printed}\"/>"));
            let scene = good(&format!(
                "<sensor type=\"thinlens\"><float name=\"aperture_radius\" value=\"0.1\"/>{place}</sensor>"
            ));
            let told =
                scene.locator.notes().iter().any(|note| note.contains("to_world: it is a turn but for its digits"));
            assert_eq!(told, is_told, "{printed}");
        }
    }

    #[test]
    fn what_is_no_turn_is_still_refused() {
        for steps in ["<scale value=\"1.002\"/>", "<matrix value=\"1 0.003 0 0 1 0 0 0 1\"/>", "<scale value=\"0\"/>"] {
            for plugin in ["projector", "sunsky"] {
                let told = fault(&format!("<emitter type=\"{plugin}\">{}</emitter>", transform(steps)), &[]);
                assert!(
                    told.contains("expected turns, moves and mirrors, found a transform that scales or shears"),
                    "{told}"
                );
            }
        }
        let mirrored = DMat3::from_diagonal(DVec3::new(-1.0004, 1.0, 0.9996));
        let turn = nearest_turn(mirrored).unwrap();
        assert!(farthest(turn, DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0))) < 1e-14, "{turn}");
        assert_eq!(nearest_turn(DMat3::from_diagonal(DVec3::new(1e200, 1e-200, 1.0))), None);
        assert_eq!(nearest_turn(DMat3::from_cols_array(&[f64::NAN; 9])), None);
    }

    fn map_of(sky: &EnvironmentLight) -> DMat3 {
        let [TransformStep::Matrix(_)] = sky.transform[..] else { panic!("one matrix") };
        DMat3::from_mat4(sky.transform[0].matrix())
    }

    fn is_turn(map: DMat3) -> bool {
        let off = map.transpose() * map - DMat3::IDENTITY;
        off.to_cols_array().into_iter().all(|x| x.abs() < 1e-14)
    }
}
