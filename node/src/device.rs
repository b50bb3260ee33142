//! The outputs of a host that one graphics adapter draws: a renderer and the windows that show its pictures.
//! In: plans, windows, and which of the host's outputs they are. Out: pictures by the host's numbers. It knows no wall.

use std::sync::Arc;

use glam::DVec3;
use render::{
    ErrorMeasure, FrameStatistics, Gpu, OutputPlan, Picture, RenderBudget, RenderError, Renderer,
    TileCache, ViewPoint, WindowSurface,
};
use winit::window::Window;

use crate::picture::OutputImage;

/// One adapter's outputs.
pub(crate) struct Device {
    pub(crate) renderer: Renderer,
    surfaces: Vec<WindowSurface>,
    /// The number of each output among the host's.
    outputs: Vec<usize>,
}

impl Device {
    /// Opens the outputs with these numbers. `plans` and `windows` are those of all the host's outputs.
    pub(crate) fn open(
        gpu: Arc<Gpu>,
        cache: &Arc<TileCache>,
        plans: &[OutputPlan],
        windows: &[Option<Arc<Window>>],
        outputs: Vec<usize>,
        budget: RenderBudget,
    ) -> Result<Self, RenderError> {
        let own = own_plans(plans, &outputs);
        let renderer = Renderer::new(gpu, Arc::clone(cache), &own, budget)?;
        let mut surfaces = Vec::new();
        for (index, (plan, output)) in own.iter().zip(&outputs).enumerate() {
            if let Some(Some(window)) = windows.get(*output) {
                let size = window.inner_size();
                let size = [size.width, size.height];
                let window = Arc::clone(window);
                surfaces.push(WindowSurface::new(
                    &renderer, window, index, &plan.name, size,
                )?);
            }
        }
        Ok(Self {
            renderer,
            surfaces,
            outputs,
        })
    }

    /// Takes other plans for the host's outputs.
    pub(crate) fn replace_plans(&mut self, plans: &[OutputPlan]) -> Result<(), RenderError> {
        let own = own_plans(plans, &self.outputs);
        self.renderer.replace_plans(&own)
    }

    /// Shows a picture instead of the scene on one of the host's outputs, if it is of this adapter.
    pub(crate) fn show_instead(&mut self, output: usize, picture: Option<Picture>) {
        if let Some(own) = self.outputs.iter().position(|number| *number == output) {
            self.renderer.show_instead(own, picture);
        }
    }

    /// Draws a scene of a view, and copies what has changed to the windows, to be shown by [`Device::present`].
    pub(crate) fn draw(
        &mut self,
        view: &ViewPoint,
        scene: u64,
        sun: Option<DVec3>,
    ) -> Result<FrameStatistics, RenderError> {
        // First: the sun is the shown scene's, and this view's on every node.
        self.renderer.show(scene)?;
        if let Some(sun) = sun {
            self.renderer.set_sun(sun);
        }
        let statistics = self.renderer.draw_shown(view, scene)?;
        if statistics.redrawn {
            for surface in &mut self.surfaces {
                surface.prepare(self.renderer.gpu())?;
            }
        }
        Ok(statistics)
    }

    /// Shows what was drawn last.
    pub(crate) fn present(&mut self) {
        for surface in &mut self.surfaces {
            surface.present(self.renderer.gpu());
        }
    }

    /// The finished pictures, with the numbers of their outputs.
    pub(crate) fn pictures(&self) -> Result<Vec<(usize, OutputImage)>, RenderError> {
        let pictures = self.renderer.read_pictures()?.into_iter();
        let images = pictures.map(|(output, picture)| OutputImage {
            output,
            width: picture.width,
            height: picture.height,
            rgba: picture.rgba,
        });
        Ok(self.outputs.iter().copied().zip(images).collect())
    }

    /// The ground under a pixel of one of the host's outputs: latitude and longitude in degrees.
    pub(crate) fn ground_under(&self, output: usize, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let own = self.outputs.iter().position(|number| *number == output)?;
        self.renderer.ground_under(own, pixel)
    }
}

/// The plans of outputs with these numbers.
fn own_plans(plans: &[OutputPlan], outputs: &[usize]) -> Vec<OutputPlan> {
    let own = outputs.iter().filter_map(|output| plans.get(*output));
    own.cloned().collect()
}

/// Which outputs each adapter draws, by the adapter's number; those that name none come first.
pub(crate) fn by_adapter(gpus: &[Option<u32>]) -> Vec<(Option<u32>, Vec<usize>)> {
    let mut groups: Vec<(Option<u32>, Vec<usize>)> = Vec::new();
    for (output, gpu) in gpus.iter().enumerate() {
        match groups.iter_mut().find(|(known, _)| known == gpu) {
            Some((_, outputs)) => outputs.push(output),
            None => groups.push((*gpu, vec![output])),
        }
    }
    groups.sort_by_key(|(gpu, _)| *gpu);
    groups
}

/// What several adapters did in one frame, as one.
pub(crate) fn together(frames: &[FrameStatistics]) -> FrameStatistics {
    let mut sum = FrameStatistics {
        converged: true,
        ..FrameStatistics::default()
    };
    for frame in frames {
        sum.redrawn |= frame.redrawn;
        sum.converged &= frame.converged;
        sum.pending_tiles += frame.pending_tiles;
        sum.triangles += frame.triangles;
        if frame.redrawn {
            sum.refined_leaves += frame.refined_leaves;
        }
        sum.achieved_tau_px = sum.achieved_tau_px.max(frame.achieved_tau_px);
        sum.achieved_tile_px = sum.achieved_tile_px.max(frame.achieved_tile_px);
        sum.is_device_bound |= frame.is_device_bound;
    }
    sum
}

/// The error of the pictures of several adapters: the largest, over all their samples.
pub(crate) fn worst(measures: &[ErrorMeasure]) -> ErrorMeasure {
    let mut all = ErrorMeasure::default();
    for measure in measures {
        // What is no number must not hide behind one.
        let worse = measure.max_px > all.max_px || measure.max_px.is_nan();
        if measure.samples > 0 && (all.samples == 0 || worse) {
            all.max_px = measure.max_px;
            all.worst = measure.worst;
        }
        all.samples += measure.samples;
        all.uncovered += measure.uncovered;
        all.triangles += measure.triangles;
        all.tau_px = all.tau_px.max(measure.tau_px);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_go_to_the_adapters_they_name() {
        let gpus = [Some(1), None, Some(0), None, Some(1)];
        let groups = by_adapter(&gpus);
        assert_eq!(
            groups,
            [
                (None, vec![1, 3]),
                (Some(0), vec![2]),
                (Some(1), vec![0, 4])
            ]
        );
        assert!(by_adapter(&[]).is_empty());
    }

    #[test]
    fn the_worst_error_counts_and_no_number_hides_it() {
        let measure = |max_px: f64, samples: u64| ErrorMeasure {
            max_px,
            samples,
            tau_px: 1.0,
            ..ErrorMeasure::default()
        };
        let all = worst(&[measure(0.5, 10), measure(0.9, 5), measure(0.2, 1)]);
        assert_eq!((all.max_px, all.samples), (0.9, 16));
        assert!(
            worst(&[measure(0.5, 1), measure(f64::NAN, 1)])
                .max_px
                .is_nan()
        );
        assert_eq!(worst(&[]), ErrorMeasure::default());
    }

    #[test]
    fn a_frame_is_complete_when_every_adapter_says_so() {
        let frame = |converged, redrawn, triangles| FrameStatistics {
            converged,
            redrawn,
            triangles,
            refined_leaves: 3,
            ..FrameStatistics::default()
        };
        let both = together(&[frame(true, false, 5), frame(false, true, 7)]);
        assert!(both.redrawn && !both.converged);
        assert_eq!((both.triangles, both.refined_leaves), (12, 3));
    }
}
