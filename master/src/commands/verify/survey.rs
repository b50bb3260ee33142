//! The outputs of one host, drawn in this process from one view after the other, and measured.
//!
//! In: a wall and a host of it, scenes, places. Out: the error of pictures, as they arrive, change and settle. It
//! judges nothing and chooses no place.

use std::time::{Duration, Instant};

use node::{Drawn, ErrorMeasure, Picture, PictureMaker as _, PictureRequest, WallPictureMaker};
use protocol::wall::Viewers;
use protocol::{Place, Scene, View, Wall};

use crate::failure::Failure;
use crate::interrupt;

/// A picture that has not settled by then never will.
const PATIENCE: Duration = Duration::from_secs(180);
/// How long to leave the processors to tiles on their way between two drawings of the same view.
const PAUSE: Duration = Duration::from_millis(1);
/// Pictures a second at most that the renderer is to plan for: slower ones give each more time to prepare.
const MOST_FPS: f64 = 4.0;
/// Numbers of finest tiles to choose places from.
const MOST_TILES: usize = 4_096;

/// When a picture was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Moment {
    /// Right after parameters changed.
    Changing,
    /// As soon as the view was drawn, while its tiles arrive.
    Arriving,
    /// When nothing was missing.
    Settled,
}

impl Moment {
    /// How tables and reports call it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Changing => "changing",
            Self::Arriving => "arriving",
            Self::Settled => "settled",
        }
    }
}

/// A measured picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    pub(super) moment: Moment,
    pub(super) place: Place,
    pub(super) drawn: Drawn,
    pub(super) measure: ErrorMeasure,
}

/// The outputs of a host.
pub(super) struct Survey {
    picture: Box<dyn Picture>,
    viewers: Viewers,
    scene: Scene,
    revision: u64,
    frame: u64,
    place: Option<Place>,
}

impl Survey {
    /// Opens the outputs of a host on an open device, with nothing in memory, to show a scene.
    pub(super) fn open(
        maker: &mut WallPictureMaker,
        wall: &Wall,
        host: usize,
        scene: &Scene,
    ) -> Result<Self, Failure> {
        let mut wall = wall.clone();
        wall.fps = wall.fps.min(MOST_FPS);
        let outputs = wall.hosts.get(host).map_or(0, |host| host.outputs.len());
        let mut picture = maker.make(PictureRequest {
            wall: &wall,
            host,
            windows: vec![None; outputs],
        })?;
        picture.prepare_scene(1, scene)?;
        Ok(Self {
            picture,
            viewers: node::viewers(&wall)?,
            scene: scene.clone(),
            revision: 1,
            frame: 0,
            place: None,
        })
    }

    /// Where the scene's data is finest, as numbers of tiles.
    pub(super) fn finest_tiles(&self) -> Result<Vec<u64>, Failure> {
        Ok(self.picture.finest_tiles(MOST_TILES)?)
    }

    /// The highest ground of the shown scene at a place, metres.
    pub(super) fn ground_m(&self, latitude_deg: f64, longitude_deg: f64) -> Result<f64, Failure> {
        Ok(self.picture.ground_height_m(latitude_deg, longitude_deg)?)
    }

    /// Shows another scene at once, prepared or not, from where the viewer is, and measures that picture.
    pub(super) fn change(&mut self, scene: &Scene) -> Result<Option<Measured>, Failure> {
        self.revision += 1;
        self.picture.prepare_scene(self.revision, scene)?;
        self.scene = scene.clone();
        let Some(place) = self.place else {
            return Ok(None);
        };
        let drawn = self.draw(&place)?;
        self.measure(Moment::Changing, place, drawn).map(Some)
    }

    /// Looks from a place: measures the first picture if anything is missing in it, then the one that stays.
    pub(super) fn look(&mut self, place: Place) -> Result<Vec<Measured>, Failure> {
        let deadline = Instant::now() + PATIENCE;
        self.place = Some(place);
        let mut measured = Vec::new();
        let mut drawn = self.draw(&place)?;
        if !drawn.converged {
            measured.push(self.measure(Moment::Arriving, place, drawn)?);
        }
        while !drawn.converged {
            if Instant::now() > deadline {
                return Err(Failure::failed(format!(
                    "the picture did not settle within {PATIENCE:?}: {} tiles are on their way",
                    drawn.pending_tiles
                )));
            }
            std::thread::sleep(PAUSE);
            drawn = self.draw(&place)?;
        }
        measured.push(self.measure(Moment::Settled, place, drawn)?);
        Ok(measured)
    }

    fn draw(&mut self, place: &Place) -> Result<Drawn, Failure> {
        if interrupt::requested() {
            return Err(Failure::failed("interrupted"));
        }
        self.frame += 1;
        let view = View {
            epoch: 0,
            frame: self.frame,
            scene_revision: self.revision,
            sent_us: 0,
            pose: place.pose(&self.scene.planet),
            wall_revision: 0,
            viewers: self.viewers.clone(),
            settle: false,
            previous_swap: None,
        };
        Ok(self.picture.draw(&view)?)
    }

    fn measure(&mut self, moment: Moment, place: Place, drawn: Drawn) -> Result<Measured, Failure> {
        let measure = self.picture.measure_error()?;
        Ok(Measured {
            moment,
            place,
            drawn,
            measure,
        })
    }
}
