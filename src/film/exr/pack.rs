//! Packs the rows of a part: Deflate here, the rest by the `exr` crate.

use super::{ChannelData, Compression, ExrImage};
use crate::film::Window;
use ::exr::block::{BlockIndex, UncompressedBlock, enumerate_ordered_header_block_indices};
use ::exr::math::Vec2;
use ::exr::meta::BlockDescription;
use ::exr::meta::attribute::{ChannelDescription, IntegerBounds, LineOrder, SampleType, Text};
use ::exr::meta::header::Header;
use ::exr::prelude::SmallVec;
use flate2::{Compress, FlushCompress, Status};
use half::f16;
use rayon::prelude::*;
use std::cell::RefCell;
use std::ops::Range;

/// A channel: its name and its pixels.
pub(super) type Channel<'a> = (&'a str, &'a ChannelData);

/// The rows of `channels` of `image`, packed, in their order.
pub(super) fn chunks(
    image: &ExrImage,
    channels: &[Channel],
    compression: Compression,
) -> std::result::Result<Vec<Vec<u8>>, String> {
    let header = compressor_header(image, channels, compression);
    let headers = [header];
    let blocks: Vec<(usize, BlockIndex)> = enumerate_ordered_header_block_indices(&headers).collect();
    let deflated = match compression {
        Compression::Zips => Some(1),
        Compression::Zip => Some(16),
        Compression::None | Compression::Piz | Compression::Dwaa(_) | Compression::Dwab(_) => None,
    };
    blocks
        .par_iter()
        .map(|&(_, index)| {
            if let Some(rows) = deflated {
                let first = index.pixel_position.y();
                return Ok(deflated_chunk(&image.window, channels, first..first + rows));
            }
            let block = UncompressedBlock::from_lines(&headers[0].channels, index, |line| {
                let place = line.location;
                let start = place.position.y() * image.window.width as usize + place.position.x();
                let range = start..start + place.sample_count;
                // The line has the length and type that the header gave it, so this cannot fail.
                let written = match channels[place.channel].1 {
                    ChannelData::F16(samples) => line.write_samples_from_slice::<f16>(&samples[range]),
                    ChannelData::F32(samples) => line.write_samples_from_slice::<f32>(&samples[range]),
                    ChannelData::U32(samples) => line.write_samples_from_slice::<u32>(&samples[range]),
                };
                debug_assert!(written.is_ok());
            });
            let mut bytes = Vec::new();
            block.compress_to_chunk(&headers)?.write(&mut bytes, 1)?;
            Ok(bytes)
        })
        .collect::<::exr::error::Result<Vec<Vec<u8>>>>()
        .map_err(|e| format!("packing the pixels failed: {e}"))
}

/// What the packer has to know. This header is not the one that is written.
fn compressor_header(image: &ExrImage, channels: &[Channel], compression: Compression) -> Header {
    let list: SmallVec<[ChannelDescription; 5]> = channels
        .iter()
        .map(|(name, data)| {
            let kind = match data {
                ChannelData::F16(_) => SampleType::F16,
                ChannelData::F32(_) => SampleType::F32,
                ChannelData::U32(_) => SampleType::U32,
            };
            ChannelDescription::new(Text::from_slice_unchecked(name.as_bytes()), kind, false)
        })
        .collect();
    let compression = match compression {
        Compression::None => ::exr::compression::Compression::Uncompressed,
        Compression::Zips => ::exr::compression::Compression::ZIP1,
        Compression::Zip => ::exr::compression::Compression::ZIP16,
        Compression::Piz => ::exr::compression::Compression::PIZ,
        Compression::Dwaa(level) => ::exr::compression::Compression::DWAA(Some(level)),
        Compression::Dwab(level) => ::exr::compression::Compression::DWAB(Some(level)),
    };
    let size = Vec2(image.window.width as usize, image.window.height as usize);
    let frame = Vec2(image.frame[0] as usize, image.frame[1] as usize);
    Header::new(Text::from_slice_unchecked(b"beauty"), size, list)
        .with_position(Vec2(image.window.x, image.window.y))
        .with_display_window(IntegerBounds::new(Vec2(0, 0), frame))
        .with_encoding(compression, BlockDescription::ScanLines, LineOrder::Increasing)
}

/// A chunk of up to 16 rows, counted from the window's first, packed as ZIP and ZIPS have it.
///
/// The bytes of all numbers, low ones first, are parted into those at even and those at odd places, each less the one
/// before it, and deflated. The fastest level: noise does not shrink further at a slower one.
fn deflated_chunk(window: &Window, channels: &[Channel], rows: Range<usize>) -> Vec<u8> {
    let width = window.width as usize;
    let rows = rows.start..rows.end.min(window.height as usize);
    let per_pixel: usize = channels.iter().map(|(_, data)| if let ChannelData::F16(_) = data { 2 } else { 4 }).sum();
    let mut plain = Vec::with_capacity(per_pixel * width * rows.len());
    for row in rows.clone() {
        let line = row * width..(row + 1) * width;
        for (_, data) in channels {
            match data {
                ChannelData::F16(v) => plain.extend(v[line.clone()].iter().flat_map(|x| x.to_le_bytes())),
                ChannelData::F32(v) => plain.extend(v[line.clone()].iter().flat_map(|x| x.to_le_bytes())),
                ChannelData::U32(v) => plain.extend(v[line.clone()].iter().flat_map(|x| x.to_le_bytes())),
            }
        }
    }
    let mut parted: Vec<u8> = Vec::with_capacity(plain.len());
    parted.extend(plain.iter().step_by(2));
    parted.extend(plain.iter().skip(1).step_by(2));
    // The first byte stands as it is; a difference of nothing is 128.
    let differences: Vec<u8> = std::iter::once(parted[0])
        .chain(parted.windows(2).map(|pair| pair[1].wrapping_sub(pair[0]).wrapping_add(128)))
        .collect();
    pack(window.y + rows.start as i32, &differences, plain)
}

thread_local! {
    /// A thread's own, for a new one takes as long as a few rows.
    static DEFLATE: RefCell<Compress> = RefCell::new(compressor());
}

fn compressor() -> Compress {
    Compress::new(flate2::Compression::fast(), true)
}

/// The chunk of the rows from `y` on: `bytes` deflated. What does not shrink is stored as it is, `plain`, and known by
/// its length.
pub(super) fn pack(y: i32, bytes: &[u8], plain: Vec<u8>) -> Vec<u8> {
    // It fills the room that there is, and no more: what zlib's `deflateBound` gives holds the whole of anything.
    let length = bytes.len();
    let mut packed = Vec::with_capacity(length + length.div_ceil(8) + length.div_ceil(64) + 11);
    let whole = DEFLATE.with_borrow_mut(|deflate| {
        deflate.reset();
        let whole = matches!(deflate.compress_vec(bytes, &mut packed, FlushCompress::Finish), Ok(Status::StreamEnd));
        // One that is left in the middle of a block does not begin the next stream with one, reset or not (zlib-rs 0.6.8).
        if !whole {
            *deflate = compressor();
        }
        whole
    });
    let pixels = if whole && packed.len() < plain.len() { packed } else { plain };
    let mut chunk = Vec::with_capacity(8 + pixels.len());
    chunk.extend_from_slice(&y.to_le_bytes());
    chunk.extend_from_slice(&(pixels.len() as i32).to_le_bytes());
    chunk.extend_from_slice(&pixels);
    chunk
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::mix64;
    use std::io::Read;

    /// Noise does not shrink, and is left in the middle, where its room ends, a little or much more than the compressor holds itself.
    /// What a thread packs next comes back as it was.
    #[test]
    fn what_follows_noise_is_packed_as_if_it_came_first() {
        let noise = |bytes: u64| -> Vec<u8> { (0..bytes).map(|i| mix64(i) as u8).collect() };
        let even: Vec<u8> = (0..8192).map(|i| (i / 64) as u8).collect();
        for kibibytes in [4, 32, 63, 64, 65, 66, 72, 96, 128, 256, 1024] {
            let noise = noise(kibibytes * 1024);
            assert_eq!(pack(0, &noise, noise.clone())[8..], noise, "{kibibytes} KiB");
            let packed = pack(0, &even, even.clone());
            let mut found = Vec::new();
            let inflated = flate2::read::ZlibDecoder::new(&packed[8..]).read_to_end(&mut found);
            assert!(packed.len() < even.len() && inflated.is_ok() && found == even, "{kibibytes} KiB: {inflated:?}");
        }
    }
}
