//! How bright the brightest of a scene is, and how far the farthest: by which powers of two sums count light and lengths.

use super::bvh::Aabb;
use super::light::Light;
use super::material::Material;
use super::shape::Shape;
use super::{Geometry, Scene};
use crate::math::sampler::GOLDEN;
use crate::math::warp::{one_minus_cos, uniform_cone};
use crate::math::{Frame, Ray};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Rays that look for what a lamp without extent lights.
const LOOKS: u32 = 64;

/// What is smaller than this part of its distance from the camera is met by no more than one sample in a million: a pixel of a
/// picture of 65,536 columns is a thousand times as wide and as high.
const SPOT: f64 = 1.0 / (1u64 << 27) as f64;

/// Lamps without extent, the strongest, that are asked.
const ASKED: usize = 64;

/// Above the brightest that is judged there are 2¹⁸ more: what glass gathers, a single path of much weight, the one texel of
/// a sun.
const MOST: i32 = 20;

/// Which powers of two sums count numbers over. Those of the brighter scene are greater.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Powers {
    /// The numbers are divided by two to this power.
    pub exponent: i32,
    /// And before they are squared by two to this one besides: sums, which hold less than 2³⁸, have the squares of numbers up
    /// to 2¹⁹ times the greatest that is judged then.
    pub squared: i32,
}

impl Scene {
    /// What light is multiplied by before it is added up; a power of two.
    #[must_use]
    pub fn light_unit(&self) -> f32 {
        f32::from_bits(((127 - self.light_powers.exponent) as u32) << 23)
    }

    /// The powers of two over which sums count the light of the scene, as a film does
    /// ([`crate::film::accumulate::Film::exponent`]): 0 where the brightest of what its lights, of [`Light::power`] `powers`,
    /// and its fog show, and in `whitted` highlights and the `ambient` light, lies between 2⁻²⁴ and 2²⁰. A darker scene is
    /// raised to one, with 2³⁸ left above; a brighter one lowered to 2²⁰, so that all of 2⁻⁶⁰ of the brightest or more keeps
    /// its mantissa. `boxes` are those of the objects.
    pub(super) fn powers_of_light(&self, powers: &[f64], ambient: Option<f64>, boxes: &[Aabb]) -> Powers {
        let lamps = || self.lights.iter().zip(powers.iter().copied());
        let shown = lamps().filter_map(|(light, power)| match light {
            Light::Area { object, .. } | Light::AlongNormal { object, .. } => {
                let Aabb { min, max } = boxes[*object as usize];
                // Of one too small to be seen, what the least that is seen shows. Planes are anywhere.
                let seen = self.seen_at(0.5 * min + 0.5 * max);
                let area = self.objects[*object as usize].geometry.area();
                Some(power / (PI * area.max(seen * seen)))
            }
            Light::Directional { .. } | Light::Constant { .. } | Light::Environment(_) => {
                Some(power / (4.0 * PI * PI * self.radius * self.radius))
            }
            Light::Point { .. } | Light::Spot { .. } | Light::Projector(_) => None,
        });
        let mut cones: Vec<(Cone, f64)> =
            lamps().filter_map(|(light, power)| Some((Cone::of(light)?, power))).collect();
        cones.sort_by(|a, b| b.1.total_cmp(&a.1));
        let lit = cones.iter().take(ASKED).map(|(cone, power)| self.lit(cone, *power));
        let fog = self.fog.as_ref().map(|fog| fog.colour.luminance());
        // Where a white wall shows 1/π of what arrives, a highlight shows its strength.
        let strengths = self.materials.iter().flat_map(Material::leaves).filter_map(|m| Some(m.highlight?.strength));
        let strongest = strengths.fold(0.0, f32::max);
        let highlight = if ambient.is_some() { (PI * f64::from(strongest)).max(1.0) } else { 1.0 };
        let brightness = shown.chain(lit).map(|b| b * highlight).chain(fog).chain(ambient);
        counted_over(brightness.filter(|b| b.is_finite()).fold(0.0, f64::max))
    }

    /// The powers of two over which sums count lengths, in the same way: by how far from the origin and from the camera anything
    /// with an end is, and from the camera a plane.
    pub(super) fn powers_of_lengths(&self) -> Powers {
        let eye = self.camera.eye();
        let planes = self.objects[..self.standing].iter().filter_map(|object| match &object.geometry {
            Geometry::Shape(Shape::Plane(plane)) => Some(plane.height(eye).abs()),
            _ => None,
        });
        let bounded = [self.center.length(), (self.center - eye).length()].map(|middle| middle + self.radius);
        let lengths = bounded.into_iter().chain([eye.length()]).chain(planes);
        counted_over(lengths.filter(|length| length.is_finite()).fold(0.0, f64::max))
    }

    /// How large the least thing is that is seen at `position`, metres.
    fn seen_at(&self, position: DVec3) -> f64 {
        SPOT * (self.camera.world_from_camera.translation - position).length()
    }

    /// About how bright a white wall is where a lamp of `power` lights the nearest thing, film units; or the medium around the
    /// lamp, where that is brighter.
    fn lit(&self, &Cone { position, axis, spread }: &Cone, power: f64) -> f64 {
        let frame = Frame::from_normal(axis);
        let looks = (0..LOOKS).map(|i| {
            // Evenly spread over the cone: Fibonacci's lattice.
            let u = DVec2::new((f64::from(i) + 0.5) / f64::from(LOOKS), (f64::from(i) * GOLDEN).fract());
            let ray = Ray::new(position, frame.to_world(uniform_cone(u, spread)));
            let Some(hit) = self.closest(&ray, f64::INFINITY) else { return (f64::INFINITY, self.camera_medium) };
            let object = &self.objects[hit.object as usize];
            let surface = self.surface_with(&ray, &hit, object.detail);
            (hit.t, object.beyond(&surface, -ray.direction, self.camera_medium))
        });
        let looks: Vec<(f64, Option<u32>)> = looks.collect();
        let nearest = looks.iter().map(|look| look.0).fold(f64::INFINITY, f64::min);
        let mut around: Vec<u32> = looks.iter().filter_map(|look| look.1).collect();
        around.sort_unstable();
        around.dedup();
        let glows = around.iter().map(|medium| self.media[*medium as usize].glows_like_a_wall_at(position));
        let glow = glows.fold(f64::INFINITY, f64::min);
        // A lamp that lies on something, or where two things meet, lights a spot beside it that no pixel sees.
        let seen = self.seen_at(position);
        let distance = match nearest.is_finite() {
            true => nearest.min(glow).max(seen),
            false => (self.center - position).length().max(self.radius).min(glow),
        };
        power / (2.0 * PI * spread * distance * distance) / PI
    }
}

/// The powers of two over which numbers are counted whose greatest is about `most`.
fn counted_over(most: f64) -> Powers {
    if most < f64::MIN_POSITIVE {
        return Powers::default();
    }
    // The exponent of the number.
    let log2 = (most.to_bits() >> 52) as i32 - 1023;
    let exponent = match log2 {
        ..-24 => log2.max(-100),
        MOST.. => (log2 - MOST).min(100),
        _ => 0,
    };
    Powers { exponent, squared: (log2 - exponent).clamp(0, MOST) }
}

/// Where a lamp without extent sends its light.
struct Cone {
    position: DVec3,
    axis: DVec3,
    /// 1 − cos of the half angle.
    spread: f64,
}

impl Cone {
    fn of(light: &Light) -> Option<Cone> {
        let (position, axis, spread) = match light {
            Light::Point { position, .. } => (*position, DVec3::Z, 2.0),
            Light::Spot { position, axis, cutoff, .. } => (*position, *axis, one_minus_cos(*cutoff)),
            Light::Projector(projector) => {
                let cone = projector.cone();
                (cone.apex, cone.axis, one_minus_cos(cone.half_angle))
            }
            _ => return None,
        };
        Some(Cone { position, axis, spread })
    }
}

#[cfg(test)]
mod tests {
    use super::{Powers, counted_over};
    use crate::film::accumulate::{QUANTUM, SAMPLE_LIMIT};
    use crate::scene::compile::testing::compiled;

    fn powers(text: &str) -> Powers {
        compiled(&format!("camera: {{origin: [0, 5, 9], target: [0, 0, 0], fov_deg: 40}}\n{text}")).light_powers
    }

    fn exponent(text: &str) -> i32 {
        powers(text).exponent
    }

    /// A lamp where a ball touches the top of a pole, in whichever order: it lights nothing there that is seen, and the sky of 0.1
    /// has to be counted, too.
    #[test]
    fn a_lamp_where_two_bodies_meet_leaves_the_rest_its_light() {
        let ball = "sphere: {center: [0.1, 2, 0], radius: 0.1}";
        let pole = "cylinder: {base: [0, 0, 0], top: [0, 2, 0], radius: 0.1}";
        for shapes in [[ball, pole], [pole, ball]] {
            let lights = "lights: [constant: {radiance: 0.1}, point: {position: [0, 2, 0], intensity: 10}]";
            let found = exponent(&format!("shapes: [{}, {}]\n{lights}\n", shapes[0], shapes[1]));
            assert!(found <= 31, "{found}");
        }
    }

    /// A lamp of intensity d² at d over a plane lights it by 1 below, whatever d: the film counts as ever. So it does where the
    /// ground is larger than the lamp is far by many orders, and where the lamp is a spot. Nearer than 2⁻²⁷ of what the camera is
    /// far it lights a spot that no pixel sees, and the rest of the plane is dark.
    #[test]
    fn what_a_lamp_lights_is_judged_by_how_far_it_is() {
        for d in [1e-6, 1.0, 1e6, 1e12, 1e18] {
            let lamp = format!("point: {{position: [0, {d:e}, 0], intensity: {:e}}}", d * d);
            assert_eq!(exponent(&format!("shapes: [plane: {{normal: [0, 1, 0]}}]\nlights: [{lamp}]\n")), 0, "{d:e}");
        }
        let ground = "shapes: [sphere: {center: [0, -6371000, 0], radius: 6371000}]\n";
        assert_eq!(exponent(&format!("{ground}lights: [point: {{position: [0, 1, 0], intensity: 100}}]\n")), 0);
        let spot = "spot: {position: [0, 1, 0], target: [0, 0, 0], cutoff_deg: 20, intensity: 100}";
        assert_eq!(exponent(&format!("{ground}lights: [{spot}]\n")), 0);
    }

    /// Smoke around a lamp shows its light, however far the nearest thing is: with a mean free path of 20 m some 1/100 of 10,
    /// where walls at 10⁹ and 10¹⁸ m show 10⁻¹⁸ and 10⁻³⁶ of it. What only absorbs shows none.
    #[test]
    fn smoke_around_a_lamp_is_lit_however_far_the_walls_are() {
        let air =
            "media: {air: {homogeneous: {extinction: 0.05, albedo: 0.9}}, tar: {homogeneous: {absorption: 0.05}}}\n";
        let lamp = "lights: [point: {position: [0, 1, 0], intensity: 10}]\n";
        for far in [1e9, 1e18] {
            let wall = format!("plane: {{point: [0, -{far:e}, 0], normal: [0, 1, 0]}}");
            let around = |medium: &str| exponent(&format!("{air}{lamp}medium: {medium}\nshapes: [{wall}]\n"));
            assert_eq!(around("air"), 0, "{far:e}");
            assert!(around("tar") < -50, "{far:e}: {}", around("tar"));
            let inside = "material: {boundary: {}}, inside: air, outside: vacuum";
            let ball = format!("{air}{lamp}shapes: [sphere: {{radius: {far:e}, {inside}}}]\n");
            assert_eq!(exponent(&ball), 0, "{far:e}");
        }
    }

    /// Of a sky of 1.5 · 2ⁿ sums have the squares of what is 2¹⁸ times as bright, or of all that they hold; from 1 on its own
    /// square is counted as 1.5².
    #[test]
    fn squares_have_room_above_the_brightest() {
        let limit = f64::from(SAMPLE_LIMIT);
        for n in (-60..=100).step_by(5).chain([17, 18, 19, 21]) {
            let sky = 1.5 * 2f64.powi(n);
            let Powers { exponent, squared } =
                powers(&format!("shapes: [sphere: {{radius: 1}}]\nlights: [constant: {{radiance: {sky:e}}}]\n"));
            let most = (sky * 2f64.powi(18 - exponent)).min(limit.next_down());
            assert!((most / 2f64.powi(squared)).powi(2) < limit, "2^{n}: {exponent}, {squared}");
            assert!(n < 0 || exponent + squared == n, "2^{n}: {exponent}, {squared}");
        }
    }

    /// Of 2⁻⁶⁴ between 2⁻²⁴ and 2²⁰; else of 2⁻⁶⁴ or 2⁻⁸⁴ of the brightest or less, down to half of that.
    #[test]
    fn light_is_counted_in_the_steps_that_the_limits_tell() {
        for (brightest, most) in [
            (1e-30, 5e-50),
            (1e-20, 5e-40),
            (5.9e-8, 5e-20 * 5.9e-8),
            (6e-8, 5e-20),
            (1.0, 5e-20),
            (1e6, 5e-20),
            (2e6, 5e-26 * 2e6),
            (1e20, 5e-6),
            (1e36, 5e10),
        ] {
            let step = QUANTUM * 2f64.powi(counted_over(brightest).exponent);
            let share = step / most;
            assert!((0.5..=1.1).contains(&share), "{brightest:e}: {step:e}, {share} of {most:e}");
        }
    }

    /// Light of 2⁻⁵⁰ and of 2⁵⁰ is counted in powers of two that bring it into reach.
    #[test]
    fn dark_and_bright_scenes_are_brought_into_reach() {
        let lamp = |intensity: f64| {
            exponent(&format!(
                "shapes: [plane: {{normal: [0, 1, 0]}}]\nlights: [point: {{position: [0, 1, 0], intensity: {intensity:e}}}]\n"
            ))
        };
        // ρ/π is left out: 2⁻⁵⁰/π, and the nearest of the looks is a little aslant.
        assert!((-53..=-51).contains(&lamp(2f64.powi(-50))), "{}", lamp(2f64.powi(-50)));
        assert!((27..=29).contains(&lamp(2f64.powi(50))), "{}", lamp(2f64.powi(50)));
        // Fog shines, too: its luminance is near its number.
        let fog = |colour: f64| {
            exponent(&format!("shapes: [plane: {{normal: [0, 1, 0]}}]\nfog: {{colour: {colour:e}, density: 0.1}}\n"))
        };
        assert!((29..=31).contains(&fog(2f64.powi(50))), "{}", fog(2f64.powi(50)));
        assert!((-51..=-49).contains(&fog(2f64.powi(-50))), "{}", fog(2f64.powi(-50)));
        // And so does the ambient light of `whitted`, beside a lamp of 2⁻⁵⁰ as well.
        let ambient = |ambient: f64| {
            let lamp = format!("point: {{position: [0, 1, 0], intensity: {:e}}}", 2f64.powi(-50));
            exponent(&format!("integrator: {{whitted: {{ambient: {ambient:e}}}}}\nlights: [{lamp}]\n"))
        };
        assert!((29..=31).contains(&ambient(2f64.powi(50))), "{}", ambient(2f64.powi(50)));
        assert_eq!(ambient(0.5), 0);
        // And so do its highlights, of 2⁵⁰ π/π where a white wall shows 1; of `path` there are none.
        let highlight = |integrator: &str, strength: f64| {
            let material = format!("{{mirror: {{highlight: {{strength: {strength:e}}}}}}}");
            let lamp = format!("point: {{position: [0, 1, 0], intensity: {}}}", std::f64::consts::PI);
            exponent(&format!(
                "integrator: {integrator}\nlights: [{lamp}]\n\
                 shapes: [plane: {{normal: [0, 1, 0], material: {{mask: {{opacity: 0.5, material: {material}}}}}}}]\n"
            ))
        };
        let strength = 2f64.powi(50) / std::f64::consts::PI;
        let found = highlight("whitted", strength);
        assert!((29..=31).contains(&found), "{found}");
        assert_eq!((highlight("path", strength), highlight("whitted", 50.0)), (0, 0));
    }
}
