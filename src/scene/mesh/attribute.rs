//! Attributes of a mesh: numbers at its vertices or on its faces, beside position, normal and texture
//! coordinates.
//!
//! # Names
//! In a PLY file an attribute is a run of properties of one element whose names are the same but for a
//! last letter after an underscore, in one of the orders `x y z`, `r g b`, `0 1 2`, `1 2 3`: `paint_0
//! paint_1 paint_2` of a vertex is the attribute `vertex_paint`; of a face, `face_paint`. With `r g b` the
//! name is lengthened, `paint_r paint_g paint_b` is `vertex_paint_color`. The properties `r g b` or `red
//! green blue` are the attribute `vertex_color` or `face_color`; whole numbers there count from 0 to the
//! greatest of their type. An attribute has one number or three; other properties are passed over.

use crate::scene::texture::{TexturePoint, even_shares, luminance, mean_luminance, outside, spread};
use crate::spectrum::{Carried, Lanes, Spectrum, upsample};
use glam::DVec3;
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;

/// What an attribute has values for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// Each vertex.
    Vertex,
    /// Each triangle.
    Face,
}

/// One attribute.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute {
    /// With `vertex_` or `face_` before it.
    pub name: String,
    /// What it has values for.
    pub element: Element,
    /// Numbers a value: 1 or 3.
    pub channels: usize,
    /// Value by value.
    pub values: Vec<f32>,
}

/// An attribute of one mesh as something that varies over its surface: between the vertices of a triangle
/// linearly, and on a face the same everywhere.
#[derive(Clone, Debug)]
pub struct AttributeTexture {
    field: Arc<Field>,
    /// Factor on the values.
    scale: f64,
}

#[derive(Debug)]
struct Field {
    element: Element,
    /// The numbers; all three are the same where there is one.
    values: Vec<[f32; 3]>,
    /// For three numbers the coefficients of the spectra that they are upsampled to, and their factors.
    sigmoids: Vec<([f32; 3], f32)>,
    /// The vertices of each triangle, in the order that barycentric coordinates count them in.
    triangles: Vec<[u32; 3]>,
}

impl AttributeTexture {
    /// The attribute of a mesh with these triangles.
    #[must_use]
    pub fn new(attribute: &Attribute, triangles: &[[u32; 3]], scale: f64, carried: Carried) -> AttributeTexture {
        let three = attribute.channels == 3;
        let values: Vec<[f32; 3]> = match attribute.channels {
            3 => attribute.values.as_chunks().0.to_vec(),
            _ => attribute.values.iter().map(|&x| [x; 3]).collect(),
        };
        let sigmoids = if three { values.iter().map(|&rgb| carried.texel(rgb)).collect() } else { Vec::new() };
        let triangles = if attribute.element == Element::Vertex { triangles.to_vec() } else { Vec::new() };
        AttributeTexture { field: Arc::new(Field { element: attribute.element, values, sigmoids, triangles }), scale }
    }

    /// The values that count at a point, and their weights.
    fn weighted(&self, at: &TexturePoint) -> [(usize, f64); 3] {
        let part = at.part as usize;
        match self.field.element {
            Element::Face => [(part, 1.0), (part, 0.0), (part, 0.0)],
            Element::Vertex => {
                let [a, b, c] = self.field.triangles[part].map(|v| v as usize);
                let [b1, b2] = at.barycentric;
                [(a, 1.0 - b1 - b2), (b, b1), (c, b2)]
            }
        }
    }

    /// The spectrum at a point: one number at all wavelengths, or the mean of the upsampled colours.
    #[must_use]
    pub fn eval(&self, at: &TexturePoint, nm: Lanes) -> Lanes {
        if self.field.sigmoids.is_empty() {
            return Lanes::splat(self.triple(at).x as f32);
        }
        let all = self.weighted(at).into_iter().filter(|(_, w)| *w != 0.0);
        let spectra = all.map(|(i, w)| {
            let (c, factor) = self.field.sigmoids[i];
            upsample::eval_sigmoid(c, nm) * (w * self.scale * f64::from(factor)) as f32
        });
        spectra.fold(Lanes::ZERO, |sum, s| sum + s)
    }

    /// The three numbers at a point, equal for an attribute of one.
    #[must_use]
    pub fn triple(&self, at: &TexturePoint) -> DVec3 {
        let value = |i: usize| DVec3::from(self.field.values[i].map(f64::from));
        self.weighted(at).into_iter().map(|(i, w)| value(i) * w).sum::<DVec3>() * self.scale
    }

    /// The first number that, by its scale, is below 0 or above 1.
    #[must_use]
    pub fn no_share(&self) -> Option<f32> {
        let mut scaled = self.field.values.iter().flatten().map(|&x| (f64::from(x) * self.scale) as f32);
        scaled.find(|x| !(0.0..=1.0).contains(x))
    }

    /// The first number outside `bounds` that, by its scale, it has; of three their mean by luminance.
    #[must_use]
    pub fn outside(&self, bounds: &RangeInclusive<f64>) -> Option<f64> {
        self.field.values.iter().find_map(|&rgb| outside(rgb, self.scale, bounds))
    }

    /// Some 16 of the spectra and the brightest, for the choice of wavelengths.
    #[must_use]
    pub fn representatives(&self) -> Vec<Spectrum> {
        spread(self.field.values.len(), 16).chain(self.brightest()).map(|i| self.spectrum(i)).collect()
    }

    /// The mean luminance of what stands in the file, as [`Texture::mean_luminance`](crate::scene::texture::Texture::mean_luminance).
    #[must_use]
    pub fn mean_luminance(&self) -> f64 {
        let brightest = self.brightest().map(|i| self.spectrum(i));
        mean_luminance(self.field.values.len(), brightest, |i| self.spectrum(i))
    }

    /// Some of its spectra and their shares, as [`Texture::shares`](crate::scene::texture::Texture::shares).
    #[must_use]
    pub fn shares(&self) -> Vec<(f64, Spectrum)> {
        even_shares(self.field.values.len(), |i| self.spectrum(i))
    }

    fn brightest(&self) -> Option<usize> {
        let value = |i: &usize| self.field.values[*i].iter().sum::<f32>();
        (0..self.field.values.len()).max_by(|a, b| value(a).total_cmp(&value(b)))
    }

    fn spectrum(&self, i: usize) -> Spectrum {
        let scale = self.scale as f32;
        match self.field.sigmoids.get(i) {
            Some(&(c, factor)) => Spectrum::Sigmoid { c, scale: scale * factor },
            None => Spectrum::Constant(self.field.values[i][0] * scale),
        }
    }
}

/// The mean of the attribute `name` of mesh `index` of a file, as the one number that its three are where one is wanted; `None` where
/// it has not three, and of a file that cannot be read.
pub(super) fn mean_of_three(path: &Path, index: u32, name: &str) -> Option<f64> {
    let source = super::load(path, index).ok()?;
    let attribute =
        source.attributes.into_iter().find(|attribute| attribute.name == name && attribute.channels == 3)?;
    let triples = attribute.values.as_chunks::<3>().0;
    Some(triples.iter().map(|&rgb| f64::from(luminance(rgb))).sum::<f64>() / triples.len().max(1) as f64)
}

/// A property of a file that may be part of an attribute.
pub(super) struct Column {
    pub(super) name: String,
    /// Whether it is used already.
    pub(super) taken: bool,
    /// What a colour of it is to be multiplied by to lie between zero and one.
    pub(super) unit: f32,
}

/// A column that a channel of an attribute is read from, and the factor on its numbers.
pub(super) type Channel = (usize, f32);

/// Endings by order of channels, one order a row.
const ENDINGS: [[char; 3]; 4] = [['x', 'y', 'z'], ['r', 'g', 'b'], ['0', '1', '2'], ['1', '2', '3']];
/// The row of colours.
const COLOUR: usize = 1;

/// The attributes that the columns of an element make, still without values, and the columns that each is
/// made of.
pub(super) fn named_columns(element: Element, columns: &[Column]) -> Vec<(Attribute, Vec<Channel>)> {
    let mut out: Vec<(Attribute, Vec<Channel>)> = Vec::new();
    let before = match element {
        Element::Vertex => "vertex_",
        Element::Face => "face_",
    };
    let mut add = |name: &str, from: Vec<Channel>| {
        let name = format!("{before}{name}");
        if [1, 3].contains(&from.len()) && out.iter().all(|(a, _)| a.name != name) {
            out.push((Attribute { name, element, channels: from.len(), values: Vec::new() }, from));
        }
    };
    let find = |name: &str| columns.iter().position(|c| !c.taken && c.name == name);
    let mut used = vec![false; columns.len()];
    for names in [["r", "g", "b"], ["red", "green", "blue"]] {
        if let [Some(r), Some(g), Some(b)] = names.map(find) {
            add("color", [r, g, b].map(|k| (k, columns[k].unit)).to_vec());
            [r, g, b].into_iter().for_each(|k| used[k] = true);
            break;
        }
    }
    let mut i = 0;
    while i < columns.len() {
        let ending = |k: usize| -> Option<(&str, char)> {
            let column = columns.get(k).filter(|c| !c.taken && !used[k])?;
            let (stem, last) = column.name.rsplit_once('_')?;
            let mut letters = last.chars();
            letters.next().filter(|_| letters.next().is_none()).map(|c| (stem, c))
        };
        let start = i;
        i += 1;
        let Some((stem, first)) = ending(start) else { continue };
        let Some(order) = ENDINGS.iter().position(|order| order[0] == first) else { continue };
        // The run goes on as long as the name does; it counts only if its letters are those of the order.
        let mut length = 1;
        while ending(start + length).is_some_and(|(s, _)| s == stem) {
            length += 1;
        }
        i = start + length;
        let in_order = (0..length).all(|k| ending(start + k).map(|(_, c)| c) == ENDINGS[order].get(k).copied());
        if in_order {
            let name = if order == COLOUR { format!("{stem}_color") } else { stem.to_owned() };
            add(&name, (start..start + length).map(|k| (k, 1.0)).collect());
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(names: &str) -> Vec<String> {
        let columns: Vec<Column> =
            names.split_whitespace().map(|n| Column { name: n.into(), taken: n == "x", unit: 1.0 }).collect();
        let named = named_columns(Element::Vertex, &columns);
        let columns = |from: Vec<Channel>| from.into_iter().map(|(k, _)| k).collect::<Vec<usize>>();
        named.into_iter().map(|(a, from)| format!("{}{:?}", a.name, columns(from))).collect()
    }

    #[test]
    fn attributes_are_runs_of_names() {
        assert_eq!(found("x color_0 color_1 color_2 weight_0"), ["vertex_color[1, 2, 3]", "vertex_weight[4]"]);
        assert_eq!(found("red green blue alpha"), ["vertex_color[0, 1, 2]"]);
        assert_eq!(found("b g r"), ["vertex_color[2, 1, 0]"]);
        assert_eq!(found("paint_r paint_g paint_b"), ["vertex_paint_color[0, 1, 2]"]);
        assert_eq!(found("flow_x flow_y flow_z heat_1"), ["vertex_flow[0, 1, 2]", "vertex_heat[3]"]);
        // Two or four numbers, a wrong order, a name without ending, a repeated name.
        for none in ["a_0 a_1", "a_0 a_1 a_2 a_3", "a_0 a_2 a_1", "quality", "a_uv", "a_y"] {
            assert!(found(none).is_empty(), "{none}");
        }
        assert_eq!(found("a_0 b_0 a_0"), ["vertex_a[0]", "vertex_b[1]"]);
    }
}
