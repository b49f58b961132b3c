//! Files of tensors, as the RGL material database keeps its measurements [Dupuy2018] and
//! Mitsuba's `measured` reads them.
//!
//! A file begins with the name of the format, a version of two bytes and the number of tensors
//! (32 bits). Each tensor has a length and a name (16 bits and bytes), a number of dimensions
//! (16 bits), a type (8 bits), the place of its values in the file (64 bits) and its
//! dimensions (64 bits each), the slowest first. The values follow. Everything is little-endian.

use crate::AdaptiveBrdf;
use std::io::{Result, Write};

const MAGIC: &[u8; 12] = b"tensor_file\0";
const VERSION: [u8; 2] = [1, 0];

/// Values start at multiples of this.
const ALIGNMENT: u64 = 8;

/// Values of a tensor.
enum Values<'a> {
    Bytes(&'a [u8]),
    Floats(&'a [f32]),
}

impl Values<'_> {
    /// Number of the type in files.
    fn kind(&self) -> u8 {
        match self {
            Values::Bytes(_) => 1,
            Values::Floats(_) => 10,
        }
    }

    fn len_bytes(&self) -> u64 {
        match self {
            Values::Bytes(list) => list.len() as u64,
            Values::Floats(list) => 4 * list.len() as u64,
        }
    }
}

/// A named tensor.
struct Tensor<'a> {
    name: &'static str,
    shape: Vec<u64>,
    values: Values<'a>,
}

impl Tensor<'_> {
    fn head_bytes(&self) -> u64 {
        2 + self.name.len() as u64 + 2 + 1 + 8 + 8 * self.shape.len() as u64
    }
}

/// Writes a file. Colour is linear sRGB, which Mitsuba reads in its RGB variants.
///
/// # Errors
/// Those of the writer.
pub fn write_adaptive(
    brdf: &AdaptiveBrdf,
    description: &str,
    out: &mut (impl Write + ?Sized),
) -> Result<()> {
    let (azimuths, polar) = (brdf.phi_rad.len() as u64, brdf.theta_rad.len() as u64);
    let side = u64::from(brdf.grid.side);
    let floats = |name, shape: &[u64], list| Tensor {
        name,
        shape: shape.to_vec(),
        values: Values::Floats(list),
    };
    let bytes = |name, list: &'static [u8]| Tensor {
        name,
        shape: vec![list.len() as u64],
        values: Values::Bytes(list),
    };
    let square = [azimuths, polar, side, side];
    let description = Tensor {
        name: "description",
        shape: vec![description.len() as u64],
        values: Values::Bytes(description.as_bytes()),
    };
    write_tensors(
        &[
            description,
            floats("phi_i", &[azimuths], &brdf.phi_rad),
            floats("theta_i", &[polar], &brdf.theta_rad),
            floats("sigma", &[side, side], &brdf.projected_area),
            floats("ndf", &[side, side], &brdf.normals),
            floats("vndf", &square, &brdf.visible_normals),
            floats("rgb", &[azimuths, polar, 3, side, side], &brdf.rgb),
            floats("luminance", &square, &brdf.luminance),
            // The values of `rgb` are divided by the density of exitant directions.
            bytes("jacobian", &[1]),
        ],
        out,
    )
}

fn write_tensors(tensors: &[Tensor<'_>], out: &mut (impl Write + ?Sized)) -> Result<()> {
    let heads: u64 = tensors.iter().map(Tensor::head_bytes).sum();
    out.write_all(MAGIC)?;
    out.write_all(&VERSION)?;
    out.write_all(&(tensors.len() as u32).to_le_bytes())?;
    let first = MAGIC.len() as u64 + VERSION.len() as u64 + 4 + heads;
    let mut end = first;
    for tensor in tensors {
        let start = end.next_multiple_of(ALIGNMENT);
        out.write_all(&(tensor.name.len() as u16).to_le_bytes())?;
        out.write_all(tensor.name.as_bytes())?;
        out.write_all(&(tensor.shape.len() as u16).to_le_bytes())?;
        out.write_all(&[tensor.values.kind()])?;
        out.write_all(&start.to_le_bytes())?;
        for extent in &tensor.shape {
            out.write_all(&extent.to_le_bytes())?;
        }
        end = start + tensor.values.len_bytes();
    }
    let mut end = first;
    for tensor in tensors {
        let start = end.next_multiple_of(ALIGNMENT);
        out.write_all(&vec![0; (start - end) as usize])?;
        match tensor.values {
            Values::Bytes(list) => out.write_all(list)?,
            Values::Floats(list) => {
                for value in list {
                    out.write_all(&value.to_le_bytes())?;
                }
            }
        }
        end = start + tensor.values.len_bytes();
    }
    Ok(())
}
