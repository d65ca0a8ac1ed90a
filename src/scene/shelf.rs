//! What one scene of a batch has read, for the next one that names the same files.
//!
//! Frames of a batch mostly share their pictures and meshes, and reading those can cost more than a small frame. Pictures
//! are kept as they are rendered (decoded and upsampled), meshes as they were read. What a scene does not ask for is
//! forgotten after it, so that a batch of any length holds what one scene holds. A file that has changed is read again.

use super::environment::Environment;
use super::mesh::MeshSource;
use super::texture::{DataImage, ImageTexture};
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

/// Things that were made of files.
#[derive(Debug)]
struct Kept<K, V> {
    things: HashMap<K, Thing<V>>,
}

#[derive(Debug)]
struct Thing<V> {
    made: V,
    of: Stamp,
    /// Whether the scene at hand has asked for it.
    wanted: bool,
}

impl<K, V> Default for Kept<K, V> {
    fn default() -> Kept<K, V> {
        Kept { things: HashMap::new() }
    }
}

impl<K: Eq + Hash, V: Clone> Kept<K, V> {
    /// Whether `key` is here, made of `path` as it is now.
    fn has(&self, key: &K, path: &Path) -> bool {
        self.things.get(key).is_some_and(|thing| stamp(path) == Some(thing.of))
    }

    /// What is here, else what `make` gives.
    fn get<E>(&mut self, key: K, path: &Path, make: impl FnOnce() -> Result<V, E>) -> Result<V, E> {
        if self.has(&key, path)
            && let Some(thing) = self.things.get_mut(&key)
        {
            thing.wanted = true;
            return Ok(thing.made.clone());
        }
        // Before it is read: what changes meanwhile is read again.
        let of = stamp(path);
        let made = make()?;
        if let Some(of) = of {
            self.things.insert(key, Thing { made: made.clone(), of, wanted: true });
        }
        Ok(made)
    }

    fn forget(&mut self) {
        self.things.retain(|_, thing| std::mem::take(&mut thing.wanted));
    }
}

/// What makes one map of light differ from another of the same file: scale, mapping and turns, as bits.
pub type SkyKey = (PathBuf, Vec<u64>);

/// Pictures, skies and meshes.
#[derive(Debug, Default)]
pub struct Shelf {
    colours: Kept<(PathBuf, bool), ImageTexture>,
    numbers: Kept<(PathBuf, bool), DataImage>,
    skies: Kept<SkyKey, Arc<Environment>>,
    meshes: Kept<(PathBuf, u32), Arc<MeshSource>>,
}

impl Shelf {
    /// Whether a picture is here, in some form.
    #[must_use]
    pub fn has_picture(&self, path: &Path, raw: bool) -> bool {
        let key = (path.to_path_buf(), raw);
        self.colours.has(&key, path) || self.numbers.has(&key, path)
    }

    /// Whether a sky is here.
    #[must_use]
    pub fn has_sky(&self, key: &SkyKey) -> bool {
        self.skies.has(key, &key.0)
    }

    /// The picture `path` as colours, made by `make` if it is not here.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn colours<E>(
        &mut self,
        path: &Path,
        raw: bool,
        make: impl FnOnce() -> Result<ImageTexture, E>,
    ) -> Result<ImageTexture, E> {
        self.colours.get((path.to_path_buf(), raw), path, make)
    }

    /// The picture `path` as numbers, made by `make` if it is not here.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn numbers<E>(
        &mut self,
        path: &Path,
        raw: bool,
        make: impl FnOnce() -> Result<DataImage, E>,
    ) -> Result<DataImage, E> {
        self.numbers.get((path.to_path_buf(), raw), path, make)
    }

    /// A sky, made by `make` if it is not here.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn sky<E>(
        &mut self,
        key: SkyKey,
        make: impl FnOnce() -> Result<Environment, E>,
    ) -> Result<Arc<Environment>, E> {
        let path = key.0.clone();
        self.skies.get(key, &path, || make().map(Arc::new))
    }

    /// Mesh `index` of `path`, if it is here.
    #[must_use]
    pub fn mesh(&mut self, path: &Path, index: u32) -> Option<Arc<MeshSource>> {
        self.meshes.get((path.to_path_buf(), index), path, || Err(())).ok()
    }

    /// Keeps a mesh.
    pub fn keep_mesh(&mut self, path: &Path, index: u32, source: &Arc<MeshSource>) {
        let kept: Result<_, ()> = self.meshes.get((path.to_path_buf(), index), path, || Ok(source.clone()));
        let _ = kept;
    }

    /// Forgets what was not asked for since the last call.
    pub fn forget_unwanted(&mut self) {
        self.colours.forget();
        self.numbers.forget();
        self.skies.forget();
        self.meshes.forget();
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
            kept.get((), &path, make).unwrap()
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
