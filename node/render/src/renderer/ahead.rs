//! The next scene: opened, prepared beside the shown one, and shown.
//! In: scenes, moments until which there is time. Out: whether all that the last view needs of the next scene is there.
//! Nothing of it is drawn before [`Renderer::show`].

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{self, TryRecvError};
use std::time::Instant;

use tiles::Kind;

use crate::error::RenderError;
use crate::loaded::LoadedScene;
use crate::renderer::Renderer;
use crate::renderer::blocks::plan_blocks;
use crate::renderer::foresight::Foresight;
use crate::scene::SceneData;
use crate::source::Source;

/// What one call of [`Renderer::prepare_ahead`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AheadStatistics {
    /// The scene in preparation, once everything that the last view needs of it is there.
    pub prepared: Option<u64>,
    /// Results made.
    pub processed_tiles: u32,
}

impl Renderer {
    /// Opens the data sets of a scene that no scene has open, in a thread of its own, for
    /// [`Renderer::prepare_scene`] to find them. True once nothing is left to be waited for; false: ask again. What
    /// cannot be opened is told when the scene is prepared. The first scene is not opened ahead: nobody waits for a
    /// frame yet.
    pub fn open_ahead(&mut self, data: &SceneData) -> bool {
        if self.scene.is_none() {
            return true;
        }
        if let Some(opening) = &self.opening {
            match opening.try_recv() {
                Ok(opened) => self.opened.extend(opened),
                Err(TryRecvError::Empty) => return false,
                // A defect there has its words above; the scene opens its data itself.
                Err(TryRecvError::Disconnected) => {}
            }
            self.opening = None;
            return true;
        }
        let known = self.scene.iter().chain(&self.next);
        let open: Vec<&PathBuf> = known
            .flat_map(|scene| scene.sources.iter().flatten())
            .chain(&self.opened)
            .map(|source| &source.path)
            .collect();
        let wanted: Vec<(String, PathBuf, Kind)> = data
            .layers
            .iter()
            .filter_map(|layer| {
                let path = layer
                    .repository
                    .clone()
                    .filter(|path| !open.contains(&path))?;
                let kind = layer.parameters.process.data_kind()?;
                Some((layer.name.clone(), path, kind))
            })
            .collect();
        if wanted.is_empty() {
            return true;
        }
        let (sender, receiver) = mpsc::channel();
        let (cache, ellipsoid) = (Arc::clone(&self.cache), data.ellipsoid);
        let thread = std::thread::Builder::new().name("opener".to_owned());
        let spawned = thread.spawn(move || {
            let opened = wanted.iter().filter_map(|(layer, path, kind)| {
                Source::open(&cache, layer, path, &ellipsoid, *kind).ok()
            });
            // Nobody hears it where the renderer is gone.
            let _unheard = sender.send(opened.collect());
        });
        match spawned {
            Ok(_) => {
                self.opening = Some(receiver);
                false
            }
            Err(error) => {
                tracing::warn!(%error, "data sets are opened between frames");
                true
            }
        }
    }

    /// Takes a scene. The first is shown at once; a later one is prepared while the shown one is drawn, and takes
    /// the place of another in preparation. Its indices are read at once where neither a scene nor
    /// [`Renderer::open_ahead`] has them open, its tiles when they are looked at. On an error nothing changes.
    pub fn prepare_scene(&mut self, revision: u64, data: SceneData) -> Result<(), RenderError> {
        let known: Vec<&LoadedScene> = self.scene.iter().chain(&self.next).collect();
        let opened = std::mem::take(&mut self.opened);
        let loaded = LoadedScene::open(&self.cache, revision, data, &known, &opened)?;
        if self.scene.is_none() {
            self.scene = Some(loaded);
            self.switched = true;
        } else {
            self.next = Some(loaded);
            self.next_wants.clear();
            self.next_prepared_at = None;
        }
        Ok(())
    }

    /// Shows a scene from the next picture on: the one in preparation, or the one that is shown already.
    pub fn show(&mut self, revision: u64) -> Result<(), RenderError> {
        let is = |scene: &Option<LoadedScene>| {
            scene
                .as_ref()
                .is_some_and(|scene| scene.revision == revision)
        };
        if is(&self.scene) {
            return Ok(());
        }
        if !is(&self.next) {
            return Err(RenderError::UnknownScene { revision });
        }
        let before = std::mem::replace(&mut self.scene, self.next.take());
        self.switched = true;
        // What was to be wanted soon was of the other scene.
        self.foresight = Foresight::default();
        self.wishes.request_ahead(&[]);
        self.next_wants.clear();
        self.next_prepared_at = None;
        // Everything else that a picture is made of is compared with the last one's.
        if let (Some(before), Some(scene)) = (before, &self.scene) {
            let (old, new) = (&before.data, &scene.data);
            self.relit |= (old.light, old.air, old.ellipsoid, old.wireframe)
                != (new.light, new.air, new.ellipsoid, new.wireframe);
        }
        Ok(())
    }

    /// Goes on preparing the next scene for the view drawn last, once after each call of [`Renderer::draw_shown`]: until
    /// this moment, but no longer than the budget allows or, where that is more, a quarter of the time that the last
    /// picture took. It does at least one step, or a slow machine would never finish. Wishes for the tiles that the
    /// viewers will want soon are renewed on the way.
    pub fn prepare_ahead(&mut self, until: Instant) -> Result<AheadStatistics, RenderError> {
        self.look_ahead();
        let Some(view) = self.last.as_ref().map(|last| last.view.clone()) else {
            return Ok(AheadStatistics::default());
        };
        let Some(next) = self.next.take() else {
            return Ok(AheadStatistics::default());
        };
        let arrivals = self.cache.generation();
        if self.next_prepared_at == Some(arrivals) {
            let prepared = Some(next.revision);
            self.next = Some(next);
            return Ok(AheadStatistics {
                prepared,
                processed_tiles: 0,
            });
        }
        // A driver that computes on the processor takes milliseconds for one stage, and much more where others want
        // the processor too. So a few are begun in each frame and nobody waits for them.
        if self.gpu.is_software() && !self.gpu.is_idle()? {
            self.next = Some(next);
            return Ok(AheadStatistics::default());
        }
        let until = until.min(Instant::now() + self.budget.upload.max(self.draw_time / 4));
        let blocks = plan_blocks(&self.outputs, &view);
        let ahead = self.gather(&next, &view, &blocks, until, true);
        let revision = next.revision;
        self.next = Some(next);
        let ahead = ahead?;
        self.next_wants = ahead.wants;
        self.request();
        // What the shown scene waits for as well does not keep the next one back: a viewer in flight always
        // waits for something.
        let prepared = !ahead.behind
            && self
                .last
                .as_ref()
                .is_some_and(|last| ahead.pending.is_subset(&last.pending));
        self.next_prepared_at = prepared.then_some(arrivals);
        Ok(AheadStatistics {
            prepared: prepared.then_some(revision),
            processed_tiles: ahead.statistics.processed_tiles,
        })
    }
}
