//! Phantoms: grey volumes drawn from fibres, whose answers are therefore known.

use crate::ScanError;
use crate::input::{SampleType, Shape, Slices};
use crate::smooth::{gaussian, smooth_slices};
use glam::{DVec3, IVec3, UVec3, Vec3};
use organza_basis::{Aabb, Budget, PathRng, Segment, SegmentSource};
use rayon::prelude::*;
use std::io::{Seek, Write};
use tiff::TiffError;
use tiff::encoder::colortype::Gray8;
use tiff::encoder::{Compression, DeflateLevel, TiffEncoder};

/// How a phantom looks to the scanner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhantomLook {
    /// Grey value of air.
    pub air: f32,
    /// Grey value of fibre.
    pub fibre: f32,
    /// Deviation of the Gaussian that the scanner blurs with, voxels.
    pub blur: f32,
    /// Deviation of the noise, as a share of the difference of both grey values.
    pub noise: f32,
    /// Seed of the noise.
    pub seed: u64,
}

/// Fibres drawn into voxels.
#[derive(Clone, Debug)]
pub struct Phantom {
    dims: UVec3,
    voxel_mm: f32,
    /// Share of fibre in every voxel.
    fill: Vec<f32>,
    /// Axis of the fibre that fills most of it.
    axes: Vec<Vec3>,
    grey: Vec<f32>,
}

impl Phantom {
    /// Draws the fibres of a source into the voxels of a box; a source that repeats fills the
    /// whole box.
    ///
    /// The share of a voxel that a fibre fills is taken from the distance of its centre to the
    /// axis, as if the outline were straight across the voxel. Of several fibres the one that
    /// fills most counts.
    ///
    /// # Errors
    /// More memory than the budget: 24 bytes a voxel.
    pub fn draw(
        source: &dyn SegmentSource,
        bounds_mm: Aabb,
        voxel_mm: f32,
        budget: &mut Budget,
    ) -> Result<Phantom, ScanError> {
        let size = (bounds_mm.size() / voxel_mm).round();
        if !(size.min_element() >= 1.0 && size.max_element() <= 65535.0) {
            return Err(ScanError::Settings(format!(
                "voxels of {voxel_mm} mm cut the box into {size}; expected 1 to 65535 along each \
                 axis"
            )));
        }
        let dims = size.as_uvec3();
        let count = dims.as_u64vec3().element_product();
        budget.take(count.saturating_mul(24), "voxels")?;
        let mut phantom = Phantom {
            dims,
            voxel_mm,
            fill: vec![0.0; count as usize],
            axes: vec![Vec3::ZERO; count as usize],
            grey: Vec::new(),
        };
        let tile = source.tile();
        let copies = |axis: usize| -> std::ops::RangeInclusive<i32> {
            if !tile.repeats {
                return 0..=0;
            }
            let period = tile.bounds_mm.size()[axis];
            let low = (bounds_mm.min[axis] - tile.bounds_mm.max[axis]) / period;
            let high = (bounds_mm.max[axis] - tile.bounds_mm.min[axis]) / period;
            // Fibres may leave the tile sideways by up to a period.
            low.floor() as i32 - 1..=high.ceil() as i32 + 1
        };
        let period = tile.bounds_mm.size();
        for batch in 0..source.batch_count() {
            source.for_each_in_batch(batch, &mut |s| {
                for j in copies(1) {
                    for i in copies(0) {
                        let shift = Vec3::new(i as f32 * period.x, j as f32 * period.y, 0.0);
                        phantom.add(s, bounds_mm.min - shift);
                    }
                }
            });
        }
        Ok(phantom)
    }

    /// Draws one segment; `origin_mm` is the least corner of the voxels.
    fn add(&mut self, s: &Segment, origin_mm: Vec3) {
        let per_mm = 1.0 / self.voxel_mm;
        let (a, b) = (
            (s.start_mm - origin_mm) * per_mm - 0.5,
            (s.end_mm - origin_mm) * per_mm - 0.5,
        );
        let (r0, r1) = (s.start_radius_mm * per_mm, s.end_radius_mm * per_mm);
        let grown = r0.max(r1) + 1.0;
        let low = (a.min(b) - grown).ceil().as_ivec3().max(IVec3::ZERO);
        let high = (a.max(b) + grown)
            .floor()
            .as_ivec3()
            .min(self.dims.as_ivec3() - 1);
        let along = b - a;
        let length_sq = along.length_squared();
        let axis = along.normalize_or(s.start_tangent);
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let p = Vec3::new(x as f32, y as f32, z as f32) - a;
                    let t = if length_sq > 0.0 {
                        (p.dot(along) / length_sq).clamp(0.0, 1.0)
                    } else {
                        0.0
                    };
                    let away = (p - t * along).length();
                    let fill = (0.5 + r0 + t * (r1 - r0) - away).clamp(0.0, 1.0);
                    let at = UVec3::new(x as u32, y as u32, z as u32);
                    let i = (at.x + self.dims.x * (at.y + self.dims.y * at.z)) as usize;
                    if fill > self.fill[i] {
                        self.fill[i] = fill;
                        self.axes[i] = axis;
                    }
                }
            }
        }
    }

    /// Gives the voxels grey values, with blur and noise.
    pub fn look(&mut self, look: &PhantomLook) {
        let (nx, ny) = (self.dims.x as usize, self.dims.y as usize);
        let (plane, nz) = (nx * ny, self.dims.z as usize);
        let mut blurred = self.fill.clone();
        let kernel = gaussian(look.blur);
        let reach = kernel.len() / 2;
        smooth_slices(&mut blurred, nx, ny, [&kernel, &kernel]);
        self.grey = vec![0.0; self.fill.len()];
        self.grey
            .par_chunks_mut(plane)
            .enumerate()
            .for_each(|(z, out)| {
                for (k, w) in kernel.iter().enumerate() {
                    let from = (z + k).saturating_sub(reach).min(nz - 1);
                    for (o, v) in out.iter_mut().zip(&blurred[from * plane..][..plane]) {
                        *o += w * v;
                    }
                }
                let mut rng = PathRng::new(look.seed, 1, z as u64);
                for o in out {
                    let noisy = *o + look.noise * rng.normal2().x;
                    *o = look.air + (look.fibre - look.air) * noisy;
                }
            });
    }

    /// Voxels along each axis.
    pub fn dims(&self) -> UVec3 {
        self.dims
    }

    /// Share of fibre in a voxel, and the axis there: zero without fibre.
    pub fn truth(&self, cell: UVec3) -> (f32, Vec3) {
        let i = (cell.x + self.dims.x * (cell.y + self.dims.y * cell.z)) as usize;
        (self.fill[i], self.axes[i])
    }
}

/// Writes grey values as the pages of a TIFF of 8 bits, packed; values are rounded and limited to
/// 0 to 255.
///
/// # Errors
/// Those of the slices and of writing.
pub fn write_tiff(slices: &mut dyn Slices, out: impl Write + Seek) -> Result<(), ScanError> {
    let failed = |e: TiffError| match e {
        TiffError::IoError(e) => ScanError::Io(e),
        e => ScanError::Settings(e.to_string()),
    };
    let dims = slices.shape().dims;
    let mut values = vec![0.0; slices.shape().slice_len()];
    let encoder = TiffEncoder::new(out).map_err(failed)?;
    let mut encoder = encoder.with_compression(Compression::Deflate(DeflateLevel::Best));
    for z in 0..dims.z {
        slices.read(z, &mut values)?;
        let bytes: Vec<u8> = values.iter().map(|v| (v + 0.5) as u8).collect();
        encoder
            .write_image::<Gray8>(dims.x, dims.y, &bytes)
            .map_err(failed)?;
    }
    Ok(())
}

impl Slices for Phantom {
    fn shape(&self) -> Shape {
        Shape {
            dims: self.dims,
            sample: SampleType::F32,
            spacing: Some(DVec3::splat(self.voxel_mm.into())),
        }
    }

    fn read(&mut self, slice: u32, out: &mut [f32]) -> Result<(), ScanError> {
        let start = slice as usize * out.len();
        let own = self.grey.get(start..start + out.len());
        let own = own.ok_or_else(|| ScanError::Settings("the phantom has no look yet".into()))?;
        out.copy_from_slice(own);
        Ok(())
    }
}
