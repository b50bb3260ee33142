//! How the memory on the device is shared out, and how much a view may show for it.
//!
//! In: a budget, what the device can bind. Out: bytes for each kind of thing, leaves and tiles that all eyes may see
//! together, and whether more memory would allow more. It allocates nothing.

use crate::geometry::Geometries;
use crate::textures::SurfaceTextures;

/// The parts of a budget, in bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shares {
    /// What tiles look like.
    pub(crate) textures: u64,
    /// Raw data, and what is made of it on the way.
    pub(crate) processing: u64,
    /// Heights of leaves and their errors.
    pub(crate) geometries: u64,
    /// Meshes.
    pub(crate) meshes: u64,
}

/// How much all eyes may see together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Most {
    /// Leaves and those around them, for their geometries.
    pub(crate) leaves: usize,
    /// Tiles of fused heights or of fused colours.
    pub(crate) tiles: usize,
}

/// What keeps a view from tiles as fine as its scene asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Bound {
    /// Room for geometries.
    Leaves,
    /// Room for what tiles look like.
    Tiles,
    /// A selection has as many leaves as any may have.
    Selection,
}

impl Shares {
    /// Of so many bytes.
    pub(crate) const fn of(gpu_bytes: u64) -> Self {
        let eighth = gpu_bytes / 8;
        Self {
            textures: eighth * 3,
            processing: eighth,
            geometries: eighth * 3,
            meshes: eighth,
        }
    }
}

impl Most {
    /// What fits here.
    pub(crate) fn here(geometries: &Geometries, textures: &SurfaceTextures) -> Self {
        Self::within(geometries.capacity(), textures.most_layers())
    }

    /// What fits on a device that binds as much as a budget of so many bytes asks for.
    pub(crate) fn of_budget(gpu_bytes: u64) -> Self {
        let shares = Shares::of(gpu_bytes);
        let whole = |number: u64| usize::try_from(number).unwrap_or(usize::MAX);
        Self::within(
            whole(Geometries::slots_of(shares.geometries)),
            whole(SurfaceTextures::layers_of(shares.textures)),
        )
    }

    /// Half of it, so that two scenes fit: the shown one and, while it is in preparation, the next one. Layer 0 holds no tile.
    fn within(slots: usize, layers: usize) -> Self {
        Self {
            leaves: slots / 2,
            tiles: layers / 2 - 1,
        }
    }

    /// For as many eyes. Where their neighbours differ, two eyes have a tile each: hence a reserve.
    pub(crate) fn for_eyes(self, eyes: usize) -> Self {
        match eyes {
            0 | 1 => self,
            _ => Self {
                leaves: self.leaves / 5 * 4,
                tiles: self.tiles / 5 * 4,
            },
        }
    }
}

impl Bound {
    /// Whether a larger budget would change nothing.
    pub(crate) fn is_of_device(self, geometries: &Geometries, textures: &SurfaceTextures) -> bool {
        match self {
            Self::Leaves => geometries.is_device_full(),
            Self::Tiles => textures.is_device_full(),
            Self::Selection => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_memory_holds_more_and_all_parts_are_within_it() {
        const MIB: u64 = 1 << 20;
        let mut before = Most::of_budget(0);
        assert!(before.leaves >= 8 && before.tiles >= 8, "the roots fit");
        for mib in [128, 256, 1024, 4096, u64::MAX / MIB] {
            let Shares {
                textures,
                processing,
                geometries,
                meshes,
            } = Shares::of(mib * MIB);
            assert!(textures + processing + geometries + meshes <= mib * MIB);
            let most = Most::of_budget(mib * MIB);
            assert!(most.leaves > before.leaves && most.tiles > before.tiles);
            let two_eyes = most.for_eyes(2);
            assert!(two_eyes.leaves < most.leaves && two_eyes.tiles < most.tiles);
            assert_eq!(most.for_eyes(1), most);
            before = most;
        }
    }
}
