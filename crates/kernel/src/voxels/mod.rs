//! Matter in voxels: micro-flakes and virtual fibres, laid out flat, and the walk
//! of lanes through them.

pub mod aim;
pub mod blocks;
mod borders;
pub mod camera_rays;
pub mod diffuse_flakes;
pub mod environment;
#[cfg(test)]
mod environment_tests;
pub mod even_fibres;
pub mod event;
pub mod event_weights;
pub mod fibre_tables;
pub mod flake_tables;
pub mod flat_medium;
pub mod flat_scene;
pub mod lane_work;
pub mod layout;
pub mod light_groups;
pub mod lone_flakes;
#[cfg(test)]
mod matter_tests;
pub mod mirrors;
pub mod optical_depth_table;
pub mod panel;
mod placed_light;
pub mod population_tables;
pub mod reach;
pub mod scattering;
pub mod seen_tangent;
pub mod shadow_ray;
#[cfg(test)]
mod virtual_fibre_tests;
pub mod virtual_fibres;
mod voxel_walk;
pub mod voxel_words;
pub mod walk;
