//! Cameras. Camera space: +x right on the picture, +y up, +z the way it looks.

use crate::math::{Ray, warp};
use glam::{DAffine3, DMat4, DVec2, DVec3, DVec4};

/// A camera.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Camera space to world; a rotation and a translation. A picture is not mirrored: world x to
    /// the right of a viewer at +z looking along −z.
    pub world_from_camera: DAffine3,
    /// How directions come about.
    pub projection: Projection,
    /// The full picture, in pixels.
    pub resolution: [u32; 2],
    /// A lens focused at a distance; `None` for a pinhole, which a lens of radius zero is.
    pub lens: Option<Lens>,
    /// Distances along the axis between which the camera sees, metres: 0 and infinity where nothing is cut away.
    /// Rays begin at the first.
    pub clip: [f64; 2],
    /// Where the axis meets the picture, from its middle to the right and down, in widths and heights.
    pub principal_point: DVec2,
    /// What follows for every ray.
    view: View,
}

/// What of a camera's rays does not depend on the ray.
#[derive(Clone, Copy, Debug)]
struct View {
    /// Where the axis meets the picture, in pixels.
    middle: DVec2,
    /// In the world, of the picture at distance one (a perspective) or where it is (parallel rays): a pixel to the
    /// right, a pixel down.
    right: DVec3,
    down: DVec3,
    /// The axis in the world, as long as the matrix makes it, and of unit length.
    axis: DVec3,
    unit_axis: DVec3,
    /// Of a point off the camera, how far along the axis the plane of its depth is: across the camera's x and y, so the unit axis,
    /// but where a matrix shears.
    depth: DVec3,
    /// Where the axis meets the near clipping plane.
    near: DVec3,
    /// The clipping planes in units of the camera, which a matrix may make as long as the axis.
    clip: [f64; 2],
    /// Radii of the lens along x and y, and the distance of its plane of focus, in the same units; without a lens zero and one.
    aperture: DVec2,
    focus: f64,
    /// World to camera space.
    camera_from_world: DAffine3,
}

/// A thin lens.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// Radius in metres.
    pub radius: f64,
    /// Distance of the plane of focus along the axis, metres.
    pub focus_distance: f64,
}

/// How a point on the picture becomes a direction.
#[derive(Clone, Copy, Debug)]
pub enum Projection {
    /// From one point; half the width of the picture at distance one.
    Perspective {
        /// tan of half the horizontal field of view.
        half_width: f64,
    },
    /// Parallel; half the width of the picture in metres.
    Orthographic {
        /// Metres.
        half_width: f64,
    },
}

/// A way into the camera.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Where the light falls on the picture; (0, 0) is the corner of the top left pixel. May lie outside.
    pub pixel: DVec2,
    /// From the point toward the camera, unit.
    pub direction: DVec3,
    /// From the point to where the camera's rays begin, metres.
    pub distance: f64,
    /// Pixels per m² across `direction` at the point.
    pub density: f64,
}

/// Which extent of the picture an angle of view spans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FovAxis {
    /// The width.
    #[default]
    X,
    /// The height.
    Y,
    /// The smaller of both.
    Smaller,
    /// The larger of both.
    Larger,
    /// The diagonal.
    Diagonal,
}

impl Projection {
    /// A perspective of `fov` radians along `axis` for a picture of `resolution`.
    #[must_use]
    pub fn perspective(fov: f64, axis: FovAxis, resolution: [u32; 2]) -> Projection {
        let (w, h) = (f64::from(resolution[0]), f64::from(resolution[1]));
        let extent = match axis {
            FovAxis::X => w,
            FovAxis::Y => h,
            FovAxis::Smaller => w.min(h),
            FovAxis::Larger => w.max(h),
            FovAxis::Diagonal => (w * w + h * h).sqrt(),
        };
        Projection::Perspective { half_width: libm::tan(0.5 * fov) * w / extent }
    }
}

impl Camera {
    /// A camera of these parts; see the fields.
    #[must_use]
    pub fn new(
        world_from_camera: DAffine3,
        projection: Projection,
        resolution: [u32; 2],
        lens: Option<Lens>,
        clip: [f64; 2],
        principal_point: DVec2,
    ) -> Camera {
        let size = DVec2::new(f64::from(resolution[0]), f64::from(resolution[1]));
        let (Projection::Perspective { half_width } | Projection::Orthographic { half_width }) = projection;
        let side = 2.0 * half_width / size.x;
        let m = world_from_camera.matrix3;
        let axis_length = m.z_axis.length();
        let local_clip = clip.map(|distance| distance / axis_length);
        let lens = lens.filter(|lens| lens.radius > 0.0);
        let (radius, focus_distance) = lens.map_or((0.0, axis_length), |lens| (lens.radius, lens.focus_distance));
        let camera_from_world = world_from_camera.inverse();
        let view = View {
            middle: (DVec2::splat(0.5) + principal_point) * size,
            right: m.x_axis * side,
            down: m.y_axis * -side,
            axis: m.z_axis,
            unit_axis: m.z_axis.normalize(),
            depth: camera_from_world.matrix3.row(2) * axis_length,
            near: world_from_camera.translation + m.z_axis * local_clip[0],
            clip: local_clip,
            aperture: radius / DVec2::new(m.x_axis.length(), m.y_axis.length()),
            focus: focus_distance / axis_length,
            camera_from_world,
        };
        Camera { world_from_camera, projection, resolution, lens, clip, principal_point, view }
    }

    /// Where the ray through the middle of the lens begins.
    #[must_use]
    pub fn eye(&self) -> DVec3 {
        self.view.near
    }

    /// Where it looks: the axis, unit.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        self.view.unit_axis
    }

    /// The same camera, moved by `step`, metres.
    #[must_use]
    pub fn moved(&self, step: DVec3) -> Camera {
        let Camera { mut world_from_camera, projection, resolution, lens, clip, principal_point, .. } = *self;
        world_from_camera.translation += step;
        Camera::new(world_from_camera, projection, resolution, lens, clip, principal_point)
    }

    /// Where the camera stands and looks; `None` where `target` is `origin` or `up` is along the view.
    #[must_use]
    pub fn look_at(origin: DVec3, target: DVec3, up: DVec3) -> Option<DAffine3> {
        let z = (target - origin).try_normalize()?;
        let x = z.cross(up).try_normalize()?;
        let y = x.cross(z);
        // Three columns of a rotation whose x points right: (x, y, z) is left-handed.
        Some(DAffine3::from_cols(x, y, z, origin))
    }

    /// The ray through `pixel` (continuous; (0, 0) is the corner of the top left one) and the point
    /// `lens` of the unit square.
    #[must_use]
    #[inline]
    pub fn ray(&self, pixel: DVec2, lens: impl FnOnce() -> DVec2) -> Ray {
        let view = &self.view;
        let place = pixel - view.middle;
        let across = view.right * place.x + view.down * place.y;
        let (origin, direction) = match (self.lens, self.projection) {
            (Some(_), _) => self.through_lens(place, warp::concentric_disk(lens()) * view.aperture),
            (None, Projection::Perspective { .. }) => {
                (view.near + across * view.clip[0], (view.axis + across).normalize())
            }
            (None, Projection::Orthographic { .. }) => (view.near + across, view.unit_axis),
        };
        Ray::new(origin, direction)
    }

    /// Origin and direction of the ray through a point of the picture, in pixels from its middle, and a point of the
    /// lens, in the camera's units.
    #[inline(never)]
    fn through_lens(&self, place: DVec2, on_lens: DVec2) -> (DVec3, DVec3) {
        let (Projection::Perspective { half_width } | Projection::Orthographic { half_width }) = self.projection;
        let plane = DVec2::new(place.x, -place.y) * (2.0 * half_width / f64::from(self.resolution[0]));
        let (mut origin, direction) = match self.projection {
            Projection::Perspective { .. } => (DVec3::ZERO, plane.extend(1.0)),
            Projection::Orthographic { .. } => (plane.extend(0.0), DVec3::Z),
        };
        // Every ray of a pixel meets in the plane of focus.
        let focus = origin + direction * self.view.focus;
        origin += on_lens.extend(0.0);
        let direction = focus - origin;
        origin += direction * (self.view.clip[0] / direction.z);
        let to_world = self.world_from_camera;
        (to_world.transform_point3(origin), to_world.transform_vector3(direction).normalize())
    }

    /// How far along one of the camera's rays it sees, metres: to the far clipping plane.
    #[must_use]
    #[inline]
    pub fn reach(&self, ray: &Ray) -> f64 {
        if self.clip[1] == f64::INFINITY {
            return f64::INFINITY;
        }
        (self.clip[1] - self.clip[0]) / ray.direction.dot(self.view.depth)
    }

    /// How light from `point` enters the camera through the point `lens` of the unit square of its lens; `None` where
    /// the camera does not look.
    ///
    /// A pixel is the mean of L over its filter h, I = ∫ L h dx with x in pixels. Seen from one point of the lens,
    /// x moves over the plane at distance one as directions do: dx = dω / (s² cos³θ), with s the side of a pixel
    /// there (Veach 1997, 8.2). Parallel rays through an area dA across them pass dx = dA / s².
    #[must_use]
    pub fn entry(&self, point: DVec3, lens: impl FnOnce() -> DVec2) -> Option<Entry> {
        let w = f64::from(self.resolution[0]);
        let local = self.view.camera_from_world.transform_point3(point);
        if !(local.z > 0.0 && local.z >= self.view.clip[0] && local.z <= self.view.clip[1]) {
            return None;
        }
        let aperture = self.lens.map_or(DVec2::ZERO, |_| warp::concentric_disk(lens()) * self.view.aperture);
        let focus = self.view.focus;
        let (half_width, plane, origin, density) = match self.projection {
            Projection::Perspective { half_width } => {
                // The ray meets the plane of focus where the ray of a pinhole does.
                let slope = (local.truncate() - aperture) / local.z;
                let secant2 = 1.0 + slope.length_squared();
                let distance2 = local.z * local.z * secant2;
                let side = 2.0 * half_width / w;
                (half_width, slope + aperture / focus, aperture, secant2 * secant2.sqrt() / (side * side * distance2))
            }
            Projection::Orthographic { half_width } => {
                // From one point of the lens all rays are parallel.
                let slope = -aperture / focus;
                let place = local.truncate() - aperture - slope * local.z;
                let side = 2.0 * half_width / w;
                let m = self.world_from_camera.matrix3;
                // Area across the rays in the world, of a unit of area of the picture: a matrix may stretch.
                let toward = m * slope.extend(1.0);
                let stretch = m.determinant().abs() / toward.length();
                (half_width, place, place + aperture, 1.0 / (side * side * stretch))
            }
        };
        let pixel = self.on_picture(plane / half_width);
        // Rays begin at the near clipping plane.
        let start = origin.extend(0.0);
        let begin = start + (local - start) * (self.view.clip[0] / local.z);
        let offset = self.world_from_camera.transform_point3(begin) - point;
        let whole = self.world_from_camera.transform_point3(start) - point;
        let wi = whole.try_normalize()?;
        Some(Entry { pixel, direction: wi, distance: offset.length(), density })
    }

    /// Where the middle of the lens sees `point`, wherever the clipping planes are; `None` behind an eye.
    #[must_use]
    pub fn place_of(&self, point: DVec3) -> Option<DVec2> {
        let local = self.view.camera_from_world.transform_point3(point);
        let plane = match self.projection {
            Projection::Perspective { half_width } if local.z > 0.0 => local.truncate() / (local.z * half_width),
            Projection::Perspective { .. } => return None,
            Projection::Orthographic { half_width } => local.truncate() / half_width,
        };
        Some(self.on_picture(plane))
    }

    /// Where the middle of the lens sees what is infinitely far in `direction`; `None` behind the camera, and where parallel
    /// rays all look into one direction.
    #[must_use]
    pub fn vanishing_point(&self, direction: DVec3) -> Option<DVec2> {
        let Projection::Perspective { half_width } = self.projection else { return None };
        let local = self.view.camera_from_world.transform_vector3(direction);
        (local.z > 0.0).then(|| self.on_picture(local.truncate() / (local.z * half_width)))
    }

    /// In pixels what is at `place`: from the middle to the right and up, in halves of the picture's width.
    fn on_picture(&self, place: DVec2) -> DVec2 {
        let size = DVec2::new(f64::from(self.resolution[0]), f64::from(self.resolution[1]));
        (DVec2::new(place.x, -place.y) * size.x + size) * 0.5 + self.principal_point * size
    }

    /// World to camera for row vectors, row by row, as EXR files and RenderMan have it: +x right, +y up,
    /// +z forward.
    #[must_use]
    pub fn camera_from_world(&self) -> [f32; 16] {
        DMat4::from(self.view.camera_from_world).to_cols_array().map(|x| x as f32)
    }

    /// World to the picture for row vectors: x and y from (0, 0) at the top left to (1, 1).
    #[must_use]
    pub fn ndc_from_world(&self) -> [f32; 16] {
        let aspect = f64::from(self.resolution[0]) / f64::from(self.resolution[1]);
        let middle = DVec2::splat(0.5) + self.principal_point;
        let ndc_from_camera = match self.projection {
            // x/z from −half_width…half_width to 0…1; y/z likewise, downward.
            Projection::Perspective { half_width } => {
                let s = 0.5 / half_width;
                DMat4::from_cols(
                    DVec4::new(s, 0.0, 0.0, 0.0),
                    DVec4::new(0.0, -s * aspect, 0.0, 0.0),
                    DVec4::new(middle.x, middle.y, 1.0, 1.0),
                    DVec4::ZERO,
                )
            }
            Projection::Orthographic { half_width } => {
                let s = 0.5 / half_width;
                DMat4::from_cols(
                    DVec4::new(s, 0.0, 0.0, 0.0),
                    DVec4::new(0.0, -s * aspect, 0.0, 0.0),
                    DVec4::new(0.0, 0.0, 1.0, 0.0),
                    DVec4::new(middle.x, middle.y, 0.0, 1.0),
                )
            }
        };
        (ndc_from_camera * DMat4::from(self.view.camera_from_world)).to_cols_array().map(|x| x as f32)
    }

    /// The frame in the plane at distance one before the camera, in its space: x and y of the middle, and the width. `None` where
    /// it sees along parallel lines.
    #[must_use]
    pub fn screen_window(&self) -> Option<[f32; 3]> {
        let Projection::Perspective { half_width } = self.projection else { return None };
        let width = 2.0 * half_width;
        let height = width * f64::from(self.resolution[1]) / f64::from(self.resolution[0]);
        let middle = self.principal_point * DVec2::new(-width, height);
        Some([middle.x, middle.y, width].map(|x| x as f32))
    }

    /// Distance of `point` along the axis, metres, whatever the scale of the camera's own coordinates: the same all over a plane of
    /// its x and y, as the clipping planes are.
    #[must_use]
    pub fn depth(&self, point: DVec3) -> f64 {
        (point - self.world_from_camera.translation).dot(self.view.depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use std::f64::consts::SQRT_2;

    fn camera(lens: Option<Lens>) -> Camera {
        clipped(lens, 0.0)
    }

    fn clipped(lens: Option<Lens>, near: f64) -> Camera {
        let resolution = [200, 100];
        Camera::new(
            Camera::look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y).unwrap(),
            Projection::perspective(90f64.to_radians(), FovAxis::X, resolution),
            resolution,
            lens,
            [near, f64::INFINITY],
            DVec2::ZERO,
        )
    }

    /// 90° across 200 pixels, looking along −z: the left edge is at x = −z, the top at y = z/2.
    #[test]
    fn corners_of_the_picture_look_where_they_should() {
        let corner = |x, y| camera(None).ray(DVec2::new(x, y), || unreachable!()).direction;
        let top_left = DVec3::new(-1.0, 0.5, -1.0).normalize();
        assert!((corner(0.0, 0.0) - top_left).length() < 4.0 * f64::EPSILON);
        assert!((corner(200.0, 100.0) - top_left * DVec3::new(-1.0, -1.0, 1.0)).length() < 4.0 * f64::EPSILON);
        assert!((corner(100.0, 50.0) + DVec3::Z).length() < 4.0 * f64::EPSILON);
    }

    /// What a lens costs, one without extent does not.
    #[test]
    fn a_lens_of_radius_zero_is_a_pinhole() {
        let lens = |radius| camera(Some(Lens { radius, focus_distance: 4.0 })).lens;
        assert!(lens(0.0).is_none() && lens(1e-9).is_some());
    }

    /// And begin in the near plane, of which they cross as much of the lens as is left there: a quarter a metre before the focus.
    #[test]
    fn all_rays_of_a_lens_meet_in_the_plane_of_focus() {
        let lens = Lens { radius: 0.5, focus_distance: 4.0 };
        let pixel = DVec2::new(30.0, 80.0);
        let focus = DVec3::new(-0.7, -0.3, -1.0) * 4.0;
        for (near, u) in
            [0.0, 3.0].into_iter().flat_map(|near| [[0.0, 0.0], [0.9, 0.1], [0.5, 0.99]].map(|u| (near, u)))
        {
            let ray = clipped(Some(lens), near).ray(pixel, || DVec2::from(u));
            let t = (focus - ray.origin).dot(ray.direction);
            assert!((ray.at(t) - focus).length() < 16.0 * f64::EPSILON);
            assert!((ray.origin.z + near).abs() < 16.0 * f64::EPSILON);
            let beside = (ray.origin - focus * (near / 4.0)).length();
            assert!(beside <= 0.5 * (1.0 - near / 4.0) + 16.0 * f64::EPSILON, "{near}: {beside}");
        }
    }

    /// Lens and focus have their metres where a matrix makes the camera larger: 0.5 m about the axis and 4 m before it, and light goes the
    /// same ways in and out. Numbers below ten after a dozen of roundings.
    #[test]
    fn a_lens_keeps_its_size_in_a_camera_that_is_scaled() {
        let lens = Some(Lens { radius: 0.5, focus_distance: 4.0 });
        let projection = Projection::Orthographic { half_width: 1.0 };
        for [x, y, z] in [[1.0, 1.0, 1.0], [2.0, 3.0, 1.0], [1.0, 1.0, 2.0], [2.0, 2.0, 0.5]] {
            let matrix = DAffine3::from_scale(DVec3::new(x, y, z));
            let camera = Camera::new(matrix, projection, [200, 100], lens, [0.0, f64::INFINITY], DVec2::ZERO);
            let pixel = DVec2::new(130.0, 20.0);
            let middle = camera.ray(pixel, || DVec2::splat(0.5));
            let mut widest: f64 = 0.0;
            for u in (0..64).map(|i| DVec2::new(f64::from(i % 8) + 0.5, f64::from(i / 8) + 0.5) / 8.0) {
                let ray = camera.ray(pixel, || u);
                widest = widest.max((ray.origin - middle.origin).length());
                let focus = ray.at(4.0 / ray.direction.z);
                assert!((focus - middle.at(4.0)).length() < 1e-13, "{x} {y} {z}: {focus}");
                let entry = camera.entry(ray.at(7.0), || u).unwrap();
                assert!((entry.pixel - pixel).length() < 1e-11, "{x} {y} {z}: {}", entry.pixel);
            }
            // The outermost of the 64 places.
            assert!((0.4..=0.5).contains(&widest), "{x} {y} {z}: {widest}");
        }
    }

    /// A camera that looks down and leans by 45°: its axis is √2 m long for each metre down, so what is n metres below it has a depth
    /// of n √2 m, wherever it is in the picture and however a lens slants the ray; and so have the clipping planes, for rays
    /// and for light that comes in. Numbers below ten after a dozen of roundings.
    #[test]
    fn planes_of_depth_lie_across_a_camera_that_a_matrix_shears() {
        let leaning = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(1.0, 0.0, -1.0));
        let projection = Projection::Orthographic { half_width: 1.0 };
        let clip = [1.0, 4.0].map(|down| down * SQRT_2);
        for lens in [None, Some(Lens { radius: 1.0, focus_distance: 3.0 })] {
            let camera =
                Camera::new(DAffine3::from_mat3(leaning), projection, [200, 100], lens, clip, DVec2::new(0.1, 0.2));
            let pixels = [[0.0, 0.0], [200.0, 0.0], [130.0, 20.0], [200.0, 100.0]].map(DVec2::from);
            let places = [[0.5, 0.5], [0.0, 0.0], [0.9, 0.1]].map(DVec2::from);
            for (pixel, u) in pixels.into_iter().flat_map(|pixel| places.map(|u| (pixel, u))) {
                let ray = camera.ray(pixel, || u);
                let reach = camera.reach(&ray);
                let [near, middle, far] = [0.0, 0.5 * reach, reach].map(|t| ray.at(t));
                assert!((near.z + 1.0).abs() < 1e-13 && (far.z + 4.0).abs() < 1e-13, "{near} {far}");
                assert!((camera.depth(middle) + middle.z * SQRT_2).abs() < 1e-13, "{middle}");
                let enters = |part: f64| camera.entry(ray.at(part * reach), || u).is_some();
                assert_eq!([0.01, 0.99, 1.01].map(enters), [true, true, false]);
            }
        }
    }

    #[test]
    fn looking_along_up_or_nowhere_is_refused() {
        assert!(Camera::look_at(DVec3::ZERO, DVec3::Y, DVec3::Y).is_none());
        assert!(Camera::look_at(DVec3::X, DVec3::X, DVec3::Y).is_none());
    }

    /// A point on the ray through a pixel falls on that pixel's share of the picture.
    #[test]
    fn the_matrix_to_the_picture_agrees_with_the_rays() {
        let camera = camera(None);
        let pixel = DVec2::new(30.0, 80.0);
        let p = camera.ray(pixel, || unreachable!()).at(7.0);
        let m = camera.ndc_from_world().map(f64::from);
        // Row vectors: (p, 1) · M, row by row.
        let row = |j: usize| p.x * m[j] + p.y * m[4 + j] + p.z * m[8 + j] + m[12 + j];
        let ndc = DVec2::new(row(0), row(1)) / row(3);
        // Sixteen f32 roundings of numbers of size one.
        assert!((ndc - DVec2::new(0.15, 0.8)).length() < 16.0 * f64::from(f32::EPSILON), "{ndc}");
    }

    /// 90° across 200 pixels is a window of width 2; where the axis is 20 pixels right of the middle and 10 below it, the middle is 0.2 to
    /// the left of the axis and 0.1 above. The ray through a corner meets that of the window.
    #[test]
    fn the_screen_window_is_what_the_rays_pass() {
        let Camera { world_from_camera, projection, resolution, .. } = camera(None);
        let place = DVec2::new(0.1, 0.1);
        let camera = Camera::new(world_from_camera, projection, resolution, None, [0.0, f64::INFINITY], place);
        let [x, y, width] = camera.screen_window().unwrap();
        assert_eq!([x, y, width], [-0.2, 0.1, 2.0]);
        let corner = camera.ray(DVec2::ZERO, || unreachable!()).direction;
        // The camera looks along −z; the window is half as high as wide.
        let [right, up] = [corner.x, corner.y].map(|x| x / -corner.z);
        assert!((right - f64::from(x - 0.5 * width)).abs() < 1e-6 && (up - f64::from(y + 0.25 * width)).abs() < 1e-6);
        let parallel = Projection::Orthographic { half_width: 1.0 };
        let parallel = Camera::new(world_from_camera, parallel, resolution, None, [0.0, f64::INFINITY], place);
        assert!(parallel.screen_window().is_none());
    }

    #[test]
    fn depth_is_measured_along_the_axis() {
        assert_eq!(camera(None).depth(DVec3::new(3.0, 9.0, -5.0)), 5.0);
    }
}
