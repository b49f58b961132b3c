//! Renders that are shown on a display server while they go on, with a small server of the
//! test's own.

use crate::cli::write_grid_scene;
use crate::program::{bytes, ended, folder, organza, picture, succeed};
use organza_testing::assert_contains;
use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::time::{Duration, Instant};

/// Renders `scene.toml` with a display server and returns the picture and the messages.
fn shown(folder: &Path, name: &str, address: &str, more: &str) -> (Vec<u8>, String) {
    let render = format!("render scene.toml -o {name} --display-server {address}");
    let out = organza(folder, &format!("{render} {more}"));
    let printed = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.success(), "{printed}");
    (bytes(folder, name), printed)
}

/// The next packet of a connection, without its length.
fn packet(stream: &mut TcpStream) -> Option<Vec<u8>> {
    let mut length = [0; 4];
    stream.read_exact(&mut length).ok()?;
    let mut packet = vec![0; u32::from_le_bytes(length) as usize - 4];
    stream.read_exact(&mut packet).unwrap();
    Some(packet)
}

/// Takes fields from a packet.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (field, rest) = self.0.split_first_chunk().unwrap();
        self.0 = rest;
        *field
    }

    fn i32(&mut self) -> i32 {
        i32::from_le_bytes(self.take())
    }

    fn i64(&mut self) -> i64 {
        i64::from_le_bytes(self.take())
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|&b| b == 0).unwrap();
        let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
        self.0 = &self.0[end + 1..];
        text
    }
}

/// A server as tev is: a picture of three channels, and how often its first row was updated.
fn serve(listener: &TcpListener) -> (String, [i32; 2], Vec<f32>, usize) {
    let mut stream = listener.accept().unwrap().0;
    let created = packet(&mut stream).unwrap();
    let mut created = Fields(&created);
    assert_eq!(created.take(), [4, 1], "create and select");
    let name = created.text();
    let size = [created.i32(), created.i32()];
    assert_eq!(created.i32(), 3);
    assert_eq!(
        [created.text(), created.text(), created.text()],
        ["R", "G", "B"]
    );
    assert!(created.0.is_empty());
    let mut pixels = vec![f32::NAN; 3 * (size[0] * size[1]) as usize];
    let mut updates = 0;
    while let Some(updated) = packet(&mut stream) {
        let mut updated = Fields(&updated);
        assert_eq!(updated.take(), [6, 0], "update without selecting");
        assert_eq!(updated.text(), name);
        assert_eq!(updated.i32(), 3);
        assert_eq!(
            [updated.text(), updated.text(), updated.text()],
            ["R", "G", "B"]
        );
        let [left, top, width, height] = [0; 4].map(|_| updated.i32());
        assert!(left == 0 && width == size[0] && height > 0 && top + height <= size[1]);
        let offsets = [0; 3].map(|_| updated.i64() as usize);
        let strides = [0; 3].map(|_| updated.i64() as usize);
        let values: Vec<f32> = updated
            .0
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
            .collect();
        assert_eq!(values.len(), 3 * (width * height) as usize);
        updates += usize::from(top == 0);
        for pixel in 0..(width * height) as usize {
            for channel in 0..3 {
                let place = 3 * ((top * width) as usize + pixel) + channel;
                pixels[place] = values[offsets[channel] + strides[channel] * pixel];
            }
        }
    }
    (name, size, pixels, updates)
}

#[test]
fn a_server_sees_the_picture_grow_and_its_end() {
    let folder = folder("display");
    write_grid_scene(&folder);
    let set = "--set camera.resolution=[40,30] --spp 2000";
    let crop = "--crop 0,2,40,30";
    let flags = format!("{set} {crop}");
    let plain = picture(&folder, &flags);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let server = std::thread::spawn(move || serve(&listener));
    let (picture, printed) = shown(&folder, "shown.exr", &address, &flags);
    assert!(!printed.contains("warning"), "{printed}");
    assert!(picture == plain);
    let (name, size, pixels, updates) = server.join().unwrap();
    assert_eq!((name.as_str(), size), ("shown.exr", [40, 28]));
    assert!(updates >= 2, "{updates}");
    let channels = crate::program::exr_channels(&folder.join("shown.exr"));
    for (channel, name) in ["R", "G", "B"].iter().enumerate() {
        let last: Vec<f32> = pixels.iter().skip(channel).step_by(3).copied().collect();
        assert!(last == channels[*name], "{name}");
    }
}

#[test]
fn a_server_that_is_absent_gone_or_stuck_is_one_warning() {
    let folder = folder("display-absent");
    write_grid_scene(&folder);
    let small = "--set camera.resolution=[40,30] --spp 2000";
    // More bytes than connections hold back, so that a stuck server is noticed.
    let large = "--set camera.resolution=[1200,1000] --spp 1";
    let check = |address: &str, flags: &str, why: &str| {
        let render = "render scene.toml -o plain.png";
        succeed(&folder, &format!("{render} {flags}"));
        let plain = bytes(&folder, "plain.png");
        let (picture, printed) = shown(&folder, "shown.png", address, flags);
        assert!(picture == plain, "{why}");
        let warnings: Vec<&str> = printed.lines().filter(|l| l.contains("warning")).collect();
        assert_eq!(warnings.len(), 1, "{printed}");
        assert!(
            warnings[0].contains(&format!("display server {address}: ")),
            "{printed}"
        );
        printed
    };
    let bound = || {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        (listener, address)
    };
    let (listener, address) = bound();
    drop(listener);
    check(&address, "--spp 16", "absent");
    let (listener, address) = bound();
    let server = std::thread::spawn(move || drop(listener.accept().unwrap()));
    check(&address, small, "gone");
    server.join().unwrap();
    // Takes the connection, and nothing from it.
    let (listener, address) = bound();
    let started = Instant::now();
    let printed = check(&address, large, "stuck");
    assert_contains(&printed, "has not taken the last picture");
    assert!(started.elapsed() < Duration::from_secs(60));
    drop(listener);
    // No server at all for a wrong address, before anything is rendered.
    let wrong = "render scene.toml -o none.exr --display-server here";
    assert_contains(&ended(&organza(&folder, wrong), 2), "expected HOST:PORT");
    assert!(!folder.join("none.exr").exists());
}
