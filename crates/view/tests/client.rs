//! A session that is served from a folder of its own, and clients of it.

use organza_view::{
    Answering, Guard, Limits, Patience, SavedFile, Session, Waits, listen, open, render, serve,
};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A cloth of few voxels.
pub const FABRIC: &str = "# A cloth of few voxels.\n[draft]\nweave = \"plain\" # over and under\n\n\
    [warp]\nyarn = \"cotton\"\nper_cm = 20.0\n\n[weft]\nyarn = \"cotton\"\nper_cm = 20.0\n\n\
    [yarn.cotton]\ntex = 20.0\nhairs = { per_mm = 0.0 }\nloops = { per_mm = 0.0 }\n\n\
    [voxel]\nsize_um = 60.0\n";

/// A scene of it.
pub const SCENE: &str = "# A small scene.\n[render]\nspp = 6\nseed = 3\n\n[camera]\n\
    origin_mm = [0.3, -1.0, 4.0]\ntarget_mm = [0.0, 0.0, 0.0]\nwidth_mm = 2.0\n\
    resolution = [40, 30]\n\n[[light]]\nkind = \"directional\"\ndirection = [-0.5, -0.3, -0.8]\n\
    irradiance = [2.0, 1.9, 1.7] # a lamp\n\n[[light]]\nkind = \"environment\"\n\
    radiance = [0.3, 0.3, 0.3]\n\n[[object]]\nkind = \"cloth\"\nfabric = \"fabric.toml\"\n\
    model = \"microflake\"\nlod = 0\n";

/// A draft of two ends and two picks.
pub const DRAFT: &str = "[WIF]\nVersion=1.1\n[WARP]\nThreads=2\n[WEFT]\nThreads=2\n\
    [THREADING]\n1=1\n2=2\n[LIFTPLAN]\n1=1\n2=2\n";

/// Times that a test can wait for.
pub const SHORT: Duration = Duration::from_millis(400);

/// A running server.
pub struct Served {
    /// Its session.
    pub session: Arc<Session>,
    /// The folder, which lies in another one.
    pub folder: PathBuf,
    port: u16,
    threads: Vec<JoinHandle<()>>,
    _outer: tempfile::TempDir,
}

/// What a server answered.
#[derive(Debug)]
pub struct Answered {
    /// The status, 0 if the connection was closed without one.
    pub status: u16,
    /// Its head.
    pub head: String,
    /// Its body.
    pub body: Vec<u8>,
}

impl Answered {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|e| panic!("{e}: {self:?}"))
    }

    pub fn error(&self) -> String {
        self.json()["error"]
            .as_str()
            .unwrap_or_else(|| panic!("{self:?}"))
            .to_owned()
    }
}

fn write_files(files: Vec<SavedFile<'_>>) -> Result<(), String> {
    for file in files {
        let mut out = std::io::Cursor::new(Vec::new());
        (file.write)(&mut out)?;
        std::fs::write(&file.path, out.into_inner()).map_err(|e| e.to_string())?;
    }
    Ok(())
}

impl Served {
    /// Serves a scene, without a render.
    pub fn new() -> Served {
        Served::of("scene.toml", false)
    }

    /// Serves a file of the folder, with a render or without.
    pub fn of(file: &str, is_rendered: bool) -> Served {
        Served::waiting(file, is_rendered, SHORT)
    }

    /// The same with so long for the head of a request.
    pub fn waiting(file: &str, is_rendered: bool, head: Duration) -> Served {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("inner");
        std::fs::create_dir(&folder).unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
        write("scene.toml", SCENE);
        write("fabric.toml", FABRIC);
        write("plain.wif", DRAFT);
        write("../secret.wif", DRAFT);
        write("../secret.txt", "OUTSIDE");
        let session = Arc::new(Session::new(open(&folder.join(file), &[]).unwrap()));
        let listener = listen(0).unwrap();
        let port = listener.local_addr().unwrap().port();
        let patience = Patience {
            body: SHORT,
            news: SHORT,
            picture: Duration::from_secs(60),
        };
        let waits = Waits {
            head,
            write: SHORT,
            connection: Duration::from_secs(60),
        };
        let guard = Guard::with_token(port, "token");
        let answering = Answering::new(Arc::clone(&session), guard, patience);
        let mut threads = Vec::new();
        let own = Arc::clone(&session);
        threads.push(std::thread::spawn(move || {
            serve(listener, answering, waits, &|| own.is_over()).unwrap();
        }));
        if is_rendered {
            let own = Arc::clone(&session);
            let limits = Limits {
                max_memory_bytes: None,
                threads: Some(2),
                cache: None,
            };
            threads.push(std::thread::spawn(move || {
                render(&own, &limits, &write_files).unwrap();
            }));
        }
        Served {
            session,
            folder,
            port,
            threads,
            _outer: outer,
        }
    }

    pub fn host(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.host()).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(20)))
            .unwrap();
        stream
    }

    /// Sends bytes and reads until the server closes the connection.
    pub fn raw(&self, bytes: &[u8]) -> Answered {
        let mut stream = self.connect();
        let _ = stream.write_all(bytes);
        read_all(&mut stream)
    }

    /// A request with the right host and secret.
    pub fn request(&self, method: &str, path: &str, headers: &str, body: &[u8]) -> Answered {
        let length = body.len();
        let head = format!(
            "{method} /token/{path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\
             Content-Length: {length}\r\n{headers}\r\n",
            self.host()
        );
        self.raw(&[head.as_bytes(), body].concat())
    }

    pub fn get(&self, path: &str) -> Answered {
        self.request("GET", path, "", b"")
    }

    pub fn post(&self, path: &str, body: &Value) -> Answered {
        let headers = "Content-Type: application/json\r\n";
        self.request("POST", path, headers, body.to_string().as_bytes())
    }

    /// Makes changes that must be right.
    pub fn edit(&self, edits: Value) -> u64 {
        let answered = self.post("edit", &serde_json::json!({ "edits": edits }));
        assert_eq!(answered.status, 200, "{answered:?}");
        answered.json()["revision"].as_u64().unwrap()
    }

    /// The message for changes that must be refused.
    pub fn refused(&self, edits: Value) -> String {
        let answered = self.post("edit", &serde_json::json!({ "edits": edits }));
        assert_eq!(answered.status, 422, "{answered:?}");
        answered.error()
    }

    /// Waits until the news is as wanted.
    pub fn news_that(&self, is_wanted: impl Fn(&organza_view::News) -> bool) -> organza_view::News {
        let began = Instant::now();
        loop {
            let news = self.session.news();
            if is_wanted(&news) {
                return news;
            }
            assert!(began.elapsed() < Duration::from_secs(120), "{news:?}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(Path::new(name))
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.session.end();
        for thread in self.threads.drain(..) {
            let ended = thread.join();
            if !std::thread::panicking() {
                ended.unwrap();
            }
        }
    }
}

/// Reads one answer, until the connection is closed.
pub fn read_all(stream: &mut TcpStream) -> Answered {
    let mut bytes = Vec::new();
    // A reset ends an answer as well.
    let _ = stream.read_to_end(&mut bytes);
    let end = bytes.windows(4).position(|w| w == b"\r\n\r\n");
    let (head, body) = match end {
        Some(end) => (&bytes[..end], &bytes[end + 4..]),
        None => (&bytes[..], &[][..]),
    };
    let head = String::from_utf8_lossy(head).into_owned();
    let status = head.split(' ').nth(1).and_then(|s| s.parse().ok());
    Answered {
        status: status.unwrap_or(0),
        head,
        body: body.to_vec(),
    }
}
