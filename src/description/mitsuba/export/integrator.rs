//! The integrator, and which light Mitsuba's do not know.

use super::super::super::emitter::EmissionDirection;
use super::super::super::light::Light;
use super::super::super::settings::{Coverage, Integrator, Technique};
use super::Export;

impl Export<'_> {
    pub(super) fn integrator(&mut self) {
        // Theirs counts the crossing of a pane as scattering, unless it is the one for media, which alone sees them.
        let media = !self.scene.media.is_empty();
        let counts = matches!(&self.scene.integrator, Integrator::Path(path) if path.count_crossings);
        let plugin = if counts && !media { "path" } else { "volpath" };
        let (plugin, depth, roulette, hidden) = match &self.scene.integrator {
            Integrator::Depth(_) => {
                self.xml.open("integrator", &[("type", "depth")]);
                self.xml.close();
                return;
            }
            Integrator::LightTracer(tracer) if !media => {
                ("ptracer", tracer.max_depth, tracer.roulette_depth, tracer.hide_emitters)
            }
            Integrator::Path(path) => {
                if path.light_samples != 1 || path.scatter_samples != 1 {
                    self.lose("integrator.path", "one shadow ray and one scattered ray at each surface");
                }
                if counts && media {
                    let what =
                        "longer paths where panes, masks and boundaries end a segment, or lamps behind them hidden";
                    self.lose("integrator.path.count_crossings", what);
                }
                (plugin, path.max_depth, path.roulette_depth, path.hide_emitters)
            }
            // Alpha would be 1 where light from infinity is not hidden.
            Integrator::None(_) => {
                self.xml.open("integrator", &[("type", "volpath")]);
                self.xml.value("integer", "max_depth", 0);
                self.xml.value("boolean", "hide_emitters", true);
                self.xml.close();
                return;
            }
            Integrator::Whitted(_) => {
                let what = "a path tracer: Mitsuba has no Whitted ray tracer";
                return self.path_tracer(plugin, "integrator.whitted", what);
            }
            Integrator::LightTracer(_) => {
                let what = "a path tracer: Mitsuba's ptracer sees no media";
                return self.path_tracer(plugin, "integrator.light_tracer", what);
            }
        };
        self.xml.open("integrator", &[("type", plugin)]);
        if let Some(depth) = depth {
            self.xml.value("integer", "max_depth", depth);
        }
        self.xml.value("integer", "rr_depth", roulette);
        if hidden {
            self.xml.value("boolean", "hide_emitters", true);
        }
        self.xml.close();
        match &self.scene.integrator {
            Integrator::Path(path) => {
                let coverage = match path.coverage {
                    Coverage::Surfaces => "surfaces",
                    Coverage::Scattering => "scattering",
                    Coverage::FirstHit => "first_hit",
                };
                let fields = [
                    ("opaque_sky", "false".to_owned(), !path.opaque_sky),
                    ("coverage", coverage.to_owned(), path.coverage != Coverage::Scattering),
                    ("delta_caustics", "true".to_owned(), path.delta_caustics),
                    ("count_crossings", "true".to_owned(), counts && media),
                    ("light_samples", path.light_samples.to_string(), path.light_samples != 1),
                    ("scatter_samples", path.scatter_samples.to_string(), path.scatter_samples != 1),
                ];
                for (key, value, _) in fields.iter().filter(|(.., differs)| *differs) {
                    self.xml.instruction(&format!("set integrator.path.{key}: {value}"));
                }
            }
            Integrator::LightTracer(tracer) if !tracer.count_crossings => {
                self.xml.instruction("set integrator.light_tracer.count_crossings: false");
            }
            _ => {}
        }
    }

    /// A path tracer for what Mitsuba does not have.
    fn path_tracer(&mut self, plugin: &str, field: &str, what: &str) {
        self.lose(field, what);
        let yaml = self.root.get("integrator").map(|node| self.yaml(node)).unwrap_or_default();
        self.xml.instruction(&format!("instead integrator: {yaml}"));
        self.xml.open("integrator", &[("type", plugin)]);
        self.xml.close();
        self.end();
    }

    /// Says which light Mitsuba's integrators do not know.
    pub(super) fn missing_light(&mut self) {
        let scene = self.scene;
        let meets_parallel = match &scene.integrator {
            // With media it is a path tracer, too.
            Integrator::LightTracer(_) => scene.media.is_empty(),
            Integrator::Path(_) | Integrator::Whitted(_) => false,
            Integrator::Depth(_) | Integrator::None(_) => true,
        };
        for (i, shape) in scene.shapes.iter().enumerate().filter(|_| !meets_parallel) {
            if shape.emission.is_some() && shape.emission_direction == Some(EmissionDirection::Normal) {
                let field = format!("shapes[{i}].{}.emission_direction", shape.geometry.kind());
                self.lose(&field, "no light: along normals Mitsuba's ptracer alone finds it");
            }
        }
        let shapes = || self.scene.shapes.iter().chain(self.scene.groups.values().flatten());
        let path = match &self.scene.integrator {
            Integrator::Path(path) => path,
            Integrator::LightTracer(tracer) => {
                let open = shapes().any(|shape| self.is_open(&shape.material));
                if open && tracer.max_depth.is_some() && !tracer.count_crossings {
                    let what = "shorter paths where panes, masks and boundaries end a segment";
                    self.lose("integrator.light_tracer.count_crossings", what);
                }
                return;
            }
            _ => return,
        };
        let delta = |light: &Light| match light {
            Light::Directional(l) => l.angle_deg == 0.0,
            _ => !light.is_around(),
        };
        if !path.opaque_sky && !path.hide_emitters && self.scene.lights.iter().any(Light::is_around) {
            self.lose("integrator.path.opaque_sky", "an alpha of 1 where light from infinity is seen");
        }
        if path.coverage == Coverage::Surfaces && shapes().any(|shape| self.is_pane(&shape.material)) {
            self.lose("integrator.path.coverage", "the alpha of what is behind them where light goes through panes");
        }
        let traced = path.delta_caustics && self.scene.render.techniques.light_tracing != Technique::Off;
        let throws = shapes().any(|shape| self.is_single(&shape.material));
        if traced && throws && self.scene.lights.iter().any(delta) {
            self.lose(
                "integrator.path.delta_caustics",
                "no light that mirrors, glass and smooth coats throw of lights without extent",
            );
        }
    }
}
