//! The tables and plots of `bench refine`.
//!
//! In: its figures. Out: tables on standard output, two plots after Lambers (2011), figures 3.10 and 3.11. It computes
//! nothing that is not in the figures.

use crate::failure::Failure;
use crate::output;
use crate::plot::{Plot, Series};

use super::figures::{Figures, MOST_COST, MOST_TRIANGLES, SEED, SecondFigures};

/// Prints every second, the passes of one picture, and the sums.
pub(crate) fn print(figures: &Figures) -> Result<(), Failure> {
    let Figures {
        width,
        height,
        tau_px,
        frames,
        adapter,
        ..
    } = figures;
    output::line(format!(
        "{width}×{height}, τ = {tau_px} px, {frames} pictures a second of the sequence, fewer of brute force; {adapter}\n\
         reused: creation and refinement with what earlier pictures left; anew: of every leaf; drawing: with meshes that \
         are there; frame: until the picture has settled, loading and fusion included. Milliseconds a picture."
    ))?;
    seconds(figures)?;
    passes(figures)?;
    sums(figures)
}

fn seconds(figures: &Figures) -> Result<(), Failure> {
    let mut rows = Vec::new();
    for method in &figures.methods {
        for second in &method.seconds {
            let whole = second.whole.as_ref();
            let cell = |value: Option<f64>, digits: usize| {
                value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
            };
            let drawn = |value: f64| (second.frames > 0).then_some(value);
            let ratio = whole.and_then(|whole| {
                let minimum = whole.minimum_triangles.filter(|minimum| *minimum > 0)?;
                Some(whole.triangles as f64 / minimum as f64)
            });
            rows.push(vec![
                method.method.to_owned(),
                second.second.to_string(),
                second.phase.to_owned(),
                cell(drawn(second.reused_ms), 2),
                cell(whole.map(|whole| whole.anew_ms), 2),
                cell(whole.map(|whole| whole.drawing_ms), 1),
                cell(drawn(second.frame_ms), 1),
                cell(whole.map(|whole| whole.triangles as f64), 0),
                cell(whole.map(|whole| whole.error_px.measured_max), 3),
                cell(ratio, 3),
            ]);
        }
    }
    let head = [
        "method",
        "s",
        "phase",
        "reused",
        "anew",
        "drawing",
        "frame",
        "triangles",
        "error px",
        "× minimum",
    ];
    output::table(&head, &rows)?;
    for method in &figures.methods {
        for second in &method.seconds {
            if let Some(failed) = &second.failed {
                output::line(format!(
                    "{}, second {}: {failed}",
                    method.method, second.second
                ))?;
            }
        }
    }
    Ok(())
}

/// Ours on the left, and on the right what Lambers (2011), table 3.1, says of another scene, planet and machine.
fn passes(figures: &Figures) -> Result<(), Failure> {
    let Some(table) = &figures.passes else {
        return Ok(());
    };
    output::line(format!(
        "\nPasses of {} at second {}, everything made anew; beside them the seed's example scene on its GTX 285",
        table.method, table.second
    ))?;
    let seed_ms: f64 = SEED.iter().map(|(_, ms)| ms).sum();
    let ours = table.passes.iter().map(|pass| {
        [
            pass.label.clone(),
            pass.runs.to_string(),
            format!("{:.3}", pass.ms),
            format!("{:.0} %", pass.share * 100.0),
        ]
    });
    let seeds = SEED.iter().map(|(label, ms)| {
        [
            (*label).to_owned(),
            format!("{ms:.1}"),
            format!("{:.0} %", ms / seed_ms * 100.0),
        ]
    });
    let (mut ours, mut seeds) = (ours.fuse(), seeds.fuse());
    let mut rows: Vec<Vec<String>> = Vec::new();
    loop {
        let (left, right) = (ours.next(), seeds.next());
        if left.is_none() && right.is_none() {
            break;
        }
        let left = left.unwrap_or_default();
        rows.push(left.into_iter().chain(right.unwrap_or_default()).collect());
    }
    rows.push(vec![
        "total".to_owned(),
        String::new(),
        format!("{:.3}", table.total_ms),
        "100 %".to_owned(),
        "total".to_owned(),
        format!("{seed_ms:.1}"),
        "100 %".to_owned(),
    ]);
    output::table(
        &["pass", "runs", "ms", "share", "seed's task", "ms", "share"],
        &rows,
    )
}

fn sums(figures: &Figures) -> Result<(), Failure> {
    let percent = |ratio: Option<f64>| {
        ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{:.1} %", ratio * 100.0))
    };
    let times =
        |ratio: Option<f64>| ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{ratio:.3}"));
    let rows: Vec<Vec<String>> = figures
        .sums
        .iter()
        .map(|sums| {
            vec![
                sums.method.to_owned(),
                sums.pictures.to_string(),
                format!("{:.2}", sums.anew_ms),
                format!("{:.2}", sums.reused_ms),
                format!("{:.2}", sums.reused_max_ms),
                format!("{:.1}", sums.drawing_ms),
                format!("{:.0}", sums.triangles),
                percent(sums.anew_ratio),
                percent(sums.reused_ratio),
                times(sums.triangles_ratio),
                times(sums.triangles_ratio_max),
            ]
        })
        .collect();
    output::line("\nMeans over the sequence")?;
    let head = [
        "method",
        "pictures",
        "anew",
        "reused",
        "max",
        "drawing",
        "triangles",
        "anew ÷ fine",
        "reused ÷ fine",
        "× minimum",
        "worst",
    ];
    output::table(&head, &rows)?;
    let error = &figures.error_px;
    output::line(format!(
        "÷ fine: creation, refinement and drawing over those of brute force, in pictures that both have: everything made \
         anew, and with what earlier pictures left (asked: at most {:.0} %). × minimum: triangles over those of the \
         smallest mesh, in all pictures and in the worst (asked: at most {MOST_TRIANGLES}).\n\
         error of refined meshes: {:.3} px at most where τ is {} px (kept: {}), {} samples in {} pictures, {} not covered",
        MOST_COST * 100.0,
        error.measured_max,
        error.tau,
        error.achieved_tau,
        error.samples,
        error.views,
        error.uncovered,
    ))
}

/// Frame rates by second, as in figure 3.10.
pub(crate) fn rates(figures: &Figures) -> Plot {
    plot(
        figures,
        "Frame rates by method",
        "pictures a second (logarithmic)",
        &|second| (second.frames > 0).then(|| 1e3 / second.frame_ms),
    )
}

/// Creation and refinement of every mesh by second, as in figure 3.11.
pub(crate) fn times(figures: &Figures) -> Plot {
    plot(
        figures,
        "Mesh creation and refinement on the device, nothing being used again",
        "ms a picture (logarithmic)",
        &|second| second.whole.as_ref().map(|whole| whole.anew_ms),
    )
}

fn plot(
    figures: &Figures,
    title: &str,
    y_label: &str,
    value: &dyn Fn(&SecondFigures) -> Option<f64>,
) -> Plot {
    let series = figures.methods.iter().map(|method| Series {
        name: method.method.to_owned(),
        points: method
            .seconds
            .iter()
            .map(|second| (f64::from(second.second), value(second).unwrap_or(f64::NAN)))
            .collect(),
    });
    Plot {
        title: format!(
            "{title}, {}×{}, {}",
            figures.width, figures.height, figures.adapter
        ),
        x_label: "second of the sequence".to_owned(),
        y_label: y_label.to_owned(),
        series: series.collect(),
    }
}
