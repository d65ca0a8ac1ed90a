//! Values of arguments, from their text.

use super::threads::MOST_THREADS;
use crate::batch::Samples;
use crate::description::{self, PathMap, SAMPLES_LIMIT};
use std::time::Duration;

type Parsed<T> = Result<T, String>;

pub(super) fn host_and_port(text: &str) -> Parsed<String> {
    let named = |(host, port): &(&str, &str)| !host.is_empty() && port.parse::<u16>().is_ok_and(|port| port > 0);
    match text.rsplit_once(':').filter(named) {
        Some(_) => Ok(text.to_owned()),
        None => Err("expected HOST:PORT, as localhost:14158".into()),
    }
}

pub(super) fn threads(text: &str) -> Parsed<usize> {
    match text.parse() {
        Ok(n) if n <= MOST_THREADS => Ok(n),
        Ok(n) => Err(format!("{n} is not in 0..={MOST_THREADS}")),
        Err(_) => Err(format!("expected a whole number from 0 to {MOST_THREADS}")),
    }
}

pub(super) fn spp(text: &str) -> Parsed<u32> {
    match text.parse::<i64>() {
        Ok(n) if (1..=i64::from(SAMPLES_LIMIT)).contains(&n) => Ok(n as u32),
        Ok(n) => Err(format!("{n} is not in 1..={SAMPLES_LIMIT}")),
        Err(_) => Err(format!("expected a whole number from 1 to {SAMPLES_LIMIT}")),
    }
}

pub(super) fn seed(text: &str) -> Parsed<u64> {
    text.parse().map_err(|_| format!("expected a whole number from 0 to {}", u64::MAX))
}

pub(super) fn duration(text: &str) -> Parsed<Duration> {
    description::duration(text).ok_or_else(|| "expected a time, as 90s, 10m or 2h".into())
}

pub(super) fn some_time(text: &str) -> Parsed<Duration> {
    let time = duration(text)?;
    if time.is_zero() { Err("expected a time above 0, as 90s, 10m or 2h".into()) } else { Ok(time) }
}

/// Frames, which are read again where they belong.
pub(super) fn frames(text: &str) -> Parsed<String> {
    description::frames(text).map(|_| text.to_owned())
}

pub(super) fn path_map(text: &str) -> Parsed<String> {
    PathMap::default().add(text).map(|()| text.to_owned())
}

/// A relative error, or per cent.
pub(super) fn relative_error(text: &str) -> Parsed<f64> {
    let share = description::share(text).filter(|x| *x > 0.0 && *x < 1.0);
    share.ok_or_else(|| "expected an error above 0 and below 1, as 0.01 or 1%".into())
}

/// Two whole numbers around a mark.
fn pair(text: &str, mark: char) -> Option<[u32; 2]> {
    let (a, b) = text.split_once(mark)?;
    Some([a.trim().parse().ok()?, b.trim().parse().ok()?])
}

pub(super) fn tile(text: &str) -> Parsed<[u32; 2]> {
    pair(text, '/').ok_or_else(|| "expected i/n, as 2/8: the third of eight tiles".into())
}

pub(super) fn samples(text: &str) -> Parsed<Samples> {
    let one = || text.trim().parse().ok().map(|n| [n, n]);
    let range = || pair(text, '-').or_else(one).map(Samples::Range);
    let expected = "expected a-b, as 0-63: the first 64 samples; or i/n, as 2/8: the third of eight ranges";
    pair(text, '/').map(Samples::Nth).or_else(range).ok_or_else(|| expected.into())
}

/// Of which the red, 1.2 times as much, and the blue are numbers of a picture, which has 32-bit floats.
pub(super) fn radiance(text: &str) -> Parsed<f64> {
    match text.parse::<f64>() {
        Ok(x) if (1e-37..=1e38).contains(&x) => Ok(x),
        _ => Err("expected a number from 1e-37 to 1e38, as 0.8".into()),
    }
}

pub(super) fn share(text: &str) -> Parsed<f64> {
    match text.parse::<f64>() {
        Ok(x) if (0.0..1.0).contains(&x) => Ok(x),
        _ => Err("expected a number from 0 up to 1, as 0.003".into()),
    }
}

pub(super) fn key_value(text: &str) -> Parsed<(String, String)> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => Ok((key.trim().to_owned(), value.to_owned())),
        _ => Err("expected KEY=VALUE, for example camera.fov_deg=25".into()),
    }
}

pub(super) fn name_value(text: &str) -> Parsed<(String, String)> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().to_owned(), value.to_owned())),
        _ => Err("expected NAME=VALUE, for example res=256".into()),
    }
}
