//! `terrawall check WALL`: is a wall right, and is it odd?
//!
//! In: a wall file and the files that it names. Out: what it describes, what is legal but odd, and a plan of the room. A
//! wall that is wrong fails with the place in the file. It must not start anything.

mod calibrated;
mod canvases;
mod eyes;
mod findings;
mod heads;
mod meeting;
mod overlaps;
mod ramps;

mod windows;

use crate::args::Check;
use crate::failure::{Failure, OrConfiguration as _};
use crate::output::counted;
use crate::{output, plan};

use super::files;
use calibrated::ChannelFindings;
use findings::{Findings, Range, ScreenFindings};

/// Validates a wall.
pub(crate) fn run(args: &Check) -> Result<(), Failure> {
    let wall = files::wall(&args.wall)?;
    let surfaces = node::surfaces(&wall).or_configuration()?;
    let findings = Findings::new(&wall, &surfaces);
    if let Some(path) = &args.plan {
        output::file(path, plan::room_plan(&wall, &surfaces).as_bytes())?;
    }
    if args.json {
        return output::json(&findings);
    }
    output::line(format!(
        "{}: {}, {}, {}, {:.1} megapixels at {} frames per second",
        findings.name,
        counted(findings.screens.len(), "screen"),
        counted(findings.hosts, "host"),
        counted(findings.outputs, "output"),
        findings.pixels as f64 / 1e6,
        findings.fps
    ))?;
    for screen in &findings.screens {
        output::line(sentence(screen))?;
    }
    for channel in &findings.calibrated {
        output::line(of_channel(channel))?;
    }
    for warning in &findings.warnings {
        output::line(format!("  odd: {warning}"))?;
    }
    if findings.warnings.is_empty() {
        output::line("  nothing odd")?;
    }
    Ok(())
}

fn densities(range: Option<&Range>) -> String {
    range.map_or("not seen from the front".to_owned(), |range| {
        format!(
            "{:.0}…{:.0} pixels to a radian",
            range.sparsest, range.densest
        )
    })
}

fn of_channel(channel: &ChannelFindings) -> String {
    let region = channel.region.as_ref();
    format!(
        "  output {}: {}×{} pixels on screen {} by {}{}, {}",
        channel.output,
        channel.size_px[0],
        channel.size_px[1],
        channel.screen,
        channel.calibration,
        region.map_or(String::new(), |region| format!(", region {region}")),
        densities(channel.pixels_per_radian.as_ref())
    )
}

fn sentence(screen: &ScreenFindings) -> String {
    let density = densities(screen.pixels_per_radian.as_ref());
    let shown = &screen.outputs;
    let shown = [
        (shown.centre, "both eyes at once"),
        (shown.left, "the left eye"),
        (shown.right, "the right eye"),
    ]
    .into_iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, eye)| format!("{} for {eye}", counted(count, "output")))
    .collect::<Vec<String>>()
    .join(" and ");
    format!(
        "  screen {}: {}, {}×{} pixels, {:.2}×{:.2} m, {:.2} m away, {:.0}°×{:.0}° of view, {density}, shown by {}",
        screen.name,
        screen.kind,
        screen.size_px[0],
        screen.size_px[1],
        screen.size_m[0],
        screen.size_m[1],
        screen.distance_m,
        screen.field_of_view_deg[0],
        screen.field_of_view_deg[1],
        if shown.is_empty() {
            "nobody"
        } else {
            shown.as_str()
        }
    )
}
