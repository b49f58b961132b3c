//! Writing .vdb files, version 224 of the format.

use super::{Cells, Data, EDGES, ENDING, Grid, Leaf, Value};
use crate::Error;
use flate2::{Compression, write::ZlibEncoder};
use glam::{DAffine3, DMat3, DVec3, IVec3};
use std::io::Write;

/// How values are packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Codec {
    /// zlib, active values only.
    #[default]
    Zip,
    /// Raw, active values only.
    Raw,
}

/// Metadata of organza: the least and greatest cell of the lattice.
pub(super) const EXTENT: [&str; 2] = ["organza_extent_min", "organza_extent_max"];
const ZIP: u32 = 1;
const ACTIVE_MASK: u32 = 2;

/// Writes grids to a file.
///
/// Active cubes are not written: [`Cells::cubes`] must be empty.
///
/// # Errors When a grid has cubes or misplaced leaves, or writing fails.
pub fn write(grids: &[Grid], codec: Codec, out: &mut dyn Write) -> Result<(), Error> {
    let mut head = b" BDV\0\0\0\0".to_vec();
    for n in [224u32, 10, 0] {
        head.extend(n.to_le_bytes());
    }
    head.push(1);
    // Any unique name is valid; a constant one makes files reproducible.
    head.extend(b"6f726761-6e7a-4100-8000-000000000001");
    put_metadata(&[("creator", Meta::Text("organza"))], &mut head);
    head.extend((grids.len() as u32).to_le_bytes());
    out.write_all(&head)?;
    let mut at = head.len() as u64;
    for g in grids {
        let bytes = encode_grid(g, codec, at)?;
        out.write_all(&bytes)?;
        at += bytes.len() as u64;
    }
    Ok(())
}

enum Meta<'a> {
    Text(&'a str),
    Bool(bool),
    Int64(i64),
    Vec3i(IVec3),
}

fn put_text(s: &str, out: &mut Vec<u8>) {
    out.extend((s.len() as u32).to_le_bytes());
    out.extend(s.as_bytes());
}

fn put_metadata(entries: &[(&str, Meta)], out: &mut Vec<u8>) {
    out.extend((entries.len() as u32).to_le_bytes());
    for (name, value) in entries {
        put_text(name, out);
        let (kind, bytes) = match value {
            Meta::Text(s) => ("string", s.as_bytes().to_vec()),
            Meta::Bool(b) => ("bool", vec![u8::from(*b)]),
            Meta::Int64(n) => ("int64", n.to_le_bytes().to_vec()),
            Meta::Vec3i(v) => (
                "vec3i",
                v.to_array().iter().flat_map(|x| x.to_le_bytes()).collect(),
            ),
        };
        put_text(kind, out);
        out.extend((bytes.len() as u32).to_le_bytes());
        out.extend(bytes);
    }
}

/// One grid with its descriptor, which names places counted from the start of
/// the file, where this grid begins at `at`.
fn encode_grid(g: &Grid, codec: Codec, at: u64) -> Result<Vec<u8>, Error> {
    let half = g.half && !matches!(g.data, Data::Int(_));
    let mut out = Vec::new();
    put_text(&g.name, &mut out);
    let suffix = if half { "_HalfFloat" } else { "" };
    put_text(
        &format!("Tree_{}_5_4_3{suffix}", g.data.type_name()),
        &mut out,
    );
    put_text("", &mut out);
    let offsets = out.len();
    out.extend([0u8; 24]);
    let grid_at = at + out.len() as u64;

    let compression = match codec {
        Codec::Zip => ZIP | ACTIVE_MASK,
        Codec::Raw => ACTIVE_MASK,
    };
    out.extend(compression.to_le_bytes());
    let (low, high) = g.data.active_box().unwrap_or((IVec3::ZERO, IVec3::NEG_ONE));
    let mut metadata = vec![
        ("name", Meta::Text(&g.name)),
        (
            "class",
            Meta::Text(if g.name == "density" {
                "fog volume"
            } else {
                "unknown"
            }),
        ),
        ("file_bbox_min", Meta::Vec3i(low)),
        ("file_bbox_max", Meta::Vec3i(high)),
        (
            "file_voxel_count",
            Meta::Int64(g.data.active_count() as i64),
        ),
    ];
    if let Some((low, high)) = g.extent {
        metadata.push((EXTENT[0], Meta::Vec3i(low)));
        metadata.push((EXTENT[1], Meta::Vec3i(high)));
    }
    if half {
        metadata.push(("is_saved_as_half_float", Meta::Bool(true)));
    }
    if let Data::Vec3(_) = g.data {
        metadata.push(("vector_type", Meta::Text("invariant")));
    }
    put_metadata(&metadata, &mut out);
    put_map(&g.mm_from_cell, &mut out);
    let blocks_at = match &g.data {
        Data::Float(c) => put_tree(c, half, codec, &mut out),
        Data::Vec3(c) => put_tree(c, half, codec, &mut out),
        Data::Int(c) => put_tree(c, half, codec, &mut out),
    }?;
    let ends = [grid_at, at + blocks_at as u64, at + out.len() as u64];
    for (k, place) in ends.into_iter().enumerate() {
        out[offsets + 8 * k..offsets + 8 * k + 8].copy_from_slice(&place.to_le_bytes());
    }
    Ok(out)
}

fn put_map(map: &DAffine3, out: &mut Vec<u8>) {
    let m = map.matrix3;
    let scale = DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z);
    let mut numbers = Vec::new();
    if m == DMat3::from_diagonal(scale) && scale.min_element() > 0.0 {
        let uniform = scale == DVec3::splat(scale.x);
        let name = if uniform {
            "UniformScaleTranslateMap"
        } else {
            "ScaleTranslateMap"
        };
        put_text(name, out);
        let inverse = 1.0 / scale;
        for v in [
            map.translation,
            scale,
            scale,
            inverse,
            inverse * inverse,
            0.5 * inverse,
        ] {
            numbers.extend(v.to_array());
        }
    } else {
        put_text("AffineMap", out);
        // Row vectors: the rows of the file are our columns.
        let rows = [m.x_axis, m.y_axis, m.z_axis, map.translation];
        for (row, last) in rows.into_iter().zip([0.0, 0.0, 0.0, 1.0]) {
            numbers.extend(row.extend(last).to_array());
        }
    }
    numbers.iter().for_each(|x| out.extend(x.to_le_bytes()));
}

/// Slot of a cell's node in a node of edge `EDGES[level]`.
fn slot(cell: IVec3, level: usize) -> usize {
    let across = if level == 1 { 16 } else { 32 };
    let s = (cell & (EDGES[level] - 1)) / EDGES[level - 1];
    ((s.x * across + s.y) * across + s.z) as usize
}

/// Appends topology and values; returns where the values begin.
fn put_tree<T: Value>(
    cells: &Cells<T>,
    half: bool,
    codec: Codec,
    out: &mut Vec<u8>,
) -> Result<usize, Error> {
    if !cells.cubes.is_empty() {
        return Err(Error::format(
            ENDING,
            "cubes of one value cannot be written",
        ));
    }
    let origin = |l: &Leaf<T>, level: usize| l.origin & !(EDGES[level] - 1);
    let order = |l: &Leaf<T>| {
        (
            origin(l, 2).to_array(),
            slot(l.origin, 2),
            slot(l.origin, 1),
        )
    };
    let mut leaves: Vec<&Leaf<T>> = cells.leaves.iter().collect();
    leaves.sort_by_key(|l| order(l));
    let misplaced = |l: &&Leaf<T>| l.origin & 7 != IVec3::ZERO || l.values.len() != 512;
    if leaves.iter().any(misplaced) || leaves.windows(2).any(|w| order(w[0]) == order(w[1])) {
        return Err(Error::format(ENDING, "leaves out of place"));
    }
    out.extend(1u32.to_le_bytes());
    cells.background.put(out);
    out.extend(0u32.to_le_bytes());
    let uppers: Vec<_> = leaves
        .chunk_by(|a, b| origin(a, 2) == origin(b, 2))
        .collect();
    out.extend((uppers.len() as u32).to_le_bytes());
    for upper in uppers {
        let at = origin(upper[0], 2).to_array();
        at.iter().for_each(|x| out.extend(x.to_le_bytes()));
        let lowers: Vec<_> = upper
            .chunk_by(|a, b| origin(a, 1) == origin(b, 1))
            .collect();
        let children = lowers.iter().map(|l| slot(l[0].origin, 2));
        put_node::<T>(children, 32 * 32 * 32, half, codec, out);
        for lower in lowers {
            let children = lower.iter().map(|l| slot(l.origin, 1));
            put_node::<T>(children, 16 * 16 * 16, half, codec, out);
            for leaf in lower {
                leaf.mask.iter().for_each(|m| out.extend(m.to_le_bytes()));
            }
        }
    }
    let blocks_at = out.len();
    for leaf in leaves {
        leaf.mask.iter().for_each(|m| out.extend(m.to_le_bytes()));
        let active = (0..512).filter(|i| leaf.mask[i / 64] >> (i % 64) & 1 == 1);
        let mut raw = Vec::new();
        let mut count = 0;
        for i in active {
            count += 1;
            if half {
                leaf.values[i].put_half(&mut raw)
            } else {
                leaf.values[i].put(&mut raw)
            }
        }
        put_values(&raw, count, half, codec, out);
    }
    Ok(blocks_at)
}

/// An inner node without active cubes.
fn put_node<T: Value>(
    children: impl Iterator<Item = usize>,
    slots: usize,
    half: bool,
    codec: Codec,
    out: &mut Vec<u8>,
) {
    let mut mask = vec![0u8; slots / 8];
    children.for_each(|c| mask[c / 8] |= 1 << (c % 8));
    out.extend(mask);
    out.extend(vec![0u8; slots / 8]);
    put_values(&[], 0, half && T::HALF_WIDTH.is_some(), codec, out);
}

/// A record of active values; all others are background.
fn put_values(raw: &[u8], count: usize, half: bool, codec: Codec, out: &mut Vec<u8>) {
    out.push(0);
    // The format's own exception: no length before no half values.
    if codec == Codec::Raw || (half && count == 0) {
        out.extend(raw);
        return;
    }
    let mut zlib = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing to memory does not fail.
    let packed = zlib.write_all(raw).and_then(|()| zlib.finish());
    let packed = packed.unwrap_or_default();
    if count > 0 && !packed.is_empty() && packed.len() < raw.len() {
        out.extend((packed.len() as i64).to_le_bytes());
        out.extend(packed);
    } else {
        out.extend((-(raw.len() as i64)).to_le_bytes());
        out.extend(raw);
    }
}
