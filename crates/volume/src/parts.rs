//! Equal parts of a tile, of which some are needed.

use glam::{IVec3, UVec2, UVec3};

/// A tile of equal parts along x and y. Fibres outside the needed ones are left out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parts {
    count: UVec2,
    /// x fastest.
    is_needed: Vec<bool>,
}

impl Parts {
    /// So many parts, all of them needed.
    pub fn all(count: UVec2) -> Parts {
        Parts {
            count,
            is_needed: vec![true; count.element_product() as usize],
        }
    }

    /// So many parts, of which `needed` are needed.
    pub fn some(count: UVec2, needed: impl Iterator<Item = UVec2>) -> Parts {
        let mut is_needed = vec![false; count.element_product() as usize];
        for part in needed.filter(|part| part.cmplt(count).all()) {
            is_needed[(part.x + count.x * part.y) as usize] = true;
        }
        Parts { count, is_needed }
    }

    /// Parts along x and y.
    pub fn count(&self) -> UVec2 {
        self.count
    }

    /// Whether a needed part of a tile of `dims` voxels holds any voxel from `low` to `high`.
    pub(crate) fn needs(&self, dims: UVec3, low: IVec3, high: IVec3) -> bool {
        let part = (dims.truncate() / self.count).max(UVec2::ONE);
        let of = |voxel: IVec3| {
            let inside = voxel.clamp(IVec3::ZERO, dims.as_ivec3() - 1).as_uvec3();
            (inside.truncate() / part).min(self.count - 1)
        };
        let (first, last) = (of(low), of(high));
        (first.y..=last.y).any(|y| {
            let row = (y * self.count.x) as usize;
            let row = &self.is_needed[row + first.x as usize..=row + last.x as usize];
            row.contains(&true)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_beside_needed_parts_are_left_out() {
        let dims = UVec3::new(12, 8, 4);
        let parts = Parts::some(UVec2::new(3, 2), [UVec2::new(1, 0)].into_iter());
        let needs = |x: [i32; 2], y: [i32; 2]| {
            let corner = |i: usize| IVec3::new(x[i], y[i], 0);
            parts.needs(dims, corner(0), corner(1))
        };
        assert!(needs([4, 4], [0, 0]) && needs([7, 9], [3, 7]) && needs([-5, 20], [-3, 9]));
        assert!(!needs([0, 3], [0, 7]) && !needs([8, 30], [0, 3]) && !needs([0, 11], [4, 7]));
        let all = Parts::all(UVec2::new(3, 2));
        assert!(all.needs(dims, IVec3::ZERO, IVec3::ZERO));
    }
}
