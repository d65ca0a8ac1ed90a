//! Light of photons that paths of the camera merge with, at vertices behind mirrors and glass.

use super::{Leaving, Path, Tracer};
use crate::optics::bsdf::Lobes;
use crate::scene::SurfacePoint;
use crate::spectrum::{LANES, Lanes};
use crate::transport::photons::PhotonMap;
use crate::transport::ways::Found;
use glam::DVec3;

impl Tracer<'_> {
    /// Adds the light of the photons around a vertex behind mirrors and glass.
    #[inline(never)]
    pub(super) fn add_merged<const CHROMATIC: bool, B: Lobes>(
        &self,
        map: &PhotonMap,
        path: &mut Path,
        at: &Leaving,
        bsdf: &B,
        wo: DVec3,
    ) {
        let of_own = |light: Lanes| path.alone.map_or(light, |lane| Lanes::splat(light.to_array()[lane]));
        let merge = |group| self.merge::<CHROMATIC>(map, path, at.surface, group, |wi| at.eval(bsdf, wo, wi).0);
        let light = of_own(path.beta * merge(None));
        if let Some(ledger) = self.ledger {
            for group in 0..self.scene.light_groups.count() {
                let light = of_own(path.beta * merge(Some(group)));
                ledger.caustic(Found { light, group, alone: path.alone });
            }
        }
        path.radiance += light;
    }

    /// Light of the photons around a vertex behind mirrors and glass, of lamps of one group or all. A lane could lead both parts of the joined path
    /// with the product of its densities.
    #[inline(never)]
    fn merge<const CHROMATIC: bool>(
        &self,
        map: &PhotonMap,
        path: &Path,
        surface: &SurfacePoint,
        group: Option<u8>,
        f: impl Fn(DVec3) -> Lanes,
    ) -> Lanes {
        let balanced = LANES as f64 / f64::from(path.led.reduce_add());
        map.gather(surface.point, surface.normal, |photon| {
            if group.is_some_and(|group| photon.group != group) {
                return Lanes::ZERO;
            }
            // The camera's segments and the light's.
            if self.settings.max_depth.is_some_and(|most| path.vertices + photon.vertices + 2 > most) {
                return Lanes::ZERO;
            }
            let (came, rho) = (photon.came.as_dvec3(), photon.light.rho);
            let cosine = came.dot(surface.normal).abs();
            let f = f(came);
            // What has parted carries what all that could have led it there make of it already, and one that goes on for all has led with
            // its own density alone.
            let led = match CHROMATIC {
                _ if path.chosen => LANES as f64,
                true => f64::from((path.rho * rho).reduce_add()),
                false => f64::from((path.led * rho).reduce_add()) * balanced,
            };
            let share = LANES as f64 / (led * cosine);
            if share.is_finite() { f * share as f32 } else { Lanes::ZERO }
        })
    }
}
