//! `terrawall verify WALL --scene SCENE --error`: how far is the drawn surface from the data, at worst?
//!
//! In: a wall and a scene. Out: the error in pixels over views drawn from a seed, and whether the scene's τ bounds it.
//! The wall's outputs are drawn in this process, one host after the other, so that memory holds one host's share.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use node::WallPictureMaker;
use protocol::{Place, Scene, Wall};
use serde_json::Value;

use crate::args::Verify;
use crate::failure::Failure;
use crate::output;

use super::findings::{Findings, Looked};
use super::places::{self, Draws, Wanted};
use super::survey::{Measured, Moment, Survey};
use crate::commands::{files, local};

/// Views from one change of parameters to the next.
const VIEWS_OF_A_CHANGE: usize = 3;
/// Of so many views one is the scene's own, and at least one of all.
const VIEWS_OF_AN_OWN: usize = 4;

/// Measures, writes the report and judges.
pub(super) fn run(args: &Verify) -> Result<(), Failure> {
    let (wall, scene) = (files::wall(&args.wall)?, files::scene(&args.scene)?);
    local::check_repositories(&scene)?;
    let mut findings = Findings::new(
        args.wall.display().to_string(),
        args.scene.display().to_string(),
        args.seed,
        &scene,
    );
    measure(args, &wall, &scene, &mut findings)?;
    if let Some(path) = &args.report {
        output::json_file(path, &findings)?;
    }
    if args.json {
        output::json(&findings)?;
    } else {
        findings.print()?;
    }
    findings.judge(&scene)
}

/// What stands on the outputs of a host.
#[derive(Clone, Default)]
struct Standing {
    /// Height above ground; none for the scene's own views.
    height_m: Option<f64>,
    /// What differs from the scene.
    patch: Value,
}

/// A measured picture, and what it shows.
type Shown = (Standing, Measured);

fn measure(
    args: &Verify,
    wall: &Wall,
    scene: &Scene,
    findings: &mut Findings,
) -> Result<(), Failure> {
    let own = own_views(scene, args.views as usize);
    let bar = progress(args.views, wall.hosts.len());
    let mut maker = WallPictureMaker::open(None)?;
    // Height above ground of each view, and whether any host has ground in view.
    let mut seen: Vec<(Option<f64>, bool)> = vec![(None, false); args.views as usize];
    for (index, host) in wall.hosts.iter().enumerate() {
        let mut survey = Survey::open(&mut maker, wall, index, scene)?;
        let finest = survey.finest_tiles()?;
        let mut standing = Standing::default();
        for (view, seen) in (0..args.views).zip(&mut seen) {
            let mut draws = Draws::new(args.seed, u64::from(view));
            let visited = match own.get(view as usize) {
                Some(place) => own_visit(&mut survey, *place),
                None => {
                    let change = (view as usize - own.len()).is_multiple_of(VIEWS_OF_A_CHANGE);
                    visit(&mut survey, scene, &finest, &mut draws, change, &standing)
                }
            };
            let pictures = visited.map_err(|failure| {
                let what = format!(
                    "view {} of seed {} on host \"{}\"",
                    view + 1,
                    args.seed,
                    host.name
                );
                Failure::Failed(failure.into_error().context(what))
            })?;
            for (shown, measured) in &pictures {
                let looked = Looked {
                    height_m: shown.height_m,
                    host: &host.name,
                    patch: &shown.patch,
                };
                findings.add(looked, measured);
                seen.1 |= measured.moment != Moment::Changing && measured.measure.samples > 0;
            }
            if let Some((last, _)) = pictures.into_iter().last() {
                standing = last;
            }
            seen.0 = standing.height_m;
            let largest = findings.error_px.measured_max.unwrap_or(0.0);
            bar.set_message(format!("largest error {largest:.3} px"));
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    for (height_m, seen) in seen {
        findings.view(height_m, seen);
    }
    Ok(())
}

/// Looks from a place of the scene's own camera.
fn own_visit(survey: &mut Survey, place: Place) -> Result<Vec<Shown>, Failure> {
    let pictures = survey.look(place)?.into_iter();
    Ok(pictures
        .map(|measured| (Standing::default(), measured))
        .collect())
}

/// Changes parameters where it is time to, seen from the last place, and looks from a new one.
fn visit(
    survey: &mut Survey,
    scene: &Scene,
    finest: &[u64],
    draws: &mut Draws,
    change: bool,
    standing: &Standing,
) -> Result<Vec<Shown>, Failure> {
    let mut pictures = Vec::new();
    let mut standing = standing.clone();
    if let (true, Some(patch)) = (change, places::change(draws, scene)) {
        standing.patch = patch;
        let changing = survey.change(&scene.patched(&standing.patch)?)?;
        pictures.extend(changing.map(|measured| (standing.clone(), measured)));
    }
    let wanted = Wanted::draw(draws, scene.planet.semi_major_m, finest);
    let ground_m = survey.ground_m(wanted.latitude_deg, wanted.longitude_deg)?;
    standing.height_m = Some(wanted.height_m);
    for measured in survey.look(wanted.over(ground_m))? {
        pictures.push((standing.clone(), measured));
    }
    Ok(pictures)
}

/// The places of the scene's camera, thinned out where they are many.
fn own_views(scene: &Scene, views: usize) -> Vec<Place> {
    let places = super::places_of(&scene.camera);
    let most = (views / VIEWS_OF_AN_OWN).max(1);
    let step = places.len().div_ceil(most).max(1);
    places.into_iter().step_by(step).collect()
}

fn progress(views: u32, hosts: usize) -> ProgressBar {
    let bar = ProgressBar::new(u64::from(views) * hosts as u64);
    if let Ok(style) = ProgressStyle::with_template("views [{bar:40}] {pos}/{len} {eta} left {msg}")
    {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}
