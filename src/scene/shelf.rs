//! What one scene of a batch has read, for the next one that names the same files.
//!
//! Frames of a batch mostly share their pictures, meshes and volumes, and reading those can cost more than a small frame.
//! Pictures and volumes are kept as they are rendered (decoded and upsampled), and so are distance grids; meshes as they were
//! read; curves where they stand. What a scene does not ask for is forgotten after it, so that a batch of any length holds what
//! one scene holds. A file that has changed is read again. The tables of coats, which take some 20 ms each, are kept as well,
//! for all that have the same coat.

use super::curves::{Basis, Curves, Strands};
use super::environment::Environment;
use super::mesh::MeshSource;
use super::sdf::Distances;
use super::texture::{DataImage, ImageTexture};
use super::volume::Unplaced;
use crate::optics::microfacet::{Distribution, Microfacets};
use crate::optics::plastic::{Coats, DiffuseMean};
use crate::spectrum::Carried;
use std::collections::HashMap;
use std::hash::Hash;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

/// Length and time of change of a file.
type Stamp = (u64, Option<SystemTime>);

fn stamp(path: &Path) -> Option<Stamp> {
    let data = std::fs::metadata(path).ok()?;
    Some((data.len(), data.modified().ok()))
}

#[derive(Debug)]
struct Thing<V> {
    made: V,
    /// Whether the scene at hand has asked for it.
    wanted: bool,
}

/// Keeps what was asked for since the last call.
fn forget<K, V>(things: &mut HashMap<K, Thing<V>>) {
    things.retain(|_, thing| std::mem::take(&mut thing.wanted));
}

/// Things that were made of files as they were then: of each file, of as many kinds as there are `K`.
#[derive(Debug)]
pub struct Kept<K, V> {
    things: HashMap<(PathBuf, K), Thing<(V, Stamp)>>,
}

impl<K, V> Default for Kept<K, V> {
    fn default() -> Kept<K, V> {
        Kept { things: HashMap::new() }
    }
}

impl<K: Eq + Hash, V: Clone> Kept<K, V> {
    /// Whether `key` is here, made of `path` as it is now.
    #[must_use]
    pub fn has(&self, path: &Path, key: K) -> bool {
        self.things.get(&(path.to_path_buf(), key)).is_some_and(|thing| stamp(path) == Some(thing.made.1))
    }

    /// What is here, made of `path` as it is now.
    pub fn find(&mut self, path: &Path, key: K) -> Option<V> {
        let thing = self.things.get_mut(&(path.to_path_buf(), key))?;
        let (made, of) = &thing.made;
        (stamp(path) == Some(*of)).then(|| {
            thing.wanted = true;
            made.clone()
        })
    }

    /// What is here, else what `make` gives, which is kept.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn get<E>(&mut self, path: &Path, key: K, make: impl FnOnce() -> Result<V, E>) -> Result<V, E>
    where
        K: Clone,
    {
        if let Some(made) = self.find(path, key.clone()) {
            return Ok(made);
        }
        // Before it is read: what changes meanwhile is read again.
        let of = stamp(path);
        let made = make()?;
        if let Some(of) = of {
            self.things.insert((path.to_path_buf(), key), Thing { made: (made.clone(), of), wanted: true });
        }
        Ok(made)
    }

    fn forget(&mut self) {
        forget(&mut self.things);
    }
}

/// What makes one coat differ from another: the range of its index, its facets, and how their mean is taken. Numbers as bits.
type CoatKey = ([u64; 2], Option<(Distribution, [u64; 2])>, DiffuseMean);

/// The tables of coats.
#[derive(Debug, Default)]
pub struct KeptCoats {
    tables: HashMap<CoatKey, Thing<Arc<Coats>>>,
}

impl KeptCoats {
    /// [`Coats::new`], computed once.
    pub fn get(&mut self, [low, high]: [f64; 2], facets: Option<&Microfacets>, mean: DiffuseMean) -> Arc<Coats> {
        let rough = facets.map(|facets| (facets.distribution, [facets.alpha, facets.ratio].map(f64::to_bits)));
        let compute = || Thing { made: Arc::new(Coats::new(low, high, facets, mean)), wanted: true };
        let tables = self.tables.entry(([low, high].map(f64::to_bits), rough, mean)).or_insert_with(compute);
        tables.wanted = true;
        tables.made.clone()
    }

    fn forget(&mut self) {
        forget(&mut self.tables);
    }
}

/// A place and what control points mean: what makes curves of one file differ. Numbers as bits.
pub type CurvesKey = ([u64; 12], Basis);

/// Pictures, skies, meshes, volumes, distance grids, curves and coats.
#[derive(Debug, Default)]
pub struct Shelf {
    /// What they are made for: others have a shelf of their own.
    pub carried: Carried,
    /// Pictures as colours, raw or not, and what was changed in them.
    pub colours: Kept<bool, (ImageTexture, Option<String>)>,
    /// Pictures as numbers, raw or not, and what a person should know of them.
    pub numbers: Kept<bool, (DataImage, Option<String>)>,
    /// Maps of light, by what makes one differ from another of the same file: turns, scale and mapping, as bits.
    pub skies: Kept<Vec<u64>, (Arc<Environment>, Option<String>)>,
    /// Meshes, by their index in the file.
    pub meshes: Kept<u32, Arc<MeshSource>>,
    /// Volumes, as colours or raw. They share their voxels, wherever they are placed.
    pub volumes: Kept<bool, Unplaced>,
    /// Distance grids. They share their numbers, wherever they are placed.
    pub distances: Kept<(), Distances>,
    /// Curves as their files have them, while the moments of a scene are made.
    pub strands: Kept<(), Arc<Strands>>,
    /// Curves in the world, which are one wherever they stay in their place.
    pub curves: Kept<CurvesKey, Arc<Curves>>,
    /// Tables of the coats of plastics.
    pub coats: KeptCoats,
}

impl Shelf {
    /// Forgets what was not asked for since the last call.
    pub fn forget_unwanted(&mut self) {
        self.colours.forget();
        self.numbers.forget();
        self.skies.forget();
        self.meshes.forget();
        self.volumes.forget();
        self.distances.forget();
        self.strands.forget();
        self.curves.forget();
        self.coats.forget();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Made once while the file stays as it is, again after it has changed, and forgotten after a scene that did not ask.
    #[test]
    fn a_thing_is_made_once_for_scenes_in_a_row() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("x");
        std::fs::write(&path, "one").unwrap();
        let (mut kept, mut made) = (Kept::default(), 0);
        let mut get = |kept: &mut Kept<(), u32>| {
            let make = || -> Result<u32, ()> {
                made += 1;
                Ok(made)
            };
            kept.get(&path, (), make).unwrap()
        };
        assert_eq!([get(&mut kept), get(&mut kept)], [1, 1]);
        kept.forget();
        assert_eq!(get(&mut kept), 1);
        std::fs::write(&path, "another").unwrap();
        assert_eq!(get(&mut kept), 2);
        kept.forget();
        kept.forget();
        assert_eq!(get(&mut kept), 3);
    }
}
