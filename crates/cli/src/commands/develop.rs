//! `organza develop`

use super::Command;
use crate::flags::MemoryArgs;
use crate::flags::display::DisplayArgs;
use crate::terminal::note;
use anyhow::Result;
use clap::Args;
use glam::UVec2;
use organza_basis::Rgb;
use organza_picture::{Display, Exposure, Picture, decode, png};
use organza_scene::memory::free_memory_bytes;
use organza_scene::read;
use organza_work::values::whole;
use organza_work::{after_option, of_file, output, picture};
use std::path::PathBuf;

/// `organza develop`
#[derive(Debug, Args)]
#[command(
    about = "Make a picture to look at (.png) from a finished render, with another exposure, curve, white or size",
    after_help = "Example:\n  organza develop denim.exr -o denim.png --exposure 0.5 --tone-mapping agx --size-px 800",
    mut_arg("exposure", |a| a.help("Brighten the picture by so many stops; \"auto\" brings the 98th percentile of its luminance to 0.8 and prints the stops [default: auto]"))
)]
pub struct DevelopArgs {
    /// Linear picture: an .exr of `organza render`, or any .exr or .hdr
    pub picture: PathBuf,
    /// Picture to write (.png)
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Longer edge of the picture; pixels are put together [default: that of the render]
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1..=65_536))]
    pub size_px: Option<u32>,
    #[command(flatten)]
    pub display: DisplayArgs,
    #[command(flatten)]
    pub memory: MemoryArgs,
    /// Print only errors
    #[arg(long)]
    pub quiet: bool,
}

impl Command for DevelopArgs {
    const NAME: &'static str = "develop";

    fn run(&self) -> Result<()> {
        let (out, read_from) = (&self.outfile, self.picture.display());
        if picture::is_linear(out) || picture::format(out).is_err() {
            let why = "expected a name that ends in .png";
            return Err(of_file(out, why));
        }
        output::check_writable(out)?;
        output::check_not_an_input(out, [&self.picture])?;
        let allowed = self.memory.max_memory.unwrap_or_else(free_memory_bytes);
        let decoded = decode(&read::bytes(&self.picture)?, allowed);
        let (linear, format) = decoded.map_err(|e| of_file(&self.picture, e))?;
        if !format.is_linear {
            return Err(of_file(
                &self.picture,
                format!(
                    "is a finished picture ({}); expected a linear one (.exr, .hdr)",
                    format.name
                ),
            ));
        }
        let smaller = match self.size_px {
            None => linear,
            Some(longer) => shrunk(&linear, longer).map_err(|longest| {
                after_option(
                    "size_px",
                    format!(
                        "{longer}: {read_from} has {longest} pixels along its longer edge, and \
                         more are not in it"
                    ),
                )
            })?,
        };
        let display = self.display.over(Display {
            exposure: Exposure::Auto,
            ..Display::default()
        });
        let display = display.resolve(&smaller);
        output::write_file(out, |mut file| {
            Ok(png::write_colours(&smaller, &display, &mut file)?)
        })?;
        if !self.quiet {
            note!(
                "{}: {} x {}, exposure {}, white balance {}",
                out.display(),
                smaller.size.x,
                smaller.size.y,
                display.exposure,
                display.white_balance
            );
        }
        Ok(())
    }
}

/// A picture of which the longer edge has so many pixels: each is the mean of the area that it
/// takes the place of. The error is the longer edge of a picture that is smaller than that.
fn shrunk(picture: &Picture, longer: u32) -> Result<Picture, u32> {
    let longest = picture.size.max_element();
    if longer >= longest {
        return match longer == longest {
            true => Ok(picture.clone()),
            false => Err(longest),
        };
    }
    let scale = f64::from(longer) / f64::from(longest);
    let size = (picture.size.as_dvec2() * scale)
        .round()
        .as_uvec2()
        .max(UVec2::ONE);
    // One axis after the other: the mean over a rectangle is that of means over its rows.
    let (columns, rows) = (picture.size.x as usize, picture.size.y as usize);
    let narrow: Vec<_> = picture
        .pixels
        .chunks_exact(columns.max(1))
        .flat_map(|row| means(size.x as usize, columns, |i| row[i]))
        .collect();
    let width = size.x as usize;
    let columns_of: Vec<Vec<Rgb>> = (0..width)
        .map(|x| means(size.y as usize, rows, |i| narrow[i * width + x]))
        .collect();
    let pixels = (0..size.y as usize).flat_map(|y| columns_of.iter().map(move |c| c[y]));
    let pixels = pixels.collect();
    Ok(Picture { size, pixels })
}

/// Means over `count` equal stretches of `of` values.
fn means(count: usize, of: usize, value: impl Fn(usize) -> Rgb) -> Vec<Rgb> {
    let step = of as f64 / count as f64;
    let mean = |i: usize| {
        let (from, to) = (i as f64 * step, (i + 1) as f64 * step);
        let last = (to.ceil() as usize).min(of);
        (from.floor() as usize..last).fold(Rgb::BLACK, |sum, j| {
            let share = to.min((j + 1) as f64) - from.max(j as f64);
            Rgb(sum.0 + value(j).0 * (share / step) as f32)
        })
    };
    (0..count).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smaller_picture_keeps_the_light() {
        let size = UVec2::new(7, 5);
        let pixels = (0..35).map(|i| Rgb::splat(i as f32)).collect();
        let picture = Picture { size, pixels };
        let small = shrunk(&picture, 3).unwrap();
        assert_eq!(small.size, UVec2::new(3, 2));
        let mean =
            |p: &Picture| p.pixels.iter().map(|c| c.mean()).sum::<f32>() / p.pixels.len() as f32;
        // Roundings of some thirty products.
        assert!((mean(&small) - mean(&picture)).abs() < 64.0 * 17.0 * f32::EPSILON);
        assert_eq!(shrunk(&picture, 7).unwrap(), picture);
        assert_eq!(shrunk(&picture, 8), Err(7));
    }
}
