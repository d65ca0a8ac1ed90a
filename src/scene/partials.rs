//! How texture coordinates run over a surface.

use super::shape::exact::difference_of_products;
use super::shape::{Detail, SurfacePoint};
use super::{Geometry, Hit, Scene};
use crate::math::Ray;
use glam::{DMat2, DVec2, DVec3};

/// A frame of the tangent plane, and the derivatives of (u, v) along its axes, 1/m.
#[derive(Clone, Copy, Debug)]
pub struct UvGradient {
    /// First axis, unit.
    pub s: DVec3,
    /// Second axis, unit; s × t is the normal.
    pub t: DVec3,
    /// Columns: ∂(u, v)/∂s and ∂(u, v)/∂t.
    pub gradient: DMat2,
    /// Columns: ∂p/∂u and ∂p/∂v in those axes, m; `None` where u and v do not tell points apart.
    along: Option<DMat2>,
}

impl UvGradient {
    /// ∂p/∂u and ∂p/∂v in metres; the axes themselves where u and v do not tell points apart (a pole, a mesh
    /// without texture coordinates of its own).
    #[must_use]
    pub fn partials(&self) -> [DVec3; 2] {
        let Some(along) = self.along else { return [self.s, self.t] };
        [along.x_axis, along.y_axis].map(|d| self.s * d.x + self.t * d.y)
    }

    /// How much (u, v) changes over `offset` in the tangent plane.
    #[must_use]
    pub fn change(&self, offset: DVec3) -> DVec2 {
        self.gradient * DVec2::new(offset.dot(self.s), offset.dot(self.t))
    }
}

impl Scene {
    /// The surface at a hit with its texture coordinates, whether or not anything on it varies.
    #[must_use]
    pub fn surface_with_texture(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        self.surface_with(ray, hit, Detail::Texture)
    }

    /// How (u, v) runs over the surface at a hit.
    ///
    /// On shapes and triangles exactly. On curves by central differences over 2⁻¹³ of their thickness: off by the square of that, 1e-8,
    /// for the curvature of u and v, and by their rounding.
    #[must_use]
    pub fn uv_gradient(&self, hit: &Hit, surface: &SurfacePoint) -> UvGradient {
        let tangent = surface.tangent - surface.normal * surface.tangent.dot(surface.normal);
        let s = tangent.normalize();
        let t = surface.normal.cross(s);
        // The child of an instance knows its own space only.
        let map = self.instance_map(hit);
        let (point, axes) = match map {
            None => (surface.point, [s, t]),
            Some(m) => {
                let m = m.object_from_world();
                (m.transform_point3(surface.point), [s, t].map(|axis| m.transform_vector3(axis)))
            }
        };
        let gradient = match &self.objects[hit.object as usize].geometry {
            Geometry::Shape(shape) => {
                let [s, t] = axes.map(|axis| shape.uv_rates(point, hit.part as u8, axis));
                DMat2::from_cols(s, t)
            }
            // No texture coordinates.
            Geometry::Sdf(_) => DMat2::ZERO,
            Geometry::Curves(curves) => {
                let size = curves.thickness(hit.part, hit.barycentric[0]);
                let uv = |p: DVec3| curves.surface(p, hit.part, hit.barycentric[0]).uv;
                differences(point, axes, size, uv)
            }
            Geometry::Mesh(mesh) => {
                let [a, b, c] = mesh.mesh.vertices(hit.part);
                let [of_a, of_b, of_c] = mesh.mesh.texture_corners(hit.part);
                let flat = |d: DVec3| {
                    let d = map.map_or(d, |m| m.world_from_object().transform_vector3(d));
                    DVec2::new(d.dot(s), d.dot(t))
                };
                let edges = DMat2::from_cols(flat(b - a), flat(c - a));
                let (u, v) = (of_b - of_a, of_c - of_a);
                let gradient = DMat2::from_cols(u, v) * edges.inverse();
                // Texture coordinates on a line are told by their own determinant, which is zero then: that of the gradient is
                // what rounding leaves.
                let det = difference_of_products(u.x, v.y, u.y, v.x);
                let adjugate = DMat2::from_cols(DVec2::new(v.y, -u.y), DVec2::new(-v.x, u.x));
                let along = edges * adjugate * (1.0 / det);
                return UvGradient { s, t, gradient, along: Some(along).filter(DMat2::is_finite) };
            }
            Geometry::Instance(_) => DMat2::ZERO,
        };
        UvGradient { s, t, gradient, along: Some(gradient.inverse()).filter(DMat2::is_finite) }
    }
}

/// Derivatives of `uv` at `point` along two axes by central differences over 2⁻¹³ of `size`. Angles may pass from one turn to none
/// in between.
fn differences(point: DVec3, axes: [DVec3; 2], size: f64, uv: impl Fn(DVec3) -> DVec2) -> DMat2 {
    let [s, t] = axes.map(|axis| {
        let step = size.max(f64::MIN_POSITIVE) / 8192.0 / axis.length();
        let d = uv(point + axis * step) - uv(point - axis * step);
        DVec2::new(nearest_turn(d.x), nearest_turn(d.y)) / (2.0 * step)
    });
    DMat2::from_cols(s, t)
}

/// `d` less the nearest whole number.
fn nearest_turn(d: f64) -> f64 {
    d - d.round()
}

#[cfg(test)]
mod tests {
    use crate::math::{Frame, Ray, warp};
    use crate::scene::compile::testing::compiled;
    use glam::DVec3;

    /// What is thin, e to a length of 2, has ∂p/∂u and ∂p/∂v of its own measures: once around a wire of radius e are 2πe, on a cone
    /// at 0.35 of its height below the apex 0.35 of that, on an ellipse at 0.3 of its half width 0.3 of it, and on a unit sphere at
    /// the polar distance e, sin e for e. What is hit is known to a few 2⁻⁵² of the distance to the eye, 5.
    #[test]
    fn texture_coordinates_run_over_thin_shapes_by_their_own_measures() {
        const TAU: f64 = std::f64::consts::TAU;
        for e in [0.5, 1e-3, 1e-5, 1e-8] {
            let ends = "base: [-1, 0, 0]";
            let side = format!("{{translate: [0, {}, 0]}}", -0.5 * e);
            let (above, over) = (DVec3::new(0.3, 0.0, 5.0), DVec3::NEG_Z);
            for (form, measures, eye, direction) in [
                (format!("cylinder: {{{ends}, top: [1, 0, 0], radius: {e:?}}}"), [TAU * e, 2.0], above, over),
                (
                    format!("cone: {{{ends}, apex: [1, 0, 0], radius: {e:?}}}"),
                    [0.35 * TAU * e, 2f64.hypot(e)],
                    above,
                    over,
                ),
                (
                    format!(
                        "rectangle: {{corner: [-1, 0, 0], edge_u: [2, 0, 0], edge_v: [0, {e:?}, 0], transform: [{side}]}}"
                    ),
                    [2.0, e],
                    above,
                    over,
                ),
                (format!("cube: {{size: [2, {e:?}, 2]}}"), [2.0, e], above, over),
                (
                    format!("disk: {{normal: [0, 0, 1], radius: 1, transform: [{{scale: [1, {e:?}, 1]}}]}}"),
                    [1.0, 0.3 * TAU * e],
                    above,
                    over,
                ),
                (
                    "sphere: {radius: 1}".to_owned(),
                    [TAU * libm::sin(e), 0.5 * TAU],
                    DVec3::new(libm::sin(e), 5.0, 0.0),
                    DVec3::NEG_Y,
                ),
            ] {
                let text =
                    format!("camera: {{origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40}}\nshapes: [{{{form}}}]\n");
                let scene = compiled(&text);
                let ray = Ray::new(eye, direction);
                let hit = scene.closest(&ray, f64::INFINITY).unwrap();
                let partials = scene.uv_gradient(&hit, &scene.surface_with_texture(&ray, &hit)).partials();
                for (partial, measure) in partials.iter().zip(measures) {
                    let off = partial.length() / measure - 1.0;
                    assert!(off.abs() < 1e-14 + 64.0 * f64::EPSILON / e, "{form}: {partial} for {measure}");
                }
            }
        }
    }

    /// Points 1e-5 beside each other lie ∂p/∂u Δu + ∂p/∂v Δv apart, wherever a form stands and however it is turned, to the second order:
    /// 1e-5 over the distance to where u and v bend, which is above 1e-3.
    #[test]
    fn texture_coordinates_run_as_points_do() {
        for form in [
            "sphere: {center: [1, 2, 3], radius: 0.5}",
            "cylinder: {base: [1, 2, 3], top: [1.3, 3, 3.2], radius: 0.5}",
            "cone: {base: [1, 2, 3], apex: [1.3, 3, 3.2], radius: 0.5}",
            "disk: {center: [1, 2, 3], normal: [1, 2, 3], radius: 0.5}",
            "cube: {center: [1, 2, 3], size: [0.5, 0.9, 0.7]}",
            "rectangle: {corner: [1, 2, 3], edge_u: [0.5, 0.1, 0], edge_v: [0.1, 0.7, 0.2]}",
        ] {
            let text = format!("camera: {{origin: [0, 1, 9], target: [0, 0, 0], fov_deg: 40}}\nshapes: [{{{form}}}]\n");
            let scene = compiled(&text);
            let mut met = 0;
            for toward in warp::midpoints(16).map(warp::uniform_sphere) {
                let at = |beside: DVec3| {
                    let ray = Ray::new(DVec3::new(1.1, 2.3, 3.1) - toward * 5.0 + beside, toward);
                    let hit = scene.closest(&ray, f64::INFINITY)?;
                    Some((hit, scene.surface_with_texture(&ray, &hit)))
                };
                let beside = Frame::from_normal(toward).s * 1e-5;
                let (Some((hit, here)), Some((other, there))) = (at(DVec3::ZERO), at(beside)) else { continue };
                let (uv, moved) = (there.uv - here.uv, there.point - here.point);
                // Not across an edge or a seam.
                if hit.part != other.part || uv.abs().max_element() > 0.5 {
                    continue;
                }
                let [du, dv] = scene.uv_gradient(&hit, &here).partials();
                let told = du * uv.x + dv * uv.y;
                assert!((told - moved).length() < 1e-2 * moved.length(), "{form} {toward}: {told} for {moved}");
                met += 1;
            }
            assert!(met > 32, "{form}: {met}");
        }
    }

    /// u and v of a plane are metres, however far from the origin: ∂p/∂u and ∂p/∂v are unit vectors that stand on each other, to
    /// the rounding of u, 2⁻⁵³ of some coordinate over 2⁻¹² of it.
    #[test]
    fn texture_coordinates_of_a_plane_run_alike_everywhere() {
        let text =
            "camera: {origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40}\nshapes: [plane: {normal: [0, 1, 0]}]\n";
        let scene = compiled(text);
        for x in [1.0, 1500.0, 3000.0, -9000.0, 1e7] {
            let ray = Ray::new(DVec3::new(x, 1.0, 0.3 * x), DVec3::NEG_Y);
            let hit = scene.closest(&ray, f64::INFINITY).unwrap();
            let [du, dv] = scene.uv_gradient(&hit, &scene.surface_with_texture(&ray, &hit)).partials();
            let off = [du.length() - 1.0, dv.length() - 1.0, du.dot(dv)];
            assert!(off.into_iter().all(|off| off.abs() < 1e-11), "{x}: {du} {dv}");
        }
    }
}
