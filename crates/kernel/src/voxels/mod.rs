//! Matter in voxels: micro-flakes and virtual fibres, laid out flat, and the walk
//! of lanes through them.

pub mod aim;
pub mod borders;
pub mod environment;
#[cfg(test)]
mod environment_tests;
pub mod event;
pub mod event_weights;
pub mod fibre_tables;
#[cfg(test)]
mod fibre_tests;
pub mod fibres;
pub mod film_rays;
pub mod flakes;
pub mod flat_medium;
pub mod lane_work;
pub mod layout;
#[cfg(test)]
mod matter_tests;
pub mod optical_depth_table;
pub mod panel;
pub mod population_tables;
pub mod reach;
pub mod shadow_ray;
pub mod voxel_words;
pub mod walk;
