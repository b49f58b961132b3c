//! The keys of `[camera]` that belong to single kinds.

/// The largest length of a camera, mm: rays start in `f64`, whose steps are there
/// 1.2e-4 mm wide, a fiftieth of a fibre.
pub const MAX_MM: f64 = 1e12;

/// A key of a kind of camera, whose value is a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraKey {
    /// Its name.
    pub name: &'static str,
    /// Its greatest value.
    pub max: f64,
}

impl CameraKey {
    /// A length in mm, or a ratio of lengths.
    pub const fn length(name: &'static str) -> CameraKey {
        CameraKey { name, max: MAX_MM }
    }

    /// An angle, whose range the camera itself checks.
    pub const fn angle(name: &'static str) -> CameraKey {
        let max = f64::INFINITY;
        CameraKey { name, max }
    }
}

/// The values of such keys in one table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnKeys(Vec<(&'static str, f64)>);

impl OwnKeys {
    pub(super) fn set(&mut self, name: &'static str, value: f64) {
        self.0.push((name, value));
    }

    /// The value of a key; `None` if it is not given.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.0.iter().find(|key| key.0 == name).map(|key| key.1)
    }

    /// The value of a key that must be given.
    ///
    /// # Errors
    /// `key is missing`.
    pub fn required(&self, name: &str) -> Result<f64, String> {
        self.get(name).ok_or_else(|| format!("{name} is missing"))
    }
}
