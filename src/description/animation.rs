//! A scene for all of its frames: what was read, before time is filled in.

use std::path::{Path, PathBuf};

use super::decode::decode;
use super::fault::Fault;
use super::frames::Frames;
use super::keyed;
use super::node::{Entry, Node, Sources, Value};
use super::output::Output;
use super::path::Segment;
use super::scene::SceneDescription;
use crate::error::Result;

/// A scene as it is written, includes and settings in their places, with values that change over frames.
#[derive(Clone, Debug)]
pub struct Animation {
    root: Node,
    path: PathBuf,
    sources: Sources,
    frames: Vec<i32>,
    /// Whether anything changes over frames.
    changes: bool,
}

/// A scene around one of its frames.
#[derive(Clone, Debug)]
pub struct Motion {
    animation: Animation,
    frame: i32,
}

impl Motion {
    /// The scene `time` frames after its frame.
    ///
    /// # Errors
    /// As [`Animation::scene`].
    pub fn at(&self, time: f64) -> Result<SceneDescription> {
        let Animation { mut root, path, sources, .. } = self.animation.clone();
        let frame = f64::from(self.frame);
        keyed::evaluate_within(&mut root, frame, frame + time)
            .and_then(|()| settle(&mut root, self.frame, &sources))
            .map_err(|fault| fault.into_error(&sources))?;
        let mut scene = SceneDescription::of_tree(root, &path, sources)?;
        scene.frame = Some(self.frame);
        Ok(scene)
    }
}

impl Animation {
    /// Reads which frames there are, and the tables that the tree names.
    ///
    /// # Errors
    /// [`Error::Config`](crate::error::Error::Config) for frames that are none, or for a scene that changes over frames and
    /// says nothing of them; [`Error::Input`](crate::error::Error::Input) for a table that cannot be read.
    pub(crate) fn new(mut root: Node, path: &Path, mut sources: Sources) -> Result<Animation> {
        let changes = keyed::read_tables(&mut root, &mut sources)?;
        let written = root.get("render").and_then(|render| render.get("frames"));
        let frames = match written.filter(|node| !matches!(node.value, Value::Null)) {
            None => Ok(Vec::new()),
            Some(node) => decode::<Frames>(node, &sources)
                .and_then(|frames| frames.list().map_err(|message| Fault::at_place(node.place, message)))
                .map_err(|fault| fault.under(Segment::Key("frames".into())).under(Segment::Key("render".into()))),
        };
        let frames = frames.map_err(|fault| fault.into_error(&sources))?;
        if let (true, true, Some(fault)) = (changes, frames.is_empty(), keyed::first(&mut root)) {
            let expected = "expected render.frames or --frames, since this changes over frames, found none";
            return Err(fault.saying(expected).into_error(&sources));
        }
        Ok(Animation { root, path: path.to_path_buf(), sources, frames, changes })
    }

    /// The frames to render, in order; none where the scene has no frames, and is one picture.
    #[must_use]
    pub fn frames(&self) -> &[i32] {
        &self.frames
    }

    /// Which files are written for the first of its frames.
    ///
    /// # Errors
    /// [`Error::Config`](crate::error::Error::Config) for what is no output.
    pub fn output(&self) -> Result<Output> {
        let Value::Map(entries) = &self.root.value else { return Ok(Output::default()) };
        let Some(entry) = entries.iter().find(|entry| entry.key == "output") else { return Ok(Output::default()) };
        let first = self.frames.first();
        let node = first.map_or_else(|| Ok(entry.node.clone()), |frame| keyed::section(entry, f64::from(*frame)));
        node.and_then(|node| decode(&node, &self.sources)).map_err(|fault| fault.into_error(&self.sources))
    }

    /// The scene at one of its frames, or the scene that has none.
    ///
    /// # Errors
    /// [`Error::Config`](crate::error::Error::Config) with every fault of the description.
    pub fn scene(&self, frame: Option<i32>) -> Result<SceneDescription> {
        self.clone().into_scene(frame)
    }

    /// The files that were read so far: of the scene, of what it includes, of its tables and of the batch.
    #[must_use]
    pub fn files(&self) -> Vec<PathBuf> {
        self.sources.files()
    }

    /// The files that it names besides: pictures, meshes, spectra.
    #[must_use]
    pub fn named_files(&self) -> Vec<PathBuf> {
        fn within(node: &Node, sources: &Sources, found: &mut Vec<PathBuf>) {
            match &node.value {
                Value::List(items) => items.iter().for_each(|item| within(item, sources, found)),
                Value::Map(entries) => {
                    for Entry { key, node, .. } in entries {
                        match &node.value {
                            Value::Text(file) if key == "file" => found.push(sources.file(node.place, file)),
                            // They have whatever names they are given.
                            _ if key == "attributes" => {}
                            _ => within(node, sources, found),
                        }
                    }
                }
                _ => {}
            }
        }
        let mut found = Vec::new();
        within(&self.root, &self.sources, &mut found);
        found
    }

    /// All pictures in order, each with its frame.
    pub fn into_scenes(self) -> impl Iterator<Item = (Option<i32>, Result<SceneDescription>)> {
        let mut frames = self.frames.clone().into_iter();
        let mut rest = Some(self);
        std::iter::from_fn(move || {
            let animation = rest.take()?;
            let frame = frames.next();
            if frames.len() == 0 {
                return Some((frame, animation.into_scene(frame)));
            }
            let scene = animation.scene(frame);
            rest = Some(animation);
            Some((frame, scene))
        })
    }

    /// The first picture.
    ///
    /// # Errors
    /// As [`Animation::scene`].
    pub fn into_first(self) -> Result<SceneDescription> {
        let first = self.frames.first().copied();
        self.into_scene(first)
    }

    /// [`Animation::scene`] of what is needed no more.
    ///
    /// # Errors
    /// As there.
    pub fn into_scene(mut self, frame: Option<i32>) -> Result<SceneDescription> {
        let shutter = self.root.get("camera").and_then(|camera| camera.get("shutter"));
        let open = self.changes && shutter.is_some_and(|node| !matches!(node.value, Value::Null));
        let motion = frame.filter(|_| open).map(|frame| Box::new(Motion { animation: self.clone(), frame }));
        if let Some(frame) = frame {
            keyed::evaluate(&mut self.root, f64::from(frame)).map_err(|fault| fault.into_error(&self.sources))?;
            settle(&mut self.root, frame, &self.sources).map_err(|fault| fault.into_error(&self.sources))?;
        }
        let mut scene = SceneDescription::of_tree(self.root, &self.path, self.sources)?;
        scene.frame = frame;
        scene.motion = motion;
        Ok(scene)
    }
}

/// Makes of what is said of all frames what is so of one: its seed.
fn settle(root: &mut Node, frame: i32, sources: &Sources) -> std::result::Result<(), Fault> {
    let Some(render) = root.get_mut("render") else { return Ok(()) };
    let at = |key: &str| [Segment::Key("render".into()), Segment::Key(key.into())];
    let given = |node: &&Node| !matches!(node.value, Value::Null);
    let per_frame = render.get("seed_per_frame").filter(given).map(|node| decode::<bool>(node, sources));
    let per_frame = per_frame.transpose().map_err(|fault| fault.under_path(&at("seed_per_frame")))?.unwrap_or(true);
    let seed = render.get("seed").filter(given).map(|node| decode::<u64>(node, sources));
    let seed = seed.transpose().map_err(|fault| fault.under_path(&at("seed")))?.unwrap_or(0);
    let place = render.get("seed").map_or(render.place, |node| node.place);
    if let Value::Map(entries) = &mut render.value {
        entries.retain(|entry| entry.key != "frames" && entry.key != "seed_per_frame");
        if per_frame {
            entries.retain(|entry| entry.key != "seed");
            let node = Node::new(place, Value::Unsigned(seed.wrapping_add_signed(frame.into())));
            entries.push(Entry { key: "seed".into(), key_place: place, node });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::testing::{CAMERA, faults, scene};
    use super::super::{SceneDescription, load};

    #[test]
    fn the_seed_runs_with_the_frame_unless_it_is_held() {
        let seed = |render: &str| scene(&format!("render: {{{render}}}")).render.seed;
        assert_eq!(seed("frames: 12"), 12);
        assert_eq!(seed("frames: 12, seed: 100"), 112);
        assert_eq!(seed("frames: -2, seed: 100"), 98);
        assert_eq!(seed("frames: 12, seed: 100, seed_per_frame: false"), 100);
        assert_eq!(seed("seed: 100"), 100);
    }

    #[test]
    fn a_scene_without_keys_is_the_same_at_each_frame() {
        let described = |render: &str| {
            format!(
                "{:?}",
                SceneDescription {
                    locator: Default::default(),
                    frame: None,
                    ..scene(&format!("render: {{{render}}}"))
                }
            )
        };
        assert_eq!(described("frames: 1-9, seed: 2"), described("seed: 3"));
    }

    #[test]
    fn frames_of_a_batch_are_laid_over_those_of_its_scenes() {
        let directory = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
        put(
            "a.yaml",
            &format!("{CAMERA}render: {{frames: 1-3}}\nfog: {{colour: {{0: 0, 4: 1}}, density: {{0: 1}}}}\n"),
        );
        put("b.yaml", "render: {frames: 5-9x2}\nscenes: [{file: a.yaml, set: {fog.colour: {0: 1, 10: 0}}}]\n");
        let frames = |name: &str, set: &[(String, String)]| {
            load(&directory.path().join(name)).unwrap().entries()[0].animation(set).unwrap().frames().to_vec()
        };
        assert_eq!(frames("a.yaml", &[]), [1, 2, 3]);
        assert_eq!(frames("b.yaml", &[]), [5, 7, 9]);
        assert_eq!(frames("b.yaml", &[("render.frames".into(), "20,4".into())]), [20, 4]);
        let batch = load(&directory.path().join("b.yaml")).unwrap();
        let fog = batch.entries()[0].scene(&[]).unwrap().fog.unwrap();
        assert_eq!(fog.colour, super::super::Spectrum::Number(0.5));
    }

    #[test]
    fn frames_that_are_none_are_refused_with_their_place() {
        assert_eq!(
            faults("render:\n  frames: 10-1"),
            "dir/s.yaml:3:11: render.frames: expected ranges from a frame to a later one in steps of 1 or more, found \"10-1\""
        );
        assert_eq!(
            faults("render: {frames: [1, 2]}"),
            "dir/s.yaml:2:18: render.frames: expected one of a number, text, found a list of 2"
        );
        assert_eq!(
            faults("render: {frames: 1-3, seed_per_frame: 1}"),
            "dir/s.yaml:2:39: render.seed_per_frame: expected true or false, found 1"
        );
        assert_eq!(
            faults("render: {frames_per_second: 0}"),
            "dir/s.yaml:2:29: render.frames_per_second: expected a number from 0.001 to 1000000, found 0"
        );
    }
}
