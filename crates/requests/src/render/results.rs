//! A picture as arrays.

use organza_film::Film;
use organza_picture::Layers;
use organza_picture::exr::CHANNELS;
use organza_work::{Numbers, Results};
use serde_json::Value;

/// The channels of an EXR file: those of one name before the dot, and the colours as `rgb`,
/// share an array of rows from the top, pixels, channels. Layers follow where they are known.
pub fn of(film: &Film, layers: Layers<'_>, figures: Value) -> Results {
    let (rows, columns) = (film.size().y as usize, film.size().x as usize);
    let mut results = Results::default();
    let mut rest = &CHANNELS[..];
    while let Some(((first, _), _)) = rest.split_first() {
        let group = |name: &str| match name {
            "R" | "G" | "B" => "rgb".to_owned(),
            name => name.split('.').next().unwrap_or(name).to_owned(),
        };
        let name = group(first);
        let count = rest.iter().take_while(|(n, _)| group(n) == name).count();
        let (channels, after) = rest.split_at(count);
        let pixels = film.pixels().iter();
        let values = pixels.flat_map(|p| channels.iter().map(move |(_, of)| of(p)));
        let numbers = Numbers::F32(values.collect());
        let shape: &[usize] = match count {
            1 => &[rows, columns],
            count => &[rows, columns, count],
        };
        results.push(&name, shape, numbers);
        rest = after;
    }
    if let Some(direct) = layers.direct {
        let colours = direct.pixels().iter().flat_map(|p| p.mean().0.to_array());
        let numbers = Numbers::F32(colours.collect());
        results.push("direct", &[rows, columns, 3], numbers);
    }
    if let Some(errors) = layers.cache_error {
        let numbers = Numbers::F32(errors.to_vec());
        results.push("cache_error", &[rows, columns], numbers);
    }
    results.with_figure("figures", figures)
}
