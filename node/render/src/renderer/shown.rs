//! Changes of what outputs are, while they are shown: other plans of the same size, and pictures in place of the scene.
//! In: plans, finished pictures. Out: the renderer with them, to be drawn anew. It draws nothing.

use crate::error::RenderError;
use crate::finish::Finisher;
use crate::outputs::OutputPlan;
use crate::renderer::Renderer;
use crate::target::Picture;

impl Renderer {
    /// Takes other plans for the same outputs, in the same order. Nothing changes where one has another size, or shows
    /// another number of eyes.
    pub fn replace_plans(&mut self, plans: &[OutputPlan]) -> Result<(), RenderError> {
        for ((known, _, _), plan) in self.outputs.iter().zip(plans) {
            if known.size_px != plan.size_px || known.pictures() != plan.pictures() {
                return Err(RenderError::OtherOutputs {
                    output: plan.name.clone(),
                });
            }
        }
        self.finisher = Finisher::new(&self.gpu, plans)?;
        for ((known, _, _), plan) in self.outputs.iter_mut().zip(plans) {
            known.clone_from(plan);
        }
        self.relit = true;
        Ok(())
    }

    /// Shows a picture of the output's size instead of the scene from the next drawing on; `None`: the scene. A picture
    /// of another size is not shown.
    pub fn show_instead(&mut self, output: usize, picture: Option<Picture>) {
        let size = self.outputs.get(output).map(|(plan, _, _)| plan.size_px);
        let picture = picture.filter(|picture| Some([picture.width, picture.height]) == size);
        if picture.is_some() || self.instead.contains_key(&output) {
            self.relit = true;
        }
        match picture {
            Some(picture) => self.instead.insert(output, picture),
            None => self.instead.remove(&output),
        };
    }

    /// Writes the pictures that stand for the scene over what was drawn.
    pub(super) fn write_instead(&self) {
        for (output, picture) in &self.instead {
            let Some((_, target, _)) = self.outputs.get(*output) else {
                continue;
            };
            self.gpu.queue.write_texture(
                target.texture.as_image_copy(),
                &picture.rgba,
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(4 * picture.width),
                    rows_per_image: Some(picture.height),
                },
                target.texture.size(),
            );
        }
    }
}
