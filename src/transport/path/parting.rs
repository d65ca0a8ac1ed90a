//! Wavelengths that part at the glass that the camera looks at: each of the eight follows its own refraction with the same
//! random numbers, up to the first thing that scatters. From there one goes on.
//!
//! A hero that goes alone has the noise of one wavelength's colour, up to 270 % a path; eight rotated ones together have that
//! of their lattice, some 5 %.

use super::{Leaving, Path, Tracer};
use crate::optics::dielectric::Dielectric;
use crate::spectrum::{LANES, Lanes};

impl Tracer<'_> {
    /// Whether wavelengths part at `glass` and go on side by side.
    #[inline(always)]
    pub(super) fn parts_at<const CHROMATIC: bool>(&self, path: &Path, glass: &Dielectric) -> bool {
        CHROMATIC && self.plan.packets && path.specular && glass.parts()
    }

    /// Sends all eight wavelengths on from a dispersive surface: true where they go on as one, reflected; else all have
    /// been followed to their ends.
    #[inline(never)]
    pub(super) fn part<const MEDIA: bool>(
        &self,
        path: &mut Path,
        glass: &Dielectric,
        wo: glam::DVec3,
        u_lobe: f64,
        at: &Leaving,
    ) -> bool {
        // Each decides for itself: none leads.
        path.beta *= LANES as f32 / path.rho.reduce_add();
        path.rho = Lanes::ONE;
        if let Some(sample) = glass.reflects_all(wo, u_lobe) {
            return self.leave::<true, MEDIA>(path, &sample, || Lanes::ZERO, at);
        }
        let (nm, beta) = (self.nm.to_array(), path.beta.to_array());
        let (mut radiance, mut left) = (path.radiance.to_array(), path.left.to_array());
        let (mut vertices, mut crossings) = (path.vertices, path.crossings);
        for lane in 0..LANES {
            let Some(sample) = glass.lane(lane).sample(wo, u_lobe) else { continue };
            if let Some(ledger) = self.ledger {
                ledger.part();
            }
            let mut alone = Path {
                beta: Lanes::splat(beta[lane]),
                radiance: Lanes::ZERO,
                left: Lanes::ZERO,
                alone: Some(lane),
                ..*path
            };
            // One wavelength in all lanes: nothing depends on which of them leads.
            let tracer = Tracer { nm: Lanes::splat(nm[lane]), ..*self };
            if tracer.leave::<false, MEDIA>(&mut alone, &sample, || Lanes::ZERO, at) {
                tracer.follow::<false, MEDIA>(&mut alone, f64::INFINITY, None);
            }
            radiance[lane] += alone.radiance.to_array()[0];
            left[lane] += alone.left.to_array()[0];
            vertices += alone.vertices - path.vertices;
            crossings += alone.crossings - path.crossings;
            path.mirrored |= alone.mirrored;
        }
        (path.radiance, path.left) = (Lanes::new(radiance), Lanes::new(left));
        (path.vertices, path.crossings) = (vertices, crossings);
        false
    }
}

impl Path {
    /// Of wavelengths that parted, whether this one goes on: beyond, their ways have nothing in common. The first is as
    /// likely any wavelength as each other is, and those of a pixel's samples are evenly spread.
    #[inline(always)]
    pub(super) fn goes_on(&mut self) -> bool {
        let Some(lane) = self.alone.filter(|_| !self.chosen) else { return true };
        self.beta *= LANES as f32;
        self.chosen = true;
        lane == 0
    }
}
