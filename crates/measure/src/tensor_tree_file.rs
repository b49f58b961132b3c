//! XML files with a BSDF as a tensor tree, in the schema of WINDOW that Radiance reads
//! [Ward2012].
//!
//! A tree is text. `{ v }` is one value for a whole block, `{ v v v ... }` all the cells of a
//! block, the last dimension fastest, and `{ {} {} ... }` its halves along every dimension,
//! the first dimension fastest. Colour is written as Radiance reads it of trees: `Visible` (Y)
//! and the chromaticities `CIE-u` and `CIE-v`, those of equal energy for a neutral value.

use crate::klems_file::XYZ_FROM_RGB;
use crate::{TensorTree, TreeCell, TreeLayout};
use glam::DVec3;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};
use std::io::{Result, Write};

/// Bands of a file.
const BANDS: [&str; 3] = ["Visible", "CIE-u", "CIE-v"];

/// Blocks are joined if the differences of their halves are at most this many times what the
/// noise of the measurement explains. For sixteen halves, noise alone is below it in 99 of 100
/// blocks.
const NOISE_ALLOWANCE: f64 = 2.0;

/// A block of cells.
enum TreeBlock {
    /// A single cell, or cells that are joined: their mean.
    Joined(DVec3),
    /// All cells below are written.
    Full,
    /// Its halves along every dimension, the first dimension fastest.
    Halves(Vec<TreeBlock>),
}

/// Mean and variance of the mean of a block.
#[derive(Clone, Copy)]
struct Level {
    mean: DVec3,
    variance: f64,
}

/// One matrix as a tree.
struct Matrix<'a> {
    layout: TreeLayout,
    cells: &'a [TreeCell],
    /// Largest standard deviation of joined cells, as a share of their mean; `None` joins none.
    tolerance: Option<f64>,
}

impl Matrix<'_> {
    /// The cell at a place. The unused half of the first dimension of rank 3 is black.
    fn cell(&self, place: [usize; 4]) -> TreeCell {
        let n = self.layout.side();
        let [incident, exitant] = match self.layout.dimensions() {
            3 => [place[0], place[1] * n + place[2]],
            _ => [place[0] * n + place[1], place[2] * n + place[3]],
        };
        let index = incident * self.layout.exitant_cells() + exitant;
        self.cells.get(index).copied().unwrap_or_default()
    }

    /// The place of one of the halves of a block.
    fn half(&self, place: [usize; 4], size: usize, number: usize) -> [usize; 4] {
        std::array::from_fn(|d| place[d] + if number >> d & 1 == 1 { size / 2 } else { 0 })
    }

    /// The block of `size` cells along every dimension from a place on.
    fn block(&self, place: [usize; 4], size: usize) -> (TreeBlock, Level) {
        if size == 1 {
            let cell = self.cell(place);
            let mean = DVec3::from_array(cell.mean.map(f64::from));
            let variance = f64::from(cell.variance);
            return (TreeBlock::Joined(mean), Level { mean, variance });
        }
        let halves = 1 << self.layout.dimensions();
        let (blocks, levels): (Vec<TreeBlock>, Vec<Level>) = (0..halves)
            .map(|number| self.block(self.half(place, size, number), size / 2))
            .unzip();
        let count = halves as f64;
        let level = Level {
            mean: levels.iter().map(|l| l.mean).sum::<DVec3>() / count,
            variance: levels.iter().map(|l| l.variance).sum::<f64>() / (count * count),
        };
        let joined = blocks.iter().all(|b| matches!(b, TreeBlock::Joined(_)));
        if joined && self.is_even(&levels, &level) {
            return (TreeBlock::Joined(level.mean), level);
        }
        let is_full = |b: &TreeBlock| matches!(b, TreeBlock::Full) || size == 2;
        if blocks.iter().all(is_full) {
            return (TreeBlock::Full, level);
        }
        (TreeBlock::Halves(blocks), level)
    }

    /// Whether halves differ by no more than the tolerance and the noise.
    fn is_even(&self, halves: &[Level], whole: &Level) -> bool {
        let Some(tolerance) = self.tolerance else {
            return false;
        };
        let grey = |v: DVec3| v.element_sum() / 3.0;
        let mean = grey(whole.mean);
        let apart = |l: &Level| (grey(l.mean) - mean).powi(2);
        let spread: f64 = halves.iter().map(apart).sum();
        let noise: f64 = halves.iter().map(|l| l.variance).sum();
        let allowed = halves.len() as f64 * (tolerance * mean).powi(2);
        spread <= allowed + NOISE_ALLOWANCE * noise
    }

    /// How many values a block of `size` cells along every dimension has in the file.
    fn values(&self, block: &TreeBlock, size: usize) -> usize {
        match block {
            TreeBlock::Joined(_) => 1,
            TreeBlock::Full => size.pow(self.layout.dimensions() as u32),
            TreeBlock::Halves(blocks) => blocks.iter().map(|b| self.values(b, size / 2)).sum(),
        }
    }

    fn write(
        &self,
        block: &TreeBlock,
        at: ([usize; 4], usize),
        band: usize,
        out: &mut dyn Write,
    ) -> Result<()> {
        let (place, size) = at;
        match block {
            TreeBlock::Joined(mean) => writeln!(out, "{{ {:.4e} }}", value(*mean, band)),
            TreeBlock::Full => {
                writeln!(out, "{{")?;
                let d = self.layout.dimensions();
                for index in 0..size.pow(d as u32) {
                    let digit = |k: usize| index / size.pow((d - 1 - k) as u32) % size;
                    let within = |k: usize| if k < d { place[k] + digit(k) } else { 0 };
                    let cell = self.cell(std::array::from_fn(within));
                    let mean = DVec3::from_array(cell.mean.map(f64::from));
                    let end = if index % size == size - 1 { '\n' } else { ' ' };
                    write!(out, "{:.4e}{end}", value(mean, band))?;
                }
                writeln!(out, "}}")
            }
            TreeBlock::Halves(blocks) => {
                writeln!(out, "{{")?;
                for (number, half) in blocks.iter().enumerate() {
                    let at = (self.half(place, size, number), size / 2);
                    self.write(half, at, band, out)?;
                }
                writeln!(out, "}}")
            }
        }
    }
}

/// A colour in a band of the file.
fn value(rgb: DVec3, band: usize) -> f64 {
    let xyz = (XYZ_FROM_RGB * rgb).max(DVec3::ZERO);
    // Black is written as neutral.
    let xyz_of_hue = if xyz.y > 0.0 { xyz } else { DVec3::ONE };
    let weight = xyz_of_hue.x + 15.0 * xyz_of_hue.y + 3.0 * xyz_of_hue.z;
    match band {
        0 => xyz.y,
        1 => 4.0 * xyz_of_hue.x / weight,
        _ => 9.0 * xyz_of_hue.y / weight,
    }
}

/// Writes a file. `name` is the name of the cloth. With a `tolerance`, neighbouring cells
/// are joined whose standard deviation is at most this share of their mean, beside what the
/// noise of the measurement explains. Returns the number of values written for every cell of
/// the full tree, at most one.
///
/// # Errors
/// Those of the writer.
pub fn write_tensor_tree(
    tree: &TensorTree,
    name: &str,
    tolerance: Option<f64>,
    out: &mut dyn Write,
) -> Result<f64> {
    let layout = tree.layout;
    let (mut kept, mut cells_in_all) = (0, 0);
    let mut xml = Writer::new_with_indent(out, b' ', 1);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let structure = format!("TensorTree{}", layout.dimensions());
    let parts = [
        ("Transmission Front", "BTDF", &tree.transmission[0]),
        ("Transmission Back", "BTDF", &tree.transmission[1]),
        ("Reflection Front", "BRDF", &tree.reflection[0]),
        ("Reflection Back", "BRDF", &tree.reflection[1]),
    ];
    let root = xml
        .create_element("WindowElement")
        .with_attribute(("xmlns", "http://windows.lbl.gov"));
    root.write_inner_content(|xml| {
        text(xml, "WindowElementType", "System")?;
        let optical = xml.create_element("Optical");
        optical.write_inner_content(|xml| {
            let layer = xml.create_element("Layer");
            layer.write_inner_content(|xml| {
                let material = xml.create_element("Material");
                material.write_inner_content(|xml| {
                    text(xml, "Name", name)?;
                    text(xml, "Manufacturer", "organza")?;
                    text(xml, "DeviceType", "Other")
                })?;
                let definition = xml.create_element("DataDefinition");
                definition
                    .write_inner_content(|xml| text(xml, "IncidentDataStructure", &structure))?;
                for (direction, kind, cells) in parts {
                    let matrix = Matrix {
                        layout,
                        cells,
                        tolerance,
                    };
                    let root = ([0; 4], layout.side());
                    let (block, _) = matrix.block(root.0, root.1);
                    kept += matrix.values(&block, layout.side());
                    cells_in_all += layout.side().pow(layout.dimensions() as u32);
                    for (band, band_name) in BANDS.iter().enumerate() {
                        write_band(xml, (direction, kind), band_name, |out| {
                            matrix.write(&block, root, band, out)
                        })?;
                    }
                }
                Ok(())
            })?;
            Ok(())
        })?;
        Ok(())
    })?;
    writeln!(xml.get_mut())?;
    Ok(kept as f64 / cells_in_all.max(1) as f64)
}

/// One matrix in one band.
fn write_band(
    xml: &mut Writer<&mut dyn Write>,
    (direction, kind): (&str, &str),
    band: &str,
    values: impl FnOnce(&mut dyn Write) -> Result<()>,
) -> Result<()> {
    let data = xml.create_element("WavelengthData");
    data.write_inner_content(|xml| {
        text(xml, "LayerNumber", "System")?;
        let wavelength = xml.create_element("Wavelength");
        let wavelength = wavelength.with_attribute(("unit", "Integral"));
        wavelength.write_text_content(BytesText::new(band))?;
        text(xml, "SourceSpectrum", "CIE Illuminant D65 1nm.ssp")?;
        text(xml, "DetectorSpectrum", "ASTM E308 1931 Y.dsp")?;
        let block = xml.create_element("WavelengthDataBlock");
        block.write_inner_content(|xml| {
            text(xml, "WavelengthDataDirection", direction)?;
            text(xml, "AngleBasis", "LBNL/Shirley-Chiu")?;
            text(xml, "ScatteringDataType", kind)?;
            let data = xml.create_element("ScatteringData");
            data.write_inner_content(|xml| {
                writeln!(xml.get_mut())?;
                values(xml.get_mut())
            })?;
            Ok(())
        })?;
        Ok(())
    })?;
    Ok(())
}

fn text(xml: &mut Writer<&mut dyn Write>, name: &str, content: &str) -> Result<()> {
    let element = xml.create_element(name);
    element.write_text_content(BytesText::new(content))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of white: the file's white has equal X, Y and Z. Red has the chromaticity that
    /// its column of the matrix gives.
    #[test]
    fn colours_have_their_chromaticity() {
        let of = |rgb: DVec3| [0, 1, 2].map(|band| value(rgb, band));
        let is_near = |found: [f64; 3], expected: [f64; 3]| {
            let mut pairs = found.into_iter().zip(expected);
            let near = pairs.all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(near, "{found:?} {expected:?}");
        };
        is_near(of(DVec3::splat(0.5)), [0.5, 4.0 / 19.0, 9.0 / 19.0]);
        is_near(of(DVec3::ZERO), [0.0, 4.0 / 19.0, 9.0 / 19.0]);
        let (x, y, z) = (0.433_887, 0.212_639, 0.017_750);
        let weight = x + 15.0 * y + 3.0 * z;
        is_near(of(DVec3::X), [y, 4.0 * x / weight, 9.0 * y / weight]);
    }
}
