//! Scenes thrown together by chance, with numbers from 10⁻¹² to 10¹²: each is refused in words, or gives a
//! picture of finite numbers, within bounds of time. Nothing panics.

mod common;

use abbe::film::resolve;
use abbe::math::sampler::mix64;
use abbe::spectrum::ColourSpace;
use common::{grey_png, try_bench};
use std::time::{Duration, Instant};

/// How many scenes; more where a machine has the time, by `ABBE_FUZZ`.
const SCENES: u64 = 300;

/// Numbers addressed by a seed and drawn in turn.
struct Dice {
    state: u64,
}

impl Dice {
    fn unit(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix64(self.state) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    fn one<'a>(&mut self, of: &[&'a str]) -> &'a str {
        of[self.below(of.len())]
    }

    /// Positive: mostly near 1, sometimes anywhere in 24 decades.
    fn size(&mut self) -> String {
        let decades = if self.below(4) == 0 { 24.0 } else { 2.0 };
        format!("{:e}", 10f64.powf((self.unit() - 0.5) * decades))
    }

    /// Any sign, sometimes zero.
    fn number(&mut self) -> String {
        match self.below(8) {
            0 => "0".into(),
            1 => "-0.0".into(),
            2..=4 => format!("-{}", self.size()),
            _ => self.size(),
        }
    }

    fn vector(&mut self) -> String {
        format!("[{}, {}, {}]", self.number(), self.number(), self.number())
    }

    fn share(&mut self) -> String {
        match self.below(6) {
            0 => "0".into(),
            1 => "1".into(),
            2 => format!("{{rgb: [{}, {}, {}]}}", self.unit(), self.unit(), self.unit()),
            _ => format!("{}", self.unit()),
        }
    }

    fn light(&mut self) -> String {
        match self.below(5) {
            0 => format!("{{blackbody: {{kelvin: {}}}}}", 500.0 + 20_000.0 * self.unit()),
            1 => "{illuminant: D65}".into(),
            2 => format!("{{lines: [{{nm: {}, power: {}}}]}}", 400.0 + 300.0 * self.unit(), self.size()),
            _ => self.size(),
        }
    }

    fn index(&mut self) -> String {
        match self.below(4) {
            0 => "{glass: N-SF11}".into(),
            1 => format!("{{abbe: {{nd: {}, vd: {}}}}}", 1.3 + self.unit(), 20.0 + 60.0 * self.unit()),
            2 => format!("{}", 1.0 + 1e-6 * self.unit()),
            _ => format!("{}", 0.4 + 3.0 * self.unit()),
        }
    }

    fn roughness(&mut self) -> String {
        match self.below(3) {
            0 => "0".into(),
            1 => self.size(),
            _ => format!("{}", self.unit()),
        }
    }

    fn material(&mut self) -> String {
        let distribution = self.one(&["ggx", "beckmann"]);
        match self.below(8) {
            0 => format!("{{diffuse: {{reflectance: {}}}}}", self.share()),
            1 => "{diffuse: {reflectance: {texture: map}}}".into(),
            2 => format!("{{mirror: {{reflectance: {}}}}}", self.share()),
            3 => {
                format!("{{conductor: {{metal: gold, roughness: {}, distribution: {distribution}}}}}", self.roughness())
            }
            4 => format!(
                "{{dielectric: {{ior: {}, exterior_ior: {}, roughness: {}, distribution: {distribution}}}}}",
                self.index(),
                self.one(&["1", "1", "1.33"]),
                self.roughness()
            ),
            5 => format!("{{thin_dielectric: {{ior: {}}}}}", 1.0 + self.unit()),
            6 => format!("{{plastic: {{reflectance: {}, roughness: {}}}}}", self.share(), 0.05 + self.unit()),
            _ => "{boundary: {}}".into(),
        }
    }

    fn shape(&mut self) -> String {
        let form = match self.below(7) {
            0 => format!("sphere: {{center: {}, radius: {}", self.vector(), self.size()),
            1 => format!("plane: {{point: {}, normal: {}", self.vector(), self.vector()),
            2 => format!("disk: {{center: {}, normal: {}, radius: {}", self.vector(), self.vector(), self.size()),
            3 => {
                format!("rectangle: {{corner: {}, edge_u: {}, edge_v: {}", self.vector(), self.vector(), self.vector())
            }
            4 => {
                format!("cube: {{center: {}, size: [{}, {}, {}]", self.vector(), self.size(), self.size(), self.size())
            }
            5 => format!(
                "cylinder: {{base: {}, top: {}, radius: {}, caps: {}",
                self.vector(),
                self.vector(),
                self.size(),
                self.one(&["both", "none", "base", "top"])
            ),
            _ => format!("cone: {{base: {}, apex: {}, radius: {}", self.vector(), self.vector(), self.size()),
        };
        let mut text = format!("{form}, material: {}", self.material());
        if self.below(4) == 0 {
            text += &format!(", emission: {}", self.light());
        }
        if self.below(3) == 0 {
            text += ", inside: smoke";
        }
        if self.below(4) == 0 {
            text += &format!(
                ", transform: [{{rotate: {{axis: {}, deg: {}}}}}, {{scale: {}}}, {{translate: {}}}]",
                self.vector(),
                self.number(),
                self.size(),
                self.vector()
            );
        }
        format!("- {text}}}\n")
    }

    fn lamp(&mut self) -> String {
        match self.below(4) {
            0 => format!("- point: {{position: {}, intensity: {}}}\n", self.vector(), self.light()),
            1 => format!(
                "- spot: {{position: {}, direction: {}, cutoff_deg: {}, intensity: {}}}\n",
                self.vector(),
                self.vector(),
                1.0 + 89.0 * self.unit(),
                self.light()
            ),
            2 => format!("- directional: {{direction: {}, irradiance: {}}}\n", self.vector(), self.light()),
            _ => format!("- constant: {{radiance: {}}}\n", self.light()),
        }
    }

    fn scene(&mut self) -> String {
        let mut text = format!(
            "camera: {{origin: {}, target: {}, fov_deg: {}}}\nimage: {{width: 4, height: 4}}\n\
             render: {{samples: 4, effects: {}}}\n",
            self.vector(),
            self.vector(),
            1.0 + 150.0 * self.unit(),
            self.one(&["auto", "all"])
        );
        text += self.one(&["", "", "integrator: {whitted: {ambient: 0.1, transparent_shadows: true}}\n"]);
        text += "textures: {map: {image: {file: map.png}}}\n";
        let phase = self.one(&["isotropic", "rayleigh", "{hg: 0.9}", "{hg: -0.999}"]);
        text += &format!(
            "media: {{smoke: {{homogeneous: {{absorption: {}, scattering: {}, phase: {phase}}}}}}}\n",
            self.size(),
            self.one(&["0", "1", "{rgb: [0.1, 1, 2]}", "1.0e+6", "1.0e-9"])
        );
        text += self.one(&["", "", "medium: smoke\n", "fog: {colour: 0.5, density: 1}\n"]);
        text += "shapes:\n";
        for _ in 0..1 + self.below(5) {
            text += &self.shape();
        }
        text += "lights:\n";
        for _ in 0..1 + self.below(2) {
            text += &self.lamp();
        }
        text
    }
}

#[test]
fn random_scenes_are_refused_in_words_or_give_finite_pictures() {
    let count = std::env::var("ABBE_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(SCENES);
    let map = grey_png(4, 4, |x, y| (40 * x + 20 * y) as u8);
    let (mut rendered, mut lit, mut slowest) = (0, 0, Duration::ZERO);
    for seed in 0..count {
        let yaml = Dice { state: seed << 20 }.scene();
        let start = Instant::now();
        let outcome = std::panic::catch_unwind(|| {
            let bench = match try_bench(&yaml, &[("map.png", &map)]) {
                Ok(bench) => bench,
                Err(words) => {
                    assert!(words.lines().all(|l| l.contains("DIR/scene.yaml:")), "a fault without a place: {words}");
                    return None;
                }
            };
            let film = bench.film();
            let image = resolve::resolve(&film, None, &ColourSpace::Rec709.matrix_from_xyz());
            assert!(image.rgb.iter().flatten().chain(&image.alpha).all(|x| x.is_finite()), "{:?}", image.rgb);
            let invalid = film.invalid;
            // Numbers up to 10¹² leave what f32 holds only where light of 10¹² is focussed further.
            assert!(invalid.nan == 0 && invalid.negative == 0, "{invalid:?}");
            Some(image.rgb[1].iter().any(|x| *x > 0.0))
        });
        match outcome {
            Ok(Some(light)) => {
                rendered += 1;
                lit += u64::from(light);
            }
            Ok(None) => {}
            Err(_) => panic!("scene {seed}:\n{yaml}"),
        }
        slowest = slowest.max(start.elapsed());
        assert!(start.elapsed() < Duration::from_secs(30), "scene {seed} took {:?}:\n{yaml}", start.elapsed());
    }
    eprintln!("{rendered} of {count} scenes rendered, {lit} of them not black, the slowest in {slowest:?}");
    assert!(rendered * 2 > count && lit * 4 > rendered, "{rendered} rendered, {lit} lit: the dice are loaded");
}
