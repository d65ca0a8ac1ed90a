//! Ways that part at the glass that the camera looks at, and are followed side by side.
//!
//! Each of the eight wavelengths follows its own refraction with the same random numbers, up to the first thing that scatters. From there
//! one goes on. A hero that goes alone has the noise of one wavelength's colour, up to 270 % a path; eight rotated ones together
//! have that of their lattice, some 5 %.
//!
//! Near the edge of a ball light is reflected and goes in alike: what the one finds is as rare as the chance of the other is large, and
//! as much brighter. There a path goes both ways, once.

use super::{Leaving, Path, Tracer};
use crate::optics::bsdf::BsdfSample;
use crate::optics::dielectric::Dielectric;
use crate::spectrum::{LANES, Lanes};
use glam::DVec3;

/// The least share reflected from which a path goes both ways. Below it what goes in is found often enough.
const BOTH_WAYS: f32 = 0.3;

impl Tracer<'_> {
    /// Whether wavelengths part at `glass` and go on side by side.
    #[inline(always)]
    pub(super) fn parts_at<const CHROMATIC: bool>(&self, path: &Path, glass: &Dielectric) -> bool {
        CHROMATIC && self.plan.packets && path.specular && glass.parts()
    }

    /// The reflection, where a path goes both ways at `glass`: of all things sharp that it meets first, once.
    #[inline(always)]
    pub(super) fn goes_both_ways(
        &self,
        path: &Path,
        glass: &Dielectric,
        wo: DVec3,
        at: &Leaving,
    ) -> Option<BsdfSample> {
        if !path.specular || path.is_one_of_two || at.pane || wo.z <= 0.0 {
            return None;
        }
        let reflection = glass.reflection(wo);
        (reflection.weight.reduce_add() >= BOTH_WAYS * LANES as f32).then_some(reflection)
    }

    /// Follows what goes through `glass` to its end, and sends the path on where it is reflected.
    #[inline(never)]
    pub(super) fn go_both_ways<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        glass: &Dielectric,
        wo: DVec3,
        reflection: &BsdfSample,
        at: &Leaving,
    ) -> bool {
        path.is_one_of_two = true;
        let through = |glass: &Dielectric| glass.go_through(wo).filter(|(sample, _)| sample.transmitted);
        if self.parts_at::<CHROMATIC>(path, glass) {
            for lane in 0..LANES {
                if let Some((sample, share)) = through(&glass.lane(lane)) {
                    self.follow_alone::<MEDIA>(path, lane, &sample, share, at);
                }
            }
        } else if let Some((sample, share)) = through(glass) {
            let (beta, eta2) = (path.beta * share as f32, path.eta2 / share);
            let mut inner = Path { beta, eta2, radiance: Lanes::ZERO, left: Lanes::ZERO, ..*path };
            self.follow_beside::<CHROMATIC, MEDIA>(path, &mut inner, &sample, at);
            path.radiance += inner.radiance;
            path.left += inner.left;
        }
        if let Some(ledger) = self.ledger {
            ledger.part();
        }
        path.eta2 *= LANES as f64 / f64::from(reflection.weight.reduce_add());
        self.leave::<CHROMATIC, MEDIA>(path, reflection, || Lanes::ZERO, at)
    }

    /// Sends all eight wavelengths on from a dispersive surface: true where they go on as one, reflected; else all have
    /// been followed to their ends.
    #[inline(never)]
    pub(super) fn part<const MEDIA: bool>(
        &self,
        path: &mut Path,
        glass: &Dielectric,
        wo: DVec3,
        u_lobe: f64,
        at: &Leaving,
    ) -> bool {
        // All alike: the one that has led so far leads on.
        if let Some(sample) = glass.reflects_all(wo, u_lobe) {
            return self.leave::<true, MEDIA>(path, &sample, || Lanes::ZERO, at);
        }
        for lane in 0..LANES {
            if let Some(sample) = glass.lane(lane).sample(wo, u_lobe) {
                self.follow_alone::<MEDIA>(path, lane, &sample, 1.0, at);
            }
        }
        false
    }

    /// Follows the wavelength of a `lane` by itself to its end, with the `share` of its light that goes there. Each decides for itself
    /// from here on; up to here any could have led.
    fn follow_alone<const MEDIA: bool>(
        &self,
        path: &mut Path,
        lane: usize,
        sample: &BsdfSample,
        share: f64,
        at: &Leaving,
    ) {
        let of_lane = |lanes: Lanes| lanes.to_array()[lane];
        let balanced = LANES as f32 / path.rho.reduce_add();
        let mut alone = Path {
            beta: Lanes::splat(of_lane(path.beta) * balanced * share as f32),
            rho: Lanes::ONE,
            led: path.rho,
            eta2: path.eta2 / share,
            radiance: Lanes::ZERO,
            left: Lanes::ZERO,
            alone: Some(lane),
            ..*path
        };
        // One wavelength in all lanes: nothing depends on which of them leads.
        let tracer = Tracer { nm: Lanes::splat(of_lane(self.nm)), ..*self };
        tracer.follow_beside::<false, MEDIA>(path, &mut alone, sample, at);
        let brought = |all: &mut Lanes, own: Lanes| {
            let mut lanes = all.to_array();
            lanes[lane] += own.to_array()[0];
            *all = Lanes::new(lanes);
        };
        brought(&mut path.radiance, alone.radiance);
        brought(&mut path.left, alone.left);
    }

    /// Follows `other` from where `path` is to its end.
    fn follow_beside<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        other: &mut Path,
        sample: &BsdfSample,
        at: &Leaving,
    ) {
        if let Some(ledger) = self.ledger {
            ledger.part();
        }
        if self.leave::<CHROMATIC, MEDIA>(other, sample, || Lanes::ZERO, at) {
            self.follow::<CHROMATIC, MEDIA>(other, f64::INFINITY, None);
        }
        path.beside = other.beside + (other.vertices - path.vertices) + (other.crossings - path.crossings);
        path.further = other.further;
        path.mirrored |= other.mirrored;
    }
}

impl Path {
    /// Of wavelengths that parted, whether this one goes on: beyond, their ways have nothing in common. The first is as
    /// likely any wavelength as each other is, and those of a pixel's samples are evenly spread. It has led the way to where they
    /// parted, with its own density: what the others would have led there with has no part in what it carries.
    #[inline(always)]
    pub(super) fn goes_on(&mut self) -> bool {
        let Some(lane) = self.alone.filter(|_| !self.chosen) else { return true };
        self.beta *= self.led.reduce_add();
        self.chosen = true;
        lane == 0
    }
}
