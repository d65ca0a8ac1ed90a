//! Where the chunks of a file lie and what they announce, before their pixels are unpacked.

use ::exr::block::chunk::TileCoordinates;
use ::exr::compression::Compression;
use ::exr::math::Vec2;
use ::exr::meta::header::Header;
use ::exr::meta::{BlockDescription, MetaData};
use std::io::{BufReader, Read, Result, Seek, SeekFrom};
use std::path::Path;

/// Whether the rows of the file at `path`, which has no tiles, lie in it one behind the other: no chunk of them ends beyond the
/// beginning of the next one or the end of the file. A length that is damaged need not show in the pixels that are read here, for
/// what follows the end of deflated rows is passed over; other readers refuse them.
///
/// # Errors
/// Of the system, or for a file that ends early.
pub fn rows_are_apart(path: &Path) -> Result<bool> {
    let mut reader = BufReader::new(std::fs::File::open(path)?);
    let length = reader.get_ref().metadata()?.len();
    let meta = MetaData::read_from_buffered(&mut reader, false).map_err(std::io::Error::other)?;
    let starts = starts(&mut reader, &meta, length)?;
    let mut file = reader.into_inner();
    // A chunk begins with the number of its part, where there are several, and that of its first row.
    let before = if meta.requirements.has_multiple_layers { 8 } else { 4 };
    for (i, start) in starts.iter().enumerate() {
        file.seek(SeekFrom::Start(start.saturating_add(before)))?;
        let mut size = [0; 4];
        file.read_exact(&mut size)?;
        let end = start.saturating_add(before + 4 + u64::from(u32::from_le_bytes(size)));
        if end > starts.get(i + 1).copied().unwrap_or(length) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Whether chunks packed by DWA announce no more numbers than their pixels can have: the decoder takes memory for what they
/// announce before it unpacks it. `reader` stands behind the headers of a file of `length` bytes.
pub(super) fn counts_can_be(reader: &mut (impl Read + Seek), meta: &MetaData, length: u64) -> Result<bool> {
    /// Eleven numbers of eight bytes (`DataSizesSingle` of OpenEXR's internal_dwa_compressor.h), those of bytes and numbers among
    /// them: the version is first, and last is which code the AC numbers have.
    const COUNTS: usize = 11;
    if !meta.headers.iter().any(is_dwa) {
        return Ok(true);
    }
    let several = meta.requirements.has_multiple_layers;
    for start in starts(reader, meta, length)? {
        let mut word = [0; 4];
        // Places that are beyond the end are told where pixels are read.
        if start > length || reader.seek(SeekFrom::Start(start)).is_err() {
            continue;
        }
        let part = match several {
            true if reader.read_exact(&mut word).is_err() => continue,
            true => u32::from_le_bytes(word) as usize,
            false => 0,
        };
        let Some(header) = meta.headers.get(part).filter(|header| is_dwa(header)) else { continue };
        let Ok((place, size)) = place_of(reader, header) else { continue };
        let Ok(bounds) = header.get_absolute_block_pixel_coordinates(place) else { continue };
        // Pixels that would be no smaller are not packed.
        if u64::from(size) == (bounds.size.area() as u64).saturating_mul(header.channels.bytes_per_pixel as u64) {
            continue;
        }
        let mut counts = [0; 8 * COUNTS];
        if reader.read_exact(&mut counts).is_err() {
            continue;
        }
        let most = most_of_dwa(bounds.size, header.channels.list.len());
        let mut counts = counts.as_chunks().0[1..COUNTS - 1].iter().map(|count| u64::from_le_bytes(*count));
        if counts.any(|count| count > most) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Which block a chunk is, and how many bytes it has, which stand before them.
fn place_of(reader: &mut impl Read, header: &Header) -> Result<(TileCoordinates, u32)> {
    let mut number = || -> Result<i32> {
        let mut word = [0; 4];
        reader.read_exact(&mut word)?;
        Ok(i32::from_le_bytes(word))
    };
    let index = |number: i32| usize::try_from(number).map_err(std::io::Error::other);
    let place = match header.blocks {
        BlockDescription::Tiles(_) => {
            let [x, y, level_x, level_y] = [number()?, number()?, number()?, number()?];
            TileCoordinates {
                tile_index: Vec2(index(x)?, index(y)?),
                level_index: Vec2(index(level_x)?, index(level_y)?),
            }
        }
        BlockDescription::ScanLines => {
            let row = number()?.saturating_sub(header.own_attributes.layer_position.y());
            let block = index(row)? / header.compression.scan_lines_per_block();
            TileCoordinates { tile_index: Vec2(0, block), level_index: Vec2(0, 0) }
        }
    };
    Ok((place, number()? as u32))
}

fn is_dwa(header: &Header) -> bool {
    matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_))
}

/// More than what a chunk of so many pixels and channels that is packed by DWA has of anything: channels are cut into whole blocks of
/// 8 × 8, and runs of bytes take up to half as much again as the bytes, four to a pixel.
fn most_of_dwa(size: Vec2<usize>, channels: usize) -> u64 {
    let sides = [size.width(), size.height()].map(|side| (side as u64).next_multiple_of(8));
    sides[0].saturating_mul(sides[1]).saturating_mul(8 * channels as u64).saturating_add(1024)
}

/// Where the chunks of all parts begin, in ascending order. `reader` stands behind the headers.
fn starts(reader: &mut impl Read, meta: &MetaData, length: u64) -> Result<Vec<u64>> {
    let count = meta.headers.iter().map(|header| header.chunk_count as u64).sum::<u64>().min(length / 8);
    let mut starts = Vec::new();
    let mut word = [0; 8];
    for _ in 0..count {
        reader.read_exact(&mut word)?;
        starts.push(u64::from_le_bytes(word));
    }
    starts.sort_unstable();
    Ok(starts)
}

#[cfg(test)]
mod tests {
    use super::super::{ChannelData, ColourEncoding, Compression, ExrImage, Layout, encode_exr, read_exr};
    use super::{MetaData, starts};
    use crate::film::Window;
    use crate::spectrum::ColourSpace;
    use std::collections::BTreeSet;

    /// Of rows packed by DWA one bit more in any of what they announce: the file is refused, and no memory is taken for it. Rows that are
    /// not packed, since they would be no smaller, announce nothing.
    #[test]
    fn a_chunk_that_announces_too_much_is_damaged() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let encoded = |side: u32, compression: Compression, value: &dyn Fn(u32) -> f32| {
            let image = ExrImage {
                frame: [side; 2],
                window: Window::full(side, side),
                channels: ["R", "G"]
                    .map(|name| (name.to_owned(), ChannelData::F32((0..side * side).map(value).collect())))
                    .into(),
                colour: Some(ColourEncoding::of(ColourSpace::Rec709)),
                attributes: Vec::new(),
                data: BTreeSet::new(),
                compression,
                layout: Layout::Single,
            };
            encode_exr(&image).unwrap()
        };
        for compression in [Compression::Dwaa(45.0), Compression::Dwab(45.0)] {
            let bytes = encoded(64, compression, &|i| (i % 64) as f32 / 64.0);
            std::fs::write(&path, &bytes).unwrap();
            read_exr(&path).unwrap();
            let mut reader = std::io::Cursor::new(&bytes);
            let meta = MetaData::read_from_buffered(&mut reader, false).unwrap();
            let start = starts(&mut reader, &meta, bytes.len() as u64).unwrap()[0] as usize + 8;
            for count in 1..10 {
                for byte in 4..8 {
                    let mut bytes = bytes.clone();
                    bytes[start + 8 * count + byte] ^= 0x10;
                    std::fs::write(&path, &bytes).unwrap();
                    let e = read_exr(&path).unwrap_err();
                    assert_eq!(e.exit_code(), 3);
                    assert!(e.to_string().ends_with("announces more than its pixels can take"), "{count} {byte}: {e}");
                }
            }
            std::fs::write(&path, encoded(2, compression, &|i| 0.25 + 0.3 * i as f32)).unwrap();
            read_exr(&path).unwrap();
        }
    }
}
