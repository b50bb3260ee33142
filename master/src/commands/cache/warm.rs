//! `terrawall cache warm`: a wall's disk cache holds what a scene's camera path shows before anybody looks.
//!
//! In: a wall, a scene, steps of its path. Out: the tiles on the disk, and a summary that says of each that is not there
//! why. One host after the other, each with the outputs that it has on the wall; nothing is drawn.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use node::{
    Fetched, FetchedTile, Level, Picture, PictureMaker as _, PictureRequest, WallPictureMaker,
};
use protocol::message::View;
use protocol::wall::Viewers;
use protocol::{Camera, Scene, Wall};
use serde::Serialize;

use crate::args::WarmCache;
use crate::failure::Failure;
use crate::{interrupt, output};

use super::super::{files, local, show};
use super::{bar, homeless, megabytes};

/// How often Ctrl-C is looked at and the bar moved.
const GLANCE: Duration = Duration::from_millis(200);
/// A repository from which nothing comes and nothing fails for so long is not waited for.
const PATIENCE: Duration = Duration::from_secs(120);
/// Views of one path.
const MOST_VIEWS: f64 = 1e6;
/// Tiles that are named when they cannot be had.
const MOST_NAMED: usize = 20;
/// A cache holds other things too: what is advised beyond what is needed.
const RESERVE: f64 = 1.25;
const MIB: u64 = 1 << 20;
/// The only scene of each picture.
const REVISION: u64 = 1;

/// What came of it.
#[derive(Debug, Default, Serialize)]
struct Summary {
    directory: PathBuf,
    hosts: usize,
    /// Views of the path, for each host.
    views: usize,
    /// Different tiles that are needed and were had.
    tiles: u64,
    /// Bytes of their files.
    bytes: u64,
    /// Reads from repositories.
    repository_reads: u64,
    /// Tiles that had not to be read from a repository.
    already_there: u64,
    /// Tiles that came and are not on the disk now.
    not_kept: u64,
    failed: Vec<FailedTile>,
}

#[derive(Debug, Serialize)]
struct FailedTile {
    tile: String,
    reason: String,
}

/// What has come so far.
#[derive(Default)]
struct Brought {
    known: HashSet<u64>,
    tiles: Vec<FetchedTile>,
    bytes: u64,
    failed: HashMap<u64, FailedTile>,
    repository_reads: u64,
}

/// Why a flight ended before its end.
enum Stopped {
    /// By Ctrl-C.
    Interrupted,
    /// What came is more than the budget.
    Full,
}

/// Warms.
pub(super) fn run(args: &WarmCache) -> Result<(), Failure> {
    let (mut wall, scene) = (files::wall(&args.wall)?, files::scene(&args.scene)?);
    show::close_windows(&mut wall);
    let directory = node::cache::directory(&wall).ok_or_else(homeless)?;
    let times = times(&scene.camera, args)?;
    local::check_repositories(&scene)?;
    // Nothing is drawn: this machine need not have what the wall's hosts have.
    let mut maker = WallPictureMaker::open(None)?.with_one_adapter();
    let viewers = node::viewers(&wall)?;
    let bar = bar("views [{bar:40}] {pos}/{len} {eta} left {msg}");
    bar.set_length((times.len() * wall.hosts.len()) as u64);
    let mut brought = Brought::default();
    let mut flown = 0_u32;
    let mut stopped = None;
    for (host, of_wall) in wall.hosts.iter().enumerate() {
        let mut picture = maker.make(PictureRequest {
            wall: &wall,
            host,
            windows: vec![None; of_wall.outputs.len()],
        })?;
        picture.prepare_scene(REVISION, &scene)?;
        let mut flight = Flight {
            host: &of_wall.name,
            picture: &mut *picture,
            viewers: &viewers,
            budget_bytes: wall.cache.disk_mib.saturating_mul(MIB),
            bar: &bar,
        };
        for time_s in &times {
            stopped = flight.bring(&scene, *time_s, &mut brought)?;
            if stopped.is_some() {
                break;
            }
            flown += 1;
            bar.inc(1);
        }
        brought.repository_reads += picture.counters().repository_reads;
        if stopped.is_some() {
            break;
        }
        // Here it goes, and waits until its last copies are written.
    }
    bar.finish_and_clear();
    let all = times.len() * wall.hosts.len();
    let mut summary = brought.finish(directory);
    (summary.hosts, summary.views) = (wall.hosts.len(), times.len());
    if args.json {
        output::json(&summary)?;
    } else {
        summary.print()?;
    }
    match stopped {
        Some(Stopped::Interrupted) => Err(Failure::failed(format!(
            "stopped after {flown} of {all} views; what has come stays, and the same command goes on from there"
        ))),
        Some(Stopped::Full) => {
            let expected = summary.bytes as f64 * all as f64 / f64::from(flown.max(1));
            Err(Failure::failed(format!(
                "stopped after {flown} of {all} views: the tiles that have come are more than cache.disk_mib = {} allows; \
                 write about disk_mib = {} under [cache] in {}, or warm a shorter path with --seconds",
                wall.cache.disk_mib,
                advised_mib(expected),
                args.wall.display()
            )))
        }
        None => summary.verdict(&wall, &args.wall),
    }
}

/// MiB that hold so many bytes, with a reserve.
fn advised_mib(bytes: f64) -> u64 {
    (bytes * RESERVE / MIB as f64).ceil() as u64
}

/// The moments of the path at which views are taken: its end is always one of them.
fn times(camera: &Camera, args: &WarmCache) -> Result<Vec<f64>, Failure> {
    let seconds = args.seconds.unwrap_or_else(|| length_s(camera));
    let steps = (seconds / args.step).ceil();
    if steps >= MOST_VIEWS {
        return Err(Failure::configuration(format!(
            "a path of {seconds} s in steps of {} s has more than {MOST_VIEWS} views; write a longer --step or fewer \
             --seconds",
            args.step
        )));
    }
    let steps = steps as u32;
    let times = (0..=steps).map(|step| (f64::from(step) * args.step).min(seconds));
    Ok(times.collect())
}

/// How long a camera takes to have shown everything.
fn length_s(camera: &Camera) -> f64 {
    match camera {
        Camera::Fixed(_) => 0.0,
        Camera::Orbit(orbit) if orbit.degrees_per_second == 0.0 => 0.0,
        Camera::Orbit(orbit) => 360.0 / orbit.degrees_per_second.abs(),
        Camera::Path(path) => path.keyframes.last().map_or(0.0, |last| last.time_s),
    }
}

/// One host's flight.
struct Flight<'f> {
    /// Its name.
    host: &'f str,
    picture: &'f mut dyn Picture,
    viewers: &'f Viewers,
    budget_bytes: u64,
    bar: &'f ProgressBar,
}

impl Flight<'_> {
    /// Brings what one moment of the path shows.
    fn bring(
        &mut self,
        scene: &Scene,
        time_s: f64,
        brought: &mut Brought,
    ) -> Result<Option<Stopped>, Failure> {
        let view = View {
            epoch: 0,
            frame: 0,
            scene_revision: REVISION,
            wall_revision: 0,
            sent_us: 0,
            pose: scene.camera.pose(&scene.planet, time_s),
            viewers: self.viewers.clone(),
            settle: false,
            previous_swap: None,
        };
        let mut last_news = Instant::now();
        loop {
            if interrupt::requested() {
                return Ok(Some(Stopped::Interrupted));
            }
            let fetched = self.picture.fetch(&view, &brought.known, GLANCE)?;
            let waiting = fetched.waiting;
            for trouble in self.picture.take_troubles() {
                let host = self.host;
                self.bar
                    .suspend(|| eprintln!("terrawall: {host}: {trouble}"));
            }
            if brought.take(fetched) {
                last_news = Instant::now();
            }
            self.bar.set_message(format!(
                "{} tiles, {}",
                brought.tiles.len(),
                megabytes(brought.bytes)
            ));
            if brought.bytes > self.budget_bytes {
                return Ok(Some(Stopped::Full));
            }
            if waiting == 0 {
                return Ok(None);
            }
            if last_news.elapsed() > PATIENCE {
                return Err(Failure::failed(format!(
                    "{waiting} tiles of the view at {time_s} s are on their way, and none has come for {PATIENCE:?}; \
                     check the repositories, and try again: what has come stays"
                )));
            }
        }
    }
}

impl Brought {
    /// Notes what has come. Says whether there was anything new.
    fn take(&mut self, fetched: Fetched) -> bool {
        let mut news = false;
        for tile in fetched.tiles {
            if self.known.insert(tile.number) {
                self.failed.remove(&tile.number);
                self.bytes = self.bytes.saturating_add(tile.bytes);
                self.tiles.push(tile);
                news = true;
            }
        }
        for failed in fetched.failed {
            let tile = FailedTile {
                tile: failed.tile,
                reason: failed.reason,
            };
            news |= self.failed.insert(failed.number, tile).is_none();
        }
        news
    }

    /// Looks for what came on the disk. Nothing may be on its way there any more.
    fn finish(self, directory: PathBuf) -> Summary {
        let mut summary = Summary {
            tiles: self.tiles.len() as u64,
            repository_reads: self.repository_reads,
            ..Summary::default()
        };
        for tile in &self.tiles {
            match std::fs::metadata(directory.join(&tile.file)) {
                Ok(file) => summary.bytes += file.len(),
                Err(_) => {
                    summary.not_kept += 1;
                    summary.bytes += tile.bytes;
                }
            }
            summary.already_there += u64::from(tile.level != Level::Repository);
        }
        summary.failed = self.failed.into_values().collect();
        summary.failed.sort_by(|a, b| a.tile.cmp(&b.tile));
        summary.directory = directory;
        summary
    }
}

impl Summary {
    fn print(&self) -> Result<(), Failure> {
        output::line(format!(
            "{}: {} tiles ({}) of {} views of {} hosts: {} read from repositories, {} already there",
            self.directory.display(),
            self.tiles,
            megabytes(self.bytes),
            self.views,
            self.hosts,
            self.repository_reads,
            self.already_there
        ))?;
        for failed in self.failed.iter().take(MOST_NAMED) {
            output::line(format!("  {}: {}", failed.tile, failed.reason))?;
        }
        if self.failed.len() > MOST_NAMED {
            let more = self.failed.len() - MOST_NAMED;
            output::line(format!("  and {more} more; --json names all of them"))?;
        }
        Ok(())
    }

    fn verdict(&self, wall: &Wall, file: &Path) -> Result<(), Failure> {
        if let Some(first) = self.failed.first() {
            return Err(Failure::failed(format!(
                "{} tiles cannot be had; the first is {}: {}",
                self.failed.len(),
                first.tile,
                first.reason
            )));
        }
        if self.not_kept > 0 {
            return Err(Failure::failed(format!(
                "{} of {} tiles are not on the disk: they need {}, and cache.disk_mib = {} allows {}; if that is too \
                 little, write about disk_mib = {} under [cache] in {}, and if not, another process shares {} with a \
                 smaller budget (`terrawall cache stat`), or the disk takes nothing (RUST_LOG=warn tells)",
                self.not_kept,
                self.tiles,
                megabytes(self.bytes),
                wall.cache.disk_mib,
                megabytes(wall.cache.disk_mib.saturating_mul(MIB)),
                advised_mib(self.bytes as f64).max(1),
                file.display(),
                self.directory.display()
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    fn camera(text: &str) -> Camera {
        let layer = "[layers.relief]\nkind = \"elevation\"\nrepository = \"relief\"\n";
        Scene::parse(&format!("{text}\n{layer}"), "test")
            .unwrap()
            .camera
    }

    fn args(step: f64, seconds: Option<f64>) -> WarmCache {
        WarmCache {
            wall: PathBuf::new(),
            scene: PathBuf::new(),
            step,
            seconds,
            json: false,
        }
    }

    const PLACE: &str = "latitude_deg = 0, longitude_deg = 0, altitude_m = 1e6, pitch_deg = -90";

    #[test]
    fn a_path_is_looked_at_from_end_to_end() {
        let path = camera(&format!(
            "[camera]\nmode = \"path\"\nlooped = false\nkeyframes = [\n\
             {{ time_s = 0, place = {{ {PLACE} }} }},\n{{ time_s = 1.1, place = {{ {PLACE}, heading_deg = 9 }} }} ]\n"
        ));
        let of = |step, seconds| times(&path, &args(step, seconds)).unwrap();
        assert_eq!(of(0.5, None), [0.0, 0.5, 1.0, 1.1]);
        assert_eq!(of(0.5, Some(0.0)), [0.0]);
        assert_eq!(of(0.5, Some(2.0)), [0.0, 0.5, 1.0, 1.5, 2.0]);
        let refused = times(&path, &args(0.1, Some(2e5))).unwrap_err();
        assert!(refused.to_string().contains("--step"), "{refused}");
        let still = camera(&format!(
            "[camera]\nmode = \"fixed\"\nplace = {{ {PLACE} }}\n"
        ));
        assert_eq!(times(&still, &args(0.5, None)).unwrap(), [0.0]);
    }

    #[test]
    fn a_tile_that_comes_late_has_not_failed() {
        let mut brought = Brought::default();
        let failed = node::Unfetched {
            number: 7,
            tile: "tile 0/1".to_owned(),
            reason: "gone".to_owned(),
        };
        let bad = Fetched {
            failed: vec![failed],
            ..Fetched::default()
        };
        assert!(brought.take(bad.clone()) && !brought.take(bad));
        let good = Fetched {
            tiles: vec![FetchedTile {
                number: 7,
                bytes: 10,
                level: Level::Repository,
                file: PathBuf::from("a/b.cached"),
            }],
            ..Fetched::default()
        };
        assert!(brought.take(good.clone()) && !brought.take(good));
        let folder = tempfile::tempdir().unwrap();
        let summary = brought.finish(folder.path().to_owned());
        assert!(summary.failed.is_empty());
        assert_eq!((summary.tiles, summary.bytes, summary.not_kept), (1, 10, 1));
    }
}
