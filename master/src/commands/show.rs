//! `terrawall up` and `terrawall master`: a wall shows a scene.
//!
//! In: wall and scene files, what is asked of the run. Out: a wall in step; at the end pictures and a report.

use std::time::Duration;

use link::Identity;
use master::{Master as RunningMaster, MasterOptions, MasterOutcome};
use protocol::Wall;
use protocol::report::Report;

use crate::args::{Master, Show, Up};
use crate::failure::{Failure, OrConfiguration as _};
use crate::{interrupt, output};

use super::control::Opening;
use super::notices::Teller;
use super::{files, local, pictures};

/// How often Ctrl-C is looked at.
const LOOK: Duration = Duration::from_millis(100);

/// Runs a whole wall on this machine.
pub(crate) fn up(args: &Up) -> Result<(), Failure> {
    let show = &args.show;
    let (mut wall, scene) = (wall_of(show)?, files::scene(&show.scene)?);
    let windows = wall
        .hosts
        .iter()
        .flat_map(|host| &host.outputs)
        .any(|output| output.window.is_some());
    let headless = show.headless || !windows || !node::display_available();
    if headless && !show.headless && windows {
        eprintln!("terrawall: there is no display (DISPLAY is not set): rendering headless");
    }
    if headless {
        close_windows(&mut wall);
    }
    let run = local::Run {
        headless,
        fps: show.fps,
        frames: show.frames,
        capture: show.capture.is_some(),
        measure_error: show.wants_error(),
        digests: args.digests.as_deref(),
    };
    let control = local::Control {
        opening: Opening::new(&show.control)?,
        scene_file: &show.scene,
        wall_file: files::wall_file(&show.wall)?,
    };
    let shown = local::run(&wall, &scene, run, Some(control))?;
    finish(show, &wall, &shown.outcome)?;
    match shown.lost {
        Some(lost) if !shown.outcome.stopped => Err(Failure::failed(format!(
            "the wall went on without some nodes: {lost}"
        ))),
        _ => Ok(()),
    }
}

/// Runs the master of a wall whose nodes are started on their hosts.
pub(crate) fn master(args: &Master) -> Result<(), Failure> {
    let show = &args.show;
    let (mut wall, scene) = (wall_of(show)?, files::scene(&show.scene)?);
    let identity = Identity::load(&args.identity).or_configuration()?;
    if show.headless {
        close_windows(&mut wall);
    }
    let mut options = MasterOptions::new(
        wall.clone(),
        files::open_surfaces(),
        scene,
        identity,
        args.listen,
    );
    options.fps = show.fps;
    options.frames = show.frames;
    options.capture = show.capture.is_some();
    options.measure_error = show.wants_error();
    options.start_after = Some(Duration::from_secs_f64(args.wait));
    options.start_timeout = None;
    let opening = Opening::new(&show.control)?;
    opening.put_into(&mut options, &show.scene, files::wall_file(&show.wall)?)?;
    let master = RunningMaster::start(options).map_err(Failure::of_start)?;
    eprintln!(
        "terrawall: the master of \"{}\" listens at {}",
        wall.name,
        master.address()
    );
    opening.announce(&master);
    let mut teller = Teller::new(show.frames);
    let mut stopping = false;
    while !master.is_over() {
        if interrupt::requested() && !stopping {
            stopping = true;
            master.stop();
        }
        if let Some(notice) = master.next_notice(LOOK) {
            teller.tell(&notice);
        }
    }
    drop(teller);
    finish(show, &wall, &master.finish()?)
}

/// The wall to be shown, with as many pixels as are asked for.
fn wall_of(show: &Show) -> Result<Wall, Failure> {
    let wall = files::wall(&show.wall)?;
    Ok(match show.pixels {
        Some(share) => wall.with_share_of_pixels(share),
        None => wall,
    })
}

/// The same wall without windows.
pub(super) fn close_windows(wall: &mut Wall) {
    for output in wall.hosts.iter_mut().flat_map(|host| &mut host.outputs) {
        output.window = None;
    }
}

/// Writes what was asked for.
fn finish(show: &Show, wall: &Wall, outcome: &MasterOutcome) -> Result<(), Failure> {
    if let Some(path) = &show.report {
        output::json_file(path, &outcome.report)?;
    }
    if let Some(directory) = show.capture.as_ref().filter(|_| !outcome.stopped) {
        pictures::write(directory, wall, &outcome.captures)?;
    }
    if show.json {
        output::json(&outcome.report)?;
    } else {
        let report = &outcome.report;
        output::line(format!(
            "{} at {:.1} a second; skew p50 {:.2} ms, p99 {:.2} ms; {}{}",
            output::counted(report.frames as usize, "frame"),
            report.fps,
            report.skew_us.p50 / 1e3,
            report.skew_us.p99 / 1e3,
            if report.converged {
                "the picture has converged"
            } else {
                "the picture was still being refined"
            },
            error_px(report)
        ))?;
    }
    if outcome.stopped && (show.frames.is_some() || show.capture.is_some()) {
        return Err(Failure::failed("the run was stopped before its end"));
    }
    Ok(())
}

/// What is said of the error of the last picture, if it was measured.
fn error_px(report: &Report) -> String {
    let error = &report.error_px;
    error.measured_max.map_or(String::new(), |max_px| {
        format!(
            "; the surface is off by at most {max_px:.2} pixels (τ = {})",
            error.tau
        )
    })
}
