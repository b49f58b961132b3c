//! A budget of memory, by which every reader of files is bounded.
//!
//! The caller says how many bytes what is read may take. Readers keep one rule:
//! - **Memory**: everything that is kept is charged before it is allocated.
//!   Buffers whose size no file can change are not charged.
//! - **Number of items**: each is charged by its size in memory, so that a count
//!   in a file cannot exceed what the budget pays for.
//! - **Depth**: no reader recurses as deep as a file says.
//! - **Time**: every step either consumes bytes of the file, never the same bytes
//!   twice, or charges the budget.

use std::fmt;

/// Bytes that may be taken, and how many of them were.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Budget {
    allowed: u64,
    taken: u64,
}

/// More bytes were asked for than a [`Budget`] has left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OverBudget {
    /// What the bytes were for, in the plural.
    pub what: &'static str,
    /// Bytes in all, with those that were taken before.
    pub needed: u64,
    /// Bytes in all that are allowed.
    pub allowed: u64,
}

impl fmt::Display for OverBudget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "with its {} it takes {} bytes of memory; {} bytes are allowed",
            self.what, self.needed, self.allowed
        )
    }
}

impl std::error::Error for OverBudget {}

impl Budget {
    /// A budget of this many bytes, none of them taken.
    pub fn new(allowed_bytes: u64) -> Budget {
        Budget {
            allowed: allowed_bytes,
            taken: 0,
        }
    }

    /// Bytes that are left.
    pub fn left(&self) -> u64 {
        self.allowed - self.taken
    }

    /// Takes bytes for `what`, a noun in the plural.
    ///
    /// # Errors
    /// When fewer are left; nothing is taken then.
    pub fn take(&mut self, bytes: u64, what: &'static str) -> Result<(), OverBudget> {
        let needed = self.taken.saturating_add(bytes);
        if needed > self.allowed {
            return Err(OverBudget {
                what,
                needed,
                allowed: self.allowed,
            });
        }
        self.taken = needed;
        Ok(())
    }

    /// Takes the bytes of `count` items of a type.
    ///
    /// # Errors
    /// As [`Budget::take`].
    pub fn take_items<T>(&mut self, count: u64, what: &'static str) -> Result<(), OverBudget> {
        self.take(count.saturating_mul(size_of::<T>() as u64), what)
    }

    /// Gives bytes back that were taken and are free again.
    pub fn give_back(&mut self, bytes: u64) {
        self.taken = self.taken.saturating_sub(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_can_be_taken_and_no_more() {
        let mut budget = Budget::new(100);
        budget.take_items::<u64>(10, "words").unwrap();
        let over = budget.take(21, "bricks").unwrap_err();
        assert_eq!((over.needed, over.allowed), (101, 100));
        assert!(over.to_string().contains("bricks"));
        assert_eq!(budget.left(), 20);
        assert!(budget.take_items::<u64>(u64::MAX, "words").is_err());
        budget.give_back(80);
        budget.take(100, "bricks").unwrap();
        assert_eq!(budget.left(), 0);
    }
}
