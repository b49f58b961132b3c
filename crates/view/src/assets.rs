//! The files of the page. They are in the binary: the page works without a network, and no
//! request opens a file.

/// A file of the page.
pub struct Asset {
    /// Its path below that of the session.
    pub path: &'static str,
    /// Its type.
    pub media_type: &'static str,
    /// Its text.
    pub text: &'static str,
}

macro_rules! script {
    ($name:literal) => {
        Asset {
            path: $name,
            media_type: "text/javascript; charset=utf-8",
            text: include_str!(concat!("../assets/", $name)),
        }
    };
}

/// All of them; the first is the page itself.
pub const ASSETS: &[Asset] = &[
    Asset {
        path: "",
        media_type: "text/html; charset=utf-8",
        text: include_str!("../assets/index.html"),
    },
    Asset {
        path: "style.css",
        media_type: "text/css; charset=utf-8",
        text: include_str!("../assets/style.css"),
    },
    Asset {
        path: "icon.svg",
        media_type: "image/svg+xml",
        text: include_str!("../assets/icon.svg"),
    },
    script!("main.js"),
    script!("session.js"),
    script!("camera.js"),
    script!("stage.js"),
    script!("fields.js"),
    script!("colour.js"),
    script!("panels.js"),
    script!("figures.js"),
];

/// The file of a path.
pub fn asset(path: &str) -> Option<&'static Asset> {
    ASSETS.iter().find(|asset| asset.path == path)
}
