//! `terrawall convert FILE`: a wall file out of a configuration of QVR, SGCT or Equalizer.
//!
//! In: a file of another system. Out: TOML, and on standard error what it cannot say. It must not drop anything silently,
//! nor overwrite a file that somebody may have edited.

use std::path::Path;

use anyhow::{Context as _, anyhow};
use convert::Format;
use protocol::Wall;

use crate::args::Convert;
use crate::failure::{Failure, OrConfiguration as _};
use crate::output;

/// Converts.
pub(crate) fn run(args: &Convert) -> Result<(), Failure> {
    let name = args.file.display().to_string();
    let format = match args.format {
        Some(format) => format,
        None => Format::of_file_name(&name)
            .ok_or_else(|| unknown(&args.file))
            .or_configuration()?,
    };
    let text = std::fs::read_to_string(&args.file)
        .with_context(|| format!("cannot read {name}; check the path and the permissions"))
        .or_configuration()?;
    let converted = convert::convert(&text, &name, format).or_configuration()?;
    match &args.into {
        None => output::line(converted.toml.trim_end())?,
        Some(into) if into.exists() && !args.overwrite => {
            return Err(Failure::failed(format!(
                "{} is there already; add --overwrite, or write to another file",
                into.display()
            )));
        }
        Some(into) => output::file(into, converted.toml.as_bytes())?,
    }
    for lost in &converted.lost {
        eprintln!("terrawall: not carried over as it was: {lost}");
    }
    // What is written is checked, so that nobody has to find out on the wall.
    let origin = args
        .into
        .as_ref()
        .map_or(name, |into| into.display().to_string());
    match Wall::parse(&converted.toml, &origin) {
        Ok(_) => Ok(()),
        Err(error) => Err(Failure::failed(format!(
            "the wall was converted, but needs mending before it can be shown: {error}"
        ))),
    }
}

fn unknown(file: &Path) -> anyhow::Error {
    let names = Format::NAMES.map(|(_, name)| name).join(", ");
    anyhow!(
        "{} has none of the known endings (.qvr, .json, .eqc); write --format with one of {names}",
        file.display()
    )
}
