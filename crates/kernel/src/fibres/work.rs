//! What waves of paths work for.

use glam::{DVec3, Vec3};
use organza_basis::{PathRng, Rgb};
use organza_film::{Brightness, Camera, FirstEvent, Pixel, Sample, Stats, Tally};

use super::cache::Note;
use crate::block::Block;
use organza_lanes::math::pixel_key;

/// A path to walk.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    pub origin_mm: DVec3,
    /// Unit.
    pub direction: DVec3,
    /// Names its random numbers.
    pub key: (u32, u32),
    pub index: u32,
}

/// A path that has ended.
#[derive(Clone, Copy, Debug)]
pub struct End<'a> {
    pub radiance: Vec3,
    /// The part of it that came straight to the camera or by one event.
    pub direct: Vec3,
    pub bounces: u32,
    pub first: Option<FirstEvent>,
    /// Estimate of the share that was absorbed.
    pub absorbed: Vec3,
    /// Where it left the matter and what it carried, if it did.
    pub escape: Option<(Vec3, Vec3)>,
    /// Where it noted places for the cache.
    pub notes: &'a [Note],
}

/// Gives out paths and takes what they found. Every slot of a wave has one path
/// at a time.
pub trait Work {
    /// The next path of a slot.
    fn begin(&mut self, slot: usize, stats: &mut Stats) -> Option<Start>;
    /// The path of a slot has ended.
    fn end(&mut self, slot: usize, end: &End<'_>, stats: &mut Stats);
}

/// Slots of a wave.
pub const WAVE: usize = 64;

/// Samples of a pixel that a slot takes one after the other. With few of them, the slots
/// of a wave share pixels, and their paths the cells of a small part of the matter, which
/// stay in the second cache.
const SAMPLES_PER_TURN: usize = 8;

/// Samples of the pixels of a block, a few of one pixel in every slot.
pub struct FilmWork<'a, 'b> {
    pub block: &'a mut Block<'b>,
    pub camera: &'a Camera,
    pub seed: u64,
    pub brightness: Brightness,
    posts: [Post; WAVE],
    next_turn: usize,
}

#[derive(Clone, Copy, Default)]
struct Post {
    /// Number in the block, and column and row in the picture.
    pixel: Option<(usize, u32, u32)>,
    sample: u32,
    /// Beyond its last sample.
    end: u32,
    tally: Tally,
    /// Of direct light, where a film of it is filled.
    direct: Tally,
}

impl<'a, 'b> FilmWork<'a, 'b> {
    pub fn new(
        block: &'a mut Block<'b>,
        camera: &'a Camera,
        seed: u64,
        brightness: Brightness,
    ) -> FilmWork<'a, 'b> {
        FilmWork {
            block,
            camera,
            seed,
            brightness,
            posts: [Post::default(); WAVE],
            next_turn: 0,
        }
    }
}

impl Work for FilmWork<'_, '_> {
    fn begin(&mut self, slot: usize, stats: &mut Stats) -> Option<Start> {
        let post = &mut self.posts[slot];
        let (x, y) = loop {
            if post.pixel.is_none() {
                let samples = &self.block.samples;
                let turns = samples.len().div_ceil(SAMPLES_PER_TURN).max(1);
                let first = self.next_turn % turns * SAMPLES_PER_TURN;
                post.pixel = self.block.pixel(self.next_turn / turns);
                post.sample = samples.start + first as u32;
                post.end = samples.end.min(post.sample + SAMPLES_PER_TURN as u32);
                self.next_turn += 1;
            }
            let (pixel, x, y) = post.pixel?;
            if let Some(sample) = self.block.next_sample(x, y, post.sample, post.end) {
                post.sample = sample;
                break (x, y);
            }
            post.finish(self.block, pixel, &self.brightness);
        };
        stats.paths += 1;
        let name = u64::from(y) * u64::from(self.camera.resolution().x) + u64::from(x);
        let mut rng = PathRng::new(self.seed, name, u64::from(post.sample));
        let (origin_mm, direction) = self.camera.ray(glam::UVec2::new(x, y), &mut rng);
        Some(Start {
            origin_mm,
            direction,
            key: pixel_key(self.seed, name),
            index: post.sample,
        })
    }

    fn end(&mut self, slot: usize, end: &End<'_>, stats: &mut Stats) {
        let post = &mut self.posts[slot];
        let Some((number, ..)) = post.pixel else {
            return;
        };
        let sample = Sample {
            radiance: end.radiance.to_array(),
            bounces: end.bounces,
            first: end.first,
            index: post.sample,
        };
        let pixel: &mut Pixel = &mut self.block.pixels[number];
        if post.tally.add(&sample, &self.brightness, pixel) {
            stats.brightest = stats.brightest.max(Rgb(end.radiance).max_component());
            if let Some(direct) = &mut self.block.direct {
                let radiance = end.direct.to_array();
                let sample = Sample { radiance, ..sample };
                let pixel = &mut direct[number];
                post.direct.add(&sample, &self.brightness, pixel);
            }
        } else {
            stats.rejected += 1;
        }
        post.sample += 1;
        if post.sample >= post.end {
            post.finish(self.block, number, &self.brightness);
        }
    }
}

impl Post {
    /// Brings what is left to the films; another pixel may follow.
    fn finish(&mut self, block: &mut Block<'_>, pixel: usize, brightness: &Brightness) {
        self.tally.flush(brightness, &mut block.pixels[pixel]);
        if let Some(direct) = &mut block.direct {
            self.direct.flush(brightness, &mut direct[pixel]);
        }
        self.pixel = None;
    }
}
