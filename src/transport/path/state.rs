//! What a path carries from vertex to vertex, and what it knows of the one that it is at.

use super::mirrored::Counted;
use super::{Incoming, PathSettings};
use crate::math::sampler::{Sampler, Set};
use crate::math::{Frame, Ray};
use crate::optics::bsdf::Lobes;
use crate::scene::compound::Slopes;
use crate::scene::nested::Crossing;
use crate::scene::{Hit, Inside, Object, Scene, SurfacePoint};
use crate::spectrum::{LANES, Lanes};
use glam::DVec3;
use std::cell::Cell;

/// The last vertex that light could also have been found from by next-event estimation.
#[derive(Clone, Copy)]
pub(super) struct Previous {
    pub(super) point: DVec3,
    /// Shading normal, where the light sample was asked with one.
    pub(super) normal: Option<DVec3>,
    /// Σ ρ before scattering, times how many shadow rays were sent.
    pub(super) rho: f64,
    /// The hero's density of the direction taken, sr⁻¹, times that of the flight since.
    pub(super) density: f64,
    /// Distance flown since (across boundaries of media).
    pub(super) distance: f64,
    /// Whether light was looked for along the way there.
    pub(super) looked_along: bool,
}

/// The state of a path between two vertices.
pub(super) struct Path {
    pub(super) ray: Ray,
    pub(super) beta: Lanes,
    pub(super) rho: Lanes,
    /// What `rho` was where wavelengths parted; one before.
    pub(super) led: Lanes,
    /// How far from the middle of the scene a medium that scatters the path lets it go on as anywhere: see [`worth`](crate::transport::roulette::worth). Zero
    /// before the first time.
    pub(super) near: f64,
    /// What roulette must not take for a loss: the product of η² over crossings, by which β shrinks in glass and regains it, over the
    /// share of this one of two ways that are both taken.
    pub(super) eta2: f64,
    pub(super) inside: Inside,
    /// `None` where only scattering could find light: at the camera and after mirrors.
    pub(super) previous: Option<Previous>,
    /// What lights may give to the last vertex that asked for one, which is `previous`; zero where that is not known.
    pub(super) judged: f32,
    pub(super) radiance: Lanes,
    /// Scattering events so far.
    pub(super) vertices: u32,
    /// Surfaces so far that it went straight through.
    pub(super) crossings: u32,
    /// The same of ways that have been followed beside it, both.
    pub(super) beside: u32,
    /// Shadow rays so far beyond one from each vertex.
    pub(super) further: u32,
    /// Whether it has met mirrors and glass only.
    pub(super) specular: bool,
    /// Whether paths from the lights can be joined to it: by the camera at its first vertex, by merging behind mirrors
    /// and glass.
    pub(super) seen: bool,
    /// Whether its first vertex was on something sharp.
    pub(super) mirrored: bool,
    /// Whether the last vertex that it has come to is on something sharp.
    pub(super) sharp: bool,
    /// Whether the last vertex, on something that scatters, too, has thrown it in a single direction.
    pub(super) thrown: bool,
    /// Light of paths that are traced from the lights.
    pub(super) left: Lanes,
    /// Whether it has gone both ways at some glass, of which this is one.
    pub(super) is_one_of_two: bool,
    /// The lane whose wavelength is in all lanes, after the others took other ways.
    pub(super) alone: Option<usize>,
    /// Whether it goes on for all that parted.
    pub(super) chosen: bool,
    /// A lamp that has been counted at a vertex which mirrors it, where the path has gone on toward it: it does not count it again.
    pub(super) counted: Option<Counted>,
    /// The same from beyond the surface that it is at.
    pub(super) beyond: Option<Counted>,
}

/// How far a path has come, beside what it carries.
pub(super) struct Walk {
    pub(super) alpha: f32,
    pub(super) depth: f64,
    /// Whether it has met nothing yet that is to be seen.
    pub(super) first: bool,
    /// Boundaries crossed since the last vertex. They have numbers of their own, so that every vertex of the path keeps
    /// the same ones whether or not boundaries lie on the way.
    pub(super) crossings: u32,
}

impl Walk {
    pub(super) const NEW: Walk = Walk { alpha: 0.0, depth: f64::INFINITY, first: true, crossings: 0 };

    /// [`Walk::NEW`] in a scene: an opaque sky covers all of it, wherever it ends.
    pub(super) fn begin(scene: &Scene, settings: &PathSettings) -> Walk {
        let covered = settings.opaque_sky && !settings.hide_emitters && scene.has_sky;
        Walk { alpha: if covered { 1.0 } else { 0.0 }, ..Walk::NEW }
    }

    /// Something to be seen, `depth` away: depth fog is that of the first, whatever counts as coverage.
    #[inline]
    pub(super) fn show(&mut self, depth: impl FnOnce() -> f64) {
        if self.first {
            *self = Walk { depth: depth(), first: false, ..*self };
        }
    }

    /// Something that covers what is behind it.
    #[inline]
    pub(super) fn cover(&mut self) {
        self.alpha = 1.0;
    }

    /// Something that lets the share `through` of what is behind it come through.
    #[inline]
    pub(super) fn veil(&mut self, through: f32) {
        self.alpha = 1.0 - (1.0 - self.alpha) * through;
    }
}

/// What a path has done with what it met.
pub(super) enum Step {
    Ended,
    /// Gone straight through something at this distance.
    Straight(f64),
    Scattered,
}

/// Where a path leaves a surface.
pub(super) struct Leaving<'a> {
    pub(super) hit: &'a Hit,
    pub(super) surface: &'a SurfacePoint,
    pub(super) object: &'a Object,
    pub(super) frame: &'a Frame,
    pub(super) slopes: Option<&'a Slopes>,
    pub(super) crossing: Option<&'a Crossing<'a>>,
    /// Toward where it came from.
    pub(super) wo: DVec3,
    /// Shading normal, where lights were asked with one.
    pub(super) sided: Option<DVec3>,
    /// Whether the frame is turned against the normal.
    pub(super) flip: bool,
    /// Whether it is of what might have gone straight through.
    pub(super) pane: bool,
    pub(super) choice: &'a Choice<'a>,
}

/// The numbers of [`Set::Choice`] of a vertex, drawn where one is asked for.
pub(super) struct Choice<'a> {
    pub(super) sampler: Sampler<'a>,
    pub(super) vertex: u32,
    pub(super) drawn: Cell<Option<[f64; 4]>>,
}

impl Choice<'_> {
    #[inline]
    pub(super) fn draw(&self, i: usize) -> f64 {
        let drawn = self.drawn.get().unwrap_or_else(|| self.sampler.set(Set::Choice(self.vertex)));
        self.drawn.set(Some(drawn));
        drawn[i]
    }
}

impl Leaving<'_> {
    /// f · |cos| and densities toward `wi` (world), given the local `wo`.
    #[inline(always)]
    pub(super) fn eval<B: Lobes>(&self, bsdf: &B, wo: DVec3, wi_world: DVec3) -> (Lanes, Lanes) {
        let wi = self.frame.to_local(wi_world);
        let geometric = wi_world.dot(self.surface.normal) * if self.flip { -1.0 } else { 1.0 };
        // Light that the shading normal sees and the true one does not would leak through.
        if geometric * wi.z <= 0.0 {
            return (Lanes::ZERO, Lanes::ZERO);
        }
        let e = bsdf.eval(wo, wi);
        let cos = wi.z.abs() * self.slopes.map_or(1.0, |s| s.shadowing(wi_world));
        (e.f * cos as f32, e.pdf)
    }
}

impl Path {
    /// A path before it has a ray.
    pub(super) const BLANK: Path = Path {
        ray: Ray { origin: DVec3::ZERO, direction: DVec3::Z, departure: None },
        beta: Lanes::ONE,
        rho: Lanes::ONE,
        led: Lanes::ONE,
        near: 0.0,
        eta2: 1.0,
        inside: Inside::NOTHING,
        previous: None,
        judged: 0.0,
        radiance: Lanes::ZERO,
        vertices: 0,
        crossings: 0,
        beside: 0,
        further: 0,
        specular: true,
        seen: false,
        mirrored: false,
        sharp: false,
        thrown: false,
        left: Lanes::ZERO,
        is_one_of_two: false,
        alone: None,
        chosen: false,
        counted: None,
        beyond: None,
    };

    /// What has come of it.
    pub(super) fn incoming(&self, alpha: f32, depth: f64) -> Incoming {
        let events = self.vertices + self.crossings + self.beside;
        let Path { radiance, left, further, mirrored, .. } = *self;
        Incoming { radiance, alpha, depth, left, events, further, mirrored }
    }

    /// Whether light `index`, which the path meets, has been counted at a vertex before; once.
    #[inline]
    pub(super) fn has_counted(&mut self, index: u32) -> bool {
        let here = Counted { light: index, behind: 0 };
        self.counted.take_if(|counted| *counted == here).is_some()
    }

    pub(super) fn rho_sum<const CHROMATIC: bool>(&self) -> f64 {
        if CHROMATIC { f64::from(self.rho.reduce_add()) } else { LANES as f64 }
    }

    /// What light `l` found with weight `w` adds to the estimator Σ β l / Σ ρ; the film's mean over lanes divides by 8.
    pub(super) fn share_of<const CHROMATIC: bool>(&self, l: Lanes, w: f64) -> Lanes {
        let share = if CHROMATIC { w * LANES as f64 / self.rho_sum::<true>() } else { w };
        self.beta * l * share as f32
    }

    /// Notes light `l`, found with weight `w`, that paths from the lights add.
    #[cold]
    pub(super) fn leave_out<const CHROMATIC: bool>(&mut self, l: Lanes, w: f64) {
        self.left += self.share_of::<CHROMATIC>(l, w);
    }
}
