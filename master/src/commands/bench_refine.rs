//! `terrawall bench refine`: what meshes with a guaranteed error cost over a sequence, beside brute force.
//!
//! In: the imported data. Out: milliseconds, triangles and error of every second by method, passes of one picture,
//! JSON and plots: the test of Lambers (2011), section 3.6, on other mountains. No network takes part.

mod figures;
mod sequence;
mod show;
mod stage;

use std::path::Path;

use node::{PictureMaker as _, WallPictureMaker};

use crate::args::{BenchRefine, RefineMethod};
use crate::failure::Failure;
use crate::{interrupt, output};

pub(crate) use figures::Figures;
use figures::{ErrorPx, MethodFigures, SecondFigures, WholeFigures, pass_table, shares, sums};
use sequence::{Sequence, Touches};
pub(crate) use show::print;
use stage::Stage;

/// Brute force is measured once in so many seconds.
const FINE_EVERY: u32 = 2;

/// Runs the bench, prints its tables and writes its files. An error beyond τ is a failure.
pub(crate) fn run(args: BenchRefine) -> Result<(), Failure> {
    let args = args.settled();
    let figures = measure(&args)?;
    write(&args.out, &figures)?;
    if args.json {
        output::json(&figures)?;
    } else {
        print(&figures)?;
        output::line(format!(
            "Report and plots are refine.json, refine-rates.svg and refine-times.svg in {}",
            args.out.display()
        ))?;
    }
    let error = &figures.error_px;
    if error.views > 0 && !error.holds() {
        return Err(Failure::failed(format!(
            "refined meshes are off by {} pixels where τ is {}, and {} samples lie under no triangle",
            error.measured_max, error.achieved_tau, error.uncovered
        )));
    }
    Ok(())
}

/// Writes the report and the plots.
pub(crate) fn write(out: &Path, figures: &Figures) -> Result<(), Failure> {
    output::json_file(&out.join("refine.json"), figures)?;
    for (name, plot) in [
        ("refine-rates.svg", show::rates(figures)),
        ("refine-times.svg", show::times(figures)),
    ] {
        output::file(&out.join(name), plot.svg_logarithmic().as_bytes())?;
    }
    Ok(())
}

/// Measures every method over the sequence.
pub(crate) fn measure(args: &BenchRefine) -> Result<Figures, Failure> {
    let sequence = Sequence::open(&args.data, args.seconds, f64::from(args.tile_px))?;
    let mut maker = WallPictureMaker::open(None)?;
    let methods = args
        .methods
        .iter()
        .map(|method| measure_method(&mut maker, &sequence, args, *method))
        .collect::<Result<Vec<_>, Failure>>()?;
    let mut error_px = ErrorPx::default();
    for method in methods.iter().filter(|method| method.refine.is_bounded()) {
        error_px.add(&method.error_px);
    }
    Ok(Figures {
        adapter: maker.adapter(),
        width: args.width,
        height: args.height,
        seconds: args.seconds,
        frames: args.frames,
        tau_px: sequence.tau_px(),
        error_px,
        passes: pass_table(&methods),
        sums: sums(&methods),
        methods,
    })
}

/// Runs through the sequence with one method.
fn measure_method(
    maker: &mut WallPictureMaker,
    sequence: &Sequence,
    args: &BenchRefine,
    method: RefineMethod,
) -> Result<MethodFigures, Failure> {
    let mut run = Run {
        stage: Stage::open(maker, [args.width, args.height])?,
        sequence,
        method,
        touches: Touches::default(),
    };
    let interval_s = 1.0 / f64::from(args.frames);
    // The first picture would pay for the compilation of everything. What cannot be drawn is told by those that count.
    let _unmeasured = run.show(interval_s);
    // Brute force is slow: one picture of every other second, after the picture before it in the other methods'
    // sequences, so that it finds as much to use again as they do.
    let (slow, every) = match method {
        RefineMethod::Fine if args.frames > 1 => (true, FINE_EVERY),
        _ => (false, 1),
    };
    let count = ((args.seconds * f64::from(args.frames)) as u32).max(1);
    let mut figures = MethodFigures {
        method: method.name(),
        refine: method,
        error_px: ErrorPx::default(),
        seconds: Vec::new(),
    };
    for first in (0..count).step_by((args.frames * every) as usize) {
        let pictures = if slow { 1 } else { args.frames };
        let times_s: Vec<f64> = (first..count.min(first + pictures))
            .map(|frame| f64::from(frame) * interval_s)
            .collect();
        if slow && first > 0 {
            // What cannot be drawn is told by the picture that counts.
            let _unmeasured = run.show(f64::from(first - 1) * interval_s);
        }
        let second = run.second(first / args.frames, &times_s)?;
        if let Some(whole) = &second.whole {
            figures.error_px.add(&whole.error_px);
        }
        tracing::info!(method = method.name(), second = second.second, ?second.failed, "measured");
        figures.seconds.push(second);
    }
    let failed = figures
        .seconds
        .iter()
        .find_map(|second| second.failed.as_ref());
    match failed {
        // Brute force may be more than a device can hold, and then there is nothing to compare with.
        Some(failed)
            if method != RefineMethod::Fine
                && figures.seconds.iter().all(|second| second.whole.is_none()) =>
        {
            Err(Failure::failed(format!(
                "no picture of \"{}\" came about: {failed}",
                method.name()
            )))
        }
        _ => Ok(figures),
    }
}

/// One method on its way through the sequence.
struct Run<'s> {
    stage: Stage,
    sequence: &'s Sequence,
    method: RefineMethod,
    touches: Touches,
}

impl Run<'_> {
    fn show(&mut self, time_s: f64) -> Result<stage::Settled, Failure> {
        let scene = self.sequence.scene(self.method, time_s, self.touches);
        self.stage.show(&scene, &self.sequence.pose(time_s))
    }

    /// Draws the pictures of one second. Those that cannot be drawn are noted: brute force needs more memory than there
    /// may be.
    fn second(&mut self, second: u32, times_s: &[f64]) -> Result<SecondFigures, Failure> {
        let mut figures = SecondFigures {
            second,
            phase: self
                .sequence
                .phase(times_s.first().copied().unwrap_or_default()),
            ..SecondFigures::default()
        };
        for (index, time_s) in times_s.iter().enumerate() {
            if let Err(failure) = self.picture(*time_s, index == 0, &mut figures) {
                if interrupt::requested() {
                    return Err(failure);
                }
                figures.failed = Some(failure.to_string());
            }
        }
        let drawn = f64::from(figures.frames.max(1));
        figures.reused_ms /= drawn;
        figures.frame_ms /= drawn;
        Ok(figures)
    }

    /// Draws one picture, and looks more closely at that of a whole second.
    fn picture(
        &mut self,
        time_s: f64,
        closely: bool,
        figures: &mut SecondFigures,
    ) -> Result<(), Failure> {
        let settled = self.show(time_s)?;
        let reused_ms = settled.passes.sum_ms();
        figures.frames += 1;
        figures.reused_ms += reused_ms;
        figures.reused_max_ms = figures.reused_max_ms.max(reused_ms);
        figures.frame_ms += settled.frame_ms;
        if !closely {
            return Ok(());
        }
        let measure = self.stage.error()?;
        let error_px = ErrorPx::of(&measure, self.sequence.tau_px());
        let minimum_triangles = match self.method {
            RefineMethod::TopDown => Some(self.stage.minimum_triangles()?),
            _ => None,
        };
        self.touches.light += 1;
        let redrawn = self.show(time_s)?;
        self.touches.elevation += 1;
        let anew = self.show(time_s)?;
        figures.whole = Some(WholeFigures {
            reused_ms,
            anew_ms: anew.passes.sum_ms(),
            passes: shares(&anew.passes),
            drawing_ms: redrawn.last_draw_ms,
            triangles: measure.triangles,
            error_px,
            minimum_triangles,
        });
        Ok(())
    }
}
