//! Materials: the scattering function of a surface, for every point and wavelength.

use super::SurfacePoint;
use super::compound::{Composition, Compound};
use super::principled::{Solid, Thin};
use super::texture::{Scalar, Texture, TexturePoint};
use crate::description::LEAST_ALPHA;
use crate::optics::bsdf::{Bsdf, Metal, Pane};
use crate::optics::dielectric::{Dielectric, RelativeIndex, RoughDielectric, Tint};
use crate::optics::fresnel::Model;
use crate::optics::hair::{Fibre, Hair};
use crate::optics::microfacet::{Distribution, Microfacets};
use crate::optics::plastic::{Base, Coats, Plastic, RoughPlastic};
use crate::optics::thin_film::ThinFilm;
use crate::spectrum::{BAND_NM, Lanes, RefractiveIndex, Spectrum};
use glam::DVec3;
use std::sync::Arc;

/// A material.
#[derive(Clone, Debug)]
pub struct Material {
    /// What it does with light.
    pub kind: Kind,
    /// True where the back side behaves as the front does.
    pub two_sided: bool,
    /// The highlight that `whitted` adds for each light.
    pub highlight: Option<Highlight>,
}

/// A Phong (1975) or Blinn (1977) highlight: strength · cosⁿ.
#[derive(Clone, Copy, Debug)]
pub struct Highlight {
    /// Factor on the light.
    pub strength: f32,
    /// The exponent n.
    pub exponent: f64,
    /// Which cosine.
    pub model: HighlightModel,
}

/// Which cosine a highlight is a power of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HighlightModel {
    /// Between the normal and the half vector.
    #[default]
    Blinn,
    /// Between the mirrored viewer and the light.
    Phong,
}

/// What a material does with light; see [`Bsdf`].
#[derive(Clone, Debug)]
pub enum Kind {
    /// Lambert.
    Diffuse {
        /// Albedo.
        reflectance: Texture,
    },
    /// A perfect mirror.
    Mirror {
        /// Reflectance.
        reflectance: Spectrum,
    },
    /// A metal.
    Conductor {
        /// Real part of the index.
        eta: Spectrum,
        /// Imaginary part.
        k: Spectrum,
        /// Factor on the reflectance.
        tint: Texture,
        /// Which Fresnel formula.
        fresnel: Model,
        /// Rough or smooth.
        facets: Option<Roughness>,
        /// A film on it.
        film: Option<Box<Film>>,
    },
    /// An interface between transparent media.
    Dielectric {
        /// Index on the inside.
        interior: RefractiveIndex,
        /// Index on the side of the normal.
        exterior: RefractiveIndex,
        /// Which Fresnel formula (smooth only).
        fresnel: Model,
        /// Rough or smooth.
        facets: Option<Roughness>,
        /// Factors beside Fresnel's, where there are any.
        tints: Option<Box<Tints>>,
        /// Which of two bodies has the place where they overlap: that of the higher one.
        priority: Option<i32>,
        /// A film on it.
        film: Option<Box<Film>>,
        /// What its inside absorbs, m⁻¹, where no other medium fills it.
        absorption: Option<Box<Spectrum>>,
    },
    /// A thin pane.
    Thin {
        /// Index of the pane.
        interior: RefractiveIndex,
        /// Index around it.
        exterior: RefractiveIndex,
        /// Factors beside Fresnel's, where there are any.
        tints: Option<Box<Tints>>,
        /// Where it is thin enough for its faces to interfere.
        thickness: Option<Box<Thickness>>,
    },
    /// A diffuse base under a clear coat.
    Plastic {
        /// Albedo of the base.
        reflectance: Texture,
        /// The coat.
        coat: Box<Coat>,
        /// Colour shift of light that bounces under the coat.
        nonlinear: bool,
        /// Factor on what the coat reflects, where it is not one.
        tint: Option<Box<Texture>>,
    },
    /// A principled surface of a solid.
    Principled(Box<Solid>),
    /// A principled sheet.
    PrincipledThin(Box<Thin>),
    /// Fibres of hair.
    Hair {
        /// Their shape and finish.
        fibre: Arc<Fibre>,
        /// Absorption times the radius, as a sum.
        absorption: Vec<Spectrum>,
    },
    /// The boundary of a medium.
    Boundary,
    /// Made of other materials.
    Compound(Box<Compound>),
}

/// A thin film on a surface.
#[derive(Clone, Debug)]
pub struct Film {
    /// Its index.
    pub index: RefractiveIndex,
    /// Its thickness.
    pub thickness: Thickness,
}

impl Film {
    /// The film at a point for the wavelengths `nm`, where the index on the side of the normal is `outside`.
    #[must_use]
    pub fn at(&self, at: &TexturePoint, nm: Lanes, outside: &RefractiveIndex) -> ThinFilm {
        ThinFilm::new(self.index.lanes(nm), self.thickness.at(at), outside.lanes(nm), nm)
    }
}

/// How thick a film is, nm.
#[derive(Clone, Debug)]
pub enum Thickness {
    /// The same everywhere.
    Uniform(f64),
    /// After a texture.
    Textured {
        /// The numbers.
        numbers: Scalar,
        /// Where they are 0.
        from: f64,
        /// Where they are 1.
        to: f64,
    },
}

impl Thickness {
    /// At a point, nm; not below zero.
    #[must_use]
    pub fn at(&self, at: &TexturePoint) -> f64 {
        match self {
            Thickness::Uniform(d) => *d,
            Thickness::Textured { numbers, from, to } => (to - from).mul_add(numbers.eval(at), *from).max(0.0),
        }
    }

    /// Over the wavelength in a medium of index `outside`.
    #[must_use]
    pub fn waves(&self, at: &TexturePoint, nm: Lanes, outside: &RefractiveIndex) -> Lanes {
        let (d, outside, nm) = (self.at(at), outside.lanes(nm), nm.to_array());
        Lanes::new(std::array::from_fn(|k| (outside[k] * d / f64::from(nm[k])) as f32))
    }

    fn varies(&self) -> bool {
        matches!(self, Thickness::Textured { numbers, .. } if numbers.varies())
    }
}

/// The clear coat of a plastic.
#[derive(Clone, Debug)]
pub struct Coat {
    /// Index of the coat.
    pub interior: RefractiveIndex,
    /// Index outside.
    pub exterior: RefractiveIndex,
    /// Rough or smooth.
    pub facets: Option<Microfacets>,
    /// What follows from them.
    pub tables: Arc<Coats>,
}

impl Coat {
    /// A coat with the `tables` of the range of its index over that outside.
    #[must_use]
    pub fn new(
        interior: RefractiveIndex,
        exterior: RefractiveIndex,
        facets: Option<Microfacets>,
        tables: impl FnOnce([f64; 2]) -> Arc<Coats>,
    ) -> Coat {
        // Formulas and tables have no peak within a nanometre.
        let range = BAND_NM[0] as u32..=BAND_NM[1] as u32;
        let etas = range.map(|nm| interior.at(f64::from(nm)) / exterior.at(f64::from(nm)));
        let (low, high) = etas.fold((f64::INFINITY, 0.0f64), |(low, high), eta| (low.min(eta), high.max(eta)));
        Coat { interior, exterior, facets, tables: tables([low, high]) }
    }

    /// Index of the coat over that outside.
    #[must_use]
    pub fn eta(&self, nm: Lanes) -> RelativeIndex {
        relative_index(&self.interior, &self.exterior, nm, false)
    }

    /// A base under it, whose reflection has the factor `tint`.
    #[must_use]
    pub fn base(&self, reflectance: Lanes, nonlinear: bool, tint: Lanes, nm: Lanes) -> Base {
        let eta = self.eta(nm);
        Base { reflectance, eta, internal: eta.lanes(|eta| self.tables.internal(eta)), nonlinear, tint }
    }
}

/// How rough a surface is, point by point.
#[derive(Clone, Debug)]
pub enum Roughness {
    /// The same everywhere.
    Uniform(Microfacets),
    /// After textures.
    Textured(Box<TexturedRoughness>),
}

/// Roughness after textures.
#[derive(Clone, Debug)]
pub struct TexturedRoughness {
    /// The family.
    pub distribution: Distribution,
    /// α along ∂p/∂u.
    pub u: Scalar,
    /// α across; the same as along where there is none.
    pub v: Option<Scalar>,
}

impl Roughness {
    fn at(&self, at: &TexturePoint) -> Microfacets {
        match self {
            Roughness::Uniform(facets) => *facets,
            Roughness::Textured(textured) => {
                let alpha = |s: &Scalar| s.eval(at).max(LEAST_ALPHA);
                let u = alpha(&textured.u);
                match &textured.v {
                    None => Microfacets::isotropic(textured.distribution, u),
                    Some(v) => Microfacets::anisotropic(textured.distribution, u, alpha(v)),
                }
            }
        }
    }

    fn varies(&self) -> bool {
        match self {
            Roughness::Uniform(_) => false,
            Roughness::Textured(t) => t.u.varies() || t.v.as_ref().is_some_and(Scalar::varies),
        }
    }
}

/// Factors on what an interface reflects and transmits.
#[derive(Clone, Debug)]
pub struct Tints {
    /// On the reflected light.
    pub reflected: Texture,
    /// On the transmitted light.
    pub transmitted: Texture,
}

impl Tints {
    /// The factors at a point; one where there are none.
    #[must_use]
    pub fn at(tints: Option<&Tints>, at: &TexturePoint, nm: Lanes) -> Tint {
        match tints {
            None => Tint::NONE,
            Some(t) => Tint { reflected: t.reflected.eval(at, nm), transmitted: t.transmitted.eval(at, nm) },
        }
    }

    fn varies(&self) -> bool {
        self.reflected.varies() || self.transmitted.varies()
    }
}

/// A metal at a point.
pub fn metal(
    eta: &Spectrum,
    k: &Spectrum,
    tint: &Texture,
    fresnel: Model,
    film: Option<&Film>,
    at: &TexturePoint,
    nm: Lanes,
) -> Metal {
    let film = film.map(|film| film.at(at, nm, &RefractiveIndex::Constant(1.0)));
    Metal { eta: eta.eval(nm), k: k.eval(nm), tint: tint.eval(at, nm), fresnel, film }
}

fn film_varies(film: &Option<Box<Film>>) -> bool {
    film.as_ref().is_some_and(|film| film.thickness.varies())
}

/// η inside over η outside, for each lane.
#[must_use]
pub fn relative_index(
    interior: &RefractiveIndex,
    exterior: &RefractiveIndex,
    nm: Lanes,
    treat_as_dispersive: bool,
) -> RelativeIndex {
    match (interior, exterior) {
        (RefractiveIndex::Constant(i), RefractiveIndex::Constant(e)) if !treat_as_dispersive => {
            RelativeIndex::Constant(i / e)
        }
        _ => {
            let (i, e) = (interior.lanes(nm), exterior.lanes(nm));
            RelativeIndex::Dispersive(std::array::from_fn(|k| i[k] / e[k]))
        }
    }
}

/// What goes straight through a surface as if it were not there.
#[derive(Clone, Copy, Debug)]
pub struct Straight {
    /// The share of paths that do.
    pub share: f64,
    /// Their factor.
    pub weight: Lanes,
}

impl Straight {
    /// All of it, as it is.
    pub const OPEN: Straight = Straight { share: 1.0, weight: Lanes::ONE };
}

impl Material {
    /// True where light may go straight through, so that a lamp behind is looked for.
    #[must_use]
    pub fn lets_through(&self) -> bool {
        match &self.kind {
            Kind::Boundary | Kind::Thin { .. } => true,
            Kind::Compound(compound) => {
                matches!(compound.composition, Composition::Mask { .. })
                    || compound.composition.inner().iter().any(|m| m.lets_through())
            }
            _ => false,
        }
    }

    /// True where light may be bent on its way through: what is behind is then another medium.
    #[must_use]
    pub fn refracts(&self) -> bool {
        match &self.kind {
            Kind::Dielectric { .. } => true,
            Kind::Principled(solid) => solid.transmission.is_some(),
            Kind::Compound(compound) => compound.composition.inner().iter().any(|m| m.refracts()),
            _ => false,
        }
    }

    /// Whether light that falls on one side is scattered from the other, without bending.
    #[must_use]
    pub fn scatters_through(&self) -> bool {
        match &self.kind {
            Kind::PrincipledThin(_) | Kind::Hair { .. } => true,
            Kind::Compound(compound) => compound.composition.inner().iter().any(|m| m.scatters_through()),
            _ => false,
        }
    }

    /// What goes straight through at `surface` in `direction`; `None` where nothing can.
    #[must_use]
    #[inline]
    pub fn straight(
        &self,
        surface: &SurfacePoint,
        direction: DVec3,
        at: impl FnOnce() -> TexturePoint,
        nm: Lanes,
    ) -> Option<Straight> {
        match &self.kind {
            Kind::Boundary => Some(Straight::OPEN),
            Kind::Thin { interior, exterior, tints, thickness } => {
                let eta = relative_index(interior, exterior, nm, false);
                let at = (tints.is_some() || thickness.is_some()).then(at);
                let waves = at.as_ref().and_then(|at| thickness.as_ref().map(|t| t.waves(at, nm, exterior)));
                let pane = Pane::new(direction.dot(surface.shading_normal).abs(), &eta, waves);
                let tint = at.zip(tints.as_ref()).map_or(Lanes::ONE, |(at, tints)| tints.transmitted.eval(&at, nm));
                Some(Straight { share: pane.share, weight: pane.transmitted * tint })
            }
            Kind::Compound(compound) => compound.straight(surface, direction, &at(), nm),
            _ => None,
        }
    }

    /// The share of paths in `direction` that meet nothing at `surface`: it is a hole there, or only bounds a medium.
    #[must_use]
    pub fn open(&self, surface: &SurfacePoint, direction: DVec3, at: &TexturePoint) -> f64 {
        match &self.kind {
            Kind::Boundary => 1.0,
            Kind::Compound(compound) => compound.open(surface, direction, at),
            _ => 0.0,
        }
    }

    /// The scattering function at a point for the wavelengths `nm`. `all_dispersive` treats every
    /// glass as if its index depended on wavelength (`effects: all`).
    #[must_use]
    pub fn bsdf(&self, at: &TexturePoint, nm: Lanes, all_dispersive: bool) -> Bsdf<'_> {
        self.bsdf_beside(at, nm, all_dispersive, None)
    }

    /// [`Material::bsdf`] with another index on the outside, if there is one.
    #[must_use]
    pub fn bsdf_beside(
        &self,
        at: &TexturePoint,
        nm: Lanes,
        all_dispersive: bool,
        around: Option<&RefractiveIndex>,
    ) -> Bsdf<'_> {
        match &self.kind {
            Kind::Diffuse { reflectance } => Bsdf::Diffuse { reflectance: reflectance.eval(at, nm) },
            Kind::Mirror { reflectance } => Bsdf::Mirror { reflectance: reflectance.eval(nm) },
            Kind::Conductor { eta, k, tint, fresnel, facets, film } => {
                let metal = metal(eta, k, tint, *fresnel, film.as_deref(), at, nm);
                match facets {
                    Some(facets) => Bsdf::RoughConductor(metal, facets.at(at)),
                    None => Bsdf::Conductor(metal),
                }
            }
            Kind::Dielectric { interior, exterior, fresnel, facets, tints, film, .. } => {
                let exterior = around.unwrap_or(exterior);
                // Under a film a leading wavelength would choose by its own reflectance, where otherwise their mean does.
                let eta = relative_index(interior, exterior, nm, all_dispersive && film.is_none());
                let film = film.as_ref().map(|film| film.at(at, nm, exterior));
                let tint = Tints::at(tints.as_deref(), at, nm);
                match facets {
                    Some(facets) => {
                        let (eta, facets) = (eta.apart_from_one(), facets.at(at));
                        Bsdf::RoughDielectric(RoughDielectric { eta, facets, tint, film })
                    }
                    None => Bsdf::Dielectric(Dielectric { eta, fresnel: *fresnel, tint, film }),
                }
            }
            Kind::Thin { interior, exterior, tints, thickness } => Bsdf::Thin {
                eta: relative_index(interior, exterior, nm, false),
                thickness: thickness.as_ref().map(|t| t.waves(at, nm, exterior)),
                tint: Tints::at(tints.as_deref(), at, nm),
            },
            Kind::Plastic { reflectance, coat, nonlinear, tint } => {
                let tint = tint.as_ref().map_or(Lanes::ONE, |tint| tint.eval(at, nm));
                let base = coat.base(reflectance.eval(at, nm), *nonlinear, tint, nm);
                match coat.facets {
                    Some(facets) => Bsdf::RoughPlastic(RoughPlastic { base, facets, coats: &coat.tables }),
                    None => Bsdf::Plastic(Plastic { base }),
                }
            }
            Kind::Principled(solid) => Bsdf::Principled(solid.at(at, nm)),
            Kind::PrincipledThin(sheet) => Bsdf::PrincipledThin(sheet.at(at, nm)),
            Kind::Hair { fibre, absorption } => {
                Bsdf::Hair(Hair { fibre, absorption: absorption.iter().fold(Lanes::ZERO, |sum, s| sum + s.eval(nm)) })
            }
            // A compound material is resolved before it comes to this; unresolved it is not there.
            Kind::Boundary | Kind::Compound(_) => Bsdf::Null,
        }
    }

    /// True where the material varies over the surface.
    #[must_use]
    pub fn varies(&self) -> bool {
        match &self.kind {
            Kind::Diffuse { reflectance } => reflectance.varies(),
            Kind::Plastic { reflectance, tint, .. } => {
                reflectance.varies() || tint.as_ref().is_some_and(|tint| tint.varies())
            }
            Kind::Conductor { tint, facets, film, .. } => {
                tint.varies() || facets.as_ref().is_some_and(Roughness::varies) || film_varies(film)
            }
            Kind::Dielectric { facets, tints, film, .. } => {
                let facets = facets.as_ref().is_some_and(Roughness::varies);
                facets || tints.as_ref().is_some_and(|t| t.varies()) || film_varies(film)
            }
            Kind::Thin { tints, thickness, .. } => {
                tints.as_ref().is_some_and(|t| t.varies()) || thickness.as_ref().is_some_and(|t| t.varies())
            }
            Kind::Principled(solid) => solid.varies(),
            Kind::PrincipledThin(sheet) => sheet.varies(),
            Kind::Mirror { .. } | Kind::Hair { .. } | Kind::Boundary => false,
            Kind::Compound(compound) => compound.varies() || compound.composition.inner().iter().any(|m| m.varies()),
        }
    }

    /// True where light can cross the surface.
    #[must_use]
    #[inline]
    pub fn transmits(&self) -> bool {
        match &self.kind {
            Kind::Dielectric { .. }
            | Kind::Thin { .. }
            | Kind::PrincipledThin(_)
            | Kind::Hair { .. }
            | Kind::Boundary => true,
            Kind::Principled(solid) => solid.transmission.is_some(),
            Kind::Diffuse { .. } | Kind::Mirror { .. } | Kind::Conductor { .. } | Kind::Plastic { .. } => false,
            Kind::Compound(compound) => {
                matches!(compound.composition, Composition::Mask { .. })
                    || compound.composition.inner().iter().any(|m| m.transmits())
            }
        }
    }

    /// Priority and index of the body that the material bounds, and whether its surface shows by more than the index;
    /// `None` without a priority.
    ///
    /// # Errors
    /// In words, where parts of the surface bound different bodies.
    pub fn body(&self) -> Result<Option<(i32, RefractiveIndex, bool)>, String> {
        let leaves = self.leaves();
        let mut found = None;
        for leaf in &leaves {
            if let Kind::Dielectric { interior, tints, priority, film, .. } = &leaf.kind {
                let shows = leaves.len() > 1 || tints.is_some() || film.is_some();
                let body = priority.map(|priority| (priority, interior.clone(), shows));
                if found.get_or_insert_with(|| body.clone()) != &body {
                    return Err("expected one priority and one index all over a body, found several".into());
                }
            }
        }
        Ok(found.flatten())
    }

    /// What the inside of a body absorbs that the material bounds, m⁻¹; that of the first part that does.
    #[must_use]
    pub fn absorption(&self) -> Option<&Spectrum> {
        self.leaves().into_iter().find_map(|leaf| match &leaf.kind {
            Kind::Dielectric { absorption, .. } => absorption.as_deref(),
            _ => None,
        })
    }

    /// Whether light interferes in a film on the surface, or in the sheet that it is.
    #[must_use]
    pub fn has_film(&self) -> bool {
        match &self.kind {
            Kind::Conductor { film, .. } | Kind::Dielectric { film, .. } => film.is_some(),
            Kind::Thin { thickness, .. } => thickness.is_some(),
            _ => false,
        }
    }

    /// The layers of a material made of others.
    #[must_use]
    pub fn compound(&self) -> Option<&Compound> {
        match &self.kind {
            Kind::Compound(compound) => Some(compound),
            _ => None,
        }
    }

    /// The materials of which it is made, or itself.
    #[must_use]
    pub fn leaves(&self) -> Vec<&Material> {
        match &self.kind {
            Kind::Compound(compound) => compound.composition.inner().iter().flat_map(|m| m.leaves()).collect(),
            _ => vec![self],
        }
    }
}
