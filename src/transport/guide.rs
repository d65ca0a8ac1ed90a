//! A density on the unit square that is constant in each leaf of a tree of halves.
//!
//! What comes through a slit, or off one facet of many, is found in a small part of the square that lies anywhere: cells
//! are halved where something was found, again and again, so that a thousand finds tell a thousandth of the square.

use glam::DVec2;

/// Where something was found.
#[derive(Clone, Copy, Debug)]
pub struct Find {
    /// In the square.
    pub place: DVec2,
    /// The square of what was found over the density with which it was looked for there: the mean over all that was
    /// looked for is the integral of the square.
    pub square: f64,
}

/// A piecewise constant density.
#[derive(Clone, Debug, PartialEq)]
pub struct Guide {
    /// The root last; none for the same density everywhere.
    nodes: Vec<Node>,
}

/// A part of the square that is halved.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    /// Probability of the lower half.
    lower: f64,
    /// Whether y is halved, not x.
    across: bool,
    halves: [u32; 2],
}

/// In place of a node: a part that is not halved.
const LEAF: u32 = u32::MAX;

/// Finds, as if all were alike, that a part must have to be halved.
const FEW: f64 = 12.0;

/// Halves of halves at the most: 2⁻²⁰ of the square.
const DEPTH: u32 = 20;

/// A part and what the densities of its leaves are chosen by.
struct Part {
    node: u32,
    /// Σ √(area · ∫ square) over its leaves, and their area.
    worth: f64,
    area: f64,
}

/// The root of what squares integrate to over leaves of area a is √(a ∫), the least that sampling in proportion to it
/// leaves of the error.
fn worth(area: f64, square: f64) -> f64 {
    (area * square).sqrt()
}

impl Guide {
    /// The same everywhere.
    #[must_use]
    pub fn uniform() -> Guide {
        Guide { nodes: Vec::new() }
    }

    /// The density that leaves the least variance by what was found, with a share `anywhere` the same everywhere; and
    /// Σ √(area · ∫ square) over its leaves, but for the number of paths.
    #[must_use]
    pub fn of(finds: &mut [Find], anywhere: f64) -> (Guide, f64) {
        let total = finds.iter().map(|f| f.square).sum::<f64>();
        if total.is_nan() || total <= 0.0 {
            return (Guide::uniform(), 0.0);
        }
        let mut guide = Guide::uniform();
        let mut parts = Vec::new();
        let root = guide.grow(finds, total, [DVec2::ZERO, DVec2::ONE], 0, &mut parts);
        // Probabilities, now that the worth of all is known.
        let mass = |worth: f64, area: f64| (1.0 - anywhere) * worth / root.worth + anywhere * area;
        for (node, [lower, upper]) in guide.nodes.iter_mut().zip(&parts) {
            let [a, b] = [lower, upper].map(|part| mass(part.worth, part.area));
            node.lower = a / (a + b);
        }
        (guide, root.worth)
    }

    /// Halves the part between two corners, whose finds have squares that sum to `square`, as long as it pays.
    fn grow(
        &mut self,
        finds: &mut [Find],
        square: f64,
        [low, high]: [DVec2; 2],
        depth: u32,
        parts: &mut Vec<[Part; 2]>,
    ) -> Part {
        let size = high - low;
        let area = size.x * size.y;
        let sum = finds.iter().map(|f| f.square).sum::<f64>();
        // By what was found, not by its square, of which a few are most.
        let roots = finds.iter().map(|f| f.square.sqrt()).sum::<f64>();
        let count = if sum > 0.0 { roots * roots / sum } else { 0.0 };
        if count < FEW || depth == DEPTH {
            return Part { node: LEAF, worth: worth(area, square), area };
        }
        // Along which side are quarters more unlike? Halves may be alike although something crosses their middle.
        let quarters = |across: bool| {
            let mut sums = [0.0; 4];
            for f in finds.iter() {
                let x = (f.place - low) / size;
                let x = if across { x.y } else { x.x };
                sums[((4.0 * x) as usize).min(3)] += f.square;
            }
            sums.map(f64::sqrt).iter().sum::<f64>()
        };
        let across = quarters(true) < quarters(false);
        let middle = 0.5 * low + 0.5 * high;
        let is_lower = |f: &Find| if across { f.place.y < middle.y } else { f.place.x < middle.x };
        finds.sort_by_key(|f| !is_lower(f));
        let (below, above) = finds.split_at_mut(finds.partition_point(is_lower));
        // As if one more had been found in each half: few say nothing for sure.
        let of_lower = below.iter().map(|f| f.square).sum::<f64>() / sum;
        let shares = [of_lower, 1.0 - of_lower].map(|share| square * (share * count + 1.0) / (count + 2.0));
        let (ends, starts) = match across {
            true => (DVec2::new(high.x, middle.y), DVec2::new(low.x, middle.y)),
            false => (DVec2::new(middle.x, high.y), DVec2::new(middle.x, low.y)),
        };
        let lower = self.grow(below, shares[0], [low, ends], depth + 1, parts);
        let upper = self.grow(above, shares[1], [starts, high], depth + 1, parts);
        let whole = Part { node: self.nodes.len() as u32, worth: lower.worth + upper.worth, area };
        self.nodes.push(Node { lower: 0.5, across, halves: [lower.node, upper.node] });
        parts.push([lower, upper]);
        whole
    }

    /// The point for `u`.
    #[must_use]
    pub fn sample(&self, mut u: DVec2) -> DVec2 {
        let (mut low, mut size) = (DVec2::ZERO, DVec2::ONE);
        let mut at = self.root();
        while let Some(node) = self.nodes.get(at as usize) {
            let axis = usize::from(node.across);
            let x = u[axis];
            size[axis] *= 0.5;
            let upper = x >= node.lower;
            let (from, width) = if upper { (node.lower, 1.0 - node.lower) } else { (0.0, node.lower) };
            u[axis] = ((x - from) / width).clamp(0.0, 1.0 - f64::EPSILON);
            low[axis] += if upper { size[axis] } else { 0.0 };
            at = node.halves[usize::from(upper)];
        }
        low + size * u
    }

    /// The density at `x`; its mean over the square is one.
    #[must_use]
    pub fn density(&self, mut x: DVec2) -> f64 {
        let mut density = 1.0;
        let mut at = self.root();
        while let Some(node) = self.nodes.get(at as usize) {
            let axis = usize::from(node.across);
            // Exact, as are the halves.
            x[axis] *= 2.0;
            let upper = x[axis] >= 1.0;
            x[axis] -= if upper { 1.0 } else { 0.0 };
            density *= 2.0 * if upper { 1.0 - node.lower } else { node.lower };
            at = node.halves[usize::from(upper)];
        }
        density
    }

    fn root(&self) -> u32 {
        match self.nodes.len() {
            0 => LEAF,
            n => n as u32 - 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Finds in a slit, as wide as a hundredth of the square, that lies askew, and a few elsewhere.
    fn slit() -> Vec<Find> {
        let across = |x: f64| 0.31 + 0.2 * x;
        let along = (0..4000).map(|i| {
            let (x, y) = ((f64::from(i) + 0.5) / 4000.0, 0.01 * (f64::from(i) * 0.618).fract());
            Find { place: DVec2::new(across(x) + y, x), square: 1.0 }
        });
        let elsewhere = (0..16).map(|i| Find { place: DVec2::splat((f64::from(i) + 0.5) / 16.0), square: 0.5 });
        along.chain(elsewhere).collect()
    }

    /// Points of a regular grid land with the density that is told of their places: the mean of 1/density over them is
    /// the area, one, and that of any part of the square is its own. Those in the slit are most of them.
    #[test]
    fn points_follow_the_density_and_find_a_slit() {
        let (guide, _) = Guide::of(&mut slit(), 0.2);
        let n = 1024;
        let (mut whole, mut corner, mut found) = (0.0, 0.0, 0.0);
        for i in 0..n {
            for j in 0..n {
                let u = (DVec2::new(f64::from(i), f64::from(j)) + 0.5) / f64::from(n);
                let x = guide.sample(u);
                let share = 1.0 / (guide.density(x) * f64::from(n * n));
                whole += share;
                corner += if x.x > 0.75 && x.y < 0.25 { share } else { 0.0 };
                found += if (0.0..0.01).contains(&(x.x - 0.31 - 0.2 * x.y)) { 1.0 / f64::from(n * n) } else { 0.0 };
            }
        }
        // Each cut of the tree moves points of one row of the grid at the most: a thousandth of them, of some hundred cuts.
        assert!((whole - 1.0).abs() < 0.02 && (corner - 1.0 / 16.0).abs() < 0.005, "{whole} {corner}");
        // A hundredth of them would, did they not know: 4000 finds tell the slit from twice as much beside it.
        assert!(found > 0.25, "{found}");
    }

    /// The density integrates to one and is nowhere below the share that goes anywhere.
    #[test]
    fn nowhere_is_left_out() {
        let (guide, _) = Guide::of(&mut slit(), 0.2);
        let n = 2048;
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let density = guide.density((DVec2::new(f64::from(i), f64::from(j)) + 0.5) / f64::from(n));
                assert!(density >= 0.2 * (1.0 - 1e-12), "{density}");
                sum += density / f64::from(n * n);
            }
        }
        // Leaves are as fine as 2⁻²⁰, or 2⁻¹⁰ along each side; those of 2⁻¹² are met by chance.
        assert!((sum - 1.0).abs() < 0.02, "{sum}");
        assert_eq!(Guide::of(&mut [], 0.2), (Guide::uniform(), 0.0));
        assert_eq!(Guide::uniform().density(DVec2::splat(0.3)), 1.0);
    }
}
