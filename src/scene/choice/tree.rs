//! Lights by what they may give to a point, in a tree of eight children a node.

use super::gift::{Extent, Gift};
use crate::math::inverse_power_of_two;
use crate::scene::Object;
use crate::scene::bvh::Aabb;
use crate::scene::light::Light;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use wide::f32x8;

/// Bit of a child word that marks a light.
const LEAF: u32 = 1 << 31;

/// Eight extents, in coordinates of the tree, and where they lead.
#[derive(Clone, Debug)]
struct Node {
    center: [f32x8; 3],
    radius2: f32x8,
    intensity: f32x8,
    axis: [f32x8; 3],
    /// Cosine and sine of the spread.
    spread: [f32x8; 2],
    /// Cosine of the reach.
    reach: f32x8,
    /// 1 where the light is even, else 0.
    even: f32x8,
    /// A light with [`LEAF`], or a node.
    children: [u32; 8],
}

/// Light from infinity.
#[derive(Clone, Copy, Debug)]
struct Distant {
    light: u32,
    toward: Option<Vec3>,
    surface: f32,
    point: f32,
}

/// Where a light is found.
#[derive(Clone, Copy, Debug)]
enum Place {
    Child { node: u32, lane: u32 },
    Distant(u32),
}

/// The lights of a scene by what they have to give.
#[derive(Clone, Debug)]
pub struct Choice {
    nodes: Vec<Node>,
    /// Of each node but the first, the node and lane that lead to it.
    parents: Vec<(u32, u32)>,
    distant: Vec<Distant>,
    places: Vec<Place>,
    center: DVec3,
    /// Of lengths, a power of two.
    scale: f64,
}

/// In which lights are judged: their places and the points that ask, as f32.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Its middle: that of the scene.
    pub center: DVec3,
    /// What is 1 or a little more in it: how far the scene reaches from there.
    pub radius: f64,
    /// The eye of the camera.
    pub eye: DVec3,
}

/// By how many times as far as half of the lamps are from the eye a scene may reach: f32 then tells their places to 2⁻¹⁰ of that.
const FAR: f64 = (1u64 << 14) as f64;

impl Frame {
    /// For `gifts`. Where something stands so far away that f32 does not tell places at all well that are about the eye, that is the
    /// middle, and the distance from there within which half of the lamps are is 1.
    fn about(self, gifts: &[Gift]) -> Frame {
        let distance = |gift: &Gift| match gift {
            Gift::Near(extent) => Some((extent.center - self.eye).length()),
            Gift::Distant { .. } => None,
        };
        let mut distances: Vec<f64> = gifts.iter().filter_map(distance).collect();
        distances.sort_by(f64::total_cmp);
        match distances.len().checked_sub(1).map(|last| distances[last / 2]) {
            Some(half) if half > 0.0 && self.radius > FAR * half => Frame { center: self.eye, radius: half, ..self },
            _ => self,
        }
    }
}

/// A point that asks, in coordinates of the tree, and the normal of the side that it asks for.
#[derive(Clone, Debug)]
pub(super) struct Asking {
    point: Vec3,
    normal: Option<Vec3>,
}

/// The weights at the root: of eight children, of each light from infinity, and their sum.
#[derive(Clone, Debug)]
pub(super) struct Root {
    near: [f32; 8],
    pub(super) sum: f32,
}

impl Choice {
    /// Of `lights` of [`Light::power`] `powers`, which count as often as `weights` say, in a scene of this `frame`. `None` where every
    /// point would choose alike.
    #[must_use]
    pub fn of(lights: &[Light], powers: &[f64], weights: &[f64], objects: &[Object], frame: Frame) -> Option<Choice> {
        if lights.len() < 2 {
            return None;
        }
        let gifts: Vec<Gift> =
            lights.iter().zip(powers).map(|(light, &power)| Gift::of(light, power, objects)).collect();
        let Frame { center, radius, .. } = frame.about(&gifts);
        // A power of two, so that a scene times a power of two has the same tree; its square is finite.
        let scale = inverse_power_of_two(radius.clamp(1e-150, 1e150));
        let mut near = Vec::new();
        let mut distant = Vec::new();
        for ((i, gift), &weight) in (0u32..).zip(gifts).zip(weights) {
            match gift {
                Gift::Near(extent) => {
                    let intensity = weight * extent.intensity * scale * scale;
                    let center = (extent.center - center) * scale;
                    near.push((i, Extent { center, radius: extent.radius * scale, intensity, ..extent }));
                }
                Gift::Distant { toward, surface, point } => distant.push((i, toward, weight * surface, weight * point)),
            }
        }
        if near.is_empty() && distant.iter().all(|(_, toward, ..)| toward.is_none()) {
            return None;
        }
        let strongest = near.iter().map(|(_, e)| e.intensity).chain(distant.iter().map(|d| d.3)).fold(0.0, f64::max);
        let per_unit = 1.0 / strongest;
        if !(per_unit.is_finite() && per_unit > 0.0) || near.iter().any(|(_, e)| !e.bounds().is_finite()) {
            return None;
        }
        near.iter_mut().for_each(|(_, extent)| extent.intensity *= per_unit);
        let mut places = vec![Place::Distant(0); lights.len()];
        let distant = distant.iter().map(|&(light, toward, surface, point)| Distant {
            light,
            toward: toward.map(|t| t.as_vec3()),
            surface: (surface * per_unit) as f32,
            point: (point * per_unit) as f32,
        });
        let distant: Vec<Distant> = distant.collect();
        (0..).zip(&distant).for_each(|(k, d)| places[d.light as usize] = Place::Distant(k));
        let mut choice = Choice { nodes: Vec::new(), parents: Vec::new(), distant, places, center, scale };
        choice.build(&mut near, (0, 0));
        Some(choice)
    }

    /// Adds a node over `all`, which `parent` leads to; its index.
    fn build(&mut self, all: &mut [(u32, Extent)], parent: (u32, u32)) -> u32 {
        let index = self.nodes.len() as u32;
        self.nodes.push(Node::EMPTY);
        self.parents.push(parent);
        // The group that is widest for its strength is cut until there are eight.
        let mut groups: Vec<&mut [(u32, Extent)]> = if all.is_empty() { vec![] } else { vec![all] };
        while groups.len() < 8 {
            let size = |group: &[(u32, Extent)]| {
                let all = group.iter().fold(Aabb::EMPTY, |b, (_, e)| b.union(&e.bounds()));
                (all.max - all.min).length_squared() * group.iter().map(|(_, e)| e.intensity).sum::<f64>()
            };
            let widest = (0..groups.len()).filter(|&i| groups[i].len() > 1);
            let Some(widest) = widest.max_by(|&a, &b| size(groups[a]).total_cmp(&size(groups[b]))) else { break };
            let group = groups.swap_remove(widest);
            let middle = parting(group);
            let (left, right) = group.split_at_mut(middle);
            groups.extend([left, right]);
        }
        for (lane, group) in groups.into_iter().enumerate() {
            let extents: Vec<Extent> = group.iter().map(|(_, extent)| *extent).collect();
            let child = match group {
                [(light, _)] => {
                    self.places[*light as usize] = Place::Child { node: index, lane: lane as u32 };
                    *light | LEAF
                }
                group => self.build(group, (index, lane as u32)),
            };
            let extent = if extents.len() == 1 { extents[0] } else { Extent::around(&extents) };
            self.nodes[index as usize].set(lane, &extent, child);
        }
        index
    }

    /// The point that asks, in coordinates of the tree.
    pub(super) fn asking(&self, point: DVec3, normal: Option<DVec3>) -> Asking {
        Asking { point: ((point - self.center) * self.scale).as_vec3(), normal: normal.map(|n| n.as_vec3()) }
    }

    /// What all may give to a point; `None` where that is nothing.
    #[inline(never)]
    pub(super) fn judge(&self, point: DVec3, normal: Option<DVec3>) -> Option<(Asking, Root)> {
        let asking = self.asking(point, normal);
        self.root(&asking).map(|root| (asking, root))
    }

    /// What each may give, if any may give anything.
    pub(super) fn root(&self, asking: &Asking) -> Option<Root> {
        let near = self.nodes[0].weigh(asking).to_array();
        let sum = near.iter().sum::<f32>() + self.distant.iter().map(|d| d.weigh(asking)).sum::<f32>();
        (sum > 0.0 && sum.is_finite()).then_some(Root { near, sum })
    }

    /// A light by `u` in [0, 1), and its probability.
    pub(super) fn choose(&self, asking: &Asking, root: &Root, u: f64) -> Option<(u32, f64)> {
        let mut rest = u * f64::from(root.sum);
        let mut fallen = None;
        for distant in &self.distant {
            let weight = f64::from(distant.weigh(asking));
            if weight == 0.0 {
                continue;
            }
            fallen = Some((distant.light, weight / f64::from(root.sum)));
            if rest < weight {
                return fallen;
            }
            rest -= weight;
        }
        if root.near == [0.0; 8] {
            return fallen;
        }
        let (mut node, mut weights, mut probability) = (0, root.near, 1.0 / f64::from(root.sum));
        loop {
            // The last that weighs anything takes what rounding leaves over.
            let last = weights.iter().rposition(|&w| w > 0.0)?;
            let mut lane = 0;
            while lane < last && rest >= f64::from(weights[lane]) {
                rest -= f64::from(weights[lane]);
                lane += 1;
            }
            let weight = f64::from(weights[lane]);
            if weight == 0.0 {
                return None;
            }
            probability *= weight;
            let child = self.nodes[node].children[lane];
            if child & LEAF != 0 {
                return Some((child & !LEAF, probability));
            }
            let part = (rest / weight).clamp(0.0, 1.0);
            node = child as usize;
            weights = self.nodes[node].weigh(asking).to_array();
            let sum = f64::from(weights.iter().sum::<f32>());
            if !(sum > 0.0 && sum.is_finite()) {
                return None;
            }
            probability /= sum;
            rest = part * sum;
        }
    }

    /// What the `k`th light from infinity may give, of `all`.
    fn share_of_distant(&self, k: u32, asking: &Asking, all: f32) -> f64 {
        f64::from(self.distant[k as usize].weigh(asking)) / f64::from(all)
    }

    /// The probability of [`Choice::choose`] for a light, and what all may give as it was `judged`: zero where that is not known.
    /// `None` where none may give anything.
    pub(super) fn probability_at(&self, asking: &Asking, light: u32, judged: f32) -> Option<f64> {
        if let Place::Distant(k) = self.places[light as usize]
            && judged > 0.0
        {
            return Some(self.share_of_distant(k, asking, judged));
        }
        let root = self.root(asking)?;
        Some(self.probability(asking, &root, light))
    }

    /// The same of a point that is judged from the `root` down.
    pub(super) fn probability(&self, asking: &Asking, root: &Root, light: u32) -> f64 {
        let (mut node, mut lane) = match self.places[light as usize] {
            Place::Distant(k) => return self.share_of_distant(k, asking, root.sum),
            Place::Child { node, lane } => (node, lane),
        };
        let mut probability = 1.0 / f64::from(root.sum);
        while node != 0 {
            let weights = self.nodes[node as usize].weigh(asking).to_array();
            let sum = f64::from(weights.iter().sum::<f32>());
            if !(sum > 0.0 && sum.is_finite()) {
                return 0.0;
            }
            probability *= f64::from(weights[lane as usize]) / sum;
            (node, lane) = self.parents[node as usize];
        }
        probability * f64::from(root.near[lane as usize])
    }
}

/// Sorts a group of two or more along an axis; where it is best cut in two, so that the sum of intensity times size is
/// least, and of several such cuts the one that leaves the larger half smallest: lamps in one place make no list.
fn parting(group: &mut [(u32, Extent)]) -> usize {
    let cost = |bounds: &Aabb, intensity: f64| (bounds.max - bounds.min).length_squared() * intensity;
    let by = |axis: usize| {
        move |a: &(u32, Extent), b: &(u32, Extent)| a.1.center[axis].total_cmp(&b.1.center[axis]).then(a.0.cmp(&b.0))
    };
    let mut best = (f64::INFINITY, 0, group.len() / 2);
    let all_of = group.len();
    let uneven = |at: usize| (2 * at).abs_diff(all_of);
    for axis in 0..3 {
        group.sort_unstable_by(by(axis));
        let sweep = |order: &mut dyn Iterator<Item = &(u32, Extent)>| -> Vec<f64> {
            let (mut bounds, mut intensity) = (Aabb::EMPTY, 0.0);
            let add = |(_, extent): &(u32, Extent)| {
                bounds = bounds.union(&extent.bounds());
                intensity += extent.intensity;
                cost(&bounds, intensity)
            };
            order.map(add).collect()
        };
        let left = sweep(&mut group.iter());
        let right = sweep(&mut group.iter().rev());
        for at in 1..group.len() {
            let all = left[at - 1] + right[group.len() - at - 1];
            if all < best.0 || all == best.0 && uneven(at) < uneven(best.2) {
                best = (all, axis, at);
            }
        }
    }
    let (_, axis, at) = best;
    group.sort_unstable_by(by(axis));
    at
}

impl Distant {
    fn weigh(&self, asking: &Asking) -> f32 {
        match (asking.normal, self.toward) {
            (Some(normal), Some(toward)) => self.surface * normal.dot(toward).max(0.0),
            (Some(_), None) => self.surface,
            (None, _) => self.point,
        }
    }
}

impl Node {
    const EMPTY: Node = Node {
        center: [f32x8::ZERO; 3],
        radius2: f32x8::ONE,
        intensity: f32x8::ZERO,
        axis: [f32x8::ZERO; 3],
        spread: [f32x8::ONE, f32x8::ZERO],
        reach: f32x8::ZERO,
        even: f32x8::ZERO,
        children: [LEAF; 8],
    };

    fn set(&mut self, lane: usize, e: &Extent, child: u32) {
        let put = |to: &mut f32x8, x: f64| to.as_mut_array()[lane] = x as f32;
        for axis in 0..3 {
            put(&mut self.center[axis], e.center[axis]);
            put(&mut self.axis[axis], e.axis[axis]);
        }
        put(&mut self.radius2, e.radius * e.radius);
        put(&mut self.intensity, e.intensity);
        put(&mut self.spread[0], libm::cos(e.spread));
        put(&mut self.spread[1], libm::sin(e.spread));
        put(&mut self.reach, libm::cos(e.reach.min(PI)));
        put(&mut self.even, f64::from(u8::from(e.even)));
        self.children[lane] = child;
    }

    /// What each child may give, up to a factor.
    ///
    /// Sines are lengths of cross products, so that all is as well known as the coordinates: where a point lies to 2⁻²⁴
    /// of the scene must not decide how it chooses. A point on a round lamp counts as outside of its ball.
    #[inline]
    fn weigh(&self, asking: &Asking) -> f32x8 {
        /// Of the square of the radius: further inside nothing is known of directions.
        const INSIDE: f32 = 0.998;
        let (zero, one) = (f32x8::ZERO, f32x8::ONE);
        let dot = |a: &[f32x8; 3], b: &[f32x8; 3]| a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]));
        let [px, py, pz] = asking.point.to_array().map(f32x8::splat);
        let v = [self.center[0] - px, self.center[1] - py, self.center[2] - pz];
        let d2 = dot(&v, &v);
        let within = d2.simd_lt(self.radius2 * f32x8::splat(INSIDE));
        let inverse = one / d2.sqrt();
        // Cosine and sine of the angle of a unit vector with the way to the ball.
        let angle = |a: &[f32x8; 3]| {
            let x = a[1].mul_sub(v[2], a[2] * v[1]);
            let y = a[2].mul_sub(v[0], a[0] * v[2]);
            let z = a[0].mul_sub(v[1], a[1] * v[0]);
            (dot(a, &v) * inverse, dot(&[x, y, z], &[x, y, z]).sqrt() * inverse)
        };
        // The cosine of an angle less that in which the ball is seen.
        let sin2_ball = (self.radius2 / d2).fast_min(one);
        let (cos_ball, sin_ball) = ((one - sin2_ball).sqrt(), sin2_ball.sqrt());
        let less_ball =
            |c: f32x8, s: f32x8| c.simd_ge(cos_ball).select(one, c.mul_add(cos_ball, s * sin_ball).fast_max(zero));
        // From the nearest normal to the nearest way from the ball to the point.
        let (toward, sin) = angle(&self.axis);
        let [cos_spread, sin_spread] = self.spread;
        let spread = (-toward).simd_ge(cos_spread);
        let c = spread.select(one, sin.mul_sub(sin_spread, toward * cos_spread));
        let s = spread.select(zero, sin.mul_add(cos_spread, toward * sin_spread));
        let c = less_ball(c, s);
        let lit = within | c.simd_ge(self.reach);
        let emitted = within.select(one, c.fast_max(self.even));
        let falling = match asking.normal {
            None => one,
            Some(normal) => {
                let (c, s) = angle(&normal.to_array().map(f32x8::splat));
                within.select(one, less_ball(c, s))
            }
        };
        lit.select(self.intensity * emitted * falling / d2.fast_max(self.radius2), zero)
    }
}
