//! How a render tells of its progress: bars, lines, JSON, nothing.

use super::ProgressStyle;
use super::render::{per_cent_between, seconds_between};
use super::{complain, say};
use crate::batch::frame::Progress;
use crate::batch::report::{SceneReport, Status};
use crate::batch::words::{per_cent, seconds};
use crate::batch::{Turn, Watcher};
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle as BarStyle};
use serde_json::json;
use std::io::IsTerminal;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Least time between two lines for one scene.
const LINE_EVERY: Duration = Duration::from_secs(5);

enum Style {
    Bars { all: MultiProgress, batch: ProgressBar, scene: ProgressBar },
    Plain,
    Json,
    OpenJd,
    Quiet,
}

/// Tells of progress: people on the standard error, programs (JSON) on the standard output.
pub struct Teller {
    style: Style,
    state: Mutex<State>,
}

struct State {
    scene: String,
    turn: Turn,
    last_line: Instant,
}

impl Teller {
    /// Tells those who read a protocol that has a word for it what fails: one line of `message`.
    pub fn fails(&self, message: &str) {
        if matches!(self.style, Style::OpenJd) {
            say(&format!("openjd_fail: {}\n", message.lines().next().unwrap_or_default()));
        }
    }

    /// Bars on a terminal, lines elsewhere, unless a style is named.
    pub fn new(style: ProgressStyle) -> Teller {
        let terminal = std::io::stderr().is_terminal();
        let style = match style {
            ProgressStyle::Auto if terminal => {
                let all = MultiProgress::with_draw_target(ProgressDrawTarget::stderr_with_hz(10));
                let batch = all.add(ProgressBar::new(0));
                let scene = all.add(ProgressBar::new(0));
                // The templates are constants: that they parse is tested.
                batch.set_style(bar("{prefix:>20} [{bar:40}] {pos}/{len} scenes  {elapsed} elapsed"));
                scene.set_style(bar("{prefix:>20} [{bar:40}] {percent:>3} %  {msg}"));
                batch.set_prefix("batch");
                Style::Bars { all, batch, scene }
            }
            ProgressStyle::Auto | ProgressStyle::Plain => Style::Plain,
            ProgressStyle::Json => Style::Json,
            ProgressStyle::Openjd => Style::OpenJd,
            ProgressStyle::None => Style::Quiet,
        };
        Teller {
            style,
            state: Mutex::new(State { scene: String::new(), turn: Turn::default(), last_line: Instant::now() }),
        }
    }

    /// The state, where it is time for a line: that counts as told.
    fn state_if_due(&self) -> Option<MutexGuard<'_, State>> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let due = state.last_line.elapsed() >= LINE_EVERY;
        if due {
            state.last_line = Instant::now();
        }
        due.then_some(state)
    }

    /// Takes the bars away.
    pub fn finish(&self) {
        if let Style::Bars { all, batch, scene } = &self.style {
            // A bar that is not finished draws itself once more when it is dropped.
            scene.finish_and_clear();
            batch.finish_and_clear();
            let _ = all.clear();
        }
    }
}

fn bar(template: &str) -> BarStyle {
    BarStyle::with_template(template).unwrap_or_else(|_| BarStyle::default_bar()).progress_chars("=> ")
}

/// That a search goes on, of which `share` was done after `elapsed`, and the most seconds that it takes yet.
fn search(share: f64, elapsed: Duration) -> (String, f64) {
    // Its rays take the same time each.
    let left = elapsed.as_secs_f64() * (1.0 - share) / share.max(f64::MIN_POSITIVE);
    (format!("looking for light that mirrors or glass throw, at most about {} more", seconds(left)), left)
}

/// Tells of searches alone, by lines on the standard error.
pub struct Searches {
    scene: String,
    last_line: Mutex<Instant>,
}

impl Searches {
    /// Those for the picture `scene`.
    pub fn of(scene: &str) -> Searches {
        Searches { scene: scene.to_owned(), last_line: Mutex::new(Instant::now()) }
    }
}

impl Watcher for Searches {
    fn scene_begins(&self, _: Turn, _: &str) {}

    fn searches(&self, share: f64, elapsed: Duration) {
        let mut last_line = self.last_line.lock().unwrap_or_else(PoisonError::into_inner);
        if last_line.elapsed() >= LINE_EVERY {
            *last_line = Instant::now();
            complain(&format!("{}: {}", self.scene, search(share, elapsed).0));
        }
    }

    fn progress(&self, _: Progress) {}
    fn scene_ends(&self, _: &SceneReport) {}
}

/// Rate, error so far and time left.
fn words(p: &Progress) -> String {
    let elapsed = p.elapsed.as_secs_f64().max(1e-9);
    let rate = p.done as f64 / elapsed;
    let left = match &p.forecast {
        Some(f) => (f.seconds - elapsed).max(0.0),
        None => (p.total - p.done) as f64 / rate,
    };
    let left = seconds(left);
    let rate = format!("{:.2} Msamples/s", rate * 1e-6);
    match (&p.error, &p.forecast) {
        (Some(e), Some(f)) if p.target.is_some_and(|target| f.error <= target * 1.000_001) => {
            let between = seconds_between(f.seconds_between.map(|end| (end - elapsed).max(0.0)));
            format!("{rate}, error {}, {} in about {left}{between}", per_cent(e.rel_rmse), per_cent(f.error))
        }
        (Some(e), Some(f)) => {
            let between = per_cent_between(f.error_between);
            format!("{rate}, error {}, about {}{between} in {left}", per_cent(e.rel_rmse), per_cent(f.error))
        }
        (Some(e), None) => format!("{rate}, error {}, {left} left", per_cent(e.rel_rmse)),
        // The first of a large frame waited for its memory: what it took says nothing of the others.
        (None, _) if p.done < p.total / 100 => rate,
        (None, _) => format!("{rate}, {left} left"),
    }
}

impl Watcher for Teller {
    fn scene_begins(&self, turn: Turn, name: &str) {
        let Turn { scene: [index, count], frame: [frame, frames] } = turn;
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        name.clone_into(&mut state.scene);
        state.turn = turn;
        state.last_line = Instant::now();
        match &self.style {
            Style::Bars { batch, scene, .. } => {
                batch.set_length(count as u64);
                batch.set_position(index as u64);
                scene.set_prefix(name.to_owned());
                // Nothing of nothing would be all.
                scene.set_length(1);
                scene.set_position(0);
                scene.set_message("loading");
            }
            Style::Plain => {
                let frames = if frames > 1 { format!(" (frame {} of {frames})", frame + 1) } else { String::new() };
                complain(&format!("[{}/{count}] {name}{frames}", index + 1));
            }
            Style::Json => {
                let mut event = json!({"event": "scene", "scene": name, "index": index, "count": count});
                if frames > 1 {
                    event["frame"] = json!({"index": frame, "count": frames});
                }
                line(&event);
            }
            Style::OpenJd => {
                let [nth, all] = if frames > 1 { [frame, frames] } else { [index, count] };
                say(&format!("openjd_status: {name} ({} of {all})\n{}", nth + 1, openjd(turn, 0.0)));
            }
            Style::Quiet => {}
        }
    }

    fn searches(&self, share: f64, elapsed: Duration) {
        let (said, left) = search(share, elapsed);
        match &self.style {
            Style::Bars { scene, .. } => scene.set_message(said),
            Style::Plain | Style::Json | Style::OpenJd => {
                let Some(state) = self.state_if_due() else { return };
                let name = &state.scene;
                match self.style {
                    Style::OpenJd => say(&format!("openjd_status: {name}: {said}\n")),
                    Style::Plain => complain(&format!("Progress: 0.0%  {name}: {said}")),
                    _ => line(&json!({"event": "search", "scene": name, "done": share, "seconds_left": left})),
                }
            }
            Style::Quiet => {}
        }
    }

    fn progress(&self, p: Progress) {
        match &self.style {
            Style::Bars { scene, .. } => {
                scene.set_length(p.total);
                scene.set_position(p.done);
                scene.set_message(words(&p));
            }
            Style::Plain | Style::Json | Style::OpenJd => {
                let Some(state) = self.state_if_due() else { return };
                let share = p.done as f64 / p.total as f64;
                if matches!(self.style, Style::OpenJd) {
                    say(&openjd(state.turn, share));
                } else if matches!(self.style, Style::Plain) {
                    complain(&format!("Progress: {:.1}%  {}: {}", share * 100.0, state.scene, words(&p)));
                } else {
                    let error = p.error.map(|e| e.rel_rmse);
                    line(
                        &json!({"event": "progress", "scene": state.scene, "done": share, "error": error, "forecast": p.forecast}),
                    );
                }
            }
            Style::Quiet => {}
        }
    }

    fn warns(&self, message: &str) {
        let scene = self.state.lock().unwrap_or_else(PoisonError::into_inner).scene.clone();
        let note = format!("note: {scene}: {message}");
        match &self.style {
            // Where the bars are not drawn it says nothing.
            Style::Bars { all, .. } => drop(all.println(note)),
            Style::Json => line(&json!({"event": "note", "scene": scene, "message": message})),
            Style::Plain | Style::OpenJd | Style::Quiet => complain(&note),
        }
    }

    fn scene_ends(&self, report: &SceneReport) {
        match &self.style {
            Style::Bars { batch, .. } => batch.inc(1),
            Style::Plain => match &report.status {
                Status::Done => {
                    let error = report.error.map_or(String::new(), |e| format!(", error {:.2} %", e.rel_rmse * 100.0));
                    complain(&format!("  done in {}{error}", seconds(report.seconds.rendering)));
                }
                Status::Skipped => complain("  there already"),
                Status::Failed { .. } if report.is_stopped() => complain("  stopped"),
                Status::Failed { .. } if report.is_written_with_a_fault() => complain("  written, with a fault"),
                Status::Failed { .. } => complain("  failed"),
            },
            Style::Json => line(&json!({"event": "done", "report": report})),
            Style::OpenJd => {
                let turn = self.state.lock().unwrap_or_else(PoisonError::into_inner).turn;
                match &report.status {
                    Status::Done | Status::Skipped => say(&openjd(turn, 1.0)),
                    Status::Failed { message, .. } => self.fails(&format!("{}: {message}", report.label())),
                }
            }
            Style::Quiet => {}
        }
    }
}

/// What Open Job Description takes for progress: a number from 0 to 100 of the whole task.
fn openjd(turn: Turn, share: f64) -> String {
    let within = |[nth, all]: [usize; 2], share: f64| (nth as f64 + share) / all.max(1) as f64;
    let done = within(turn.scene, within(turn.frame, share));
    format!("openjd_progress: {:.1}\n", (100.0 * done).clamp(0.0, 100.0))
}

fn line(value: &serde_json::Value) {
    say(&format!("{value}\n"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::forecast::Forecast;
    use crate::film::error::ErrorEstimate;

    #[test]
    fn openjd_hears_of_the_whole_batch() {
        let openjd = |scene, frame, share| openjd(Turn { scene, frame }, share);
        assert_eq!(openjd([0, 1], [0, 1], 0.42), "openjd_progress: 42.0\n");
        assert_eq!(openjd([2, 4], [0, 1], 0.5), "openjd_progress: 62.5\n");
        assert_eq!(openjd([1, 2], [3, 5], 0.5), "openjd_progress: 85.0\n");
        assert_eq!(openjd([3, 4], [4, 5], 1.0 + 1e-9), "openjd_progress: 100.0\n");
    }

    #[test]
    fn what_is_left_follows_from_the_rate() {
        let elapsed = Duration::from_secs(10);
        let p = Progress { done: 300_000, total: 1_200_000, elapsed, error: None, forecast: None, target: None };
        assert_eq!(words(&p), "0.03 Msamples/s, 30.0 s left");
        assert_eq!(words(&Progress { done: 3000, ..p }), "0.00 Msamples/s");
        let error = Some(ErrorEstimate { rel_rmse: 0.018, low: 0.017, high: 0.019, pixels: 100, valid: true });
        let forecast = Forecast {
            made_at: 8,
            samples: 40.0,
            seconds: 52.0,
            error: 0.01,
            error_between: [0.009, 0.011],
            seconds_between: [52.0; 2],
        };
        let known = Progress { error, forecast: Some(forecast), ..p };
        assert_eq!(words(&known), "0.03 Msamples/s, error 1.80 %, about 1.00 % (0.90-1.10 %) in 42.0 s");
        let aimed = Progress { target: Some(0.01), ..known };
        assert_eq!(words(&aimed), "0.03 Msamples/s, error 1.80 %, 1.00 % in about 42.0 s");
        let forecast = Forecast { seconds_between: [40.0, 72.0], ..forecast };
        let aimed = Progress { forecast: Some(forecast), ..aimed };
        assert_eq!(words(&aimed), "0.03 Msamples/s, error 1.80 %, 1.00 % in about 42.0 s (30.0 s to 62.0 s)");
        let forecast = Forecast { seconds_between: [10.0, 72.0], ..forecast };
        let aimed = Progress { forecast: Some(forecast), ..aimed };
        assert_eq!(words(&aimed), "0.03 Msamples/s, error 1.80 %, 1.00 % in about 42.0 s (up to 62.0 s)");
    }
}
