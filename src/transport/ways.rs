//! Light by the way that it came: for layers that add up to the picture.
//!
//! Every path of light belongs to one [`Way`]. Counted from the camera, *direct* light was scattered once, *indirect*
//! light more often; what scattered it first decides between diffuse, glossy, transmission and media. A material with a
//! diffuse base under a coat is parted by the share that each has of f, for each wavelength, so that the layers add up to
//! the picture without noise of their own. Light that a mirror or smooth glass threw onto something else is a caustic,
//! however that is seen: paths from the lights find it, and they know no other way.
//!
//! Light is also parted by the group of its lamp. A [`Ledger`] holds both, and exists only where such layers are asked for.

use crate::spectrum::Lanes;
use std::cell::{Cell, RefCell};

/// How light came to the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Way {
    /// Straight from the lamp: the camera sees the light itself.
    Emission,
    /// Over a mirror or smooth glass onto something else, and on.
    Caustic,
    /// Scattered once, by a diffuse surface.
    DiffuseDirect,
    /// First by a diffuse surface, as seen from the camera.
    DiffuseIndirect,
    /// Scattered once, by a mirror, a gloss or a hair.
    GlossyDirect,
    /// First by one of these.
    GlossyIndirect,
    /// Once through a surface.
    TransmissionDirect,
    /// First through a surface.
    TransmissionIndirect,
    /// Scattered once, in a medium; and depth fog.
    MediaDirect,
    /// First in a medium.
    MediaIndirect,
}

/// Number of ways.
pub const WAYS: usize = 10;

/// A set of ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ways(u16);

impl Ways {
    /// All.
    pub const ALL: Ways = Ways((1 << WAYS) - 1);

    /// Those of a list.
    #[must_use]
    pub const fn of(ways: &[Way]) -> Ways {
        let (mut bits, mut i) = (0, 0);
        while i < ways.len() {
            bits |= 1 << ways[i] as u16;
            i += 1;
        }
        Ways(bits)
    }

    /// Whether the set has one.
    #[must_use]
    pub fn holds(self, way: Way) -> bool {
        self.0 & 1 << way as u16 != 0
    }

    /// What is in either.
    #[must_use]
    pub fn or(self, other: Ways) -> Ways {
        Ways(self.0 | other.0)
    }
}

/// What scattered light first, as seen from the camera.
#[derive(Clone, Copy, Debug)]
pub enum First {
    /// A surface, on the side where it came from; the share of f that is diffuse.
    Reflected(Lanes),
    /// A surface, through it.
    Transmitted,
    /// A medium.
    Media,
}

/// The light of one sample, by way and group.
#[derive(Debug)]
pub struct Ledger {
    /// Ways of the first group, of the second, …
    sums: RefCell<Vec<Lanes>>,
    /// The same of paths that are behind depth fog already.
    veiled: RefCell<Vec<Lanes>>,
    /// What is set aside from `sums`.
    aside: RefCell<Vec<Lanes>>,
    first: Cell<First>,
    /// Whether the vertex that the path is at is on something sharp.
    here: Cell<bool>,
    /// Whether the last vertex that it left was sharp.
    sharp: Cell<bool>,
    /// Whether some vertex that it left was not.
    spread: Cell<bool>,
}

/// One contribution of light.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// What it adds to the radiance of the sample.
    pub light: Lanes,
    /// The group of its lamp.
    pub group: u8,
    /// The lane that it is of, if its wavelength went alone.
    pub alone: Option<usize>,
}

impl Ledger {
    /// An empty one for lamps of so many groups.
    #[must_use]
    pub fn new(groups: usize) -> Ledger {
        Ledger {
            sums: RefCell::new(vec![Lanes::ZERO; WAYS * groups]),
            veiled: RefCell::new(vec![Lanes::ZERO; WAYS * groups]),
            aside: RefCell::new(vec![Lanes::ZERO; WAYS * groups]),
            first: Cell::new(First::Media),
            here: Cell::new(false),
            sharp: Cell::new(false),
            spread: Cell::new(false),
        }
    }

    /// Empties it.
    pub fn clear(&self) {
        self.sums.borrow_mut().fill(Lanes::ZERO);
        self.veiled.borrow_mut().fill(Lanes::ZERO);
    }

    /// The next of the wavelengths that part leaves, from a path that has met nothing but what is sharp.
    pub fn part(&self) {
        self.spread.set(false);
    }

    /// A path has come to a vertex on something `sharp` or not.
    #[inline]
    pub fn meet(&self, sharp: bool) {
        self.here.set(sharp);
    }

    /// A path leaves its `vertex`th vertex, from 0: what the first scattered, and whether this one went in a single direction.
    #[inline]
    pub fn leave(&self, vertex: u32, first: impl FnOnce() -> First, single: bool) {
        let sharp = single || self.here.get();
        self.spread.set(!sharp || vertex > 0 && self.spread.get());
        if vertex == 0 {
            self.first.set(first());
        }
        self.sharp.set(sharp);
    }

    /// Whether light that the path meets was thrown by something sharp onto something else.
    #[must_use]
    pub fn is_caustic(&self) -> bool {
        self.spread.get() && self.sharp.get()
    }

    /// Whether light that is found from the vertex that the path is at was.
    #[must_use]
    pub fn is_caustic_from_here(&self, vertex: u32) -> bool {
        vertex > 0 && self.spread.get() && self.here.get()
    }

    /// Light that the camera sees itself.
    pub fn emitted(&self, found: Found) {
        self.put(Way::Emission, found, found.light);
    }

    /// Light that was thrown by something sharp.
    pub fn caustic(&self, found: Found) {
        self.put(Way::Caustic, found, found.light);
    }

    /// Light that was scattered `times`, first as the path remembers.
    pub fn scattered(&self, found: Found, times: u32) {
        self.scattered_by(self.first.get(), found, times);
    }

    /// Light that was scattered `times`, first by `first`.
    pub fn scattered_by(&self, first: First, found: Found, times: u32) {
        let way = |direct, indirect| if times == 1 { direct } else { indirect };
        match first {
            First::Reflected(share) => {
                let diffuse = found.light * share;
                self.put(way(Way::DiffuseDirect, Way::DiffuseIndirect), found, diffuse);
                self.put(way(Way::GlossyDirect, Way::GlossyIndirect), found, found.light - diffuse);
            }
            First::Transmitted => {
                self.put(way(Way::TransmissionDirect, Way::TransmissionIndirect), found, found.light);
            }
            First::Media => self.put(way(Way::MediaDirect, Way::MediaIndirect), found, found.light),
        }
    }

    /// Light that the `vertex`th vertex reflects in a single direction, of which it and so many more, all sharp, are `times` in all.
    pub fn mirrored(&self, vertex: u32, times: u32, found: Found) {
        match vertex {
            0 => self.scattered_by(First::Reflected(Lanes::ZERO), found, times),
            _ if self.spread.get() => self.caustic(found),
            _ => self.scattered(found, vertex + times),
        }
    }

    fn put(&self, way: Way, found: Found, light: Lanes) {
        let slot = &mut self.sums.borrow_mut()[found.group as usize * WAYS + way as usize];
        match found.alone {
            None => *slot += light,
            Some(lane) => {
                let mut lanes = slot.to_array();
                lanes[lane] += light.to_array()[0];
                *slot = Lanes::new(lanes);
            }
        }
    }

    /// Dims by `factor` all that was entered since the last veil, the light of one path, and adds the `veil` of depth fog.
    pub fn veil(&self, factor: f32, veil: Lanes) {
        let mut veiled = self.veiled.borrow_mut();
        for (veiled, light) in veiled.iter_mut().zip(self.sums.borrow_mut().iter_mut()) {
            *veiled += std::mem::replace(light, Lanes::ZERO) * factor;
        }
        veiled[Way::MediaDirect as usize] += veil;
    }

    /// Sets aside what was entered so far; what comes is for others, too.
    pub fn set_aside(&self) {
        self.sums.swap(&self.aside);
    }

    /// Adds the `share` of what was entered in another to what is set aside.
    pub fn gain(&self, other: &Ledger, share: Lanes) {
        let mut aside = self.aside.borrow_mut();
        aside.iter_mut().zip(other.sums.borrow().iter()).for_each(|(own, light)| *own += share * *light);
    }

    /// Adds the `share` of what was entered in another.
    pub fn add(&self, other: &Ledger, share: f32) {
        for (own, of) in [(&self.sums, &other.sums), (&self.veiled, &other.veiled)] {
            own.borrow_mut().iter_mut().zip(of.borrow().iter()).for_each(|(own, light)| *own += *light * share);
        }
    }

    /// Takes back what was set aside and gained: in place of what was entered since, where that was `shared` among all.
    pub fn put_back(&self, shared: bool) {
        if shared {
            self.sums.borrow_mut().fill(Lanes::ZERO);
        }
        for (light, aside) in self.sums.borrow_mut().iter_mut().zip(self.aside.borrow_mut().iter_mut()) {
            *light += std::mem::replace(aside, Lanes::ZERO);
        }
    }

    /// Multiplies all with `factor`.
    pub fn scale(&self, factor: f32) {
        self.sums.borrow_mut().iter_mut().for_each(|light| *light *= factor);
        self.veiled.borrow_mut().iter_mut().for_each(|light| *light *= factor);
    }

    /// The light of `ways`, of one group or all.
    #[must_use]
    pub fn light(&self, ways: Ways, group: Option<u8>) -> Lanes {
        let (sums, veiled) = (self.sums.borrow(), self.veiled.borrow());
        let mut light = Lanes::ZERO;
        for (i, (sum, veiled)) in sums.iter().zip(veiled.iter()).enumerate() {
            let (of, way) = (i / WAYS, i % WAYS);
            if ways.0 & 1 << way != 0 && group.is_none_or(|group| usize::from(group) == of) {
                light += *sum + *veiled;
            }
        }
        light
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVERY: [Way; WAYS] = [
        Way::Emission,
        Way::Caustic,
        Way::DiffuseDirect,
        Way::DiffuseIndirect,
        Way::GlossyDirect,
        Way::GlossyIndirect,
        Way::TransmissionDirect,
        Way::TransmissionIndirect,
        Way::MediaDirect,
        Way::MediaIndirect,
    ];

    #[test]
    fn a_set_holds_what_it_was_made_of() {
        assert_eq!(Ways::of(&EVERY), Ways::ALL);
        let some = Ways::of(&[Way::Emission, Way::MediaIndirect]).or(Ways::of(&[Way::Caustic]));
        assert_eq!(EVERY.map(|way| some.holds(way)).iter().filter(|held| **held).count(), 3);
        assert!(some.holds(Way::Caustic) && !some.holds(Way::GlossyDirect));
    }

    /// One quarter diffuse, of two groups; a lane that went alone adds to that lane only.
    #[test]
    fn a_ledger_parts_by_way_and_group_and_adds_up() {
        let ledger = Ledger::new(2);
        let found = |light: f32, group, alone| Found { light: Lanes::splat(light), group, alone };
        ledger.leave(0, || First::Reflected(Lanes::splat(0.25)), false);
        ledger.scattered(found(8.0, 0, None), 1);
        ledger.scattered(found(4.0, 1, None), 2);
        ledger.emitted(found(1.0, 1, Some(3)));
        let light = |ways: &[Way], group| ledger.light(Ways::of(ways), group).to_array();
        assert_eq!(light(&[Way::DiffuseDirect], None), [2.0; 8]);
        assert_eq!(light(&[Way::GlossyDirect, Way::GlossyIndirect], None), [9.0; 8]);
        assert_eq!(light(&[Way::DiffuseIndirect], Some(0)), [0.0; 8]);
        assert_eq!(light(&[Way::Emission], Some(1)), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        ledger.veil(0.5, Lanes::splat(3.0));
        assert_eq!(ledger.light(Ways::ALL, None).to_array()[0], 9.0);
        // Another path is behind fog of its own.
        ledger.scattered(found(4.0, 1, None), 1);
        ledger.veil(0.25, Lanes::splat(2.0));
        assert_eq!(ledger.light(Ways::ALL, None).to_array()[0], 12.0);
        ledger.clear();
        assert_eq!(ledger.light(Ways::ALL, None), Lanes::ZERO);
    }
}
