//! Samples to files: accumulators, filters, EXR, PNG, and the comparison of two pictures.
//!
//! Samples are added as integers ([`accumulate`], a pixel's in [`run`]s), so any split of the work gives the same bits;
//! [`resolve`] turns sums into a picture with its standard error; [`exr`] and [`png`] write it
//! atomically ([`output`]); [`compare`] says whether two pictures show the same scene.
//!
//! Pixel coordinates are those of the full frame, x to the right and y down; a [`Window`] may lie
//! anywhere in it.

pub mod accumulate;
pub mod compare;
pub mod cryptomatte;
pub mod error;
pub mod exr;
pub mod facts;
pub mod filter;
pub mod heat;
pub mod icc;
pub mod layers;
pub mod mattes;
pub mod output;
pub mod png;
pub mod resolve;
pub mod run;
pub mod sharing;

/// A rectangle of pixels: a crop, a tile, the data or the display window of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct Window {
    /// First column.
    pub x: i32,
    /// First row.
    pub y: i32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Window {
    /// The window of a whole frame.
    #[must_use]
    pub fn full(width: u32, height: u32) -> Window {
        Window { x: 0, y: 0, width, height }
    }

    /// Its pixels, row by row.
    pub fn iter(self) -> impl Iterator<Item = [i32; 2]> {
        let row = move |y: u32| (0..self.width).map(move |x| [self.x + x as i32, self.y + y as i32]);
        (0..self.height).flat_map(row)
    }

    /// How many pixels.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Position of `pixel` in raster order, if it lies in the window.
    #[must_use]
    pub fn index(&self, pixel: [i32; 2]) -> Option<usize> {
        let column = i64::from(pixel[0]) - i64::from(self.x);
        let row = i64::from(pixel[1]) - i64::from(self.y);
        let inside = (0..i64::from(self.width)).contains(&column) && (0..i64::from(self.height)).contains(&row);
        inside.then(|| row as usize * self.width as usize + column as usize)
    }

    /// Its part that is in a frame of this size.
    #[must_use]
    pub fn shown(&self, frame: [u32; 2]) -> Window {
        let cut = |start: i32, size: u32, frame: u32| {
            let end = (i64::from(start) + i64::from(size)).min(i64::from(frame));
            (start.max(0), (end - i64::from(start.max(0))).max(0) as u32)
        };
        let ((x, width), (y, height)) = (cut(self.x, self.width, frame[0]), cut(self.y, self.height, frame[1]));
        Window { x, y, width, height }
    }

    /// Whether every pixel of `other` lies in this window.
    #[must_use]
    pub fn contains(&self, other: &Window) -> bool {
        let fits = |start: i32, size: u32, inner: i32, inner_size: u32| {
            inner >= start && i64::from(inner) + i64::from(inner_size) <= i64::from(start) + i64::from(size)
        };
        fits(self.x, self.width, other.x, other.width) && fits(self.y, self.height, other.y, other.height)
    }
}

impl std::fmt::Display for Window {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{} at ({}, {})", self.width, self.height, self.x, self.y)
    }
}
