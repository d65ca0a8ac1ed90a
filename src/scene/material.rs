//! Materials: the scattering function of a surface, for every point and wavelength.

use super::SurfacePoint;
use super::texture::{Texture, TexturePoint};
use crate::optics::bsdf::{Bsdf, Metal, pane_reflectance};
use crate::optics::dielectric::{Dielectric, RelativeIndex, RoughDielectric};
use crate::optics::fresnel::{self, Model};
use crate::optics::microfacet::Microfacets;
use crate::optics::plastic::{Base, CoatTable, Plastic, RoughPlastic};
use crate::spectrum::{Lanes, RefractiveIndex, Spectrum};
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
        tint: Spectrum,
        /// Which Fresnel formula.
        fresnel: Model,
        /// Rough or smooth.
        facets: Option<Microfacets>,
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
        facets: Option<Microfacets>,
    },
    /// A thin pane.
    Thin {
        /// Index of the pane.
        interior: RefractiveIndex,
        /// Index around it.
        exterior: RefractiveIndex,
    },
    /// A diffuse base under a clear coat.
    Plastic {
        /// Albedo of the base.
        reflectance: Texture,
        /// Index of the coat.
        eta: f64,
        /// Diffuse reflectance of the coat from inside.
        internal: f64,
        /// Colour shift of light that bounces under the coat.
        nonlinear: bool,
        /// Rough coat.
        rough: Option<(Microfacets, Arc<CoatTable>)>,
    },
    /// The boundary of a medium.
    Boundary,
}

impl Kind {
    /// A plastic; computes the coat's tables.
    #[must_use]
    pub fn plastic(reflectance: Texture, eta: f64, nonlinear: bool, facets: Option<Microfacets>) -> Kind {
        let rough = facets.map(|f| (f, Arc::new(CoatTable::new(eta, &f))));
        let internal = match &rough {
            Some((_, table)) => table.internal,
            None => fresnel::dielectric_diffuse(1.0 / eta),
        };
        Kind::Plastic { reflectance, eta, internal, nonlinear, rough }
    }
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

impl Material {
    /// True where light may go straight through, so that a lamp behind is looked for.
    #[must_use]
    pub fn lets_through(&self) -> bool {
        matches!(self.kind, Kind::Boundary | Kind::Thin { .. })
    }

    /// What goes straight through at `surface` in `direction`; `None` where nothing can.
    #[must_use]
    #[inline]
    pub fn straight(
        &self,
        surface: &SurfacePoint,
        direction: DVec3,
        _at: impl FnOnce() -> TexturePoint,
        nm: Lanes,
    ) -> Option<Straight> {
        match &self.kind {
            Kind::Boundary => Some(Straight { share: 1.0, weight: Lanes::ONE }),
            Kind::Thin { interior, exterior } => {
                let eta = relative_index(interior, exterior, nm, false).hero();
                let cos = direction.dot(surface.shading_normal).abs();
                Some(Straight { share: 1.0 - pane_reflectance(cos, eta), weight: Lanes::ONE })
            }
            _ => None,
        }
    }

    /// The scattering function at a point for the wavelengths `nm`. `all_dispersive` treats every
    /// glass as if its index depended on wavelength (`effects: all`).
    #[must_use]
    pub fn bsdf(&self, at: &TexturePoint, nm: Lanes, all_dispersive: bool) -> Bsdf {
        match &self.kind {
            Kind::Diffuse { reflectance } => Bsdf::Diffuse { reflectance: reflectance.eval(at, nm) },
            Kind::Mirror { reflectance } => Bsdf::Mirror { reflectance: reflectance.eval(nm) },
            Kind::Conductor { eta, k, tint, fresnel, facets } => {
                let metal = Metal { eta: eta.eval(nm), k: k.eval(nm), tint: tint.eval(nm), fresnel: *fresnel };
                match facets {
                    Some(facets) => Bsdf::RoughConductor(metal, *facets),
                    None => Bsdf::Conductor(metal),
                }
            }
            Kind::Dielectric { interior, exterior, fresnel, facets } => {
                let eta = relative_index(interior, exterior, nm, all_dispersive);
                match facets {
                    Some(facets) => Bsdf::RoughDielectric(RoughDielectric { eta, facets: *facets }),
                    None => Bsdf::Dielectric(Dielectric { eta, fresnel: *fresnel }),
                }
            }
            Kind::Thin { interior, exterior } => {
                Bsdf::Thin { eta: relative_index(interior, exterior, nm, false).hero() }
            }
            Kind::Plastic { reflectance, eta, internal, nonlinear, rough } => {
                let base = Base {
                    reflectance: reflectance.eval(at, nm),
                    eta: *eta,
                    internal: *internal,
                    nonlinear: *nonlinear,
                };
                match rough {
                    Some((facets, table)) => {
                        Bsdf::RoughPlastic(RoughPlastic { base, facets: *facets, table: table.clone() })
                    }
                    None => Bsdf::Plastic(Plastic { base }),
                }
            }
            Kind::Boundary => Bsdf::Null,
        }
    }

    /// True where the material varies over the surface.
    #[must_use]
    pub fn varies(&self) -> bool {
        match &self.kind {
            Kind::Diffuse { reflectance } | Kind::Plastic { reflectance, .. } => reflectance.varies(),
            Kind::Mirror { .. }
            | Kind::Conductor { .. }
            | Kind::Dielectric { .. }
            | Kind::Thin { .. }
            | Kind::Boundary => false,
        }
    }

    /// True where light can cross the surface.
    #[must_use]
    pub fn transmits(&self) -> bool {
        matches!(self.kind, Kind::Dielectric { .. } | Kind::Thin { .. } | Kind::Boundary)
    }
}
