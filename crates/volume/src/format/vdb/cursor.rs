//! Numbers and texts of a file, one after another.

use super::read::{Problem, wrong};
use glam::{DVec3, IVec3};

/// A position in the file that never passes its end.
pub struct Cursor<'a> {
    /// The file.
    pub bytes: &'a [u8],
    /// Where the next byte is.
    pub at: usize,
}

impl<'a> Cursor<'a> {
    pub fn take(&mut self, length: usize) -> Result<&'a [u8], Problem> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let taken = rest.get(..length);
        self.at = self.at.saturating_add(length);
        taken.ok_or_else(|| wrong(format!("it is cut off ({length} bytes missing at its end)")))
    }

    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], Problem> {
        let mut a = [0; N];
        a.copy_from_slice(self.take(N)?);
        Ok(a)
    }

    pub fn u32(&mut self) -> Result<u32, Problem> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub fn u64(&mut self) -> Result<u64, Problem> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub fn f64(&mut self) -> Result<f64, Problem> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    pub fn text(&mut self) -> Result<String, Problem> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }

    pub fn triple(&mut self) -> Result<DVec3, Problem> {
        Ok(DVec3::new(self.f64()?, self.f64()?, self.f64()?))
    }

    /// A place in the file.
    pub fn place(&mut self) -> Result<usize, Problem> {
        let at = usize::try_from(self.u64()?).unwrap_or(usize::MAX);
        if at > self.bytes.len() {
            return Err(wrong("it is cut off (it names a place beyond its end)"));
        }
        Ok(at)
    }

    /// The least cell of a node of this edge, far enough from the ends of the
    /// lattice to count with.
    pub fn cell(&mut self, edge: i32) -> Result<IVec3, Problem> {
        let mut c = [0; 3];
        for x in &mut c {
            *x = i32::from_le_bytes(self.array()?);
        }
        let cell = IVec3::from_array(c);
        let near = -(1 << 30)..1 << 30;
        let within = near.contains(&cell.min_element()) && near.contains(&cell.max_element());
        if cell & (edge - 1) != IVec3::ZERO || !within {
            return Err(wrong(format!("a node begins at cell {cell}")));
        }
        Ok(cell)
    }
}
