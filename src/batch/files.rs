//! The files of a picture: what they are called, and the writing of them.

use super::finish::Finish;
use super::frame::{self, Frame};
use super::header::{self, attributes};
use super::prepare::colour_space;
use super::report::{Developed, SceneReport};
use super::{checkpoint, contact};
use crate::description;
use crate::error::{Error, Result};
use crate::film::accumulate::PixelCells;
use crate::film::exr::{self, Attribute, ChannelData, ColourEncoding, ExrImage, LayerPlane, stderr_name};
use crate::film::heat;
use crate::film::output;
use crate::film::png;
use crate::film::resolve::Image;
use crate::transport::layers::{Channel, Holds};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Writes the EXR at `exr_path` and the PNG beside it, and notes them in the report, which has measured the frame. `target` is
/// whether that is as good as was asked for.
///
/// # Errors
/// [`Error::Output`] where a file cannot be written, [`Error::Render`] for invalid samples, or `target`; the files are then
/// written all the same.
pub fn write(
    finish: &Finish,
    frame: &Frame,
    target: Result<()>,
    exr_path: &Path,
    report: &mut SceneReport,
) -> Result<()> {
    let written = Instant::now();
    let (counted, dropped) = frame.film.samples();
    let paths: u64 = frame.splats.iter().flat_map(|splats| splats.paths).sum();
    let sound = frame::check_invalid(&frame.invalid(), counted + dropped + paths).and(target);
    report.fault = sound.as_ref().err().map(ToString::to_string);
    let mut image = frame.resolve(&finish.rgb_from_xyz());
    if !finish.is_random() {
        // Its samples differ by where they are, and would be the same again: there is no noise.
        image.standard_error.iter_mut().for_each(|plane| plane.fill(0.0));
    }
    report.pixel_hash = pixel_hash(&image);
    let [_, png_path, spectral_path] = places(exr_path);
    let shown = image.shown();
    let mut settings = finish.png_settings(&shown);
    settings.texts.extend(finish.png_marks(&report.pixel_hash));
    report.png = Some(Developed {
        exposure_stops: settings.exposure_stops,
        metered: finish.output.png.exposure == description::Exposure::Auto,
        white: finish.white,
    });
    // Rays on a grid differ from each other, but not by chance.
    if report.error.is_some() {
        report.error_map = heat::error_map(&shown, finish.space().matrix_to_xyz()[1], contact::SIDE);
    }
    let spectral =
        spectral_image(finish, frame, &image, report).map(|mut file| sealed(&spectral_path, &mut file)).transpose()?;
    let (exr, png) =
        rayon::join(|| sealed_exr(exr_path, finish, frame, &image, report), || png::encode_png(&shown, &settings));
    let (exr, bytes) = exr?;
    let png = png.map_err(|message| Error::output(&png_path, message))?;
    // All or none: what stands there may be of another render.
    let mut files = Vec::from_iter(spectral.as_ref().map(|bytes| (&*spectral_path, &**bytes)));
    files.extend([(exr_path, &*bytes), (&*png_path, &*png)]);
    output::write_together(&files)?;
    note_loss(exr_path, finish, &exr, report)?;
    report.files = of(finish, exr_path);
    report.seconds.writing = written.elapsed().as_secs_f64();
    sound
}

/// Makes the files of a picture of one pixel, which has no sample, to see whether the channels and attributes of the whole one
/// can stand in them.
///
/// # Errors
/// Why they cannot.
pub fn check_files(finish: &Finish, frame: &Frame) -> std::result::Result<(), String> {
    let one = Finish { window: frame.film.window(), ..finish.clone() };
    let image = frame.resolve(&one.rgb_from_xyz());
    let mut report = SceneReport::new(&one.name, one.frame_number);
    let file = exr_image(&one, frame, &image, &mut report);
    // More of them are written where a pixel shows more things.
    let numbered = |name: &str, layer: &str| {
        name.strip_prefix(layer).is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
    };
    for matte in &finish.mattes {
        let layer = |channel: &Channel| channel.name.rsplit_once('.').map_or("", |(layer, _)| layer).to_owned();
        if let Some(layer) = finish.layers.iter().map(layer).find(|layer| numbered(layer, &matte.layer)) {
            return Err(format!("the layer `{layer}` has a name of the mattes {}", matte.layer));
        }
    }
    exr::encode_exr(&file)?;
    spectral_image(&one, frame, &image, &report).map_or(Ok(()), |file| exr::encode_exr(&file).map(drop))
}

/// The EXR of a picture that is to be at `path`, and its bytes.
fn sealed_exr(
    path: &Path,
    finish: &Finish,
    frame: &Frame,
    image: &Image,
    report: &mut SceneReport,
) -> Result<(ExrImage, Vec<u8>)> {
    let mut file = exr_image(finish, frame, image, report);
    let bytes = sealed(path, &mut file)?;
    Ok((file, bytes))
}

/// Notes what packing has changed in `file`, which is at `path`.
fn note_loss(path: &Path, finish: &Finish, file: &ExrImage, report: &mut SceneReport) -> Result<()> {
    if file.compression.loses() {
        let loss = exr::loss(path, file)?;
        report.notes.push(format!(
            "DWA compression of level {} changes values by {:.2e} in the root mean square, at most {:.2e}; their mean is {:.2e}",
            finish.output.exr.dwa_level, loss.root_mean_square, loss.most, loss.mean
        ));
        if loss.no_longer_finite > 0 {
            report
                .notes
                .push(format!("DWA compression changes {} values between finite and not", loss.no_longer_finite));
        }
    }
    Ok(())
}

/// The file of a picture, and notes on it.
fn exr_image<'a>(finish: &'a Finish, frame: &Frame, image: &Image, report: &mut SceneReport) -> ExrImage {
    let exr = &finish.output.exr;
    let precision = match exr.precision {
        description::Precision::Half => exr::Precision::Half,
        description::Precision::Float => exr::Precision::Float,
    };
    let compression = match exr.compression {
        description::Compression::None => exr::Compression::None,
        description::Compression::Zips => exr::Compression::Zips,
        description::Compression::Zip => exr::Compression::Zip,
        description::Compression::Piz => exr::Compression::Piz,
        description::Compression::Dwaa => exr::Compression::Dwaa(exr.dwa_level as f32),
        description::Compression::Dwab => exr::Compression::Dwab(exr.dwa_level as f32),
    };
    let error = if exr.stderr { exr::StandardError::Write } else { exr::StandardError::Leave };
    // Bands come first.
    let mut errors = band_errors(finish, frame, 0..finish.spectral_channels().start);
    let shared = match finish.bands {
        true => shared_errors_of_bands(finish, frame, 0..finish.spectral_channels().start, &errors),
        false => frame.shared_errors(image, &finish.rgb_from_xyz(), finish.sharing),
    };
    let mut beyond: BTreeMap<&str, Beyond> = BTreeMap::new();
    let layer = |(i, channel): (usize, &'a Channel)| {
        let own = LayerPlane {
            name: channel.name.clone(),
            plane: match channel.holds {
                Holds::Once => frame.layer_once(i),
                Holds::Band | Holds::Light | Holds::Data => {
                    let plane = frame.layer(i);
                    // What sums count as it is has its place in a float; so has coverage, which is no light.
                    if channel.exponent != 0 {
                        let layer = channel.name.rsplit_once('.').map_or(&*channel.name, |(layer, _)| layer);
                        let (beyond, unit) = (beyond.entry(layer).or_default(), unit(channel));
                        plane.iter().for_each(|x| beyond.add(f64::from(*x) * unit));
                    }
                    whole(plane, channel)
                }
            },
            kind: match channel.holds {
                Holds::Light => exr::PlaneKind::Colour,
                Holds::Band => exr::PlaneKind::Band,
                Holds::Data | Holds::Once => exr::PlaneKind::Data,
            },
        };
        let error = errors.get_mut(i).map(|plane| LayerPlane {
            name: stderr_name(&channel.name),
            plane: whole(std::mem::take(plane), channel),
            kind: exr::PlaneKind::Data,
        });
        [Some(own), error].into_iter().flatten()
    };
    let own = finish.layers.iter().enumerate().filter(|(i, _)| !finish.spectral_channels().contains(i));
    let own = own.flat_map(layer).collect();
    let colour = ColourEncoding::of(colour_space(finish.output.colour));
    let mut beauty = exr::beauty(image, finish.base(), own, colour, precision, error, compression);
    if frame.film.layers.invalid.total() > 0 {
        let samples = frame.film.layers.invalid.total();
        report.notes.push(format!("in {samples} samples a number of a layer could not be added, and counts as zero"));
    }
    let told = beyond.iter().filter_map(|(layer, beyond)| Some(format!("layer {layer}: {}", beyond.note()?)));
    report.notes.extend(told);
    let as_asked = beauty.note.is_none();
    report.notes.extend(beauty.note.take());
    let mut file = beauty.exr;
    file.layout = match exr.layout {
        description::FileLayout::Single => exr::Layout::Single,
        description::FileLayout::Multipart => exr::Layout::Multipart,
    };
    file.attributes = attributes(finish, frame, report, report.error.as_ref());
    file.attributes.extend(shared_errors(shared));
    if finish.bands {
        let bands = finish.spectral_channels().start;
        file.attributes.push((exr::BANDS.to_owned(), Attribute::Int(bands as i32)));
    }
    if exr.aces_container && as_asked {
        file.attributes.push(("acesImageContainerFlag".to_owned(), Attribute::Int(1)));
    } else if exr.aces_container {
        report.notes.push("an ACES container holds half floats only: the file is none".to_owned());
    }
    if finish.variance {
        let mut lost = Beyond::default();
        let mut squares = |errors: &[f32]| {
            errors.iter().for_each(|error| lost.add(f64::from(*error) * f64::from(*error)));
            ChannelData::F32(errors.iter().map(|x| x * x).collect())
        };
        // Bands stand in place of colours.
        for i in 0..finish.spectral_channels().start {
            let channel = &finish.layers[i];
            let error = whole(band_error(finish, frame, i), channel);
            file.push_data(format!("variance.{}", channel.name), squares(&error));
        }
        for &(name, i) in finish.base().colours() {
            file.push_data(format!("variance.{name}"), squares(&image.standard_error[i]));
        }
        report
            .notes
            .extend(lost.note().map(|lost| format!("layer variance: {lost}; a layer stderr holds their roots")));
    }
    if finish.sample_count {
        let count = |cells: &PixelCells| cells.iter().map(|cell| cell.count).sum();
        let counts = frame.film.cells().iter().map(count).collect();
        file.push_data("sampleCount".to_owned(), ChannelData::U32(counts));
    }
    for matte in &finish.mattes {
        let (channels, attributes) = matte.write(&frame.film);
        channels.into_iter().for_each(|(name, samples)| file.push_data(name, samples));
        file.attributes.extend(attributes);
    }
    let infinite = image.rgb.iter().flatten().filter(|x| x.is_infinite()).count();
    if infinite > 0 {
        report.notes.push(format!("{infinite} values are more than 32-bit floats hold: they are written as infinite"));
    }
    file
}

/// What 32-bit floats do not hold of numbers as they are written.
#[derive(Default)]
struct Beyond {
    /// How many are infinite then that are not.
    infinite: usize,
    /// The size of the greatest.
    most: f64,
}

impl Beyond {
    fn add(&mut self, number: f64) {
        if number.is_finite() {
            self.infinite += usize::from((number as f32).is_infinite());
            self.most = self.most.max(number.abs());
        }
    }

    /// What is lost, if anything: the greatest, or all.
    fn note(&self) -> Option<String> {
        match self.infinite {
            0 if self.most > 0.0 && self.most < f64::from(f32::MIN_POSITIVE) => {
                Some("all values are less than 32-bit floats hold with all digits (1.2e-38)".to_owned())
            }
            0 => None,
            infinite => {
                Some(format!("{infinite} values are more than 32-bit floats hold: they are written as infinite"))
            }
        }
    }
}

/// The attribute that tells how much more the sum of all pixels varies than that of independent ones; none where it is no more.
fn shared_errors(shared: f64) -> Option<(String, Attribute)> {
    (shared > 1.0).then(|| (exr::SHARED_ERRORS.to_owned(), Attribute::Text(format!("{shared:.3}"))))
}

/// What the sums of `channel` count its numbers over.
fn unit(channel: &Channel) -> f64 {
    2f64.powi(channel.exponent)
}

/// The numbers of `channel`, or their standard errors, of which `plane` is as the sums count them.
fn whole(mut plane: Vec<f32>, channel: &Channel) -> Vec<f32> {
    let unit = unit(channel);
    plane.iter_mut().for_each(|x| *x = (f64::from(*x) * unit) as f32);
    plane
}

/// The standard errors of the bands that are `channels`, as their sums count them; none where they are not wanted.
fn band_errors(finish: &Finish, frame: &Frame, channels: Range<usize>) -> Vec<Vec<f32>> {
    let error = |i: usize| band_error(finish, frame, i);
    if finish.output.exr.stderr { channels.map(error).collect() } else { Vec::new() }
}

/// The standard error of the band that is `channel`, as its sums count it.
fn band_error(finish: &Finish, frame: &Frame, channel: usize) -> Vec<f32> {
    // As of colours: samples that are not random would be the same again.
    if finish.is_random() { frame.layer_error(channel) } else { vec![0.0; frame.film.window().pixels()] }
}

/// What pixels share of the errors of the bands that are `channels`, which is no less where those are not written.
fn shared_errors_of_bands(finish: &Finish, frame: &Frame, channels: Range<usize>, written: &[Vec<f32>]) -> f64 {
    if !written.is_empty() {
        return frame.shared_errors_of_bands(channels.start, written, finish.sharing);
    }
    let errors: Vec<Vec<f32>> = channels.clone().map(|i| frame.layer_error(i)).collect();
    frame.shared_errors_of_bands(channels.start, &errors, finish.sharing)
}

/// The path of the spectral file beside the EXR at `path`: `name.spectral.exr`, and before the number of a frame.
#[must_use]
pub fn spectral_path(path: &Path) -> PathBuf {
    let stem = Path::new(path.file_stem().unwrap_or_default());
    let is_number = |n: &&str| {
        let digits = n.strip_prefix('-').unwrap_or(n);
        !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit())
    };
    let number = stem.extension().and_then(OsStr::to_str).filter(is_number);
    // Whatever bytes the name has: those of two pictures differ.
    let name = if number.is_some() { stem.file_stem().unwrap_or_default() } else { stem.as_os_str() };
    let mut file = name.to_owned();
    file.push(number.map_or(".spectral.exr".into(), |number| format!(".spectral.{number}.exr")));
    path.with_file_name(file)
}

/// The files of the picture at `path`.
#[must_use]
pub fn of(finish: &Finish, path: &Path) -> Vec<PathBuf> {
    let [exr, png, spectral] = places(path);
    [exr, png].into_iter().chain(finish.output.spectral.map(|_| spectral)).collect()
}

/// All files that the picture at `path` may have.
#[must_use]
pub fn places(path: &Path) -> [PathBuf; 3] {
    [path.to_path_buf(), path.with_extension("png"), spectral_path(path)]
}

/// What the render of the picture at `path`, which is `whole` or a part, is going to write.
#[must_use]
pub fn written(path: &Path, output: &description::Output, whole: bool) -> Vec<PathBuf> {
    let [exr, png, spectral] = places(path);
    let mut files = vec![exr, checkpoint::place(path)];
    files.extend(whole.then_some(png));
    files.extend(output.spectral.filter(|_| whole).map(|_| spectral));
    files
}

/// All files that a render of the picture at `path`, which is `whole` or a part, may write or take away, in its midst as well.
#[must_use]
pub fn touched(path: &Path, whole: bool) -> Vec<PathBuf> {
    let [exr, png, spectral] = places(path);
    let mut files = vec![exr, checkpoint::place(path), checkpoint::snapshot_place(path)];
    // A part has nothing of a picture beside it.
    if whole {
        files.extend([png, spectral]);
    }
    files
}

/// Bands of the spectrum, where they are wanted, as Fichet, Pacanowski and Wilkie have them ("An OpenEXR Layout for Spectral
/// Images", JCGT 10(3), 2021, layout 1.0): `S0.<nm>nm` is the mean spectral radiance of a band around that wavelength,
/// W·m⁻²·sr⁻¹·nm⁻¹; R, G and B show them, and `stderr.S0.<nm>nm` is the standard error of each value where those are wanted.
fn spectral_image(finish: &Finish, frame: &Frame, image: &Image, report: &SceneReport) -> Option<ExrImage> {
    let channels = finish.spectral_channels();
    if channels.is_empty() {
        return None;
    }
    let plane = |i: usize| (finish.layers[i].name.clone(), ChannelData::F32(whole(frame.layer(i), &finish.layers[i])));
    let preview = ["R", "G", "B"].iter().zip(&image.rgb);
    let preview = preview.map(|(name, plane)| ((*name).to_owned(), ChannelData::F32(plane.clone())));
    let error = frame.error_of_bands(channels.clone(), &finish.gauge());
    let mut attributes = attributes(finish, frame, report, error.as_ref());
    let text = |name: &str, value: &str| (name.to_owned(), Attribute::Text(value.to_owned()));
    attributes.extend([text("spectralLayoutVersion", "1.0"), text("emissiveUnits", "W.m^-2.sr^-1")]);
    attributes.push((header::SPECTRAL.to_owned(), Attribute::Int(channels.len() as i32)));
    let errors = band_errors(finish, frame, channels.clone());
    attributes.extend(shared_errors(shared_errors_of_bands(finish, frame, channels.clone(), &errors)));
    let own = finish.layers[channels.clone()].iter().zip(errors);
    let errors: Vec<(String, ChannelData)> =
        own.map(|(channel, plane)| (stderr_name(&channel.name), ChannelData::F32(whole(plane, channel)))).collect();
    Some(ExrImage {
        frame: image.frame,
        window: image.window,
        data: errors.iter().map(|(name, _)| name.clone()).collect(),
        channels: channels.map(plane).chain(preview).chain(errors).collect(),
        colour: Some(ColourEncoding::of(finish.space())),
        attributes,
        compression: exr::Compression::Zip,
        layout: exr::Layout::Single,
    })
}

/// The bytes of a file that is to be at `path`, which says what its channels add up to, so that damage shows.
fn sealed(path: &Path, file: &mut ExrImage) -> Result<Vec<u8>> {
    let fail = |message| Error::output(path, message);
    file.attributes.push(("abbe/contentHash".to_owned(), Attribute::Text(file.content_hash().map_err(fail)?)));
    exr::encode_exr(file).map_err(fail)
}

/// 128 bits of BLAKE3 over the numbers of a picture.
fn pixel_hash(image: &Image) -> String {
    let mut hasher = blake3::Hasher::new();
    let mut bytes = Vec::new();
    for plane in image.rgb.iter().chain([&image.alpha]) {
        bytes.clear();
        bytes.extend(plane.iter().flat_map(|x| x.to_le_bytes()));
        hasher.update(&bytes);
    }
    hasher.finalize().to_hex()[..32].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::{Overrides, entries, prepare};
    use std::sync::atomic::AtomicBool;

    /// Where one cannot be written there is none: on a full disk a new file of bands stood beside the old picture.
    #[test]
    fn the_files_of_a_picture_are_all_there_or_none() {
        let dir = tempfile::tempdir().unwrap();
        let [yaml, exr, png] = ["s.yaml", "a.exr", "a.png"].map(|name| dir.path().join(name));
        let text = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 4, height: 4}\n\
            render: {samples: 4}\nlights: [constant: {radiance: 1}]\noutput: {spectral: {bands: 1}}\n";
        std::fs::write(&yaml, text).unwrap();
        let none = Overrides::default();
        let prepared = prepare(&entries(&yaml, &none).unwrap()[0], &none).unwrap();
        let (filter, finish) = (prepared.sampler().unwrap(), Finish::of(&prepared));
        let frame = frame::render(&prepared.job(&filter), &|_| {}, &AtomicBool::new(false)).unwrap();
        let mut report = SceneReport::new("s", None);
        std::fs::create_dir(&png).unwrap();
        let e = write(&finish, &frame, Ok(()), &exr, &mut report).unwrap_err().to_string();
        assert!(e.ends_with("a.png: cannot write: it is a directory"), "{e}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2, "the scene, and the directory");
        std::fs::remove_dir(&png).unwrap();
        write(&finish, &frame, Ok(()), &exr, &mut report).unwrap();
        assert!(places(&exr).iter().all(|file| file.is_file()));
    }

    /// Squares of f32 end at 1.8e19 and begin at 1.1e-19.
    #[test]
    fn variances_that_floats_do_not_hold_are_told() {
        let note = |errors: &[f32]| {
            let mut squares = Beyond::default();
            errors.iter().for_each(|error| squares.add(f64::from(*error) * f64::from(*error)));
            squares.note()
        };
        let beyond = "2 values are more than 32-bit floats hold: they are written as infinite";
        assert_eq!(note(&[1.9e19, 1.0, 1e25, f32::INFINITY, f32::NAN]).as_deref(), Some(beyond));
        assert!(note(&[1e-20, 0.0, f32::NAN]).unwrap().contains("less than 32-bit floats hold"));
        // What is next to nothing beside the rest is no loss.
        for held in [&[1.8e19f32, 1e-30, 0.0][..], &[1.1e-19, 1e-30], &[0.0, f32::NAN], &[]] {
            assert_eq!(note(held), None, "{held:?}");
        }
    }

    #[test]
    fn numbers_of_frames_stay_at_the_end() {
        for (path, expected) in [
            ("o/a.exr", "o/a.spectral.exr"),
            ("o/a.0001.exr", "o/a.spectral.0001.exr"),
            ("o/a.-001.exr", "o/a.spectral.-001.exr"),
            ("o/a.-.exr", "o/a.-.spectral.exr"),
            ("o/a.1-1.exr", "o/a.1-1.spectral.exr"),
        ] {
            assert_eq!(spectral_path(Path::new(path)), Path::new(expected));
        }
    }

    /// Two pictures whose names differ by what is no letter had one file of bands.
    #[cfg(unix)]
    #[test]
    fn names_keep_bytes_that_are_no_text() {
        use std::os::unix::ffi::OsStrExt;
        let path = |bytes| Path::new(OsStr::from_bytes(bytes));
        assert_eq!(spectral_path(path(b"o/\xff.exr")), path(b"o/\xff.spectral.exr"));
        assert_eq!(spectral_path(path(b"o/\xff.0001.exr")), path(b"o/\xff.spectral.0001.exr"));
    }
}
