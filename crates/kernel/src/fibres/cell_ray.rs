//! A ray on its way from cell to cell.

use super::block::{BLOCK, RayLanes};
use super::body::Body;
use super::cells::Cells;
use super::grid::{Grid, GridPoint};
use super::joint_table::JointTable;
use super::matter::FibreMatter;
use glam::{IVec2, IVec3, Vec3};
use organza_basis::MAX_PERIODS;
use organza_lanes::Floats;
use organza_lanes::math::V3;

/// Directions have no smaller component than this, so that dividing by it gives
/// a number.
const MIN_COMPONENT: f32 = 1e-12;

/// Where a ray is, and where it goes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct CellRay {
    /// From the centre of its cell, mm.
    pub(super) at: [f32; 3],
    pub(super) direction: [f32; 3],
    per_direction: [f32; 3],
    /// Way since its start, mm.
    pub(super) gone_mm: f32,
    /// Where it ends, mm from its start.
    end_mm: f32,
    /// It meets nothing up to this distance from its start.
    min_mm: f32,
    pub(super) cell: [i32; 3],
    pub(super) period: [i32; 2],
    cells_left: u32,
    /// The body whose cells it goes through.
    body: u16,
}

/// What a ray meets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellHit {
    pub piece: u32,
    /// From the ray's start, mm.
    pub distance_mm: f32,
    /// The point of the axis nearest to where it is met, from the centre of the
    /// cell, and from there to the surface.
    pub axis_at_mm: Vec3,
    pub out_mm: Vec3,
    /// From the mitre before the piece's first joint to there, along the axis.
    pub along_mm: f32,
    pub cell: IVec3,
    pub period: IVec2,
}

/// What a cell had for a ray.
pub enum Visit {
    Met(CellHit),
    /// The ray is in the next cell.
    Onward,
    /// It has left the grid, or has come to its end.
    Left,
}

impl CellRay {
    /// Nowhere.
    pub fn none() -> CellRay {
        CellRay {
            at: [0.0; 3],
            direction: [0.0, 0.0, 1.0],
            per_direction: [1.0; 3],
            gone_mm: 0.0,
            end_mm: 0.0,
            min_mm: 0.0,
            cell: [0; 3],
            period: [0; 2],
            cells_left: 0,
            body: 0,
        }
    }

    /// From a point along a unit direction: hits lie beyond `min_mm` and not
    /// beyond `end_mm`. `None` when it begins beyond a face of the grid and goes
    /// on away from it.
    #[inline(always)]
    pub fn new(
        grid: &Grid,
        from: &GridPoint,
        direction: Vec3,
        min_mm: f32,
        end_mm: f32,
    ) -> Option<CellRay> {
        let mut cell = from.cell;
        let mut period = from.period;
        let mut at = from.at_mm;
        let size = grid.cell_mm().as_vec3();
        let half = 0.5 * size;
        for axis in 0..3 {
            if at[axis].abs() <= half[axis] {
                continue;
            }
            let cells = ((at[axis] + half[axis]) / size[axis]).floor();
            let mut next = cell[axis] + cells as i32;
            at[axis] -= cells * size[axis];
            if !(0..grid.dims[axis]).contains(&next) {
                if grid.repeats && axis < 2 {
                    period[axis] += next.div_euclid(grid.dims[axis]);
                    next = next.rem_euclid(grid.dims[axis]);
                } else {
                    // A hair beyond the last cell: as if in it.
                    let kept = next.clamp(0, grid.dims[axis] - 1);
                    at[axis] += (next - kept) as f32 * size[axis];
                    if (next > kept) == (direction[axis] >= 0.0) {
                        return None;
                    }
                    next = kept;
                }
            }
            cell[axis] = next;
        }
        let per = |d: f32| {
            if d.abs() > MIN_COMPONENT {
                1.0 / d
            } else {
                (1.0 / MIN_COMPONENT).copysign(d)
            }
        };
        let sum = grid.dims.element_sum() as u32;
        Some(CellRay {
            at: at.to_array(),
            direction: direction.to_array(),
            per_direction: direction.to_array().map(per),
            gone_mm: 0.0,
            end_mm,
            min_mm,
            cell: cell.to_array(),
            period: period.to_array(),
            cells_left: sum.saturating_mul(MAX_PERIODS),
            body: 0,
        })
    }

    /// The same ray through the cells of that body.
    pub fn of(self, body: u16) -> CellRay {
        CellRay { body, ..self }
    }

    /// The body whose cells it goes through.
    #[inline(always)]
    pub fn body<'a>(&self, matter: &'a FibreMatter) -> &'a Body {
        &matter.bodies[usize::from(self.body)]
    }

    /// The direction.
    pub fn direction(&self) -> Vec3 {
        Vec3::from_array(self.direction)
    }

    /// Looks into the ray's cell, and goes on to the next unless something is met
    /// there; `any` stops at whatever is found first. `tests` counts pieces.
    #[inline(always)]
    pub fn visit<F: Floats>(
        &mut self,
        cells: &Cells,
        joints: &JointTable,
        any: bool,
        tests: &mut u64,
    ) -> Visit {
        let grid = &cells.grid;
        let [hx, hy, hz] = cells.half_mm;
        let [dx, dy, dz] = self.direction;
        let [px, py, pz] = self.per_direction;
        let faces = [hx.copysign(dx), hy.copysign(dy), hz.copysign(dz)];
        let x = (faces[0] - self.at[0]) * px;
        let y = (faces[1] - self.at[1]) * py;
        let z = (faces[2] - self.at[2]) * pz;
        let span = x.min(y).min(z).max(0.0);
        let index = grid.index(IVec3::from_array(self.cell));
        let head = cells.heads[index];
        if head.block_count | head.hull_count != 0 {
            let ray = RayLanes {
                at: V3::splat(Vec3::from_array(self.at)),
                direction: V3::splat(Vec3::from_array(self.direction)),
                least: F::splat((self.min_mm - self.gone_mm).max(-cells.lead_mm)),
                most: F::splat(span.min(self.end_mm - self.gone_mm)),
            };
            let count = u64::from(head.block_count) + u64::from(head.hull_count);
            *tests += count * BLOCK as u64;
            let found = match &cells.lists {
                None => self.search_copies(cells, joints, head, ray, any),
                Some(lists) => self.search_lists(cells, lists, joints, ray, any),
            };
            if let Some(hit) = found {
                return Visit::Met(hit);
            }
        }
        self.gone_mm += span;
        self.cells_left -= 1;
        if self.gone_mm >= self.end_mm || self.cells_left == 0 {
            return Visit::Left;
        }
        self.at[0] += span * dx;
        self.at[1] += span * dy;
        self.at[2] += span * dz;
        let axis = if x <= y && x <= z {
            0
        } else if y <= z {
            1
        } else {
            2
        };
        self.at[axis] = -faces[axis];
        let forth = if faces[axis] > 0.0 { 1 } else { -1 };
        let next = self.cell[axis] + forth;
        let count = grid.dims[axis];
        if (next as u32) < count as u32 {
            self.cell[axis] = next;
        } else if grid.repeats && axis < 2 {
            self.cell[axis] = if forth > 0 { 0 } else { count - 1 };
            self.period[axis] += forth;
        } else {
            return Visit::Left;
        }
        cells.prefetch_head(grid.index(IVec3::from_array(self.cell)));
        Visit::Onward
    }

    /// Asks for the head of its cell.
    #[inline(always)]
    pub fn prepare_head(&self, matter: &FibreMatter) {
        let cells = &self.body(matter).cells;
        cells.prefetch_head(cells.grid.index(IVec3::from_array(self.cell)));
    }

    /// Asks for the memory of its cell, whose head has been asked for.
    #[inline(always)]
    pub fn prepare(&self, matter: &FibreMatter) {
        let cells = &self.body(matter).cells;
        let index = cells.grid.index(IVec3::from_array(self.cell));
        cells.prefetch(index);
    }
}
