//! What `organza measure` measures: the directions that its flags name.

use super::{MeasureArgs, ends_in, ptm, rgl, tensor_tree};
use crate::error::{InputError, after_option, input, of_option};
use anyhow::Result;
use organza_measure::{
    AdaptiveGrid, Angles, KlemsBasis, LampPosition, Pair, TexelGrid, TreeLayout, grid_directions,
    grid_layout, irawan_incident, irawan_layout, lamp_positions, parse_incident, parse_pairs,
};
use organza_scene::file_kind::Wanted as FileKind;
use organza_scene::memory::free_memory_bytes;
use std::ops::Range;

/// Layouts of directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum LayoutName {
    /// 225 incident directions out to 75 degrees times 7 exitant ones
    Irawan,
    /// A regular grid of directions, see --grid
    Grid,
    /// The four matrices of the Klems basis, one path for all exitant directions
    Klems,
    /// The four matrices of a tensor tree for Radiance, see --tree-depth
    TensorTree,
    /// Reflection in the tensor format of the RGL material database, for Mitsuba, see --rgl-grid
    Rgl,
    /// A polynomial texture map: how every texel changes with the direction of the light, see --ptm-lamps
    Ptm,
    /// A linear light swung over face and back, seen along the normal
    Sweep,
    /// What a shade before a window is sold by, and its classes of visual comfort by EN 14501:2005
    En14501,
}

/// Klems bases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum KlemsBasisName {
    /// 145 patches a side
    Full,
    /// 73
    Half,
    /// 41
    Quarter,
}

impl From<KlemsBasisName> for KlemsBasis {
    fn from(name: KlemsBasisName) -> KlemsBasis {
        match name {
            KlemsBasisName::Full => KlemsBasis::Full,
            KlemsBasisName::Half => KlemsBasis::Half,
            KlemsBasisName::Quarter => KlemsBasis::Quarter,
        }
    }
}

/// What a value takes while it is measured, and as JSON; upper bounds, measured.
const BYTES_OF_VALUE: u64 = 512;
const BYTES_OF_JSON: u64 = 5120;

/// What to measure.
pub enum Wanted {
    /// The BSDF of pairs of directions.
    Pairs(Vec<Pair>),
    /// Where the light of these directions goes.
    Incident(Vec<Angles>),
    /// A picture of the tile for each pair.
    Textures(Vec<Pair>),
    /// The matrices of a basis.
    Klems(KlemsBasis),
    /// The matrices of a tensor tree.
    TensorTree(TreeLayout),
    /// Reflection over an adaptive parameterisation.
    Rgl(AdaptiveGrid),
    /// A polynomial texture map from so many lamps.
    Ptm(u32),
    /// A lamp swung over face and back.
    Sweep(Vec<LampPosition>),
    /// The figures of a shade.
    Shade,
}

impl Wanted {
    /// How many rows the table has: pairs, incident directions or positions of a lamp.
    fn len(&self) -> usize {
        match self {
            Wanted::Pairs(list) | Wanted::Textures(list) => list.len(),
            Wanted::Incident(list) => list.len(),
            Wanted::Klems(basis) => 2 * basis.len(),
            Wanted::TensorTree(layout) => 2 * layout.incident_cells(),
            Wanted::Rgl(grid) => grid.incident_count(),
            Wanted::Ptm(lamps) => *lamps as usize,
            Wanted::Sweep(list) => list.len(),
            // A beam and diffuse light, on both sides.
            Wanted::Shade => 4,
        }
    }

    /// The rows to measure: those asked for, or all.
    ///
    /// # Errors
    /// Rows that the table does not have, or a measurement that is no table of rows.
    pub fn rows(&self, asked: Option<&Range<usize>>) -> Result<Range<usize>> {
        let count = self.len();
        let Some(rows) = asked else {
            return Ok(0..count);
        };
        let fail = |why: String| {
            Err(after_option(
                "rows",
                format!("{}..{}: {why}", rows.start, rows.end),
            ))
        };
        match self {
            Wanted::Pairs(_) | Wanted::Incident(_) if rows.end <= count => Ok(rows.clone()),
            Wanted::Pairs(_) | Wanted::Incident(_) => fail(format!(
                "the table has {count} rows; expected rows within 0..{count}"
            )),
            Wanted::Textures(_) => fail("pictures of the tile are measured all at once".into()),
            Wanted::Klems(_)
            | Wanted::TensorTree(_)
            | Wanted::Rgl(_)
            | Wanted::Ptm(_)
            | Wanted::Sweep(_)
            | Wanted::Shade => {
                fail("this layout is measured all at once; take irawan, grid or --pairs".into())
            }
        }
    }
}

/// What the flags ask for.
///
/// # Errors
/// Flags that contradict each other, or a wrong file of pairs.
pub fn wanted(args: &MeasureArgs) -> Result<Wanted> {
    let layout = args.layout.unwrap_or(LayoutName::Irawan);
    let is_xml = [LayoutName::Klems, LayoutName::TensorTree].contains(&layout);
    if ends_in(args, "bsdf") && (args.pairs.is_some() || layout != LayoutName::Rgl) {
        return Err(input("a table that ends in .bsdf needs --layout rgl"));
    }
    if ends_in(args, "ptm") && (args.pairs.is_some() || layout != LayoutName::Ptm) {
        return Err(input("a table that ends in .ptm needs --layout ptm"));
    }
    if ends_in(args, "xml") && (args.pairs.is_some() || !is_xml) {
        return Err(input(
            "a table that ends in .xml needs --layout klems or --layout tensor-tree",
        ));
    }
    if let Some(path) = &args.pairs {
        let text = args.common.host.loader().text_of(path, FileKind::Text)?;
        let parsed = if args.albedo {
            parse_incident(&text).map(Wanted::Incident)
        } else {
            parse_pairs(&text).map(Wanted::Pairs)
        };
        let wanted = parsed.map_err(|e| InputError::from(e).in_file(path))?;
        return Ok(as_textures(args, wanted));
    }
    let [polar, azimuths] = args.grid;
    check_count(args, layout)?;
    let wanted = match (layout, args.albedo) {
        (LayoutName::Irawan, false) => Wanted::Pairs(irawan_layout()),
        (LayoutName::Irawan, true) => Wanted::Incident(irawan_incident()),
        (LayoutName::Grid, false) => Wanted::Pairs(grid_layout(polar, azimuths)),
        (LayoutName::Grid, true) => Wanted::Incident(grid_directions(polar, azimuths, true)),
        (LayoutName::Klems, false) => Wanted::Klems(args.klems_basis.into()),
        (LayoutName::Sweep, false) => Wanted::Sweep(lamp_positions(args.step)),
        (LayoutName::TensorTree, false) => Wanted::TensorTree(tensor_tree::wanted(args)?),
        (LayoutName::Rgl, false) => Wanted::Rgl(rgl::wanted(args)?),
        (LayoutName::Ptm, false) => Wanted::Ptm(ptm::wanted(args)?),
        (LayoutName::En14501, false) => Wanted::Shade,
        (_, true) => {
            return Err(after_option(
                "albedo",
                "goes with pairs, not with this layout",
            ));
        }
    };
    Ok(as_textures(args, wanted))
}

fn as_textures(args: &MeasureArgs, wanted: Wanted) -> Wanted {
    match wanted {
        Wanted::Pairs(pairs) if ends_in(args, "exr") => Wanted::Textures(pairs),
        other => other,
    }
}

/// Refuses layouts of more directions than fit into memory.
fn check_count(args: &MeasureArgs, layout: LayoutName) -> Result<()> {
    let directions = u64::from(args.grid[0]) * u64::from(args.grid[1]);
    let (flag, count) = match layout {
        LayoutName::Grid if args.albedo => ("--grid", 2 * directions),
        LayoutName::Grid => ("--grid", (2 * directions).saturating_mul(directions)),
        LayoutName::Sweep => ("--step", (4.0 * (2.0 * 75.0 / args.step + 1.0)) as u64),
        _ => return Ok(()),
    };
    let each = if args.json || ends_in(args, "json") {
        BYTES_OF_JSON
    } else {
        BYTES_OF_VALUE
    };
    let needed = count.saturating_mul(each);
    let most = args.memory.max_memory.unwrap_or_else(free_memory_bytes);
    if needed > most {
        return Err(of_option(
            flag,
            format!("{count} values need {needed} bytes of memory, {most} are allowed: take fewer"),
        ));
    }
    Ok(())
}

/// Refuses a table that does not fit into memory; `flag` sets its size.
pub fn check_table_memory(args: &MeasureArgs, flag: &str, needed: u64) -> Result<()> {
    let most = args.memory.max_memory.unwrap_or_else(free_memory_bytes);
    if needed > most {
        return Err(of_option(
            flag,
            format!("the table needs {needed} bytes of memory, {most} are allowed: take fewer"),
        ));
    }
    Ok(())
}

/// Refuses pictures that do not fit into memory: six numbers a texel, held
/// twice when they are written.
pub fn check_texture_memory(args: &MeasureArgs, pairs: u64, grid: &TexelGrid) -> Result<()> {
    let texels = grid.texels.as_u64vec2().element_product();
    let needed = texels.saturating_mul(2 * 6 * 4).saturating_mul(pairs);
    let most = args.memory.max_memory.unwrap_or_else(free_memory_bytes);
    if needed > most {
        return Err(after_option(
            "texels",
            format!(
                "{}: {pairs} pictures of {} x {} texels need {needed} bytes of memory, {most} are \
                 allowed: take fewer texels or fewer pairs",
                args.texels, grid.texels.x, grid.texels.y
            ),
        ));
    }
    Ok(())
}
