//! What of a wall may be changed while it runs: where viewers and screens are, and how bright edges are.
//! In: a running wall, another one out of the same file. Out: the running wall with the other's measures. Pictures keep
//! their sizes and places, so that nothing has to be opened anew.

use super::{Wall, WallError};
use crate::config::{Fault, Problem};

impl Wall {
    /// This wall with the measures of another: observers' heads, looks and eye separations, shapes of screens, gamma and
    /// eyes of outputs, blending but for the width of ramps.
    ///
    /// # Errors
    /// A wall of other observers, screens, outputs or channels, or measures that make no wall.
    pub fn with_measures_of(&self, other: &Self) -> Result<Self, WallError> {
        let unlike = |key: &str| {
            let advice = "the running wall has others; restart it to add, remove or rename any";
            Problem::new(Fault::Name, key, advice).without_origin()
        };
        let names = |wall: &Self| -> Vec<String> {
            let observers = wall.observers.iter().map(|o| format!("o {}", o.name));
            let screens = wall.screens.iter().map(|s| format!("s {}", s.name));
            let outputs = wall.hosts.iter().flat_map(|host| {
                let of_host = |output: &super::Output| {
                    format!("h {} {} {}", host.name, output.name, output.channels.len())
                };
                host.outputs.iter().map(of_host).collect::<Vec<_>>()
            });
            observers.chain(screens).chain(outputs).collect()
        };
        if names(self) != names(other) {
            return Err(unlike("wall"));
        }
        let mut wall = self.clone();
        for (own, new) in wall.observers.iter_mut().zip(&other.observers) {
            own.head_m = new.head_m;
            own.looks_deg = new.looks_deg;
            own.eye_separation_m = new.eye_separation_m;
        }
        for (own, new) in wall.screens.iter_mut().zip(&other.screens) {
            if own.shape.smooth().is_some() != new.shape.smooth().is_some() {
                return Err(unlike("screens"));
            }
            // The points of a file were read when the wall was started.
            if own.shape.smooth().is_some() {
                own.shape = new.shape.clone();
            }
        }
        for (own, new) in wall.hosts.iter_mut().zip(&other.hosts) {
            for (own, new) in own.outputs.iter_mut().zip(&new.outputs) {
                own.gamma = new.gamma;
                own.swap_eyes = new.swap_eyes;
                for (own, new) in own.channels.iter_mut().zip(&new.channels) {
                    own.blend.gamma = new.blend.gamma;
                    own.blend.black_level = new.blend.black_level;
                }
            }
        }
        wall.validate()?;
        Ok(wall)
    }
}
