//! Wavelengths that have parted in glass, side by side: eight rays that meet the same things at places of their own.
//!
//! Each lane is a path alone, with the random numbers of all. As long as they meet the same object from the same side
//! and go the same way from there, what depends on neither place nor direction is found once: the numbers, the material,
//! its indices. A lane that takes another way goes on with those that take it, too, or as a [`Beam`] alone.

use super::views::{Place, View};
use super::{Beam, LightPaths, Splat, Walk, adjoint};
use crate::math::{Frame, Ray, warp};
use crate::optics::bsdf::Bsdf;
use crate::optics::dielectric::{Dielectric, refract};
use crate::scene::bundle::each;
use crate::scene::material::{Kind, Material};
use crate::scene::texture::Texture;
use crate::scene::{Geometry, Hit, SurfacePoint};
use crate::spectrum::{LANES, Lanes};
use crate::transport::path::seen_normal;
use glam::{DVec2, DVec3};
use std::f32::consts::FRAC_1_PI;

/// Wavelengths on rays of their own.
#[derive(Clone, Copy)]
pub(super) struct Packet {
    /// What they have in common. Its power is that of each lane on its ray; its own ray says nothing.
    beam: Beam,
    /// Which of the eight are here, a bit each.
    lanes: u8,
    rays: [Ray; LANES],
}

/// Where each lane has come to; anything for lanes that are not there.
type Places<'a> = [(&'a SurfacePoint, &'a Hit); LANES];

/// The same with the normals that stand for those of the surfaces.
struct Faces<'a> {
    at: &'a Places<'a>,
    normals: &'a [DVec3; LANES],
}

impl Packet {
    /// One of the wavelengths alone.
    fn alone(&self, lane: usize) -> Beam {
        let only = |x: Lanes| Lanes::splat(x.to_array()[lane]);
        let Beam { power, nm, .. } = self.beam;
        Beam { ray: self.rays[lane], power: only(power), nm: only(nm), alone: Some(lane), ..self.beam }
    }
}

impl Walk<'_, '_> {
    /// Sends each wavelength of a beam on from glass in which they part, if from where it goes the glass is seen as `view`.
    /// None has led so far.
    pub(super) fn part(
        &mut self,
        beam: &Beam,
        glass: &Dielectric,
        at: &Place,
        view: &View,
        [u_lobe, roulette]: [f64; 2],
    ) {
        let beam = Beam { power: beam.power * view.shadowing, ..*beam };
        let mut packet = Packet { beam, lanes: u8::MAX, rays: [beam.ray; LANES] };
        let faces = Faces { at: &[(at.surface, at.hit); LANES], normals: &[view.frame.n; LANES] };
        self.cross_glass(&mut packet, glass, &faces, |_, went| at.is_seen_so(view, went), [u_lobe, roulette]);
        self.together(packet);
    }

    /// Follows a packet to the end of all its paths.
    fn together(&mut self, mut packet: Packet) {
        let (scene, plan) = (self.paths.scene, self.paths.plan);
        loop {
            // One needs no company. What they are in is known but for light that has only been reflected so far, and where
            // bodies overlap each meets others.
            let unknown = !scene.nested.bodies().is_empty() || scene.has_media && packet.beam.medium.is_none();
            if packet.lanes.count_ones() < 2 || unknown {
                each(packet.lanes).for_each(|lane| self.follow(packet.alone(lane)));
                return;
            }
            let vertex = packet.beam.vertex;
            if self.is_last(packet.beam.events()) {
                return;
            }
            let numbers = self.numbers(vertex);
            self.rays += packet.lanes.count_ones().div_ceil(2);
            let hits = scene.closest_of(&packet.rays, packet.lanes);
            let Some(first) = each(packet.lanes).find(|&lane| hits[lane].is_some()) else {
                self.drift_apart(&packet, packet.lanes);
                return;
            };
            let Some(leader) = hits[first] else { return };
            let object = &scene.objects[leader.object as usize];
            let material = &scene.materials[object.material as usize];
            if !matches!(&material.kind, Kind::Diffuse { .. } | Kind::Dielectric { facets: None, .. }) {
                each(packet.lanes).for_each(|lane| self.follow(packet.alone(lane)));
                return;
            }

            // Those that have come to the same side of the same thing.
            let met = |lane: usize| hits[lane].filter(|hit| hit.object == leader.object);
            let leading = scene.surface(&packet.rays[first], &leader);
            let surfaces: [SurfacePoint; LANES] = std::array::from_fn(|lane| match met(lane) {
                Some(hit) if lane != first => scene.surface(&packet.rays[lane], &hit),
                _ => leading,
            });
            let facing = |lane: usize| surfaces[lane].normal.dot(packet.rays[lane].direction);
            let mut here = 0;
            for lane in each(packet.lanes) {
                if met(lane).is_some() && facing(lane) * facing(first) > 0.0 {
                    here |= 1 << lane;
                }
            }
            let others = packet.lanes & !here;
            if others != 0 {
                let missed = each(others).filter(|&lane| hits[lane].is_none()).fold(0, |set, lane| set | 1 << lane);
                self.drift_apart(&packet, missed);
                if here != 0 {
                    self.together(Packet { lanes: others & !missed, ..packet });
                } else {
                    // Along the surface: each decides for itself.
                    each(others & !missed).for_each(|lane| self.follow(packet.alone(lane)));
                }
            }
            packet.lanes = here;
            let hits: [Hit; LANES] = std::array::from_fn(|lane| met(lane).unwrap_or(leader));
            self.fly_together(&mut packet, &hits, numbers.flight);

            let places: Places = std::array::from_fn(|lane| (&surfaces[lane], &hits[lane]));
            if let Kind::Diffuse { reflectance } = &material.kind {
                self.receive(&packet, material, reflectance, &places, &numbers);
                return;
            }
            if material.varies() || material.two_sided {
                // What it lets through is another thing at each place.
                each(packet.lanes).for_each(|lane| self.follow(packet.alone(lane)));
                return;
            }
            let at = leader.texture_point(&leading);
            let Bsdf::Dielectric(glass) = material.bsdf(&at, packet.beam.nm, plan.all_dispersive) else { return };
            let normals = surfaces.each_ref().map(|surface| surface.shading_normal);
            let faces = Faces { at: &places, normals: &normals };
            let chances = [numbers.lobe, numbers.roulette];
            if each(packet.lanes).all(|lane| surfaces[lane].normal == normals[lane]) {
                self.cross_glass(&mut packet, &glass, &faces, |_, _| true, chances);
                continue;
            }
            // Where the normals are interpolated there are two ways to see the glass.
            let seen_by =
                |normals: [DVec3; LANES]| move |lane: usize, went| seen_normal(places[lane].0, went) == normals[lane];
            let two_ways = |lane: &usize| {
                let (normal, came) = (surfaces[*lane].normal, -packet.rays[*lane].direction);
                let apart = normal.cross(normals[*lane]).length();
                apart > 0.0 && glass.may_graze(came.dot(normal), apart)
            };
            let behind = each(packet.lanes).filter(two_ways).fold(0, |set, lane| set | 1 << lane);
            if behind != 0 {
                let true_normals = surfaces.each_ref().map(|surface| surface.normal);
                let faces = Faces { at: &places, normals: &true_normals };
                let mut behind = Packet { lanes: behind, ..packet };
                self.cross_glass(&mut behind, &glass, &faces, seen_by(true_normals), chances);
                self.together(behind);
            }
            self.cross_glass(&mut packet, &glass, &faces, seen_by(normals), chances);
        }
    }

    /// Lanes that meet no surface: only something between could scatter them.
    fn drift_apart(&mut self, packet: &Packet, lanes: u8) {
        if self.paths.plan.media && self.paths.scene.has_media {
            each(lanes).for_each(|lane| self.follow(packet.alone(lane)));
        }
    }

    /// Takes each lane through what fills the space before what it hits. A lane that is scattered there goes alone.
    fn fly_together(&mut self, packet: &mut Packet, hits: &[Hit; LANES], u: f64) {
        let Some(medium) = packet.beam.medium.flatten().filter(|_| self.paths.plan.media) else { return };
        let medium = &self.paths.scene.media[medium as usize];
        for lane in each(packet.lanes) {
            let (ray, nm) = (&packet.rays[lane], Lanes::splat(packet.beam.nm.to_array()[lane]));
            let walk = || self.sampler.walk(Walk::set_of_flight(packet.beam.vertex, 0));
            let flight = medium.fly(ray, hits[lane].t, nm, u, walk);
            if flight.scattered_at.is_some() {
                self.follow(packet.alone(lane));
                packet.lanes &= !(1 << lane);
            } else {
                packet.beam.power.as_mut_array()[lane] *= flight.weight.to_array()[0];
            }
        }
    }

    /// Sends each lane on from smooth glass. Those that it reflects where it lets the others through are followed to
    /// their end, or these where they are fewer; the packet has the rest. Those go on for which `seen_so` tells that from
    /// where they go the glass has these normals.
    fn cross_glass(
        &mut self,
        packet: &mut Packet,
        glass: &Dielectric,
        &Faces { at, normals }: &Faces,
        seen_so: impl Fn(usize, DVec3) -> bool,
        [u_lobe, roulette]: [f64; 2],
    ) {
        let scene = self.paths.scene;
        let mut cosines = [1.0; LANES];
        for lane in each(packet.lanes) {
            cosines[lane] = -packet.rays[lane].direction.dot(normals[lane]);
        }
        let ways = glass.lanes(&cosines);
        let (mut reflected, mut transmitted) = (0, 0);
        let mut beyond = None;
        let vertex = packet.beam.vertex + 1;
        let [mirrored, through] = [glass.tint.reflected, glass.tint.transmitted].map(|tint| tint.to_array());
        for lane in each(packet.lanes) {
            let ((surface, hit), normal, cos) = (at[lane], normals[lane], cosines[lane]);
            let came = -packet.rays[lane].direction;
            let reflects = u_lobe < ways.reflected[lane];
            let went = if reflects {
                normal * (2.0 * cos) - came
            } else {
                refract(came, normal * 1.0f64.copysign(cos), ways.eta[lane], ways.cos_transmitted[lane])
            };
            let (true_came, true_went) = (came.dot(surface.normal), went.dot(surface.normal));
            if true_came * true_went == 0.0 || (true_came * true_went > 0.0) != reflects || !seen_so(lane, went) {
                continue;
            }
            let tint = if reflects { mirrored[lane] } else { through[lane] };
            let adjoint = adjoint(cos, went.dot(normal), true_came, true_went);
            let power = &mut packet.beam.power.as_mut_array()[lane];
            *power *= tint * adjoint as f32;
            let Some(worth) = self.survival(f64::from(*power), vertex, true, roulette) else { continue };
            *power *= worth;
            packet.rays[lane] = scene.leave(surface, hit, went);
            if reflects {
                reflected |= 1 << lane;
            } else {
                transmitted |= 1 << lane;
                let object = &scene.objects[hit.object as usize];
                beyond.get_or_insert_with(|| scene.beyond(object, surface, went, packet.beam.inside()));
            }
        }
        packet.beam.vertex = vertex;
        let mut crossed = Packet { lanes: transmitted, ..*packet };
        if let Some(beyond) = beyond {
            (crossed.beam.medium, crossed.beam.bodies) = (Some(beyond.medium), beyond.bodies);
        }
        packet.lanes = reflected;
        if reflected == 0 {
            *packet = crossed;
        } else if transmitted != 0 {
            let (few, most) =
                if reflected.count_ones() < transmitted.count_ones() { (*packet, crossed) } else { (crossed, *packet) };
            self.together(few);
            *packet = most;
        }
    }

    /// Light of each lane on a diffuse surface: seen by the camera, kept as photons, and of one lane followed on.
    fn receive(
        &mut self,
        packet: &Packet,
        material: &Material,
        reflectance: &Texture,
        at: &Places,
        numbers: &super::Numbers,
    ) {
        let scene = self.paths.scene;
        let nm = packet.beam.nm;
        let Some(first) = each(packet.lanes).next() else { return };
        let texture_point = |lane: usize| at[lane].1.texture_point(at[lane].0);
        let alike = (!reflectance.varies()).then(|| reflectance.eval(&texture_point(first), nm).to_array());
        if alike.is_some_and(|all| all == [0.0; LANES]) {
            return;
        }
        let place = |lane: usize| {
            let ((surface, hit), came) = (at[lane], -packet.rays[lane].direction);
            Place { scene, hit, surface, came, two_sided: material.two_sided, part_of: None }
        };
        let lit_normal = |lane: usize| place(lane).normal_from(-packet.rays[lane].direction);

        // What each would send into the camera.
        let mut rays = packet.rays;
        let mut distances = [0.0; LANES];
        let mut places = [DVec2::ZERO; LANES];
        let mut light = [0.0f32; LANES];
        let mut wanted = 0;
        for lane in each(packet.lanes) {
            let ((surface, hit), came) = (at[lane], -packet.rays[lane].direction);
            if scene.objects[hit.object as usize].is_lamp && self.hides_lamps() {
                continue;
            }
            let Some(entry) = scene.camera.entry(surface.point, || numbers.lens) else { continue };
            let normal = place(lane).normal_from(entry.direction);
            let (from, to) = (came.dot(normal), entry.direction.dot(normal));
            let (true_from, true_to) = (came.dot(surface.normal), entry.direction.dot(surface.normal));
            let seen = from > 0.0 && to > 0.0 && true_from * from * true_to * to > 0.0;
            if !seen || !self.paths.bounds.holds(entry.pixel) {
                continue;
            }
            let reflectance = match &alike {
                Some(all) => all[lane],
                None => reflectance.eval(&texture_point(lane), nm).to_array()[lane],
            };
            let cosines = to * adjoint(from, to, true_from, true_to);
            light[lane] = packet.beam.power.to_array()[lane]
                * (reflectance * FRAC_1_PI * (cosines * entry.density * self.unit_area) as f32);
            if light[lane] != 0.0 {
                rays[lane] = scene.leave(surface, hit, entry.direction);
                (distances[lane], places[lane]) = (entry.distance, entry.pixel);
                wanted |= 1 << lane;
            }
        }
        let empty = !scene.has_media && scene.nested.bodies().is_empty() && !scene.has_boundaries;
        if !empty || self.hides_lamps() {
            for lane in each(wanted) {
                let (surface, came) = (at[lane].0, -packet.rays[lane].direction);
                let object = &scene.objects[at[lane].1.object as usize];
                let beam = packet.alone(lane);
                let went = rays[lane].direction;
                let crosses = came.dot(surface.normal) * went.dot(surface.normal) < 0.0;
                let inside = if crosses { scene.beyond(object, surface, went, beam.inside()) } else { beam.inside() };
                let clear = self.clear_through(surface.point, &rays[lane], distances[lane], inside, beam.nm);
                light[lane] *= clear.to_array()[0];
                match self.open(&rays[lane], distances[lane], inside, &beam) {
                    Some(through) => light[lane] *= through.to_array()[0],
                    None => wanted &= !(1 << lane),
                }
            }
        } else if wanted != 0 {
            self.rays += wanted.count_ones().div_ceil(2);
            wanted &= !scene.occluded_of(&rays, &distances, wanted, None);
            for lane in each(wanted) {
                light[lane] *= self.clear(at[lane].0.point);
            }
        }
        for lane in each(wanted) {
            let mut lanes = [0.0; LANES];
            lanes[lane] = light[lane];
            let (place, light, group) = (places[lane], Lanes::new(lanes), self.group);
            let splat = Splat { place, light, alone: Some(lane), group };
            (self.splat)(self.wavelengths, splat);
        }

        if self.photons.is_some() {
            let lit = |lane: &usize| lit_normal(*lane).dot(packet.rays[*lane].direction) < 0.0;
            for lane in each(packet.lanes).filter(lit) {
                self.leave_photon(&packet.alone(lane), at[lane].0);
            }
        }
        // It has left photons here.
        let packet = &Packet { beam: Beam { unfound: false, ..packet.beam }, ..*packet };
        let lane = self.chosen_lane();
        if packet.lanes >> lane & 1 == 0 || self.is_last(packet.beam.events() + 1) {
            return;
        }
        if empty && each(packet.lanes).all(|lane| place(lane).is_plain()) {
            let reflected: [f32; LANES] = match &alike {
                Some(all) => *all,
                None => std::array::from_fn(|k| match packet.lanes >> k & 1 {
                    1 => reflectance.eval(&texture_point(k), nm).to_array()[k],
                    _ => 0.0,
                }),
            };
            let normals = std::array::from_fn(lit_normal);
            self.scatter_together(packet, lane, &reflected, &normals, at, numbers);
            return;
        }
        let (at, mut beam) = (place(lane), packet.alone(lane));
        let view = at.seen_from(at.came);
        beam.power *= LANES as f32;
        beam.chosen = true;
        let bsdf = material.bsdf(&texture_point(lane), beam.nm, false);
        if let Some((sample, view)) = self.sample(&bsdf, &at, &view, beam.vertex, numbers.lobe, numbers.scatter)
            && self.cross(&mut beam, &sample, &at, &view, numbers.roulette)
        {
            self.follow(beam);
        }
    }

    /// Sends light of all lanes on from where they have come to on a diffuse surface.
    ///
    /// Lane `chosen`, each with the same probability, draws a direction, which leads to a point y. If y is on a diffuse
    /// surface, too, all lanes are sent there: each has come to y with the density with which some lane would have
    /// found it, Σ_c p_c(y) / 8 (the balance heuristic over what could have been chosen), so that lane j carries
    /// Φ_j r_j 8 p_j(y) / Σ_c p_c(y), r its reflectance, at most 8 times what it had. From y they go on as one. Elsewhere,
    /// as on glass, the chosen one goes on alone for all. Which of the two is done depends on y alone.
    fn scatter_together(
        &mut self,
        packet: &Packet,
        chosen: usize,
        reflected: &[f32; LANES],
        normals: &[DVec3; LANES],
        at: &Places,
        numbers: &super::Numbers,
    ) {
        let scene = self.paths.scene;
        // Whether lane k, which comes from `came`, scatters into `went`; neither side of the surface is the other's.
        let scatters = |k: usize, went: DVec3| {
            let came = -packet.rays[k].direction;
            let true_normal = at[k].0.normal;
            let (from, to) = (came.dot(normals[k]), went.dot(normals[k]));
            let (true_from, true_to) = (came.dot(true_normal), went.dot(true_normal));
            (from > 0.0 && to > 0.0 && true_from * true_to > 0.0).then(|| (to, adjoint(from, to, true_from, true_to)))
        };
        let frame = Frame::from_normal_and_tangent(normals[chosen], at[chosen].0.tangent);
        let went = frame.to_world(warp::cosine_hemisphere(numbers.scatter));
        let Some((_, adjoint_alone)) = scatters(chosen, went) else { return };
        let ray = scene.leave(at[chosen].0, at[chosen].1, went);
        self.rays += 1;
        let Some(hit) = scene.closest(&ray, f64::INFINITY) else { return };
        let next = scene.surface(&ray, &hit);
        let [power, nm] = [packet.beam.power, packet.beam.nm];
        let mut beam = Beam { ray, chosen: true, vertex: packet.beam.vertex + 1, ..packet.beam };

        if self.joins(&hit, &next, went) {
            let mut rays = packet.rays;
            let (mut distances, mut densities, mut adjoints) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
            let mut open = 0u8;
            for k in each(packet.lanes) {
                let offset = next.point - at[k].0.point;
                let distance = offset.length();
                let to_next = offset / distance;
                let cos_next = -to_next.dot(next.normal);
                if let Some((cos, adjoint)) = scatters(k, to_next)
                    && cos_next > 0.0
                {
                    rays[k] = scene.leave(at[k].0, at[k].1, to_next);
                    distances[k] = distance;
                    adjoints[k] = adjoint;
                    // Over π, as all of them are.
                    densities[k] = cos * cos_next / (distance * distance);
                    open |= 1 << k;
                }
            }
            let others = open & !(1 << chosen);
            self.rays += others.count_ones().div_ceil(2);
            open &= !scene.occluded_of(&rays, &distances, others, Some(hit.departure()));
            let found = each(open).map(|k| densities[k]).sum::<f64>() / LANES as f64;
            let carried = std::array::from_fn(|k| match open >> k & 1 {
                1 => power.to_array()[k] * reflected[k] * (densities[k] / found * adjoints[k]) as f32,
                _ => 0.0,
            });
            // Again one leads, which any could have led to where they parted.
            (beam.rho, beam.led) = (beam.led, Lanes::ONE);
            beam.power = Lanes::new(carried) * (beam.rho.reduce_add() / LANES as f32);
        } else {
            let carried = power.to_array()[chosen] * reflected[chosen] * (LANES as f64 * adjoint_alone) as f32;
            beam.power = Lanes::splat(carried);
            beam.nm = Lanes::splat(nm.to_array()[chosen]);
            beam.alone = Some(chosen);
        }
        if self.survives(&mut beam, false, 1.0, numbers.roulette) {
            self.ahead = Some(hit);
            self.follow(beam);
        }
    }

    /// Whether lanes can be sent to what a ray in `direction` has met: a diffuse surface that is seen from outside, as
    /// that hides nothing of itself, with the normal that it has.
    fn joins(&self, hit: &Hit, surface: &SurfacePoint, direction: DVec3) -> bool {
        let LightPaths { scene, caustics, .. } = *self.paths;
        let object = &scene.objects[hit.object as usize];
        let diffuse = matches!(scene.materials[object.material as usize].kind, Kind::Diffuse { .. });
        let outside = match &object.geometry {
            Geometry::Shape(_) => !object.flipped,
            Geometry::Mesh(_) => true,
            Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => false,
        };
        diffuse
            && outside
            && hit.instance.is_none()
            && surface.shading_normal == surface.normal
            && direction.dot(surface.normal) < 0.0
            && !caustics.is_some_and(|c| c.is_sharp(hit.object))
    }
}
