//! `organza view` as a process: its address, its picture, its end.
#![cfg(unix)] // it is ended by a signal

use crate::program::{bytes, complaint, folder, signal, succeed};
use organza_testing::assert_contains;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A running page.
struct View {
    process: Child,
    host: String,
    token: String,
}

impl View {
    fn start(folder: &Path, arguments: &[&str]) -> View {
        let mut process = Command::new(env!("CARGO_BIN_EXE_organza"))
            .current_dir(folder)
            .env_remove("ORGANZA_CACHE")
            .arg("view")
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut address = String::new();
        let out = process.stdout.take().unwrap();
        BufReader::new(out).read_line(&mut address).unwrap();
        let rest = address.trim_end().strip_prefix("http://").unwrap();
        let (host, token) = rest.split_once('/').unwrap();
        assert!(host.starts_with("127.0.0.1:"), "{address}");
        View {
            process,
            host: host.to_owned(),
            token: token.trim_end_matches('/').to_owned(),
        }
    }

    /// The body of an answer.
    fn ask(&self, method: &str, path: &str, body: &str) -> Vec<u8> {
        let (host, token, length) = (&self.host, &self.token, body.len());
        let mut stream = TcpStream::connect(host).unwrap();
        let request = format!(
            "{method} /{token}/{path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\
             Content-Type: application/json\r\nContent-Length: {length}\r\n\r\n{body}"
        );
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        assert!(answer.starts_with(b"HTTP/1.1 200 OK"), "{path}");
        let head = answer.windows(4).position(|w| w == b"\r\n\r\n").unwrap();
        answer.split_off(head + 4)
    }

    /// Waits until the picture has all samples.
    fn finished_picture(&self) -> Vec<u8> {
        let began = Instant::now();
        loop {
            let news = self.ask("GET", "news?after=0&known=1", "");
            let news: serde_json::Value = serde_json::from_slice(&news).unwrap();
            match news["news"]["phase"].as_str() {
                Some("done") => return self.ask("GET", "picture.png", ""),
                Some("failed") => panic!("{news}"),
                _ => std::thread::sleep(Duration::from_millis(20)),
            }
            assert!(began.elapsed() < Duration::from_secs(120), "{news}");
        }
    }

    /// Ends it as Ctrl-C does; the exit status.
    fn interrupt(mut self) -> Option<i32> {
        signal(&self.process, "-INT");
        let began = Instant::now();
        loop {
            if let Some(status) = self.process.try_wait().unwrap() {
                return status.code();
            }
            assert!(began.elapsed() < Duration::from_secs(20), "it goes on");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for View {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn the_page_shows_and_saves_what_render_writes() {
    let folder = folder("view");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let fabric = root.join("scenes/fabrics/organza.toml");
    let scene = format!(
        "[render]\nspp = 3\nexposure = 0.5\n[camera]\nkind = 'perspective'\nfov_deg = 20.0\n\
         origin_mm = [0.0, -2.0, 4.0]\ntarget_mm = [0.0, 0.0, 0.0]\nresolution = [40, 32]\n\
         [[light]]\nkind = 'environment'\nradiance = [0.5, 0.6, 0.7]\n\
         [[object]]\nkind = 'cloth'\nmodel = 'auto'\nfabric = '{}'\n",
        fabric.display()
    );
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    let view = View::start(&folder, &["scene.toml"]);
    let shown = view.finished_picture();
    view.ask("POST", "save", "{\"name\":\"saved\"}");
    succeed(&folder, "render scene.toml -o rendered.png");
    succeed(&folder, "render saved.toml -o saved_rendered.exr");
    assert!(
        shown == bytes(&folder, "rendered.png"),
        "the picture of the page"
    );
    assert!(shown == bytes(&folder, "saved.png"), "the saved picture");
    let [a, b] = ["saved.exr", "saved_rendered.exr"]
        .map(|name| crate::program::exr_channels(&folder.join(name)));
    for channel in ["R", "G", "B"] {
        let bits = |list: &[f32]| list.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&a[channel]), bits(&b[channel]), "{channel}");
    }
    assert_eq!(view.interrupt(), Some(0));
}

#[test]
fn wrong_files_and_ports_are_refused_before_anything_is_served() {
    let folder = folder("view-wrong");
    std::fs::write(folder.join("broken.toml"), "[draft]\nweave = 'plan'\n").unwrap();
    let said = complaint(&folder, "view broken.toml");
    assert_contains(&said, "broken.toml: draft.weave");
    std::fs::write(folder.join("broken.wif"), "[WIF]\nVersion=1.1\n").unwrap();
    let message = complaint(&folder, "view broken.wif");
    assert!(message.starts_with("organza: broken.wif: "), "{message}");
    let message = complaint(&folder, "view brocken.toml");
    assert!(message.ends_with("did you mean broken.toml?"), "{message}");
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let draft = "[draft]\nweave = 'plain'\n[warp]\nper_cm = 20.0\n[weft]\nper_cm = 20.0\n";
    std::fs::write(folder.join("plain.toml"), draft).unwrap();
    let message = complaint(&folder, &["view", "plain.toml", "--port", &port]);
    assert_contains(&message, "choose another, or leave it out");
    // It ends while it renders, too.
    let view = View::start(&folder, &["plain.toml", "--set", "tile.repeats=[2,2]"]);
    view.ask("GET", "", "");
    assert_eq!(view.interrupt(), Some(0));
}
