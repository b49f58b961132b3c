//! A scene as Mitsuba 3 reads it: XML with `.vol` grids.
//!
//! Mitsuba's heterogeneous medium holds one SGGX matrix and one albedo a cell,
//! ends at the box of its extinction grid, and bounds the extinction by the
//! greatest density, so that matrices must have no eigenvalue above one.

use glam::{DVec3, UVec2, UVec3, Vec3};
use organza_basis::{Aabb, Mixture, Rgb, Sym3};
use organza_light::Light;
use organza_light::mitsuba::{colour, matrix, numbers};
use organza_scatter::LaneEvent;
use organza_transport::{
    AnyMedium, Camera, CellGrid, FlakeOctreeMedium, Grid, GridMedium, Interpolation, Medium,
    PixelFilter, Plane, Projection, Scene,
};
use organza_volume::format::grid_set::BYTES_PER_CELL;
use organza_volume::{GridSet, VolGrid};
use std::fmt::Write;

/// What is written.
pub struct Export {
    /// The scene; parameters `spp` and `phase` may be set where it is loaded.
    pub xml: String,
    /// Grids by file name.
    pub grids: Vec<(String, VolGrid)>,
    /// Environments by file name, with size and pixels.
    pub pictures: Vec<(String, UVec2, Vec<Rgb>)>,
    /// What is not the same in Mitsuba.
    pub notes: Vec<String>,
}

/// How much of media without end to write.
pub struct Tiling {
    /// Periods in x and y, if any were asked for.
    pub repeats: Option<UVec2>,
    /// The point they lie around.
    pub around_mm: DVec3,
    /// Limit on the memory of grids.
    pub max_bytes: u64,
}

/// Half the edge of the square that stands for an endless plane.
const PLANE_HALF_EDGE_MM: f32 = 1000.0;

/// Writes a scene.
///
/// # Errors
/// What Mitsuba has no counterpart for, with what to do about it.
pub fn export(
    scene: &Scene,
    spp: u32,
    max_bounces: Option<u32>,
    tiling: &Tiling,
) -> Result<Export, String> {
    let mut out = Export {
        xml: String::from("<scene version=\"3.0.0\">\n"),
        grids: Vec::new(),
        pictures: Vec::new(),
        notes: Vec::new(),
    };
    // Mitsuba counts segments, organza what lies between them.
    let depth = max_bounces.map_or(-1, |n| i64::from(n) + 1);
    let _ = write!(
        out.xml,
        r#"    <default name="spp" value="{spp}"/>
    <default name="phase" value="sggx"/>
    <integrator type="volpath">
        <integer name="max_depth" value="{depth}"/>
    </integrator>
"#
    );
    camera(&mut out.xml, &scene.camera);
    let mut environments = 0;
    for (i, light) in scene.lights.iter().enumerate() {
        environments += u32::from(out.light(i, light)?);
    }
    if environments > 1 {
        return Err("Mitsuba takes one environment at most; leave the others out".into());
    }
    let mut boxes: Vec<Aabb> = Vec::new();
    for (i, medium) in scene.media.iter().enumerate() {
        let fail = |why: String| format!("object[{i}]: {why}");
        let (mut grids, lattice) = match medium {
            AnyMedium::Plane(p) => {
                out.plane(p);
                continue;
            }
            AnyMedium::Grid(m) => (Grids::of_grid(m), m.cell_grid()),
            AnyMedium::FlakeOctree(m) if is_sggx_mirror(m) => {
                let (grids, merged) = Grids::of_cloth(m, tiling.max_bytes).map_err(fail)?;
                if merged > 0 {
                    out.notes.push(format!(
                        "object[{i}]: {merged} voxels hold several yarns or populations of \
                         fibres; Mitsuba gets the mean of their SGGX matrices"
                    ));
                }
                (grids, m.cell_grid())
            }
            AnyMedium::Levelled(_) => {
                return Err(fail(
                    "has several levels of detail, or lies over a mesh; Mitsuba takes one \
                     level of a flat cloth: set lod to a number, 0 the finest"
                        .into(),
                ));
            }
            AnyMedium::FlakeOctree(_) => {
                return Err(fail(
                    "Mitsuba has specular SGGX micro-flakes, which transmit no light, and no \
                     other family; use flake = \"sggx-specular\""
                        .into(),
                ));
            }
            _ => {
                return Err(fail(
                    "only micro-flakes have a counterpart in Mitsuba; \
                     use model = \"microflake\""
                        .into(),
                ));
            }
        };
        let reach = grids.tile(lattice, tiling).map_err(fail)?;
        let overlaps = |b: &Aabb| b.min.cmplt(reach.max).all() && reach.min.cmplt(b.max).all();
        if boxes.iter().any(overlaps) {
            return Err(fail(
                "its box overlaps that of another object; Mitsuba's media cannot".into(),
            ));
        }
        boxes.push(reach);
        out.medium(i, grids, reach);
    }
    let origin = scene.camera.pose().origin_mm.as_vec3();
    if boxes.iter().any(|b| b.contains(origin)) {
        return Err("camera.origin_mm lies inside an object's box; \
                    Mitsuba's cameras cannot start there"
            .into());
    }
    out.xml.push_str("</scene>\n");
    Ok(out)
}

/// Whether a cloth is of the one family that Mitsuba has.
fn is_sggx_mirror(medium: &FlakeOctreeMedium) -> bool {
    medium.flakes().scattering().lane_event() == LaneEvent::SggxMirrors
}

/// One medium's grids.
struct Grids {
    sigma_t: VolGrid,
    sggx: VolGrid,
    albedo: VolGrid,
    filter: &'static str,
    wrap: &'static str,
}

fn vol<const N: usize>(bounds_mm: Aabb, grid: &Grid<N>) -> VolGrid {
    VolGrid {
        dims: grid.dims(),
        channels: N as u32,
        bounds_mm,
        data: grid.data().concat(),
    }
}

impl Grids {
    fn of_grid(medium: &GridMedium) -> Grids {
        let bounds = medium.cell_grid().bounds_mm();
        let (sigma_t, sggx, albedo) = medium.grids();
        let mut grids = Grids {
            sigma_t: vol(bounds, sigma_t),
            sggx: vol(bounds, sggx),
            albedo: vol(bounds, albedo),
            filter: match medium.interpolation() {
                Interpolation::Nearest => "nearest",
                Interpolation::Trilinear => "trilinear",
            },
            wrap: "clamp",
        };
        // Extinction is density times the root of the matrix's form: what is
        // taken from all matrices goes into all densities.
        let greatest = sggx
            .data()
            .iter()
            .map(|&s| Sym3::from_array(s).eigen()[0].0)
            .fold(1.0f32, f32::max);
        grids.sggx.data.iter_mut().for_each(|s| *s /= greatest);
        let root = greatest.sqrt();
        grids.sigma_t.data.iter_mut().for_each(|d| *d *= root);
        grids
    }

    /// The grids of a cloth, and how many of its voxels hold more than one
    /// population.
    fn of_cloth(medium: &FlakeOctreeMedium, max_bytes: u64) -> Result<(Grids, usize), String> {
        // Grids have the voxels of the level itself, without the outlines inside them.
        let dims = medium.octree().dims(medium.level());
        let cells = dims.as_u64vec3().element_product();
        check_memory(cells.saturating_mul(BYTES_PER_CELL), max_bytes)?;
        let several = std::cell::Cell::new(0);
        let merge = |mixture: &Mixture| {
            let merged = medium.flakes().materials().merged(mixture);
            several.set(several.get() + usize::from(merged.populations > 1));
            merged
        };
        let set = GridSet::from_octree(medium.octree(), medium.level(), &merge);
        let (Some(sggx), Some(albedo)) = (set.sggx, set.albedo) else {
            return Err("its voxels have no orientation".into());
        };
        let grids = Grids {
            sigma_t: set.sigma_t,
            sggx,
            albedo,
            filter: "nearest",
            wrap: "clamp",
        };
        Ok((grids, several.get()))
    }

    /// Repeats the extinction as often as asked, or as the lattice's cut wants;
    /// gives the box of the matter. The other grids repeat on their own.
    fn tile(&mut self, lattice: &CellGrid, tiling: &Tiling) -> Result<Aabb, String> {
        let period = lattice.bounds_mm();
        if !lattice.repeats() {
            return Ok(lattice.reach_mm());
        }
        let size = period.size();
        let index = |at: Vec3| ((at - period.min) / size).floor().as_ivec3();
        let (first, count, reach) = match (lattice.is_endless(), tiling.repeats) {
            (true, None) => {
                return Err(format!(
                    "repeats without end, which Mitsuba's media cannot; say how many of its \
                     {:.3} x {:.3} mm to write with --repeats NX,NY, or set extent_mm",
                    size.x, size.y
                ));
            }
            (true, Some(repeats)) => {
                let middle = index(tiling.around_mm.as_vec3());
                let first = middle - ((repeats - 1) / 2).extend(0).as_ivec3();
                let min = period.min + (first.as_vec3() * size).with_z(0.0);
                let max = min + (repeats.as_vec2() * size.truncate()).extend(size.z);
                (first, repeats, Aabb::new(min, max))
            }
            (false, _) => {
                let reach = lattice.reach_mm();
                let first = index(reach.min);
                // The tile that ends where the cut does is the last one.
                let last = ((reach.max - period.min) / size).ceil().as_ivec3();
                let count = (last - first).truncate().max(glam::IVec2::ONE).as_uvec2();
                (first, count, reach)
            }
        };
        let from = self.sigma_t.dims;
        let dims = UVec3::new(from.x, from.y, from.z) * count.extend(1);
        let cells = from.as_u64vec3().element_product();
        let copies = u64::from(count.x) * u64::from(count.y);
        check_memory(
            cells.saturating_mul(copies).saturating_mul(4),
            tiling.max_bytes,
        )?;
        let min = period.min + (first.as_vec3() * size).with_z(0.0);
        let max = (min + (count.as_vec2() * size.truncate()).extend(0.0)).with_z(period.max.z);
        let mut data = Vec::with_capacity((cells * copies) as usize);
        let width = from.x as usize;
        for row in 0..dims.y as usize * dims.z as usize {
            let (y, z) = (row % dims.y as usize, row / dims.y as usize);
            let start = (z * from.y as usize + y % from.y as usize) * width;
            for _ in 0..count.x {
                data.extend_from_slice(&self.sigma_t.data[start..start + width]);
            }
        }
        self.sigma_t = VolGrid {
            dims,
            channels: 1,
            bounds_mm: Aabb::new(min, max),
            data,
        };
        self.wrap = "repeat";
        Ok(reach)
    }
}

fn check_memory(bytes: u64, max_bytes: u64) -> Result<(), String> {
    if bytes > max_bytes {
        return Err(format!(
            "its grids take {} MiB, at most {} are allowed; \
             write fewer repeats, or set a coarser lod or voxel_um",
            bytes >> 20,
            max_bytes >> 20
        ));
    }
    Ok(())
}

fn camera(xml: &mut String, camera: &Camera) {
    let pose = camera.pose();
    let (kind, more, scale) = match camera.projection() {
        Projection::Orthographic { width_mm } => ("orthographic", String::new(), 0.5 * width_mm),
        Projection::Perspective { fov_rad } => ("perspective", fov(fov_rad), 1.0),
        Projection::ThinLens {
            fov_rad,
            aperture_mm,
            focus_mm,
        } => {
            let lens = format!(
                r#"
        <float name="aperture_radius" value="{}"/>
        <float name="focus_distance" value="{focus_mm}"/>"#,
                0.5 * aperture_mm
            );
            ("thinlens", fov(fov_rad) + &lens, 1.0)
        }
    };
    let filter = match camera.filter() {
        PixelFilter::Box => r#"<rfilter type="box"/>"#,
        PixelFilter::Tent => r#"<rfilter type="tent"/>"#,
        PixelFilter::Gaussian => {
            r#"<rfilter type="gaussian"><float name="stddev" value="0.5"/></rfilter>"#
        }
    };
    let size = camera.resolution();
    let _ = write!(
        xml,
        r#"    <sensor type="{kind}">
        <transform name="to_world">
            <scale x="{scale}" y="{scale}"/>
            <lookat origin="{}" target="{}" up="{}"/>
        </transform>{more}
        <float name="near_clip" value="0.001"/>
        <float name="far_clip" value="1e5"/>
        <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
        <film type="hdrfilm">
            <integer name="width" value="{}"/>
            <integer name="height" value="{}"/>
            <string name="pixel_format" value="rgb"/>
            <string name="component_format" value="float32"/>
            {filter}
        </film>
    </sensor>
"#,
        numbers(pose.origin_mm.to_array()),
        numbers(pose.target_mm.to_array()),
        numbers(pose.up.to_array()),
        size.x,
        size.y
    );
}

fn fov(fov_rad: f64) -> String {
    format!(
        r#"
        <float name="fov" value="{}"/>
        <string name="fov_axis" value="x"/>"#,
        fov_rad.to_degrees()
    )
}

impl Export {
    fn light(&mut self, index: usize, light: &Light) -> Result<bool, String> {
        let light = light.for_mitsuba(index)?;
        self.xml += &light.xml;
        self.pictures.extend(light.pictures);
        self.notes.extend(light.notes);
        Ok(light.is_environment)
    }

    fn plane(&mut self, plane: &Plane) {
        self.notes.push(format!(
            "an unbounded plane is written as a square of {} m",
            2e-3 * PLANE_HALF_EDGE_MM
        ));
        let (position, normal) = plane.position_and_normal();
        let u = normal.any_orthonormal_vector();
        let v = normal.cross(u);
        let emitter = if plane.radiance().is_black() {
            String::new()
        } else {
            format!(
                r#"
        <emitter type="area"><rgb name="radiance" value="{}"/></emitter>"#,
                colour(plane.radiance())
            )
        };
        let edge = PLANE_HALF_EDGE_MM;
        let _ = write!(
            self.xml,
            r#"    <shape type="rectangle">
        {}
        <bsdf type="twosided"><bsdf type="diffuse">
            <rgb name="reflectance" value="{}"/>
        </bsdf></bsdf>{emitter}
    </shape>
"#,
            matrix([edge * u, edge * v, normal], position),
            colour(plane.reflectance())
        );
    }

    fn medium(&mut self, i: usize, grids: Grids, reach: Aabb) {
        let half = 0.5 * reach.size();
        let columns = [
            Vec3::new(half.x, 0.0, 0.0),
            Vec3::new(0.0, half.y, 0.0),
            Vec3::new(0.0, 0.0, half.z),
        ];
        let volume = |name: &str, part: &str, raw: bool, wrap: &str| {
            let filter = grids.filter;
            format!(
                r#"<volume type="gridvolume" name="{name}">
                <string name="filename" value="object{i}.{part}.vol"/>
                <string name="filter_type" value="{filter}"/>
                <string name="wrap_mode" value="{wrap}"/>
                <boolean name="use_grid_bbox" value="true"/>
                <boolean name="raw" value="{raw}"/>
            </volume>"#
            )
        };
        let _ = write!(
            self.xml,
            r#"    <shape type="cube">
        {}
        <bsdf type="null"/>
        <medium type="heterogeneous" name="interior">
            {}
            {}
            <phase type="$phase">
            {}
            </phase>
        </medium>
    </shape>
"#,
            matrix(columns, reach.centre()),
            volume("sigma_t", "sigma_t", true, "clamp"),
            volume("albedo", "albedo", false, grids.wrap),
            volume("S", "sggx", true, grids.wrap),
        );
        for (part, grid) in [
            ("sigma_t", grids.sigma_t),
            ("sggx", grids.sggx),
            ("albedo", grids.albedo),
        ] {
            self.grids.push((format!("object{i}.{part}.vol"), grid));
        }
    }
}
