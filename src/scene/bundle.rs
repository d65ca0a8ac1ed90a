//! Eight rays that lie close together, four at a time where the scene has few things.

use super::{Hit, Scene};
use crate::math::{Departure, Ray};
use crate::spectrum::LANES;

/// The lanes whose bits are set.
pub fn each(lanes: u8) -> impl Iterator<Item = usize> {
    (0..LANES).filter(move |lane| lanes >> lane & 1 == 1)
}

/// Shows `visit` the lanes whose bits are set, four at a time: what is beyond the count repeats the first.
fn by_fours(lanes: u8, mut visit: impl FnMut([usize; 4], usize)) {
    let mut left = each(lanes);
    while let Some(first) = left.next() {
        let (mut group, mut count) = ([first; 4], 1);
        while count < 4
            && let Some(lane) = left.next()
        {
            group[count] = lane;
            count += 1;
        }
        visit(group, count);
    }
}

impl Scene {
    /// [`Scene::closest`] for the rays whose bits are in `lanes`; `None` for the others.
    #[must_use]
    pub fn closest_of(&self, rays: &[Ray; LANES], lanes: u8) -> [Option<Hit>; LANES] {
        let mut best = [None; LANES];
        by_fours(lanes, |group, count| {
            let [a, b, c, d] = group;
            let mut hits = [None; 4];
            self.closest_of_four([&rays[a], &rays[b], &rays[c], &rays[d]], [f64::INFINITY; 4], count, &mut hits);
            group.into_iter().zip(hits).take(count).for_each(|(lane, hit)| best[lane] = hit);
        });
        best
    }

    /// The rays among `lanes` in whose way anything stands before their `distances`, a bit each; see
    /// [`Scene::occluded`].
    #[must_use]
    pub fn occluded_of(
        &self,
        rays: &[Ray; LANES],
        distances: &[f64; LANES],
        lanes: u8,
        target: Option<Departure>,
    ) -> u8 {
        let mut hidden = 0;
        by_fours(lanes, |group, count| {
            let [a, b, c, d] = group;
            let (four, far) = ([&rays[a], &rays[b], &rays[c], &rays[d]], group.map(|lane| distances[lane]));
            let found = self.occluded_of_four(four, far, [target; 4], count);
            let of = |i: usize| u8::from(found >> i & 1 == 1) << group[i];
            hidden |= (0..count).fold(0, |set, i| set | of(i));
        });
        hidden
    }
}
