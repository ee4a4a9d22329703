//! `fillrate pixel`

use std::path::PathBuf;
use std::str::FromStr;

use anyhow::{Context, Result};

use super::Verdict;
use super::threads::MOST;
use crate::report::pixel;
use crate::run::pixel::{PixelQuery, history};
use crate::work::SurfaceKey;

/// Tell the history of a pixel: the draws that touch it in a frame, in their order, and how each fragment ends
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  fillrate pixel traces/cube 96,124\n  fillrate pixel traces/shadow 40,40@5 --json\n\n\
@ names a texture by its number, as heat maps and errors do; @7:0:3 is layer 3 of its level 0.")]
pub struct Arguments {
    /// The trace: a file, or its folder; native or foreign
    trace: PathBuf,
    /// The pixel, from the upper left corner, and the texture: the one that the frame shows unless another is named
    #[arg(value_name = "X,Y[@TEXTURE]")]
    pixel: Pixel,
    /// The frame
    #[arg(long, value_name = "N", default_value = "0", value_parser = clap::value_parser!(u32).range(..i64::from(u32::MAX)))]
    frame: u32,
    /// Print one JSON document
    #[arg(help_heading = "Output", long)]
    json: bool,
    /// Threads; no result depends on it [default: all processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST)))]
    pub threads: Option<u16>,
    #[command(flatten, next_help_heading = "Reading the trace")]
    reading: super::reading::Reading,
}

/// A pixel of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pixel {
    at: [u32; 2],
    target: Option<SurfaceKey>,
}

impl FromStr for Pixel {
    type Err = String;

    fn from_str(text: &str) -> Result<Pixel, String> {
        let number = |text: &str| text.parse::<u32>().map_err(|_| format!("`{text}` is no number"));
        let (at, target) = text.split_once('@').map_or((text, None), |(at, target)| (at, Some(target)));
        let (x, y) = at.split_once(',').ok_or("write it as X,Y or X,Y@TEXTURE")?;
        let at = [number(x)?, number(y)?];
        let target = target.map(|target| {
            let parts = target.split(':').map(number).collect::<Result<Vec<u32>, String>>()?;
            match parts[..] {
                [texture] => Ok(SurfaceKey { texture, level: 0, layer: 0 }),
                [texture, level, layer] => Ok(SurfaceKey { texture, level, layer }),
                _ => Err("write the texture as TEXTURE or TEXTURE:LEVEL:LAYER".to_owned()),
            }
        });
        Ok(Pixel { at, target: target.transpose()? })
    }
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let Arguments { frame, pixel: Pixel { at, target }, .. } = *arguments;
    let name = arguments.trace.display();
    let trace = arguments.reading.open_frames(&arguments.trace, u64::from(frame)..u64::from(frame) + 1)?;
    let opened = trace.origin();
    let history = history(&trace, &PixelQuery { frame, at, target }).with_context(|| name.to_string())?;
    arguments.reading.say_at_end(&arguments.trace, &trace, &opened);
    if arguments.json {
        super::say_json(&pixel::json(&history, at, frame))?;
    } else {
        print!("{}", pixel::text(&history, at, frame));
    }
    Ok(super::reading::verdict(&trace))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_may_name_its_texture() {
        let key = |texture, level, layer| Some(SurfaceKey { texture, level, layer });
        assert_eq!("3,4".parse(), Ok(Pixel { at: [3, 4], target: None }));
        assert_eq!("3,4@7".parse(), Ok(Pixel { at: [3, 4], target: key(7, 0, 0) }));
        assert_eq!("3,4@7:1:2".parse(), Ok(Pixel { at: [3, 4], target: key(7, 1, 2) }));
        for (text, reason) in [("3", "X,Y"), ("3,x", "`x`"), ("3,-1", "`-1`"), ("3,4@7:1", "LEVEL"), ("3,4@", "``")] {
            let error = text.parse::<Pixel>().unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }
}
