//! The picture or colour that a fabric file prints on its cloth.

use crate::error::{InputError, Result};
use crate::memory::free_memory_bytes;
use crate::optics::{OpticsFile, OpticsList};
use organza_weave::{PrintImage, PrintSpec};

/// What `[print]` prints: its picture, or one pixel of its colour.
///
/// # Errors
/// Names the key at fault.
pub(crate) fn image(
    spec: &PrintSpec,
    open: &dyn Fn(&str) -> std::io::Result<Vec<u8>>,
) -> Result<PrintImage> {
    match (&spec.image, spec.colour) {
        (Some(name), None) => decode(name, open).map_err(|e| e.at_key("print.image")),
        (None, Some(colour)) => Ok(PrintImage {
            size: [1, 1],
            pixels: vec![colour],
        }),
        _ => Err(InputError::new("expected exactly one of image, colour").at_key("print")),
    }
}

/// Reads a picture in linear colours.
///
/// # Errors
/// Names the picture and what is wrong with it.
fn decode(name: &str, open: &dyn Fn(&str) -> std::io::Result<Vec<u8>>) -> Result<PrintImage> {
    let bytes = open(name).map_err(|e| InputError::of_io(name, &e))?;
    let decoded = organza_picture::decode(&bytes, free_memory_bytes());
    let (picture, _) = decoded.map_err(|e| InputError::of_file(name, e))?;
    Ok(PrintImage {
        size: picture.size.to_array(),
        pixels: picture.pixels,
    })
}

/// Warnings of keys of `[optics.NAME]` that give all fibres of a yarn one colour: in the models
/// that read them, print and wear do not show.
pub(crate) fn warnings(optics: &OpticsFile) -> Vec<String> {
    let of = |(name, list): (&String, &OpticsList)| {
        let table = list.of(None, None);
        let keys = [
            ("albedo", table.albedo.is_some()),
            ("colour", table.colour.is_some()),
            ("absorption_per_mm", table.absorption_per_mm.is_some()),
            ("fitted", table.fitted.is_some()),
            ("model", table.model.is_some()),
        ];
        let found = keys.into_iter().filter(|k| k.1);
        let warning = |(key, _)| {
            format!(
                "optics.{name}.{key} gives all fibres one colour and hides print and wear; leave it \
                 out, and colour the threads by `colours` of warp and weft"
            )
        };
        found.map(warning).collect::<Vec<_>>()
    };
    optics.iter().flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::warnings;
    use crate::fabric_file::from_sources;
    use crate::fabric_table::FabricFile;
    use glam::UVec2;
    use organza_basis::Rgb;
    use organza_picture::{Picture, exr};
    use organza_volume::ovox::SourceFile;
    use std::path::Path;

    const FABRIC: &str = "[draft]\nweave = 'plain'\n[warp]\nper_cm = 20.0\n[weft]\nper_cm = 18.0\n\
                          [print]\nimage = 'roses.exr'\n";

    fn source(name: &str, bytes: &[u8]) -> SourceFile {
        SourceFile {
            name: name.into(),
            bytes: bytes.to_vec(),
        }
    }

    fn roses() -> Vec<u8> {
        let picture = Picture {
            size: UVec2::new(2, 1),
            pixels: vec![Rgb::new(0.8, 0.1, 0.1), Rgb::new(0.1, 0.6, 0.1)],
        };
        let mut bytes = std::io::Cursor::new(Vec::new());
        exr::write_colours(&picture, &mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn fabrics_are_printed_and_mistakes_reported() {
        let path = Path::new("rose.toml");
        let fabric = source("rose.toml", FABRIC.as_bytes());
        let read = from_sources(path, &[fabric.clone(), source("roses.exr", &roses())]).unwrap();
        // Undyed, red and green; each with its fibre.
        assert_eq!(read.cloth.materials().len(), 3);
        assert_eq!(read.fibre_models(path).unwrap().len(), 3);
        assert!(warnings(&read.file.optics).is_empty());
        let recoloured = format!("{FABRIC}[optics.cotton]\ncolour = [0.7, 0.7, 0.7]\nior = 1.5\n");
        let recoloured: FabricFile = toml::from_str(&recoloured).unwrap();
        let said = warnings(&recoloured.optics);
        assert!(
            said.len() == 1 && said[0].contains("optics.cotton.colour gives"),
            "{said:?}"
        );
        let refused = |sources: &[SourceFile]| match from_sources(path, sources) {
            Ok(_) => String::from("read"),
            Err(e) => e.to_string(),
        };
        let said = refused(std::slice::from_ref(&fabric));
        assert!(
            said.contains("rose.toml: print.image: roses.exr: "),
            "{said}"
        );
        let said = refused(&[fabric, source("roses.exr", b"no picture")]);
        assert!(
            said.contains("rose.toml: print.image: roses.exr: "),
            "{said}"
        );
        let wrong = FABRIC.replace("image =", "size_mm = [0.77, 0.77]\nimage =");
        let sources = [
            source("rose.toml", wrong.as_bytes()),
            source("roses.exr", &roses()),
        ];
        let said = refused(&sources);
        assert!(
            said.contains("rose.toml: print.size_mm: expected a width"),
            "{said}"
        );
        let dyed = FABRIC.replace("image = 'roses.exr'", "colour = [0.1, 0.2, 0.6]");
        let read = from_sources(path, &[source("rose.toml", dyed.as_bytes())]).unwrap();
        assert_eq!(read.cloth.materials().len(), 2);
        for keys in ["", "colour = [0.1, 0.2, 0.6]\nimage = 'roses.exr'"] {
            let wrong = FABRIC.replace("image = 'roses.exr'", keys);
            let said = refused(&[source("rose.toml", wrong.as_bytes())]);
            let expected = "rose.toml: print: expected exactly one of image, colour";
            assert!(said.contains(expected), "{said}");
        }
        let wrong = FABRIC.replace("image =", "side = 'up'\nimage =");
        let said = refused(&[source("rose.toml", wrong.as_bytes())]);
        assert!(said.contains("face"), "{said}");
    }
}
