//! How an import tells how far it is.
//! In: phases and steps. Out: a bar on standard error, or whatever the caller makes of them. It never influences
//! the work.

use std::sync::Mutex;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Hears how an import goes. Called from many threads.
pub trait Progress: Sync {
    /// A new phase begins: its name, and the number of steps it will take.
    fn phase(&self, name: &str, total: u64);
    /// So many more steps of the phase are done.
    fn advance(&self, steps: u64);
    /// Something worth a line: what is resumed, discarded, left out.
    fn note(&self, line: &str);
}

/// Hears nothing.
pub struct Silent;

impl Progress for Silent {
    fn phase(&self, _name: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn note(&self, _line: &str) {}
}

/// A progress bar with the time left, on standard error. Where that is no terminal, only the notes appear.
pub struct Bar {
    current: Mutex<Option<ProgressBar>>,
}

impl Bar {
    /// A bar that appears with the first phase.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            current: Mutex::new(None),
        }
    }

    fn with(&self, action: impl FnOnce(&mut Option<ProgressBar>)) {
        let mut current = self
            .current
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        action(&mut current);
    }
}

impl Default for Bar {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.with(|current| {
            if let Some(bar) = current.take() {
                bar.finish_and_clear();
            }
        });
    }
}

impl Progress for Bar {
    fn phase(&self, name: &str, total: u64) {
        self.with(|current| {
            if let Some(bar) = current.take() {
                bar.finish_and_clear();
            }
            let bar = ProgressBar::new(total);
            let template = "{msg:24} [{bar:32}] {pos}/{len} {elapsed}, {eta} left";
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.set_message(name.to_owned());
            bar.enable_steady_tick(Duration::from_millis(250));
            *current = Some(bar);
        });
    }

    fn advance(&self, steps: u64) {
        self.with(|current| {
            if let Some(bar) = current {
                bar.inc(steps);
            }
        });
    }

    fn note(&self, line: &str) {
        self.with(|current| match current {
            Some(bar) if !bar.is_hidden() => bar.println(line),
            _ => eprintln!("{line}"),
        });
    }
}
