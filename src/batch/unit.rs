//! A work unit: some samples of the pixels of a tile.

use super::adaptive::{self, Allocation};
use super::frame::FrameJob;
use super::splatting::{self, Block, Dealt, Pool};
use crate::film::accumulate::{Invalid, REPLICATES, TileBuffer};
use crate::film::layers::{self, Kept, Layout};
use crate::film::run::{LONGEST, LayerRun, Run};
use crate::math::sampler::Octet;
use crate::scene::Scene;
use crate::transport::layers::Source;
use crate::transport::merge::Collection;
use crate::transport::middle;
use crate::transport::path::reuse::{self, Group};
use crate::transport::{Address, Alone, PixelSample, Samples, Shot, address, moment, scene_at};
use std::ops::Range;

/// Renders one work unit into `tile`: `samples` of each pixel, or where they are shared out what that is for each.
pub(super) fn render_unit(
    job: &FrameJob,
    samples: Range<u32>,
    shares: Option<&Allocation>,
    photons: Option<Collection>,
    tile: &mut TileBuffer,
) {
    let FrameJob { scene, moments, plan, filter, seed, .. } = *job;
    let shot = Shot { scene, plan, filter, seed, photons };
    let moments = match photons.and_then(|photons| photons.moment) {
        Some(shared) => &moments[shared..=shared],
        None => moments,
    };
    // Who renders the first sample adds what stands in the pixels once.
    if samples.start == 0 && plan.layers.layers.iter().any(|layer| matches!(layer.source, Source::Middle(_))) {
        for (index, pixel) in tile.window().iter().enumerate() {
            middle::middle(scene, job.next, plan, pixel, |channel, value| {
                tile.layers.add_once(index, [(channel, value)])
            });
        }
    }
    // A scrambling for each replicate, and the number of a sample in it.
    let mut wanted: Vec<(u32, u32)> = Vec::new();
    let want = |pixel: [i32; 2], wanted: &mut Vec<(u32, u32)>| {
        wanted.clear();
        for replicate in 0..REPLICATES as u32 {
            // Samples take turns among the replicates.
            let turns = |s: u32| s.saturating_sub(replicate).div_ceil(REPLICATES as u32);
            let indices = match shares {
                Some(shares) => shares.turns(pixel, replicate, &samples),
                None => turns(samples.start)..turns(samples.end),
            };
            // Or a scrambling for each sample, of which it is the first point.
            let address = |i| if job.independent { (replicate + REPLICATES as u32 * i, 0) } else { (replicate, i) };
            wanted.extend(indices.map(address));
        }
    };
    let weighed = tile.layers.layout().kept == Kept::Weighed;
    let sums = Sums { tile, weighed, runs: Runs::default() };
    let mut unit = Unit { shot, moments, memory: Samples::default(), sums, pools: Vec::new(), numbers: Vec::new() };
    let window = unit.sums.tile.window();
    if plan.splatting {
        for block in splatting::blocks(window, scene.camera.resolution, filter) {
            // A cell has samples of the same numbers in all its pixels.
            want([block.window.x, block.window.y], &mut wanted);
            wanted.chunks(LONGEST as usize).for_each(|run| unit.render_block(&block, run));
        }
    } else if plan.reuse {
        for corner in adaptive::corners(window) {
            for group in reuse::groups(corner, scene.camera.resolution) {
                if group.pixels().iter().any(|pixel| window.index(*pixel).is_some()) {
                    want(corner, &mut wanted);
                    wanted.chunks(LONGEST as usize).for_each(|run| unit.render_group(&group, run));
                }
            }
        }
    } else {
        let pixels: Vec<[i32; 2]> = window.iter().collect();
        let mut left = &pixels[..];
        while let Some(&pixel) = left.first() {
            want(pixel, &mut wanted);
            // Where all have as many samples, and see one moment, few of a pixel go with those of the next.
            let alike = shares.is_none() && moments.is_empty();
            let together = if alike { Octet::SAMPLES / wanted.len().max(1) } else { 1 };
            let (some, rest) = left.split_at(together.clamp(1, left.len()));
            left = rest;
            match some {
                [pixel] => wanted.chunks(LONGEST as usize).for_each(|run| unit.render_pixel(*pixel, run)),
                _ => unit.render_few(some, &wanted),
            }
        }
    }
}

/// A work unit that is being rendered. Samples are pairs of the number of a scrambling, which take turns among the replicates, and
/// an index in it.
struct Unit<'a> {
    shot: Shot<'a>,
    /// Of which each sample sees its own, if there are any.
    moments: &'a [Scene],
    memory: Samples,
    sums: Sums<'a>,
    /// Where samples are dealt out.
    pools: Vec<Pool>,
    /// The numbers of the layers of a sample.
    numbers: Vec<f32>,
}

impl Unit<'_> {
    /// Renders `samples` of `pixel`, at most [`LONGEST`].
    fn render_pixel(&mut self, pixel: [i32; 2], samples: &[(u32, u32)]) {
        let Unit { shot, moments, memory, sums, .. } = self;
        sums.begin(1);
        follow(shot, moments, memory, pixel, samples, |i, sample, values, covered| {
            sums.record((pixel, 0), samples[i].0, sample, values, covered);
        });
        sums.end(&[pixel]);
    }

    /// Renders `samples` of each of `pixels`, in all no more than go side by side.
    fn render_few(&mut self, pixels: &[[i32; 2]], samples: &[(u32, u32)]) {
        let Unit { shot, memory, sums, .. } = self;
        sums.begin(pixels.len());
        let mut addresses = [Address { pixel: [0; 2], replicate: 0, index: 0 }; Octet::SAMPLES];
        let all = pixels.iter().flat_map(|&pixel| samples.iter().map(move |&sample| (pixel, sample)));
        for (to, (pixel, (replicate, index))) in addresses.iter_mut().zip(all) {
            *to = Address { pixel: address(pixel), replicate, index };
        }
        memory.render(shot, &addresses[..pixels.len() * samples.len()], |lane, sample, values, covered| {
            let (place, i) = (lane / samples.len(), lane % samples.len());
            sums.record((pixels[place], place), samples[i].0, sample, values, covered);
        });
        sums.end(pixels);
    }

    /// Renders `samples`, at most [`LONGEST`], of all pixels of a group.
    fn render_group(&mut self, group: &Group, samples: &[(u32, u32)]) {
        let Unit { shot, memory, sums, .. } = self;
        let pixels = group.pixels();
        sums.begin(pixels.len());
        for &(replicate, index) in samples {
            let addresses = &group.samples(replicate, index)[..pixels.len()];
            memory.render(shot, addresses, |lane, sample, values, covered| {
                sums.record((pixels[lane], lane), replicate, sample, values, covered);
            });
        }
        sums.end(pixels);
    }

    /// Renders `samples`, at most [`LONGEST`], of all pixels of a block, and deals them out.
    fn render_block(&mut self, block: &Block, samples: &[(u32, u32)]) {
        let Unit { shot, moments, memory, sums, pools, numbers } = self;
        let pixels: Vec<[i32; 2]> = block.window.iter().collect();
        let channels = sums.tile.layers.layout().channels;
        sums.begin(pixels.len());
        pools.resize_with(Octet::SAMPLES, Pool::default);
        for some in samples.chunks(Octet::SAMPLES) {
            pools.iter_mut().take(some.len()).for_each(|pool| pool.reset(channels));
            let mut give = |i: usize, pixel: [i32; 2], sample: &PixelSample, values: &[f32], alone: bool| {
                if !sums.is_valid(pixel, some[i].0, sample) {
                    return;
                }
                sums.check(pixel, sample.weight, values, numbers);
                let xyz = sample.xyz.map(|x| x * sample.weight);
                if alone {
                    pools[i].add_alone(block, pixel, xyz, numbers);
                } else {
                    let light = (xyz, sample.alpha * sample.weight);
                    pools[i].add(block, shot.filter, (pixel, sample.place), light, numbers);
                }
            };
            if shot.plan.reuse {
                let [x, y] = [block.window.x, block.window.y].map(|x| x.div_euclid(adaptive::SIDE as i32));
                let corner = [x, y].map(|x| x * adaptive::SIDE as i32);
                for group in reuse::groups(corner, shot.scene.camera.resolution) {
                    let lies_inside = |pixel: &[i32; 2]| block.window.index(*pixel).is_some();
                    if !group.pixels().iter().any(lies_inside) {
                        continue;
                    }
                    for (i, &(replicate, index)) in some.iter().enumerate() {
                        let addresses = &group.samples(replicate, index)[..group.pixels().len()];
                        memory.render(shot, addresses, |lane, sample, values, _| {
                            // Some may lie where another block begins.
                            let pixel = group.pixels()[lane];
                            if lies_inside(&pixel) {
                                give(i, pixel, sample, values, false);
                            }
                        });
                        for (lane, Alone { sample, values }) in memory.alone() {
                            let pixel = group.pixels()[lane];
                            if lies_inside(&pixel) {
                                give(i, pixel, sample, values, true);
                            }
                        }
                    }
                }
            } else {
                for &pixel in &pixels {
                    follow(shot, moments, memory, pixel, some, |i, sample, values, _| {
                        give(i, pixel, sample, values, false);
                    });
                    // Of what moves there is none, so that all samples went together.
                    for (i, Alone { sample, values }) in memory.alone() {
                        give(i, pixel, sample, values, true);
                    }
                }
            }
            for (pool, &(replicate, _)) in pools.iter().zip(some) {
                pool.deal(block, |at, dealt, values| sums.take(at, replicate, dealt, values));
            }
        }
        sums.end(&pixels);
    }
}

/// Renders `samples` of `pixel` and gives each by its place among them, as [`Samples::render`] does.
fn follow(
    shot: &Shot,
    moments: &[Scene],
    memory: &mut Samples,
    pixel: [i32; 2],
    samples: &[(u32, u32)],
    mut give: impl FnMut(usize, &PixelSample, &[f32], Option<u64>),
) {
    // Those that are rendered together see one moment.
    let together = if moments.is_empty() { Octet::SAMPLES } else { 1 };
    for (chunk, octet) in samples.chunks(together).enumerate() {
        let (stream, i) = octet[0];
        let scene = scene_at(shot.scene, moments, |count| moment(shot.seed, address(pixel), stream, i, count));
        let mut addresses = [Address { pixel: address(pixel), replicate: 0, index: 0 }; Octet::SAMPLES];
        for (to, &(replicate, index)) in addresses.iter_mut().zip(octet) {
            (to.replicate, to.index) = (replicate, index);
        }
        memory.render(&Shot { scene, ..*shot }, &addresses[..octet.len()], |lane, sample, values, covered| {
            give(chunk * together + lane, sample, values, covered);
        });
    }
}

/// A tile and what is on its way there.
struct Sums<'a> {
    tile: &'a mut TileBuffer,
    /// Whether it counts by how much samples do.
    weighed: bool,
    runs: Runs,
}

/// Sums of pixels by replicate.
#[derive(Default)]
struct Runs {
    light: Vec<[Run; REPLICATES]>,
    layers: Vec<[LayerRun; REPLICATES]>,
}

impl Sums<'_> {
    /// Empties the runs of so many pixels.
    fn begin(&mut self, pixels: usize) {
        let channels = self.tile.layers.layout().channels;
        let Runs { light, layers } = &mut self.runs;
        light.clear();
        light.resize(pixels, [Run::default(); REPLICATES]);
        layers.resize_with(pixels.max(layers.len()), Default::default);
        layers[..pixels].iter_mut().flatten().for_each(|run| run.reset(channels));
    }

    /// Adds the runs to their pixels.
    fn end(&mut self, pixels: &[[i32; 2]]) {
        let Layout { channels, kept } = self.tile.layers.layout();
        for (place, &pixel) in pixels.iter().enumerate() {
            let Some(index) = self.tile.window().index(pixel) else { continue };
            for (replicate, run) in self.runs.light[place].iter().enumerate() {
                self.tile.add_run(pixel, replicate, run);
            }
            if channels > 0 {
                for (replicate, run) in self.runs.layers[place].iter().enumerate().take(kept.sets()) {
                    self.tile.layers.add_run(index, replicate, run);
                }
            }
        }
    }

    /// Adds a sample with scrambling `stream` to the runs of `place`, which are those of `pixel`; nothing of one that lies beyond the
    /// tile.
    #[inline]
    fn record(
        &mut self,
        (pixel, place): ([i32; 2], usize),
        stream: u32,
        sample: &PixelSample,
        values: &[f32],
        covered: Option<u64>,
    ) {
        let Some(index) = self.tile.window().index(pixel) else { return };
        if let Some(number) = covered {
            let pixels = self.tile.window().pixels();
            self.tile.layers.mattes.add(index, pixels, number, 1);
        }
        let replicate = stream as usize % REPLICATES;
        self.layer((index, place), replicate, sample.weight, values);
        if self.is_valid(pixel, stream, sample) {
            let xyz = sample.xyz.map(|x| x * sample.weight);
            let alpha = sample.alpha * sample.weight;
            let run = &mut self.runs.light[place][replicate];
            if (run.add(xyz, alpha) || self.tile.add(pixel, replicate, xyz, alpha)) && self.weighed {
                run.weigh(sample.weight);
            }
        }
    }

    /// Adds what samples of one number came to in `pixel`.
    fn take(&mut self, (pixel, place): ([i32; 2], usize), stream: u32, dealt: &Dealt, values: &[f32]) {
        let Some(index) = self.tile.window().index(pixel) else { return };
        let replicate = stream as usize % REPLICATES;
        let Dealt { xyz, alpha, weight } = *dealt;
        let run = &mut self.runs.light[place][replicate];
        if run.add(xyz, alpha) || self.tile.add(pixel, replicate, xyz, alpha) {
            run.weigh(weight);
            self.layer((index, place), replicate, 1.0, values);
        }
    }

    /// Adds the numbers of the layers of a sample, times `weight`.
    #[inline]
    fn layer(&mut self, (index, place): (usize, usize), replicate: usize, weight: f32, values: &[f32]) {
        let Layout { channels, kept } = self.tile.layers.layout();
        if channels > 0 && !self.runs.layers[place][kept.set(replicate)].add(weight, values) {
            self.tile.layers.add(index, replicate, weight, values);
        }
    }

    /// Whether `sample` is light that can be; one of the tile's that is not is counted there.
    #[inline]
    fn is_valid(&mut self, pixel: [i32; 2], stream: u32, sample: &PixelSample) -> bool {
        let Some(cause) = Invalid::of(sample.radiance) else { return true };
        if self.tile.window().index(pixel).is_some() {
            self.tile.drop_sample(pixel, stream as usize % REPLICATES, cause);
        }
        false
    }

    /// Writes `values` of a sample of `pixel`, times `weight`, into `numbers`. What no sum can hold is nothing, and counted where the
    /// pixel is the tile's.
    fn check(&mut self, pixel: [i32; 2], weight: f32, values: &[f32], numbers: &mut Vec<f32>) {
        numbers.clear();
        numbers.extend(values.iter().map(|value| value * weight));
        if let Some(cause) = numbers.iter().find_map(|x| layers::fault(*x)) {
            if self.tile.window().index(pixel).is_some() {
                self.tile.layers.invalid.record(cause);
            }
            numbers.iter_mut().filter(|x| layers::fault(**x).is_some()).for_each(|x| *x = 0.0);
        }
    }
}
