//! Numbers drawn in turn, and pieces of scenes made of them.

use abbe::math::sampler::mix64;

/// Numbers addressed by a seed.
pub struct Dice {
    state: u64,
}

impl Dice {
    pub fn new(seed: u64) -> Dice {
        Dice { state: mix64(seed) }
    }

    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix64(self.state)
    }

    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    pub fn one<'a>(&mut self, of: &[&'a str]) -> &'a str {
        of[self.below(of.len())]
    }

    /// Positive: mostly near 1, sometimes anywhere in 24 decades.
    pub fn size(&mut self) -> String {
        let decades = if self.below(4) == 0 { 24.0 } else { 2.0 };
        format!("{:e}", 10f64.powf((self.unit() - 0.5) * decades))
    }

    /// Any sign, sometimes zero.
    pub fn number(&mut self) -> String {
        match self.below(8) {
            0 => "0".into(),
            1 => "-0.0".into(),
            2..=4 => format!("-{}", self.size()),
            _ => self.size(),
        }
    }

    pub fn vector(&mut self) -> String {
        format!("[{}, {}, {}]", self.number(), self.number(), self.number())
    }

    /// 0 to 1.
    pub fn share(&mut self) -> String {
        match self.below(6) {
            0 => "0".into(),
            1 => "1".into(),
            2 => format!("{{rgb: [{}, {}, {}]}}", self.unit(), self.unit(), self.unit()),
            _ => format!("{}", self.unit()),
        }
    }

    pub fn number_share(&mut self) -> String {
        match self.below(5) {
            0 => "0".into(),
            1 => "1".into(),
            2 => "{texture: map}".into(),
            _ => format!("{}", self.unit()),
        }
    }

    pub fn light(&mut self) -> String {
        match self.below(5) {
            0 => format!("{{blackbody: {{kelvin: {}}}}}", 500.0 + 20_000.0 * self.unit()),
            1 => "{illuminant: D65}".into(),
            2 => format!("{{lines: [{{nm: {}, power: {}}}]}}", 400.0 + 300.0 * self.unit(), self.size()),
            _ => self.size(),
        }
    }

    pub fn index(&mut self) -> String {
        match self.below(5) {
            0 => "{glass: N-SF11}".into(),
            1 => format!("{{abbe: {{nd: {}, vd: {}}}}}", 1.3 + self.unit(), 20.0 + 60.0 * self.unit()),
            2 => format!("{}", 1.0 + 1e-6 * self.unit()),
            3 => format!("{{cauchy: [{}, {}]}}", 1.3 + self.unit(), 0.01 * self.unit()),
            _ => format!("{}", 0.4 + 3.0 * self.unit()),
        }
    }

    pub fn roughness(&mut self) -> String {
        match self.below(4) {
            0 => "0".into(),
            1 => self.size(),
            2 => format!("{{u: {}, v: {}}}", self.unit(), self.unit()),
            _ => format!("{}", self.unit()),
        }
    }

    fn film(&mut self) -> String {
        match self.below(4) {
            0 => format!(", film: {{ior: {}, thickness_nm: {}}}", 1.0 + 2.0 * self.unit(), self.size()),
            _ => String::new(),
        }
    }

    pub fn material(&mut self, depth: u32) -> String {
        let distribution = self.one(&["ggx", "beckmann"]);
        match self.below(if depth == 0 { 18 } else { 11 }) {
            0 => format!("{{diffuse: {{reflectance: {}}}}}", self.share()),
            1 => "{diffuse: {reflectance: {texture: map}}}".into(),
            2 => format!("{{mirror: {{reflectance: {}}}}}", self.share()),
            3 => format!(
                "{{conductor: {{metal: gold, roughness: {}, distribution: {distribution}{}}}}}",
                self.roughness(),
                self.film()
            ),
            4 => format!(
                "{{dielectric: {{ior: {}, exterior_ior: {}, roughness: {}, distribution: {distribution}{}}}}}",
                self.index(),
                self.one(&["1", "1", "1.33"]),
                self.roughness(),
                self.film()
            ),
            5 => format!("{{dielectric: {{ior: {}, priority: {}}}}}", self.index(), self.below(3)),
            6 => format!("{{thin_dielectric: {{ior: {}}}}}", 1.0 + self.unit()),
            7 => format!("{{plastic: {{reflectance: {}, roughness: {}}}}}", self.share(), 0.05 + self.unit()),
            8 => format!(
                "{{principled: {{base_color: {}, roughness: {}, anisotropic: {}, metallic: {}, sheen: {}, clearcoat: {}, \
                 spec_trans: {}}}}}",
                self.share(),
                self.number_share(),
                self.number_share(),
                self.number_share(),
                self.number_share(),
                self.number_share(),
                self.one(&["0", "0", "0.5", "1"])
            ),
            9 => format!(
                "{{principled_thin: {{base_color: {}, roughness: {}, spec_trans: {}, diff_trans: {}}}}}",
                self.share(),
                self.number_share(),
                self.number_share(),
                2.0 * self.unit()
            ),
            10 => format!(
                "{{hair: {{eumelanin: {}, roughness_along: {}, roughness_around: {}, tilt_deg: {}}}}}",
                self.size(),
                0.01 + 0.99 * self.unit(),
                0.01 + 0.99 * self.unit(),
                4.0 * self.unit()
            ),
            11 => format!("{{mask: {{opacity: {}, material: {}}}}}", self.number_share(), self.material(1)),
            12 => format!(
                "{{blend: {{weight: {}, first: {}, second: {}}}}}",
                self.number_share(),
                self.material(1),
                self.material(1)
            ),
            13 => format!("{{two_sided: {{front: {}, back: {}}}}}", self.material(1), self.material(1)),
            14 => format!(
                "{{bump: {{height: {{texture: map}}, scale: {}, material: {}}}}}",
                self.number(),
                self.material(1)
            ),
            15 => format!("{{normal_map: {{normals: {{texture: map}}, material: {}}}}}", self.material(1)),
            _ => "{boundary: {}}".into(),
        }
    }

    /// Fields of a form.
    fn form(&mut self) -> String {
        match self.below(12) {
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
            6 => format!("cone: {{base: {}, apex: {}, radius: {}", self.vector(), self.vector(), self.size()),
            7 | 8 => format!("mesh: {{file: solid.obj, normals: {}", self.one(&["face", "smooth", "file"])),
            9 => format!("sdf_grid: {{file: ball.vol, normals: {}", self.one(&["smooth", "analytic"])),
            _ => format!("curves: {{file: hair.txt, basis: {}", self.one(&["linear", "bspline"])),
        }
    }

    fn transform(&mut self) -> String {
        format!(
            ", transform: [{{rotate: {{axis: {}, deg: {}}}}}, {{scale: {}}}, {{translate: {}}}]",
            self.vector(),
            self.number(),
            self.size(),
            self.vector()
        )
    }

    pub fn shape(&mut self) -> String {
        if self.below(12) == 0 {
            return format!("- instance: {{group: pair{}}}\n", self.transform());
        }
        let form = self.form();
        let dark = form.starts_with("sdf") || form.starts_with("curves");
        let mut text = format!("{form}, material: {}", self.material(0));
        if self.below(4) == 0 && !dark {
            text += &format!(", emission: {}", self.light());
            text += self.one(&["", "", ", emission_direction: normal"]);
        }
        if self.below(3) == 0 {
            text += self.one(&[", inside: smoke", ", inside: cloud"]);
        }
        if self.below(3) == 0 {
            text += &self.transform();
        }
        format!("- {text}}}\n")
    }

    pub fn lamp(&mut self) -> String {
        match self.below(6) {
            0 => format!("- point: {{position: {}, intensity: {}}}\n", self.vector(), self.light()),
            1 => format!(
                "- spot: {{position: {}, direction: {}, cutoff_deg: {}, intensity: {}{}}}\n",
                self.vector(),
                self.vector(),
                1.0 + 89.0 * self.unit(),
                self.light(),
                self.one(&["", ", texture: map"])
            ),
            2 => format!(
                "- directional: {{direction: {}, irradiance: {}{}}}\n",
                self.vector(),
                self.light(),
                self.one(&["", ", angle_deg: 0.5", ", angle_deg: 1.0e-12", ", angle_deg: 179"])
            ),
            3 => format!(
                "- projector: {{origin: {}, target: {}, fov_deg: {}, scale: {}, irradiance: {{texture: map}}}}\n",
                self.vector(),
                self.vector(),
                1.0 + 150.0 * self.unit(),
                self.size()
            ),
            4 => format!("- constant: {{radiance: {}}}\n", self.light()),
            _ => {
                let sun = match self.below(3) {
                    0 => format!("{{direction: {}}}", self.vector()),
                    1 => format!("{{elevation_deg: {}, azimuth_deg: {}}}", 180.0 * self.unit() - 90.0, self.number()),
                    _ => format!(
                        "{{latitude_deg: {}, longitude_deg: 8, hour: {}}}",
                        180.0 * self.unit() - 90.0,
                        self.number()
                    ),
                };
                format!(
                    "- sky: {{sun: {sun}, turbidity: {}, albedo: {}, sky_scale: {}, sun_scale: {}, sun_angle_deg: {}, \
                     limb_darkening: {}}}\n",
                    1.0 + 9.0 * self.unit(),
                    self.share(),
                    self.one(&["0", "1", "1.0e-6", "1.0e+6"]),
                    self.one(&["0", "1", "1.0e-6", "1.0e+6"]),
                    self.one(&["0.5", "0.01", "30", "170"]),
                    self.one(&["true", "false"])
                )
            }
        }
    }

    pub fn scene(&mut self) -> String {
        let mut text = format!(
            "camera: {{origin: {}, target: {}, fov_deg: {}{}}}\nimage: {{width: 16, height: 16}}\n\
             render: {{samples: 4, effects: {}}}\n",
            self.vector(),
            self.vector(),
            1.0 + 150.0 * self.unit(),
            self.one(&["", "", ", lens: {radius: 0.1, focus_distance: 3}"]),
            self.one(&["auto", "all"])
        );
        text += self.one(&[
            "",
            "",
            "",
            "integrator: {whitted: {ambient: 0.1, transparent_shadows: true}}\n",
            "integrator: {path: {max_depth: 4}}\n",
            "integrator: light_tracer\n",
        ]);
        text += "textures: {map: {image: {file: map.png}}}\n";
        let phase = self.one(&["isotropic", "rayleigh", "{hg: 0.9}", "{hg: -0.999}", "{table: [1, 2, 4]}"]);
        text += &format!(
            "volumes: {{haze: {{grid: {{file: haze.vol}}}}, even: {{constant: {{value: {}}}}}}}\n",
            self.size()
        );
        text += &format!(
            "media:\n  smoke: {{homogeneous: {{absorption: {}, scattering: {}, phase: {phase}}}}}\n  \
             cloud: {{heterogeneous: {{extinction: {{volume: {}}}, albedo: {}, scale: {}}}}}\n",
            self.size(),
            self.one(&["0", "1", "{rgb: [0.1, 1, 2]}", "1.0e+6", "1.0e-9"]),
            self.one(&["haze", "even"]),
            self.unit(),
            self.one(&["1", "1.0e-6", "30"])
        );
        text += self.one(&["", "", "medium: smoke\n", "fog: {colour: 0.5, density: 1}\n"]);
        text += "groups:\n  pair: [{sphere: {radius: 0.5}}, {mesh: {file: solid.obj}}]\n";
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
