//! Lights as Mitsuba 3 writes them, and the parts of its XML that others need.

use glam::{UVec2, Vec3};
use organza_basis::Rgb;

/// A light as XML, with the files that it names.
#[derive(Clone, Debug, Default)]
pub struct MitsubaLight {
    /// Its elements, indented once, with a line end.
    pub xml: String,
    /// Pictures that it names: name, columns and rows, pixels in rows from the top.
    pub pictures: Vec<(String, UVec2, Vec<Rgb>)>,
    /// How it differs from the original.
    pub notes: Vec<String>,
    /// Whether it surrounds the scene, of which Mitsuba takes one at most.
    pub is_environment: bool,
}

impl MitsubaLight {
    /// A light that is XML alone.
    pub fn of_xml(xml: String) -> MitsubaLight {
        MitsubaLight {
            xml,
            ..MitsubaLight::default()
        }
    }
}

/// A shape that emits light, with half its edges, its middle, and its radiance; to both sides as
/// two shapes.
pub(crate) fn area_light(
    shape: &str,
    [u, v, middle]: [Vec3; 3],
    radiance: Rgb,
    is_two_sided: bool,
) -> MitsubaLight {
    let mut xml = String::new();
    for [u, v] in [[u, v], [v, u]]
        .into_iter()
        .take(1 + usize::from(is_two_sided))
    {
        let normal = u.cross(v).normalize();
        xml += &format!(
            r#"    <shape type="{shape}">
        {}
        <bsdf type="null"/>
        <emitter type="area"><rgb name="radiance" value="{}"/></emitter>
    </shape>
"#,
            matrix([u, v, normal], middle),
            colour(radiance)
        );
    }
    MitsubaLight::of_xml(xml)
}

/// Numbers as the value of an attribute.
pub fn numbers(v: impl IntoIterator<Item = f64>) -> String {
    let words: Vec<String> = v.into_iter().map(|x| x.to_string()).collect();
    words.join(", ")
}

/// A vector as the value of an attribute.
pub fn vector(v: Vec3) -> String {
    numbers(v.as_dvec3().to_array())
}

/// A colour as the value of an attribute.
pub fn colour(c: Rgb) -> String {
    numbers(<[f32; 3]>::from(c).map(f64::from))
}

/// A transform by its columns: where x, y and z go, and the origin.
pub fn matrix(columns: [Vec3; 3], origin: Vec3) -> String {
    let row = |i: usize| columns.map(|c| c[i].to_string()).join(" ") + &format!(" {} ", origin[i]);
    format!(
        r#"<transform name="to_world"><matrix value="{}{}{}0 0 0 1"/></transform>"#,
        row(0),
        row(1),
        row(2)
    )
}
