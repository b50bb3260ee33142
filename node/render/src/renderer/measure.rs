//! The oracle over a picture: how far is what was drawn from what should have been, sample by sample.
//! In: the picture drawn last. Out: the largest error in wall pixels, how many triangles the best mesh would have, times
//! of passes. It reads meshes and fused heights back from the device, which drawing never does, and it is slow.

use std::collections::HashSet;
use std::num::NonZero;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use geodesy::{MAX_LEVEL, Tile, TilePosition};
use glam::DVec3;
use shaders::{INVALID_WORD, ResampleUniform, SampleForm, cpu};
use terrain::{Domain, LATTICE_NODES, Vertex};

use crate::error::RenderError;
use crate::geometry::Geometry;
use crate::heights::VertexHeights;
use crate::loaded::LoadedScene;
use crate::meshes::{Mesh, MeshKey};
use crate::process::{Made, Plan, SLOT_SIDE};
use crate::readback::{read_buffer, read_slot};
use crate::refining::Refined;
use crate::renderer::Renderer;

/// The error of a picture over every elevation sample of the leaves that are in view.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorMeasure {
    /// The largest distance in wall pixels between a sample's true place on the screen and the drawn surface's at the
    /// same surface point.
    pub max_px: f64,
    /// Where that is: the leaf and the node.
    pub worst: Option<(Tile, [u16; 2])>,
    /// Samples that were looked at.
    pub samples: u64,
    /// Samples that no triangle covers: holes in the mesh. There must be none.
    pub uncovered: u64,
    /// Triangles of the leaves in view.
    pub triangles: u64,
    /// The τ that the meshes were made for: the scene's, or a multiple of it. 0 where they were not made for any.
    pub tau_px: f64,
}

/// What one pass took on the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassTime {
    /// Name of the pass.
    pub label: &'static str,
    /// Milliseconds.
    pub ms: f64,
}

/// A drawn leaf with what it was made of.
struct DrawnLeaf {
    leaf: Tile,
    mesh: Mesh,
    heights_m: Vec<f64>,
}

impl Renderer {
    /// Measures the picture drawn last, of every eye. Nothing drawn is nothing measured: 0 samples.
    pub fn measure_error(&mut self) -> Result<ErrorMeasure, RenderError> {
        let Some(last) = self.last.take() else {
            return Ok(ErrorMeasure::default());
        };
        let Some(scene) = self.scene.take() else {
            self.last = Some(last);
            return Ok(ErrorMeasure::default());
        };
        let mut measure = ErrorMeasure {
            tau_px: last.statistics.achieved_tau_px,
            ..ErrorMeasure::default()
        };
        let mut failed = None;
        for refined in &last.refined {
            let eye = refined.eye;
            match self.drawn_leaves(&scene, refined) {
                Ok(leaves) => {
                    let found =
                        self.measure_leaves(&scene, &leaves, eye, last.view.pixels_per_radian);
                    match found {
                        Ok(mut found) => {
                            found.uncovered += refined.undrawn * LATTICE_NODES as u64;
                            measure.add(&found);
                        }
                        Err(error) => failed = Some(error),
                    }
                }
                Err(error) => failed = Some(error),
            }
        }
        self.scene = Some(scene);
        self.last = Some(last);
        failed.map_or(Ok(measure), Err)
    }

    /// Triangles of the smallest meshes that keep the picture drawn last within τ at every sample, over the same
    /// leaves: what no refinement can do without. Slow.
    pub fn minimum_triangles(&mut self) -> Result<u64, RenderError> {
        let Some(last) = self.last.take() else {
            return Ok(0);
        };
        let Some(scene) = self.scene.take() else {
            self.last = Some(last);
            return Ok(0);
        };
        let mut total = Ok(0);
        for refined in &last.refined {
            let density = last.view.pixels_per_radian;
            let tau_px = if scene.data.refine.is_bounded() {
                last.statistics.achieved_tau_px
            } else {
                scene.data.tau_px
            };
            let found = self.minimum_of(&scene, refined, density, tau_px);
            total = total.and_then(|sum| Ok(sum + found?));
        }
        self.scene = Some(scene);
        self.last = Some(last);
        total
    }

    /// Whether times of passes are taken from now on. What was taken is dropped.
    pub fn time_passes(&mut self, on: bool) {
        self.times = on.then(|| crate::recorder::PassTimes::new(&self.gpu));
    }

    /// What passes took since the last call, in the order of their running.
    pub fn take_pass_times(&mut self) -> Vec<PassTime> {
        self.times
            .as_mut()
            .map(|times| {
                let taken = times.take();
                taken
                    .into_iter()
                    .map(|(label, ms)| PassTime { label, ms })
                    .collect()
            })
            .unwrap_or_default()
    }

    /// The highest ground at a place in metres above the ellipsoid, by the finest data of the shown scene. It reads
    /// files, and waits for them.
    pub fn ground_height_m(
        &self,
        latitude_deg: f64,
        longitude_deg: f64,
    ) -> Result<f64, RenderError> {
        let Some(scene) = &self.scene else {
            return Ok(0.0);
        };
        let normal = geodesy::Ellipsoid::normal(latitude_deg, longitude_deg);
        let place = TilePosition::of_normal(normal, MAX_LEVEL).tile;
        let mut samples = vec![[None; 4]; scene.elevation_layers.len()];
        for (slot, layer) in samples.iter_mut().zip(&scene.elevation_layers) {
            let Some(source) = scene.source(*layer) else {
                continue;
            };
            let Some(best) = source.best(place) else {
                continue;
            };
            let read = source
                .data
                .read_now(best)
                .map_err(|error| RenderError::Layer {
                    layer: scene.data.layers[*layer].name.clone(),
                    reason: error.to_string(),
                })?;
            let Some(data) = read else { continue };
            let within = TilePosition::of_normal(normal, best.level());
            let (i, j) = (within.i.floor() as i64, within.j.floor() as i64);
            for (sample, (di, dj)) in slot.iter_mut().zip([(0, 0), (1, 0), (0, 1), (1, 1)]) {
                *sample = data.height(i + di, j + dj);
            }
        }
        let heights = VertexHeights::new(scene);
        let relations = scene.relations(place);
        let corner = |corner: usize| {
            let samples: Vec<Option<i32>> = samples.iter().map(|slot| slot[corner]).collect();
            heights.at(scene, &relations, normal, &samples)
        };
        Ok((0..4).map(corner).fold(f64::NEG_INFINITY, f64::max))
    }

    /// The meshes of an eye's visible leaves and the true heights under them.
    fn drawn_leaves(
        &mut self,
        scene: &LoadedScene,
        refined: &Refined,
    ) -> Result<Vec<DrawnLeaf>, RenderError> {
        let mut leaves = Vec::with_capacity(refined.drawn.len());
        for (leaf, key) in &refined.drawn {
            let (Some(mesh), Some(place)) = (self.mesh_of(*key), refined.place(*leaf)) else {
                return Err(RenderError::Mesh(format!(
                    "the mesh of tile {leaf} was drawn and is gone"
                )));
            };
            let heights_m = self.true_heights(scene, refined, place)?;
            leaves.push(DrawnLeaf {
                leaf: *leaf,
                mesh,
                heights_m,
            });
        }
        Ok(leaves)
    }

    fn mesh_of(&mut self, key: MeshKey) -> Option<Mesh> {
        self.meshes.get(key, self.frame)
    }

    /// The fused heights of a leaf's nodes in metres: the processed samples as they are, on the border those that the
    /// leaves around it agree on.
    fn true_heights(
        &mut self,
        scene: &LoadedScene,
        refined: &Refined,
        place: usize,
    ) -> Result<Vec<f64>, RenderError> {
        let mut heights_m = vec![0.0; LATTICE_NODES];
        let (Some(Some(geometry)), Some((tile, plan)), Some(leaf)) = (
            refined.geometries.get(place),
            refined.plans.get(place),
            refined.domain.get(place),
        ) else {
            return Ok(heights_m);
        };
        if let Some(words) = self.fused_words(scene, plan, *tile, *leaf)? {
            let side = SLOT_SIDE as usize;
            for (y, row) in heights_m.chunks_mut(geodesy::NODES as usize).enumerate() {
                for (x, height_m) in row.iter_mut().enumerate() {
                    let word = words.get((y + 9) * side + x + 9).copied();
                    let word = word.unwrap_or(INVALID_WORD);
                    if word != INVALID_WORD {
                        *height_m = f64::from(f32::from_bits(word));
                    }
                }
            }
        }
        if let Some(node) = heights_m.iter().position(|height_m| !height_m.is_finite()) {
            return Err(RenderError::Mesh(format!(
                "the fused height at node {node} of tile {leaf} is not finite: correct the layers' parameters"
            )));
        }
        set_border(
            &mut heights_m,
            geometry,
            refined.coarser.get(place).copied().unwrap_or_default(),
        );
        Ok(heights_m)
    }

    /// The fused heights on a leaf's lattice as the device has them, made anew where they are not kept.
    fn fused_words(
        &mut self,
        scene: &LoadedScene,
        plan: &Plan,
        tile: Tile,
        leaf: Tile,
    ) -> Result<Option<Vec<u32>>, RenderError> {
        let Some(root) = plan.key() else {
            return Ok(None);
        };
        self.processor.begin();
        let made = self
            .processor
            .make_root(&self.gpu, scene, &self.cache, plan)?;
        self.processor.submit(&self.gpu);
        if made != Made::Whole {
            return Err(RenderError::Mesh(format!(
                "the elevation of tile {tile} has left memory: its error cannot be measured. Raise ram_mib"
            )));
        }
        let Some(slot) = self.processor.slot(root) else {
            return Ok(None);
        };
        let words = read_slot(&self.gpu, &slot.texture)?;
        if tile == leaf {
            return Ok(Some(words));
        }
        let shift = u32::from(leaf.level().saturating_sub(tile.level()));
        let along = |leaf: u32, data: u32| {
            let first = (i64::from(leaf) - (i64::from(data) << shift)) * geodesy::CELLS;
            i32::try_from(first).unwrap_or_default()
        };
        let uniform = ResampleUniform {
            origin: [along(leaf.x(), tile.x()), along(leaf.y(), tile.y())],
            shift,
            form: SampleForm::Number as u32,
        };
        Ok(Some(cpu::resample::run(&uniform, &[&words])))
    }

    fn measure_leaves(
        &self,
        scene: &LoadedScene,
        leaves: &[DrawnLeaf],
        eye: DVec3,
        pixels_per_radian: f64,
    ) -> Result<ErrorMeasure, RenderError> {
        let ellipsoid = &scene.data.ellipsoid;
        let bytes = read_buffer(&self.gpu, &self.meshes.vertices)?;
        let vertices: Vec<Vertex> = bytes
            .chunks_exact(Vertex::BYTES)
            .filter_map(Vertex::from_bytes)
            .collect();
        let bytes = read_buffer(&self.gpu, &self.meshes.indices)?;
        let indices: Vec<u32> = bytes
            .chunks_exact(4)
            .filter_map(|word| word.try_into().ok().map(u32::from_le_bytes))
            .collect();
        let next = AtomicUsize::new(0);
        let total = Mutex::new(ErrorMeasure::default());
        let work = || {
            let mut own = ErrorMeasure::default();
            while let Some(drawn) = leaves.get(next.fetch_add(1, Ordering::Relaxed)) {
                let mesh = &drawn.mesh;
                let first = mesh.first_vertex as usize;
                let vertices = vertices.get(first..first + mesh.vertices as usize);
                let first = mesh.first_index as usize;
                let indices = indices.get(first..first + mesh.indices as usize);
                let found = terrain::measure(
                    ellipsoid,
                    drawn.leaf,
                    &drawn.heights_m,
                    vertices.unwrap_or_default(),
                    indices.unwrap_or_default(),
                    eye,
                    pixels_per_radian,
                );
                own.add(&ErrorMeasure {
                    max_px: found.max_px,
                    worst: Some((drawn.leaf, found.worst)),
                    samples: found.samples,
                    uncovered: found.uncovered,
                    triangles: u64::from(mesh.indices / 3),
                    tau_px: 0.0,
                });
            }
            if let Ok(mut total) = total.lock() {
                total.add(&own);
            }
        };
        let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(work);
            }
        });
        Ok(total.into_inner().unwrap_or_default())
    }

    fn minimum_of(
        &mut self,
        scene: &LoadedScene,
        refined: &Refined,
        pixels_per_radian: f64,
        tau_px: f64,
    ) -> Result<u64, RenderError> {
        let mut heights = Vec::with_capacity(refined.domain.len());
        for place in 0..refined.domain.len() {
            heights.push(self.true_heights(scene, refined, place)?);
        }
        let heights: Vec<&[f64]> = heights.iter().map(Vec::as_slice).collect();
        let domain = Domain::new(&refined.selection, &refined.domain);
        let ellipsoid = &scene.data.ellipsoid;
        let marks = terrain::minimum(
            &domain,
            ellipsoid,
            &heights,
            refined.eye,
            pixels_per_radian,
            tau_px,
        );
        let drawn: HashSet<Tile> = refined.drawn.iter().map(|(leaf, _)| *leaf).collect();
        let of_drawn = refined
            .domain
            .iter()
            .zip(&marks)
            .filter(|(leaf, _)| drawn.contains(leaf));
        Ok(of_drawn
            .map(|(_, marks)| terrain::triangles(marks).len() as u64)
            .sum())
    }
}

impl ErrorMeasure {
    /// Adds what was found elsewhere. A measure that is no number counts as worse than any.
    fn add(&mut self, found: &Self) {
        let worse = found.max_px.is_nan() || found.max_px > self.max_px || self.worst.is_none();
        if found.samples > 0 && worse {
            self.max_px = found.max_px;
            self.worst = found.worst;
        }
        self.samples += found.samples;
        self.uncovered += found.uncovered;
        self.triangles += found.triangles;
    }
}

/// The border's heights. An edge beside a coarser leaf belongs to that leaf: its odd nodes are no samples, the surface
/// there is straight between those of the coarser lattice.
fn set_border(heights_m: &mut [f64], geometry: &Geometry, coarser: u8) {
    let last = geodesy::CELLS as u16;
    let positions = terrain::border_positions();
    for ([x, y], height_m) in positions.iter().zip(&geometry.ground.border_m) {
        let (x, y) = (*x, *y);
        let edges = [x == 0, x == last, y == 0, y == last];
        let odd = x % 2 == 1 || y % 2 == 1;
        let beside_coarser = (0..)
            .zip(edges)
            .any(|(bit, on)| on && coarser >> bit & 1 == 1);
        if let Some(node) =
            heights_m.get_mut(usize::from(y) * geodesy::NODES as usize + usize::from(x))
        {
            *node = if odd && beside_coarser {
                f64::NAN
            } else {
                *height_m
            };
        }
    }
}
