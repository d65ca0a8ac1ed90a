//! Who covers how much of each pixel: counts of samples, by number of what they met.
//!
//! Counts are added, so the order of tiles, threads and parts decides nothing.

use super::Window;

/// Samples of each pixel of a window by what they met, in raster order; empty where mattes are not asked for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mattes {
    /// By rising number.
    pixels: Vec<Vec<(u64, u32)>>,
}

impl Mattes {
    /// Whether there is nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.pixels.clear();
    }

    /// Adds `count` samples that met `number` to the pixel at `index` of `pixels`.
    pub fn add(&mut self, index: usize, pixels: usize, number: u64, count: u32) {
        if self.pixels.is_empty() {
            self.pixels.resize(pixels, Vec::new());
        }
        let counts = &mut self.pixels[index];
        match counts.binary_search_by_key(&number, |(number, _)| *number) {
            Ok(at) => counts[at].1 = counts[at].1.saturating_add(count),
            Err(at) => counts.insert(at, (number, count)),
        }
    }

    /// Adds those of `inner`, which lies in `window`.
    ///
    /// # Panics
    /// If it does not.
    pub fn merge(&mut self, window: Window, part: &Mattes, inner: Window) {
        for (from, counts) in part.pixels.iter().enumerate() {
            let (column, row) = (from % inner.width as usize, from / inner.width as usize);
            let place = [inner.x + column as i32, inner.y + row as i32];
            let to = window.index(place).expect("the part lies in the window");
            for &(number, count) in counts {
                self.add(to, window.pixels(), number, count);
            }
        }
    }

    /// What the samples of the pixel at `index` met, by rising number.
    #[must_use]
    pub fn of(&self, index: usize) -> &[(u64, u32)] {
        self.pixels.get(index).map_or(&[], Vec::as_slice)
    }

    /// The most things that a pixel has.
    #[must_use]
    pub fn most(&self) -> usize {
        self.pixels.iter().map(Vec::len).max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_add_up_in_any_order() {
        // The lower two of three rows, on the right.
        let (window, right) = (Window::full(2, 3), Window { x: 1, y: 1, width: 1, height: 2 });
        let mut whole = Mattes::default();
        let mut part = Mattes::default();
        for (pixel, number) in [(0, 7), (3, 9), (3, 3), (5, 3), (3, 9)] {
            whole.add(pixel, 6, number, 1);
            if pixel > 0 {
                part.add((pixel - 3) / 2, 2, number, 1);
            }
        }
        assert_eq!([0, 3, 5].map(|i| whole.of(i)), [&[(7, 1)][..], &[(3, 1), (9, 2)], &[(3, 1)]]);
        let mut merged = Mattes::default();
        merged.merge(window, &part, right);
        merged.add(0, 6, 7, 1);
        assert_eq!((merged.most(), &merged), (2, &whole));
    }
}
