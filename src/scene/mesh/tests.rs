use super::*;
use crate::math::Ray;
use crate::math::sampler::mix64;

/// A stream of numbers in [0, 1), for tests.
pub(super) struct Numbers(u64);

impl Numbers {
    pub(super) fn new(seed: u64) -> Numbers {
        Numbers(seed)
    }

    pub(super) fn next(&mut self) -> f64 {
        self.0 += 1;
        (mix64(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(super) fn direction(&mut self) -> DVec3 {
        warp::uniform_sphere(DVec2::new(self.next(), self.next()))
    }
}

fn mesh(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Mesh {
    let source = MeshSource { positions, triangles, ..MeshSource::default() };
    Mesh::new(&source, &DAffine3::IDENTITY, NormalMode::Face, Winding::Object).unwrap()
}

/// A grid of `n` × `n` cells, its corners placed by `place` on the unit square.
fn grid(n: u32, place: impl Fn(DVec2) -> DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let corner = |i: u32, j: u32| i * (n + 1) + j;
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            positions.push(place(DVec2::new(f64::from(i), f64::from(j)) / f64::from(n)));
        }
    }
    for i in 0..n {
        for j in 0..n {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    (positions, triangles)
}

/// Rough terrain of 131 072 triangles and a dented sphere of 125 000 above it.
fn landscape() -> Mesh {
    let noise =
        |p: DVec3| (7.0 * p.x).sin() * (9.0 * p.y).cos() + 0.3 * (31.0 * p.x + 17.0 * p.z).sin() * (37.0 * p.y).sin();
    let (mut positions, mut triangles) = grid(256, |u| {
        let p = DVec3::new(4.0 * u.x - 2.0, 4.0 * u.y - 2.0, 0.0);
        p + DVec3::Z * (0.2 * noise(p))
    });
    let first = positions.len() as u32;
    let (sphere, faces) = grid(250, |u| {
        let (turn, polar) = (u.x * std::f64::consts::TAU, u.y * std::f64::consts::PI);
        let d = DVec3::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos());
        DVec3::Z + d * (0.6 + 0.03 * noise(2.0 * d))
    });
    positions.extend(sphere);
    triangles.extend(faces.iter().map(|t| t.map(|v| v + first)));
    mesh(positions, triangles)
}

/// Seconds that this thread has been on a processor; wall time where the system does not say.
fn busy_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let busy = stat.and_then(|s| s.split_whitespace().next()?.parse::<f64>().ok());
    busy.map_or_else(|| std::time::UNIX_EPOCH.elapsed().map_or(0.0, |d| d.as_secs_f64()), |ns| ns * 1e-9)
}

/// Speed, one thread: `cargo test --release --lib mesh_speed -- --ignored --nocapture`.
#[test]
#[ignore = "prints figures"]
fn mesh_speed() {
    let mesh = landscape();
    let started = std::time::Instant::now();
    let tree = MeshTree::build(&mesh);
    println!(
        "{} triangles, build {:?}, {} B a triangle",
        mesh.triangles.len(),
        started.elapsed(),
        tree.bytes() / mesh.triangles.len()
    );
    let mut numbers = Numbers::new(1);
    let n = 1_000_000;
    let table = AreaTable::new(&mesh);
    let scattered: Vec<(Ray, u32)> = (0..n)
        .map(|_| {
            let i = table.sample(numbers.next()).unwrap().0;
            let at = mesh.sample_area(i, DVec2::new(numbers.next(), numbers.next()));
            let d = Frame::from_normal(at.normal)
                .to_world(warp::cosine_hemisphere(DVec2::new(numbers.next(), numbers.next())));
            (Ray::new(at.point, d), i)
        })
        .collect();
    let camera: Vec<(Ray, u32)> = (0..n)
        .map(|k| {
            let (x, y) = (f64::from(k % 1000) / 1000.0 - 0.5, f64::from(k / 1000) / 1000.0 - 0.5);
            (Ray::new(DVec3::new(0.0, -6.0, 2.0), DVec3::new(x, 1.5, y - 0.4).normalize()), u32::MAX)
        })
        .collect();
    let bounces: Vec<(Ray, u32)> = camera
        .iter()
        .filter_map(|(ray, _)| {
            let found = tree.closest(ray, f64::INFINITY, None)?;
            let at = mesh.surface(found.triangle, found.hit.b1, found.hit.b2);
            let normal = if ray.direction.dot(at.normal) < 0.0 { at.normal } else { -at.normal };
            let d = warp::cosine_hemisphere(DVec2::new(numbers.next(), numbers.next()));
            Some((Ray::new(at.point, Frame::from_normal(normal).to_world(d)), found.triangle))
        })
        .collect();
    for (name, rays) in [("scattered", &scattered), ("bounce", &bounces), ("camera", &camera)] {
        for _ in 0..3 {
            let n = rays.len() as f64;
            let started = busy_seconds();
            let hits = rays.iter().filter(|(r, i)| tree.closest(r, f64::INFINITY, Some(*i)).is_some()).count();
            let closest = n / (busy_seconds() - started) * 1e-6;
            let started = busy_seconds();
            let any = rays.iter().filter(|(r, i)| tree.any(r, f64::INFINITY, [Some(*i), None])).count();
            let speed = n / (busy_seconds() - started) * 1e-6;
            println!("{name}: closest {closest:.2} Mrays/s, any {speed:.2} Mrays/s, hits {hits} {any}");
            assert_eq!(hits, any);
        }
    }
}

/// An icosphere of 20 · 4ⁿ triangles; `place` takes the unit sphere to where the vertices go.
fn icosphere(n: u32, place: impl Fn(DVec3) -> DVec3) -> Mesh {
    let p = 0.5 * (1.0 + 5f64.sqrt());
    let mut positions: Vec<DVec3> = Vec::new();
    for s in [-1.0, 1.0] {
        for q in [-p, p] {
            positions.extend([DVec3::new(0.0, s, q), DVec3::new(s, q, 0.0), DVec3::new(q, 0.0, s)]);
        }
    }
    let mut triangles = Vec::new();
    // The edges have length 2; three vertices with all distances 2 are a face.
    for i in 0..12u32 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [i, j, k].map(|v| positions[v as usize]);
                if [a.distance(b), b.distance(c), c.distance(a)].iter().all(|d| (d - 2.0).abs() < 1e-9) {
                    let outward = (b - a).cross(c - a).dot(a) > 0.0;
                    triangles.push(if outward { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    for _ in 0..n {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push(positions[a as usize] + positions[b as usize]);
                positions.len() as u32 - 1
            })
        };
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    mesh(positions.iter().map(|p| place(p.normalize())).collect(), triangles)
}

/// Rays from inside a closed mesh, aimed exactly at vertices, at points of edges, or anywhere,
/// all hit: through the hierarchy, for meshes of 1e-4 to 1e4 m, up to 1e5 sizes from the origin.
#[test]
fn a_closed_mesh_does_not_leak() {
    let mut numbers = Numbers::new(11);
    let mut leaks = [0usize; 3];
    let mut rays = 0;
    for case in 0..16 {
        let size = 10f64.powf(8.0 * numbers.next() - 4.0);
        let centre =
            numbers.direction() * if case % 3 == 0 { 0.0 } else { size * 10f64.powf(7.0 * numbers.next() - 2.0) };
        let mesh = icosphere(case % 5, |p| centre + p * (size * (1.0 + 0.2 * (5.0 * p.x + 3.0 * p.y * p.z).sin())));
        let tree = MeshTree::build(&mesh);
        for k in 0..64_000 {
            let from = centre + numbers.direction() * (0.3 * size * numbers.next());
            let [a, b, _] = mesh.vertices((numbers.next() * mesh.triangles.len() as f64) as u32);
            let target = match k % 3 {
                0 => a,
                1 => a + (b - a) * numbers.next(),
                _ => numbers.direction() * size + (from - mesh.origin),
            };
            let ray = Ray::new(from, (target + mesh.origin - from).normalize());
            leaks[k % 3] += usize::from(tree.closest(&ray, f64::INFINITY, None).is_none());
            rays += 1;
        }
    }
    assert!(rays >= 1_000_000);
    assert_eq!(leaks, [0; 3], "vertices, edges, anywhere");
}

/// Without hierarchy, one triangle after the other.
fn brute_force(mesh: &Mesh, ray: &Ray, t_max: f64, skip: Option<u32>) -> Option<f64> {
    let sheared = TriangleRay::new(ray, mesh.origin);
    (0..mesh.triangles.len() as u32)
        .filter(|&i| Some(i) != skip)
        .filter_map(|i| sheared.intersect(mesh.vertices(i)))
        .map(|hit| hit.t)
        .filter(|&t| t < t_max)
        .reduce(f64::min)
}

/// The distance is the same, bit for bit, as that of the plain triangle test on all triangles;
/// directions include the axes with ±0, and slivers, zero areas and repeated corners are there.
#[test]
fn the_tree_finds_what_brute_force_finds() {
    let mut numbers = Numbers::new(12);
    let mut hits = 0;
    for case in 0..8 {
        let size = 10f64.powi(3 * case - 12);
        let mut soup = icosphere(1, |p| p * size);
        let n = soup.positions.len();
        for k in 0..240 {
            let p = numbers.direction() * size;
            let shrink = if k % 2 == 0 { 0.3 } else { 1e-7 };
            for d in [DVec3::ZERO, numbers.direction() * (0.3 * size), numbers.direction() * (shrink * size)] {
                soup.positions.push((p + d).as_vec3().to_array());
            }
            let first = (n + 3 * k) as u32;
            soup.triangles.push(if k % 7 == 0 { [first, first, first + 1] } else { [first, first + 1, first + 2] });
        }
        let tree = MeshTree::build(&soup);
        for _ in 0..2000 {
            let mut d = numbers.direction();
            if numbers.next() < 0.3 {
                let a = (numbers.next() * 3.0) as usize;
                let zero = if numbers.next() < 0.5 { 0.0 } else { -0.0 };
                d = [DVec3::new(1.0, zero, -zero), DVec3::new(zero, -1.0, zero), DVec3::new(0.6, 0.8, zero)][a];
            }
            // Half of the rays start at a triangle and skip it, as a departing path does.
            let i = (numbers.next() * soup.triangles.len() as f64) as u32;
            let target = soup.vertices(i).iter().zip([0.5, 0.25, 0.25]).map(|(&v, w)| v * w).sum::<DVec3>();
            let (origin, skip) = if numbers.next() < 0.5 {
                (target, Some(i))
            } else {
                (target - d * (3.0 * size * numbers.next()), None)
            };
            let t_max = if numbers.next() < 0.5 { f64::INFINITY } else { size };
            let ray = Ray::new(origin, d);
            let expected = brute_force(&soup, &ray, t_max, skip);
            let found = tree.closest(&ray, t_max, skip);
            assert_eq!(found.map(|f| f.hit.t), expected, "{ray:?}");
            assert_eq!(tree.any(&ray, t_max, [skip, None]), expected.is_some(), "{ray:?}");
            if let Some(f) = found {
                let sheared = TriangleRay::new(&ray, soup.origin);
                assert_eq!(sheared.intersect(soup.vertices(f.triangle)), Some(f.hit));
                hits += 1;
            }
        }
    }
    assert!(hits > 5000, "{hits}");
}

/// So it is with meshes of up to sixteen triangles, which have no tree, from a thousandth of their size away to 1e9 times
/// it: rays through vertices, edges and the inside of triangles of any shape, and of any length.
#[test]
fn a_small_mesh_shows_what_brute_force_finds() {
    let mut numbers = Numbers::new(13);
    let (mut hits, mut far) = (0, 0);
    for case in 0..400 {
        let size = 10f64.powf(20.0 * numbers.next() - 10.0);
        let count = 1 + case % 16;
        let positions = (0..3 * count).map(|_| numbers.direction() * (size * numbers.next())).collect();
        let soup = mesh(positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect());
        let tree = MeshTree::build(&soup);
        for k in 0..250 {
            let [a, b, c] = soup.vertices((numbers.next() * f64::from(count)) as u32);
            let (v, w) = (numbers.next(), numbers.next());
            let target = [a, a + (b - a) * v, a + (b - a) * (v * w) + (c - a) * (v * (1.0 - w))][k % 3] + soup.origin;
            let distance = 10f64.powf(12.0 * numbers.next() - 3.0);
            let origin = target + numbers.direction() * (size * distance);
            let ray = Ray::new(origin, (target - origin) * if k % 2 == 0 { 1.0 } else { 10.0 / (size * distance) });
            let expected = brute_force(&soup, &ray, f64::INFINITY, None);
            let found = tree.closest(&ray, f64::INFINITY, None);
            assert_eq!(found.map(|f| f.hit.t), expected, "{ray:?}");
            assert_eq!(tree.any(&ray, f64::INFINITY, [None; 2]), expected.is_some(), "{ray:?}");
            hits += u32::from(found.is_some());
            far += u32::from(found.is_some() && distance > 1e6);
        }
    }
    assert!(hits > 50_000 && far > 10_000, "{hits} {far}");
}

/// A triangle of legs 3 and 4 m: area 6 m², normal +z; the middle of the opposite side at
/// b = (½, ½) is (1.5, 2, 5). On an edge, points keep 2⁻⁴⁰ of the scale from it; their weights are normalised.
#[test]
fn a_surface_has_point_normal_area_and_tangent() {
    let source = MeshSource {
        positions: vec![DVec3::new(0.0, 0.0, 5.0), DVec3::new(3.0, 0.0, 5.0), DVec3::new(0.0, 4.0, 5.0)],
        // u runs along y over 4 m from 0 to 2, v along x.
        uvs: vec![DVec2::ZERO, DVec2::new(0.0, 1.0), DVec2::new(2.0, 0.0)],
        triangles: vec![[0, 1, 2]],
        ..MeshSource::default()
    };
    let mesh = Mesh::new(&source, &DAffine3::IDENTITY, NormalMode::Face, Winding::Object).unwrap();
    assert_eq!(mesh.area(0), 6.0);
    let s = mesh.surface(0, 0.5, 0.5);
    let b = mesh.boundary(0, 0.5, 0.5);
    assert_eq!((b.point, b.scale, b.normal), (s.point, s.scale, s.normal));
    let near = (s.point - DVec3::new(1.5, 2.0, 5.0)).length() / 5.0;
    assert!((0.99..4.0).contains(&(near * 2f64.powi(40))), "{}", s.point);
    assert_eq!(s.scale, 5.0);
    assert_eq!((s.normal, s.shading_normal), (DVec3::Z, DVec3::Z));
    assert!((s.uv - DVec2::new(1.0, 0.5)).length() < 4.0 * 2f64.powi(-40), "{}", s.uv);
    assert_eq!(s.tangent, DVec3::new(0.0, 2.0, 0.0));
    // Farther from the edges than that nothing is moved.
    assert_eq!(mesh.surface(0, 0.25, 0.5).point, DVec3::new(0.75, 2.0, 5.0));
    let hit =
        TriangleRay::new(&Ray::new(DVec3::new(1.0, 1.0, 9.0), DVec3::NEG_Z), mesh.origin).intersect(mesh.vertices(0));
    // x = 3 b1, y = 4 b2.
    let hit = hit.unwrap();
    assert_eq!((hit.t, hit.b2), (4.0, 0.25));
    assert!((hit.b1 - 1.0 / 3.0).abs() <= f64::EPSILON);
}

/// Mirrored, scaled and moved far away, a sphere's normals still point outward and its shading
/// normals are unit length; vertices land within half an f32 ulp of the size.
#[test]
fn a_mirrored_mesh_keeps_its_outside() {
    let unit = icosphere(2, |p| p);
    let as_f64 = |list: &[[f32; 3]]| list.iter().map(|p| DVec3::from(p.map(f64::from))).collect::<Vec<_>>();
    let source = MeshSource {
        positions: as_f64(&unit.positions),
        normals: as_f64(&unit.positions),
        triangles: unit.triangles.clone(),
        ..MeshSource::default()
    };
    let centre = DVec3::new(1e6, -3e6, 7e5);
    let scale = DVec3::new(-2.0, 1.0, 0.5);
    let place = DAffine3 { matrix3: DMat3::from_diagonal(scale), translation: centre };
    for mode in [NormalMode::Face, NormalMode::Smooth, NormalMode::File] {
        let mesh = Mesh::new(&source, &place, mode, Winding::Object).unwrap();
        for (p, source) in mesh.positions.iter().zip(&source.positions) {
            let world = DVec3::from(p.map(f64::from)) + mesh.origin;
            // Half an ulp of f32 at up to 4 m, and f64 at 3e6 m.
            let bound = 2.0 * f64::from(f32::EPSILON) + 3e6 * 4.0 * f64::EPSILON;
            assert!((world - place.transform_point3(*source)).abs().max_element() <= bound);
        }
        for i in 0..mesh.triangles.len() as u32 {
            let s = mesh.surface(i, 0.3, 0.3);
            // Normals of an ellipsoid: gradient of Σ (x/a)².
            let outward = ((s.point - centre) / (scale * scale)).normalize();
            assert!(s.normal.dot(outward) > 0.9 && s.shading_normal.dot(outward) > 0.9, "{mode:?}");
            assert!((s.shading_normal.length() - 1.0).abs() < 4.0 * f64::EPSILON);
        }
    }
}

/// Coordinates that are f32 in the file stay what they are, near the origin and far from it.
#[test]
fn f32_coordinates_are_kept_exactly() {
    for base in [0.0f32, 3.0, 1000.0, 123_456.7] {
        let corners = [[base, 0.1, -0.3], [base + 1.3, 0.1, 0.2], [base, 0.7, 0.9]];
        let m = mesh(corners.iter().map(|p| DVec3::from(p.map(f64::from))).collect(), vec![[0, 1, 2]]);
        for (p, q) in m.vertices(0).iter().zip(corners) {
            assert_eq!(*p + m.origin, DVec3::from(q.map(f64::from)));
        }
    }
}

/// Angle-weighted normals of a cube's corners are the diagonals, although the faces have two
/// triangles at some corners and one at others.
#[test]
fn smooth_normals_do_not_depend_on_how_faces_are_split() {
    let centre = DVec3::new(1.0, 2.0, 3.0);
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    // Corners are not shared between the six faces: equal places count as one vertex.
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let first = positions.len() as u32;
            for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let mut p = DVec3::ZERO;
                p[axis] = side;
                p[(axis + 1) % 3] = u * side;
                p[(axis + 2) % 3] = v;
                positions.push(centre + p);
            }
            triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|k: u32| k + first)));
        }
    }
    let source = MeshSource { positions, triangles, ..MeshSource::default() };
    let cube = Mesh::new(&source, &DAffine3::IDENTITY, NormalMode::Smooth, Winding::Object).unwrap();
    for (n, p) in cube.normals.iter().zip(&source.positions) {
        let expected = (*p - centre).normalize();
        assert!((DVec3::from(n.map(f64::from)) - expected).length() < 4.0 * f64::from(f32::EPSILON), "{n:?} {p}");
    }
    // Vertex by vertex of the file each corner keeps its face's normal.
    let sharp = Mesh::new(&source, &DAffine3::IDENTITY, NormalMode::Vertex, Winding::Object).unwrap();
    for (i, t) in sharp.triangles.iter().enumerate() {
        for &v in t {
            let n = DVec3::from(sharp.normals[v as usize].map(f64::from));
            assert!((n - sharp.surface(i as u32, 0.2, 0.2).normal).length() < 1e-6);
        }
    }
}

/// A triangle in the plane z = 0, counterclockwise from +z, with normals of the file up or down or none,
/// mirrored or not: by the right hand in the world a mirror turns it over, but normals keep their side.
#[test]
fn winding_in_the_world_follows_the_right_hand_or_the_normals() {
    for (normal, mirrored, outside) in [
        (None, false, 1.0),
        (None, true, -1.0),
        (Some(1.0), false, 1.0),
        (Some(1.0), true, 1.0),
        (Some(-1.0), false, -1.0),
        (Some(-1.0), true, -1.0),
    ] {
        let source = MeshSource {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            normals: normal.map_or(Vec::new(), |z| vec![DVec3::Z * z; 3]),
            triangles: vec![[0, 1, 2]],
            ..MeshSource::default()
        };
        let place = DAffine3::from_scale(DVec3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0));
        let mesh = Mesh::new(&source, &place, NormalMode::Vertex, Winding::World).unwrap();
        // u and v stay with the file's corners: here (0.2, 0.3) is x = ±0.2, y = 0.3.
        let (b1, b2) = if mesh.is_swapped(0) { (0.3, 0.2) } else { (0.2, 0.3) };
        let s = mesh.surface(0, b1, b2);
        assert_eq!((s.normal.z, s.shading_normal.z), (outside, outside), "{normal:?} {mirrored}");
        assert!((s.uv - DVec2::new(0.2, 0.3)).length() < 1e-15 && (s.point.y - 0.3).abs() < 1e-15, "{s:?}");
        assert!((s.tangent - mesh.surface(0, 0.0, 0.0).tangent).length() < 1e-15 && s.tangent.x.abs() == 1.0);
        let faced = Mesh::new(&source, &place, NormalMode::Face, Winding::World).unwrap();
        assert_eq!(faced.surface(0, 0.2, 0.2).normal.z, if mirrored { -1.0 } else { 1.0 });
    }
}

/// Three triangles wound either way, with normals that point up all over: each has its outside above, and u and v by the file's corners.
#[test]
fn each_triangle_has_its_outside_where_its_normals_are() {
    let corners =
        [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (4.0, 4.0), (8.0, 4.0), (4.0, 8.0), (2.0, 0.0), (3.0, 0.0), (2.0, 1.0)];
    let source = MeshSource {
        positions: corners.map(|(x, y)| DVec3::new(x, y, 0.0)).to_vec(),
        normals: vec![DVec3::Z; 9],
        triangles: vec![[0, 1, 2], [3, 5, 4], [6, 8, 7]],
        ..MeshSource::default()
    };
    let sorted = MeshSource { triangles: vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]], ..source.clone() };
    for mirror in [1.0, -1.0] {
        let place = DAffine3::from_scale(DVec3::new(mirror, 1.0, 1.0));
        let [mixed, sorted] =
            [&source, &sorted].map(|source| Mesh::new(source, &place, NormalMode::Vertex, Winding::World).unwrap());
        assert_eq!(mixed.triangles, sorted.triangles);
        for i in 0..3 {
            let (a, b) = (mixed.surface(i, 0.2, 0.3), sorted.surface(i, 0.2, 0.3));
            assert_eq!((a.point, a.normal, a.shading_normal), (b.point, DVec3::Z, DVec3::Z));
            // The second and third corner of the file are those of the sorted one, or the other way round.
            assert_eq!(a.uv, if i == 0 { b.uv } else { DVec2::new(b.uv.y, b.uv.x) });
        }
    }
    // Of a fan of four, one of which is wound the other way, the means at the vertices tell; its tip has none of its own.
    let fan = MeshSource {
        positions: [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
            .map(|(x, y)| DVec3::new(x, y, 0.0))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [0, 4, 3], [0, 4, 1]],
        ..MeshSource::default()
    };
    let fan = Mesh::new(&fan, &DAffine3::IDENTITY, NormalMode::Vertex, Winding::World).unwrap();
    assert_eq!(fan.triangles[2], [0, 3, 4]);
    assert_eq!([0, 1, 2, 3].map(|i| fan.surface(i, 0.2, 0.2).normal.z), [1.0; 4]);
    let faced = Mesh::new(&source, &DAffine3::IDENTITY, NormalMode::Face, Winding::World).unwrap();
    assert_eq!([0, 1, 2].map(|i| faced.surface(i, 0.2, 0.2).normal.z), [1.0, -1.0, -1.0]);
}

/// Areas 0, 2 and 6: the second is chosen for u < ¼ and the third above; the first never.
#[test]
fn triangles_are_chosen_by_area_and_flat_ones_never() {
    let positions = [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (0.0, 6.0), (1.0, 0.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
    let m = mesh(positions.to_vec(), vec![[0, 1, 4], [0, 1, 2], [0, 1, 3]]);
    assert_eq!(m.flat_triangles, 1);
    let table = AreaTable::new(&m);
    assert_eq!(table.total(), 8.0);
    assert_eq!([0.0, 0.2499, 0.25, 1.0 - f64::EPSILON].map(|u| table.sample(u).map(|s| s.0)), [1, 1, 2, 2].map(Some));
    let flat = mesh(positions.to_vec(), vec![[0, 1, 4]]);
    assert_eq!(AreaTable::new(&flat).sample(0.5), None);
    let along = Ray::new(DVec3::new(-1.0, 0.0, 0.0), DVec3::X);
    let across = Ray::new(DVec3::new(0.5, 0.0, 1.0), DVec3::NEG_Z);
    for ray in [along, across] {
        assert_eq!(MeshTree::build(&flat).closest(&ray, f64::INFINITY, None), None);
        assert_eq!(brute_force(&flat, &ray, f64::INFINITY, None), None);
    }
}

/// 2⁻¹²⁶ is the least that f32 holds with all digits. What is scaled to nothing is no fault.
#[test]
fn meshes_beyond_what_f32_holds_are_refused() {
    let (positions, triangles) = grid(2, |u| DVec3::new(u.x, u.y, 0.0));
    let source = MeshSource { positions, triangles, ..MeshSource::default() };
    let scaled = |scale: f64| {
        let place = DAffine3::from_scale(DVec3::splat(scale));
        Mesh::new(&source, &place, NormalMode::Face, Winding::Object).map(|_| ())
    };
    for fits in [0.0, f64::from(f32::MIN_POSITIVE), 1e38] {
        assert_eq!(scaled(fits), Ok(()));
    }
    assert_eq!(scaled(1e-38).unwrap_err(), "the mesh is 1e-38 m across in the world, outside the range of f32");
    assert!(scaled(1e-50).is_err());
    assert!(scaled(1e39).unwrap_err().ends_with("in the world, outside the range of f32"));
    let aside = DAffine3 { translation: DVec3::new(-1e200, 0.5, 0.0), ..DAffine3::from_scale(DVec3::splat(1e300)) };
    let told = Mesh::new(&source, &aside, NormalMode::Face, Winding::Object).map(|_| ()).unwrap_err();
    assert_eq!(told, "vertex 0 lies at [-1e200, 0.5, 0] in the world, outside the range of f32");
}
