//! Mitsuba's `.vol` grids, version 3 of the layout.
//!
//! Little-endian: "VOL", a version byte 3, then 32-bit integers: type 1
//! (32-bit floats), cells along x, y, z, channels; the box as six floats (least
//! corner, greatest corner); then the values, channel fastest, then x, y, z.
//!
//! A volume is three such files, `tile.sigma_t.vol`, `tile.sggx.vol` and
//! `tile.albedo.vol`, which `tile.vol` or the first stands for.

use super::grid_set::GridSet;
use super::{Format, Part, Source, Volume, Voxels, WriteOption, described};
use crate::Error;
use glam::{UVec3, Vec3};
use organza_basis::{Aabb, Budget};
use serde_json::{Value, json};
use std::io::{Read, Write};

const ENDING: &str = ".vol";

/// The record of the format.
pub static FORMAT: Format = Format {
    ending: "vol",
    magic: b"VOL\x03",
    noun: "a Mitsuba grid (.vol)",
    keeps: "one level as three grids: extinction, SGGX matrix, albedo",
    options: &[WriteOption::Level],
    describe,
    read: |source, budget| read_set(source, budget).map(Volume::Grids),
    write_memory_bytes: GridSet::memory_bytes,
    write: write_set,
};

/// What stands before the ending of the three files.
const INFIXES: [&str; 3] = ["sigma_t", "sggx", "albedo"];

/// The part of the name that the three files have in common.
fn stem(name: &str) -> &str {
    let stem = name.get(..name.len().saturating_sub(ENDING.len()));
    let stem = stem.unwrap_or(name);
    INFIXES
        .iter()
        .find_map(|infix| stem.strip_suffix(infix)?.strip_suffix('.'))
        .unwrap_or(stem)
}

fn decode(bytes: &[u8], budget: &mut Budget) -> Result<VolGrid, Error> {
    VolGrid::read(&mut &bytes[..], budget)
}

/// Reads the three files; SGGX and albedo may be absent.
fn read_set(source: &Source<'_>, budget: &mut Budget) -> Result<GridSet, Error> {
    let mut grids = [None, None, None];
    for (grid, infix) in grids.iter_mut().zip(INFIXES) {
        let name = format!("{}.{infix}{ENDING}", stem(source.name));
        let at_fault = |e: Error| Error::Beside {
            name: name.clone(),
            problem: Box::new(e),
        };
        let read = source.read_beside(&name, budget, decode);
        *grid = read.map_err(at_fault)?;
    }
    let [sigma_t, sggx, albedo] = grids;
    let sigma_t = sigma_t.ok_or_else(|| {
        Error::Unreadable(format!("there is no {}.sigma_t{ENDING}", stem(source.name)))
    })?;
    let set = GridSet {
        sigma_t,
        sggx,
        axes: None,
        albedo,
    };
    set.check()?;
    Ok(set)
}

fn write_set<'a>(voxels: &'a Voxels<'a>) -> Result<Vec<Part<'a>>, Error> {
    let set = GridSet::from_octree(voxels.octree, voxels.level, voxels.merge);
    let grids = [Some(set.sigma_t), set.sggx, set.albedo];
    let parts = INFIXES.into_iter().zip(grids).filter_map(|(infix, grid)| {
        let grid = grid?;
        Some(Part {
            infix: Some(infix),
            write: Box::new(move |out| grid.write(out)),
        })
    });
    Ok(parts.collect())
}

/// One file as it is; where the name stands for three, all of them.
fn describe(source: &Source<'_>, budget: &mut Budget) -> Result<Value, Error> {
    if let Some(grid) = source.read_beside(source.name, budget, decode)? {
        return Ok(grid.describe());
    }
    let set = read_set(source, budget)?;
    let or_none = |grid: &Option<VolGrid>| grid.as_ref().map(VolGrid::describe);
    Ok(json!({
        "kind": "grids",
        "sigma_t": set.sigma_t.describe(),
        "sggx": or_none(&set.sggx),
        "albedo": or_none(&set.albedo),
    }))
}

/// A dense grid of one or more channels; samples stand for whole cells.
#[derive(Clone, Debug, PartialEq)]
pub struct VolGrid {
    /// Cells along each axis, at least one.
    pub dims: UVec3,
    /// Values per cell, at least one.
    pub channels: u32,
    /// The box that the cells fill, in millimetres.
    pub bounds_mm: Aabb,
    /// Values: channel fastest, then x, y, z.
    pub data: Vec<f32>,
}

impl VolGrid {
    /// The values of a cell, which must lie within `dims`.
    #[inline]
    pub fn cell(&self, cell: UVec3) -> &[f32] {
        &self.data[self.place(cell)]
    }

    /// The same to write to.
    pub fn cell_mut(&mut self, cell: UVec3) -> &mut [f32] {
        let place = self.place(cell);
        &mut self.data[place]
    }

    #[inline]
    fn place(&self, cell: UVec3) -> std::ops::Range<usize> {
        let channels = self.channels as usize;
        let (x, y, z) = (cell.x as usize, cell.y as usize, cell.z as usize);
        let at = channels * (x + self.dims.x as usize * (y + self.dims.y as usize * z));
        at..at + channels
    }

    /// Writes the file.
    ///
    /// # Errors
    /// When `data` does not match `dims` and `channels`, or writing fails.
    pub fn write(&self, out: &mut dyn Write) -> Result<(), Error> {
        let fits = |n: u32| (1..=i32::MAX as u32).contains(&n);
        let sizes = [self.dims.x, self.dims.y, self.dims.z, self.channels];
        let expected = sizes.iter().map(|&n| u128::from(n)).product::<u128>();
        if !sizes.into_iter().all(fits) || expected != self.data.len() as u128 {
            return Err(Error::format(
                ENDING,
                format!(
                    "{} cells of {} channels do not match {} values",
                    self.dims,
                    self.channels,
                    self.data.len()
                ),
            ));
        }
        let mut head = b"VOL\x03\x01\0\0\0".to_vec();
        sizes.iter().for_each(|n| head.extend(n.to_le_bytes()));
        let (min, max) = (self.bounds_mm.min, self.bounds_mm.max);
        for x in min.to_array().into_iter().chain(max.to_array()) {
            head.extend(x.to_le_bytes());
        }
        out.write_all(&head)?;
        for part in self.data.chunks(1 << 16) {
            let bytes: Vec<u8> = part.iter().flat_map(|x| x.to_le_bytes()).collect();
            out.write_all(&bytes)?;
        }
        Ok(())
    }

    /// Reads a file.
    ///
    /// # Errors
    /// For other kinds and versions of file, sizes that are not positive, more
    /// values than the budget has room for, a box that is not finite, values that
    /// are not finite, and a file that ends early or goes on after its values.
    pub fn read(input: &mut dyn Read, budget: &mut Budget) -> Result<VolGrid, Error> {
        let wrong = |problem: String| Error::format(ENDING, problem);
        let mut head = [0u8; 48];
        read_exactly(input, &mut head, "header")?;
        if &head[..3] != b"VOL" {
            return Err(wrong("it does not begin with \"VOL\"".into()));
        }
        if head[3] != 3 {
            return Err(wrong(format!("version {}, expected 3", head[3])));
        }
        let word = |i: usize| [head[i], head[i + 1], head[i + 2], head[i + 3]];
        let int = |i: usize| i32::from_le_bytes(word(i));
        if int(4) != 1 {
            return Err(wrong(format!(
                "values of type {}, expected 1 (32-bit float)",
                int(4)
            )));
        }
        let sizes = [int(8), int(12), int(16), int(20)];
        if sizes.iter().any(|&n| n <= 0) {
            return Err(wrong(format!(
                "{} x {} x {} cells of {} channels, expected positive numbers",
                sizes[0], sizes[1], sizes[2], sizes[3]
            )));
        }
        let bytes = 4 * sizes.iter().map(|&n| n as u128).product::<u128>();
        if bytes > isize::MAX as u128 {
            return Err(wrong(format!(
                "it declares {bytes} bytes of values, more than any memory holds"
            )));
        }
        budget.take(bytes as u64, "values")?;
        let float = |i: usize| f32::from_le_bytes(word(i));
        let corner = |i: usize| Vec3::new(float(i), float(i + 4), float(i + 8));
        let bounds_mm = Aabb::new(corner(24), corner(36));
        let (min, max) = (bounds_mm.min, bounds_mm.max);
        if !(min.is_finite() && max.is_finite() && max.cmpgt(min).all()) {
            return Err(wrong(format!("its box runs from {min} to {max}")));
        }
        let count = (bytes / 4) as usize;
        let mut data = Vec::new();
        let mut buffer = vec![0u8; 1 << 18];
        // Memory grows with what the file really holds, not with what it claims.
        while data.len() < count {
            let part = &mut buffer[..(4 * (count - data.len())).min(1 << 18)];
            read_exactly(input, part, "values")?;
            data.extend(
                part.chunks_exact(4)
                    .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            );
        }
        if let Some(i) = data.iter().position(|x| !x.is_finite()) {
            return Err(wrong(format!("value {i} is {}", data[i])));
        }
        if input.read(&mut [0])? != 0 {
            return Err(wrong("it continues after its values".into()));
        }
        Ok(VolGrid {
            dims: UVec3::new(sizes[0] as u32, sizes[1] as u32, sizes[2] as u32),
            channels: sizes[3] as u32,
            bounds_mm,
            data,
        })
    }
}

impl VolGrid {
    fn describe(&self) -> Value {
        let (channels, bounds_mm) = (json!(self.channels), &self.bounds_mm);
        described("grid", channels, &self.data, self.dims, bounds_mm)
    }
}

fn read_exactly(input: &mut dyn Read, into: &mut [u8], what: &str) -> Result<(), Error> {
    input.read_exact(into).map_err(|e| match e.kind() {
        std::io::ErrorKind::UnexpectedEof => {
            Error::format(ENDING, format!("it ends within its {what}"))
        }
        _ => Error::Io(e),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> VolGrid {
        VolGrid {
            dims: UVec3::new(3, 2, 4),
            channels: 2,
            bounds_mm: Aabb::new(Vec3::new(-1.0, 0.0, 2.0), Vec3::new(1.0, 0.5, 2.25)),
            data: (0..48).map(|i| i as f32 * 0.25).collect(),
        }
    }

    fn bytes() -> Vec<u8> {
        let mut out = Vec::new();
        grid().write(&mut out).unwrap();
        out
    }

    #[test]
    fn round_trip_is_exact_and_channel_fastest() {
        let back = VolGrid::read(&mut &bytes()[..], &mut Budget::new(1000)).unwrap();
        assert_eq!(back, grid());
        assert_eq!(back.cell(UVec3::new(1, 0, 0)), [0.5, 0.75]);
        assert_eq!(back.cell(UVec3::new(0, 1, 0)), [1.5, 1.75]);
        assert_eq!(back.cell(UVec3::new(2, 1, 3)), [11.5, 11.75]);
    }

    #[test]
    fn damaged_files_are_refused() {
        let good = bytes();
        for end in 0..good.len() {
            let read = VolGrid::read(&mut &good[..end], &mut Budget::new(1000));
            assert!(read.is_err(), "{end}");
        }
        let mut long = good.clone();
        long.push(0);
        assert!(VolGrid::read(&mut &long[..], &mut Budget::new(1000)).is_err());
        let spoilt = |at: usize, with: &[u8]| {
            let mut b = good.clone();
            b[at..at + with.len()].copy_from_slice(with);
            VolGrid::read(&mut &b[..], &mut Budget::new(1 << 40))
                .unwrap_err()
                .to_string()
        };
        assert!(spoilt(0, b"x").contains("VOL"));
        assert!(spoilt(3, b"\x02").contains("version 2"));
        assert!(spoilt(4, b"\x02").contains("type 2"));
        assert!(spoilt(8, &[0, 0, 0, 0]).contains("positive"));
        assert!(spoilt(8, &[255, 255, 255, 127]).contains("ends within"));
        assert!(spoilt(8, &[255; 4]).contains("positive"));
        assert!(spoilt(24, &f32::NAN.to_le_bytes()).contains("box"));
        assert!(spoilt(60, &f32::NAN.to_le_bytes()).contains("value 3"));
        let small = VolGrid::read(&mut &good[..], &mut Budget::new(100));
        assert!(small.unwrap_err().to_string().contains("192 bytes"));
        let mut short = grid();
        short.data.pop();
        assert!(short.write(&mut Vec::new()).is_err());
    }
}
