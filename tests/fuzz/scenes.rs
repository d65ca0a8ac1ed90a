//! Scenes thrown together, with numbers from 10⁻¹² to 10¹².

use super::common::{grey_png, try_bench};
use super::dice::Dice;
use super::targets::{CURVES, SOLID, ball};
use abbe::film::resolve;
use abbe::spectrum::ColourSpace;
use std::sync::atomic::{AtomicU64, Ordering};

/// How many scenes.
const SCENES: u64 = 300;

#[test]
fn random_scenes_are_refused_in_words_or_give_finite_pictures() {
    let count = super::count(SCENES);
    let (map, ball, haze) = (grey_png(4, 4, |x, y| (40 * x + 20 * y) as u8), ball(0.0), ball(1.0));
    let files: [(&str, &[u8]); 5] = [
        ("map.png", &map),
        ("solid.obj", SOLID.as_bytes()),
        ("hair.txt", CURVES.as_bytes()),
        ("ball.vol", &ball),
        ("haze.vol", &haze),
    ];
    let scene = |i: u64| Dice::new(super::seed() << 32 | i).scene();
    let (rendered, lit) = (AtomicU64::new(0), AtomicU64::new(0));
    super::each(count, scene, |i| {
        let bench = match try_bench(&scene(i), &files) {
            Ok(bench) => bench,
            Err(words) if words.lines().all(|l| l.contains("DIR/scene.yaml:")) => return Ok(()),
            Err(words) => return Err(format!("a fault without a place: {words}")),
        };
        let film = bench.film();
        let image = resolve::resolve(&film, None, &ColourSpace::Rec709.matrix_from_xyz());
        if !image.rgb.iter().flatten().chain(&image.alpha).all(|x| x.is_finite()) {
            return Err("a pixel is not finite".into());
        }
        // Numbers up to 10¹² leave what f32 holds only where light of 10¹² is focussed further.
        if film.invalid.nan > 0 || film.invalid.negative > 0 {
            return Err(format!("{:?}", film.invalid));
        }
        rendered.fetch_add(1, Ordering::Relaxed);
        lit.fetch_add(u64::from(image.rgb[1].iter().any(|x| *x > 0.0)), Ordering::Relaxed);
        Ok(())
    });
    let (rendered, lit) = (rendered.into_inner(), lit.into_inner());
    eprintln!("{rendered} of {count} scenes rendered, {lit} of them not black");
    assert!(rendered * 4 > count && lit * 4 > rendered, "{rendered} rendered, {lit} lit: the dice are loaded");
}
