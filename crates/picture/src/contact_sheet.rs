//! Several small pictures on one sheet, each above its label.

use crate::{Display, Picture};
use font8x8::UnicodeFonts;
use glam::UVec2;

/// A small picture on a sheet.
#[derive(Clone, Debug)]
pub struct Cell {
    /// What stands below it; characters that the font lacks become `?`, and what is too long
    /// for the cell ends in dots.
    pub label: String,
    /// Its linear colours, at most the sheet's cell in size.
    pub picture: Picture,
    /// How it is shown.
    pub display: Display,
}

/// Space around cells, pixels.
const GAP: u32 = 8;
/// Edge of a character of the font, pixels.
const FONT: u32 = 8;
/// Edge of a cell, pixels, from which labels have twice the size.
const LARGE_CELL: u32 = 384;
/// Background and letters, linear display values.
const PAPER: [f32; 3] = [0.03; 3];
const INK: [f32; 3] = [0.7; 3];

/// Where cells lie on a sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    cell_px: u32,
    columns: u32,
    rows: u32,
}

impl Layout {
    /// The nearest to a square of so many cells, filled row by row. `cell_px` is the edge of
    /// the square in which a picture lies, pixels.
    pub fn new(cells: usize, cell_px: u32) -> Layout {
        let count = u32::try_from(cells).unwrap_or(u32::MAX).max(1);
        let root = count.isqrt();
        let columns = if root * root < count { root + 1 } else { root };
        Layout {
            cell_px,
            columns,
            rows: count.div_ceil(columns),
        }
    }

    /// Pixels of the sheet; saturated where `u32` cannot hold them.
    pub fn size(&self) -> UVec2 {
        let along = |count: u32, edge: u32| count.saturating_mul(edge + GAP).saturating_add(GAP);
        let height = self.cell_px + self.label_px();
        UVec2::new(along(self.columns, self.cell_px), along(self.rows, height))
    }

    /// Height of a label with the space above it, pixels.
    fn label_px(&self) -> u32 {
        FONT * self.letter_scale() + GAP / 2
    }

    fn letter_scale(&self) -> u32 {
        1 + u32::from(self.cell_px >= LARGE_CELL)
    }

    /// The sheet, as linear display values in rows from the top.
    pub fn draw(&self, cells: &[Cell]) -> Vec<[f32; 3]> {
        let size = self.size();
        let mut sheet = Sheet {
            size,
            values: vec![PAPER; size.x as usize * size.y as usize],
        };
        for (i, cell) in (0u32..).zip(cells) {
            let at = UVec2::new(i % self.columns, i / self.columns);
            let step = UVec2::new(self.cell_px, self.cell_px + self.label_px()) + GAP;
            let corner = at * step + GAP;
            let inset = UVec2::splat(self.cell_px).saturating_sub(cell.picture.size) / 2;
            sheet.lay(corner + inset, cell);
            let below = corner + UVec2::new(0, self.cell_px + GAP / 2);
            sheet.write(below, &cell.label, self.letter_scale(), self.cell_px);
        }
        sheet.values
    }
}

struct Sheet {
    size: UVec2,
    values: Vec<[f32; 3]>,
}

impl Sheet {
    fn set(&mut self, at: UVec2, value: [f32; 3]) {
        if at.cmplt(self.size).all() {
            self.values[at.y as usize * self.size.x as usize + at.x as usize] = value;
        }
    }

    fn lay(&mut self, corner: UVec2, cell: &Cell) {
        let width = cell.picture.size.x.max(1);
        for (i, shown) in (0u32..).zip(cell.display.apply(&cell.picture)) {
            self.set(corner + UVec2::new(i % width, i / width), shown);
        }
    }

    /// Writes a line of at most `width` pixels.
    fn write(&mut self, corner: UVec2, text: &str, scale: u32, width: u32) {
        let fits = (width / (FONT * scale)) as usize;
        let mut letters: Vec<char> = text.chars().collect();
        if letters.len() > fits {
            letters.truncate(fits.saturating_sub(2));
            letters.extend(".".repeat(fits.min(2)).chars());
        }
        for (i, letter) in (0u32..).zip(letters) {
            let of = |c| font8x8::BASIC_FONTS.get(c);
            let rows = of(letter).or_else(|| of('?')).unwrap_or_default();
            for (y, x) in (0..FONT * scale).flat_map(|y| (0..FONT * scale).map(move |x| (y, x))) {
                if rows[(y / scale) as usize] >> (x / scale) & 1 == 1 {
                    self.set(corner + UVec2::new(i * FONT * scale + x, y), INK);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::Rgb;

    fn cell(label: &str, grey: f32, size: UVec2) -> Cell {
        Cell {
            label: label.into(),
            picture: Picture::new(size, vec![Rgb::splat(grey); (size.x * size.y) as usize]),
            display: Display::default(),
        }
    }

    #[test]
    fn cells_fill_rows_of_a_sheet_near_a_square() {
        for (cells, columns, rows) in [(1, 1, 1), (2, 2, 1), (4, 2, 2), (5, 3, 2), (12, 4, 3)] {
            let layout = Layout::new(cells, 64);
            assert_eq!((layout.columns, layout.rows), (columns, rows), "{cells}");
            let size = UVec2::new(columns * 72 + 8, rows * (64 + 12 + 8) + 8);
            assert_eq!(layout.size(), size, "{cells}");
        }
        assert_eq!(Layout::new(usize::MAX, 2048).size().x, 65_536 * 2056 + 8);
    }

    #[test]
    fn pictures_lie_in_the_middle_of_their_cells_above_their_labels() {
        let layout = Layout::new(3, 64);
        let cells = [
            cell("a", 0.5, UVec2::splat(64)),
            cell("b", 0.25, UVec2::new(64, 32)),
            cell("much longer than its cell \u{448}", 0.125, UVec2::splat(64)),
        ];
        let size = layout.size();
        let sheet = layout.draw(&cells);
        assert_eq!(sheet.len(), (size.x * size.y) as usize);
        let at = |x: u32, y: u32| sheet[(y * size.x + x) as usize][0];
        assert_eq!((at(8, 8), at(71, 71), at(72, 40)), (0.5, 0.5, PAPER[0]));
        // 16 rows of paper above and below the wide picture.
        let column = [8, 23, 24, 55, 56].map(|y| at(80, y));
        assert_eq!(column, [PAPER[0], PAPER[0], 0.25, 0.25, PAPER[0]]);
        let third = 8 + 84;
        assert_eq!(at(8, third), 0.125);
        // Letters below each cell, and none beyond it or in the empty fourth place.
        let inked = |x0: u32, y0: u32, width: u32| {
            let rows = (y0..y0 + 12).flat_map(|y| (x0..x0 + width).map(move |x| (x, y)));
            rows.filter(|&(x, y)| at(x, y) == INK[0]).count()
        };
        assert!(inked(8, 72, 8) > 8 && inked(16, 72, 56) == 0, "one letter");
        assert!(inked(80, 72, 8) > 8);
        assert!(inked(8, third + 64, 64) > 60 && inked(72, third + 64, 80) == 0);
        let count = |value: f32| sheet.iter().filter(|v| v[0] == value).count();
        assert_eq!((count(0.5), count(0.25), count(0.125)), (4096, 2048, 4096));
    }
}
