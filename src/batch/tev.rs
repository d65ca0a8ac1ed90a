//! The picture as it grows, in the tev viewer on this machine or another: `--tev HOST:PORT`.
//!
//! A thread of its own sends what it is given; a render that is ahead of the viewer leaves pictures out. Only the last state of
//! a picture waits for the one before it, as long as that may be on its way. A viewer that is not there, goes away, or has not
//! taken a picture by then is told of once, and the render goes on without it.
//!
//! Source: the inter-process protocol of tev (Müller): packets of little-endian numbers, each its own length in 32 bits, a
//! byte of type, and a body; text ends in a zero. Type 4 makes an image (whether to show it, name, width, height, number and
//! names of channels), type 3 sets a rectangle of one channel (whether to show it, name, channel, x, y, width, height, floats).

use super::frame::lock;
use crate::film::resolve::Image;
use std::io::{ErrorKind, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long a picture may be on its way to a viewer; half of it, how long the viewer may take to answer at all.
const PATIENCE: Duration = Duration::from_secs(4);
/// Side of a tile, pixels.
const TILE: usize = 128;
/// Least time between two states of one picture.
pub const EVERY: Duration = Duration::from_millis(500);

/// A picture to show.
struct Picture {
    name: String,
    image: Image,
    /// When it must be there.
    until: Instant,
}

/// The way to a viewer.
#[derive(Debug)]
pub struct Viewer {
    /// To the thread; taken when all has been sent.
    queue: Mutex<Option<SyncSender<Picture>>>,
    thread: Mutex<Option<JoinHandle<()>>>,
    state: Arc<State>,
}

#[derive(Debug)]
struct State {
    /// `HOST:PORT`.
    place: String,
    /// When the picture that is on its way must be there, if one is.
    on_its_way: Mutex<Option<Instant>>,
    /// Why nothing is sent any more.
    gone: Mutex<Option<String>>,
}

impl State {
    /// From now on the viewer counts as gone.
    fn leave(&self, why: &std::io::Error) {
        let told = || format!("tev at {}: {}; rendered without it", self.place, words(why));
        lock(&self.gone).get_or_insert_with(told);
    }

    fn is_gone(&self) -> bool {
        lock(&self.gone).is_some()
    }

    fn is_busy(&self) -> bool {
        lock(&self.on_its_way).is_some()
    }
}

impl Viewer {
    /// Begins to look for the viewer at `place`, `HOST:PORT`; does not wait for it.
    #[must_use]
    pub fn new(place: &str) -> Viewer {
        let (queue, pictures) = sync_channel(1);
        let state = State { place: place.to_owned(), on_its_way: Mutex::default(), gone: Mutex::default() };
        let state = Arc::new(state);
        let away = Arc::clone(&state);
        let thread = std::thread::Builder::new().spawn(move || {
            if let Err(e) = serve(&pictures, &away) {
                away.leave(&e);
            }
            *lock(&away.on_its_way) = None;
        });
        let thread = thread.map_err(|e| state.leave(&e)).ok();
        Viewer { queue: Mutex::new(Some(queue)), thread: Mutex::new(thread), state }
    }

    /// Whether it would take a picture now: none is on its way, and it has not gone.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        !self.state.is_busy() && !self.state.is_gone()
    }

    /// Shows `image` under `name`, if nothing else is on its way.
    pub fn show(&self, name: &str, image: Image) {
        let Some(queue) = lock(&self.queue).clone().filter(|_| !self.state.is_gone()) else { return };
        let until = Instant::now() + PATIENCE;
        *lock(&self.state.on_its_way) = Some(until);
        if let Err(TrySendError::Disconnected(_)) = queue.try_send(Picture { name: name.to_owned(), image, until }) {
            *lock(&self.state.on_its_way) = None;
        }
    }

    /// Shows the last state of a picture: waits, but no longer than the viewer's patience, for the one before it.
    pub fn show_last(&self, name: &str, image: Image) {
        self.wait();
        self.show(name, image);
    }

    /// Ends the connection when all has been sent, and says what went wrong, once.
    #[must_use]
    pub fn close(&self) -> Option<String> {
        self.wait();
        drop(lock(&self.queue).take());
        if let Some(thread) = lock(&self.thread).take()
            && !self.state.is_busy()
        {
            // It has nothing left to do but to end.
            let _ = thread.join();
        }
        lock(&self.state.gone).take()
    }

    /// Waits until the picture that is on its way is there, or until it must have been: then the viewer counts as gone.
    fn wait(&self) {
        loop {
            let on_its_way = *lock(&self.state.on_its_way);
            match on_its_way {
                None => return,
                Some(until) if Instant::now() >= until => return self.state.leave(&late()),
                Some(_) => std::thread::sleep(Duration::from_millis(2)),
            }
        }
    }
}

/// What an I/O error means for a viewer.
fn words(e: &std::io::Error) -> String {
    match e.kind() {
        // So the system says that the time for writing is over.
        ErrorKind::WouldBlock => format!("it did not take a picture within {PATIENCE:?}"),
        _ => e.to_string(),
    }
}

/// That the time of a picture is over.
fn late() -> std::io::Error {
    ErrorKind::WouldBlock.into()
}

/// Connects, and sends pictures until there are no more.
fn serve(pictures: &Receiver<Picture>, state: &State) -> std::io::Result<()> {
    let addresses = state.place.to_socket_addrs()?;
    let mut stream = Err(std::io::Error::other("no such address"));
    for address in addresses {
        stream = TcpStream::connect_timeout(&address, PATIENCE / 2);
        if stream.is_ok() {
            break;
        }
    }
    let mut stream = stream?;
    let mut known: Vec<String> = Vec::new();
    for Picture { name, image, until } in pictures {
        if !known.contains(&name) {
            send(&mut stream, &create(&name, [image.window.width, image.window.height]), until)?;
            known.push(name.clone());
        }
        tiles(&name, &image).try_for_each(|packet| send(&mut stream, &packet, until))?;
        *lock(&state.on_its_way) = None;
    }
    Ok(())
}

/// Sends a packet `until` its time is over: one that is taken a little now and then would never be late for each little.
fn send(stream: &mut TcpStream, mut packet: &[u8], until: Instant) -> std::io::Result<()> {
    while !packet.is_empty() {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(late());
        }
        stream.set_write_timeout(Some(left))?;
        match stream.write(packet) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(taken) => packet = &packet[taken..],
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

const CHANNELS: [&str; 4] = ["R", "G", "B", "A"];

/// A packet: its length before it.
fn packet(kind: u8, body: &[u8]) -> Vec<u8> {
    let mut bytes = (body.len() as u32 + 5).to_le_bytes().to_vec();
    bytes.push(kind);
    bytes.extend(body);
    bytes
}

fn text(text: &str) -> Vec<u8> {
    // A name cannot hold the zero that ends it.
    text.bytes().filter(|b| *b != 0).chain([0]).collect()
}

fn create(name: &str, size: [u32; 2]) -> Vec<u8> {
    let mut body = vec![1];
    body.extend(text(name));
    for number in [size[0], size[1], CHANNELS.len() as u32] {
        body.extend(number.to_le_bytes());
    }
    CHANNELS.iter().for_each(|channel| body.extend(text(channel)));
    packet(4, &body)
}

fn tiles<'a>(name: &'a str, image: &'a Image) -> impl Iterator<Item = Vec<u8>> + 'a {
    let (width, height) = (image.window.width as usize, image.window.height as usize);
    let starts = move || (0..height).step_by(TILE).flat_map(move |y| (0..width).step_by(TILE).map(move |x| [x, y]));
    starts().flat_map(move |[x, y]| {
        let size = [TILE.min(width - x), TILE.min(height - y)];
        let planes = image.rgb.iter().chain([&image.alpha]);
        CHANNELS.into_iter().zip(planes).map(move |(channel, plane)| {
            let mut body = vec![0];
            body.extend(text(name));
            body.extend(text(channel));
            for number in [x, y, size[0], size[1]] {
                body.extend((number as u32).to_le_bytes());
            }
            for row in y..y + size[1] {
                let start = row * width + x;
                body.extend(plane[start..start + size[0]].iter().flat_map(|v| v.to_le_bytes()));
            }
            packet(3, &body)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;
    use std::collections::BTreeMap;
    use std::io::Read;
    use std::net::TcpListener;

    fn picture(width: u32, height: u32) -> Image {
        let n = (width * height) as usize;
        let plane = |start: f32| (0..n).map(|i| start + i as f32).collect::<Vec<f32>>();
        Image {
            frame: [width, height],
            window: Window::full(width, height),
            rgb: [plane(0.0), plane(0.25), plane(0.5)],
            alpha: plane(0.75),
            standard_error: [plane(0.0), plane(0.0), plane(0.0)],
        }
    }

    /// A viewer without a screen: images by name, of channels by name, as the protocol sets them.
    fn receive(bytes: &[u8]) -> BTreeMap<String, (usize, BTreeMap<String, Vec<f32>>)> {
        let mut images: BTreeMap<String, (usize, BTreeMap<String, Vec<f32>>)> = BTreeMap::new();
        let mut rest = bytes;
        while !rest.is_empty() {
            let length = u32::from_le_bytes(rest[..4].try_into().unwrap()) as usize;
            let (kind, mut body) = (rest[4], &rest[5..length]);
            rest = &rest[length..];
            body = &body[1..];
            let mut name = || {
                let end = body.iter().position(|b| *b == 0).unwrap();
                let text = String::from_utf8(body[..end].to_vec()).unwrap();
                body = &body[end + 1..];
                text
            };
            let image = name();
            let channel = if kind == 3 { name() } else { String::new() };
            let number = |i: usize| u32::from_le_bytes(body[4 * i..4 * i + 4].try_into().unwrap()) as usize;
            match kind {
                4 => {
                    let (width, height, count) = (number(0), number(1), number(2));
                    assert_eq!(&body[12..], b"R\0G\0B\0A\0");
                    assert_eq!(count, 4);
                    let planes = CHANNELS.map(|c| (c.to_owned(), vec![f32::NAN; width * height]));
                    assert!(images.insert(image, (width, planes.into())).is_none(), "made once");
                }
                3 => {
                    let (x, y, w, h) = (number(0), number(1), number(2), number(3));
                    let (width, planes) = images.get_mut(&image).unwrap();
                    let plane = planes.get_mut(&channel).unwrap();
                    let values: Vec<f32> =
                        body[16..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
                    assert_eq!(values.len(), w * h);
                    for (row, line) in values.chunks_exact(w).enumerate() {
                        let start = (y + row) * *width + x;
                        plane[start..start + w].copy_from_slice(line);
                    }
                }
                other => panic!("type {other}"),
            }
        }
        images
    }

    #[test]
    fn a_viewer_sees_every_number() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let place = listener.local_addr().unwrap().to_string();
        let server = std::thread::spawn(move || {
            let mut bytes = Vec::new();
            listener.accept().unwrap().0.read_to_end(&mut bytes).unwrap();
            bytes
        });
        let viewer = Viewer::new(&place);
        viewer.show_last("first", picture(300, 140));
        viewer.show_last("second", picture(5, 3));
        viewer.show_last("second", picture(5, 3));
        assert_eq!(viewer.close(), None);
        let images = receive(&server.join().unwrap());
        for (name, image) in [("first", picture(300, 140)), ("second", picture(5, 3))] {
            let (width, planes) = &images[name];
            assert_eq!(*width, image.window.width as usize);
            for (channel, plane) in ["R", "G", "B"].into_iter().zip(&image.rgb).chain([("A", &image.alpha)]) {
                assert_eq!(&planes[channel], plane, "{name} {channel}");
            }
        }
    }

    /// A port that nobody listens at: said once, in words, and nothing waits.
    #[test]
    fn a_viewer_that_is_away_is_told_once() {
        let place = {
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            listener.local_addr().unwrap().to_string()
        };
        let viewer = Viewer::new(&place);
        viewer.show_last("a", picture(5, 3));
        let said = viewer.close().unwrap();
        assert!(said.starts_with(&format!("tev at {place}: ")) && said.ends_with("; rendered without it"), "{said}");
        assert!(!viewer.is_ready() || viewer.close().is_none());
    }

    /// One that takes nothing: the picture that is on its way is given up after the viewer's patience.
    #[test]
    fn a_viewer_that_sleeps_stops_nothing() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let viewer = Viewer::new(&listener.local_addr().unwrap().to_string());
        // 64 MB: more than a connection holds.
        let pictures = [(); 3].map(|()| picture(2000, 2000));
        let start = Instant::now();
        for picture in pictures {
            viewer.show("large", picture);
        }
        assert!(start.elapsed() < PATIENCE, "{:?}", start.elapsed());
        let said = viewer.close().unwrap();
        assert!(said.ends_with(": it did not take a picture within 4s; rendered without it"), "{said}");
        assert!(start.elapsed() < 2 * PATIENCE, "{:?}", start.elapsed());
    }

    /// One that takes a little now and then, 200 kB of 64 MB a second: it held up the end of each picture, and lost it without a word.
    #[test]
    fn a_viewer_that_is_slow_delays_one_picture_and_is_told() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let viewer = Viewer::new(&listener.local_addr().unwrap().to_string());
        std::thread::spawn(move || {
            let (mut stream, mut bytes) = (listener.accept().unwrap().0, [0; 2000]);
            while stream.read(&mut bytes).is_ok_and(|n| n > 0) {
                std::thread::sleep(Duration::from_millis(10));
            }
        });
        let start = Instant::now();
        for name in ["a", "b", "c"] {
            viewer.show_last(name, picture(2000, 2000));
        }
        let said = viewer.close().unwrap();
        assert!(said.ends_with(": it did not take a picture within 4s; rendered without it"), "{said}");
        assert!(start.elapsed() < 2 * PATIENCE, "{:?}", start.elapsed());
    }
}
