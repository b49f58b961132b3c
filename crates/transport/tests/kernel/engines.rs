//! Engines: how they share a film, and which one renders a scene.

use super::*;

/// An engine that takes the whole film at once, as one off the processor would.
struct WholeFilm {
    engine: VoxelEngine,
    blocks: Arc<AtomicU32>,
}

impl Engine for WholeFilm {
    fn name(&self) -> &'static str {
        "whole-film"
    }

    fn memory_bytes(&self) -> u64 {
        self.engine.memory_bytes()
    }

    fn rows_per_block(&self, rows: u32, _threads: u32) -> u32 {
        rows
    }

    fn take(&self, block: &mut Block<'_>) -> Result<Stats, Lost> {
        self.blocks.fetch_add(1, Ordering::Relaxed);
        self.engine.take(block)
    }
}

#[test]
fn an_engine_may_take_the_whole_film_at_once() {
    let scene = scene(AnyMedium::Grid(grid(true)), parallel(), lens());
    let settings = settings(0..6, 40);
    let (in_blocks, stats) = by_kernel(&scene, &settings);
    let blocks = Arc::new(AtomicU32::new(0));
    let whole = WholeFilm {
        engine: kernel(&scene, &settings, Backend::widest()),
        blocks: Arc::clone(&blocks),
    };
    let rendering = Rendering::new(&scene, settings).unwrap();
    let mut rendering = rendering.with_engine(Box::new(whole));
    for samples in [2, 4] {
        rendering = rendering
            .take(samples, &|_| ControlFlow::Continue(()))
            .unwrap();
    }
    assert_eq!(blocks.load(Ordering::Relaxed), 2, "one block a pass");
    assert!(rendering.film() == &in_blocks);
    assert_eq!(rendering.stats(), &stats);
}

/// The fastest engine that takes a scene renders it, and the next one where it refuses.
#[test]
fn an_engine_that_refuses_a_scene_leaves_it_to_the_next() {
    let scene = scene(AnyMedium::Grid(grid(false)), parallel(), lens());
    let flat = flat_scene(&scene, &settings(0..1, 1));
    let laid_out = LaidOut::Voxels(Arc::new(flat));
    let scalar = *record(Backend::Scalar);
    let full = EngineRecord {
        name: "full",
        for_voxels: |_| Err(Refusal::Memory(2, 1)),
        ..scalar
    };
    let absent = EngineRecord {
        name: "absent",
        is_available: || false,
        is_automatic: || false,
        ..scalar
    };
    let name = |engines: &[EngineRecord]| laid_out.fastest_engine(engines).map(|e| e.name());
    assert_eq!(name(&[scalar, full, absent]), Ok("scalar"));
    assert_eq!(name(&[full, absent]), Err(Refusal::Memory(2, 1)));
    let named = laid_out.engine(&absent).map(|e| e.name());
    assert_eq!(
        named,
        Err(Refusal::Unavailable {
            engine: "absent",
            needs: scalar.needs,
        })
    );
}

#[test]
fn what_the_kernel_cannot_do_it_refuses() {
    let refusal =
        |scene: &Scene, settings: &RenderSettings| flatten(scene, settings, 1 << 30).err();
    let mut scene = scene(AnyMedium::Grid(grid(false)), parallel(), FLAT);
    let mut exact = settings(0..1, 1);
    assert_eq!(refusal(&scene, &exact), None);
    exact.integrator = Integrator::Regular;
    assert_eq!(refusal(&scene, &exact), Some(KernelRefusal::Integrator));
    scene.media.push(AnyMedium::Grid(grid(false)));
    let two = refusal(&scene, &settings(0..1, 1));
    assert_eq!(two, Some(KernelRefusal::MediumCount(2)));
    // A flat flake is no fibre's.
    let flat = GridMedium::new(
        Aabb::new(Vec3::ZERO, Vec3::ONE),
        false,
        Interpolation::Nearest,
        Grid::constant([1.0]),
        Grid::constant(Sym3::axial(Vec3::Z, 0.1, 1.0).to_array()),
        Grid::constant([0.5; 3]),
    );
    scene.media = vec![AnyMedium::Grid(flat.unwrap())];
    let not_axial = refusal(&scene, &settings(0..1, 1));
    let expected = KernelRefusal::Kernel(Refusal::Medium(Unsuited::NotAxial));
    assert_eq!(not_axial, Some(expected));
}
