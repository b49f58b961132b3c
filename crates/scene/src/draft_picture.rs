//! A draft from a picture of two colours, one pixel for each crossing: point paper.

use crate::error::InputError;
use crate::memory::free_memory_bytes;
use organza_weave::spec::DraftSpec;

/// Linear brightness up to which a pixel is black, and from which it is white.
const BLACK: f32 = 0.1;
const WHITE: f32 = 0.6;

/// The draft of a fabric with its picture, if it names one, as rows of crossings: black pixels
/// are warp on the face, the lowest row is the first pick.
///
/// # Errors
/// Names the key, and what is wrong with the picture.
pub(crate) fn resolved(
    spec: &DraftSpec,
    open: &dyn Fn(&str) -> std::io::Result<Vec<u8>>,
) -> Result<DraftSpec, InputError> {
    let mut spec = spec.clone();
    let Some(name) = spec.picture.take() else {
        return Ok(spec);
    };
    let at = |e: InputError| e.at_key("draft.picture");
    let fail = |why: String| at(InputError::of_file(&name, why));
    let others = [
        &spec.weave,
        &spec.wif,
        &spec.knit,
        &spec.openwork,
        &spec.curves,
    ];
    if spec.drawdown.is_some() || others.into_iter().any(Option::is_some) {
        return Err(fail("expected no other kind of draft beside it".into()));
    }
    let bytes = open(&name).map_err(|e| at(InputError::of_io(&name, &e)))?;
    let decoded = organza_picture::decode(&bytes, free_memory_bytes());
    let (picture, _) = decoded.map_err(|e| fail(e.to_string()))?;
    let width = picture.size.x as usize;
    let mut rows = Vec::with_capacity(picture.size.y as usize);
    for (y, row) in picture.pixels.chunks_exact(width.max(1)).enumerate() {
        let mut text = String::with_capacity(width);
        for (x, pixel) in row.iter().enumerate() {
            let brightness = pixel.0.element_sum() / 3.0;
            text.push(match brightness {
                b if b <= BLACK => 'X',
                b if b >= WHITE => '.',
                _ => {
                    return Err(fail(format!(
                        "expected black and white, found the colour {:?} (linear) at column {}, \
                         row {}",
                        pixel.0.to_array(),
                        x + 1,
                        y + 1
                    )));
                }
            });
        }
        rows.push(text);
    }
    spec.drawdown = Some(rows);
    Ok(spec)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec2;
    use organza_basis::Rgb;
    use organza_picture::{Picture, exr};

    fn drafted(values: &[f32]) -> Result<DraftSpec, InputError> {
        let pixels = values.iter().map(|&v| Rgb::splat(v)).collect();
        let mut bytes = std::io::Cursor::new(Vec::new());
        let size = UVec2::new(3, 2);
        exr::write_colours(&Picture { size, pixels }, &mut bytes).unwrap();
        let bytes = bytes.into_inner();
        let spec = DraftSpec {
            picture: Some("points.exr".into()),
            ..DraftSpec::default()
        };
        resolved(&spec, &|_| Ok(bytes.clone()))
    }

    #[test]
    fn black_pixels_are_warp() {
        let spec = drafted(&[0.0, 1.0, 1.0, 1.0, 0.0, 0.05]).unwrap();
        assert_eq!(spec.drawdown.unwrap(), ["X..", ".XX"]);
        assert_eq!(spec.picture, None);
    }

    #[test]
    fn grey_pixels_are_refused() {
        let why = drafted(&[0.0, 1.0, 1.0, 1.0, 0.3, 0.0]).unwrap_err();
        let why = why.to_string();
        assert!(
            why.starts_with("draft.picture: points.exr: expected black and white"),
            "{why}"
        );
        assert!(why.ends_with("column 2, row 2"), "{why}");
    }
}
