//! Speed against error: every choice there is for a cloth, seen from some
//! distances under some lights, against explicit fibres.

pub mod peer;
pub mod scaling;
pub mod stage;
pub mod trial;
pub mod try_all;
