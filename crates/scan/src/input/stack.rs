//! Stacks of files, one slice each.

use super::{Shape, Slices};
use crate::ScanError;
use glam::UVec3;
use organza_basis::Budget;
use std::cmp::Ordering;

/// Opens the `i`-th file of a stack.
pub type OpenSlice<'a> =
    Box<dyn FnMut(usize, &mut Budget) -> Result<Box<dyn Slices>, ScanError> + Send + 'a>;

/// Files of one slice each, which are opened one at a time.
pub struct Stack<'a> {
    names: Vec<String>,
    open: OpenSlice<'a>,
    shape: Shape,
    left: Budget,
}

impl<'a> Stack<'a> {
    /// The stack of the named files, in their order. The files after the first are checked
    /// when they are read.
    ///
    /// # Errors
    /// No file, a first file that cannot be opened or has several slices.
    pub fn new(
        names: Vec<String>,
        mut open: OpenSlice<'a>,
        budget: &mut Budget,
    ) -> Result<Stack<'a>, ScanError> {
        let Some(first) = names.first() else {
            return Err(ScanError::Settings("there is no slice".into()));
        };
        let names_bytes = names.iter().map(|n| n.len() as u64 + 24).sum();
        budget.take(names_bytes, "names of slices")?;
        // What one file takes is free again when the next is opened.
        let before = budget.left();
        let opened = open(0, budget).map_err(|e| in_file(first, e))?;
        budget.give_back(before - budget.left());
        let own = opened.shape();
        drop(opened);
        if own.dims.z != 1 {
            let problem = format!(
                "holds {} slices; expected one in each of {} files",
                own.dims.z,
                names.len()
            );
            return Err(in_file(first, ScanError::Settings(problem)));
        }
        let count = super::checked_dims(
            "stack",
            [own.dims.x.into(), own.dims.y.into(), names.len() as u64],
        )?;
        let left = Budget::new(budget.left());
        Ok(Stack {
            names,
            open,
            shape: Shape { dims: count, ..own },
            left,
        })
    }
}

impl Slices for Stack<'_> {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn read(&mut self, slice: u32, out: &mut [f32]) -> Result<(), ScanError> {
        let index = slice as usize;
        let name = &self.names[index];
        let mut budget = self.left.clone();
        let mut file = (self.open)(index, &mut budget).map_err(|e| in_file(name, e))?;
        let (own, first) = (file.shape(), self.shape);
        let expected = UVec3::new(first.dims.x, first.dims.y, 1);
        if own.dims != expected || own.sample != first.sample {
            let problem = format!(
                "is {} x {} x {} of {}; the first slice, {}, is {} x {} of {}",
                own.dims.x,
                own.dims.y,
                own.dims.z,
                own.sample.name(),
                self.names[0],
                expected.x,
                expected.y,
                first.sample.name()
            );
            return Err(in_file(name, ScanError::Settings(problem)));
        }
        file.read(0, out).map_err(|e| in_file(name, e))
    }
}

fn in_file(name: &str, problem: ScanError) -> ScanError {
    ScanError::InStack {
        name: name.to_owned(),
        problem: Box::new(problem),
    }
}

/// The order of slices by their names: numbers in names count as numbers, so that `s10` follows
/// `s9`.
pub fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a, b);
    loop {
        let (number_a, rest_a) = leading_number(a);
        let (number_b, rest_b) = leading_number(b);
        if !number_a.is_empty() && !number_b.is_empty() {
            let bare = |n: &'_ str| n.trim_start_matches('0').to_owned();
            let (x, y) = (bare(number_a), bare(number_b));
            let order = x.len().cmp(&y.len()).then(x.cmp(&y));
            // Leading zeros decide only between names that are else equal.
            let order = order.then_with(|| match rest_a == rest_b {
                true => number_a.len().cmp(&number_b.len()),
                false => Ordering::Equal,
            });
            if order != Ordering::Equal {
                return order;
            }
            (a, b) = (rest_a, rest_b);
            continue;
        }
        let (mut x, mut y) = (a.chars(), b.chars());
        match (x.next(), y.next()) {
            (None, None) => return Ordering::Equal,
            (p, q) if p != q => return p.cmp(&q),
            _ => (a, b) = (x.as_str(), y.as_str()),
        }
    }
}

/// The digits that a text begins with, and what follows.
fn leading_number(text: &str) -> (&str, &str) {
    let end = text
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(text.len());
    text.split_at(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_are_ordered_by_their_numbers() {
        let mut names = vec!["s10.tif", "s9.tif", "s010.tif", "s1b.tif", "s1.tif", "r99"];
        names.sort_by(|a, b| natural_order(a, b));
        let want = ["r99", "s1.tif", "s1b.tif", "s9.tif", "s10.tif", "s010.tif"];
        assert_eq!(names, want);
    }
}
