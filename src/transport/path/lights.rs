//! Light that a path finds: sent by what it meets, from infinity, and of lights that its vertices ask.

use super::together::MOST;
use super::{Path, Sought, Tracer};
use crate::math::sampler::{PARTS, Set, pairs};
use crate::math::{Departure, Ray};
use crate::scene::Inside;
use crate::scene::choice::{Asked, Asker};
use crate::scene::environment::Drawn;
use crate::scene::light::free;
use crate::spectrum::Lanes;
use crate::transport::plan::Coverage;
use crate::transport::shadow::Shadow;
use crate::transport::ways::{First, Found};
use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};

/// The power heuristic for densities `a` and `b`, safe for any values that are not both infinite.
pub(super) fn power_heuristic(a: f64, b: f64) -> f64 {
    if a <= 0.0 {
        return 0.0;
    }
    let r = b / a;
    1.0 / r.mul_add(r, 1.0)
}

/// What the vertices of paths that go together ask for.
pub(super) type Questions = ArrayVec<Question, { MOST * PARTS as usize }>;

/// Light that a vertex has asked for, and that arrives if nothing stands in the way.
#[derive(Clone, Copy)]
pub(super) struct Question {
    pub(super) ray: Ray,
    pub(super) distance: f64,
    /// The face or triangle that the ray aims at.
    pub(super) target: Option<Departure>,
    /// What it adds to the path's radiance.
    pub(super) light: Lanes,
    /// Whether it is left to paths from the lights.
    pub(super) traced: bool,
}

impl Tracer<'_> {
    /// Whether light that the path meets is of the class that is traced from `light`; see [`crate::transport::caustics`].
    pub(super) fn leaves(&self, path: &Path, light: u32) -> bool {
        self.leaves_from(path, path.sharp, path.thrown, path.ray.direction, light)
    }

    /// The same of light that the path would meet in `direction` after a vertex that is `sharp` or not, or has `thrown` it, in part.
    pub(super) fn leaves_from(&self, path: &Path, sharp: bool, thrown: bool, direction: DVec3, light: u32) -> bool {
        path.seen
            && (sharp || thrown && self.scene.lights[light as usize].stands_out(direction))
            && self.plan.caustics.as_ref().is_some_and(|c| c.traced[light as usize])
    }

    /// Whether light of a lamp that the path has met is sought, where it has come by a `single` direction or not from the last vertex.
    #[inline(always)]
    pub(super) fn seeks(&self, path: &Path, single: bool) -> bool {
        self.sought == Sought::All || self.seeks_in_part(path, single)
    }

    #[cold]
    #[inline(never)]
    fn seeks_in_part(&self, path: &Path, single: bool) -> bool {
        (path.specular && single) == (self.sought == Sought::Lamps)
    }

    /// Adds light `l` of a lamp that the path has met, found with weight `w`, or leaves it out.
    #[inline(always)]
    pub(super) fn meet_light<const CHROMATIC: bool>(&self, path: &mut Path, light: u32, l: Lanes, w: f64) {
        if self.leaves(path, light) {
            path.leave_out::<CHROMATIC>(l, w);
            return;
        }
        if !self.seeks(path, path.previous.is_none()) {
            return;
        }
        let share = path.share_of::<CHROMATIC>(l, w);
        path.radiance += share;
        if let Some(ledger) = self.ledger {
            let found = self.found(path, share, light);
            match path.vertices {
                0 => ledger.emitted(found),
                _ if ledger.is_caustic() => ledger.caustic(found),
                times => ledger.scattered(found, times),
            }
        }
    }

    pub(super) fn found(&self, path: &Path, share: Lanes, light: u32) -> Found {
        Found { light: share, group: self.scene.light_groups.of[light as usize], alone: path.alone }
    }

    /// Whether light that the path meets counts: always for the camera, else where scattering is a technique. To go straight
    /// through what counts as a vertex is to scatter there.
    pub(super) fn meets_lights(&self, path: &Path) -> bool {
        self.settings.scatter_samples > 0 || self.events(path) == 0
    }

    /// Light from infinity along a ray that met nothing.
    pub(super) fn add_background<const CHROMATIC: bool>(&self, path: &mut Path) {
        // What the path went straight through covers what is behind, and shows it, where the first hit does.
        let covered =
            self.settings.coverage == Coverage::FirstHit && self.settings.count_crossings && path.crossings > 0;
        let is_seen = path.vertices == 0 && !covered;
        if !self.meets_lights(path) || self.settings.hide_emitters && is_seen {
            return;
        }
        for &i in &self.scene.backgrounds {
            if path.has_counted(i) {
                continue;
            }
            let light = &self.scene.lights[i as usize];
            let (l, weight) = match &path.previous {
                None => (light.background(path.ray.direction, self.nm), 1.0),
                Some(p) => {
                    let (l, pdf) = light.background_and_pdf(path.ray.direction, p.normal, self.drawn(), self.nm);
                    let q = self.asked().probability(i as usize, p.point, p.normal, path.judged) * pdf;
                    (l, power_heuristic(p.density * path.rho_sum::<CHROMATIC>(), q * p.rho))
                }
            };
            self.meet_light::<CHROMATIC>(path, i, l, weight);
        }
    }

    /// How a vertex chooses among the lights that it asks.
    #[inline(always)]
    pub(super) fn asked(&self) -> &Asked {
        self.scene.asked(self.plan.asks_even_sky)
    }

    /// Which directions of a sky shadow rays take: what is even is left to what scatters, if anything does.
    #[inline(always)]
    pub(super) fn drawn(&self) -> Drawn {
        if self.settings.scatter_samples > 0 { Drawn::Brighter } else { Drawn::All }
    }

    /// Whether vertices ask lights at all.
    #[inline(always)]
    pub(super) fn asks(&self) -> bool {
        self.settings.light_samples > 0 && !self.asked().is_nobody()
    }

    /// Whether light is both looked for and met.
    #[inline(always)]
    pub(super) fn looks_and_meets(&self) -> bool {
        self.settings.light_samples > 0 && self.settings.scatter_samples > 0
    }

    /// Shadow rays from where the path is, if it looks for light there.
    pub(super) fn shadow_rays(&self, path: &Path) -> u32 {
        if path.specular { self.plan.shadow_rays } else { 1 }
    }

    /// Has the sky that a single shadow ray looks at fetched ahead; several have numbers of their own.
    pub(super) fn foresee(&self, path: &Path) {
        if self.shadow_rays(path) == 1 {
            self.scene.foresee(&self.sampler, Set::Scatter(path.vertices));
        }
    }

    /// Next-event estimation: as many times as the path sends shadow rays from here light from one point of one light, at a point
    /// with the normal of the side that is asked for. `u` and `u_light` are the numbers of a single time; `eval` tells f · |cos| and
    /// densities toward a direction, `share` what part of a lamp's light is left to this
    /// where what is scattered does not count as well, `first` what
    /// scatters light from a direction.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the state of a vertex, split by borrow")]
    pub(super) fn ask_lights<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        (point, normal): (DVec3, Option<DVec3>),
        u: DVec2,
        u_light: impl Fn() -> f64,
        eval: impl Fn(DVec3) -> (Lanes, Lanes),
        share: impl Fn(u32) -> Option<f64>,
        first: impl Fn(DVec3) -> First,
        inside: impl Fn(DVec3) -> Inside,
        leave: impl Fn(DVec3) -> Ray,
        mut later: Option<&mut Questions>,
    ) {
        let count = self.shadow_rays(path);
        path.further += count - 1;
        let asker = self.asked().asker(point, normal);
        path.judged = asker.judged();
        let parts = (count > 1).then(|| self.sampler.parts(Set::Shadows(path.vertices), count));
        for i in 0..count {
            let part = parts.as_ref().map(|parts| parts[i as usize]);
            self.add_light::<CHROMATIC, MEDIA>(
                path,
                &asker,
                (i, count),
                part.map_or(u, |u| pairs(u).0),
                || part.map_or_else(&u_light, |u| u[2]),
                &eval,
                &share,
                &first,
                &inside,
                &leave,
                later.as_deref_mut(),
            );
        }
    }

    /// Light from one point of one light for `asker`, the `i`th time of `count`.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the state of a vertex, split by borrow")]
    fn add_light<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        asker: &Asker,
        (i, count): (u32, u32),
        u: DVec2,
        u_light: impl FnOnce() -> f64,
        eval: impl Fn(DVec3) -> (Lanes, Lanes),
        share: impl Fn(u32) -> Option<f64>,
        first: impl Fn(DVec3) -> First,
        inside: impl Fn(DVec3) -> Inside,
        leave: impl FnOnce(DVec3) -> Ray,
        later: Option<&mut Questions>,
    ) {
        let scene = self.scene;
        let Asker { point, normal, .. } = *asker;
        let Some((lamp, chance)) = self.asked().choose(asker, u_light) else { return };
        // How often it is chosen.
        let probability = chance * f64::from(count);
        let (sender, drawn) = (&scene.lights[lamp], self.drawn());
        // A sky is looked up when it is known that its light arrives; what is left for later needs it now.
        let mut sky = None;
        let light = match later {
            Some(_) => sender.arriving(&scene.objects, point, normal, u, drawn, self.nm),
            None => sender.arriving_unseen(&scene.objects, point, normal, u, drawn, self.nm, &mut sky),
        };
        let Some(light) = light else { return };
        let (f, pdf) = eval(light.wi);
        if f.simd_eq(Lanes::ZERO).all() {
            return;
        }
        let ray = leave(light.wi);
        let distance = free(light.distance, light.target, point, &ray);
        // What throws light in part does so in a single direction, in which no shadow ray goes.
        let traced = self.leaves_from(path, path.sharp, false, light.wi, lamp as u32);
        let led = if CHROMATIC { path.rho * pdf } else { pdf };
        let weight = |passing: Option<Lanes>| match light.density {
            None => share(lamp as u32).unwrap_or(1.0) / probability,
            Some(density) => {
                let q = density * probability;
                if let Some(share) = share(lamp as u32) {
                    return share / q;
                }
                // B: what scattering, led by any lane, would have found this light with.
                let led = passing.map_or(led, |passing| led * passing);
                let scattering = if self.settings.scatter_samples > 0 { f64::from(led.reduce_add()) } else { 0.0 };
                power_heuristic(q * path.rho_sum::<CHROMATIC>(), scattering) / q
            }
        };
        if let Some(later) = later
            && !scene.has_boundaries
        {
            let light_found = path.share_of::<CHROMATIC>(f * light.radiance, weight(None));
            later.push(Question { ray, distance, target: light.target, light: light_found, traced });
            return;
        }
        let part;
        let sampler = if count == 1 {
            &self.sampler
        } else {
            part = self.sampler.part(i, count);
            &part
        };
        let shadow = Shadow {
            scene,
            sampler,
            nm: self.nm,
            vertex: path.vertices,
            inside: inside(light.wi),
            panes: self.panes(path),
            target: light.target,
            past_lamps: false,
            to_viewer: false,
        };
        let Some((through, passing)) = shadow.cast::<MEDIA>(&ray, distance) else { return };
        let weight = weight(Some(passing));
        let radiance = sky.map_or(light.radiance, |(map, place)| map.radiance_of(&place, self.nm));
        let value = f * radiance * through;
        if traced {
            path.leave_out::<CHROMATIC>(value, weight);
            return;
        }
        let found = path.share_of::<CHROMATIC>(value, weight);
        self.enter(path, found, lamp, || first(light.wi));
    }

    /// Adds `share` of the light of a lamp that the vertex which the path is at scatters, by `first` if it is the first.
    #[inline(always)]
    pub(super) fn enter(&self, path: &mut Path, share: Lanes, lamp: usize, first: impl FnOnce() -> First) {
        path.radiance += share;
        if let Some(ledger) = self.ledger {
            let found = self.found(path, share, lamp as u32);
            match path.vertices {
                0 => ledger.scattered_by(first(), found, 1),
                vertex if ledger.is_caustic_from_here(vertex) => ledger.caustic(found),
                vertices => ledger.scattered(found, vertices + 1),
            }
        }
    }
}
