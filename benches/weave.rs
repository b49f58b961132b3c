//! Relaxation of drafts and generation of fibres.

use criterion::{Criterion, criterion_group, criterion_main};
use organza_basis::SegmentSource;
use organza_weave::spec::{DraftSpec, ThreadSetSpec, TileSpec, YarnSpec};
use organza_weave::{Cloth, FabricGeometry};
use std::hint::black_box;

fn no_files(name: &str) -> std::io::Result<Vec<u8>> {
    Err(std::io::Error::other(name.to_owned()))
}

fn fabric(rows: Vec<String>) -> FabricGeometry {
    let threads = |per_cm| ThreadSetSpec {
        per_cm: Some(per_cm),
        ..ThreadSetSpec::default()
    };
    FabricGeometry {
        draft: DraftSpec {
            drawdown: Some(rows),
            ..DraftSpec::default()
        },
        warp: threads(20.0),
        weft: threads(20.0),
        ..FabricGeometry::default()
    }
}

/// A draft without a smaller repeat, floats of one to a few threads.
fn fancy(n: usize) -> FabricGeometry {
    let up = |e: usize, p: usize| {
        let block = (e * e / 7 + p * p / 5 + (e * p) / 11) % 3;
        (e + p * (1 + block)) % 4 < 2
    };
    let row = |p: usize| (0..n).map(|e| if up(e, p) { 'X' } else { '.' }).collect();
    fabric((0..n).map(row).collect())
}

/// One square centimetre of 3/1 twill as denim is: 27 ends, 18 picks.
fn denim() -> FabricGeometry {
    let mut denim = fabric(Vec::new());
    denim.draft = DraftSpec {
        weave: Some("twill-3-1-s".to_owned()),
        ..DraftSpec::default()
    };
    denim.warp.per_cm = Some(27.0);
    denim.weft.per_cm = Some(18.0);
    denim.tile = TileSpec { repeats: [7, 5] };
    let yarn = YarnSpec {
        tex: Some(64.0),
        ..YarnSpec::default()
    };
    denim.yarn.insert("cotton".to_owned(), yarn);
    denim
}

fn relaxation(c: &mut Criterion) {
    let mut group = c.benchmark_group("relaxation");
    group.sample_size(10);
    for n in [8, 64, 641] {
        let fabric = fancy(n);
        group.bench_function(format!("{n}x{n}"), |b| {
            b.iter(|| Cloth::build(black_box(&fabric), &no_files, 1).expect("fits"));
        });
    }
}

fn fibres(c: &mut Criterion) {
    let mut group = c.benchmark_group("fibres");
    group.sample_size(10);
    let cloth = Cloth::build(&denim(), &no_files, 1).expect("fits");
    let cloth = &cloth;
    let count = move |batch| {
        let (mut n, mut length) = (0usize, 0.0f64);
        cloth.for_each_in_batch(batch, &mut |s| {
            n += 1;
            length += f64::from(s.length_mm());
        });
        (n, length)
    };
    let all = || {
        (0..cloth.batch_count())
            .map(count)
            .fold((0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1))
    };
    let total = all();
    group.throughput(criterion::Throughput::Elements(total.0 as u64));
    group.bench_function(
        format!("denim 1 cm2, {} segments, 1 thread", total.0),
        |b| {
            b.iter(all);
        },
    );
    group.bench_function("denim 1 cm2, 2 threads", |b| {
        b.iter(|| {
            std::thread::scope(|scope| {
                let every_other = |first: usize| {
                    (first..cloth.batch_count())
                        .step_by(2)
                        .map(count)
                        .max_by_key(|c| c.0)
                };
                let odd = scope.spawn(move || every_other(1));
                black_box((every_other(0), odd.join().expect("no panic")));
            });
        });
    });
}

criterion_group!(benches, relaxation, fibres);
criterion_main!(benches);
