//! Numbers for scenes that never repeat, though those of masters do.
//! In: revisions as views bear them. Out: the renderer's number of a view's scene. A new master counts anew,
//! and the last one's picture stays until then: the renderer must not take one's revision for the other's.

use protocol::scene::Sun;

/// A scene that the renderer has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Known {
    /// Its number for the master.
    pub(crate) revision: u64,
    /// Its number for the renderer.
    pub(crate) number: u64,
    /// Where its light comes from.
    pub(crate) sun: Sun,
    /// The side of tiles in wall pixels that it asks for.
    pub(crate) tile_px: f64,
}

/// The scenes that the renderer has.
#[derive(Debug, Default)]
pub(crate) struct KnownScenes {
    shown: Option<Known>,
    preparing: Option<Known>,
    last_number: u64,
}

impl KnownScenes {
    /// The number that the next scene is to have.
    pub(crate) fn next_number(&self) -> u64 {
        self.last_number + 1
    }

    /// The renderer has taken a scene under [`Self::next_number`].
    pub(crate) fn taken(&mut self, revision: u64, sun: Sun, tile_px: f64) {
        self.last_number += 1;
        self.preparing = Some(Known {
            revision,
            number: self.last_number,
            sun,
            tile_px,
        });
    }

    /// The scene of views of this revision. Of two, the later is the present master's.
    pub(crate) fn of_revision(&self, revision: u64) -> Option<Known> {
        let mut known = self.preparing.iter().chain(&self.shown);
        known.find(|known| known.revision == revision).copied()
    }

    /// The renderer shows this scene.
    pub(crate) fn drawn(&mut self, known: Known) {
        self.shown = Some(known);
        if self
            .preparing
            .is_some_and(|scene| scene.number == known.number)
        {
            self.preparing = None;
        }
    }

    /// The revision of the scene in preparation, if it is the one that the renderer calls so.
    pub(crate) fn preparing(&self, number: Option<u64>) -> Option<u64> {
        let scene = self
            .preparing
            .filter(|scene| number == Some(scene.number))?;
        Some(scene.revision)
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        reason = "a test that panics has failed"
    )]

    use super::*;

    #[test]
    fn a_new_master_may_count_like_the_last_one() {
        let mut scenes = KnownScenes::default();
        assert_eq!(scenes.of_revision(1), None);
        scenes.taken(1, Sun::Camera, 257.0);
        scenes.drawn(scenes.of_revision(1).unwrap());
        scenes.taken(2, Sun::Camera, 257.0);
        assert_eq!(scenes.preparing(Some(2)), Some(2));
        scenes.drawn(scenes.of_revision(2).unwrap());
        assert_eq!(scenes.of_revision(1), None, "it is shown no longer");
        assert_eq!(scenes.preparing(Some(2)), None);

        // Another master, whose second scene has the number of the one that is shown.
        let fixed = Sun::Fixed {
            latitude_deg: 1.0,
            longitude_deg: 2.0,
        };
        assert_eq!(scenes.next_number(), 3);
        scenes.taken(2, fixed, 257.0);
        let found = scenes.of_revision(2).unwrap();
        assert_eq!((found.number, found.sun), (3, fixed));
        assert_eq!(scenes.preparing(Some(2)), None, "the last master's");
        assert_eq!(scenes.preparing(Some(3)), Some(2));
        scenes.drawn(found);
        assert_eq!(scenes.of_revision(2), Some(found));
    }
}
