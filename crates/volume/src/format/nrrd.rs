//! `.nrrd`: the arrays of imaging programs such as 3D Slicer, ITK and teem, with
//! density, orientation and colour of every cell in one file.
//!
//! A text header, an empty line, then the values, raw or as a gzip stream, channel fastest,
//! then x, y, z. Files of organza name their channels under the key `channels`. In files of
//! other programs, three axes, or four axes with one value per cell, are a density; four axes
//! with four values per cell are density and orientation. Samples stand for cells. A file
//! without a space has cells of its spacings, or of 1 mm, and begins at the origin.

use super::{Format, Part, Volume, Voxels, WriteOption, described};
use crate::{Error, GridSet, VolGrid};
use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use glam::{DVec3, UVec3, Vec3};
use organza_basis::{Aabb, Budget};
use serde_json::{Value, json};
use std::io::{BufWriter, Read, Write};

/// The record of the format.
pub static FORMAT: Format = Format {
    ending: "nrrd",
    magic: b"NRRD000",
    noun: "an array (.nrrd)",
    keeps: "one level: density, orientation, spread, SGGX matrix, albedo",
    options: &[WriteOption::Level, WriteOption::Raw],
    describe: |source, budget| Ok(source.read(budget, read)?.describe()),
    read: |source, budget| {
        let array = source.read(budget, read)?;
        array.grid_set(budget).map(Volume::Grids)
    },
    write_memory_bytes: |_, _| 0, // cell by cell
    write: |voxels| {
        Ok(vec![Part {
            infix: None,
            write: Box::new(|out| write(voxels, out)),
        }])
    },
};

const ENDING: &str = ".nrrd";
/// Maximum size of a header, bytes.
const MAX_HEADER: usize = 1 << 16;
/// The channels of a cell in files of organza.
const CHANNELS: [&str; 14] = [
    "density",
    "orientation_x",
    "orientation_y",
    "orientation_z",
    "spread",
    "sggx_xx",
    "sggx_yy",
    "sggx_zz",
    "sggx_xy",
    "sggx_xz",
    "sggx_yz",
    "albedo_r",
    "albedo_g",
    "albedo_b",
];

fn wrong(problem: impl Into<String>) -> Error {
    Error::format(ENDING, problem)
}

/// Writes a level of an octree.
fn write(voxels: &Voxels<'_>, out: &mut dyn Write) -> Result<(), Error> {
    let (octree, level) = (voxels.octree, voxels.level);
    let (dims, edge) = (octree.dims(level), octree.voxel_mm(level));
    let first = octree.bounds_mm().min + 0.5 * edge;
    let encoding = if voxels.raw { "raw" } else { "gzip" };
    write!(
        out,
        "NRRD0004\n# One tile of a cloth, in mm: extinction broadside per mm, SGGX at unit density.\n\
         type: float\ndimension: 4\nspace dimension: 3\nsizes: {} {} {} {}\n\
         space directions: none ({},0,0) (0,{},0) (0,0,{})\ncenterings: none cell cell cell\n\
         kinds: list domain domain domain\nendian: little\nencoding: {encoding}\n\
         space units: \"mm\" \"mm\" \"mm\"\nspace origin: ({},{},{})\nchannels:={}\n\n",
        CHANNELS.len(),
        dims.x,
        dims.y,
        dims.z,
        edge.x,
        edge.y,
        edge.z,
        first.x,
        first.y,
        first.z,
        CHANNELS.join(" ")
    )?;
    if voxels.raw {
        return write_cells(voxels, &mut BufWriter::new(out));
    }
    let mut packed = GzEncoder::new(out, Compression::default());
    write_cells(voxels, &mut BufWriter::new(&mut packed))?;
    packed.finish()?;
    Ok(())
}

fn write_cells(voxels: &Voxels<'_>, out: &mut dyn Write) -> Result<(), Error> {
    let dims = voxels.octree.dims(voxels.level);
    for z in 0..dims.z {
        for y in 0..dims.y {
            for x in 0..dims.x {
                let mixture = voxels.octree.mixture(voxels.level, UVec3::new(x, y, z));
                let m = (voxels.merge)(&mixture);
                let is_empty = m.populations == 0;
                let axis = if is_empty { Vec3::ZERO } else { m.axis };
                let values = [m.density_per_mm]
                    .into_iter()
                    .chain(axis.to_array())
                    .chain([m.spread_rad])
                    .chain(m.sggx.to_array())
                    .chain(m.albedo.0.to_array());
                for value in values {
                    out.write_all(&value.to_le_bytes())?;
                }
            }
        }
    }
    out.flush()?;
    Ok(())
}

/// The values of a file and their places.
struct Array {
    dims: UVec3,
    bounds_mm: Aabb,
    /// Names of the channels.
    channels: Vec<String>,
    /// Channel fastest, then x, y, z.
    data: Vec<f32>,
}

/// Reads a file.
fn read(bytes: &[u8], budget: &mut Budget) -> Result<Array, Error> {
    let header = Header::parse(bytes)?;
    let count = header.channels.len() as u64;
    let cells = header.dims.as_u64vec3().to_array();
    let values = cells
        .iter()
        .try_fold(count, |n, &d| n.checked_mul(d))
        .ok_or_else(|| wrong("it has more cells than can be counted"))?;
    budget.take_items::<f32>(values, "values")?;
    let mut data = Vec::new();
    let stored = &bytes[header.length..];
    match header.encoding.as_str() {
        "raw" => header.decode(&mut &stored[..], values, &mut data)?,
        "gzip" | "gz" => header.decode(&mut MultiGzDecoder::new(stored), values, &mut data)?,
        other => return Err(wrong(format!("encoding {other}; raw and gzip can be read"))),
    }
    Ok(Array {
        dims: header.dims,
        bounds_mm: header.bounds_mm,
        channels: header.channels,
        data,
    })
}

/// The type of a stored value.
#[derive(Clone, Copy)]
struct Scalar {
    bytes: usize,
    /// From little-endian bytes.
    decode: fn(&[u8]) -> f32,
}

macro_rules! scalar {
    ($kind:ty) => {
        Scalar {
            bytes: size_of::<$kind>(),
            decode: |b| {
                let mut own = [0; size_of::<$kind>()];
                own.copy_from_slice(b);
                <$kind>::from_le_bytes(own) as f32
            },
        }
    };
}

fn scalar_of(name: &str) -> Option<Scalar> {
    Some(match name {
        "float" => scalar!(f32),
        "double" => scalar!(f64),
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => scalar!(u8),
        "short" | "signed short" | "int16" | "int16_t" => scalar!(i16),
        "ushort" | "unsigned short" | "uint16" | "uint16_t" => scalar!(u16),
        "int" | "signed int" | "int32" | "int32_t" => scalar!(i32),
        "uint" | "unsigned int" | "uint32" | "uint32_t" => scalar!(u32),
        _ => return None,
    })
}

/// The contents of the header.
struct Header {
    /// Bytes before the values.
    length: usize,
    scalar: Scalar,
    is_big_endian: bool,
    encoding: String,
    dims: UVec3,
    bounds_mm: Aabb,
    channels: Vec<String>,
}

impl Header {
    fn parse(bytes: &[u8]) -> Result<Header, Error> {
        if !bytes.starts_with(FORMAT.magic) {
            return Err(wrong("it does not begin with \"NRRD000\""));
        }
        let window = &bytes[..bytes.len().min(MAX_HEADER)];
        let ends = |end: &[u8]| {
            let at = window.windows(end.len()).position(|w| w == end)?;
            Some(at + end.len())
        };
        let length = ends(b"\n\n")
            .or_else(|| ends(b"\r\n\r\n"))
            .ok_or_else(|| wrong("its header has no end"))?;
        let text = String::from_utf8_lossy(&bytes[..length]);
        // Fields are `name: value`, keys of programs `name:=value`.
        let field = |name: &str| {
            let mut lines = text.lines().filter_map(|l| l.split_once(':'));
            let found = lines.find(|(key, _)| key.eq_ignore_ascii_case(name))?.1;
            Some(found.trim_start_matches('=').trim())
        };
        let needed =
            |name: &str| field(name).ok_or_else(|| wrong(format!("it has no field `{name}`")));
        if field("data file").or(field("datafile")).is_some() {
            return Err(wrong("its values are in another file; attach them"));
        }
        let kind = needed("type")?;
        let scalar =
            scalar_of(kind).ok_or_else(|| wrong(format!("values of type {kind} are not read")))?;
        let sizes = needed("sizes")?.split_whitespace();
        let sizes: Result<Vec<u32>, _> = sizes.map(str::parse).collect();
        let sizes = sizes.map_err(|e| wrong(format!("sizes: {e}")))?;
        let (count, dims) = match sizes[..] {
            [x, y, z] => (1, UVec3::new(x, y, z)),
            [c, x, y, z] => (c as usize, UVec3::new(x, y, z)),
            _ => return Err(wrong(format!("{} axes; expected 3 or 4", sizes.len()))),
        };
        if dims.min_element() == 0 {
            return Err(wrong(format!("{dims} cells")));
        }
        let named = field("channels").map(|c| c.split_whitespace().map(str::to_owned));
        let channels: Vec<String> = match (named, count) {
            (Some(named), _) => named.collect(),
            (None, 1 | 4) => CHANNELS[..count].iter().map(|c| (*c).into()).collect(),
            (None, n) => {
                return Err(wrong(format!(
                    "{n} values a cell; expected density, or density and orientation (4), or a \
                     key `channels` that names them"
                )));
            }
        };
        if channels.len() != count {
            return Err(wrong(format!(
                "{count} values a cell and {} names in `channels`",
                channels.len()
            )));
        }
        let (first, edge) = place(field("space directions"), field("space origin"))
            .or_else(|| spaced(field("spacings"), count > 1 || sizes.len() == 4))
            .ok_or_else(|| {
                wrong("its space is turned, sheared or mirrored, which cannot be rendered")
            })?;
        let min = first - 0.5 * edge;
        let max = min + edge * dims.as_dvec3();
        let bounds_mm = Aabb::new(min.as_vec3(), max.as_vec3());
        if !(bounds_mm.min.is_finite() && bounds_mm.max.cmpgt(bounds_mm.min).all()) {
            return Err(wrong(format!("its box runs from {min} to {max}")));
        }
        Ok(Header {
            length,
            scalar,
            is_big_endian: field("endian") == Some("big"),
            encoding: needed("encoding")?.to_lowercase(),
            dims,
            bounds_mm,
            channels,
        })
    }

    /// Decodes values as they are read, so that memory grows with the actual contents.
    fn decode(&self, from: &mut dyn Read, values: u64, to: &mut Vec<f32>) -> Result<(), Error> {
        let width = self.scalar.bytes;
        let mut buffer = vec![0u8; (1 << 16) * width];
        let mut left = values;
        while left > 0 {
            let count = left.min(1 << 16) as usize;
            let part = &mut buffer[..count * width];
            from.read_exact(part)
                .map_err(|e| wrong(format!("its values are cut off or damaged: {e}")))?;
            to.extend(part.chunks_exact_mut(width).map(|b| {
                if self.is_big_endian {
                    b.reverse();
                }
                (self.scalar.decode)(b)
            }));
            left -= count as u64;
        }
        match to.iter().position(|v| !v.is_finite()) {
            Some(i) => Err(wrong(format!("value {i} is {}", to[i]))),
            None => Ok(()),
        }
    }
}

/// The centre of the first cell and the edges of a cell, of a space without rotation.
fn place(directions: Option<&str>, origin: Option<&str>) -> Option<(DVec3, DVec3)> {
    let vector = |text: &str| -> Option<DVec3> {
        let text = text.trim().strip_prefix('(')?.strip_suffix(')')?;
        let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
        <[f64; 3]>::try_from(numbers?).ok().map(DVec3::from)
    };
    let axes: Option<Vec<DVec3>> = directions?
        .split_inclusive(')')
        .map(|text| text.trim().trim_start_matches("none").trim())
        .filter(|text| !text.is_empty())
        .map(vector)
        .collect();
    let [x, y, z] = <[DVec3; 3]>::try_from(axes?).ok()?;
    let edge = DVec3::new(x.x, y.y, z.z);
    let straight = [x, y, z] == [DVec3::X * edge.x, DVec3::Y * edge.y, DVec3::Z * edge.z];
    let first = origin.map_or(Some(0.5 * edge), vector)?;
    (straight && edge.min_element() > 0.0).then_some((first, edge))
}

/// The same for a file without a space.
fn spaced(spacings: Option<&str>, skips_first: bool) -> Option<(DVec3, DVec3)> {
    let Some(text) = spacings else {
        return Some((DVec3::splat(0.5), DVec3::ONE));
    };
    let words = text.split_whitespace().skip(usize::from(skips_first));
    let numbers: Option<Vec<f64>> = words.map(|n| n.parse().ok()).collect();
    let edge = DVec3::from(<[f64; 3]>::try_from(numbers?).ok()?);
    (edge.min_element() > 0.0).then_some((0.5 * edge, edge))
}

impl Array {
    fn describe(&self) -> Value {
        let (channels, bounds_mm) = (json!(self.channels), &self.bounds_mm);
        described("array", channels, &self.data, self.dims, bounds_mm)
    }

    /// The known channels, each kind as a grid.
    fn grid_set(&self, budget: &mut Budget) -> Result<GridSet, Error> {
        let mut grid = |names: &[&str]| -> Result<Option<VolGrid>, Error> {
            let find = |name: &&str| self.channels.iter().position(|c| c == *name);
            let places: Option<Vec<usize>> = names.iter().map(find).collect();
            let Some(places) = places else {
                return Ok(None);
            };
            let cells = self.data.chunks_exact(self.channels.len());
            budget.take_items::<f32>((cells.len() * names.len()) as u64, "cells")?;
            let data = cells.flat_map(|cell| places.iter().map(|&p| cell[p]));
            Ok(Some(VolGrid {
                dims: self.dims,
                channels: names.len() as u32,
                bounds_mm: self.bounds_mm,
                data: data.collect(),
            }))
        };
        let sigma_t = grid(&CHANNELS[..1])?
            .ok_or_else(|| wrong(format!("no channel `density` among {:?}", self.channels)))?;
        if sigma_t.data.iter().any(|v| *v < 0.0) {
            return Err(wrong("channel `density` holds negative values"));
        }
        let axes = match grid(&CHANNELS[1..5])? {
            Some(axes) => Some(axes),
            // Orientation without spread: parallel fibres.
            None => grid(&CHANNELS[1..4])?.map(|axes| VolGrid {
                channels: 4,
                data: axes
                    .data
                    .chunks_exact(3)
                    .flat_map(|a| [a[0], a[1], a[2], 0.0])
                    .collect(),
                ..axes
            }),
        };
        Ok(GridSet {
            sigma_t,
            sggx: grid(&CHANNELS[5..11])?,
            axes,
            albedo: grid(&CHANNELS[11..])?,
        })
    }
}

#[cfg(test)]
mod tests;
