//! The flight of a beam to what it meets next: through media, and straight on through boundaries, panes and holes.

use super::{Beam, CHOSEN, Walk};
use crate::math::Ray;
use crate::math::sampler::Set;
use crate::scene::compound::{Compound, Leaf, Vertex};
use crate::scene::light::Light;
use crate::scene::material::Kind;
use crate::scene::nested::Crossing as Meeting;
use crate::scene::{Hit, Medium, SurfacePoint};
use crate::spectrum::Lanes;
use crate::transport::path::seen_normal;
use crate::transport::shadow::MAX_BOUNDARIES;
use glam::DVec3;

/// What a path meets of a material that is made of others: that, all of it, and the number that chose.
pub(super) type Part<'a> = (Leaf<'a>, &'a Compound, f64);

/// What ends a flight.
#[expect(clippy::large_enum_variant, reason = "surfaces are what is met, and a box would cost an allocation each")]
pub(super) enum Met<'a> {
    Surface(Landing<'a>),
    Medium { point: DVec3, medium: &'a Medium },
}

/// A surface that a beam has come to.
pub(super) struct Landing<'a> {
    pub hit: Hit,
    pub surface: SurfacePoint,
    /// Of a material that is made of others.
    pub part: Option<Part<'a>>,
    /// Whether it is a pane that has not let the beam straight through.
    pub pane: bool,
    /// The bodies with a priority that meet there.
    pub meeting: Option<Meeting<'a>>,
}

impl<'a> Walk<'a, '_> {
    /// The numbers of a flight after some boundaries.
    pub(super) fn set_of_flight(vertex: u32, crossings: u32) -> Set {
        Set::Extra((vertex + 1).wrapping_add(crossings << 16))
    }

    /// The next thing that the beam meets, other than boundaries and open panes, which it crosses.
    pub(super) fn fly(&mut self, beam: &mut Beam, u_flight: f64) -> Option<Met<'a>> {
        let scene = self.paths.scene;
        for crossings in 0..MAX_BOUNDARIES {
            let set = Walk::set_of_flight(beam.vertex, crossings);
            let hit = self.ahead.take().or_else(|| {
                self.rays += 1;
                scene.closest(&beam.ray, f64::INFINITY)
            });
            let surface = hit.map(|hit| scene.surface(&beam.ray, &hit));
            if self.paths.plan.media {
                if !self.learn_medium(beam, hit.as_ref().zip(surface.as_ref())) {
                    return None;
                }
                if let Some(medium) = beam.medium.flatten().map(|m| &scene.media[m as usize]) {
                    let u = if crossings == 0 { u_flight } else { self.sampler.set(set)[0] };
                    let distance = hit.map_or(f64::INFINITY, |h| h.t);
                    let flight = medium.fly(&beam.ray, distance, beam.nm, u, || self.sampler.walk(set));
                    beam.power *= flight.weight;
                    beam.rho *= flight.ratio;
                    if let Some(t) = flight.scattered_at {
                        return Some(Met::Medium { point: beam.ray.at(t), medium });
                    }
                }
            }
            let (hit, surface) = hit.zip(surface)?;
            let direction = beam.ray.direction;
            let object = &scene.objects[hit.object as usize];
            let material = &scene.materials[object.material as usize];
            let meeting = scene.crossing(object, &surface, direction, &beam.bodies);
            let hidden = meeting.is_some_and(|meeting| !meeting.shows);
            // Of a material made of others, what this path meets, if anything.
            let (shown, part) = match &material.kind {
                _ if hidden => (None, None),
                Kind::Compound(compound) => {
                    let part = self.part_met(beam, compound, &hit, &surface, crossings)?;
                    (part.as_ref().map(|(leaf, ..)| leaf.material), part)
                }
                _ => (Some(material), None),
            };
            if let Some(shown) = shown.filter(|m| !matches!(m.kind, Kind::Boundary)) {
                match shown.straight(&surface, direction, || hit.texture_point(&surface), beam.nm) {
                    Some(straight) if self.sampler.set(set)[1] < straight.share => beam.power *= straight.weight,
                    pane => {
                        return Some(Met::Surface(Landing { hit, surface, part, pane: pane.is_some(), meeting }));
                    }
                }
            }
            beam.crossings += u32::from(self.paths.settings.count_crossings);
            if self.is_last(beam.events()) {
                return None;
            }
            let beyond = scene.beyond(object, &surface, direction, beam.inside());
            beam.medium = beam.medium.map(|_| beyond.medium);
            beam.bodies = beyond.bodies;
            beam.ray = scene.leave(&surface, &hit, direction);
        }
        None
    }

    /// Sets what the beam is in, if that is not known yet, and takes of light from infinity what the way to where it begins does;
    /// false where that leaves nothing. `met` is what the beam meets next.
    fn learn_medium(&self, beam: &mut Beam, met: Option<(&Hit, &SurfacePoint)>) -> bool {
        if beam.medium.is_some() {
            return true;
        }
        let scene = self.paths.scene;
        // The side on which the beam meets the first surface between media tells what it is in.
        let told = met.and_then(|(hit, surface)| {
            let object = &scene.objects[hit.object as usize];
            (!object.keeps_medium).then(|| object.beyond(surface, -beam.ray.direction, None))
        });
        let before = told.unwrap_or_else(|| scene.medium_around(&beam.ray));
        let known = scene.inside(beam.bodies, before).medium;
        beam.medium = Some(known);
        if self.lamp.is_some_and(Light::is_distant)
            && let Some(medium) = known
        {
            beam.power *= self.arrived(beam, &scene.media[medium as usize]);
            return !beam.power.simd_eq(Lanes::ZERO).all();
        }
        true
    }

    /// What the beam meets of a material that is made of others: `None` where it ends, and in that `None` where there is a
    /// hole, through which it goes on.
    fn part_met(
        &mut self,
        beam: &mut Beam,
        compound: &'a Compound,
        hit: &Hit,
        surface: &SurfacePoint,
        crossings: u32,
    ) -> Option<Option<Part<'a>>> {
        let scene = self.paths.scene;
        let direction = beam.ray.direction;
        // Whoever collects photons chooses one of its materials; they lie there for all of them.
        let sharp = self.paths.caustics.is_some_and(|caustics| caustics.is_sharp(hit.object));
        if beam.vertex > 0 && !sharp {
            self.leave_photon(beam, surface);
        }
        let (at, wo) = (&hit.texture_point(surface), -direction);
        let x = Vertex { scene, hit, surface, at, wo };
        let u = self.sampler.set(Walk::set_of_flight(beam.vertex, crossings))[2];
        let mut leaf = compound.resolve(&x, seen_normal(surface, wo), u);
        // What goes straight on is seen from behind, where the holes may be others.
        if compound.sided && self.lamp.is_some() {
            let behind = Vertex { wo: direction, ..x };
            let open = compound.resolve(&behind, seen_normal(surface, direction), u).is_none();
            match (&leaf, open) {
                (None, false) => return None,
                (Some(_), true) => {
                    // Of the two ways one is followed.
                    let place = CHOSEN + 1 + beam.vertex.wrapping_add(crossings << 16);
                    beam.power *= 2.0;
                    if self.sampler.set(Set::Extra(place))[0] < 0.5 {
                        leaf = None;
                    }
                }
                _ => {}
            }
        }
        Some(leaf.map(|leaf| (leaf, compound, u)))
    }

    /// What `medium`, in which a beam of light from infinity begins, has left of it: the way from there is endless, as that
    /// of a shadow ray to such a light is. Where extinction is above zero nothing comes through.
    fn arrived(&self, beam: &Beam, medium: &Medium) -> Lanes {
        let back = Ray::new(beam.ray.origin, -beam.ray.direction);
        let distance = self.paths.scene.closest(&back, f64::INFINITY).map_or(f64::INFINITY, |hit| hit.t);
        medium.dim(&back, distance, beam.nm, || self.sampler.walk(Set::Extra(0))).through
    }
}
