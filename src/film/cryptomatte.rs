//! Cryptomatte: mattes of everything in one set of channels, by the hash of its name.
//!
//! A layer has pairs of channels, `CryptoObject00.R` an id and `.G` its coverage, `.B` and `.A` the next; further pairs in
//! `CryptoObject01` and so on, by falling coverage. An id is a name's 32-bit MurmurHash3 taken for the bits of a float, and
//! the header has a manifest of names and ids. Source: Friedman and Jones, "Fully automatic ID mattes with support for
//! motion blur and transparency", SIGGRAPH 2015; Psyop's Cryptomatte specification 1.2.0; Appleby's MurmurHash3_x86_32.

use super::accumulate::{Film, PixelCells};
use super::exr::{Attribute, ChannelData};
use super::resolve::coverage_of_halves;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One matte layer: what the numbers of the film's [`Mattes`](super::mattes::Mattes) are called in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Matte {
    /// Of the channels, without a number.
    pub layer: String,
    /// Whether the lower half of a number counts, what is seen of an object, and not the upper one, the object.
    pub of_parts: bool,
    /// By that half; none for what is never seen by that half.
    pub names: Vec<Option<String>>,
    /// Whether no sample counts against its pixel: coverage is then weighed as alpha is, else by counts alone.
    pub positive: bool,
}

/// Pairs of id and coverage that every file has.
const PAIRS: usize = 6;

/// Channels by name, and attributes.
pub type Written = (Vec<(String, ChannelData)>, Vec<(String, Attribute)>);

impl Matte {
    /// The channels and attributes of the layer over the window of `film`. There are as many pairs as some pixel needs, at
    /// least six, so that coverage adds up to that of the samples.
    #[must_use]
    pub fn write(&self, film: &Film) -> Written {
        let ids: Vec<f32> = self.names.iter().map(|name| name.as_deref().map_or(0.0, id_of)).collect();
        let pixel = |(i, cells): (usize, &PixelCells)| {
            let samples: u64 = cells.iter().map(|cell| u64::from(cell.count) + u64::from(cell.dropped)).sum();
            let mut counts: BTreeMap<u32, u64> = BTreeMap::new();
            for &(number, count) in film.layers.mattes.of(i) {
                let half = if self.of_parts { number as u32 } else { (number >> 32) as u32 };
                let id = ids.get(half as usize).copied().unwrap_or_default();
                *counts.entry(id.to_bits()).or_default() += u64::from(count);
            }
            let mut pairs: Vec<(u64, u32)> = counts.into_iter().map(|(id, count)| (count, id)).collect();
            // Of equal coverage by rising id.
            pairs.sort_by_key(|&(count, id)| (std::cmp::Reverse(count), id));
            // What covers the pixel shares its coverage by counts.
            let share = if self.positive { coverage_of_halves(cells) as f32 } else { 1.0 };
            let pair = |(count, id): (u64, u32)| (f32::from_bits(id), share * (count as f32 / samples.max(1) as f32));
            pairs.into_iter().map(pair).collect::<Vec<(f32, f32)>>()
        };
        let pixels: Vec<Vec<(f32, f32)>> = film.cells().par_iter().enumerate().map(pixel).collect();
        let pairs = pixels.iter().map(Vec::len).max().unwrap_or(0).max(PAIRS).next_multiple_of(2);
        let mut channels = Vec::new();
        for pair in 0..pairs {
            let layer = format!("{}{:02}", self.layer, pair / 2);
            let [id, coverage] = if pair % 2 == 0 { ["R", "G"] } else { ["B", "A"] };
            let plane = |of: &dyn Fn(&(f32, f32)) -> f32| {
                ChannelData::F32(pixels.iter().map(|pixel| pixel.get(pair).map_or(0.0, of)).collect())
            };
            channels.push((format!("{layer}.{id}"), plane(&|pair| pair.0)));
            channels.push((format!("{layer}.{coverage}"), plane(&|pair| pair.1)));
        }
        (channels, self.attributes())
    }

    fn attributes(&self) -> Vec<(String, Attribute)> {
        // Names are sorted, each once.
        let manifest: BTreeMap<&str, String> =
            self.names.iter().flatten().map(|name| (name.as_str(), format!("{:08x}", id_of(name).to_bits()))).collect();
        // A map of texts always is JSON.
        let manifest = serde_json::to_string(&manifest).unwrap_or_default();
        let key = key(&self.layer);
        let entry = |name: &str, value: &str| (format!("{PREFIX}{key}/{name}"), Attribute::Text(value.to_owned()));
        vec![
            entry("name", &self.layer),
            entry("hash", "MurmurHash3_32"),
            entry("conversion", "uint32_to_float32"),
            entry("manifest", &manifest),
        ]
    }
}

/// How the names of all attributes begin.
pub const PREFIX: &str = "cryptomatte/";

/// The layer of mattes that a channel group with this name is a numbered one of, as `CryptoObject00` is of `CryptoObject`.
#[must_use]
pub fn layer(name: &str) -> Option<&str> {
    let layer = name.trim_end_matches(|c: char| c.is_ascii_digit());
    (layer != name && ["CryptoObject", "CryptoMaterial", "CryptoAsset"].contains(&layer)).then_some(layer)
}

/// What tells the attributes of one layer from those of another.
#[must_use]
pub fn key(layer: &str) -> String {
    format!("{:08x}", id_of(layer).to_bits())[..7].to_owned()
}

/// The id of a name: its hash as the bits of a float that is neither subnormal nor infinite nor none.
#[must_use]
pub fn id_of(name: &str) -> f32 {
    let hash = murmur3(name.as_bytes());
    let exponent = hash >> 23 & 0xff;
    f32::from_bits(if exponent == 0 || exponent == 255 { hash ^ 1 << 23 } else { hash })
}

/// MurmurHash3_x86_32 with seed 0.
fn murmur3(bytes: &[u8]) -> u32 {
    let scramble = |k: u32| k.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let (blocks, rest) = bytes.as_chunks::<4>();
    let mut hash = 0u32;
    for block in blocks {
        hash ^= scramble(u32::from_le_bytes(*block));
        hash = hash.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    let mut last = [0; 4];
    last[..rest.len()].copy_from_slice(rest);
    hash ^= scramble(u32::from_le_bytes(last));
    // The length counts modulo 2³².
    hash ^= bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;

    fn matte(names: Vec<Option<String>>) -> Matte {
        Matte { layer: "M".into(), of_parts: false, names, positive: true }
    }

    /// The published values of MurmurHash3_x86_32 with seed 0, and the key of `CryptoObject` that other programs write.
    #[test]
    fn hashes_are_those_of_the_specification() {
        assert_eq!(["", "test", "Hello, world!"].map(|text| murmur3(text.as_bytes())), [0, 0xba6b_d213, 0xc036_3e43]);
        assert_eq!(&format!("{:08x}", id_of("CryptoObject").to_bits())[..7], "3ae39a5");
        // The hash of nothing is 0, a subnormal number.
        assert_eq!(id_of("").to_bits(), 1 << 23);
    }

    /// Hashes by another implementation: 000c9239 would be a subnormal number and 7ff8e6f3 none. Bit 23 of both is turned, and
    /// of their neighbours 009a225b and ff07ccea, which are numbers, none.
    #[test]
    fn no_id_is_subnormal_infinite_or_no_number() {
        let ids =
            [("ball 34", 0x008c_9239), ("ball 293", 0x7f78_e6f3), ("ball 262", 0x009a_225b), ("ball 18", 0xff07_ccea)];
        for (name, bits) in ids {
            assert_eq!(id_of(name).to_bits(), bits, "{name}");
            assert!(id_of(name).is_normal(), "{name}");
        }
    }

    /// Of eight samples two met `a`, two `b` and one `d`; one was dropped, which counts: it met what nobody knows. The ids are
    /// 3c2569b2, 95de7e03 and 27191473, so that of the equal ones `a` comes first, whatever their numbers.
    #[test]
    fn dropped_samples_cover_nothing_and_equals_come_by_rising_id() {
        for names in [["a", "b", "d"], ["b", "d", "a"]] {
            let mut film = Film::new([1, 1], Window::full(1, 1)).unwrap();
            (film.cells_mut()[0][1].count, film.cells_mut()[0][2].dropped) = (7, 1);
            for (name, number) in names.into_iter().zip(0u64..) {
                film.layers.mattes.add(0, 1, number << 32, if name == "d" { 1 } else { 2 });
            }
            let matte = Matte { names: names.map(|name| Some(name.to_owned())).to_vec(), ..matte(Vec::new()) };
            let (channels, _) = matte.write(&film);
            let value = |data: &ChannelData| match data {
                ChannelData::F32(plane) => plane[0],
                _ => f32::NAN,
            };
            let found: Vec<f32> = channels.iter().map(|(_, data)| value(data)).collect();
            assert_eq!(found[..7], [id_of("a"), 0.25, id_of("b"), 0.25, id_of("d"), 0.125, 0.0]);
        }
    }

    /// Of one sample in the first half and five in the second one each meets `a`: in the mean of the halves it covers (1 + 1/5)/2, by
    /// counts 2/6.
    #[test]
    fn coverage_follows_alpha_where_no_sample_counts_against_its_pixel() {
        let mut film = Film::new([1, 1], Window::full(1, 1)).unwrap();
        for (replicate, alpha) in [(0, 1.0), (2, 1.0), (2, 0.0), (2, 0.0), (3, 0.0), (3, 0.0)] {
            film.add([0, 0], replicate, [0.0; 3], alpha);
        }
        film.layers.mattes.add(0, 1, 0, 2);
        for (positive, expected) in [(true, 0.6f32), (false, 1.0 / 3.0)] {
            let (channels, _) = Matte { positive, ..matte(vec![Some("a".into())]) }.write(&film);
            let ChannelData::F32(coverage) = &channels[1].1 else { panic!("coverage is in floats") };
            assert!((coverage[0] - expected).abs() < 1e-6, "{positive}: {coverage:?}");
        }
    }

    /// Of eight samples of a pixel three met the child 2 of the object 0, one the child 3, two the object 1, two nothing.
    #[test]
    fn ids_come_by_falling_coverage_and_parts_of_one_name_together() {
        let mut film = Film::new([1, 1], Window::full(1, 1)).unwrap();
        film.cells_mut()[0][0].count = 8;
        for (number, count) in [(2, 3), (3, 1), (1 << 32 | 1, 2)] {
            film.layers.mattes.add(0, 1, number, count);
        }
        let names = ["a", "b", "x", "y"].map(|name| Some(name.to_owned())).to_vec();
        let of = |matte: &Matte| -> Vec<f32> {
            let (channels, _) = matte.write(&film);
            let names: Vec<&str> = channels.iter().map(|(name, _)| name.as_str()).collect();
            assert_eq!(names[..5], ["M00.R", "M00.G", "M00.B", "M00.A", "M01.R"]);
            let value = |data: &ChannelData| match data {
                ChannelData::F32(plane) => plane[0],
                _ => f32::NAN,
            };
            channels.iter().map(|(_, data)| value(data)).collect()
        };
        let objects = of(&matte(names.clone()));
        assert_eq!(objects[..6], [id_of("a"), 0.5, id_of("b"), 0.25, 0.0, 0.0]);
        let parts = of(&Matte { of_parts: true, ..matte(names) });
        assert_eq!(parts[..6], [id_of("x"), 0.375, id_of("b"), 0.25, id_of("y"), 0.125]);
    }
}
