//! The paths of a wave, property by property.

use super::branches::Branches;
use super::cache::Note;
use super::cell_ray::{CellHit, CellRay};
use super::matter::FibreMatter;
use super::trip::{MetFibre, Trip};
use super::work::WAVE;
use crate::packed::volume_ray::VolumeRay;
use glam::{DVec3, IVec2, IVec3, Vec3};
use organza_film::FirstEvent;
use organza_lanes::math::{LaneRng, V3};
use organza_lanes::{Floats, Ints};

/// A number of every slot.
pub type Column = [f32; WAVE];

/// What a path is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// There is nothing left to do in this slot.
    Idle,
    /// On its way.
    Flying,
    /// At a fibre.
    Met,
    /// At a plane.
    MetPlane,
    /// It has left the matter.
    Left,
    /// It ends here.
    Ended,
}

impl State {
    /// Of a path that sets out: on its way where its ray has one.
    pub fn of_ray<R>(ray: &Option<R>) -> State {
        match ray {
            Some(_) => State::Flying,
            None => State::Left,
        }
    }
}

/// The paths of a wave.
pub struct Paths {
    pub state: [State; WAVE],
    pub rays: [CellRay; WAVE],
    /// Slots whose rays are among packed fibres, and those rays.
    pub in_volume: [bool; WAVE],
    /// One a slot, then shadow rays while they are followed.
    pub volume_rays: Vec<VolumeRay>,
    pub rng: [[u32; WAVE]; 3],
    pub direction: [Column; 3],
    pub throughput: [Column; 3],
    pub radiance: [Column; 3],
    /// The part of it that came straight to the camera or by one event.
    pub direct: [Column; 3],
    pub absorbed: [Column; 3],
    pub bounces: [u32; WAVE],
    pub first: [Option<FirstEvent>; WAVE],
    /// From the camera to where the first ray began, mm.
    pub before_mm: [f64; WAVE],
    /// Density with which the direction was drawn; infinite of a camera's.
    pub pdf: Column,
    /// Where it was drawn, in the world: there the density of lights counts.
    pub drawn_at_mm: [Vec3; WAVE],
    /// Where the ray begins, in the world, among lights that have a place: light leaves a
    /// fibre beside where it came in.
    pub sent_from_mm: [DVec3; WAVE],
    pub met: MetColumns,
    /// Where several bodies, draped ones or planes may be met: the ways of all rays.
    pub trips: Vec<Trip>,
    pub branches: Branches,
    /// Fibres met so far.
    pub fibres_met: [u32; WAVE],
    /// Where paths noted places for the cache.
    pub notes: Vec<Vec<Note>>,
}

/// What the paths met.
pub struct MetColumns {
    pub piece: [u32; WAVE],
    pub distance: Column,
    pub axis_at: [Column; 3],
    pub out: [Column; 3],
    pub along: Column,
    pub cell: [IVec3; WAVE],
    pub period: [IVec2; WAVE],
    /// Of bodies among several: axes of the body in the world, and the ray's way in the
    /// places of the body.
    pub own_axes: [[Column; 3]; 3],
    pub way: [Column; 3],
}

impl MetColumns {
    pub fn put(&mut self, slot: usize, hit: &CellHit) {
        self.piece[slot] = hit.piece;
        self.distance[slot] = hit.distance_mm;
        for k in 0..3 {
            self.axis_at[k][slot] = hit.axis_at_mm[k];
            self.out[k][slot] = hit.out_mm[k];
        }
        self.along[slot] = hit.along_mm;
        self.cell[slot] = hit.cell;
        self.period[slot] = hit.period;
    }

    /// What a body among several has beside the hit.
    pub fn put_frame(&mut self, slot: usize, met: &MetFibre) {
        for (k, columns) in self.own_axes.iter_mut().enumerate() {
            put(columns, slot, met.world_from_own.col(k));
        }
        put(&mut self.way, slot, met.way);
    }
}

impl Paths {
    /// No paths, which will go through that matter.
    pub fn new(matter: &FibreMatter) -> Box<Paths> {
        let zero = [0.0; WAVE];
        Box::new(Paths {
            state: [State::Idle; WAVE],
            rays: [CellRay::none(); WAVE],
            in_volume: [false; WAVE],
            volume_rays: vec![VolumeRay::none(); WAVE],
            rng: [[0; WAVE]; 3],
            direction: [zero; 3],
            throughput: [zero; 3],
            radiance: [zero; 3],
            direct: [zero; 3],
            absorbed: [zero; 3],
            bounces: [0; WAVE],
            first: [None; WAVE],
            before_mm: [0.0; WAVE],
            pdf: [f32::INFINITY; WAVE],
            drawn_at_mm: [Vec3::ZERO; WAVE],
            sent_from_mm: [DVec3::ZERO; WAVE],
            met: MetColumns {
                piece: [0; WAVE],
                distance: zero,
                axis_at: [zero; 3],
                out: [zero; 3],
                along: zero,
                cell: [IVec3::ZERO; WAVE],
                period: [IVec2::ZERO; WAVE],
                own_axes: [[zero; 3]; 3],
                way: [zero; 3],
            },
            trips: match matter.is_one_body() {
                true => Vec::new(),
                false => vec![Trip::none(); WAVE],
            },
            branches: Branches::new(),
            fibres_met: [0; WAVE],
            notes: vec![Vec::new(); WAVE],
        })
    }

    /// A new path in a slot.
    pub fn begin(&mut self, slot: usize, key: (u32, u32), index: u32, direction: Vec3) {
        let [pixel, sample, count] = organza_lanes::math::lane_name(key, index);
        (self.rng[0][slot], self.rng[1][slot], self.rng[2][slot]) = (pixel, sample, count);
        put(&mut self.direction, slot, direction);
        put(&mut self.throughput, slot, Vec3::ONE);
        put(&mut self.radiance, slot, Vec3::ZERO);
        put(&mut self.direct, slot, Vec3::ZERO);
        put(&mut self.absorbed, slot, Vec3::ZERO);
        self.bounces[slot] = 0;
        self.fibres_met[slot] = 0;
        self.notes[slot].clear();
        self.first[slot] = None;
        self.before_mm[slot] = 0.0;
        self.pdf[slot] = f32::INFINITY;
    }

    /// Adds light that the path of a slot has found: direct light before its second event.
    #[inline]
    pub fn find_light(&mut self, slot: usize, light: Vec3) {
        let sum = get(&self.radiance, slot) + light;
        put(&mut self.radiance, slot, sum);
        if self.bounces[slot] <= 1 {
            let sum = get(&self.direct, slot) + light;
            put(&mut self.direct, slot, sum);
        }
    }

    /// Random numbers of the slots from `first` on.
    #[inline(always)]
    pub fn rng<F: Floats>(&self, first: usize) -> LaneRng<F::Ints> {
        LaneRng::from_words([
            F::Ints::load(&self.rng[0][first..]),
            F::Ints::load(&self.rng[1][first..]),
            F::Ints::load(&self.rng[2][first..]),
        ])
    }

    #[inline(always)]
    pub fn put_rng<F: Floats>(&mut self, first: usize, rng: &LaneRng<F::Ints>) {
        let [a, b, c] = rng.words();
        a.store(&mut self.rng[0][first..]);
        b.store(&mut self.rng[1][first..]);
        c.store(&mut self.rng[2][first..]);
    }
}

/// The vector of a slot.
#[inline(always)]
pub fn get(columns: &[Column; 3], slot: usize) -> Vec3 {
    Vec3::new(columns[0][slot], columns[1][slot], columns[2][slot])
}

#[inline(always)]
pub fn put(columns: &mut [Column; 3], slot: usize, v: Vec3) {
    for (column, x) in columns.iter_mut().zip(v.to_array()) {
        column[slot] = x;
    }
}

/// The vectors of the slots from `first` on.
#[inline(always)]
pub fn load<F: Floats>(columns: &[Column; 3], first: usize) -> V3<F> {
    V3 {
        x: F::load(&columns[0][first..]),
        y: F::load(&columns[1][first..]),
        z: F::load(&columns[2][first..]),
    }
}

#[inline(always)]
pub fn store<F: Floats>(columns: &mut [Column; 3], first: usize, v: V3<F>) {
    v.x.store(&mut columns[0][first..]);
    v.y.store(&mut columns[1][first..]);
    v.z.store(&mut columns[2][first..]);
}
