//! Thin films: light that both faces of a film reflect, in phase or out of it.
//!
//! The film's faces are parallel and the light reflected between them any number of times adds up by amplitude (Airy's
//! sum), here as the characteristic matrix of Abelès: Born and Wolf, *Principles of Optics*, 1.6.2–1.6.4 and 14.4. With
//! s = sin θ on the side of the light (index 1), q_j = √(n_j² − s²) = n_j cos θ_j, the phase δ = k d q₁ and k d = 2π times
//! the film's thickness in wavelengths, the fields before and behind the film stand in the ratio of
//!
//! - for s: B = cos δ − i q₂ sin δ/q₁, C = q₂ cos δ − i q₁² sin δ/q₁, r = (q₀B − C)/(q₀B + C);
//! - for p: B = q₂ cos δ − i q₁² (n₂/n₁)² sin δ/q₁, C = n₂² cos δ − i n₁² q₂ sin δ/q₁, r = (B − q₀C)/(B + q₀C).
//!
//! Written so, nothing is divided by a cosine that may be zero, and where the light only tunnels through the film (q₁²
//! below zero) all stays real: both are divided by cosh, which leaves the hyperbolic tangent. Time runs as e^(−iωt): what
//! absorbs has the index n + ik. Unpolarised light is the mean of both polarisations. A film itself absorbs nothing, so
//! what is behind it gets 1 − R.

use crate::math::trig::sin_cos_turn;
use crate::spectrum::{LANES, Lanes};
use std::f64::consts::TAU;
use std::ops::{Add, Mul, Sub};

/// A film on a surface at one point, for light from the side of the normal.
#[derive(Clone, Copy, Debug)]
pub struct ThinFilm {
    /// Its index over that on the side of the normal.
    pub eta: Lanes,
    /// Its thickness over the wavelength on the side of the normal.
    pub thickness: Lanes,
}

/// A complex number.
#[derive(Clone, Copy, Debug)]
struct Complex {
    re: f64,
    im: f64,
}

impl Complex {
    const fn real(re: f64) -> Complex {
        Complex { re, im: 0.0 }
    }

    /// i times a real number.
    fn i(im: f64) -> Complex {
        Complex { re: 0.0, im }
    }

    fn norm2(self) -> f64 {
        self.re.mul_add(self.re, self.im * self.im)
    }

    fn scaled(self, by: f64) -> Complex {
        Complex { re: self.re * by, im: self.im * by }
    }

    /// The root whose imaginary part is not negative: of a wave that does not grow behind the surface.
    fn root(self) -> Complex {
        let size = self.norm2().sqrt();
        // The larger of the two parts first: it does not cancel.
        let larger = (0.5 * (size + self.re.abs())).sqrt();
        if larger == 0.0 {
            return Complex::real(0.0);
        }
        let smaller = 0.5 * self.im.abs() / larger;
        let (re, im) = if self.re >= 0.0 { (larger, smaller) } else { (smaller, larger) };
        // Absorption is positive, so both parts have one sign.
        Complex { re, im }
    }
}

impl Add for Complex {
    type Output = Complex;

    fn add(self, other: Complex) -> Complex {
        Complex { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Sub for Complex {
    type Output = Complex;

    fn sub(self, other: Complex) -> Complex {
        Complex { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul for Complex {
    type Output = Complex;

    fn mul(self, other: Complex) -> Complex {
        Complex { re: self.re * other.re - self.im * other.im, im: self.re.mul_add(other.im, self.im * other.re) }
    }
}

/// The share of unpolarised light at |cos θ| = `cos` that a film reflects, of index `n1` and of `thickness` wavelengths,
/// before something of the index `n2` + i`k2`; all relative to the index on this side.
#[must_use]
pub fn reflectance(cos: f64, n1: f64, thickness: f64, n2: f64, k2: f64) -> f64 {
    // n² − s² = (n − 1)(n + 1) + cos² keeps its digits at grazing.
    let cos2 = cos * cos;
    let a1 = (n1 - 1.0).mul_add(n1 + 1.0, cos2);
    let index2 = Complex { re: (n2 - k2) * (n2 + k2), im: 2.0 * n2 * k2 };
    let q2 = Complex { re: (n2 - 1.0).mul_add(n2 + 1.0, cos2) - k2 * k2, im: index2.im }.root();
    let q1 = a1.abs().sqrt();
    let turns = thickness * q1;
    // cos δ and sin δ / q₁, or those over cosh.
    let (c, s) = if q1 == 0.0 {
        (1.0, TAU * thickness)
    } else if a1 > 0.0 {
        let (sin, cos) = sin_cos_turn(turns.fract());
        (cos, sin / q1)
    } else {
        (1.0, libm::tanh(TAU * turns) / q1)
    };
    let n1_2 = n1 * n1;
    let power = |q0b: Complex, c: Complex| {
        let below = (q0b + c).norm2();
        // Only where nothing is on the other side, at grazing.
        if below > 0.0 { (q0b - c).norm2() / below } else { 1.0 }
    };
    let rs = {
        let b = Complex::real(c) - Complex::i(s) * q2;
        power(b.scaled(cos), q2.scaled(c) - Complex::i(a1 * s))
    };
    let rp = {
        let b = q2.scaled(c) - Complex::i(a1 * s / n1_2) * index2;
        power(b, (index2.scaled(c) - Complex::i(n1_2 * s) * q2).scaled(cos))
    };
    // Rounding may leave a little more than all of it.
    (0.5 * (rs + rp)).min(1.0)
}

impl ThinFilm {
    /// A film of index `index` and of `thickness_nm` at the wavelengths `nm`, where the index on the side of the normal
    /// is `outside`.
    #[must_use]
    pub fn new(index: [f64; LANES], thickness_nm: f64, outside: [f64; LANES], nm: Lanes) -> ThinFilm {
        let nm = nm.to_array();
        let lanes = |f: &dyn Fn(usize) -> f64| Lanes::new(std::array::from_fn(|k| f(k) as f32));
        ThinFilm {
            eta: lanes(&|k| index[k] / outside[k]),
            thickness: lanes(&|k| outside[k] * thickness_nm / f64::from(nm[k])),
        }
    }

    /// The film as one wavelength meets it.
    #[must_use]
    pub fn lane(&self, lane: usize) -> ThinFilm {
        let only = |x: Lanes| Lanes::splat(x.to_array()[lane]);
        ThinFilm { eta: only(self.eta), thickness: only(self.thickness) }
    }

    /// What the film reflects over a dielectric of the relative indices `eta` (inside over outside), from outside where
    /// `front`, else from inside.
    #[must_use]
    pub fn over_dielectric(&self, cos: f64, eta: [f64; LANES], front: bool) -> [f64; LANES] {
        std::array::from_fn(|k| self.of_lane(k, cos, eta[k], front))
    }

    /// The same of one lane.
    #[must_use]
    pub fn of_lane(&self, lane: usize, cos: f64, eta: f64, front: bool) -> f64 {
        let (n1, d) = (f64::from(self.eta.to_array()[lane]), f64::from(self.thickness.to_array()[lane]));
        if front { reflectance(cos, n1, d, eta, 0.0) } else { reflectance(cos, n1 / eta, d * eta, 1.0 / eta, 0.0) }
    }

    /// What the film reflects over a metal of index `eta` + i`k`, relative to the outside.
    #[must_use]
    pub fn over_metal(&self, cos: f64, eta: Lanes, k: Lanes) -> Lanes {
        let all = [self.eta, self.thickness, eta, k].map(|lanes| lanes.to_array());
        Lanes::new(std::array::from_fn(|i| {
            let [n1, d, n2, k2] = all.map(|lanes| f64::from(lanes[i]));
            reflectance(cos, n1, d, n2, k2) as f32
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::fresnel::{self, Model};

    fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
        assert!((found - expected).abs() <= tolerance, "{what}: expected {expected}, found {found}");
    }

    /// Airy's sum by amplitudes, with Fresnel's textbook coefficients and complex numbers, for each polarisation:
    /// r = (r₀₁ + r₁₂ e^(2iδ)) / (1 + r₀₁ r₁₂ e^(2iδ)).
    fn airy(cos: f64, n1: f64, thickness: f64, n2: f64, k2: f64) -> f64 {
        type C = (f64, f64);
        let mul = |a: C, b: C| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
        let add = |a: C, b: C| (a.0 + b.0, a.1 + b.1);
        let div = |a: C, b: C| {
            let n = b.0 * b.0 + b.1 * b.1;
            ((a.0 * b.0 + a.1 * b.1) / n, (a.1 * b.0 - a.0 * b.1) / n)
        };
        let root = |a: C| {
            let (r, phi) = (a.0.hypot(a.1).sqrt(), 0.5 * a.1.atan2(a.0));
            let root = (r * phi.cos(), r * phi.sin());
            if root.1 < 0.0 { (-root.0, -root.1) } else { root }
        };
        let sin2 = 1.0 - cos * cos;
        let n: [C; 3] = [(1.0, 0.0), (n1, 0.0), (n2, k2)];
        let cosine = n.map(|n| root(add((1.0, 0.0), mul((-1.0, 0.0), div((sin2, 0.0), mul(n, n))))));
        let mut sum = 0.0;
        for p in [false, true] {
            let r = |i: usize, j: usize| {
                let (a, b) = if p {
                    (mul(n[j], cosine[i]), mul(n[i], cosine[j]))
                } else {
                    (mul(n[i], cosine[i]), mul(n[j], cosine[j]))
                };
                div(add(a, mul((-1.0, 0.0), b)), add(a, b))
            };
            // e^(2iδ), δ = 2π d n₁ cos θ₁.
            let delta = mul((TAU * thickness, 0.0), mul(n[1], cosine[1]));
            let size = (-2.0 * delta.1).exp();
            let turn = (size * (2.0 * delta.0).cos(), size * (2.0 * delta.0).sin());
            let back = mul(r(1, 2), turn);
            let total = div(add(r(0, 1), back), add((1.0, 0.0), mul(r(0, 1), back)));
            sum += 0.5 * (total.0 * total.0 + total.1 * total.1);
        }
        sum
    }

    const COSINES: [f64; 7] = [1.0, 0.9, 0.7, 0.5, 0.3, 0.1, 0.01];

    /// Glass, water, metals, films denser and thinner than both sides, from inside and outside, at seven angles and
    /// eleven thicknesses. The reference cancels a little at grazing: 1e-12 is a hundred of its roundings over cos.
    #[test]
    fn the_matrix_is_airys_sum() {
        for (n1, n2, k2) in [
            (1.33, 1.0, 0.0),
            (1.33, 1.5, 0.0),
            (2.4, 1.5, 0.0),
            (1.38, 1.52, 0.0),
            (2.5, 2.7, 3.6),
            (1.46, 0.2, 3.4),
            // From inside of glass, where light may only tunnel through the film, or be reflected behind it.
            (1.0 / 1.5, 1.0, 0.0),
            (1.38 / 1.52, 1.0 / 1.52, 0.0),
            (1.33 / 1.5, 1.0 / 1.5, 0.0),
        ] {
            for cos in COSINES {
                for i in 0..=10 {
                    let d = f64::from(i) * 0.137;
                    let (found, expected) = (reflectance(cos, n1, d, n2, k2), airy(cos, n1, d, n2, k2));
                    close(found, expected, 1e-12, &format!("{n1} {n2} {k2} {cos} {d}"));
                }
            }
        }
    }

    /// A film of no thickness is none: Fresnel's equations; and so is one of either neighbour's index.
    #[test]
    fn without_thickness_there_is_no_film() {
        for eta in [1.5, 1.0 / 1.5, 2.4] {
            for cos in COSINES {
                let plain = fresnel::dielectric(Model::Exact, cos, eta).reflected;
                for (n1, d) in [(1.33, 0.0), (1.0, 0.7), (eta, 0.7)] {
                    close(reflectance(cos, n1, d, eta, 0.0), plain, 1e-14, &format!("{eta} {cos} {n1}"));
                }
            }
        }
        let (eta, k) = (0.2, 3.4);
        let plain = fresnel::conductor(Model::Exact, 0.6, Lanes::splat(eta), Lanes::splat(k)).to_array()[0];
        close(reflectance(0.6, 1.7, 0.0, f64::from(eta), f64::from(k)), f64::from(plain), 1e-7, "metal");
    }

    /// A quarter of a wave at normal incidence: R = ((n₀n₂ − n₁²)/(n₀n₂ + n₁²))² (Born and Wolf, eq. 1.6.64); half of one
    /// is as if there were no film.
    #[test]
    fn quarter_waves_quench_and_half_waves_do_not_show() {
        for (n1, n2) in [(1.38, 1.52), (1.225, 1.5), (2.3, 1.5)] {
            let expected = f64::powi((n2 - n1 * n1) / (n2 + n1 * n1), 2);
            close(reflectance(1.0, n1, 0.25 / n1, n2, 0.0), expected, 1e-15, "quarter");
            close(reflectance(1.0, n1, 0.5 / n1, n2, 0.0), f64::powi((n2 - 1.0) / (n2 + 1.0), 2), 1e-15, "half");
        }
    }

    /// The same share crosses from either side: R from outside at θ is R from inside at the refracted angle, for what
    /// absorbs nothing (Stokes).
    #[test]
    fn a_film_reflects_the_same_from_both_sides() {
        let nm = Lanes::new(std::array::from_fn(|k| 400.0 + 50.0 * k as f32));
        let film = ThinFilm::new([1.33; LANES], 420.0, [1.1; LANES], nm);
        let eta = [1.52 / 1.1; LANES];
        for cos in COSINES {
            let beyond = (1.0 - (1.0 - cos * cos) / (eta[0] * eta[0])).sqrt();
            let (out, back) = (film.over_dielectric(cos, eta, true), film.over_dielectric(beyond, eta, false));
            for k in 0..LANES {
                // The cosine outside, as that beyond implies it, is off by a rounding over itself: 2e-14 at grazing.
                close(out[k], back[k], 1e-13, &format!("{cos} {k}"));
            }
        }
    }

    /// Beyond the critical angle all is reflected, film or not, to rounding; and never more than all.
    #[test]
    fn total_reflection_stays_total() {
        for cos in [0.0, 1e-6, 0.1, 0.4, 0.6] {
            for n1 in [1.33 / 1.5, 1.6 / 1.5, 1.0 / 1.5, 0.3] {
                for d in [0.0, 0.1, 1.0, 10.0, 1e4] {
                    let found = reflectance(cos, n1, d, 1.0 / 1.5, 0.0);
                    assert!((1.0 - 1e-12..=1.0).contains(&found), "{cos} {n1} {d}: {found}");
                }
            }
        }
        // At grazing everything is a mirror.
        close(reflectance(0.0, 1.33, 0.4, 1.0, 0.0), 1.0, 1e-15, "grazing");
        // A film so thick that nothing tunnels is a mirror too.
        close(reflectance(0.3, 1.0 / 1.5, 1e3, 1.0, 0.0), 1.0, 1e-14, "thick");
    }
}
