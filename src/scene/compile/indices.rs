//! Refractive indices, and what absorbs by them.

use super::Compiler;
use super::spectra::Role;
use crate::description::{self as written, OpticalData, ReadK};
use crate::error::in_short;
use crate::optics::phase::Phase;
use crate::scene::Geometry;
use crate::scene::medium::{Filling, Medium, PhaseFunction};
use crate::scene::shape::Shape;
use crate::spectrum::{BAND_NM, Outside, RefractiveIndex, Spectrum, catalogue};
use std::f64::consts::PI;

/// k above which a body is no clear one: at normal incidence it then adds k²/(n + 1)² to the reflectance, some 0.2 %, and
/// no light comes through a hair of it.
const MOST_K: f64 = 0.1;

/// The least share of light that a colour of absorption leaves: of three numbers one can be zero, and its logarithm none.
const DARKEST: f64 = f32::MIN_POSITIVE as f64;

/// The whole nanometres of the band.
fn nanometres() -> impl Iterator<Item = f64> {
    (BAND_NM[0] as u32..=BAND_NM[1] as u32).map(f64::from)
}

impl<'a> Compiler<'a> {
    /// The index of something clear.
    pub(super) fn index(&mut self, at: &str, index: &written::Index) -> RefractiveIndex {
        let made = match index {
            written::Index::Number(n) => Ok(RefractiveIndex::Constant(*n)),
            written::Index::Glass(name) => catalogue::substance(name).map(|substance| {
                if let Some(note) = substance.note() {
                    self.note(at, &note);
                }
                substance.index.clone()
            }),
            written::Index::Sellmeier(s) => Ok(RefractiveIndex::sellmeier(s.b, s.c)),
            written::Index::Cauchy(c) => Ok(RefractiveIndex::Cauchy { a: vec![c.a, c.b, c.c] }),
            written::Index::Abbe(a) => RefractiveIndex::from_abbe(a.nd, a.vd),
            written::Index::Table(samples) => Ok(RefractiveIndex::Table { samples: samples.clone() }),
            written::Index::Schott(a) => Ok(RefractiveIndex::Schott { a: *a }),
            written::Index::Formula(f) => RefractiveIndex::formula(f.number, &f.coefficients),
            written::Index::File(path) => {
                return match self.optical_data(&format!("{at}.file"), path, ReadK::PassedOver) {
                    Some(data) => {
                        let index = self.clear_index(&format!("{at}.file"), data);
                        self.shelf.carried.index(index)
                    }
                    None => RefractiveIndex::Constant(1.0),
                };
            }
        };
        let checked = made.and_then(|index| index.check_band().map(|()| index));
        let index = self.or(at, checked, RefractiveIndex::Constant(1.0));
        if let Some(nm) = nanometres().find(|&nm| index.at(nm) < 1.0) {
            let n = index.at(nm);
            let message =
                format!("an index of {n} at {nm} nm, below 1 and without k, is right as a ratio to another only");
            self.note(at, &message);
        }
        self.shelf.carried.index(index)
    }

    /// What a file says.
    fn optical_data(&mut self, at: &str, path: &written::FilePath, k: ReadK) -> Option<OpticalData> {
        self.files.push(path.to_path_buf());
        match written::optical_data(path, k) {
            Ok(data) => {
                data.notes.iter().for_each(|note| self.note(at, note));
                Some(data)
            }
            Err(error) => {
                let error = self.asked(at, error);
                self.unread.get_or_insert(error);
                None
            }
        }
    }

    /// The index of a file, if light goes through what it describes.
    fn clear_index(&mut self, at: &str, data: OpticalData) -> RefractiveIndex {
        let stand_in = RefractiveIndex::Constant(1.0);
        let Some(index) = &data.index else {
            self.fault(at, "expected a formula or a table of n, found k alone");
            return stand_in;
        };
        let opaque = nanometres().find(|&nm| data.k_at(nm) > MOST_K || index.at(nm) < 1.0);
        if let Some(nm) = opaque {
            let [n, k] = [index.at(nm), data.k_at(nm)].map(in_short);
            let found = if data.k.is_some() { format!("{n} + {k}i") } else { format!("{n} without k") };
            let message = format!(
                "expected something clear, with n of 1 or more and k up to {MOST_K}, found {found} at {nm} nm; metals \
                 are written conductor: {{file: …}}"
            );
            self.fault(at, message);
            return stand_in;
        }
        data.index.unwrap_or(stand_in)
    }

    /// n and k of a metal's file.
    pub(super) fn metal_file(&mut self, at: &str, path: &written::FilePath) -> (Spectrum, Spectrum) {
        let stand_in = (Spectrum::Constant(1.0), Spectrum::Constant(0.0));
        let Some(data) = self.optical_data(at, path, ReadK::Needed) else { return stand_in };
        let (Some(index), Some(_)) = (&data.index, &data.k) else {
            self.fault(at, "expected both n and k, found one of them");
            return stand_in;
        };
        let curve = |f: &dyn Fn(f64) -> f64| {
            Spectrum::from_samples(&nanometres().map(|nm| (nm, f(nm))).collect::<Vec<_>>(), Outside::Hold)
        };
        let made = curve(&|nm| index.at(nm)).and_then(|eta| Ok((eta, curve(&|nm| data.k_at(nm))?)));
        self.or(at, made, stand_in)
    }

    /// The absorption of a clear body, m⁻¹: as it is written, else by the k of the file of its index.
    pub(super) fn absorption(&mut self, at: &str, m: &'a written::Dielectric) -> Option<Spectrum> {
        let by_k = |c: &mut Self, at: &str, path: &written::FilePath, asked: bool| {
            let data = c.optical_data(at, path, ReadK::Needed)?;
            if data.k.is_none() {
                if asked {
                    c.fault(at, "expected a table of k, found none");
                }
                return None;
            }
            // σ = 4πk/λ, with λ in metres.
            let sigma = |nm: f64| (nm, 4.0 * PI * data.k_at(nm) / (nm * 1e-9));
            let made = Spectrum::from_samples(&nanometres().map(sigma).collect::<Vec<_>>(), Outside::Hold);
            let absorption = c.or(at, made, Spectrum::Constant(0.0));
            Some(c.shelf.carried.coefficient(absorption))
        };
        let at = |field: &str| format!("{at}.{field}");
        match (&m.absorption, &m.ior) {
            (Some(written::Absorption::None), _) => None,
            (Some(written::Absorption::File(path)), _) => by_k(self, &at("absorption.file"), path, true),
            (Some(written::Absorption::Color(c)), _) => {
                let [at, length] = [at("absorption.color"), at("absorption.at")];
                let color = self.written_spectrum(&at, &c.color, Outside::Hold, Role::Reflectance);
                self.check_file_of_shares(&at, &c.color, &color);
                if let Some(nm) = nanometres().find(|&nm| color.at(nm) <= 0.0) {
                    self.fault(
                        &at,
                        format!("expected some light to be left at every wavelength, found none at {nm} nm"),
                    );
                    return None;
                }
                let color = self.shelf.carried.reflectance(color);
                let sigma = |nm: f64| (nm, -libm::log(color.at(nm).max(DARKEST)).min(0.0) / c.at);
                let made = Spectrum::from_samples(&nanometres().map(sigma).collect::<Vec<_>>(), Outside::Hold);
                // The darkest colour absorbs 88 over its length: what f32 does not hold comes of that.
                let made = made.map_err(|_| {
                    let found = in_short(c.at);
                    format!("expected a length over which no more than 3.4e38 m⁻¹ is absorbed, found {found}")
                });
                Some(self.or(&length, made, Spectrum::Constant(0.0)))
            }
            (None, written::Index::File(path)) => by_k(self, &at("ior.file"), path, false),
            (None, _) => None,
        }
    }

    /// The medium of an object whose material absorbs by itself.
    pub(super) fn absorbing(
        &mut self,
        at: &str,
        material: u32,
        closed: bool,
        geometry: &Geometry,
        shape: &written::Shape,
    ) -> Option<u32> {
        let absorption = self.materials[material as usize].absorption()?.clone();
        if !closed && !matches!(geometry, Geometry::Shape(Shape::Plane(_))) {
            let kind = shape.geometry.kind();
            let expected = "expected a closed shape or a plane for a material that absorbs";
            self.fault(&format!("{at}.material"), format!("{expected}, found an open {kind}"));
            return None;
        }
        if shape.inside.is_some() {
            let expected = "expected no other medium inside a body whose material absorbs";
            self.fault(&format!("{at}.inside"), format!("{expected} (absorption: none leaves that out), found one"));
            return None;
        }
        if let Some(known) = self.absorbing_ids.get(&material) {
            return Some(*known);
        }
        let filling = Filling::Even { absorption, scattering: Spectrum::Constant(0.0) };
        self.absorbing.push(Medium { filling, phase: PhaseFunction::One(Phase::Isotropic), shadow_rays: true });
        let id = (self.description.media.len() + self.absorbing.len()) as u32 - 1;
        self.absorbing_ids.insert(material, id);
        Some(id)
    }
}
