//! Which finished results the visible leaves show, and which are made in this frame.
//!
//! In: leaves, what pools and caches hold. Out: per leaf a tile and a layer of each array; jobs run within the frame's
//! budget, coarse levels first. What is not there yet is replaced by the finest ancestor's result, never by one of
//! other parameters.

use std::collections::HashSet;
use std::sync::Arc;

use geodesy::Tile;
use glam::DVec3;
use tiles::Lookup;

use crate::error::RenderError;
use crate::gather::Gather;
use crate::process::{Finish, Made, Plan, Work};
use crate::source::Source;

/// Jobs after which a fast device is waited for, so that the budget counts its time too.
const JOBS_AT_ONCE: u32 = 8;

/// What a leaf shows: a tile and its layer in each array; none for bare and flat ground.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Shown {
    pub(crate) heights: Option<(Tile, u32)>,
    pub(crate) colours: Option<(Tile, u32)>,
}

/// A result that can be made now.
struct Job {
    tile: Tile,
    heights: bool,
    plan: Arc<Plan>,
}

/// Where a result is.
enum Found {
    /// In a layer.
    Ready,
    /// Nothing is to be seen there.
    Bare,
    /// It can be made.
    Possible(Arc<Plan>),
    /// Its data is on its way.
    Waiting,
}

impl Gather<'_> {
    /// Finds or makes what the leaves show, in their order.
    pub(crate) fn show(&mut self, eye: DVec3, leaves: &[Tile]) -> Result<Vec<Shown>, RenderError> {
        let scene = self.scene;
        let mut jobs = Vec::new();
        for heights in [true, false] {
            let mut wanted: Vec<Tile> = leaves
                .iter()
                .filter_map(|leaf| {
                    if heights {
                        scene.heights_tile(*leaf)
                    } else {
                        scene.colours_tile(*leaf)
                    }
                })
                .collect();
            wanted.sort_unstable();
            wanted.dedup();
            let mut roots = HashSet::new();
            for tile in wanted {
                match self.find(eye, tile, heights) {
                    Found::Ready | Found::Bare => continue,
                    Found::Possible(plan) => jobs.push(Job {
                        tile,
                        heights,
                        plan,
                    }),
                    Found::Waiting => {}
                }
                // Until then an ancestor stands in; at least the coarsest must be there.
                let root = tile.ancestor(0);
                if self.stand_in(tile, heights).is_none()
                    && root != tile
                    && roots.insert(root)
                    && let Some(plan) = self.plan_of_root(eye, root, heights)
                {
                    jobs.push(Job {
                        tile: root,
                        heights,
                        plan,
                    });
                }
            }
        }
        self.run_jobs(jobs)?;
        let mut shown = Vec::with_capacity(leaves.len());
        for leaf in leaves {
            shown.push(Shown {
                heights: scene
                    .heights_tile(*leaf)
                    .and_then(|tile| self.now(tile, true)),
                colours: scene
                    .colours_tile(*leaf)
                    .and_then(|tile| self.now(tile, false)),
            });
        }
        Ok(shown)
    }

    /// Where the result for a tile is. Wishes for data that it lacks.
    fn find(&mut self, eye: DVec3, tile: Tile, heights: bool) -> Found {
        let scene = self.scene;
        let plan = scene.plan(tile, heights);
        let Some(key) = plan.key() else {
            return Found::Bare;
        };
        if self.layer(key, heights).is_some() {
            return Found::Ready;
        }
        let mut waiting = false;
        let mut sources = None;
        for index in self.processor.missing(&plan) {
            let Some(Work::Upload { layer, source, .. }) =
                plan.nodes.get(index).map(|node| &node.work)
            else {
                continue;
            };
            let Some(data) = scene.source(*layer) else {
                continue;
            };
            let found = self.cache.get(data.id, *source);
            match &found {
                Lookup::Ready(_) => {
                    let key = (data.id, *source);
                    self.arrivals.wanted(key, true, self.frame);
                }
                Lookup::Pending => waiting = true,
                Lookup::Away(_) | Lookup::Failed(_) | Lookup::Absent => {
                    // The layer shows coarser data until a later try succeeds.
                    let sources = sources.get_or_insert_with(|| scene.best_sources(tile));
                    let works = |tile: &Tile| {
                        !matches!(
                            self.cache.get(data.id, *tile),
                            Lookup::Away(_) | Lookup::Failed(_) | Lookup::Absent
                        )
                    };
                    if let Some(slot) = sources.get_mut(*layer) {
                        *slot = source.lineage().find(works);
                    }
                }
            }
            let urgency = self.urgency(eye, *source);
            self.want(data, *source, &found, urgency);
        }
        match sources {
            _ if waiting => Found::Waiting,
            None => Found::Possible(plan),
            Some(sources) => self.find_without(eye, tile, heights, &sources),
        }
    }

    /// The same where some data cannot be had.
    fn find_without(
        &mut self,
        eye: DVec3,
        tile: Tile,
        heights: bool,
        sources: &[Option<Tile>],
    ) -> Found {
        let scene = self.scene;
        let plan = Arc::new(scene.plan_with(tile, heights, sources));
        let Some(key) = plan.key() else {
            return Found::Bare;
        };
        if self.layer(key, heights).is_some() {
            self.broken.insert((tile, heights), key);
            return Found::Ready;
        }
        let mut waiting = false;
        for index in self.processor.missing(&plan) {
            if let Some(Work::Upload { layer, source, .. }) =
                plan.nodes.get(index).map(|node| &node.work)
                && let Some(data) = scene.source(*layer)
            {
                let found = self.cache.get(data.id, *source);
                waiting |= !matches!(found, Lookup::Ready(_));
                let urgency = self.urgency(eye, *source);
                self.want(data, *source, &found, urgency);
            }
        }
        if waiting {
            return Found::Waiting;
        }
        self.broken.insert((tile, heights), key);
        Found::Possible(plan)
    }

    /// A way to the coarsest result that can be gone now: if need be without the layers whose data is still on its way,
    /// since one slow layer must not keep all others from being seen.
    fn plan_of_root(&mut self, eye: DVec3, root: Tile, heights: bool) -> Option<Arc<Plan>> {
        match self.find(eye, root, heights) {
            Found::Possible(plan) => return Some(plan),
            Found::Ready | Found::Bare => return None,
            Found::Waiting => {}
        }
        let scene = self.scene;
        let mut sources = scene.best_sources(root);
        for (source, data) in sources.iter_mut().zip(&scene.sources) {
            let there = |tile: &Tile| {
                data.as_ref()
                    .is_some_and(|data| matches!(self.cache.get(data.id, *tile), Lookup::Ready(_)))
            };
            *source = source.filter(there);
        }
        let plan = Arc::new(scene.plan_with(root, heights, &sources));
        let key = plan.key()?;
        self.broken.insert((root, heights), key);
        self.layer(key, heights).is_none().then_some(plan)
    }

    /// Runs jobs within the frame's budget, coarse levels first.
    fn run_jobs(&mut self, mut jobs: Vec<Job>) -> Result<(), RenderError> {
        jobs.sort_by_key(|job| (job.tile.level(), !job.heights, job.tile));
        let software = self.gpu.is_software();
        let mut unwaited = 0;
        for job in jobs {
            if !self.may_upload() {
                self.behind = true;
                break;
            }
            let Some(key) = job.plan.key() else { continue };
            let pool = if job.heights {
                &mut self.textures.relief
            } else {
                &mut self.textures.imagery
            };
            let Some(layer) = pool.lend(key, self.frame) else {
                self.behind = true;
                continue;
            };
            let arrays = &self.textures.arrays;
            let finish = if job.heights {
                Finish::Relief {
                    arrays: &arrays.relief_view,
                    layer,
                }
            } else {
                Finish::Surface {
                    arrays: &arrays.imagery_view,
                    layer,
                }
            };
            let made = self.processor.run(
                self.gpu,
                self.scene,
                self.cache,
                &job.plan,
                &finish,
                self.steps_left.as_mut(),
            )?;
            self.worked = true;
            if made != Made::Whole {
                let pool = if job.heights {
                    &mut self.textures.relief
                } else {
                    &mut self.textures.imagery
                };
                pool.take_back(key);
                self.behind = true;
                continue;
            }
            tracing::trace!(
                tile = %job.tile,
                heights = job.heights,
                steps = job.plan.nodes.len(),
                "a result was made"
            );
            self.note_used(&job.plan);
            self.statistics.processed_tiles += 1;
            unwaited += 1;
            if self.steps_left.is_none() && (software || unwaited == JOBS_AT_ONCE) {
                self.gpu.wait()?;
                unwaited = 0;
            }
        }
        Ok(())
    }

    /// Data that a result was made of counts as used.
    pub(crate) fn note_used(&mut self, plan: &Plan) {
        for node in &plan.nodes {
            if let Work::Upload { layer, source, .. } = &node.work
                && let Some(data) = self.scene.source(*layer)
            {
                self.note_drawable(data, *source);
            }
        }
    }

    /// A tile's data was brought to the device or into a mesh.
    pub(crate) fn note_drawable(&mut self, data: &Source, tile: Tile) {
        self.shown.push(data.number(tile));
        let cache = self.cache;
        self.arrivals
            .drawable((data.id, tile), || cache.level(data.id, tile));
    }

    /// What a leaf shows of a tile's result: the result, or its finest ancestor's.
    fn now(&mut self, tile: Tile, heights: bool) -> Option<(Tile, u32)> {
        let key = match self.broken.get(&(tile, heights)) {
            Some(key) => *key,
            None => self.scene.plan(tile, heights).key()?,
        };
        match self.layer(key, heights) {
            Some(layer) => Some((tile, layer)),
            None => {
                self.statistics.converged = false;
                self.stand_in(tile, heights)
            }
        }
    }

    /// The finest ancestor whose result is there.
    fn stand_in(&mut self, tile: Tile, heights: bool) -> Option<(Tile, u32)> {
        let scene = self.scene;
        tile.lineage().skip(1).find_map(|ancestor| {
            let best = scene.plan(ancestor, heights).key();
            let stands = self.broken.get(&(ancestor, heights)).copied();
            let mut keys = best.into_iter().chain(stands);
            Some((ancestor, keys.find_map(|key| self.layer(key, heights))?))
        })
    }

    fn layer(&mut self, key: (Tile, u64), heights: bool) -> Option<u32> {
        let pool = if heights {
            &mut self.textures.relief
        } else {
            &mut self.textures.imagery
        };
        pool.get(key, self.frame)
    }
}
