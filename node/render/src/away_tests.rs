//! Repositories that cannot be reached: what is drawn meanwhile, and that it is as it should be once they are back.
//! In: the made-up planet, its repositories behind a switch. Out: verdicts on statistics and pixels.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::error::Error;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use geodesy::Tile;
use tiles::{Kind, OpenDataset, Opener, Repository, Source, SourceError};

use crate::canvas::PixelRect;
use crate::renderer::{FrameStatistics, Renderer, ViewPoint};
use crate::scene::SceneData;
use crate::target::Picture;
use crate::test_planet::{CANVAS, Planet, output, picture, settle, views};

/// Draws that change nothing after which a picture is taken for settled, 10 ms apart: longer than the loader rests.
const STILL: u32 = 150;
const SOON: Duration = Duration::from_secs(60);

/// Whether nothing but roots can be had of elevation and of imagery.
#[derive(Default)]
struct Outage {
    heights: AtomicBool,
    colours: AtomicBool,
}

struct Behind(Arc<Outage>);

struct BehindSource {
    repository: Repository,
    outage: Arc<Outage>,
}

impl Opener for Behind {
    fn open(&self, place: &Path) -> Result<OpenDataset, Box<dyn Error + Send + Sync>> {
        let repository = Repository::open(place)?;
        let (dataset, index) = (repository.dataset().clone(), repository.load_index()?);
        let outage = Arc::clone(&self.0);
        let source = Box::new(BehindSource { repository, outage });
        Ok(OpenDataset::new(dataset, index, source))
    }
}

impl Source for BehindSource {
    fn fetch(&self, tile: Tile) -> Result<Option<Vec<u8>>, SourceError> {
        let away = match self.repository.dataset().kind {
            Kind::Elevation => &self.outage.heights,
            _ => &self.outage.colours,
        };
        if tile.level() > 0 && away.load(Ordering::SeqCst) {
            let (place, source) = (tile.to_string(), io::ErrorKind::ConnectionRefused.into());
            return Err(SourceError { place, source });
        }
        self.repository.fetch(tile)
    }
}

/// Draws until nothing changes.
fn still(renderer: &mut Renderer, view: &ViewPoint) -> (FrameStatistics, Picture) {
    let (begin, mut still) = (Instant::now(), 0);
    loop {
        let statistics = renderer.draw(view, 1).unwrap();
        still = if statistics.redrawn { 0 } else { still + 1 };
        if still == STILL {
            return (statistics, picture(renderer));
        }
        assert!(begin.elapsed() < SOON, "it never rests: {statistics:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn others_are_seen_meanwhile_and_nothing_is_missing_afterwards() {
    let Some(planet) = Planet::new() else { return };
    let [width, height] = CANVAS;
    let outputs = [output(PixelRect {
        x: 0,
        y: 0,
        width,
        height,
    })];
    let view = &views()[1];
    let reference = {
        let mut renderer = planet.renderer(&outputs, 256 << 20);
        settle(&mut renderer, view);
        picture(&renderer)
    };
    let outage = Arc::new(Outage::default());
    outage.heights.store(true, Ordering::SeqCst);
    outage.colours.store(true, Ordering::SeqCst);
    let opener = Arc::new(Behind(Arc::clone(&outage)));
    let mut renderer = planet.renderer_with(&outputs, 256 << 20, opener);

    let (coarse, coarse_picture) = still(&mut renderer, view);
    assert!(
        !coarse.converged && coarse.pending_tiles > 0 && coarse.drawn_tiles > 0,
        "{coarse:?}"
    );
    assert!(coarse_picture.rgba != reference.rgba);

    // The heights come in all their detail while the colours are away.
    outage.heights.store(false, Ordering::SeqCst);
    let (half, half_picture) = still(&mut renderer, view);
    assert!(!half.converged && half.pending_tiles > 0, "{half:?}");
    assert!(half.pending_tiles < coarse.pending_tiles, "{half:?}");
    assert!(half_picture.rgba != coarse_picture.rgba && half_picture.rgba != reference.rgba);

    // The operator changes the scene: nobody waits for the repository.
    let darker = SceneData {
        light: crate::scene::Light {
            ambient: 0.05,
            ..planet.scene().light
        },
        ..planet.scene()
    };
    renderer.prepare_scene(2, darker).unwrap();
    let begin = Instant::now();
    while renderer.draw(view, 1).unwrap().prepared != Some(2) {
        assert!(begin.elapsed() < SOON, "the next scene is never prepared");
        std::thread::sleep(Duration::from_millis(2));
    }

    // Nothing has been given up, however often it was asked for in vain.
    outage.colours.store(false, Ordering::SeqCst);
    let whole = settle(&mut renderer, view);
    assert_eq!(whole.pending_tiles, 0);
    assert!(picture(&renderer).rgba == reference.rgba);
}
