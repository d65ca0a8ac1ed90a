//! A part of a picture, as a person asks for it.

use super::part::{self, Share};
use crate::error::{Error, Result};
use crate::film::Window;

/// A part of a picture as a person asks for it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Portion {
    /// `--tile i/n`: the i-th, from 0, of n bands of rows.
    pub tile: Option<[u32; 2]>,
    /// Of each pixel.
    pub samples: Option<Samples>,
}

/// Some of the samples of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Samples {
    /// `--samples a-b`: from the first to the last.
    Range([u32; 2]),
    /// `--samples i/n`: the i-th, from 0, of n even ranges.
    Nth([u32; 2]),
}

impl Samples {
    /// The first and the last one, of `samples`.
    fn of(self, samples: u32) -> Result<[u32; 2]> {
        let bound = |i: u32, n: u32| (u64::from(samples) * u64::from(i) / u64::from(n)) as u32;
        match self {
            Samples::Range([first, last]) if first > last || last >= samples => {
                let most = samples - 1;
                Err(Error::Config(format!(
                    "--samples {self}: expected a-b with a not above b, from 0-0 to {most}-{most}: the scene has {samples} \
                     samples a pixel"
                )))
            }
            Samples::Range(range) => Ok(range),
            Samples::Nth([i, n]) if i >= n || n > samples => Err(Error::Config(format!(
                "--samples {self}: expected i/n with i from 0 to n - 1 and n at most {samples}, the samples of a pixel"
            ))),
            Samples::Nth([i, n]) => Ok([bound(i, n), bound(i + 1, n) - 1]),
        }
    }
}

impl std::fmt::Display for Samples {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Samples::Range([a, b]) => write!(f, "{a}-{b}"),
            Samples::Nth([i, n]) => write!(f, "{i}/{n}"),
        }
    }
}

impl Portion {
    /// Whether all is asked for, and no part.
    #[must_use]
    pub fn is_all(&self) -> bool {
        *self == Portion::default()
    }

    /// The share of a picture of `window` and `samples`, of which `rows` of the frame stay together.
    ///
    /// # Errors
    /// [`Error::Config`] for a tile or samples that the picture does not have.
    pub fn share(&self, window: Window, samples: u32, rows: u32) -> Result<Share> {
        let [tile, tiles] = self.tile.unwrap_or([0, 1]);
        let most = part::bands(window, rows);
        if tiles == 0 || u64::from(tiles) > most || tile >= tiles {
            let cells = if rows > 1 { " of cells of adaptive sampling" } else { "" };
            return Err(Error::Config(format!(
                "--tile {tile}/{tiles}: expected i/n with i from 0 to n - 1 and n at most {most}, the rows{cells} of the \
                 picture"
            )));
        }
        if let (Some(samples), true) = (self.samples, rows > 1) {
            return Err(Error::Config(format!(
                "--samples {samples}: expected --tile i/n or render.techniques.adaptive: off, found adaptive \
                 sampling, which tells from all first samples where others go"
            )));
        }
        let [first, last] = self.samples.map_or(Ok([0, samples - 1]), |some| some.of(samples))?;
        Ok(Share { tile, tiles, samples: first..last + 1, rows })
    }

    /// What tells the name of a part from that of the picture.
    pub(super) fn suffix(&self) -> String {
        let tile = self.tile.map_or(String::new(), |[i, n]| format!(".tile{i}of{n}"));
        let samples = self.samples.map_or(String::new(), |samples| match samples {
            Samples::Range([a, b]) => format!(".samples{a}-{b}"),
            Samples::Nth([i, n]) => format!(".samples{i}of{n}"),
        });
        tile + &samples
    }
}
