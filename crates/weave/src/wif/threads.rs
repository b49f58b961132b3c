//! The colours, spacings and thicknesses of the threads of a WIF file.

use super::{Reader, expected_number, expected_whole, real, whole, wrong};
use crate::draft::MAX_THREADS;
use crate::error::did_you_mean;
use crate::ini::IniSection;
use crate::{Error, Thread};
use organza_basis::Rgb;

impl Reader {
    /// Linear colours of the colour table, `None` when there is no table.
    pub(super) fn palette(&mut self) -> Result<Option<Vec<Option<Rgb>>>, Error> {
        let Some(table) = self.used("COLOR TABLE") else {
            return Ok(None);
        };
        let (low, high) = self.palette_range()?;
        let entries = self.count("COLOR PALETTE", "ENTRIES")?;
        let mut colours: Vec<Option<Rgb>> = Vec::new();
        let mut clamped = 0;
        for (key, value) in table.entries() {
            let index = whole(key)
                .filter(|&i| (1..=MAX_THREADS).contains(&i))
                .ok_or_else(|| {
                    wrong(
                        "COLOR TABLE",
                        key,
                        format!("expected a number from 1 to {MAX_THREADS}"),
                    )
                })?;
            let channels: Vec<f64> = value
                .split(',')
                .map(|v| real(v).ok_or_else(|| wrong("COLOR TABLE", key, expected_number(v))))
                .collect::<Result<_, _>>()?;
            let &[r, g, b] = channels.as_slice() else {
                let message = format!("expected red,green,blue, found \"{value}\"");
                return Err(wrong("COLOR TABLE", key, message));
            };
            let linear = [r, g, b].map(|c| {
                let encoded = (c - low) / (high - low);
                clamped += usize::from(!(0.0..=1.0).contains(&encoded));
                Rgb::linear_from_srgb(encoded.clamp(0.0, 1.0) as f32)
            });
            if colours.len() < index {
                colours.resize(index, None);
            }
            colours[index - 1] = Some(Rgb::from(linear));
        }
        if clamped > 0 {
            self.warn(
                "COLOR TABLE",
                format!("{clamped} channels outside {low} to {high} are clamped"),
            );
        }
        if let Some(n) = entries.filter(|&n| n != colours.len()) {
            let found = colours.len();
            self.warn(
                "COLOR PALETTE",
                format!("Entries is {n}, the table has {found}"),
            );
        }
        Ok(Some(colours))
    }

    fn palette_range(&self) -> Result<(f64, f64), Error> {
        let Some(range) = self.value("COLOR PALETTE", "RANGE") else {
            return Ok((0.0, 255.0));
        };
        let ends: Vec<Option<f64>> = range.split(',').map(real).collect();
        match ends.as_slice() {
            &[Some(low), Some(high)] if low != high => Ok((low, high)),
            _ => Err(wrong(
                "COLOR PALETTE",
                "Range",
                format!("expected two different numbers, found \"{range}\""),
            )),
        }
    }

    pub(super) fn threads(
        &mut self,
        system: &str,
        count: usize,
        palette: Option<&[Option<Rgb>]>,
    ) -> Result<Vec<Thread>, Error> {
        let colours = self.colours(system, count, palette)?;
        let spacings = self.lengths_mm(system, "SPACING", count)?;
        let thicknesses = self.lengths_mm(system, "THICKNESS", count)?;
        Ok((0..count)
            .map(|i| Thread {
                colour: colours[i],
                spacing_mm: spacings[i],
                thickness_mm: thicknesses[i],
            })
            .collect())
    }

    fn colours(
        &mut self,
        system: &str,
        count: usize,
        palette: Option<&[Option<Rgb>]>,
    ) -> Result<Vec<Option<Rgb>>, Error> {
        let look_up = |i: usize| palette.and_then(|p| *p.get(i.checked_sub(1)?)?);
        // `Color=3` or, by the letter of the format, `Color=3,r,g,b`.
        let default = match self.value(system, "COLOR") {
            None => None,
            Some(v) => {
                let first = v.split(',').next().unwrap_or(v);
                let index =
                    whole(first).ok_or_else(|| wrong(system, "Color", expected_whole(v)))?;
                let colour = look_up(index);
                if colour.is_none() && index != 0 {
                    self.warn(system, format!("Color {index} is not in the COLOR TABLE"));
                }
                colour
            }
        };
        let name = format!("{system} COLORS");
        let mut colours = vec![default; count];
        if self.used(&name).is_none() {
            return Ok(colours);
        }
        for (i, list) in self.lists(&name, count, None)?.iter().enumerate() {
            if let Some(&index) = list.first() {
                let known = palette.map_or_else(
                    || "there is no COLOR TABLE".to_owned(),
                    |p| format!("the COLOR TABLE ends at {}", p.len()),
                );
                colours[i] = Some(look_up(index).ok_or_else(|| {
                    wrong(
                        &name,
                        &(i + 1).to_string(),
                        format!("colour {index}: {known}"),
                    )
                })?);
            }
        }
        Ok(colours)
    }

    fn lengths_mm(
        &mut self,
        system: &str,
        quantity: &str,
        count: usize,
    ) -> Result<Vec<Option<f32>>, Error> {
        let default = self.real(system, quantity)?;
        let name = format!("{system} {quantity}");
        let mut own: Vec<Option<f64>> = vec![None; count];
        for (key, value) in self.used(&name).into_iter().flat_map(IniSection::entries) {
            let line = whole(key).ok_or_else(|| wrong(&name, key, "expected a line number"))?;
            let length = real(value).ok_or_else(|| wrong(&name, key, expected_number(value)))?;
            if (1..=count).contains(&line) {
                own[line - 1] = Some(length);
            }
        }
        let given = own.iter().flatten().count();
        if given > 0 && given < count && default.is_none() {
            let open = count - given;
            self.warn(
                &name,
                format!("{open} threads have none and [{system}] has no default"),
            );
        }
        if given == 0 && default.is_none() {
            return Ok(vec![None; count]);
        }
        let unit_mm = self.unit_mm(system)?;
        let lengths: Vec<Option<f32>> = own
            .iter()
            .map(|l| {
                l.or(default)
                    .map(|l| (l * unit_mm) as f32)
                    .filter(|l| *l > 0.0)
            })
            .collect();
        if own.iter().any(|l| l.or(default).is_some_and(|l| l <= 0.0)) {
            self.warn(&name, "lengths that are not above zero are ignored");
        }
        Ok(lengths)
    }

    fn unit_mm(&mut self, system: &str) -> Result<f64, Error> {
        let Some(units) = self.value(system, "UNITS").map(str::to_lowercase) else {
            self.warn(system, "Units is missing; centimeters are taken");
            return Ok(10.0);
        };
        match units.as_str() {
            "centimeters" | "centimetres" | "centimeter" | "cm" => Ok(10.0),
            "inches" | "inch" | "in" => Ok(25.4),
            "decipoints" | "decipoint" => Ok(25.4 / 720.0),
            "millimeters" | "millimetres" | "mm" => Ok(1.0),
            _ => {
                let hint = did_you_mean(&units, ["centimeters", "inches", "decipoints"]);
                Err(wrong(
                    system,
                    "Units",
                    format!("expected centimeters, inches or decipoints, found \"{units}\"{hint}"),
                ))
            }
        }
    }
}
