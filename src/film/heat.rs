//! The error of each pixel as a small picture: dark where light is known well, bright where it is not.

use crate::film::error::floor_about;
use crate::film::resolve::Image;

/// Relative standard errors at the ends of the scale, which is logarithmic.
pub const SCALE: [f64; 2] = [1e-3, 1.0];

/// Colours along the scale: matplotlib's inferno (Smith and van der Walt 2015, CC0) at each quarter.
const COLOURS: [[f64; 3]; 5] =
    [[0.0, 0.0, 4.0], [87.0, 16.0, 110.0], [188.0, 55.0, 84.0], [249.0, 142.0, 9.0], [252.0, 255.0, 164.0]];

/// A small picture in sRGB, three bytes a pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Small {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Three bytes a pixel, in raster order.
    pub rgb: Vec<u8>,
}

/// Blocks of whole pixels such that neither side has more than `side`.
pub fn blocks(width: usize, height: usize, side: usize) -> (usize, [usize; 2]) {
    let step = width.max(height).div_ceil(side).max(1);
    (step, [width.div_ceil(step), height.div_ceil(step)])
}

/// The error map of `image`, with at most `side` pixels a side: of each block, the root of the mean of
/// σ² / (Y² + 0.01 Ȳ²), as the relative error of a picture counts it; `luminance` are the weights of the channels. `None`
/// where no error is known.
#[must_use]
pub fn error_map(image: &Image, luminance: [f64; 3], side: usize) -> Option<Small> {
    let (width, height) = (image.window.width as usize, image.window.height as usize);
    let known = image.standard_error[1].iter().any(|e| !e.is_nan());
    if width == 0 || height == 0 || !known {
        return None;
    }
    let weigh = |planes: &[Vec<f32>; 3], i: usize| -> f64 {
        (0..3).map(|c| luminance[c].abs() * f64::from(planes[c][i])).sum()
    };
    let n = width * height;
    let mean = (0..n).map(|i| weigh(&image.rgb, i)).filter(|y| y.is_finite()).sum::<f64>() / n as f64;
    let (step, [columns, rows]) = blocks(width, height, side);
    let mut rgb = Vec::with_capacity(3 * columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let (mut sum, mut count) = (0.0, 0usize);
            for y in row * step..((row + 1) * step).min(height) {
                for x in column * step..((column + 1) * step).min(width) {
                    let i = y * width + x;
                    let (value, error) = (weigh(&image.rgb, i), weigh(&image.standard_error, i));
                    let relative = error * error / (value * value + floor_about(mean));
                    // Black without error is known.
                    let relative = if error == 0.0 { 0.0 } else { relative };
                    if relative.is_finite() {
                        (sum, count) = (sum + relative, count + 1);
                    }
                }
            }
            rgb.extend(if count == 0 { [128; 3] } else { colour((sum / count as f64).sqrt()) });
        }
    }
    Some(Small { width: columns, height: rows, rgb })
}

/// The colour of a relative standard error.
#[must_use]
pub fn colour(error: f64) -> [u8; 3] {
    let [low, high] = SCALE.map(libm::log10);
    let at = ((libm::log10(error.max(1e-30)) - low) / (high - low)).clamp(0.0, 1.0) * 4.0;
    let i = (at as usize).min(3);
    [0, 1, 2].map(|c| (COLOURS[i][c] + (at - i as f64) * (COLOURS[i + 1][c] - COLOURS[i][c])).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;

    /// Quarters of value 1, above an error of 0.001 and one of 1.01, below the other way round. The mean is 1, so the errors are divided
    /// by √1.01.
    #[test]
    fn each_block_has_the_colour_of_its_own_error() {
        let (width, height) = (8u32, 8u32);
        let n = (width * height) as usize;
        let error: Vec<f32> = (0..n).map(|i| if (i % 8 < 4) == (i < 32) { 0.001 } else { 1.01 }).collect();
        let plane = vec![1.0f32; n];
        let mut image = Image {
            frame: [width, height],
            window: Window::full(width, height),
            rgb: [plane.clone(), plane.clone(), plane.clone()],
            alpha: plane,
            standard_error: [error.clone(), error.clone(), error],
        };
        let map = error_map(&image, [0.2, 0.7, 0.1], 2).unwrap();
        assert_eq!((map.width, map.height), (2, 2));
        let (dark, bright) = ([0, 0, 4], [252, 255, 164]);
        assert_eq!(map.rgb, [dark, bright, bright, dark].concat());
        image.standard_error[1].fill(f32::NAN);
        assert_eq!(error_map(&image, [0.2, 0.7, 0.1], 2), None);
    }
}
