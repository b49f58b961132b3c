//! A patch of media, measured by paths that start all over it.

use crate::{Draw, DrawNumbered, Exit, FirstSight, Look, PatchResponse, PathRun};
use glam::{DVec3, UVec2, Vec2, Vec3};
use organza_basis::{Aabb, PathRng, Rgb};
use organza_transport::{
    AnyMedium, Camera, CameraError, CameraPose, CellGrid, DirectionalLight, FibreProbe, Integrator,
    Light, PathSample, PixelFilter, ProbePaths, Projection, Scene, Stats, fibre_probe, trace_from,
};

/// Why media cannot form a patch.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatchError {
    /// There is no medium.
    #[error("there is no medium to measure")]
    Empty,
    /// An opaque plane has no other side.
    #[error("a patch cannot include a plane; leave it out")]
    Plane,
    /// An endless cloth and a finite box.
    #[error("one medium repeats without end and another does not; a patch needs all of one kind")]
    Mixed,
    /// No common period.
    #[error("two media repeat with different periods, {0} and {1} mm (x, y); a patch needs one")]
    Periods(Vec2, Vec2),
    /// Exact stepping through media that are not constant in their voxels.
    #[error(
        "the \"regular\" integrator steps through constant voxels, which a medium does not have"
    )]
    NotPiecewiseConstant,
    /// The camera of the scene is invalid; this is not expected.
    #[error("{0}")]
    Camera(#[from] CameraError),
}

/// The media of a scene over their footprint: one period of an endless cloth, or the rectangle
/// of boxes that end. Paths start uniformly on the side of the footprint's box that faces the
/// viewer. The lights and the camera of the scene are ignored.
pub struct VolumePatch {
    scene: Scene,
    /// Explicit fibres alone, in cells.
    fibres: Option<FibreProbe>,
    integrator: Integrator,
    bounds_mm: Aabb,
}

impl VolumePatch {
    /// A patch of all the media of a scene.
    ///
    /// # Errors When the media have no common footprint, or exact stepping is requested and not
    /// possible.
    pub fn new(scene: Scene, integrator: Integrator) -> Result<VolumePatch, PatchError> {
        let lattices: Option<Vec<_>> = scene.media.iter().map(|m| m.cell_grid().copied()).collect();
        let mut lattices = lattices.ok_or(PatchError::Plane)?.into_iter();
        let first = lattices.next().ok_or(PatchError::Empty)?;
        let footprint = |l: &CellGrid| {
            if l.is_endless() {
                l.bounds_mm()
            } else {
                l.reach_mm()
            }
        };
        let mut bounds_mm = footprint(&first);
        for lattice in lattices {
            if lattice.is_endless() != first.is_endless() {
                return Err(PatchError::Mixed);
            }
            let bounds = footprint(&lattice);
            if first.is_endless() {
                let period = first.bounds_mm().size().truncate();
                let other = bounds.size().truncate();
                if (period - other).abs().max_element() > 1e-5 * period.max_element() {
                    return Err(PatchError::Periods(period, other));
                }
                bounds_mm.min.z = bounds_mm.min.z.min(bounds.min.z);
                bounds_mm.max.z = bounds_mm.max.z.max(bounds.max.z);
            } else {
                bounds_mm = bounds_mm.union(&bounds);
            }
        }
        let exact = scene.media.iter().all(|m| m.is_piecewise_constant());
        if integrator == Integrator::Regular && !exact {
            return Err(PatchError::NotPiecewiseConstant);
        }
        Ok(VolumePatch {
            fibres: fibre_probe(&scene),
            scene,
            integrator,
            bounds_mm,
        })
    }

    /// A patch of media without a scene. Media with several levels of detail show those for
    /// pixels of 1 mm.
    ///
    /// # Errors
    /// As [`VolumePatch::new`].
    pub fn of_media(
        media: Vec<AnyMedium>,
        integrator: Integrator,
    ) -> Result<VolumePatch, PatchError> {
        let pose = CameraPose::new(DVec3::Z, DVec3::ZERO, DVec3::Y);
        let projection = Projection::Orthographic { width_mm: 1.0 };
        let scene = Scene {
            media,
            lights: Vec::new(),
            camera: Camera::new(projection, pose, UVec2::ONE, PixelFilter::Box)?,
        };
        VolumePatch::new(scene, integrator)
    }

    /// The box over which paths start.
    pub fn bounds_mm(&self) -> Aabb {
        self.bounds_mm
    }

    /// A uniformly drawn place of the footprint, mm, on the side that faces `w`.
    fn start_mm(&self, w: Vec3, rng: &mut PathRng) -> Vec3 {
        let (low, size) = (self.bounds_mm.min, self.bounds_mm.size());
        (low.truncate() + rng.unit2() * size.truncate()).extend(self.face_mm(w))
    }

    /// Height of the side that faces `w`.
    fn face_mm(&self, w: Vec3) -> f32 {
        if w.z > 0.0 {
            self.bounds_mm.max.z
        } else {
            self.bounds_mm.min.z
        }
    }

    /// Where a ray seen from `w` through a place of the middle plane enters, mm.
    fn above_mm(&self, place_mm: Vec2, w: Vec3) -> Vec3 {
        let face = self.face_mm(w);
        (place_mm + w.truncate() * (face / w.z)).extend(face)
    }

    /// What `of` makes of every path, which is seen from a direction at a point, mm, as `start` draws
    /// both.
    fn each_path<T>(
        &self,
        start: &DrawNumbered<'_, (Vec3, Vec3)>,
        lights: &[Light],
        run: PathRun<'_, T>,
        of: impl Fn(&PathSample) -> T,
    ) {
        let names = run.names;
        let Some(probe) = &self.fibres else {
            for path in names.paths.clone() {
                let mut rng = names.rng(path);
                let (from, w) = start(path, &mut rng);
                (run.found)(of(&self.trace(from, w, lights, &mut rng, run.stats)));
            }
            return;
        };
        let start = |path: u64| {
            let (from, w) = start(path, &mut names.rng(path));
            (from.as_dvec3(), -w.as_dvec3())
        };
        let (samples, counts) = probe.trace(&ProbePaths {
            lights,
            seed: names.seed,
            stream: names.stream,
            paths: names.paths.clone(),
            start: &start,
        });
        run.stats.merge(&counts);
        samples.iter().map(of).for_each(run.found);
    }

    /// A path seen from `w` at a point.
    fn trace(
        &self,
        from_mm: Vec3,
        w: Vec3,
        lights: &[Light],
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> PathSample {
        let ray = (from_mm.as_dvec3(), -w.as_dvec3());
        trace_from(
            &self.scene,
            lights,
            ray,
            self.integrator,
            u32::MAX,
            rng,
            stats,
        )
    }
}

/// Light from `w` of unit irradiance across the beam.
fn beam(w: Vec3) -> Light {
    Light::from(DirectionalLight::new(-w, Rgb::WHITE))
}

impl PatchResponse for VolumePatch {
    fn estimate_bsdf(&self, w_in: Vec3, w_out: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Rgb {
        let from = self.start_mm(w_out, rng);
        self.trace(from, w_out, &[beam(w_in)], rng, stats).radiance / w_in.z.abs()
    }

    fn estimate_at(
        &self,
        place_mm: Vec2,
        w_in: Vec3,
        w_out: Vec3,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Rgb {
        let from = self.above_mm(place_mm, w_out);
        self.trace(from, w_out, &[beam(w_in)], rng, stats).radiance / w_in.z.abs()
    }

    fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Exit {
        let from = self.start_mm(w, rng);
        let path = self.trace(from, w, &[], rng, stats);
        exit_of(&path)
    }

    fn each_bsdf(&self, (w_in, w_out): (Vec3, Vec3), run: PathRun<'_, Rgb>) {
        let start = |_: u64, rng: &mut PathRng| (self.start_mm(w_out, rng), w_out);
        self.each_path(&start, &[beam(w_in)], run, |path| {
            path.radiance / w_in.z.abs()
        });
    }

    fn each_bsdf_at(&self, place: &Draw<'_, Vec2>, pair: (Vec3, Vec3), run: PathRun<'_, Rgb>) {
        let (w_in, w_out) = pair;
        let start = |_: u64, rng: &mut PathRng| (self.above_mm(place(rng), w_out), w_out);
        self.each_path(&start, &[beam(w_in)], run, |path| {
            path.radiance / w_in.z.abs()
        });
    }

    fn each_exit(&self, from: &Draw<'_, Vec3>, run: PathRun<'_, Exit>) {
        let start = |_: u64, rng: &mut PathRng| {
            let w = from(rng);
            (self.start_mm(w, rng), w)
        };
        self.each_path(&start, &[], run, exit_of);
    }

    fn each_exit_at(&self, start: &DrawNumbered<'_, (Vec2, Vec3)>, run: PathRun<'_, Exit>) {
        let start = |path: u64, rng: &mut PathRng| {
            let (place_mm, w) = start(path, rng);
            (self.above_mm(place_mm, w), w)
        };
        self.each_path(&start, &[], run, exit_of);
    }

    fn each_look(&self, place: &DrawNumbered<'_, Vec2>, run: PathRun<'_, Look>) {
        let face_mm = self.face_mm(Vec3::Z);
        let start = |path: u64, rng: &mut PathRng| (place(path, rng).extend(face_mm), Vec3::Z);
        self.each_path(&start, &[], run, |path| Look {
            exit: exit_of(path),
            first: path.first.map(|event| FirstSight {
                axis: event.info.axis,
                height_mm: (f64::from(face_mm) - event.depth_mm) as f32,
            }),
            events: path.bounces,
        });
    }
}

fn exit_of(path: &PathSample) -> Exit {
    Exit {
        escape: path.escape.map(|e| (e.direction, e.throughput)),
        is_straight: path.first.is_none(),
        absorbed: path.absorbed,
    }
}
