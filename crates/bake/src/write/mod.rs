//! Files: textures, and materials that name them.
//!
//! Nothing here opens a file: [`folder_files`] gives names and bytes.

mod gltf_file;
mod materialx;
mod textures;
mod usda;

pub use gltf_file::write_glb;
pub use materialx::write_materialx;
pub use textures::{FOLDER, GltfTexture, TextureFile, gltf_textures, texture_files};
pub use usda::write_usda;

use crate::maps::Maps;
use crate::model::Parameters;

/// Side of the square of cloth that the files of glTF and USD show, mm.
pub const PATCH_MM: f32 = 100.0;

/// Why a file could not be made.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// A texture could not be encoded.
    #[error("a texture cannot be encoded: {0}")]
    Encoding(String),
    /// The text of a material could not be made.
    #[error("a material cannot be written: {0}")]
    Text(String),
}

/// What the files of a folder are made from.
#[derive(Clone, Copy, Debug)]
pub struct Baked<'a> {
    /// Name of the material: letters, digits and underscores.
    pub name: &'a str,
    /// Folder of its textures below that of the materials.
    pub folder: &'a str,
    /// The maps.
    pub maps: &'a Maps,
    /// Parameters of the glTF material.
    pub gltf: &'a Parameters,
    /// Parameters of the OpenPBR material.
    pub openpbr: &'a Parameters,
    /// Parameters of the standard_surface material.
    pub standard_surface: &'a Parameters,
    /// Parameters of the USD Preview Surface.
    pub usd_preview: &'a Parameters,
}

/// A name with nothing but letters, digits and underscores that starts with a letter, as all
/// formats allow.
pub fn plain_name(name: &str) -> String {
    let kept = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let plain: String = name.chars().map(kept).take(60).collect();
    match plain.chars().next() {
        Some(c) if c.is_ascii_alphabetic() => plain,
        _ => format!("cloth_{plain}"),
    }
}

/// Paths below the folder, with bytes, and the textures among them with their meanings.
pub type FolderFiles = (Vec<(String, Vec<u8>)>, Vec<(String, &'static str)>);

/// All materials and textures of a cloth and its colourways, whose tiles have the same size and
/// which have names and folders of their own; the first is shown.
///
/// # Errors
/// See [`WriteError`].
pub fn folder_files(colourways: &[Baked<'_>]) -> Result<FolderFiles, WriteError> {
    let mut files = vec![
        ("material.glb".to_owned(), write_glb(colourways)?),
        (
            "material.mtlx".to_owned(),
            write_materialx(colourways)?.into_bytes(),
        ),
        (
            "material.usda".to_owned(),
            write_usda(colourways).into_bytes(),
        ),
    ];
    let mut meanings = Vec::new();
    for baked in colourways {
        for texture in texture_files(baked.maps, baked.openpbr, baked.usd_preview.relief)? {
            let name = format!("{}/{}", baked.folder, texture.name);
            meanings.push((name.clone(), texture.meaning));
            files.push((name, texture.bytes));
        }
    }
    Ok((files, meanings))
}

/// Quotient of two parameters, one where neither counts.
fn ratio(a: f64, b: f64) -> f64 {
    if b.abs() < 1e-9 { 1.0 } else { a / b }
}

/// A number as files hold it.
fn number(x: f64) -> String {
    let text = format!("{x:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests;
