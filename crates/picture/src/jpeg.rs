//! JPEG pictures, as cameras write them: sRGB, turned as the camera was held; read only.

use crate::decoder;
use crate::format::{Format, Reader};
use image::ImageFormat;

const NAME: &str = "JPEG";

/// The record of the format.
pub const FORMAT: Format = Format {
    name: NAME,
    endings: &["jpg", "jpeg"],
    keeps: "display values",
    starts: &[b"\xff\xd8\xff"],
    is_linear: false,
    keeps_sums: false,
    reader: Some(Reader {
        size: |bytes| decoder::size(NAME, bytes, ImageFormat::Jpeg),
        shown_size: |bytes| decoder::size(NAME, bytes, ImageFormat::Jpeg),
        decode: |bytes| decoder::decode(NAME, bytes, ImageFormat::Jpeg),
        holds_radiance: |_| false,
    }),
    writer: None,
};

#[cfg(test)]
mod tests {
    use crate::{decode, stated_size};
    use glam::UVec2;
    use image::codecs::jpeg::JpegEncoder;
    use image::codecs::tiff::TiffEncoder;
    use image::{ExtendedColorType, ImageEncoder};
    use organza_basis::Rgb;

    /// Rows of 16 red pixels over rows of 16 blue ones; the colours of JPEG change between pixels
    /// more coarsely than its brightness.
    fn flag() -> Vec<u8> {
        let row = |colour: [u8; 3]| colour.repeat(16 * 16);
        [row([255, 0, 0]), row([0, 0, 255])].concat()
    }

    /// Exif data that say how the camera was held.
    fn exif(orientation: u8) -> Vec<u8> {
        let mut exif = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".to_vec();
        exif.extend([orientation, 0, 0, 0, 0, 0, 0]);
        exif
    }

    #[test]
    fn a_photograph_is_turned_as_the_camera_was_held() {
        for (orientation, size, first_is_red) in [
            (1, UVec2::new(16, 32), true),
            (3, UVec2::new(16, 32), false),
            (6, UVec2::new(32, 16), false),
        ] {
            let mut bytes = Vec::new();
            let mut encoder = JpegEncoder::new_with_quality(&mut bytes, 95);
            encoder.set_exif_metadata(exif(orientation)).unwrap();
            encoder
                .write_image(&flag(), 16, 32, ExtendedColorType::Rgb8)
                .unwrap();
            assert_eq!(stated_size(&bytes).unwrap(), size);
            let (picture, format) = decode(&bytes, 1 << 20).unwrap();
            assert_eq!((picture.size, format.name), (size, "JPEG"));
            let [first, last] = [picture.pixels[0], *picture.pixels.last().unwrap()];
            let (red, blue) = if first_is_red {
                (first, last)
            } else {
                (last, first)
            };
            assert!(red.0.x > 0.9 && red.0.z < 0.02, "{orientation}: {red:?}");
            assert!(blue.0.z > 0.9 && blue.0.x < 0.02, "{orientation}: {blue:?}");
        }
    }

    #[test]
    fn tiff_of_whole_numbers_is_srgb_and_no_radiance() {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let encoder = TiffEncoder::new(&mut bytes);
        encoder
            .write_image(&[188; 12], 2, 2, ExtendedColorType::Rgb8)
            .unwrap();
        let bytes = bytes.into_inner();
        let (picture, _) = decode(&bytes, 1 << 20).unwrap();
        assert_eq!(
            picture.pixels[3],
            Rgb::splat(Rgb::linear_from_srgb(188.0 / 255.0))
        );
        let reader = crate::tiff::FORMAT.reader.unwrap();
        assert!(!(reader.holds_radiance)(&bytes));
    }
}
