//! Virtual goniometer, comparison and fitting over a patch of cloth.
